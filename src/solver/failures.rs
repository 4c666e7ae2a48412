//! Springs that break or yield, at the end of each substep.
//!
//! A spring with a tension above its breaking force is removed, one with a strain beyond its yield strain gets another rest
//! length. Both take energy away, and neither changes a velocity: momentum and angular momentum stay to
//! the bit.
//!
//! Of connected springs only the one that is most overloaded breaks in a substep, and those that carry twice their breaking force: the
//! break unloads the others. In a rope under tension all links carry nearly the same, and by that rule alone one would break in each
//! substep. So in ropes and trees no other spring breaks (but those that carry twice their breaking force) until the release wave has
//! had the time to travel through all of it: √(m/k) for each of its elements. Springs of surfaces are only reported, one in each tick,
//! and torn after it.
//!
//! The tension of what an implicit scheme advances is that of the solved equations at the end of its step; that of
//! others follows from the positions: its error is their rounding times the stiffness. Where that error decides whether a spring
//! breaks, it can break at the end of a tick only, and if it rests, by the tension that balances the loads, as it is published.

use bevy::math::Vec3;

use crate::solver::elements::{Element, Elements, MAX_ULPS, Release};
use crate::solver::graph::{Islands, spring_ends};
use crate::solver::outputs::Broken;
use crate::solver::particles::Particles;
use crate::solver::state::Version;

/// At this multiple of its breaking force a spring breaks, whatever else does.
const CERTAIN: f64 = 2.0;

const NO_ISLAND: u32 = u32::MAX;

/// The springs that may fail, and working memory.
#[derive(Debug, Clone, Default)]
pub(super) struct Failures {
    candidates: Vec<Candidate>,
    key: Option<(Version, Version, Version)>,
    /// What has failed in the last substep.
    pub broken: Vec<Broken>,
    /// The springs that have yielded, with their plastic strain.
    pub yielded: Vec<(u32, f32)>,
    overloaded: Vec<Overload>,
    /// The islands through which a release travels, and those of which a spring that tears was reported in this tick.
    waiting: Vec<u32>,
    /// The springs that were.
    reported: Vec<u32>,
    /// The largest coordinate of the springs of each island, m, and behind them that of those without one.
    reach: Vec<f32>,
}

#[derive(Debug, Clone, Copy)]
struct Candidate {
    spring: u32,
    island: u32,
    /// A free end of it; if it has none, an end.
    slot: u32,
    /// How long a release takes through its island, s; 0 where that has loops.
    release: f32,
}

#[derive(Debug, Clone, Copy)]
struct Overload {
    candidate: Candidate,
    tension: f64,
    length: f64,
    /// The tension as a multiple of the breaking force.
    load: f64,
}

