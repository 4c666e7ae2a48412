//! What is shot at cloths and ropes does not get through.

use bevy::math::{Quat, UVec2, Vec3};
use bevy_mass_spring::nets::{Cloth, ClothMaterial, Rope, RopeMaterial};
use bevy_mass_spring::solver::{Integrator, PairRules, Solver, StepSettings, SubstepMode};

use super::{ELASTIC, SCHEMES, SOFT};
use crate::common::bodies::{add_net, positions};
use crate::common::crossings::Shapes;

/// Number of shots of each kind by each scheme.
const SHOTS: u32 = if cfg!(debug_assertions) { 6 } else { 40 };

/// With a random restitution and friction.
fn settings(integrator: Integrator, substeps: u32, numbers: &mut Numbers) -> StepSettings {
    StepSettings {
        integrator,
        // One a tick, so that all go straight from tick to tick.
        substeps: SubstepMode::Fixed(1),
        time_step: 1.0 / 60.0 / substeps as f32,
        gravity: Vec3::NEG_Y * 9.81,
        pair_rules: Some(PairRules { restitution: numbers.next(), friction: numbers.next() }),
        ..StepSettings::default()
    }
}

/// Numbers in 0..1 (a linear congruence).
pub struct Numbers(pub u64);

impl Numbers {
    pub fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f32 / (1 << 24) as f32
    }

    fn direction(&mut self) -> Vec3 {
        loop {
            let place = Vec3::new(self.next(), self.next(), self.next()) * 2.0 - 1.0;
            if (0.01..1.0).contains(&place.length_squared()) {
                return place.normalize();
            }
        }
    }
}

fn is_explicit(integrator: Integrator) -> bool {
    integrator == Integrator::SemiImplicitEuler
}

/// A cloth of 1 m whose border is pinned, in the plane y = 0.
fn cloth(solver: &mut Solver, cells: u32, radius: f32, integrator: Integrator) -> Shapes {
    let first = solver.particle_count();
    let cloth = Cloth::grid(Vec3::new(-0.5, 0.0, -0.5), Vec3::X, Vec3::Z, UVec2::splat(cells))
        .with_radius(radius)
        .with_material(if is_explicit(integrator) { SOFT } else { ClothMaterial::COTTON });
    let topology = cloth.topology().unwrap();
    let row = cells + 1;
    let is_border =
        |number: &u32| [number / row, number % row].iter().any(|place| *place == 0 || *place == cells);
    let pinned: Vec<u32> = (0..row * row).filter(is_border).collect();
    add_net(solver, &topology, Vec3::ZERO, &pinned);
    let triangles = topology.triangles.iter();
    Shapes::of_triangles(triangles.map(|corners| corners.map(|corner| first + corner as usize)).collect())
}

fn shoot(mut solver: Solver, shapes: &Shapes, settings: &StepSettings, ticks: u32, case: &str) {
    let mut before = positions(&solver);
    for tick in 0..ticks {
        solver.step(settings);
        let after = positions(&solver);
        assert!(after.iter().all(|place| place.is_finite()), "{case}, tick {tick}");
        assert_eq!(shapes.passings(&before, &after), 0, "{case}, tick {tick}");
        before = after;
    }
}

#[test]
fn balls_do_not_pass_through_a_cloth() {
    let mut numbers = Numbers(1);
    for integrator in SCHEMES {
        for shot in 0..SHOTS {
            let mut solver = Solver::default();
            let mut shapes = cloth(&mut solver, 10, 0.005, integrator);
            let target = Vec3::new(numbers.next() - 0.5, 0.0, numbers.next() - 0.5) * 0.6;
            let mut direction = numbers.direction();
            direction.y = -direction.y.abs() - 0.3;
            let direction = direction.normalize();
            let speed = 10.0 * 100.0_f32.powf(numbers.next());
            let radius = 0.002 + 0.1 * numbers.next();
            let ball = target - direction * (0.5 + radius);
            shapes.points.push(solver.add_particle(ball, direction * speed, 0.05, radius).unwrap());
            let case = format!("{integrator}, shot {shot}: {speed} m/s, radius {radius}");
            shoot(solver, &shapes, &settings(integrator, 16, &mut numbers), 160, &case);
        }
    }
}

