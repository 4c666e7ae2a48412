//! A rope with a length that changes while it runs: wound up and paid out at its first particle, link by link.
//!
//! The first link outside grows or shrinks with the rope. With EA the stretch stiffness, a link of rest length l has
//! k = EA/l, so that a given strain is a given tension whatever l is. Beyond 1.5 times its full length a particle is
//! released that divides it; below half of it its outer end is wound up. In either case the new links have together the
//! rest length of the old ones, and the particle goes to its place, or from it, within a tick in which the rest lengths
//! change in the same proportion: the strain, and with it the tension, stay. The mass of the rope outside is that of
//! its rest length.
//!
//! What has yielded outside stays so, and is wound up so: a link remembers the plastic strain of what of it is inside, and
//! the first one outside has the mean of its rope.
//!
//! The dampers of the first two links are off: what is held moves otherwise than the rope that comes out there. Bends
//! over the first link are off, too: the rope is hinged at the winch.

use std::ops::Range;

use bevy::math::Vec3;

use super::{Breaking, Layout, Topology, Yielding};
use crate::solver::{Bend, Plasticity, Spring};

/// The first link is divided beyond this multiple of its full length.
const LONGEST: f64 = 1.5;

/// Its outer end is wound up below this part of its full length.
const SHORTEST: f64 = 0.5;

/// How far beside the line what comes out is put, at most, as a part of the way to the next particle: in the middle a quarter of it. The
/// strain is second order in it.
const ASIDE: f32 = 4e-3;

/// A way across `along` that differs from particle to particle by the golden angle, m. No rope comes out of a winch perfectly straight:
/// one that did would stand on the floor as a column that never buckles, and be compressed by all that is paid out.
fn aside(along: Vec3, particle: u32) -> Vec3 {
    let Some(direction) = along.try_normalize() else { return Vec3::ZERO };
    let (first, second) = direction.any_orthonormal_pair();
    let (sin, cos) = bevy::math::ops::sin_cos((particle % 1024) as f32 * 2.399_963);
    (first * cos + second * sin) * (ASIDE * along.length())
}

/// The state of a rope on a winch.
#[derive(Debug, Clone, Default, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
pub struct Spool {
    /// The particles along the rope, from the first one, which is at the winch.
    chain: Vec<u32>,
    /// The links between them.
    links: Vec<Link>,
    /// The bends over each particle of the chain but the first and the last: the number of the rod, if it has one.
    rods: Vec<Option<(u32, Bend<3>)>>,
    /// The masses of the particles of the chain when all is paid out, kg.
    masses: Vec<f32>,
    /// The mass of a metre of rope, kg.
    linear_density: f64,
    /// The number of particles after the first that are held at the winch.
    wound: usize,
    /// The number of the last of these that are on their way out.
    leaving: usize,
    /// The rest length of the rope outside, m.
    length: f64,
}

/// A link when it is all outside.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
struct Link {
    number: u32,
    spring: Spring,
}

impl Link {
    fn length(&self) -> f64 {
        self.spring.rest_length.into()
    }

    /// The same rope, another length of it.
    fn of_length(&self, length: f64) -> Spring {
        let stiffness = f64::from(self.spring.stiffness) * self.length() / length;
        Spring { rest_length: length as f32, stiffness: stiffness as f32, damping: 0.0, ..self.spring }
    }
}

/// Two lengths of rope as one: the mean of their plastic strains.
fn mixed([one, other]: [(Option<Plasticity>, f64); 2]) -> Option<Plasticity> {
    let strain = |plasticity: Option<Plasticity>| plasticity.map_or(0.0, |of| f64::from(of.strain));
    let sum = one.1 * strain(one.0) + other.1 * strain(other.0);
    one.0.or(other.0).map(|of| Plasticity { strain: (sum / (one.1 + other.1)) as f32, ..of })
}

