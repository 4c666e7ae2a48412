//! Sweeps: what would pass through another particle in a substep is put back to where the two first touch.
//!
//! In a substep particles move along straight lines. A pair that moves, relative to each other, by more than half
//! the sum of its radii may have its centres on the wrong sides at the end, or lie apart again. Such a pair is
//! moved back along its paths to the time of first contact; its impact is then solved as any other contact, with the normal at that
//! time. The rest of the substep is lost for the two: they keep their velocities, but do not move on in it. A pinned particle keeps its
//! prescribed motion, and takes along what it meets. Slower pairs never overlap by much, and cost nothing here.
//!
//! Particles of nets are not put back, but slide along what they meet: see `slide.rs`.
//!
//! Impacts are accepted in the order of their times. A particle that stops may be hit by others, so the paths up to there are searched
//! again, until no pair passes through another.

mod slide;

use bevy::math::{DVec3, Vec3};

use super::crowds::MAX_PARTNERS;
use super::grid::Grid;
use crate::solver::particles::{Particles, Vectors};
pub(super) use slide::Response;
use slide::Slide;

/// Relative displacement of a pair in a substep above which it is swept, as a part of the sum of its radii; and of one
/// particle above which its pairs are looked for, as a part of its radius. Of a pair above the first at least one
/// particle is above the second.
const SWEEP_THRESHOLD: f32 = 0.5;

/// How far into each other two particles are put back, as a part of the sum of their radii: they shall touch for
/// certain.
const TOUCHING_DEPTH: f64 = 1e-4;

/// Number of searches at most; whatever would pass through another after them stays where it was.
const MAX_SEARCHES: u32 = 8;

/// Working memory of sweeps.
#[derive(Debug, Clone, Default)]
pub(super) struct Sweep {
    /// Whether each particle is one to look for pairs of.
    is_fast: Vec<bool>,
    /// What all have moved by, about, m.
    common: Vec3,
    /// The pairs of slots that slide along each other in this substep, in order, the smaller slot first.
    sliding: Vec<(u32, u32)>,
    slides: Vec<Slide>,
    /// When each particle stops, as a fraction of the substep.
    stops: Vec<f64>,
    /// The pinned particle that each one is taken along by.
    pushers: Vec<Option<u32>>,
    /// Whether each particle has been stopped in this search.
    is_stopped: Vec<bool>,
    pairs: Vec<(u32, u32)>,
    impacts: Vec<Impact>,
}

/// A pair that first touches within the substep.
#[derive(Debug, Clone, Copy)]
struct Impact {
    /// When, as a fraction of the substep; 0 where they overlap from its start.
    time: f64,
    /// The smaller first.
    slots: [u32; 2],
}

/// The paths of all particles in a substep.
#[derive(Clone, Copy)]
struct Paths<'a> {
    particles: &'a Particles,
    /// Positions at the start of the substep, m.
    previous: &'a Vectors,
    /// What all have moved by, about, m.
    common: Vec3,
    stops: &'a [f64],
}

impl Sweep {
    /// To be called when a substep begins.
    pub fn begin_substep(&mut self) {
        self.sliding.clear();
        self.slides.clear();
    }

    /// Finds out what has been fast since `previous`, the positions at the start of the substep in m; only particles that are
    /// swept. Whether anything was.
    pub fn find_fast(
        &mut self,
        particles: &Particles,
        previous: &Vectors,
        is_swept: impl Fn(usize) -> bool,
    ) -> bool {
        self.common = common_displacement(particles, previous);
        let paths = Paths { particles, previous, common: self.common, stops: &[] };
        let radius = particles.radius();
        self.is_fast.clear();
        self.is_fast.reserve(particles.len());
        self.reserve(particles.len());
        if !paths.any_long() {
            self.is_fast.resize(particles.len(), false);
            return false;
        }
        self.is_fast.extend(radius.iter().enumerate().map(|(slot, radius)| {
            let least = SWEEP_THRESHOLD * radius;
            *radius > 0.0 && is_swept(slot) && paths.displacement(slot).length_squared() > least * least
        }));
        self.is_fast.contains(&true)
    }

    /// Allocates for `count` particles, so that the first fast one finds all allocated.
    fn reserve(&mut self, count: usize) {
        let Self { stops, pushers, is_stopped, pairs, impacts, .. } = self;
        stops.clear();
        stops.reserve(count);
        pushers.clear();
        pushers.reserve(count);
        is_stopped.clear();
        is_stopped.reserve(count);
        pairs.clear();
        pairs.reserve(count);
        impacts.clear();
        impacts.reserve(count);
    }

