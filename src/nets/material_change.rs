//! Applies another material to a net that has torn, broken or yielded, or is on a winch; these changes are kept.
//!
//! Recipes lay out elements in proportion to the stiffnesses of their material. So the damage of an element is the ratio of its present
//! parameters to those that it was laid out with (a half along a tear, 0 where it broke), and the new parameters get the same ratio.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::{Breaking, ParticleNet, Topology, Yielding};
use crate::solver::{Bend, Spring};

impl ParticleNet {
    /// Goes on with the parameters of `new` where it had those of `old`: topologies of recipes that differ in what acts
    /// at any time. Returns whether it could; not if `old` is of another net.
    pub(super) fn change_material(&mut self, old: &Topology, new: &Arc<Topology>) -> bool {
        let Some(rest) = self.topology.positions.get(..old.positions.len()) else { return false };
        if rest != old.positions || new.positions.len() != old.positions.len() {
            return false;
        }
        if self.is_as(old) {
            self.topology = Arc::clone(new);
            if self.breaking != Breaking::default() {
                self.give_breaking(self.breaking);
            }
            if self.yielding != Yielding::default() {
                self.give_yielding(self.yielding);
            }
        } else {
            let mut topology = (*self.topology).clone();
            let change = Change::new(old, new, &topology);
            change.carry_out(&mut topology, &self.breaking);
            if self.spool.is_none() {
                change.add_bends(&mut topology);
            }
            if let Some(spool) = &mut self.spool {
                spool.change_material(
                    |number, spring| change.spring(number, spring).unwrap_or(spring),
                    |number, rod| change.rod(number, rod),
                    |particle, mass| change.mass(particle, mass),
                );
                spool.give_breaking(&self.breaking);
                spool.write(&mut topology);
            }
            self.topology = Arc::new(topology);
        }
        self.versions.touch_structure();
        true
    }

    /// Whether nothing has happened to it since it was laid out so, but that it was given what it bears and how it yields.
    fn is_as(&self, laid_out: &Topology) -> bool {
        let plain = |spring: &Spring| {
            let plasticity = spring.plasticity.filter(|plasticity| plasticity.strain != 0.0);
            Spring { breaking_force: None, tears: false, plasticity, ..*spring }
        };
        let Topology { springs, triangles, rods, hinges, .. } = &*self.topology;
        self.spool.is_none()
            && self.broken.is_empty()
            && self.topology.positions.len() == laid_out.positions.len()
            && (springs.len(), rods.len()) == (laid_out.springs.len(), laid_out.rods.len())
            && *triangles == laid_out.triangles
            && *hinges == laid_out.hinges
            && springs
                .iter()
                .zip(&laid_out.springs)
                .all(|((ends, spring), (old_ends, old))| ends == old_ends && plain(spring) == plain(old))
    }
}

/// From one material to another.
struct Change<'a> {
    old: &'a Topology,
    new: &'a Topology,
    /// The particle that each was split from, in the end; itself if it was laid out.
    origin: Vec<u32>,
    /// The springs of both by their ends, in ascending order; empty where both have as many and the net has no more.
    old_springs: BTreeMap<[u32; 2], usize>,
    new_springs: BTreeMap<[u32; 2], usize>,
    /// The origins of the ends of the springs of the net that were added to what was laid out.
    added: Vec<[u32; 2]>,
}

impl<'a> Change<'a> {
    fn new(old: &'a Topology, new: &'a Topology, present: &Topology) -> Self {
        let mut origin: Vec<u32> = (0..present.positions.len() as u32).collect();
        // A winch adds links like the first one.
        origin[old.positions.len()..].fill(u32::from(old.positions.len() > 2));
        for (now, before) in present.triangles.iter().zip(&old.triangles) {
            for (particle, original) in now.iter().zip(before) {
                origin[*particle as usize] = *original;
            }
        }
        let sorted = |ends: [u32; 2]| [ends[0].min(ends[1]), ends[0].max(ends[1])];
        let by_ends = |topology: &Topology| {
            let springs = topology.springs.iter().enumerate();
            springs.map(|(number, (ends, _))| (sorted(*ends), number)).collect()
        };
        let added = present.springs.get(old.springs.len()..).unwrap_or_default();
        let added: Vec<[u32; 2]> =
            added.iter().map(|(ends, _)| sorted(ends.map(|end| origin[end as usize]))).collect();
        let (mut old_springs, mut new_springs) = (BTreeMap::new(), BTreeMap::new());
        if !added.is_empty() || old.springs.len() != new.springs.len() {
            (old_springs, new_springs) = (by_ends(old), by_ends(new));
        }
        Self { old, new, origin, old_springs, new_springs, added }
    }

