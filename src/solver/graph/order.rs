//! An order of the particles in which elements join close slots, and each island lies in one piece.
//!
//! Ropes, cloths and lattices are made in such an order. A mesh of triangles, or whatever was spawned at
//! random, is not: its springs reach all over memory. The reverse Cuthill–McKee order (Cuthill and McKee,
//! *Reducing the bandwidth of sparse symmetric matrices*, 1969; reversed: George, 1971) numbers the
//! particles outwards from a far end, so that the slots of joined ones lie close.

use super::layout::MIN_BLOCK;
use super::{Blocks, Islands, Neighbours};
use crate::solver::elements::Elements;
use crate::solver::particles::Particles;

/// Springs with at most this distance between their slots find both ends in the first-level cache.
const NEAR: u32 = 256;

/// The particles in a better order, if theirs is bad: the present slot of each place.
pub(in crate::solver) fn better_order(
    elements: &Elements,
    particles: &Particles,
    neighbours: &mut Neighbours,
    islands: &Islands,
) -> Option<Vec<u32>> {
    let is_far = reaches_far(elements, particles);
    if !is_far && are_contiguous(islands, particles) {
        return None;
    }
    neighbours.refresh(elements, particles.len());
    let mut order = match is_far {
        true => reverse_cuthill_mckee(neighbours),
        false => (0..particles.len() as u32).collect(),
    };
    gather_islands(&mut order, islands, neighbours);
    Some(order)
}

/// Whether more than half of the springs are in no run, and join slots that are not near.
fn reaches_far(elements: &Elements, particles: &Particles) -> bool {
    let springs = elements.springs();
    let near = springs.all_ends().iter().filter(|[first, second]| first.abs_diff(*second) <= NEAR).count();
    if particles.len() < MIN_BLOCK || 2 * near >= springs.len() {
        return false;
    }
    2 * Blocks::of(elements.clone(), particles).loose_springs() > springs.len()
}

/// Whether no slot of an island lies among those of another one.
fn are_contiguous(islands: &Islands, particles: &Particles) -> bool {
    let mut done = vec![false; islands.all().len()];
    let mut last = None;
    (0..particles.len()).filter_map(|slot| islands.of(slot)).all(|island| {
        let is_same = last == Some(island);
        if !is_same {
            if let Some(last) = last {
                done[last] = true;
            }
            last = Some(island);
        }
        is_same || !done[island]
    })
}

/// Sorts `order` by island, each where the first of it was; pinned particles go with one that they hold.
fn gather_islands(order: &mut [u32], islands: &Islands, neighbours: &Neighbours) {
    let mut first_place = vec![u32::MAX; islands.all().len()];
    let island_of = |slot: u32| {
        let near = neighbours.of(slot as usize).iter();
        islands.of(slot as usize).or_else(|| near.filter_map(|other| islands.of(*other as usize)).min())
    };
    for (place, &slot) in (0..).zip(&*order) {
        if let Some(island) = island_of(slot) {
            first_place[island] = first_place[island].min(place);
        }
    }
    let mut keyed: Vec<(u32, u32)> = (0..)
        .zip(&*order)
        .map(|(place, &slot)| (island_of(slot).map_or(place, |island| first_place[island]), slot))
        .collect();
    keyed.sort_by_key(|(place, _)| *place);
    order.iter_mut().zip(keyed).for_each(|(slot, (_, sorted))| *slot = sorted);
}

fn reverse_cuthill_mckee(neighbours: &Neighbours) -> Vec<u32> {
    let count = neighbours.particles();
    let mut order = Vec::with_capacity(count);
    let mut visited = vec![false; count];
    let mut by_degree: Vec<u32> = (0..count as u32).collect();
    by_degree.sort_by_key(|slot| neighbours.of(*slot as usize).len());
    for seed in by_degree {
        if visited[seed as usize] {
            continue;
        }
        // Twice: from the far end that the first search finds the levels are narrow.
        let begin = order.len();
        visit(neighbours, seed, &mut visited, &mut order);
        let far_end = order[order.len() - 1];
        for &particle in &order[begin..] {
            visited[particle as usize] = false;
        }
        order.truncate(begin);
        visit(neighbours, far_end, &mut visited, &mut order);
    }
    order.reverse();
    order
}