impl Spool {
    /// The spool of a rope that is all paid out; `None` if the net is no open rope of links with a rest length.
    pub fn new(topology: &Topology) -> Option<Self> {
        if topology.layout != (Layout::Rope { is_closed: false }) || topology.positions.len() < 2 {
            return None;
        }
        let chain: Vec<u32> = (0..topology.positions.len() as u32).collect();
        let link = |pair: &[u32]| {
            let mut numbered = (0..).zip(&topology.springs);
            let (number, (_, spring)) = numbered.find(|(_, (ends, _))| ends[..] == *pair)?;
            (spring.rest_length > 0.0).then_some(Link { number, spring: *spring })
        };
        let links: Vec<Link> = chain.windows(2).map(link).collect::<Option<_>>()?;
        let rod = |triple: &[u32]| {
            let mut numbered = (0..).zip(&topology.rods);
            numbered.find(|(_, (ends, _))| ends[..] == *triple).map(|(number, (_, rod))| (number, *rod))
        };
        let rods = chain.windows(3).map(rod).collect();
        let length: f64 = links.iter().map(Link::length).sum();
        let mass: f64 = topology.masses.iter().map(|mass| f64::from(*mass)).sum();
        let inner = f64::from(topology.masses[0]) * 2.0 / links[0].length();
        // A load at the end is none of the rope's own mass.
        let linear_density = inner.min(mass / length);
        let masses = topology.masses.clone();
        Some(Self { chain, links, rods, masses, linear_density, wound: 0, leaving: 0, length })
    }

    /// The rest length of the rope outside, m.
    pub fn length(&self) -> f64 {
        self.length
    }

    /// The least rest length that it can be wound up to, m: half of the last link.
    pub fn min_length(&self) -> f64 {
        SHORTEST * self.links.last().map_or(0.0, Link::length)
    }

    /// The particles that are held at the winch, the first one of the rope among them. Those that are about to leave
    /// it are on their way.
    pub fn held(&self) -> &[u32] {
        &self.chain[..=self.wound]
    }

    /// The first link outside, with the particles at its inner and its outer end: the number of the spring.
    pub fn first_link(&self) -> (u32, [u32; 2]) {
        (self.links[self.wound].number, [self.chain[self.wound], self.chain[self.wound + 1]])
    }

    /// The links outside from the winch on, each with the particles at its inner and its outer end.
    pub(super) fn outside(&self) -> impl Iterator<Item = (u32, [u32; 2])> {
        let ends = self.chain[self.wound..].windows(2).map(|pair| [pair[0], pair[1]]);
        self.links[self.wound..].iter().map(|link| link.number).zip(ends)
    }

    /// The mass of a metre of rope, kg.
    pub(super) fn linear_density(&self) -> f64 {
        self.linear_density
    }

    /// Pays out `by` metres of rope; takes them in if it is negative. To be called once a tick of `time_step` s, before it.
    ///
    /// It changes the parameters of links, bends and masses in the topology. Elements are to go to their new
    /// parameters, and the particles that are [held](Self::held) to their new positions, evenly in the tick; a particle that
    /// is held no more has its new velocity.
    ///
    /// # Panics
    /// If the topology or the motion are not those of this rope.
    pub fn turn(
        &mut self,
        by: f64,
        time_step: f64,
        topology: &mut Topology,
        positions: &mut [Vec3],
        velocities: &mut [Vec3],
    ) {
        self.release(by / time_step, positions, velocities);
        let length = (self.length + by).max(self.min_length());
        self.feed(length - self.length, topology);
        self.length = length;
        while self.first_length() < SHORTEST * self.links[self.wound].length()
            && self.wound + 2 < self.chain.len()
        {
            self.merge(topology);
            self.wound += 1;
        }
        let mut first = self.first_length();
        let mut out = 0;
        // The links beyond the first are as long as they are: what is released divides the first one.
        while self.wound > out && first > LONGEST * self.links[self.wound - out].length() {
            first -= self.links[self.wound - out].length();
            out += 1;
        }
        self.leaving = out;
        // What is divided has the same strain in all its parts.
        let divided = *self.plasticity_mut(self.wound, topology);
        (1..=out).for_each(|link| *self.plasticity_mut(self.wound - link, topology) = divided);
        self.write(topology);
        self.place_held(positions, velocities, time_step as f32);
    }

