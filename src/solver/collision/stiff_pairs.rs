//! Which particles of the islands of an implicit step have collided with each other in it.

use bevy::math::{DVec3, Vec3};

use super::Surroundings;
use super::grid::Grid;
use super::material::skin_of;
use crate::solver::elements::Elements;
use crate::solver::graph::Exclusions;
use crate::solver::particles::{Particles, Vectors};

/// Two particles that are not to come closer than they touch, along a direction that is fixed for a step.
#[derive(Debug, Clone, Copy)]
pub(in crate::solver) struct StiffPair {
    /// The smaller one first.
    pub slots: [u32; 2],
    /// The unit vector from the second to the first when they touched.
    pub normal: DVec3,
}

/// The search for such pairs; its arrays are kept.
#[derive(Debug, Clone, Default)]
pub(in crate::solver) struct StiffPairs {
    grid: Grid,
    exclusions: Exclusions,
    near: Vec<(u32, u32)>,
    entangled: Vec<[u32; 2]>,
}

impl StiffPairs {
    /// Appends to `found` the pairs among the particles in `slots` that have touched on the way from `start` to their
    /// present positions, and are not in it already; not those of which neither `is_in_island`.
    pub fn find(
        &mut self,
        slots: impl Iterator<Item = usize>,
        start: &Vectors,
        particles: &Particles,
        (elements, surroundings): (&Elements, Surroundings),
        is_in_island: impl Fn(u32) -> bool + Sync,
        found: &mut Vec<StiffPair>,
    ) {
        let Self { grid, exclusions, near, entangled } = self;
        let covered = surroundings.covered;
        let is_sphere = |slot: usize| particles.radius()[slot] > 0.0 && covered.get(slot) != Some(&true);
        let spheres = slots.filter(|slot| is_sphere(*slot)).map(|slot| {
            let (start, end) = (start.get(slot), particles.position.get(slot));
            (slot as u32, start.midpoint(end), particles.radius()[slot] + 0.5 * start.distance(end))
        });
        let may_collide = |one, other| is_in_island(one) || is_in_island(other);
        grid.find_pairs(spheres, (may_collide, |_| false), near);
        if near.is_empty() {
            return;
        }
        let memory = surroundings.memory;
        exclusions.rebuild(particles, elements, &[]);
        entangled.clear();
        entangled.extend_from_slice(memory.entangled());
        entangled.sort_unstable();
        near.sort_unstable_by_key(|(one, other)| [*one.min(other), *one.max(other)]);
        let known = found.len();
        for &(one, other) in &*near {
            let slots = [one.min(other), one.max(other)];
            let [first, second] = slots.map(|slot| slot as usize);
            let reach = particles.radius()[first] + particles.radius()[second];
            let apart = |vectors: &Vectors| vectors.get(first) - vectors.get(second);
            let Some(normal) = touch(apart(start), apart(&particles.position), reach) else { continue };
            let overlapped = apart(start).length_squared() < reach * reach;
            let is_new = || !slots.iter().all(|slot| memory.has_searched(*slot));
            let layers = slots.map(|slot| skin_of(surroundings.skins, slot as usize).layers);
            let is_excluded = exclusions.contains(slots[0], slots[1])
                || !layers[0].meet(layers[1])
                || (overlapped && (is_new() || entangled.binary_search(&slots).is_ok()))
                || found[..known].binary_search_by_key(&slots, |pair| pair.slots).is_ok();
            if !is_excluded {
                found.push(StiffPair { slots, normal: normal.as_dvec3().normalize() });
            }
        }
        found.sort_unstable_by_key(|pair| pair.slots);
    }
}

/// The direction of the separation when it first is as short as `reach` on the straight way from `start` to `end`;
/// that at the start, if it is shorter then. `None` if it never is.
fn touch(start: Vec3, end: Vec3, reach: f32) -> Option<Vec3> {
    let outside = start.length_squared() - reach * reach;
    if outside <= 0.0 {
        let is_nearer = end.length_squared() < reach * reach;
        return is_nearer.then(|| if start == Vec3::ZERO { Vec3::Y } else { start });
    }
    // ‖start + t way‖² = reach²
    let way = end - start;
    let (square, half) = (way.length_squared(), start.dot(way));
    let discriminant = half * half - square * outside;
    if half >= 0.0 || discriminant < 0.0 {
        return None;
    }
    let time = outside / (discriminant.sqrt() - half);
    (time <= 1.0).then(|| start + time * way)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_touch_on_the_way_counts() {
        assert_eq!(touch(Vec3::X * 3.0, Vec3::X * -3.0, 1.0), Some(Vec3::X), "right through");
        assert_eq!(touch(Vec3::X * 3.0, Vec3::X * 2.0, 1.0), None, "not there yet");
        assert_eq!(touch(Vec3::X * 3.0, Vec3::X * 4.0, 1.0), None, "away");
        assert_eq!(touch(Vec3::new(3.0, 2.0, 0.0), Vec3::new(-3.0, 2.0, 0.0), 1.0), None, "past");
        assert_eq!(touch(Vec3::X * 0.5, Vec3::Y * 0.5, 1.0), Some(Vec3::X * 0.5), "from the start");
    }
}
