//! Stiff nets that are pressed into each other, or onto a corner, in implicit steps: what keeps them apart gives them no energy, and
//! holds nothing in the air.

use bevy::math::{Quat, UVec2, UVec3, Vec3};
use bevy::prelude::Cuboid;
use bevy_mass_spring::nets::Topology;
use bevy_mass_spring::prelude::{Cloth, ClothMaterial, Jelly, JellyMaterial, Rope, RopeMaterial};
use bevy_mass_spring::solver::{
    Collider, Integrator, PairRules, Pose, Shape, Solver, StepSettings, SubstepMode,
};

use crate::common::bodies::{add_net, falling};

fn cube(size: f32, cells: u32, radius: f32, density: f32, youngs_modulus: f32) -> Topology {
    let material = JellyMaterial { density, youngs_modulus, retardation_time: 1e-3 };
    let cube = Jelly::from(Cuboid::from_length(size)).with_cells(UVec3::splat(cells));
    cube.with_radius(radius).with_material(material).topology().unwrap()
}

/// A level square about the origin, of this stretch and shear stiffness, N/m, and bending stiffness, N·m.
fn sheet(
    width: f32,
    cells: u32,
    radius: f32,
    area_density: f32,
    [stretch, shear, bending]: [f32; 3],
) -> Topology {
    let material = ClothMaterial {
        area_density,
        stretch_stiffness: stretch,
        shear_stiffness: shear,
        bending_stiffness: bending,
        retardation_time: 0.0,
    };
    let corner = Vec3::new(-0.5, 0.0, -0.5) * width;
    let sheet = Cloth::grid(corner, Vec3::X * width, Vec3::Z * width, UVec2::splat(cells));
    sheet.with_radius(radius).with_material(material).topology().unwrap()
}

fn ground() -> Solver {
    let mut state = Solver::default();
    state.add_collider(Collider::half_space(Vec3::ZERO, Vec3::Y, 0.0, 0.3));
    state
}

fn settings(scheme: Integrator, substeps: SubstepMode, time_step: f32) -> StepSettings {
    let pair_rules = Some(PairRules { restitution: 0.0, friction: 0.3 });
    StepSettings { pair_rules, substeps, time_step, ..falling(scheme, 1) }
}

/// Steps for some ticks: total energy is never above that at the start by more than 1 % of what the fall has brought until then,
/// and of `least_fall`, J; returns what it has brought.
fn fall(state: &mut Solver, settings: &StepSettings, ticks: u32, least_fall: f64) -> f64 {
    let before = state.measure(settings.gravity);
    let mut fallen = least_fall;
    for tick in 0..ticks {
        state.step(settings);
        let now = state.measure(settings.gravity);
        fallen = fallen.max(before.gravitational_energy - now.gravitational_energy);
        let gain = now.total_energy() - before.total_energy();
        assert!(
            gain < 0.01 * fallen,
            "{:?}, tick {tick}: {gain} J of {fallen}: {now:?}",
            settings.integrator
        );
    }
    fallen
}

/// The weight of a net, N.
fn weight(net: &Topology) -> f64 {
    f64::from(net.masses.iter().sum::<f32>() * 9.81)
}

/// What falls 0.3 m onto a cube, and with it to the ground, has pressed corners of both into each other. All of it comes down: the
/// sheet by more than half of its height, as it slides off or drapes.
#[test]
fn a_stiff_sheet_that_falls_onto_a_light_cube_gains_no_energy() {
    for (scheme, substeps) in [
        (Integrator::Auto, SubstepMode::Auto),
        (Integrator::ImplicitEuler, SubstepMode::Fixed(1)),
        (Integrator::TrBdf2, SubstepMode::Fixed(2)),
    ] {
        let mut state = ground();
        let cube = cube(0.57, 3, 0.005, 2.2, 1.6e6);
        add_net(&mut state, &cube, Vec3::new(0.19, 0.77, -0.26), &[]);
        let sheet = sheet(0.78, 8, 0.005, 3.8, [1.4e6, 2.2e5, 0.0]);
        add_net(&mut state, &sheet, Vec3::new(-0.22, 1.4, 0.0), &[]);
        let all = 0.48 * weight(&cube) + 1.4 * weight(&sheet);
        let fallen = fall(&mut state, &settings(scheme, substeps, 1.0 / 60.0), 120, 1e-3 * all);
        assert!(fallen > 0.5 * all, "{scheme:?}: {fallen} J of {all}");
    }
}