    /// Puts back what would pass through something since `previous`, the positions at the start of the substep in
    /// m; only particles that are swept, and pairs that `may_collide`. To be called after [`Self::find_fast`]. `listed`
    /// may know all pairs that come near each other. Whether anything was put back.
    pub fn put_back(
        &mut self,
        (grid, listed): (&mut Grid, Option<&[(u32, u32)]>),
        particles: &mut Particles,
        previous: &Vectors,
        is_swept: impl Fn(usize) -> bool,
        may_collide: impl Fn(&Particles, [u32; 2]) -> bool + Sync,
    ) -> bool {
        let Self { is_fast, common, stops, pushers, is_stopped, pairs, impacts, .. } = self;
        stops.resize(particles.len(), 1.0);
        pushers.resize(particles.len(), None);
        for search in 1..=MAX_SEARCHES {
            let paths = Paths { particles, previous, common: *common, stops };
            let collide = |a: u32, b: u32| {
                let any_fast = is_fast[a as usize] || is_fast[b as usize];
                let slots = [a.min(b), a.max(b)];
                any_fast && may_collide(particles, slots) && paths.impact(a, b).is_some()
            };
            paths.find_pairs((&mut *grid, listed), is_fast, &is_swept, collide, pairs);
            impacts.clear();
            impacts.extend(pairs.iter().filter_map(|(a, b)| paths.impact(*a, *b)));
            impacts.sort_unstable_by(|one, other| {
                one.time.total_cmp(&other.time).then_with(|| one.slots.cmp(&other.slots))
            });
            if impacts.is_empty() {
                break;
            }
            is_stopped.clear();
            is_stopped.resize(particles.len(), false);
            accept(impacts, particles, (stops, pushers, is_stopped), search == MAX_SEARCHES);
        }
        let stopped = || stops.iter().enumerate().filter(|(_, stop)| **stop < 1.0);
        for (slot, stop) in stopped() {
            let [start, end] = [previous, &particles.position].map(|of| of.get(slot).as_dvec3());
            let pushed = pushers[slot].map_or(DVec3::ZERO, |pusher| {
                let [start, end] =
                    [previous, &particles.position].map(|of| of.get(pusher as usize).as_dvec3());
                (1.0 - stop) * (end - start)
            });
            particles.position.set(slot, (start.lerp(end, *stop) + pushed).as_vec3());
        }
        stopped().next().is_some()
    }
}

/// Stops the pairs in the order of their impacts; those of a particle that has been stopped in this search are left to
/// the next one. After the `last` one they stay where they were.
fn accept(
    impacts: &[Impact],
    particles: &Particles,
    (stops, pushers, is_stopped): (&mut [f64], &mut [Option<u32>], &mut [bool]),
    last: bool,
) {
    for impact in impacts {
        let slots = impact.slots.map(|slot| slot as usize);
        let free = || slots.into_iter().filter(|slot| !particles.is_pinned(*slot));
        if free().any(|slot| is_stopped[slot]) {
            free().filter(|_| last).for_each(|slot| stops[slot] = 0.0);
            continue;
        }
        for slot in free() {
            is_stopped[slot] = true;
            if impact.time < stops[slot] {
                stops[slot] = impact.time;
                pushers[slot] = impact.slots.into_iter().find(|slot| particles.is_pinned(*slot as usize));
            }
        }
    }
}

