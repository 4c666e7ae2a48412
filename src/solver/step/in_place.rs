//! All substeps of a tick in one pass over the blocks.
//!
//! What no element joins, and nothing touches, needs nothing of each other within a tick. Then each block takes its substeps one
//! after the other while it is in the first-level cache, and threads wait for each other once in a tick:
//!
//! ```text
//! block A   1 2 3 4 5 6 7 8
//! block B                   1 2 3 4 5 6 7 8
//! ```
//!
//! The results have the same bits as those of one substep of all blocks after the other.
//!
//! What might touch is looked at after each substep: where something does not hold by which nothing touches, all is put back, and the tick
//! is taken with contacts.

use std::sync::atomic::{AtomicBool, Ordering};

use super::{Caches, Inputs, Plan, State, StepSettings};
use crate::solver::collision::Substep;
use crate::solver::field::Field;
use crate::solver::particles::PinnedMotion;
use crate::solver::schemes::{self, Check, Substeps};

impl Caches {
    /// Advances all particles by all substeps of a tick, each of `duration` seconds, if nothing happens between them but that pinned
    /// particles go on; returns whether it has.
    pub(super) fn advance_in_place(
        &mut self,
        state: &mut State,
        inputs: &Inputs,
        settings: &StepSettings,
        (plan, duration): (Plan, f32),
    ) -> bool {
        if !self.may_advance_in_place(state, plan) {
            return false;
        }
        let may_touch = self.contacts.is_active();
        let with_edges = self.surfaces.are_active();
        let Self { blocks, scratch, motions, contacts, surfaces, before, .. } = self;
        let Some(pinned) = in_order(&inputs.pinned, motions) else { return false };
        let State { elements, particles, contacts: memory, .. } = state;
        let watch = if may_touch {
            let Inputs { colliders, contact_properties: properties, .. } = inputs;
            let (acceleration, integrator, elapsed) = (&scratch.acceleration, plan.integrator, 0.0);
            let substep = Substep {
                elements,
                colliders,
                properties,
                acceleration,
                settings,
                integrator,
                duration,
                elapsed,
            };
            let Some(watch) = contacts.watch(memory, particles, substep, with_edges) else { return false };
            before[0].copy_from(&particles.position);
            before[1].copy_from(&particles.velocity);
            Some(watch)
        } else {
            None
        };
        let has_held = AtomicBool::new(true);
        let check = watch.as_ref().map(|watch| {
            |first: usize, positions: [&[f32]; 3], done: u32| {
                if !watch.holds((first, positions), done) {
                    has_held.store(false, Ordering::Relaxed);
                }
                has_held.load(Ordering::Relaxed)
            }
        });
        let check = check.as_ref().map(|check| check as &Check);
        let (count, time_step) = (plan.substeps, settings.time_step);
        let substeps = Substeps { count, duration, pinned, time_step, check };
        schemes::advance_in_place(
            plan.integrator,
            Field::of(settings, None),
            blocks,
            particles,
            scratch,
            substeps,
        );
        if may_touch {
            let has_held = has_held.into_inner();
            contacts.end_watch(memory, has_held, plan.substeps);
            if !has_held {
                std::mem::swap(&mut particles.position, &mut before[0]);
                std::mem::swap(&mut particles.velocity, &mut before[1]);
                return false;
            }
            if with_edges {
                surfaces.rest(memory);
            }
        }
        for _ in 0..plan.substeps {
            state.releases.iter_mut().for_each(|release| release.time_left -= duration);
        }
        true
    }

    fn may_advance_in_place(&self, state: &State, plan: Plan) -> bool {
        let State { elements, .. } = state;
        plan.substeps > 1
            && plan.stiff_substeps == 0
            && schemes::may_advance_in_place(plan.integrator, &self.blocks)
            && self.air.load().is_none()
            && !(elements.any_ramps() || elements.gases().any_act())
            && (!self.surfaces.are_active() || self.surfaces.are_rows())
            && !(self.strain_limits.any() || self.failures.any())
    }
}

/// The motions in the order of their slots; `None` where two are of one particle. `sorted` is working memory.
fn in_order<'a>(
    motions: &'a [PinnedMotion],
    sorted: &'a mut Vec<PinnedMotion>,
) -> Option<&'a [PinnedMotion]> {
    let ascend = |motions: &[PinnedMotion]| motions.is_sorted_by(|one, next| one.slot < next.slot);
    if ascend(motions) {
        return Some(motions);
    }
    sorted.clear();
    sorted.extend_from_slice(motions);
    sorted.sort_unstable_by_key(|motion| motion.slot);
    ascend(sorted).then_some(sorted)
}

#[cfg(test)]
mod tests {
    use bevy::math::Vec3;

