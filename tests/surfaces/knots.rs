//! Knots: a rope against itself.

use bevy::math::Vec3;
use bevy_mass_spring::solver::{Integrator, PairRules, Solver, Spring, StepSettings, SubstepMode};

use crate::common::bodies::positions;
use crate::common::crossings::Shapes;

/// m
const RADIUS: f32 = 0.005;

/// Places along an overhand knot with long ends, evenly, `count` + 1 of them on `length` m: Shastri's polynomial trefoil,
/// (t³ − 3t, t⁴ − 4t², t⁵ − 10t), flattened.
fn overhand(length: f32, count: usize) -> Vec<Vec3> {
    let fine: Vec<Vec3> = (0..=20_000)
        .map(|number| {
            let t = -2.35 + 4.7 * number as f32 / 20_000.0;
            let (square, cube) = (t * t, t * t * t);
            Vec3::new(cube - 3.0 * t, square * square - 4.0 * square, 0.25 * (cube * square - 10.0 * t))
        })
        .collect();
    let total: f32 = fine.windows(2).map(|pair| pair[0].distance(pair[1])).sum();
    let scale = length / total;
    let (mut places, mut walked) = (vec![fine[0] * scale], 0.0);
    for pair in fine.windows(2) {
        walked += pair[0].distance(pair[1]);
        if walked >= total * places.len() as f32 / count as f32 && places.len() < count {
            places.push(pair[1] * scale);
        }
    }
    places.push(fine[fine.len() - 1] * scale);
    places
}

/// Pulls the ends of a knotted rope apart by 4 N for a second: nothing crosses, the knot is tight and there.
#[test]
fn an_overhand_knot_is_pulled_tight_without_a_crossing() {
    for friction in [0.0, 0.3] {
        let (length, count) = (2.0, 240);
        let mut solver = Solver::default();
        let places = overhand(length, count);
        let mass = 0.1 * length / count as f32;
        for place in &places {
            solver.add_particle(*place, Vec3::ZERO, mass, RADIUS).unwrap();
        }
        for link in 0..count {
            let rest_length = places[link].distance(places[link + 1]);
            let stiffness = 150.0 / rest_length;
            let spring = Spring { rest_length, stiffness, damping: 5e-5 * stiffness, ..Spring::default() };
            solver.add_spring([link, link + 1], spring).unwrap();
            solver.add_collision_edge([link, link + 1]).unwrap();
        }
        let pull = (places[count] - places[0]).normalize() * 4.0;
        solver.set_applied_force(0, -pull);
        solver.set_applied_force(count, pull);
        let settings = StepSettings {
            integrator: Integrator::SemiImplicitEuler,
            substeps: SubstepMode::Fixed(1),
            time_step: 1.0 / 6000.0,
            viscosity: 0.01,
            pair_rules: Some(PairRules { restitution: 0.0, friction }),
            ..StepSettings::default()
        };
        let edges = (0..count).map(|link| [link, link + 1]).collect();
        let shapes = Shapes { edges, ..Shapes::default() };
        let mut before = positions(&solver);
        for tick in 0..7200 {
            solver.step(&settings);
            let after = positions(&solver);
            assert_eq!(shapes.passings(&before, &after), 0, "μ = {friction}, tick {tick}");
            before = after;
        }
        // A tight overhand knot of no friction takes at least 10.1 diameters of rope (Pieranski et al., *New J. Phys.* 3, 10,
        // 2001, of the open trefoil), less what the tension of 4 N stretches: 2.7 %.
        let taken = length * (1.0 + 4.0 / 150.0) - before[0].distance(before[count]);
        println!("μ = {friction}: {} diameters", taken / (2.0 * RADIUS));
        assert!(taken > 8.0 * 2.0 * RADIUS, "μ = {friction}: {} diameters", taken / (2.0 * RADIUS));
        assert!(taken < 40.0 * 2.0 * RADIUS, "μ = {friction}: {} diameters", taken / (2.0 * RADIUS));
    }
}
