//! Particles with a prescribed motion, in the pure solver: where they are in each substep, and what
//! springs and dampers see of it.

use crate::common::bodies::{positions, velocities};
use bevy::math::Vec3;
use bevy_mass_spring::solver::{self, Integrator, PinnedMotion, Solver, StepSettings, SubstepMode};

const TICK: f32 = 1.0 / 64.0;

/// A pinned particle at the origin, and one of 2 kg at x = 1 m.
fn pair(stiffness: f32, damping: f32) -> Solver {
    let mut state = Solver::default();
    state.add_particle(Vec3::ZERO, Vec3::ZERO, f32::INFINITY, 0.0).unwrap();
    state.add_particle(Vec3::X, Vec3::ZERO, 2.0, 0.0).unwrap();
    state
        .add_spring(
            [0, 1],
            solver::Spring { rest_length: 1.0, stiffness, damping, ..solver::Spring::default() },
        )
        .unwrap();
    state
}

/// Sends the pinned particle to `target`.
fn send(state: &mut Solver, target: Vec3) {
    let start = state.position(0);
    state.inputs_mut().pinned = vec![PinnedMotion { slot: 0, start, target }];
}

fn settings(scheme: Integrator, substeps: u32) -> StepSettings {
    StepSettings {
        integrator: scheme,
        substeps: SubstepMode::Fixed(substeps),
        time_step: TICK,
        ..StepSettings::default()
    }
}

#[test]
fn the_target_is_reached_exactly_with_the_velocity_of_the_motion() {
    for scheme in Integrator::named() {
        for substeps in [1, 3, 7, 10] {
            let mut state = pair(300.0, 2.0);
            let mut last = Vec3::ZERO;
            for target in [Vec3::new(0.1, 0.7, -0.3), Vec3::new(0.1, 0.7, -0.3), Vec3::new(0.2, 0.3, 1e-5)] {
                send(&mut state, target);
                state.step(&settings(scheme, substeps));
                assert_eq!(state.position(0), target, "{scheme:?}, {substeps}");
                assert_eq!(state.velocity(0), (target - last) / TICK, "{scheme:?}");
                last = target;
            }
        }
    }
}

/// A motion that was ordered before the state was put back begins where the state has the particle.
#[test]
fn a_restored_solver_repeats_a_motion() {
    for scheme in Integrator::named() {
        let mut solver = pair(300.0, 2.0);
        let settings = settings(scheme, 3);
        solver.step(&settings);
        let saved = solver.state().clone();
        solver.move_pinned(0, Vec3::new(0.1, 0.7, -0.3));
        let mut history = |_| {
            solver.restore(saved.clone());
            std::array::from_fn::<_, 5, _>(|_| {
                solver.step(&settings);
                [solver.position(0), solver.position(1), solver.velocity(1)]
            })
        };
        let [first, second] = [0, 1].map(&mut history);
        assert_eq!(first, second, "{scheme}");
        assert_ne!(first[0][2], Vec3::ZERO, "{scheme}");
    }
}

#[test]
fn no_force_moves_it() {
    for scheme in Integrator::named() {
        let mut state = pair(300.0, 2.0);
        state.set_position(1, Vec3::new(3.0, 1.0, 0.0));
        state.set_applied_force(0, Vec3::splat(1e3));
        let settings = StepSettings { gravity: Vec3::Y * -9.81, viscosity: 1.0, ..settings(scheme, 4) };
        for _ in 0..100 {
            send(&mut state, Vec3::ZERO);
            state.step(&settings);
            assert_eq!(state.position(0), Vec3::ZERO, "{scheme:?}");
            assert_eq!(state.velocity(0), Vec3::ZERO, "{scheme:?}");
        }
    }
}

/// With a damper c alone and an anchor that moves away at V along it, the particle is accelerated by
/// c (V − v) / m; all numbers are powers of two, so explicit Euler's v += h c (V − v) / m is exact.
#[test]
fn a_damper_sees_the_velocity_of_the_motion_from_the_first_substep_on() {
    let (damping, speed, substep) = (16.0_f32, -2.0_f32, TICK / 4.0);
    let mut state = pair(0.0, damping);
    send(&mut state, Vec3::X * speed * TICK);
    state.step(&settings(Integrator::ExplicitEuler, 4));
    let mut velocity = 0.0_f32;
    for _ in 0..4 {
        velocity += substep * (damping * (speed - velocity) / 2.0);
    }
    assert_eq!(state.velocity(1), Vec3::X * velocity);
}

/// With a spring alone, explicit Euler's k-th substep feels the anchor where it was at the start of that
/// substep: after k/n of the way. If it jumped to the target at once, or stayed until the end, the
/// change of velocity would differ by 2.5 or be missing.
#[test]
fn the_motion_is_spread_evenly_over_the_substeps() {
    let (stiffness, substeps) = (64.0_f32, 4_u16);
    let way = -1.0 / 16.0;
    let mut state = pair(stiffness, 0.0);
    send(&mut state, Vec3::X * way);
    state.step(&settings(Integrator::ExplicitEuler, substeps.into()));

    let substep = TICK / f32::from(substeps);
    let (mut position, mut velocity) = (1.0_f32, 0.0_f32);
    for done in 0..substeps {
        let anchor = way * f32::from(done) / f32::from(substeps);
        let acceleration = -stiffness * (position - anchor - 1.0) / 2.0;
        position += substep * velocity;
        velocity += substep * acceleration;
    }
    // The numbers are dyadic with few bits: not a single rounding.
    assert_eq!(state.position(1), Vec3::X * position);
    assert_eq!(state.velocity(1), Vec3::X * velocity);
}

/// A tick of n substeps is the same as n ticks of one, the anchor going a part of the way in each. With
/// damping not so of velocity Verlet, which evaluates the forces again when a tick begins.
#[test]
fn substeps_are_ticks_in_small() {
    for scheme in Integrator::named() {
        let damping = if scheme == Integrator::VelocityVerlet { 0.0 } else { 2.0 };
        let (mut whole, mut parts) = (pair(300.0, damping), pair(300.0, damping));
        let target = Vec3::new(-0.25, 0.5, 0.125);
        send(&mut whole, target);
        whole.step(&settings(scheme, 4));
        for part in 1..=4_u8 {
            send(&mut parts, target * f32::from(part) / 4.0);
            parts.step(&StepSettings { time_step: TICK / 4.0, ..settings(scheme, 1) });
        }
        assert_eq!(positions(&whole), positions(&parts), "{scheme:?}");
        assert_eq!(velocities(&whole), velocities(&parts), "{scheme:?}");
    }
}