    use super::super::{Outputs, step};
    use super::*;
    use crate::solver::collision::Collider;
    use crate::solver::elements::{Bend, Spring};
    use crate::solver::particles::Vectors;
    use crate::solver::settings::{Integrator, SubstepMode};

    const ROPES: [usize; 7] = [3, 20, 90, 20, 20, 700, 9];

    /// Ropes that hang from their first particles, some of cables, some stiff to bending; the last particle of one is pinned too,
    /// and flies at a velocity that is in no list.
    fn state() -> State {
        let mut state = State::default();
        let State { particles, elements, .. } = &mut state;
        for (rope, &length) in ROPES.iter().enumerate() {
            for number in 0..=length {
                let slot = particles.len() as u32;
                let wobble = |factor: usize| (number * factor % 101) as f32 * 0.0003;
                let position = Vec3::new(0.1 * number as f32 + wobble(7), wobble(13), rope as f32);
                let velocity = Vec3::new(wobble(300), -wobble(17), wobble(5));
                let is_pinned = number == 0 || (rope == 3 && number == length);
                particles.push(position, velocity, if is_pinned { 0.0 } else { 100.0 }, 0.01);
                if number > 0 {
                    let rest_length = 0.1 + wobble(11);
                    let tension_only = rope % 3 == 2;
                    let damping = if rope == 4 { 0.0 } else { 0.1 };
                    let spring =
                        Spring { rest_length, stiffness: 300.0, damping, tension_only, ..Spring::default() };
                    elements.push([slot - 1, slot], spring);
                }
                if number > 1 && rope % 2 == 1 {
                    let bend =
                        Bend { rest_length: 0.0, stiffness: 2.0, damping: 0.0, weights: [1.0, -2.0, 1.0] };
                    elements.push([slot - 2, slot - 1, slot], bend);
                }
            }
        }
        state
    }

    /// Where the first particle of each rope goes in a tick; one stands still. Not in the order of their slots.
    fn motions(state: &State, tick: usize) -> Vec<PinnedMotion> {
        let mut first = 0;
        let mut motions: Vec<PinnedMotion> = ROPES
            .iter()
            .enumerate()
            .map(|(rope, length)| {
                let start = state.particles.position.get(first);
                let displacement =
                    Vec3::new(0.01 * rope as f32, 0.003 * tick as f32, -0.002) * (rope % 4) as f32;
                let motion = PinnedMotion { slot: first, start, target: start + displacement };
                first += length + 1;
                motion
            })
            .collect();
        motions.rotate_left(3);
        motions
    }

    /// The motion in some ticks, and in how many of them blocks were advanced in place: all but that of a ramp, if nothing may
    /// touch anything. In the others there is a half-space far below.
    fn history(settings: &StepSettings, is_pushed: bool, may_touch: bool) -> (Vec<[Vectors; 2]>, usize) {
        let (mut state, mut caches, mut outputs) = (state(), Caches::default(), Outputs::default());
        let mut in_place = 0;
        let history = (0..5).map(|tick| {
            for slot in (0..state.particles.len()).filter(|_| is_pushed) {
                let force = Vec3::new(0.01 * (slot % 7) as f32, -0.02 * tick as f32, 0.0);
                state.particles.applied_force.set(slot, force);
            }
            if tick == 2 {
                let spring = state.elements.springs().elements()[30];
                state.elements.set(30, Spring { rest_length: 0.15, stiffness: 200.0, ..spring });
            }
            let far = Collider::half_space(Vec3::NEG_Y * 1e4, Vec3::Y, 0.5, 0.5);
            let colliders = if may_touch { vec![far] } else { Vec::new() };
            let inputs = Inputs { pinned: motions(&state, tick), colliders, ..Inputs::default() };
            step(&mut state, &inputs, &mut caches, &mut outputs, settings);
            let is_in_place =
                caches.may_advance_in_place(&state, outputs.plan) && !caches.contacts.is_active();
            in_place += usize::from(tick != 2 && is_in_place);
            [state.particles.position.clone(), state.particles.velocity.clone()]
        });
        (history.collect(), in_place)
    }