impl Paths<'_> {
    /// The displacement of a particle, apart from the common one, m.
    #[inline]
    fn displacement(&self, slot: usize) -> Vec3 {
        self.particles.position.get(slot) - self.previous.get(slot) - self.common
    }

    /// Whether any sphere moves by more than [`SWEEP_THRESHOLD`] of its radius. Without a branch: this is looked at in each substep.
    fn any_long(&self) -> bool {
        let count = self.particles.len();
        let [to, from] =
            [&self.particles.position, self.previous].map(|of| of.axes().map(|axis| &axis[..count]));
        let radius = &self.particles.radius()[..count];
        let common = self.common.to_array();
        let mut any = false;
        for slot in 0..count {
            let displacement = |axis: usize| to[axis][slot] - from[axis][slot] - common[axis];
            let square = displacement(0) * displacement(0)
                + displacement(1) * displacement(1)
                + displacement(2) * displacement(2);
            let least = SWEEP_THRESHOLD * radius[slot];
            any |= (square > least * least) & (least > 0.0);
        }
        any
    }

    /// A sphere that holds a particle all the way, unless it is a point or flies beyond all numbers.
    fn sphere(&self, slot: usize) -> Option<(Vec3, f32)> {
        let (radius, half) = (self.particles.radius()[slot], 0.5 * self.displacement(slot));
        let (centre, reach) = (self.previous.get(slot) + half, half.length() + radius);
        (radius > 0.0 && centre.is_finite() && reach.is_finite()).then_some((centre, reach))
    }

    /// Lists the pairs that `collide` on their way, among those that are `listed` as near each other if these are known.
    fn find_pairs(
        self,
        (grid, listed): (&mut Grid, Option<&[(u32, u32)]>),
        is_fast: &[bool],
        is_swept: impl Fn(usize) -> bool,
        collide: impl Fn(u32, u32) -> bool + Sync,
        pairs: &mut Vec<(u32, u32)>,
    ) {
        if let Some(listed) = listed {
            pairs.clear();
            pairs.extend(listed.iter().filter(|(a, b)| collide(*a, *b)));
            return;
        }
        let (mut least, mut most) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        for (slot, _) in is_fast.iter().enumerate().filter(|(_, is_fast)| **is_fast) {
            if let Some((centre, reach)) = self.sphere(slot) {
                (least, most) = (least.min(centre - reach), most.max(centre + reach));
            }
        }
        let spheres = (0..is_fast.len()).filter(|slot| is_swept(*slot)).filter_map(|slot| {
            let (centre, reach) = self.sphere(slot)?;
            let is_near = (centre + reach).cmpge(least).all() && (centre - reach).cmple(most).all();
            is_near.then_some((slot as u32, centre, reach))
        });
        grid.find_pairs(spheres, (collide, |_: u32, listed: &[_]| listed.len() >= MAX_PARTNERS), pairs);
    }

    /// When a pair first touches. They move together until one of them stops, then the other one alone.
    fn impact(self, a: u32, b: u32) -> Option<Impact> {
        let slots = [a.min(b), a.max(b)];
        let [one, other] = slots.map(|slot| slot as usize);
        let path = |slot: usize| {
            let start = self.previous.get(slot).as_dvec3();
            (start, self.particles.position.get(slot).as_dvec3() - start)
        };
        let ((one_start, one_displacement), (other_start, other_displacement)) = (path(one), path(other));
        let reach = f64::from(self.particles.radius()[one]) + f64::from(self.particles.radius()[other]);
        let rounding =
            4.0 * f64::from(f32::EPSILON) * (one_start.abs() + one_displacement.abs()).max_element();
        let depth = TOUCHING_DEPTH * reach + rounding;
        let [first, last] = {
            let (one, other) = (self.stops[one], self.stops[other]);
            [one.min(other), one.max(other)]
        };
        let separation = one_start - other_start;
        let change = one_displacement - other_displacement;
        let time = first_touch(separation, change, first, reach, depth).or_else(|| {
            let alone = if self.stops[one] == last { one_displacement } else { -other_displacement };
            let time = first_touch(separation + first * change, alone, last - first, reach, depth)?;
            Some(first + time)
        })?;
        Some(Impact { time, slots })
    }
}

/// When two spheres first touch: the least time t in 0 to `until` with ‖s + t d‖ = R, where s is their separation, d its
/// change in a substep, and R the sum `reach` of their radii less the `depth` to which they are put into each other.
fn first_touch(separation: DVec3, change: DVec3, until: f64, reach: f64, depth: f64) -> Option<f64> {
    let way_squared = change.length_squared();
    let sweep_threshold = f64::from(SWEEP_THRESHOLD) * reach;
    let approach = -separation.dot(change);
    // Written so that NaN takes this branch.
    if !(way_squared > sweep_threshold * sweep_threshold && approach > 0.0) {
        return None;
    }
    // Twice as deep at least: what has been put back is not found again.
    let (touching, deep) = ((reach - depth).max(0.0), (reach - 2.0 * depth).max(0.0));
    let nearest = separation + (approach / way_squared).min(until) * change;
    if nearest.length_squared() >= deep * deep {
        return None;
    }
    let outside = separation.length_squared() - touching * touching;
    let discriminant = approach * approach - way_squared * outside;
    let time = outside / (approach + discriminant.max(0.0).sqrt());
    Some(time.clamp(0.0, until))
}

