//! Which particles of the islands of an implicit step have collided with each other in it.

use bevy::math::{DVec3, Vec3};

use super::Surroundings;
use super::grid::Grid;
use super::material::properties_of;
use crate::solver::elements::Elements;
use crate::solver::graph::Exclusions;
use crate::solver::particles::{Particles, Vectors};

/// The square of the distance, as a part of that at which they touch, below which two particles that touch from the start pass into each
/// other, wherever they are at the end: at more they graze.
const PASSING_DISTANCE: f32 = 0.998;

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
    /// The spheres around the paths: slots, centres and radii, m.
    swept: Vec<(u32, Vec3, f32)>,
    near: Vec<(u32, u32)>,
    /// The pairs that touch: their slots, the direction, and whether they overlapped at the start.
    touching: Vec<([u32; 2], Vec3, bool)>,
    initial_overlaps: Vec<[u32; 2]>,
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
        let Self { grid, exclusions, swept, near, touching, initial_overlaps } = self;
        let covered = surroundings.covered;
        let is_sphere = |slot: usize| particles.radius()[slot] > 0.0 && covered.get(slot) != Some(&true);
        let spheres = slots.filter(|slot| is_sphere(*slot)).map(|slot| {
            let (start, end) = (start.get(slot), particles.position.get(slot));
            (slot as u32, start.midpoint(end), particles.radius()[slot] + 0.5 * start.distance(end))
        });
        swept.clear();
        swept.extend(spheres);
        // Smaller spheres are enlarged: the grid searches each class of size by itself.
        let mean = geometric_mean(swept.iter().map(|(_, _, reach)| *reach));
        let even = swept.iter().map(|(slot, centre, reach)| (*slot, *centre, reach.max(mean)));
        let may_collide = |one, other| is_in_island(one) || is_in_island(other);
        grid.find_pairs(even, (may_collide, |_, _| false), near);
        touching.clear();
        touching.extend(near.iter().filter_map(|&(one, other)| {
            let slots = [one.min(other), one.max(other)];
            let [first, second] = slots.map(|slot| slot as usize);
            let reach = particles.radius()[first] + particles.radius()[second];
            let apart = |vectors: &Vectors| vectors.get(first) - vectors.get(second);
            let normal = touch(apart(start), apart(&particles.position), reach)?;
            Some((slots, normal, apart(start).length_squared() < reach * reach))
        }));
        if touching.is_empty() {
            return;
        }
        let memory = surroundings.memory;
        exclusions.rebuild(particles, elements, &[]);
        initial_overlaps.clear();
        initial_overlaps.extend_from_slice(memory.initial_overlaps());
        initial_overlaps.sort_unstable();
        touching.sort_unstable_by_key(|(slots, ..)| *slots);
        let known = found.len();
        for &(slots, normal, overlapped) in &*touching {
            let is_new = || !slots.iter().all(|slot| memory.has_searched(*slot));
            let layers = slots.map(|slot| properties_of(surroundings.properties, slot as usize).layers);
            let is_excluded = exclusions.contains(slots[0], slots[1])
                || !layers[0].meet(layers[1])
                || (overlapped && (is_new() || initial_overlaps.binary_search(&slots).is_ok()))
                || found[..known].binary_search_by_key(&slots, |pair| pair.slots).is_ok();
            if !is_excluded {
                found.push(StiffPair { slots, normal: normal.as_dvec3().normalize() });
            }
        }
        found.sort_unstable_by_key(|pair| pair.slots);
    }
}

/// About the geometric mean of positive values, for which single large ones hardly count; 0 of none.
fn geometric_mean(values: impl Iterator<Item = f32>) -> f32 {
    // The bits of a float grow about as its logarithm does.
    let (sum, count) =
        values.fold((0, 0), |(sum, count), value| (sum + u64::from(value.to_bits()), count + 1));
    f32::from_bits(u64::checked_div(sum, count).unwrap_or_default() as u32)
}

/// The direction of the separation when it first is as short as `reach` on the straight path from `start` to `end`;
/// that at the start, if it is shorter then, and they stay so or pass into each other. `None` if it never is.
pub(super) fn touch(start: Vec3, end: Vec3, reach: f32) -> Option<Vec3> {
    let outside = start.length_squared() - reach * reach;
    let displacement = end - start;
    let (square, half) = (displacement.length_squared(), start.dot(displacement));
    if outside <= 0.0 {
        let nearest = start + displacement * (-half / square).min(1.0);
        let passes = half < 0.0 && nearest.length_squared() < PASSING_DISTANCE * reach * reach;
        let is_nearer = end.length_squared() < reach * reach;
        return (is_nearer || passes).then(|| if start == Vec3::ZERO { Vec3::Y } else { start });
    }
    // ‖start + t displacement‖² = reach²
    let discriminant = half * half - square * outside;
    if half >= 0.0 || discriminant < 0.0 {
        return None;
    }
    let time = outside / (discriminant.sqrt() - half);
    (time <= 1.0).then(|| start + time * displacement)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mean_is_between_the_values_and_hardly_moved_by_a_large_one() {
        let mean = |values: &[f32]| geometric_mean(values.iter().copied());
        assert_eq!((mean(&[]), mean(&[0.3, 0.3])), (0.0, 0.3));
        assert!((mean(&[0.1, 1.6]) / 0.4 - 1.0).abs() < 0.1);
        let mut values = [0.1; 300];
        values[7] = 1e9;
        assert!(mean(&values) < 0.12);
    }

    #[test]
    fn the_first_touch_on_the_way_counts() {
        assert_eq!(touch(Vec3::X * 3.0, Vec3::X * -3.0, 1.0), Some(Vec3::X), "right through");
        assert_eq!(touch(Vec3::X * 3.0, Vec3::X * 2.0, 1.0), None, "not there yet");
        assert_eq!(touch(Vec3::X * 3.0, Vec3::X * 4.0, 1.0), None, "away");
        assert_eq!(touch(Vec3::new(3.0, 2.0, 0.0), Vec3::new(-3.0, 2.0, 0.0), 1.0), None, "past");
        assert_eq!(touch(Vec3::X * 0.5, Vec3::Y * 0.5, 1.0), Some(Vec3::X * 0.5), "from the start");
        assert_eq!(touch(Vec3::X, Vec3::X * -3.0, 1.0), Some(Vec3::X), "touching, and right through");
        assert_eq!(touch(Vec3::X, Vec3::new(0.9999, 3.0, 0.0), 1.0), None, "touching, and along it");
        assert_eq!(touch(Vec3::X, Vec3::X * 2.0, 1.0), None, "touching, and away");
    }
}
