//! Which surfaces would collide in an implicit step: their contacts become a part of it. And which may touch in a tick: those take one
//! scheme.

use bevy::math::{DVec3, Vec3, Vec3A};

use super::confine::ATTEMPTS;
use super::contact::{Evaluations, Examination, Meeting};
use super::pair::{CLOSE_PART, Kind, MIN_DISTANCE_PART};
use super::search::{Candidate, Moving};
use super::{Surfaces, rebound_of};
use crate::solver::graph::Islands;
use crate::solver::particles::{Particles, Vectors};
use crate::solver::settings::{Integrator, StepSettings};

use super::super::material::ContactProperties;

/// Upper estimate of the displacement by elements in a tick, as a fraction of the largest free-flight displacement. It only decides
/// which nets take one scheme.
pub(in crate::solver::collision) const MAX_ELEMENT_SHARE: f32 = 0.25;

/// Beyond the contact distance, the fraction of it within which a pair counts as touching, so that schemes do not alternate where nets
/// bounce on each other.
pub(in crate::solver::collision) const CONTACT_HYSTERESIS: f32 = 0.5;

/// A point of one surface that is not to come nearer to a point of another one than they touch, along a direction that is fixed
/// for a step.
#[derive(Debug, Clone, Copy)]
pub(in crate::solver) struct StiffContact {
    /// A corner may be in two places, one of them of weight 0.
    pub slots: [u32; 4],
    /// Those of the first side add up to 1, those of the second to −1.
    pub weights: [f64; 4],
    /// From the second side to the first.
    pub normal: DVec3,
    /// The distance that they keep, m.
    pub reach: f64,
    /// The distance at which they are stopped, m.
    pub least: f64,
    /// Coefficient of restitution.
    pub restitution: f64,
    /// Coefficient of Coulomb friction.
    pub friction: f64,
    kind: Kind,
}

impl StiffContact {
    /// What pair it is.
    pub fn key(&self) -> ([u32; 4], u8) {
        (self.slots, self.kind as u8)
    }

    /// The corners that have a part in it, with their weights.
    pub fn corners(&self) -> impl Iterator<Item = (usize, f64)> {
        let all = self.slots.into_iter().zip(self.weights);
        all.filter(|(_, weight)| *weight != 0.0).map(|(slot, weight)| (slot as usize, weight))
    }
}

impl Surfaces {
    /// Appends to `found` the contacts of what has touched on the way from `start` to the present positions in a step of `h`
    /// seconds, and is not in it already. Only those with free corners that are all advanced in that step, and one of these
    /// `is_in_island`; pinned particles move at their velocities.
    pub fn find_stiff(
        &mut self,
        (start, particles, h): (&Vectors, &Particles, f32),
        (settings, properties): (&StepSettings, &[ContactProperties]),
        is_in_island: impl Fn(u32) -> bool,
        is_advanced: impl Fn(u32) -> bool,
        found: &mut Vec<StiffContact>,
    ) {
        let Some(rules) = settings.pair_rules.filter(|_| self.is_active) else { return };
        let Self { search, primitives, end, confinement, .. } = self;
        end.copy_from(&particles.position);
        for slot in (0..particles.len()).filter(|slot| particles.is_pinned(*slot)) {
            end.set(slot, start.get(slot) + h * particles.velocity.get(slot));
        }
        let rebound = rebound_of(settings, (Integrator::ImplicitEuler, h));
        search.ensure(primitives, Moving { start, end, particles }, (properties, Some(0.0)));
        for with_common in ATTEMPTS {
            if !search.is_overfull {
                break;
            }
            confinement.find(primitives, (start, end, particles), with_common);
            confinement.shorten(start, end);
            search.ensure(primitives, Moving { start, end, particles }, (properties, Some(0.0)));
        }
        let moving = Moving { start, end, particles };
        let examination = Examination {
            evaluated: Evaluations::default(),
            moving,
            acceleration: start,
            rebound,
            rules,
            properties,
            search,
            on_mesh: &primitives.on_mesh,
        };
        let is_free = |slot: &&u32| !particles.is_pinned(**slot as usize);
        let known = found.len();
        for near in search.near() {
            let candidate = search.candidate(*near);
            let free = || candidate.slots.iter().filter(is_free);
            if !free().all(|slot| is_advanced(*slot)) || !free().any(|slot| is_in_island(*slot)) {
                continue;
            }
            let Some(meeting) = examination.meeting(*near, 0.0) else { continue };
            if meeting.gap >= meeting.reach {
                continue;
            }
            let contact = stiff_contact(candidate, meeting, examination.coefficients(candidate));
            let may_move = contact.corners().any(|(slot, _)| !particles.is_pinned(slot));
            let is_known = || found[..known].binary_search_by_key(&contact.key(), StiffContact::key).is_ok();
            if may_move && !is_known() {
                found.push(contact);
            }
        }
        found.sort_unstable_by_key(StiffContact::key);
    }

