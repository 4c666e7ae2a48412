//! Ropes and other chains that touch nothing for a while: a broad phase for whole chains, before that for particles.
//!
//! A *chain* is a row of consecutive slots, each joined to the next by a spring. It is *free* as long as two conditions hold, which are
//! established by a search and then only checked:
//! - All of it is in a box, enlarged by the motion that is expected in the next ticks, with which no other such box and no skin of a
//!   sphere overlaps. So it touches nothing else.
//! - Since the search, no particle has moved, relative to its neighbour in the row, by more than the chain's *play*: the least of (‖xᵢ − xⱼ‖ − rᵢ − rⱼ) / |i − j| over its pairs. The separation of i and j changes by
//!   |i − j| times as much at most, so the chain does not touch itself. (Unlike a skin it is not used up by a
//!   motion of the whole, and slowly by a rotation.)
//!
//! Particles of free chains have no skins to check, no candidates, and are in no grid.

use std::ops::Range;

use bevy::math::Vec3;

use super::extents::{Coordinates, keeps_within};
use crate::solver::graph::Exclusions;
use crate::solver::particles::{Particles, Vectors};

/// Least number of particles of a chain.
pub(super) const MIN_LENGTH: usize = 4;

/// Greatest number of particles of a chain, as the search tests all its pairs.
pub(super) const MAX_LENGTH: usize = 128;

/// Change of the velocity along an axis that a box allows for, as a fraction of the speed along it.
const CHANGE_ALONG: f32 = 0.5;

/// What it allows for beside that, as a fraction of the speed in any direction.
const CHANGE_ACROSS: f32 = 0.05;

/// Fraction of its play that a chain may use until it is searched anew: the rest is for one substep.
const USED_PLAY: f32 = 0.75;

/// The same during a search of all particles: less, so that fewer chains need another search before the next one.
const KEPT_PLAY: f32 = 0.4;

/// Number of substeps for which the play of a free chain is to last at the present velocities.
const PLAY_SUBSTEPS: f32 = 2.0;

/// Particles are tested together: a vector of AVX2.
pub(super) const LANES: usize = 8;

/// A free chain.
#[derive(Debug, Clone, Copy, Default)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Chain {
    /// The slots are those from here to before `end`.
    start: u32,
    end: u32,
    /// The corners of the box of the centres, m: that in which it need not be looked at again.
    pub least: Vec3,
    pub most: Vec3,
    /// What the box is larger on each side that nothing else reaches into, m.
    pub margin: Vec3,
    /// m.
    pub play: f32,
    /// The greatest radius of its particles, m.
    pub radius: f32,
}

/// Whether it is known that a chain touches nothing.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Proof {
    /// It touches nothing, and may stay unexamined.
    #[default]
    Holds,
    /// It touches nothing yet.
    Expires,
    /// It may touch anything.
    Fails,
}

impl Chain {
    /// A chain of these slots, without a box yet.
    pub fn new(slots: Range<usize>) -> Self {
        Self { start: slots.start as u32, end: slots.end as u32, ..Self::default() }
    }

    /// The slots of its particles.
    pub fn slots(&self) -> Range<usize> {
        self.start as usize..self.end as usize
    }

    /// The corners of what nothing else reaches into, m.
    pub fn reserved(&self) -> [Vec3; 2] {
        [self.least - self.margin, self.most + self.margin]
    }

    /// Whether so little of its play is used that it may keep it.
    pub fn has_play_left(&self, positions: &Vectors, links: &Vectors) -> bool {
        let [_, is_within] =
            keeps_within(self, (0, positions.axes()), links, (Vec3::ZERO, Vec3::ZERO), KEPT_PLAY * self.play);
        is_within
    }

    /// Makes the present links those from which its play counts.
    pub fn note_links(&self, positions: &Vectors, links: &mut Vectors) {
        for (links, here) in links.axes_mut().into_iter().zip(positions.axes()) {
            let (links, here) = (&mut links[self.slots()], &here[self.slots()]);
            links[0] = 0.0;
            links[1..].iter_mut().zip(here.windows(2)).for_each(|(link, ends)| *link = ends[1] - ends[0]);
        }
    }

    /// Whether it touches nothing else, and not itself; `common` is what all have moved by, m.
    #[inline(always)]
    pub fn proofs(&self, positions: &Vectors, links: &Vectors, common: Vec3) -> [Proof; 2] {
        let positions = (0, positions.axes());
        let hold = keeps_within(self, positions, links, (common, Vec3::ZERO), USED_PLAY * self.play);
        if hold == [true; 2] {
            return [Proof::Holds; 2];
        }
        let may_go_on = keeps_within(self, positions, links, (common, self.margin), self.play);
        [0, 1].map(|place| match (hold[place], may_go_on[place]) {
            (true, _) => Proof::Holds,
            (false, true) => Proof::Expires,
            (false, false) => Proof::Fails,
        })
    }

