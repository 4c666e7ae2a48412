//! Which surfaces collide, and what their contacts are like.

use bevy::math::{UVec2, Vec3};
use bevy_mass_spring::nets::{Cloth, Rope};
use bevy_mass_spring::solver::{
    ContactProperties, Integrator, Layers, Material, PairRules, Solver, StepSettings, SubstepMode,
};

use super::{ELASTIC, SCHEMES, SOFT};
use crate::common::bodies::{add_net, positions, solver_bits, velocities};

fn settings(integrator: Integrator) -> StepSettings {
    StepSettings {
        integrator,
        substeps: SubstepMode::Fixed(1),
        time_step: 1.0 / 960.0,
        pair_rules: Some(PairRules::default()),
        ..StepSettings::default()
    }
}

/// Two rods that cross, the upper one falling at 1 m/s.
fn rods() -> Solver {
    let mut solver = Solver::default();
    for (ends, velocity) in [
        ([Vec3::new(-0.5, 0.0, 0.0), Vec3::new(0.5, 0.0, 0.0)], Vec3::ZERO),
        ([Vec3::new(0.0, 0.11, -0.5), Vec3::new(0.0, 0.11, 0.5)], Vec3::new(0.3, -1.0, 0.0)),
    ] {
        let ends = ends.map(|end| solver.add_particle(end, velocity, 1.0, 0.05).unwrap());
        solver.add_collision_edge(ends).unwrap();
    }
    solver
}

#[test]
fn the_layers_of_surfaces_say_which_meet() {
    for (filters, meets) in [(u32::MAX, true), (2, false)] {
        let mut solver = rods();
        let layers = Layers::new(1, filters);
        solver.inputs_mut().contact_properties =
            vec![ContactProperties { layers, ..ContactProperties::default() }; 4];
        for _ in 0..20 {
            solver.step(&settings(Integrator::SemiImplicitEuler));
        }
        assert_eq!(solver.velocity(0).y < -0.1, meets, "{filters}");
    }
}

/// Two rods of 2 kg meet in their middles: the impulse of equal masses, (1 + ε) m v / 2, and μ times that across.
#[test]
fn materials_of_surfaces_say_how_they_rebound_and_rub() {
    let material = |restitution, friction| Material { restitution, friction, ..Material::default() };
    for (properties, restitution, friction) in [
        ([None, None], 0.0, 0.0),
        ([Some(material(0.5, 0.1)), None], 0.5, 0.1),
        ([None, Some(material(1.0, 0.0))], 1.0, 0.0),
        ([Some(material(0.2, 0.05)), Some(material(0.6, 0.15))], 0.4, 0.1),
    ] {
        let mut solver = rods();
        let own_properties = |number: usize| ContactProperties {
            material: properties[number],
            ..ContactProperties::default()
        };
        solver.inputs_mut().contact_properties =
            vec![own_properties(0), own_properties(0), own_properties(1), own_properties(1)];
        for _ in 0..20 {
            solver.step(&settings(Integrator::SemiImplicitEuler));
        }
        let speed = 0.5 * (1.0 + restitution);
        // Of the middles, as the two have slipped a little until they meet.
        let mean = |end: usize| 0.5 * (solver.velocity(end) + solver.velocity(end + 1));
        let (lower, upper) = (mean(0), mean(2));
        let case = format!("{restitution} and {friction}: {lower} {upper}");
        assert!((lower.y + speed).abs() < 1e-4 && (upper.y - (speed - 1.0)).abs() < 1e-4, "{case}");
        assert!((lower.x - friction * speed).abs() < 1e-4, "{case}");
    }
}

/// A cloth in folds that is crossed from the start is left alone: nothing is put anywhere.
#[test]
fn what_starts_crossed_does_not_explode() {
    for integrator in SCHEMES {
        let mut solver = Solver::default();
        let corner = Vec3::new(-0.2, 0.0, -0.2);
        let cloth = Cloth::grid(corner, Vec3::X * 0.4, Vec3::Z * 0.4, UVec2::splat(6)).with_radius(0.01);
        add_net(&mut solver, &cloth.with_material(SOFT).topology().unwrap(), Vec3::ZERO, &[]);
        let rope = Rope::between(Vec3::Y * -0.2, Vec3::Y * 0.2).with_segments(7).with_radius(0.01);
        add_net(
            &mut solver,
            &rope.with_material(ELASTIC).topology().unwrap(),
            Vec3::new(0.01, 0.0, 0.02),
            &[],
        );
        let before = positions(&solver);
        for _ in 0..200 {
            solver.step(&settings(integrator));
        }
        for (slot, place) in before.into_iter().enumerate() {
            let way = solver.position(slot).distance(place);
            // Two radii: what overlaps may part.
            assert!(way < 0.03, "{integrator}, {slot}: {way} m");
        }
    }
}