/// A stiff sheet falls onto a corner of a box: stopped there it is not stretched, and falls on beside it.
#[test]
fn a_stiff_sheet_that_falls_onto_the_corner_of_a_box_gains_no_energy() {
    for (scheme, substeps) in [
        (Integrator::Auto, SubstepMode::Auto),
        (Integrator::ImplicitEuler, SubstepMode::Fixed(1)),
        (Integrator::TrBdf2, SubstepMode::Fixed(2)),
    ] {
        let mut state = ground();
        let pose = Pose { point: Vec3::new(-0.155, 0.134, 0.181), rotation: Quat::IDENTITY };
        state.add_collider(Collider::resting(Shape::cuboid(Vec3::new(0.104, 0.134, 0.085)), pose));
        let sheet = sheet(0.5341, 7, 0.005, 0.26, [5.6e7, 2.6e7, 0.0]);
        add_net(&mut state, &sheet, Vec3::new(-0.0132, 0.6458, -0.1505), &[]);
        let all = 0.6458 * weight(&sheet);
        let fallen = fall(&mut state, &settings(scheme, substeps, 1.0 / 30.0), 60, 1e-3 * all);
        assert!(fallen > 0.5 * all, "{scheme:?}: {fallen} J of {all}");
    }
}

/// A sheet that velocity Verlet advances falls onto a rope that is held at its ends and advanced by TR-BDF2 beside it: the contacts do
/// not stretch the rope until its next step.
#[test]
fn a_sheet_that_falls_onto_a_stiff_rope_gives_it_no_energy() {
    let mut state = ground();
    let material = RopeMaterial {
        linear_density: 0.60439,
        stretch_stiffness: 6.95199e7,
        bending_stiffness: 511.121,
        retardation_time: 1e-3,
    };
    let rope = Rope::between(Vec3::new(0.0544, 0.495, -0.3799), Vec3::new(0.1186, 0.5743, 0.8425));
    let rope = rope.with_segments(9).with_radius(0.02).with_material(material).topology().unwrap();
    add_net(&mut state, &rope, Vec3::ZERO, &[0, 9]);
    let sheet = sheet(0.7847, 4, 0.02, 21.3449, [1.15152e6, 1.34705e5, 115.152]);
    add_net(&mut state, &sheet, Vec3::new(0.15605, 0.9849, -0.16735), &[]);
    let all = 0.985 * weight(&sheet);
    let fallen = fall(&mut state, &settings(Integrator::Auto, SubstepMode::Auto, 1.0 / 60.0), 90, 1e-3 * all);
    assert!(fallen > 0.4 * all, "{fallen} J of {all}");
}

/// Nothing from outside acts on a sheet and a cube that fly into each other: their momentum stays what it was, whatever is stopped.
#[test]
fn stiff_nets_that_run_into_each_other_keep_their_momentum() {
    for scheme in [Integrator::ImplicitEuler, Integrator::TrBdf2] {
        let mut state = Solver::default();
        let cube = cube(0.57, 3, 0.005, 2.2, 1.6e6);
        add_net(&mut state, &cube, Vec3::new(0.19, 0.0, -0.26), &[]);
        let first = state.particle_count();
        let sheet = sheet(0.78, 8, 0.005, 3.8, [1.4e6, 2.2e5, 0.0]);
        add_net(&mut state, &sheet, Vec3::new(-0.22, 0.5, 0.0), &[]);
        for slot in first..state.particle_count() {
            state.set_velocity(slot, Vec3::NEG_Y * 4.0);
        }
        let gravity = Vec3::ZERO;
        let settings = StepSettings { gravity, ..settings(scheme, SubstepMode::Fixed(2), 1.0 / 60.0) };
        let before = state.measure(gravity);
        for tick in 0..60 {
            state.step(&settings);
            let now = state.measure(gravity);
            let lost = (now.momentum - before.momentum).length();
            assert!(lost < 1e-3 * before.momentum.length(), "{scheme:?}, tick {tick}: {lost} N·s lost");
            assert!(now.total_energy() < 1.01 * before.total_energy(), "{scheme:?}, tick {tick}: {now:?}");
        }
        let cube_is_hit = (0..first).map(|slot| state.velocity(slot).y).fold(0.0, f32::min);
        assert!(cube_is_hit < -0.5, "{scheme:?}: {cube_is_hit} m/s");
    }
}
