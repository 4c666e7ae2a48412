//! An order of the particles in which springs join neighbours.
//!
//! Ropes, cloths and lattices are made in such an order. A mesh of triangles, or whatever was spawned at
//! random, is not: its springs reach all over memory. The reverse Cuthill–McKee order (Cuthill and McKee,
//! *Reducing the bandwidth of sparse symmetric matrices*, 1969; reversed: George, 1971) numbers the
//! particles outwards from a far end, so that the slots of joined ones lie close.

use super::batches::SMALLEST_BLOCK;
use super::springs::Springs;

/// Springs that reach so far at most find their ends in the first-level cache.
const NEAR: u32 = 256;

/// The particles in a better order, if theirs is bad: the present slot of each place.
///
/// An order is good if at least half of the springs are in runs, or join near slots.
pub fn better_order(springs: &mut Springs, particles: usize) -> Option<Vec<u32>> {
    let ends = springs.first().iter().zip(springs.second());
    let near = ends.filter(|(first, second)| first.abs_diff(**second) <= NEAR).count();
    if particles < SMALLEST_BLOCK || 2 * near >= springs.len() {
        return None;
    }
    springs.prepare(particles);
    if 2 * springs.batches().loose() <= springs.len() {
        return None;
    }
    Some(reverse_cuthill_mckee(&Neighbours::of(springs, particles)))
}

/// The particles that springs join to each particle.
struct Neighbours {
    /// `starts[a]..starts[a + 1]` are those of a.
    starts: Vec<u32>,
    others: Vec<u32>,
}

impl Neighbours {
    fn of(springs: &Springs, particles: usize) -> Self {
        let ends = || springs.first().iter().zip(springs.second()).flat_map(|(&a, &b)| [(a, b), (b, a)]);
        let mut starts = vec![0_u32; particles + 1];
        ends().for_each(|(a, _)| starts[a as usize] += 1);
        let mut total = 0;
        for start in &mut starts {
            total += *start;
            *start = total;
        }
        let mut others = vec![0; total as usize];
        for (a, b) in ends() {
            starts[a as usize] -= 1;
            others[starts[a as usize] as usize] = b;
        }
        Self { starts, others }
    }

    fn of_particle(&self, a: u32) -> &[u32] {
        &self.others[self.starts[a as usize] as usize..self.starts[a as usize + 1] as usize]
    }

    fn degree(&self, a: u32) -> usize {
        self.of_particle(a).len()
    }
}

fn reverse_cuthill_mckee(neighbours: &Neighbours) -> Vec<u32> {
    let count = neighbours.starts.len() - 1;
    let mut order = Vec::with_capacity(count);
    let mut visited = vec![false; count];
    let mut by_degree: Vec<u32> = (0..count as u32).collect();
    by_degree.sort_by_key(|particle| neighbours.degree(*particle));
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

/// Appends all that hangs together with `seed`, level by level, those of low degree first.
fn visit(neighbours: &Neighbours, seed: u32, visited: &mut [bool], order: &mut Vec<u32>) {
    let mut next = order.len();
    visited[seed as usize] = true;
    order.push(seed);
    while let Some(&particle) = order.get(next) {
        next += 1;
        let begin = order.len();
        for &other in neighbours.of_particle(particle) {
            if !std::mem::replace(&mut visited[other as usize], true) {
                order.push(other);
            }
        }
        order[begin..].sort_by_key(|other| (neighbours.degree(*other), *other));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A cloth of `width` × `width`, its particles numbered by `slot_of`.
    fn cloth(width: usize, slot_of: impl Fn(usize) -> usize) -> Springs {
        let mut springs = Springs::default();
        for place in 0..width * width {
            for (columns, rows) in [(1, 0), (0, 1), (1, 1)] {
                if place % width + columns < width && place / width + rows < width {
                    springs.push(slot_of(place), slot_of(place + columns + rows * width), 1.0, 1.0, 0.0);
                }
            }
        }
        springs
    }

    fn longest_reach(springs: &Springs, place_of: impl Fn(u32) -> u32) -> u32 {
        let ends = springs.first().iter().zip(springs.second());
        ends.map(|(first, second)| place_of(*first).abs_diff(place_of(*second))).max().unwrap_or(0)
    }

    #[test]
    fn a_cloth_in_rows_stays_as_it_is() {
        assert_eq!(better_order(&mut cloth(300, |place| place), 300 * 300), None);
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
        let mut springs = cloth(width, |place| shuffled[place]);
        let order = better_order(&mut springs, count).expect("the order is bad");
        let mut place_of = vec![u32::MAX; count];
        for (place, slot) in order.iter().enumerate() {
            place_of[*slot as usize] = place as u32;
        }
        assert!(!place_of.contains(&u32::MAX), "each particle has one place");
        let before = longest_reach(&springs, |slot| slot);
        let after = longest_reach(&springs, |slot| place_of[slot as usize]);
        assert!(before > 1000 && after <= 4 * width as u32, "{before} became {after}");
    }
}