/// In a plane nothing can step aside: a rope that falls, and crosses one that is held, falls past it from edge to edge.
#[test]
fn ropes_that_cross_in_a_plane_fall_past_each_other() {
    for integrator in SCHEMES.into_iter().chain([Integrator::VelocityVerlet, Integrator::RungeKutta4]) {
        let mut solver = Solver::default();
        let (radius, length, segments) = (0.005, 0.4, 8);
        let rope = |from: Vec3, to: Vec3| {
            let rope = Rope::between(from, to).with_segments(segments).with_radius(radius);
            rope.with_material(ELASTIC).topology().unwrap()
        };
        let held = rope(Vec3::X * -0.2, Vec3::X * 0.2);
        add_net(&mut solver, &held, Vec3::ZERO, &Vec::from_iter(0..=segments));
        let falling = rope(Vec3::new(0.013, -0.5 * length, 0.0), Vec3::new(0.013, 0.5 * length, 0.0));
        add_net(&mut solver, &falling, Vec3::ZERO, &[]);
        let gravity = 9.81;
        let settings = StepSettings { gravity: Vec3::NEG_Y * gravity, is_flat: true, ..settings(integrator) };
        let ticks = 480;
        for _ in 0..ticks {
            solver.step(&settings);
        }
        let time = ticks as f32 * settings.time_step;
        let fallen: f32 = (held.positions.len()..solver.particle_count())
            .map(|slot| -solver.position(slot).y / falling.positions.len() as f32)
            .sum();
        // The last end, which does not cross any more, may be pushed off by the distance of contact.
        let expected = 0.5 * gravity * time * time;
        let tolerance = 2.0 * radius + gravity * time * settings.time_step;
        assert!((fallen - expected).abs() < tolerance, "{integrator}: {fallen} m instead of {expected} m");
    }
}

/// Two cloths in one place, of which one is held at its corners, may part. That stretches no spring by more than twice the distance of
/// contact, whose energy they may have beside that of the fall; and they gain no more.
#[test]
fn nets_in_one_place_do_not_explode() {
    for integrator in SCHEMES.into_iter().chain([Integrator::VelocityVerlet, Integrator::RungeKutta4]) {
        let mut solver = Solver::default();
        let (radius, cells) = (0.01, 6);
        let cloth = Cloth::grid(Vec3::ZERO, Vec3::X * 0.4, Vec3::Z * 0.4, UVec2::splat(cells));
        let topology = cloth.with_radius(radius).with_material(SOFT).topology().unwrap();
        let corners = [0, cells, (cells + 1) * cells, (cells + 1) * (cells + 1) - 1];
        add_net(&mut solver, &topology, Vec3::ZERO, &corners);
        add_net(&mut solver, &topology, Vec3::ZERO, &[]);
        let stretch = 4.0 * radius;
        let springs = (0..solver.spring_count()).map(|number| solver.spring(number).1.stiffness);
        let parting = springs.map(|stiffness| 0.5 * stiffness * stretch * stretch).sum::<f32>();
        let settings = StepSettings { gravity: Vec3::NEG_Y * 9.81, ..settings(integrator) };
        let mass =
            |slot: usize| if solver.inverse_mass(slot) > 0.0 { 1.0 / solver.inverse_mass(slot) } else { 0.0 };
        let masses: Vec<f32> = (0..solver.particle_count()).map(mass).collect();
        for tick in 0..2000 {
            solver.step(&settings);
            let (mut kinetic, mut fall) = (0.0, 0.0);
            for (slot, velocity) in velocities(&solver).into_iter().enumerate() {
                kinetic += 0.5 * masses[slot] * velocity.length_squared();
                fall += masses[slot] * 9.81 * -solver.position(slot).y;
            }
            let most = parting + 1.05 * fall.max(0.0);
            assert!(kinetic < most, "{integrator}, tick {tick}: {kinetic} J of {most} J");
        }
    }
}

/// What touches nothing moves to the bit as it does without collisions, and neighbours on the mesh are no contacts, however
/// thick it is.
#[test]
fn a_thick_net_is_no_contact_of_itself() {
    for integrator in SCHEMES {
        let hang = |rules| {
            let mut solver = Solver::default();
            let cloth = Cloth::grid(Vec3::ZERO, Vec3::X * 0.4, Vec3::NEG_Y * 0.4, UVec2::splat(8));
            let cloth = cloth.with_radius(0.04).with_material(SOFT).topology().unwrap();
            add_net(&mut solver, &cloth, Vec3::ZERO, &[0, 8]);
            let rope = Rope::new(0.5).with_segments(10).with_radius(0.04).with_material(ELASTIC);
            add_net(&mut solver, &rope.topology().unwrap(), Vec3::X, &[0]);
            let settings =
                StepSettings { pair_rules: rules, gravity: Vec3::NEG_Y * 1.0, ..settings(integrator) };
            let mut contacts = 0;
            for _ in 0..100 {
                solver.step(&settings);
                contacts += solver.outputs().contact_count;
            }
            (solver_bits(&solver), contacts)
        };
        let (bits, contacts) = hang(Some(PairRules::default()));
        assert_eq!((contacts, bits == hang(None).0), (0, true), "{integrator}");
    }
}
