//! Knots: a rope against itself.

use bevy::math::Vec3;
use bevy_mass_spring::solver::{Integrator, PairRules, Solver, Spring, StepSettings, SubstepMode};

use crate::common::bodies::positions;
use crate::common::crossings::Shapes;
use crate::common::curves::overhand;

/// m
pub const RADIUS: f32 = 0.005;

/// m
const LENGTH: f32 = 2.0;

/// Number of links.
const COUNT: usize = 240;

/// A rope of 0.1 kg/m with an overhand knot, of a stretch stiffness EA in N.
fn knotted_rope(stretch_stiffness: f32) -> Solver {
    let mut solver = Solver::default();
    let places = overhand(LENGTH, COUNT);
    for place in &places {
        solver.add_particle(*place, Vec3::ZERO, 0.1 * LENGTH / COUNT as f32, RADIUS).unwrap();
    }
    for link in 0..COUNT {
        let rest_length = places[link].distance(places[link + 1]);
        let stiffness = stretch_stiffness / rest_length;
        let spring = Spring { rest_length, stiffness, damping: 5e-5 * stiffness, ..Spring::default() };
        solver.add_spring([link, link + 1], spring).unwrap();
        solver.add_collision_edge([link, link + 1]).unwrap();
    }
    solver
}

/// Advances the solver by a tick of one step, in which nothing may pass through anything.
fn step(solver: &mut Solver, settings: &StepSettings, tick: usize) {
    let shapes = Shapes { edges: (0..COUNT).map(|link| [link, link + 1]).collect(), ..Shapes::default() };
    let before = positions(solver);
    solver.step(settings);
    let passings = shapes.passings(&before, &positions(solver));
    assert_eq!(passings, 0, "{}, {:?}, tick {tick}", settings.integrator, settings.pair_rules);
}

/// Pulls the ends of a knotted rope apart by 4 N for a second: nothing crosses, the knot is tight and there.
#[test]
fn an_overhand_knot_is_pulled_tight_without_a_crossing() {
    for friction in [0.0, 0.3] {
        let mut solver = knotted_rope(150.0);
        let apart = solver.position(COUNT) - solver.position(0);
        let pull = apart.normalize() * 4.0;
        solver.set_applied_force(0, -pull);
        solver.set_applied_force(COUNT, pull);
        let settings = StepSettings {
            integrator: Integrator::SemiImplicitEuler,
            substeps: SubstepMode::Fixed(1),
            time_step: 1.0 / 6000.0,
            viscosity: 0.01,
            pair_rules: Some(PairRules { restitution: 0.0, friction }),
            ..StepSettings::default()
        };
        for tick in 0..7200 {
            step(&mut solver, &settings, tick);
        }
        // A tight overhand knot of no friction takes at least 10.1 diameters of rope (Pieranski et al., *New J. Phys.* 3, 10,
        // 2001, of the open trefoil), less what the tension of 4 N stretches: 2.7 %.
        let taken = LENGTH * (1.0 + 4.0 / 150.0) - solver.position(0).distance(solver.position(COUNT));
        println!("μ = {friction}: {} diameters", taken / (2.0 * RADIUS));
        assert!(taken > 8.0 * 2.0 * RADIUS, "μ = {friction}: {} diameters", taken / (2.0 * RADIUS));
        assert!(taken < 40.0 * 2.0 * RADIUS, "μ = {friction}: {} diameters", taken / (2.0 * RADIUS));
    }
}

/// Moves the ends of a knotted rope apart, to a good part more than it is long: the knot is there, and nothing has crossed.
#[test]
fn a_knot_that_is_pulled_with_far_too_much_force_stays_a_knot() {
    for integrator in [Integrator::ImplicitEuler, Integrator::TrBdf2] {
        let mut solver = knotted_rope(3000.0);
        let ends = [0, COUNT].map(|end| solver.position(end));
        [0, COUNT].into_iter().for_each(|end| solver.set_mass(end, f32::INFINITY).unwrap());
        let settings = StepSettings {
            integrator,
            substeps: SubstepMode::Fixed(1),
            time_step: 1.0 / 240.0,
            pair_rules: Some(PairRules { restitution: 0.0, friction: 0.3 }),
            ..StepSettings::default()
        };
        let way = 0.5 * (1.1 * LENGTH - ends[0].distance(ends[1])) * (ends[1] - ends[0]).normalize();
        let ticks = 480;
        for tick in 1..=ticks {
            let part = tick as f32 / ticks as f32;
            solver.move_pinned(0, ends[0] - part * way);
            solver.move_pinned(COUNT, ends[1] + part * way);
            step(&mut solver, &settings, tick);
        }
        assert!(positions(&solver).iter().all(|place| place.is_finite()), "{integrator}");
    }
}