/// About what all particles have moved by: the mean of every sixteenth. Zero if it is not finite.
fn common_displacement(particles: &Particles, previous: &Vectors) -> Vec3 {
    let sample = (0..particles.len()).step_by(16);
    let size = sample.len() as f32;
    let mean = sample.map(|slot| particles.position.get(slot) - previous.get(slot)).sum::<Vec3>() / size;
    if mean.is_finite() { mean } else { Vec3::ZERO }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Spheres of radius 0.1 m that go from the first to the second place; where they are put.
    fn put(paths: &[(Vec3, Vec3)], pinned: &[usize]) -> Vec<Vec3> {
        let (mut particles, mut previous) = (Particles::default(), Vectors::default());
        for (slot, (start, end)) in paths.iter().enumerate() {
            let inverse_mass = if pinned.contains(&slot) { 0.0 } else { 1.0 };
            particles.push(*end, Vec3::ZERO, inverse_mass, 0.1);
            previous.push(*start);
        }
        let (mut sweep, around) = (Sweep::default(), (&mut Grid::default(), None));
        if sweep.find_fast(&particles, &previous, |_| true) {
            sweep.put_back(around, &mut particles, &previous, |_| true, |_, _| true);
        }
        (0..paths.len()).map(|slot| particles.position.get(slot)).collect()
    }

    /// The depth to which a touching pair is put, and its rounding.
    fn assert_touch(one: Vec3, other: Vec3) {
        let distance = one.distance(other);
        assert!((0.1999..0.2).contains(&distance), "{distance} m apart");
    }

    #[test]
    fn a_pair_stops_where_it_first_touches() {
        let ends = put(&[(Vec3::ZERO, Vec3::X * 4.0), (Vec3::X * 2.0, Vec3::X)], &[]);
        // 2 m apart, at 5 m a substep: they touch after 1.8 m of these.
        assert_touch(ends[0], ends[1]);
        assert!(ends[0].distance(Vec3::X * 1.44) < 1e-4, "{ends:?}");
    }

    #[test]
    fn what_is_pinned_goes_on_and_takes_along_what_it_meets() {
        let ends = put(&[(Vec3::ZERO, Vec3::X * 4.0), (Vec3::X * 2.0, Vec3::X * 2.0)], &[0]);
        assert_eq!(ends[0], Vec3::X * 4.0);
        assert_touch(ends[1], ends[0]);
        assert!(ends[1].x > 4.0);
        let ends = put(&[(Vec3::ZERO, Vec3::X * 4.0), (Vec3::X * 2.0, Vec3::X * 2.0)], &[1]);
        assert_eq!(ends[1], Vec3::X * 2.0);
        assert_touch(ends[0], ends[1]);
    }

    #[test]
    fn the_first_of_several_stops_it_and_what_it_leaves_goes_on() {
        let still = |x: f32| (Vec3::X * x, Vec3::X * x);
        let ends = put(&[(Vec3::ZERO, Vec3::X * 9.0), still(3.0), still(2.0), still(5.0)], &[]);
        assert_touch(ends[0], ends[2]);
        assert_eq!([1, 3].map(|slot| ends[slot]), [Vec3::X * 3.0, Vec3::X * 5.0]);
        // The last two would not meet, but the second is stopped in the way of the third.
        let third = (Vec3::new(1.0, 5.0, 0.0), Vec3::new(1.0, -5.0, 0.0));
        let ends = put(&[(Vec3::ZERO, Vec3::ZERO), (Vec3::X * 2.0, Vec3::X * -2.0), third], &[]);
        assert_touch(ends[0], ends[1]);
        assert_eq!(ends[2], third.1, "it crosses where nothing is");
        let third = (Vec3::new(0.2, 5.0, 0.0), Vec3::new(0.2, -5.0, 0.0));
        let ends = put(&[(Vec3::ZERO, Vec3::ZERO), (Vec3::X * 2.0, Vec3::X * -2.0), third], &[]);
        assert_touch(ends[2], ends[1]);
        assert!(ends[2].y > 0.0, "the second stands in its way by then: {ends:?}");
    }

    #[test]
    fn what_passes_by_or_moves_together_or_away_goes_where_it_goes() {
        let displacements = [
            [(Vec3::ZERO, Vec3::X * 4.0), (Vec3::new(2.0, 0.21, 0.0), Vec3::new(2.0, 0.21, 0.0))],
            [(Vec3::ZERO, Vec3::X * 4.0), (Vec3::X * 0.15, Vec3::X * 4.11)],
            [(Vec3::ZERO, Vec3::ZERO), (Vec3::X * 0.1, Vec3::X * 4.0)],
            [(Vec3::ZERO, Vec3::X * 4.0), (Vec3::Y * 3.0, Vec3::NAN)],
        ];
        for paths in displacements {
            let ends = put(&paths, &[]);
            assert_eq!(ends[0], paths[0].1);
            assert!(ends[1] == paths[1].1 || paths[1].1.is_nan());
        }
    }
}
