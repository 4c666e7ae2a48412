//! Springs with both ends at the same position have no direction: their ends are moved apart.
//!
//! That is done once, before a tick, by a thousandth of the rest length; from then on the force of the spring has a direction. Pinned
//! particles stay, and what hangs from them is moved along gravity, link by link: so a rope that was spawned in one point unfolds
//! downwards. The direction of each spring follows from its number within its island, so that directions differ, and an island moves as
//! it would alone.

use bevy::math::{DVec3, Vec3, ops};

use super::islands::Forest;
use crate::solver::buckets::Buckets;
use crate::solver::elements::{Element, Elements};
use crate::solver::particles::Particles;

/// How far the ends are parted, as a part of the rest length.
const PARTING: f64 = 1e-3;

/// The same in roundings of their coordinates, at least.
const MIN_ROUNDINGS: f64 = 32.0;

/// How far directions differ from gravity: enough that siblings part too.
const TILT: f32 = 0.05;

/// A spring without a direction.
struct CoincidentSpring {
    ends: [u32; 2],
    rest_length: f32,
}

/// Parts the coincident ends of springs with a rest length, and leaves the centre of mass of what is free where it is.
/// Where `is_flat`, along the plane of x and y only.
pub(in crate::solver) fn part_coincident(
    elements: &Elements,
    particles: &mut Particles,
    (gravity, is_flat): (Vec3, bool),
) {
    let springs = find_coincident(elements, particles);
    if springs.is_empty() {
        return;
    }
    let is_held = find_held(elements, particles);
    let mut forest = Forest::new(particles.len());
    for [first, second] in springs.iter().map(|spring| spring.ends.map(|end| end as usize)) {
        if !particles.is_pinned(first) && !particles.is_pinned(second) {
            forest.join(first, second);
        }
    }
    // The clusters, in the order of their first springs.
    let mut cluster_of_root = vec![u32::MAX; particles.len()];
    let mut clusters = 0;
    let cluster_of: Vec<usize> = springs
        .iter()
        .map(|spring| {
            let free = spring.ends.into_iter().find(|end| !particles.is_pinned(*end as usize));
            let root = forest.root(free.expect("a spring that acts on nothing is not among them") as usize);
            if cluster_of_root[root] == u32::MAX {
                cluster_of_root[root] = clusters;
                clusters += 1;
            }
            cluster_of_root[root] as usize
        })
        .collect();
    let mut members = Buckets::default();
    members.fill(clusters as usize, |add| {
        (0..).zip(&cluster_of).for_each(|(spring, cluster)| add(*cluster, spring));
    });
    let offsets = vec![None; particles.len()];
    let mut plan = SeparationPlan { springs: &springs, is_held, offsets, gravity, is_flat };
    for cluster in 0..members.len() {
        let moved = plan.separate(members.of(cluster), particles);
        plan.apply(moved, particles);
    }
}

/// The springs without a direction. Where ends differ, as nearly everywhere, no parameters need be read.
fn find_coincident(elements: &Elements, particles: &Particles) -> Vec<CoincidentSpring> {
    let springs = elements.springs();
    let all = springs.all_ends().iter().zip(springs.elements());
    let coincident = all.filter(|(ends, _)| are_coincident(**ends, particles));
    let found = coincident.filter(|(ends, spring)| {
        let is_pinned = ends.iter().all(|end| particles.is_pinned(*end as usize));
        spring.acts() && spring.length_at_rest() > 0.0 && !is_pinned
    });
    found
        .map(|(ends, spring)| CoincidentSpring { ends: *ends, rest_length: spring.length_at_rest() })
        .collect()
}

/// Which particles are held by springs with a direction.
fn find_held(elements: &Elements, particles: &Particles) -> Vec<bool> {
    let mut is_held = vec![false; particles.len()];
    elements.springs().for_each_acting(|_, ends, _| {
        if !are_coincident(*ends, particles) {
            ends.iter().for_each(|end| is_held[*end as usize] = true);
        }
    });
    is_held
}

fn are_coincident(ends: [u32; 2], particles: &Particles) -> bool {
    let [first, second] = ends.map(|end| particles.position.get(end as usize));
    first == second
}