    /// Whether it touches nothing, as all of it is in what is reserved for it and none of its play is exceeded.
    #[inline(always)]
    pub fn is_free(&self, positions: Coordinates, links: &Vectors, common: Vec3) -> bool {
        keeps_within(self, positions, links, (common, self.margin), self.play) == [true; 2]
    }

    /// Finds its play at the present positions; whether it is enough for some substeps of
    /// `substep` s.
    pub fn renew_play(&mut self, particles: &Particles, exclusions: &Exclusions, substep: f32) -> bool {
        let slots = self.slots();
        let velocity = |slot: usize| particles.velocity.get(slot);
        let speeds = slots.clone().skip(1).map(|slot| velocity(slot).distance_squared(velocity(slot - 1)));
        let needed = speeds.fold(0.0, f32::max).sqrt() * PLAY_SUBSTEPS * substep;
        self.play = pulp::Arch::new().dispatch(Play { particles, exclusions, slots });
        self.play > 0.0 && USED_PLAY * self.play > needed
    }

    /// Makes its box large enough for `ticks`; `common` is the velocity of all, m/s.
    pub fn make_box(
        &mut self,
        particles: &Particles,
        common: Vec3,
        ticks: f32,
        ChainQuery { time_step, substep, gravity, .. }: ChainQuery,
    ) {
        let (mut least, mut most) = ([Vec3::INFINITY; 2], [Vec3::NEG_INFINITY; 2]);
        let mut speed_squared = 0.0_f32;
        for slot in self.slots() {
            let (position, velocity) = (particles.position.get(slot), particles.velocity.get(slot) - common);
            least = [least[0].min(position), least[1].min(velocity)];
            most = [most[0].max(position), most[1].max(velocity)];
            speed_squared = speed_squared.max(velocity.length_squared());
        }
        self.radius = particles.radius()[self.slots()].iter().copied().fold(0.0, f32::max);
        let (duration, speed) = (ticks * time_step, speed_squared.sqrt());
        let along = least[1].abs().max(most[1].abs());
        let across = CHANGE_ACROSS * speed;
        let change = CHANGE_ALONG * along + across + 0.5 * gravity * duration;
        self.least = least[0] + (least[1].min(Vec3::ZERO) - change) * duration;
        self.most = most[0] + (most[1].max(Vec3::ZERO) + change) * duration;
        self.margin = 2.0 * (along + across + gravity * substep) * substep;
    }
}

/// Finds the least (‖xᵢ − xⱼ‖ − rᵢ − rⱼ) / |i − j| of the pairs of these slots that may collide, m.
struct Play<'a> {
    particles: &'a Particles,
    exclusions: &'a Exclusions,
    slots: Range<usize>,
}

impl pulp::WithSimd for Play<'_> {
    type Output = f32;

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) -> f32 {
        let Self { particles, exclusions, slots } = self;
        let (start, count) = (slots.start, slots.len());
        // Padded with what is far away.
        let mut buffer = [[f32::MAX.sqrt() * 0.1; MAX_LENGTH + LANES]; 4];
        for (axis, values) in buffer.iter_mut().zip(particles.position.axes()) {
            axis[..count].copy_from_slice(&values[slots.clone()]);
        }
        buffer[3] = [0.0; MAX_LENGTH + LANES];
        buffer[3][..count].copy_from_slice(&particles.radius()[slots]);
        let [x, y, z, radius] = &buffer;
        let narrowed = |play: f32, one: usize, other: usize| {
            let are_spheres = radius[one] > 0.0 && radius[other] > 0.0;
            let [a, b] = [one, other].map(|place| (start + place) as u32);
            if !are_spheres || exclusions.contains(a, b) {
                return play;
            }
            let away = [x[other] - x[one], y[other] - y[one], z[other] - z[one]];
            let gap = Vec3::from_array(away).length() - radius[one] - radius[other];
            play.min(gap / (other - one) as f32)
        };
        let mut play = f32::MAX.sqrt() * 1e-3;
        for one in 0..count {
            // Neighbours are near, and exempt nearly always.
            if one + 1 < count {
                play = narrowed(play, one, one + 1);
            }
            for first in (one + 2..count).step_by(LANES) {
                let lanes =
                    |array: &[f32]| array[first..].first_chunk::<LANES>().copied().unwrap_or_default();
                let (other_x, other_y, other_z, reach) = (lanes(x), lanes(y), lanes(z), lanes(radius));
                let steps = (first - one) as f32;
                let (mut near, mut any) = ([0; LANES], 0);
                for lane in 0..LANES {
                    let away = [other_x[lane] - x[one], other_y[lane] - y[one], other_z[lane] - z[one]];
                    let needed = reach[lane] + radius[one] + (steps + lane as f32) * play;
                    let distance_squared = away[0] * away[0] + away[1] * away[1] + away[2] * away[2];
                    near[lane] = u32::from(distance_squared < needed * needed);
                    any |= near[lane];
                }
                if any == 0 {
                    continue;
                }
                for other in (first..count.min(first + LANES)).filter(|other| near[other - first] != 0) {
                    play = narrowed(play, one, other);
                }
            }
        }
        play
    }
}