    /// Adds `count` particles at the inner end, wound up: rope beyond what was laid out. All elements of a rope are
    /// those of its first link.
    pub fn extend(
        &mut self,
        count: usize,
        topology: &mut Topology,
        positions: &mut Vec<Vec3>,
        velocities: &mut Vec<Vec3>,
    ) {
        let mut link = self.links[0];
        link.spring.plasticity = link.spring.plasticity.map(|of| Plasticity { strain: 0.0, ..of });
        let [first, second] = [self.chain[0], self.chain[1]];
        let rod = self.rods.iter().flatten().next().map(|(_, rod)| *rod);
        let numbers = topology.positions.len() as u32..(topology.positions.len() + count) as u32;
        let mass = (self.linear_density * link.length()) as f32;
        for _ in 0..count {
            topology.positions.push(topology.positions[first as usize]);
            topology.masses.push(mass);
            positions.push(positions[first as usize]);
            velocities.push(Vec3::ZERO);
        }
        self.chain.splice(1..1, numbers.clone());
        self.masses.splice(1..1, numbers.map(|_| mass));
        self.masses[0] = 0.5 * mass;
        let spring = topology.springs.len() as u32..(topology.springs.len() + count) as u32;
        let added = spring.map(|number| Link { number, spring: link.spring });
        self.links.splice(0..0, added);
        for (place, link) in self.links[..count].iter().enumerate() {
            topology.springs.push(([self.chain[place], self.chain[place + 1]], link.spring));
        }
        // The old first link goes on from the last of the new particles.
        topology.springs[link.number as usize].0 = [self.chain[count], second];
        self.extend_rods(count, rod, topology);
        self.wound += count;
        self.write(topology);
    }

    fn extend_rods(&mut self, count: usize, rod: Option<Bend<3>>, topology: &mut Topology) {
        let old_first = self.rods.first().copied().flatten();
        self.rods.splice(0..0, std::iter::repeat_n(None, count));
        let Some(rod) = rod else { return };
        if let Some((number, _)) = old_first {
            let ends: Range<usize> = count..count + 3;
            topology.rods[number as usize].0 = std::array::from_fn(|place| self.chain[ends.start + place]);
        }
        for place in 0..count.min(self.chain.len().saturating_sub(2)) {
            self.rods[place] = Some((topology.rods.len() as u32, rod));
            topology.rods.push((std::array::from_fn(|end| self.chain[place + end]), rod));
        }
    }