impl Failures {
    /// Lists the springs that may fail. `islands` are those of the present elements; they are asked for only if there
    /// are such springs.
    pub fn prepare<'a>(
        &mut self,
        elements: &Elements,
        particles: &Particles,
        releases: &[Release],
        islands: impl FnOnce() -> &'a Islands,
    ) {
        let key = Some((elements.failures_version(), elements.ends_version(), particles.free_version()));
        self.waiting.clear();
        self.reported.clear();
        let has_same_springs = self.key.is_some_and(|(failures, ..)| failures == elements.failures_version());
        if (self.key == key && releases.is_empty()) || has_same_springs && self.candidates.is_empty() {
            return;
        }
        self.key = key;
        self.candidates.clear();
        let springs = elements.springs();
        let may_fail = |number: &u32| springs.elements()[*number as usize].may_fail();
        let numbers = (0..springs.len() as u32).filter(may_fail);
        let numbers = numbers.map(|spring| Candidate { spring, island: NO_ISLAND, slot: 0, release: 0.0 });
        self.candidates.extend(numbers);
        if self.candidates.is_empty() {
            return;
        }
        let islands = islands();
        for candidate in &mut self.candidates {
            let number = candidate.spring as usize;
            let ([first, second], spring) = (spring_ends(elements, number), springs.elements()[number]);
            let slot = if particles.is_pinned(first) { second } else { first };
            candidate.slot = slot as u32;
            let Some(island) = islands.of(slot) else { continue };
            candidate.island = island as u32;
            let island = islands.all()[island];
            if !island.has_loops {
                let masses = [first, second].map(|end| 1.0 / particles.inverse_mass()[end]);
                let link = (masses[0].min(masses[1]) / spring.stiffness).sqrt();
                candidate.release = if link.is_finite() { link * island.elements as f32 } else { 0.0 };
            }
        }
        let slots = releases.iter().flat_map(|release| release.slots);
        self.waiting.extend(slots.filter_map(|slot| islands.of(slot as usize)).map(|island| island as u32));
    }

    /// The releases of what has broken in the last substep.
    pub fn released<'a>(&'a self, elements: &'a Elements) -> impl Iterator<Item = Release> + 'a {
        self.overloaded
            .iter()
            .map(|overload| overload.candidate)
            .filter(|candidate| candidate.release > 0.0)
            .map(|candidate| {
                let ends = spring_ends(elements, candidate.spring as usize);
                Release { slots: ends.map(|end| end as u32), time_left: candidate.release }
            })
    }

    /// Whether there is any.
    pub fn any(&self) -> bool {
        !self.candidates.is_empty()
    }

    /// Whether rounding decides if any spring breaks, for the tensions that [`find`](Self::find) takes; after
    /// [`measure_reach`](Self::measure_reach).
    pub fn any_uncertain(&self, elements: &Elements, particles: &Particles, known: &[f64]) -> bool {
        self.candidates.iter().any(|candidate| {
            let limit = elements.springs().elements()[candidate.spring as usize].breaking_force;
            limit.is_some_and(|limit| {
                let (tension, _) = tension(elements, particles, known, candidate.spring);
                (tension - f64::from(limit)).abs() <= rounding(elements, &self.reach, candidate)
            })
        })
    }

    /// Measures how far the springs of each island are from the origin: the rounding of one makes the others vibrate, too. To be
    /// called in each substep, before anything is asked about it.
    pub fn measure_reach(&mut self, elements: &Elements, particles: &Particles) {
        let Self { candidates, reach, .. } = self;
        let islands =
            candidates.iter().map(|candidate| candidate.island).filter(|island| *island != NO_ISLAND);
        let count = islands.max().map_or(0, |island| island as usize + 1) + 1;
        reach.clear();
        reach.resize(count, 0.0);
        for candidate in &*candidates {
            let ends = spring_ends(elements, candidate.spring as usize);
            let coordinates = ends.map(|end| particles.position.get(end).abs().max_element());
            let reach = &mut reach[reach_index(count, candidate)];
            *reach = reach.max(coordinates[0]).max(coordinates[1]);
        }
    }

    /// Finds what fails. `known` has the tensions of the elements that were solved implicitly or are at rest; for others it has
    /// nothing, or NaN. Those at a particle that is `in_step` of a longer step are left for its end, and where rounding decides for
    /// that of the tick.
    pub fn find(
        &mut self,
        elements: &Elements,
        particles: &Particles,
        (known, ends_tick): (&[f64], bool),
        in_step: impl Fn(usize) -> bool,
    ) {
        let Self { candidates, broken, yielded, overloaded, waiting, reported, reach, .. } = self;
        broken.clear();
        yielded.clear();
        overloaded.clear();
        for &candidate in candidates.iter() {
            let spring = &elements.springs().elements()[candidate.spring as usize];
            if !spring.may_fail() || in_step(candidate.slot as usize) || reported.contains(&candidate.spring)
            {
                continue;
            }
            let (tension, length) = tension(elements, particles, known, candidate.spring);
            let is_beyond = |limit: &f64| {
                tension > *limit && (ends_tick || tension > limit + rounding(elements, reach, &candidate))
            };
            if let Some(limit) = spring.breaking_force.map(f64::from).filter(is_beyond) {
                overloaded.push(Overload { candidate, tension, length, load: tension / limit });
            } else if let Some(strain) = spring.yielded(length) {
                yielded.push((candidate.spring, strain));
            }
        }
        if !overloaded.is_empty() {
            choose(overloaded, waiting);
            broken.extend(overloaded.iter().map(|overload| broken_spring(overload, elements, particles)));
            let released = overloaded
                .iter()
                .map(|overload| overload.candidate)
                .filter(|candidate| candidate.release > 0.0);
            waiting.extend(released.map(|candidate| candidate.island));
            for candidate in overloaded.iter().map(|overload| overload.candidate) {
                if elements.springs().elements()[candidate.spring as usize].tears {
                    reported.push(candidate.spring);
                    waiting.push(candidate.island);
                }
            }
        }
    }
}

/// The tension of a spring, N, as far as it is `known`, else as measured; and its length, m.
fn tension(elements: &Elements, particles: &Particles, known: &[f64], spring: u32) -> (f64, f64) {
    let [length, measured] = elements.measure_spring(spring, particles);
    let known = known.get(spring as usize).copied().filter(|tension| !tension.is_nan());
    (known.unwrap_or(measured), length)
}

/// By how much rounding of positions may change the tension of a spring that rests, N.
fn rounding(elements: &Elements, reach: &[f32], candidate: &Candidate) -> f64 {
    let stiffness = elements.springs().elements()[candidate.spring as usize].stiffness;
    let reach = reach[reach_index(reach.len(), candidate)];
    MAX_ULPS * f64::from(f32::EPSILON * reach) * f64::from(stiffness)
}

fn reach_index(count: usize, candidate: &Candidate) -> usize {
    (candidate.island as usize).min(count - 1)
}

/// Keeps the most overloaded of each island that is not `waiting`, and those that break for certain; by their numbers.
fn choose(overloaded: &mut Vec<Overload>, waiting: &[u32]) {
    let rank = |overload: &Overload| (overload.candidate.island, overload.candidate.spring);
    overloaded.sort_unstable_by(|one, other| {
        let by_island = one.candidate.island.cmp(&other.candidate.island);
        by_island.then(other.load.total_cmp(&one.load)).then(rank(one).cmp(&rank(other)))
    });
    let mut last = None;
    overloaded.retain(|Overload { candidate, load, .. }| {
        let is_first = last.replace(candidate.island) != Some(candidate.island);
        let is_first = is_first && !waiting.contains(&candidate.island);
        is_first || candidate.island == NO_ISLAND || *load >= CERTAIN
    });
    overloaded.sort_unstable_by_key(|overload| overload.candidate.spring);
}

fn broken_spring(overload: &Overload, elements: &Elements, particles: &Particles) -> Broken {
    let number = overload.candidate.spring as usize;
    let spring = elements.springs().elements()[number];
    let [first, second]: [Vec3; 2] = spring_ends(elements, number).map(|end| particles.position.get(end));
    Broken {
        spring: number,
        tension: overload.tension as f32,
        elongation: (overload.length - f64::from(spring.length_at_rest())) as f32,
        point: first.midpoint(second),
    }
}