/// A search for chains.
#[derive(Debug, Clone, Copy)]
pub(super) struct ChainQuery {
    /// s.
    pub time_step: f32,
    /// s.
    pub substep: f32,
    /// m/s².
    pub gravity: f32,
    pub purpose: ChainPurpose,
}

/// What chains are searched for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ChainPurpose {
    /// Those of which no spheres touch each other.
    ForSubsteps,
    /// All that touch nothing else, whether they collide as spheres or along their links: whether they touch themselves is found in the tick.
    ForTick,
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::solver::elements::{Elements, Spring};

    /// A rope of spheres of 0.02 m, 0.1 m apart, through these points.
    pub fn rope(points: &[Vec3]) -> (Particles, Exclusions) {
        let (mut particles, mut elements) = (Particles::default(), Elements::default());
        for (slot, point) in points.iter().enumerate() {
            particles.push(*point, Vec3::ZERO, 1.0, 0.02);
            if slot > 0 {
                let ends = [slot as u32 - 1, slot as u32];
                elements.push(ends, Spring { rest_length: 0.1, stiffness: 1.0, ..Spring::default() });
            }
        }
        let mut exclusions = Exclusions::default();
        exclusions.rebuild(&particles, &elements, &[]);
        (particles, exclusions)
    }

    /// Chains of fewer particles than a vector has, and of more: each particle counts.
    #[test]
    fn each_particle_that_leaves_the_box_or_bends_the_chain_is_noticed() {
        for count in MIN_LENGTH..3 * LANES {
            let straight: Vec<_> = (0..count).map(|slot| Vec3::X * 0.1 * slot as f32).collect();
            let (particles, _) = rope(&straight);
            let (origins, mut links) = (particles.position.clone(), Vectors::default());
            links.resize(count);
            let mut chain = Chain::new(0..count);
            chain.note_links(&origins, &mut links);
            (chain.least, chain.most) = (Vec3::splat(-0.5), Vec3::splat(0.1 * count as f32));
            let check = |place: usize, displacement: Vec3| {
                let mut moved = origins.clone();
                moved.set(place, origins.get(place) + displacement);
                keeps_within(&chain, (0, moved.axes()), &links, (Vec3::ZERO, Vec3::ZERO), 0.02)
            };
            for place in 0..count {
                for axis in Vec3::AXES {
                    assert_eq!(check(place, 0.019 * axis), [true, true], "{place} of {count}");
                    assert_eq!(check(place, 0.021 * axis), [true, false], "{place} of {count}");
                    assert_eq!(check(place, 10.0 * axis), [false, false], "{place} of {count}");
                    assert_eq!(check(place, -10.0 * axis), [false, false], "{place} of {count}");
                    assert_eq!(check(place, f32::NAN * axis), [false, false], "{place} of {count}");
                }
            }
        }
    }

    #[test]
    fn the_play_is_the_least_gap_for_each_link_between_two() {
        let straight: Vec<_> = (0..20).map(|slot| Vec3::X * 0.1 * slot as f32).collect();
        let (particles, exclusions) = rope(&straight);
        let play = |particles: &Particles, exclusions: &Exclusions, slots: Range<usize>| {
            pulp::Arch::new().dispatch(Play { particles, exclusions, slots })
        };
        assert!((play(&particles, &exclusions, 0..20) - 0.06).abs() < 1e-6);
        // Folded in the middle: the ends are 0.08 m apart, and 13 links.
        let folded: Vec<_> = (0..14)
            .map(|slot| {
                Vec3::new(
                    if slot < 7 { slot } else { 13 - slot } as f32 * 0.1,
                    if slot < 7 { 0.0 } else { 0.08 },
                    0.0,
                )
            })
            .collect();
        let (particles, exclusions) = rope(&folded);
        assert!((play(&particles, &exclusions, 0..14) - 0.04 / 13.0).abs() < 1e-6);
    }
}