/// Appends all that is connected with `seed`, level by level, those of low degree first.
fn visit(neighbours: &Neighbours, seed: u32, visited: &mut [bool], order: &mut Vec<u32>) {
    let mut next = order.len();
    visited[seed as usize] = true;
    order.push(seed);
    while let Some(&particle) = order.get(next) {
        next += 1;
        let begin = order.len();
        for &other in neighbours.of(particle as usize) {
            if !std::mem::replace(&mut visited[other as usize], true) {
                order.push(other);
            }
        }
        order[begin..].sort_by_key(|other| (neighbours.of(*other as usize).len(), *other));
    }
}

#[cfg(test)]
mod tests {
    use bevy::math::Vec3;

    use super::*;
    use crate::solver::elements::Spring;

    const SPRING: Spring = Spring::elastic(1.0, 1.0, 0.0);

    /// A cloth of `width` × `width`, its particles numbered by `slot_of`.
    fn cloth(width: usize, slot_of: impl Fn(usize) -> usize) -> Elements {
        let mut elements = Elements::default();
        for place in 0..width * width {
            for (columns, rows) in [(1, 0), (0, 1), (1, 1)] {
                if place % width + columns < width && place / width + rows < width {
                    let ends = [slot_of(place), slot_of(place + columns + rows * width)];
                    elements.push(ends.map(|end| end as u32), SPRING);
                }
            }
        }
        elements
    }

    fn better(elements: &Elements, count: usize, pinned: &[usize]) -> Option<Vec<u32>> {
        let mut particles = Particles::default();
        for slot in 0..count {
            let inverse_mass = if pinned.contains(&slot) { 0.0 } else { 1.0 };
            particles.push(Vec3::ZERO, Vec3::ZERO, inverse_mass, 0.0);
        }
        let mut islands = Islands::default();
        islands.refresh(elements, &particles);
        better_order(elements, &particles, &mut Neighbours::default(), &islands)
    }

    fn longest_reach(elements: &Elements, place_of: impl Fn(u32) -> u32) -> u32 {
        let ends = elements.springs().all_ends().iter();
        ends.map(|[first, second]| place_of(*first).abs_diff(place_of(*second))).max().unwrap_or(0)
    }

    #[test]
    fn a_cloth_in_rows_stays_as_it_is() {
        assert_eq!(better(&cloth(300, |place| place), 300 * 300, &[]), None);
    }

    /// Levels of a search from a corner of a square grid with one diagonal are at most 2 w particles, and
    /// a spring joins a level with itself or the next.
    #[test]
    fn a_shuffled_cloth_gets_a_narrow_band() {
        let width = 60;
        let count = width * width;
        let mut shuffled: Vec<usize> = (0..count).collect();
        shuffled
            .sort_by_key(|place| (*place as u32).wrapping_mul(2_654_435_761).rotate_left(7) ^ 0x5bd1_e995);
        shuffled.sort_by_key(|place| (*place as u32 % 97).wrapping_mul(2_246_822_519));
        let elements = cloth(width, |place| shuffled[place]);
        let order = better(&elements, count, &[]).expect("the order is bad");
        let mut place_of = vec![u32::MAX; count];
        for (place, slot) in order.iter().enumerate() {
            place_of[*slot as usize] = place as u32;
        }
        assert!(!place_of.contains(&u32::MAX), "each particle has one place");
        let before = longest_reach(&elements, |slot| slot);
        let after = longest_reach(&elements, |slot| place_of[slot as usize]);
        assert!(before > 1000 && after <= 4 * width as u32, "{before} became {after}");
    }

    #[test]
    fn islands_that_were_mixed_come_apart() {
        // Two ropes on one pinned particle, spawned by turns; a lone particle between them.
        let mut elements = Elements::default();
        for ends in [[0, 1], [0, 2], [1, 4], [2, 5], [4, 6]] {
            elements.push(ends, SPRING);
        }
        assert_eq!(better(&elements, 7, &[0]), Some(vec![0, 1, 4, 6, 2, 5, 3]));
    }
}