/// Where the ends of coincident springs go.
struct SeparationPlan<'a> {
    springs: &'a [CoincidentSpring],
    is_held: Vec<bool>,
    /// How far each particle of a cluster is moved, m.
    offsets: Vec<Option<DVec3>>,
    gravity: Vec3,
    is_flat: bool,
}

impl SeparationPlan<'_> {
    /// Parts the ends of the springs of a cluster, from what is held outwards; the particles, in that order.
    fn separate(&mut self, cluster: &[u32], particles: &Particles) -> Vec<u32> {
        let is_root = |end: &u32| particles.is_pinned(*end as usize) || self.is_held[*end as usize];
        let ends = || cluster.iter().flat_map(|spring| self.springs[*spring as usize].ends);
        let mut order: Vec<u32> = ends().filter(is_root).collect();
        if order.is_empty() {
            order.extend(ends().next());
        }
        order.sort_unstable();
        order.dedup();
        order.iter().for_each(|slot| self.offsets[*slot as usize] = Some(DVec3::ZERO));
        // The springs at each particle, by their rank in the cluster; sorted pairs, since clusters are small.
        let mut at: Vec<(u32, usize)> = (0..)
            .zip(cluster)
            .flat_map(|(rank, spring)| self.springs[*spring as usize].ends.map(|end| (end, rank)))
            .collect();
        at.sort_unstable();
        let mut done = 0;
        while let Some(&slot) = order.get(done) {
            done += 1;
            let first = at.partition_point(|(other, _)| *other < slot);
            for &(_, rank) in at[first..].iter().take_while(|(other, _)| *other == slot) {
                let spring = &self.springs[cluster[rank] as usize];
                let other = spring.ends[usize::from(spring.ends[0] == slot)];
                if self.offsets[other as usize].is_none() {
                    let offset = self.offsets[slot as usize].unwrap_or_default();
                    let place = particles.position.get(slot as usize).as_dvec3() + offset;
                    let rounding = f64::from(f32::EPSILON) * place.abs().max_element();
                    let length = (PARTING * f64::from(spring.rest_length)).max(MIN_ROUNDINGS * rounding);
                    self.offsets[other as usize] = Some(offset + length * self.direction(rank));
                    order.push(other);
                }
            }
        }
        order
    }

    /// Along gravity, a little to the side; every rank has another direction. They are those of a sunflower's seeds
    /// on the sphere, and in the plane on the circle.
    fn direction(&self, rank: usize) -> DVec3 {
        /// (√5 − 1) / 2, and the same part of the full circle.
        const GOLDEN: f64 = 0.618_033_988_749_894_9;
        let height = 1.0 - 2.0 * ((rank as f64 + 0.5) * GOLDEN).fract() as f32;
        let (sin, cos) = ops::sin_cos((rank as f64 * GOLDEN * GOLDEN).fract() as f32 * std::f32::consts::TAU);
        let across = (1.0 - height * height).max(0.0).sqrt();
        let own = match self.is_flat {
            true => Vec3::new(cos, sin, 0.0),
            false => Vec3::new(across * cos, height, across * sin),
        };
        (self.gravity.normalize_or_zero() + TILT * own).normalize_or(own).normalize().as_dvec3()
    }

    /// Moves the particles of a cluster.
    fn apply(&mut self, moved: Vec<u32>, particles: &mut Particles) {
        let is_pinned = |slot: &u32| particles.is_pinned(*slot as usize);
        let (mut moment, mut mass) = (DVec3::ZERO, 0.0);
        for &slot in moved.iter().filter(|slot| !is_pinned(slot)) {
            let own = 1.0 / f64::from(particles.inverse_mass()[slot as usize]);
            moment += own * self.offsets[slot as usize].unwrap_or_default();
            mass += own;
        }
        let shift = if moved.iter().any(is_pinned) { DVec3::ZERO } else { moment / mass };
        for slot in moved.into_iter().map(|slot| slot as usize) {
            let offset = self.offsets[slot].take().unwrap_or_default();
            if !particles.is_pinned(slot) {
                let place = particles.position.get(slot).as_dvec3() + offset - shift;
                particles.position.set(slot, place.as_vec3());
            }
        }
    }
}