    fn carry_out(&self, topology: &mut Topology, breaking: &Breaking) {
        for (particle, mass) in topology.masses.iter_mut().enumerate() {
            *mass = self.mass(particle as u32, *mass);
        }
        for (number, (_, spring)) in topology.springs.iter_mut().enumerate() {
            let changed = self.spring(number as u32, *spring);
            *spring = changed.unwrap_or(Spring { stiffness: 0.0, damping: 0.0, ..*spring });
            if spring.breaking_force.is_some() {
                spring.breaking_force = breaking.limit(spring);
            }
        }
        for (number, (_, rod)) in topology.rods.iter_mut().enumerate() {
            *rod = self.rod(number as u32, *rod);
        }
        for (number, (_, hinge)) in topology.hinges.iter_mut().enumerate() {
            *hinge = changed_bend(number as u32, *hinge, &self.old.hinges, &self.new.hinges);
        }
        topology.radius = self.new.radius;
        topology.air = self.new.air;
        topology.ignores_itself = self.new.ignores_itself;
        // What gas it had may have escaped.
        if topology.pressure.is_some() || self.old.pressure.is_none() {
            topology.pressure = self.new.pressure;
        }
    }

    fn mass(&self, particle: u32, mass: f32) -> f32 {
        let original = self.origin[particle as usize] as usize;
        mass * (self.new.masses[original] / self.old.masses[original])
    }

    /// What becomes of a spring; `None` if the new material has none there.
    fn spring(&self, number: u32, present: Spring) -> Option<Spring> {
        let number = number as usize;
        let is_laid_out = number < self.old.springs.len();
        let (old, new) = if is_laid_out && self.new_springs.is_empty() {
            (number, number)
        } else {
            let ends = match number.checked_sub(self.old.springs.len()) {
                // One that a winch added is like the first.
                Some(added) => Some(self.added[added]).filter(|ends| self.old_springs.contains_key(ends)),
                None => None,
            };
            let old = match ends {
                Some(ends) => self.old_springs[&ends],
                None if is_laid_out => number,
                None => 0,
            };
            let ends = self.old.springs[old].0;
            (old, *self.new_springs.get(&[ends[0].min(ends[1]), ends[0].max(ends[1])])?)
        };
        let (old, new) = (&self.old.springs[old].1, &self.new.springs[new].1);
        let share = ratio(present.stiffness, old.stiffness);
        Some(Spring {
            rest_length: present.rest_length,
            stiffness: new.stiffness * share,
            damping: new.damping * share,
            breaking_force: present.breaking_force,
            tears: present.tears,
            plasticity: present.plasticity,
            ..*new
        })
    }

    fn rod(&self, number: u32, present: Bend<3>) -> Bend<3> {
        changed_bend(number, present, &self.old.rods, &self.new.rods)
    }

    /// Gives a net without bends those of its new material, but for those that a tear or a break has to do with; takes
    /// them away where the new material has none.
    fn add_bends(&self, topology: &mut Topology) {
        let mut is_split = vec![false; topology.positions.len()];
        let copies = self.origin.get(self.old.positions.len()..).unwrap_or_default();
        copies.iter().for_each(|particle| is_split[*particle as usize] = true);
        let gone = topology.springs.iter().filter(|(_, spring)| spring.stiffness == 0.0);
        let gone: Vec<[u32; 2]> = gone.map(|(ends, _)| *ends).collect();
        let is_whole = |ends: &[u32]| {
            !ends.iter().any(|end| is_split[*end as usize])
                && !gone.iter().any(|gone| gone.iter().all(|end| ends.contains(end)))
        };
        if self.new.rods.is_empty() {
            topology.rods.clear();
        } else if topology.rods.is_empty() {
            topology.rods.extend(self.new.rods.iter().filter(|(ends, _)| is_whole(ends)));
        }
        if self.new.hinges.is_empty() {
            topology.hinges.clear();
        } else if topology.hinges.is_empty() {
            topology.hinges.extend(self.new.hinges.iter().filter(|(ends, _)| is_whole(ends)));
        }
    }
}

type Bends<const N: usize> = [([u32; N], Bend<N>)];

/// What becomes of a bend. Those that were added are like the first.
fn changed_bend<const N: usize>(number: u32, present: Bend<N>, old: &Bends<N>, new: &Bends<N>) -> Bend<N> {
    let number = if (number as usize) < old.len() { number as usize } else { 0 };
    let Some((_, old)) = old.get(number) else { return present };
    // A material that does not resist bending has no bends.
    let Some((_, new)) = new.get(number) else { return Bend { stiffness: 0.0, damping: 0.0, ..present } };
    let share = ratio(present.stiffness, old.stiffness);
    Bend {
        rest_length: new.rest_length,
        stiffness: new.stiffness * share,
        damping: new.damping * share,
        ..present
    }
}

fn ratio(present: f32, old: f32) -> f32 {
    if old > 0.0 { present / old } else { 1.0 }
}