#[test]
fn ropes_do_not_pass_through_ropes() {
    let mut numbers = Numbers(2);
    for integrator in SCHEMES {
        for shot in 0..SHOTS {
            let mut solver = Solver::default();
            let material = if is_explicit(integrator) { ELASTIC } else { RopeMaterial::HEMP };
            let rope = Rope::new(1.0).with_segments(20).with_radius(0.005).with_material(material);
            let rope = rope.topology().unwrap();
            let last = rope.positions.len() as u32 - 1;
            add_net(&mut solver, &rope, Vec3::ZERO, &[0, last]);
            let across = Rope::between(Vec3::new(0.0, 0.0, -0.3), Vec3::new(0.0, 0.0, 0.3));
            let across =
                across.with_segments(12).with_radius(0.005).with_material(material).topology().unwrap();
            let middle = 0.5 * (rope.positions[0] + rope.positions[last as usize]);
            add_net(&mut solver, &across, middle + Vec3::new(0.0, 0.3, 0.0), &[]);
            let speed = 10.0 * 100.0_f32.powf(numbers.next());
            for slot in rope.positions.len()..solver.particle_count() {
                solver.set_velocity(slot, Vec3::NEG_Y * speed);
            }
            let count = rope.positions.len();
            let edges = (0..last as usize).map(|link| [link, link + 1]);
            let other = (count..solver.particle_count() - 1).map(|link| [link, link + 1]);
            let shapes = Shapes { edges: edges.chain(other).collect(), ..Shapes::default() };
            let case = format!("{integrator}, shot {shot}: {speed} m/s");
            shoot(solver, &shapes, &settings(integrator, 8, &mut numbers), 80, &case);
        }
    }
}

#[test]
fn cloths_and_ropes_do_not_pass_through_a_cloth() {
    let mut numbers = Numbers(3);
    for integrator in SCHEMES {
        for shot in 0..4 {
            let mut solver = Solver::default();
            let mut shapes = cloth(&mut solver, 10, 0.005, integrator);
            let first = solver.particle_count();
            let turn = Quat::from_axis_angle(numbers.direction(), 3.0 * numbers.next());
            let (cloth, rope) = (shot % 2 == 0, is_explicit(integrator));
            let thrown = if cloth {
                let corner = Vec3::new(-0.1, -0.1, 0.0);
                let cloth = Cloth::grid(corner, Vec3::X * 0.2, Vec3::Y * 0.2, UVec2::splat(4));
                let material = if rope { SOFT } else { ClothMaterial::COTTON };
                cloth.with_radius(0.005).with_material(material).topology().unwrap()
            } else {
                let material = if rope { ELASTIC } else { RopeMaterial::HEMP };
                let rope = Rope::between(Vec3::X * -0.2, Vec3::X * 0.2).with_segments(8);
                rope.with_radius(0.005).with_material(material).topology().unwrap()
            };
            let mut topology = thrown.clone();
            for place in &mut topology.positions {
                *place = turn * *place;
            }
            add_net(&mut solver, &topology, Vec3::Y * 0.4, &[]);
            let speed = 10.0 * 100.0_f32.powf(numbers.next());
            for slot in first..solver.particle_count() {
                solver.set_velocity(slot, Vec3::NEG_Y * speed);
            }
            let corners = |list: &[u32; 3]| list.map(|corner| first + corner as usize);
            let triangles = topology.triangles.iter().map(corners).collect();
            let edges = topology.springs.iter().filter(|_| !cloth);
            let edges = edges.map(|(ends, _)| ends.map(|end| first + end as usize)).collect();
            shapes = shapes.and(Shapes::of_triangles(triangles)).and(Shapes { edges, ..Shapes::default() });
            let case = format!("{integrator}, shot {shot}: {speed} m/s");
            shoot(solver, &shapes, &settings(integrator, 16, &mut numbers), 160, &case);
        }
    }
}
