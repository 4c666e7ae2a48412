//! Many particles in one place: they come apart slowly, in all directions, and with bounded work.

use bevy::math::Vec3;
use bevy_mass_spring::solver::{Integrator, Solver, StepSettings};

use crate::common::bodies::{
    Ball, falling, floating, positions, solver_bits, velocities, with_ground, world,
};

fn crowd(count: usize) -> Solver {
    world((0..count).map(|_| Ball::at(Vec3::ZERO)))
}

/// In a crowd overlaps displace a particle by about 10 times the sum of two radii in a second, 2 m/s here. At its edge
/// they are undone at once, as those of two balls are: that is less than three diameters in a tick. Never does an
/// overlap give a velocity.
#[test]
fn coincident_balls_come_apart_at_a_bounded_speed() {
    for count in [2, 3, 30, 400] {
        let mut state = crowd(count);
        let settings = floating(Integrator::SemiImplicitEuler, 0.0);
        let mut places = positions(&state);
        for tick in 0..600 {
            state.step(&settings);
            let next = positions(&state);
            let ways: Vec<f32> = places.iter().zip(&next).map(|(one, other)| one.distance(*other)).collect();
            assert!(ways.iter().all(|way| *way < 0.6), "{count}, tick {tick}: {ways:?}");
            let mean = ways.iter().sum::<f32>() / count as f32;
            assert!(count < 30 || tick > 2 || mean < 2.0 / 60.0, "{count}, tick {tick}: {mean} m");
            places = next;
            assert!(velocities(&state).iter().all(|velocity| *velocity == Vec3::ZERO), "{count}");
        }
        for (slot, one) in places.iter().enumerate() {
            for other in &places[slot + 1..] {
                assert!(one.distance(*other) > 0.2 * 0.99, "{count}: {} m apart", one.distance(*other));
            }
        }
        let middle = places.iter().sum::<Vec3>() / count as f32;
        assert!(middle.length() < 1e-3, "the corrections of a pair are opposite: {middle}");
        if count >= 30 {
            for axis in 0..3 {
                let spread = places.iter().map(|place| place[axis]);
                let (least, most) = spread.fold((0.0_f32, 0.0_f32), |(l, m), x| (l.min(x), m.max(x)));
                assert!(least < -0.15 && most > 0.15, "{count}: {least} to {most} along {axis}");
            }
        }
    }
}

/// Under gravity and onto the ground: never more kinetic energy than the fall of all brings, from the height to which the
/// overlaps lift them at most.
#[test]
fn overlaps_give_no_energy() {
    let mut state = with_ground(world((0..500).map(|_| Ball::at(Vec3::Y * 1.1))), 0.0, 0.3);
    let settings = falling(Integrator::SemiImplicitEuler, 4);
    let settings = StepSettings { pair_rules: Some(Default::default()), ..settings };
    let start = state.measure(settings.gravity).gravitational_energy;
    let mut last = 0.0;
    for tick in 0..600 {
        state.step(&settings);
        let totals = state.measure(settings.gravity);
        // 500 balls of 1 kg, 1 m above the ground.
        assert!(totals.kinetic_energy < 500.0 * 9.81 * 1.05, "tick {tick}: {} J", totals.kinetic_energy);
        assert!(totals.gravitational_energy < start * 1.1, "tick {tick}: {} J", totals.gravitational_energy);
        last = totals.kinetic_energy;
    }
    assert!(last < 0.02 * 500.0 * 9.81, "{last} J after 10 s");
}

/// Without bounds the pairs of 20,000 in one place would be 200 millions. A particle touches at most 64 others at once, and no overlap
/// gives a velocity.
#[test]
fn the_work_of_a_crowd_is_bounded() {
    let count = 20_000;
    let mut state = crowd(count);
    let settings = floating(Integrator::SemiImplicitEuler, 0.0);
    for tick in 0..10 {
        state.step(&settings);
        assert!(state.outputs().contact_count < count * 64, "tick {tick}");
        assert!(velocities(&state).iter().all(|velocity| *velocity == Vec3::ZERO), "tick {tick}");
    }
    let spread = positions(&state).iter().map(|place| place.length()).fold(0.0, f32::max);
    // At most three diameters in a tick, see above.
    assert!(spread > 0.2 && spread < 10.0 * 0.6, "{spread} m");
}

#[test]
fn crowds_follow_from_the_state() {
    let mut solvers = [crowd(300), crowd(300)];
    let settings =
        StepSettings { gravity: Vec3::NEG_Y * 9.81, ..floating(Integrator::SemiImplicitEuler, 0.3) };
    for tick in 0..60 {
        solvers[1].drop_caches();
        for solver in &mut solvers {
            solver.step(&settings);
        }
        assert!(solver_bits(&solvers[0]) == solver_bits(&solvers[1]), "tick {tick}");
    }
}