    /// How what is outside of a link yields, and how far it has.
    fn plasticity_mut<'a>(&self, link: usize, topology: &'a mut Topology) -> &'a mut Option<Plasticity> {
        &mut topology.springs[self.links[link].number as usize].1.plasticity
    }

    /// The plastic strain of the rope that comes out into the first link, `by` metres of it, or goes in.
    fn feed(&mut self, by: f64, topology: &mut Topology) {
        let first = self.first_length();
        // The link of which a part is wound up at the winch, and how much of it.
        let (mut link, mut inside) = (self.wound, self.links[self.wound].length() - first);
        while link > 0 && (inside < 0.0 || inside == 0.0 && by > 0.0) {
            link -= 1;
            inside += self.links[link].length();
        }
        let outside = self.plasticity_mut(self.wound, topology);
        let wound = &mut self.links[link].spring.plasticity;
        if by > 0.0 {
            *outside = mixed([(*outside, first), (*wound, by)]);
        } else if by < 0.0 {
            *wound = mixed([(*wound, inside.max(0.0)), (*outside, -by)]);
        }
    }

    /// The first link becomes a part of the next one.
    fn merge(&self, topology: &mut Topology) {
        let first = (*self.plasticity_mut(self.wound, topology), self.first_length());
        let next = self.plasticity_mut(self.wound + 1, topology);
        *next = mixed([(*next, self.links[self.wound + 1].length()), first]);
    }

    /// The rest length of the first link outside, m.
    fn first_length(&self) -> f64 {
        self.length - self.links[self.wound + 1..].iter().map(Link::length).sum::<f64>()
    }

    /// Frees the particles that have come out, with the velocity of the rope there: what comes out of the winch moves at
    /// `speed`, m/s, stretched as the rope is.
    fn release(&mut self, speed: f64, positions: &[Vec3], velocities: &mut [Vec3]) {
        if self.leaving == 0 {
            return;
        }
        let [winch, outer] = [self.chain[0], self.chain[self.wound + 1]].map(|end| end as usize);
        let way = positions[outer] - positions[winch];
        let first: f64 = self.first_length();
        let comes = velocities[winch] + way * (speed / first) as f32;
        let mut passed = first;
        for _ in 0..self.leaving {
            passed -= self.links[self.wound].length();
            let velocity = comes.lerp(velocities[outer], (passed / first) as f32);
            velocities[self.chain[self.wound] as usize] = velocity;
            self.wound -= 1;
        }
        self.leaving = 0;
    }

    /// A link broke: neither it nor the bends over it come back, whether they are wound up or paid out. Numbers that are no
    /// links count for nothing.
    pub fn break_link(&mut self, number: u32) {
        let Some(place) = self.links.iter().position(|link| link.number == number) else { return };
        let spring = &mut self.links[place].spring;
        (spring.stiffness, spring.damping, spring.breaking_force) = (0.0, 0.0, None);
        for over in place.saturating_sub(1)..=place {
            if let Some(Some((_, rod))) = self.rods.get_mut(over) {
                (rod.stiffness, rod.damping) = (0.0, 0.0);
            }
        }
    }

    /// Gives the links what they bear.
    pub(super) fn give_breaking(&mut self, breaking: &Breaking) {
        for Link { spring, .. } in self.links.iter_mut().filter(|link| link.spring.stiffness > 0.0) {
            spring.breaking_force = breaking.limit(spring);
        }
    }

    /// Gives the links their yield strains.
    pub(super) fn give_yielding(&mut self, yielding: &Yielding) {
        self.links.iter_mut().for_each(|Link { spring, .. }| spring.plasticity = yielding.of(spring));
    }

    /// Gives the elements and masses other parameters, by their numbers and what they are.
    pub(super) fn change_material(
        &mut self,
        spring: impl Fn(u32, Spring) -> Spring,
        rod: impl Fn(u32, Bend<3>) -> Bend<3>,
        mass: impl Fn(u32, f32) -> f32,
    ) {
        self.links.iter_mut().for_each(|link| link.spring = spring(link.number, link.spring));
        self.rods.iter_mut().flatten().for_each(|(number, bend)| *bend = rod(*number, *bend));
        let inner = self.chain[1.min(self.chain.len() - 1)];
        self.linear_density *= f64::from(mass(inner, 1.0));
        self.chain.iter().zip(&mut self.masses).for_each(|(particle, own)| *own = mass(*particle, *own));
    }

    /// Writes what is outside and what is not.
    pub(super) fn write(&self, topology: &mut Topology) {
        let outside = self.wound - self.leaving;
        let first = self.length - self.links[outside + 1..].iter().map(Link::length).sum::<f64>();
        for (place, link) in self.links.iter().enumerate() {
            let spring = &mut topology.springs[link.number as usize].1;
            let damping = if place > self.wound + 1 { link.spring.damping } else { 0.0 };
            // Held at both ends it is taken to where it comes out: that strains nothing.
            let is_leaving = (outside..self.wound).contains(&place);
            let own = link.spring.plasticity.filter(|_| !is_leaving);
            let yield_strain = own.map_or(f32::MAX, |own| own.yield_strain);
            let plasticity = spring.plasticity.map(|of| Plasticity { yield_strain, ..of });
            *spring = match place {
                _ if place < outside => Spring { stiffness: 0.0, damping, rest_length: 0.0, ..link.spring },
                _ if place == outside => link.of_length(first),
                _ => Spring { damping, ..link.spring },
            };
            spring.plasticity = plasticity;
        }
        for (place, rod) in self.rods.iter().enumerate() {
            if let Some((number, rod)) = rod {
                let acts = place > self.wound;
                topology.rods[*number as usize].1 =
                    if acts { *rod } else { Bend { stiffness: 0.0, damping: 0.0, ..*rod } };
            }
        }
        for (particle, mass) in self.chain.iter().zip(&self.masses) {
            topology.masses[*particle as usize] = *mass;
        }
        if outside + 1 < self.chain.len() {
            let more = 0.5 * self.linear_density * (first - self.links[outside].length());
            let mass = f64::from(self.masses[outside + 1]) + more;
            topology.masses[self.chain[outside + 1] as usize] = mass as f32;
        }
    }

    /// Puts what is held to the winch, and what leaves it to where its place along the first link will be after the tick.
    fn place_held(&self, positions: &mut [Vec3], velocities: &[Vec3], time_step: f32) {
        let winch = positions[self.chain[0] as usize];
        let outer = self.chain[self.wound + 1] as usize;
        let outer = positions[outer] + velocities[outer] * time_step;
        let first = self.first_length();
        let mut passed = first;
        for (place, particle) in self.chain[..=self.wound].iter().enumerate().skip(1).rev() {
            let is_leaving = place + self.leaving > self.wound;
            let share = if is_leaving {
                passed -= self.links[place].length();
                passed / first
            } else {
                0.0
            };
            let aside = if is_leaving {
                aside(outer - winch, *particle) * (share * (1.0 - share)) as f32
            } else {
                Vec3::ZERO
            };
            positions[*particle as usize] = winch.lerp(outer, share as f32) + aside;
        }
    }
}