    /// Appends to `touching` the islands of each pair of several ones that touches when a tick begins, or would in it in free flight.
    pub fn find_touching(
        &mut self,
        particles: &Particles,
        (settings, properties, islands): (&StepSettings, &[ContactProperties], &Islands),
        touching: &mut Vec<[usize; 2]>,
    ) {
        if !self.is_active || islands.all().len() < 2 {
            return;
        }
        let Self { search, primitives, start, end, .. } = self;
        let StepSettings { time_step, gravity, .. } = *settings;
        start.copy_from(&particles.position);
        search.begin_substep(start);
        // All of it is overwritten.
        end.copy_from(start);
        for slot in 0..particles.len() {
            let falls = if particles.is_pinned(slot) { Vec3::ZERO } else { time_step * gravity };
            end.set(slot, start.get(slot) + time_step * (particles.velocity.get(slot) + falls));
        }
        let displacements = (0..particles.len()).map(|slot| (end.get(slot) - start.get(slot)).length());
        let longest = displacements.filter(|displacement| displacement.is_finite()).fold(0.0, f32::max);
        let thickest = particles.radius().iter().copied().fold(0.0, f32::max);
        let margin = (MAX_ELEMENT_SHARE * longest).min(2.0 * thickest);
        let moving = Moving { start, end, particles };
        let reach = margin + CONTACT_HYSTERESIS * 2.0 * thickest;
        let forest = &primitives.forest;
        let within =
            forest.bodies.iter().any(|body| several(islands, forest.vertices_of(body)).next().is_some());
        search.ensure_candidates(primitives, moving, (properties, reach, within));
        for (candidate, least) in search.holding().filter(|(candidate, _)| within || !candidate.is_within) {
            let most = (1.0 + CONTACT_HYSTERESIS) * candidate.largest_reach() + margin;
            let mut pairs = several(islands, &candidate.slots).peekable();
            if pairs.peek().is_none() || least > most {
                continue;
            }
            let paths = candidate.paths(moving);
            let distance = paths.closest(0.0).apart.length();
            if distance <= most || paths.first_near(distance, most / (1.0 + CLOSE_PART)) < 1.0 {
                touching.extend(pairs);
            }
        }
    }
}

/// The islands that free ones of some particles are of, the first of them with each other one.
fn several<'a>(islands: &'a Islands, slots: &'a [u32]) -> impl Iterator<Item = [usize; 2]> + 'a {
    let mut own = slots.iter().filter_map(|slot| islands.of(*slot as usize));
    let first = own.next();
    own.filter_map(move |other| first.filter(|first| *first != other).map(|first| [first, other]))
}

fn stiff_contact(
    candidate: &Candidate,
    Meeting { weights, normal, reach, .. }: Meeting,
    [restitution, friction]: [f32; 2],
) -> StiffContact {
    let unit = |vector: Vec3A| vector.as_dvec3().normalize();
    StiffContact {
        slots: candidate.slots,
        weights: balanced(weights, candidate.kind.first_side()),
        normal: unit(normal),
        reach: reach.into(),
        least: (MIN_DISTANCE_PART * candidate.largest_reach()).into(),
        restitution: restitution.into(),
        friction: friction.into(),
        kind: candidate.kind,
    }
}

/// The weights of which those of the `first` corners add up to 1 and the others to −1, without the rounding of an f32.
fn balanced(weights: [f32; 4], first: usize) -> [f64; 4] {
    let mut weights = weights.map(f64::from);
    let (one, other) = weights.split_at_mut(first);
    let (sum, other_sum) = (one.iter().sum::<f64>(), -other.iter().sum::<f64>());
    one.iter_mut().for_each(|weight| *weight /= sum);
    other.iter_mut().for_each(|weight| *weight /= other_sum);
    weights
}