    #[test]
    fn blocks_that_take_all_substeps_at_once_move_to_the_bit_as_substep_by_substep() {
        for integrator in [Integrator::SemiImplicitEuler, Integrator::VelocityVerlet, Integrator::Auto] {
            for (viscosity, is_pushed) in [(0.0, false), (0.0, true), (0.02, false), (0.02, true)] {
                let substeps =
                    if integrator == Integrator::Auto { SubstepMode::Auto } else { SubstepMode::Fixed(7) };
                let gravity = Vec3::new(0.1, -9.81, 0.0);
                let time_step = 1.0 / 60.0;
                let settings = StepSettings {
                    integrator,
                    substeps,
                    gravity,
                    viscosity,
                    time_step,
                    ..StepSettings::default()
                };
                let (expected, in_place) = history(&settings, is_pushed, true);
                assert_eq!(in_place, 0);
                let (found, in_place) = history(&settings, is_pushed, false);
                assert_eq!(in_place, 4, "{integrator:?}");
                for (tick, (found, expected)) in found.iter().zip(&expected).enumerate() {
                    for (found, expected) in found.iter().zip(expected) {
                        let bits = |vectors: &Vectors| {
                            vectors
                                .axes()
                                .map(|axis| axis.iter().map(|value| value.to_bits()).collect::<Vec<_>>())
                        };
                        assert_eq!(
                            bits(found),
                            bits(expected),
                            "{integrator:?}, {viscosity}, {is_pushed}, tick {tick}"
                        );
                    }
                }
                assert!(found[4][0].y.iter().all(|y| y.is_finite() && y.abs() < 10.0));
                assert_ne!(found[4], found[3]);
            }
        }
    }

    /// Ropes that hang side by side from their first particles, as spheres that touch nothing; with `lone`, one more sphere falls far away:
    /// then contacts are looked for in each substep.
    fn ropes_of_spheres(lone: bool) -> State {
        let mut state = State::default();
        let State { particles, elements, .. } = &mut state;
        for slot in 0..6 * 20_u32 {
            let (rope, number) = (slot / 20, slot % 20);
            let position = Vec3::new(0.07 * number as f32, -0.07 * number as f32, 0.5 * rope as f32);
            particles.push(position, Vec3::ZERO, if number == 0 { 0.0 } else { 10.0 }, 0.02);
            if number > 0 {
                let spring = Spring { rest_length: 0.1, stiffness: 1e3, damping: 0.1, ..Spring::default() };
                elements.push([slot - 1, slot], spring);
            }
        }
        if lone {
            particles.push(Vec3::X * 1e3, Vec3::ZERO, 10.0, 0.02);
        }
        state
    }

    /// Also where a sudden force leads a rope out of what is reserved for it: that tick is put back, and taken with contacts.
    #[test]
    fn ticks_of_free_ropes_are_taken_at_once_and_to_the_bit_as_with_contacts() {
        for collide_springs in [false, true] {
            ticks_are_taken_at_once(StepSettings {
                integrator: Integrator::SemiImplicitEuler,
                substeps: SubstepMode::Fixed(8),
                gravity: Vec3::NEG_Y * 9.81,
                pair_rules: Some(Default::default()),
                collide_springs,
                ..StepSettings::default()
            });
        }
    }

    fn ticks_are_taken_at_once(settings: StepSettings) {
        let far = Collider::half_space(Vec3::NEG_Y * 50.0, Vec3::Y, 0.5, 0.5);
        let history = |lone: bool| {
            let (mut state, mut caches, mut outputs) =
                (ropes_of_spheres(lone), Caches::default(), Outputs::default());
            let (mut positions, mut pauses) = (Vec::new(), Vec::new());
            for tick in 0..60 {
                let force = if tick == 40 { Vec3::Z * 40.0 } else { Vec3::ZERO };
                state.particles.applied_force.set(30, force);
                let inputs = Inputs { colliders: vec![far.clone()], ..Inputs::default() };
                step(&mut state, &inputs, &mut caches, &mut outputs, &settings);
                assert_eq!(outputs.contact_count, 0, "tick {tick}");
                positions.push((0..120).map(|slot| state.particles.position.get(slot)).collect::<Vec<_>>());
                pauses.push(state.contacts.ticks_to_pause());
            }
            (positions, pauses)
        };
        let (expected, pauses) = history(true);
        assert_eq!(pauses, [None; 60], "with a lone sphere no tick is taken at once");
        let (found, pauses) = history(false);
        // From rest a box is too small at first.
        let is_taken = |pause: &Option<u32>| *pause == Some(0);
        assert!(pauses[2..40].iter().all(is_taken) && !is_taken(&pauses[40]), "{pauses:?}");
        assert!(pauses[41..].iter().any(is_taken), "{pauses:?}");
        for (tick, (found, expected)) in found.iter().zip(&expected).enumerate() {
            assert_eq!(found, expected, "tick {tick}");
        }
        assert!(found[40][30].z - found[39][30].z > 0.03);
    }

    #[test]
    fn two_motions_of_one_particle_are_left_to_the_ordinary_way() {
        let motion = |slot, x| PinnedMotion { slot, start: Vec3::ZERO, target: Vec3::X * x };
        let mut sorted = Vec::new();
        let ordered = in_order(&[motion(5, 1.0), motion(2, 2.0)], &mut sorted).map(<[_]>::to_vec);
        assert_eq!(ordered, Some(vec![motion(2, 2.0), motion(5, 1.0)]));
        assert_eq!(in_order(&[motion(2, 1.0), motion(5, 2.0), motion(2, 3.0)], &mut sorted), None);
    }
}
