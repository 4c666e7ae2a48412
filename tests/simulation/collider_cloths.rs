//! Cloths that fall on colliders of every shape: no point of them is deep inside at any time, and they come to rest.

use std::f32::consts::FRAC_PI_2;

use bevy::math::{Quat, Vec3};
use bevy_mass_spring::solver::{Collider, Integrator, Pose, Shape, Sleep, Solver, StepSettings, SubstepMode};

use crate::common::bodies::{falling, positions, velocities};
use crate::common::colliding::{Cloth, deepest_of_faces};
use crate::common::shapes::{sphere_mesh, with};

/// Of the particles, m: the cloth is twice as thick.
const RADIUS: f32 = 0.01;

/// How far what is at rest moves in half a second, m.
const AT_REST: f32 = 1e-3;

fn colliders() -> Vec<(&'static str, Collider)> {
    let (vertices, triangles) = sphere_mesh(0.3, 36);
    assert!(triangles.len() > 5000);
    let shapes = [
        ("sphere", Shape::ball(0.3)),
        ("capsule", Shape::capsule(0.1, 0.3)),
        ("cuboid", Shape::cuboid(Vec3::new(0.25, 0.2, 0.15))),
        ("cone", Shape::frustum([0.3, 0.0], 0.25)),
        ("mesh", Shape::mesh(&vertices, &triangles, false).unwrap()),
    ];
    shapes
        .map(|(name, shape)| {
            let turn = if name == "capsule" { Quat::from_rotation_z(FRAC_PI_2) } else { Quat::IDENTITY };
            let pose = Pose { point: Vec3::ZERO, rotation: turn };
            (name, with(Collider::resting(shape, pose), 0.0, 0.6))
        })
        .to_vec()
}

/// Lets a cloth of 0.9 m × 0.9 m fall onto a collider, of 0.2 kg/m² and in air or water that brings it to rest within 0.2 s,
/// by `substeps` of a scheme; looks in every fifth tick how deep the points of its faces, edges and particles are.
///
/// No more than 1 % of its thickness and 0.1 mm. How far any particle has moved in the last half second before `seconds`, m. A sheet that
/// resists no bending has folds that let go at any time: where one does, the next half seconds count, four at most.
fn lies(
    (name, collider): &(&str, Collider),
    (cells, seconds): (usize, f32),
    (integrator, substeps): (Integrator, SubstepMode),
) -> f32 {
    let mut state = Solver::default();
    state.add_collider(collider.clone());
    let cloth =
        Cloth { cells, size: 0.9, radius: RADIUS, stiffness: 100.0, areal_density: 0.2, damping: 0.2 };
    let triangles = cloth.add(&mut state, Vec3::new(-0.45, 0.33, -0.45), [Vec3::X, Vec3::Z]);
    let viscosity = 5.0 / state.inverse_mass(0);
    let settings = StepSettings { substeps, viscosity, ..falling(integrator, 1) };
    let allowed = 0.01 * f64::from(2.0 * RADIUS) + 1e-4;
    let ticks = (60.0 * seconds) as u32 - 30;
    let mut before = positions(&state);
    let mut moved = f32::INFINITY;
    for tick in 0.. {
        if tick >= ticks && (tick - ticks).is_multiple_of(30) {
            if tick > ticks {
                let places = positions(&state);
                let each = places.iter().zip(&before).map(|(one, other)| one.distance(*other));
                moved = each.fold(0.0, f32::max);
            }
            if moved < AT_REST || tick == ticks + 120 {
                break;
            }
            before = positions(&state);
        }
        state.step(&settings);
        if tick % 5 == 4 {
            let deepest = deepest_of_faces(&state, &triangles, collider, RADIUS, 4);
            let case = format!("{name}, {cells}², {integrator:?}, tick {tick}");
            assert!(deepest < allowed, "{case}: {deepest} m deep");
        }
    }
    assert!(positions(&state).iter().all(|place| place.is_finite()), "{name}");
    let touches = deepest_of_faces(&state, &triangles, collider, RADIUS, 4) > -1e-3;
    assert!(touches, "{name}: it lies on it");
    moved
}

#[test]
fn a_cloth_lies_on_every_shape() {
    for collider in colliders() {
        match collider.0 {
            // Its faces against 5,000 triangles take ten times as long.
            "mesh" => _ = lies(&collider, (8, 1.0), (Integrator::SemiImplicitEuler, SubstepMode::Fixed(12))),
            name => {
                let moved = lies(&collider, (16, 5.0), (Integrator::SemiImplicitEuler, SubstepMode::Auto));
                assert!(moved < AT_REST, "{name}: {moved} m in half a second");
            }
        }
    }
}

#[test]
fn a_cloth_lies_on_solids_by_position_based_dynamics() {
    for collider in colliders().iter().filter(|(name, _)| *name != "mesh") {
        lies(collider, (12, 2.0), (Integrator::Xpbd, SubstepMode::Fixed(12)));
    }
}

/// The energy of motion of what rests is no more than what gravity gives in a substep. Faces that are held only once they have
/// sunk into the collider, and then pushed out, keep a cloth vibrating at sixteen times that.
#[test]
fn a_cloth_that_lies_on_a_ball_does_not_tremble() {
    let ball = with(
        Collider::resting(Shape::ball(0.3), Pose { point: Vec3::ZERO, rotation: Quat::IDENTITY }),
        0.0,
        0.6,
    );
    let mut state = Solver::default();
    state.add_collider(ball);
    let cloth =
        Cloth { cells: 32, size: 0.9, radius: RADIUS, stiffness: 100.0, areal_density: 0.2, damping: 0.2 };
    cloth.add(&mut state, Vec3::new(-0.45, 0.33, -0.45), [Vec3::X, Vec3::Z]);
    let viscosity = 5.0 / state.inverse_mass(0);
    let settings =
        StepSettings { substeps: SubstepMode::Auto, viscosity, ..falling(Integrator::SemiImplicitEuler, 1) };
    let mut most = 0.0_f32;
    for tick in 0..180 {
        state.step(&settings);
        if tick >= 150 {
            let each = velocities(&state).into_iter().map(|velocity| velocity.length_squared());
            most = most.max(0.5 * each.sum::<f32>() / state.inverse_mass(0));
        }
    }
    let speed = 9.81 * settings.time_step / state.outputs().plan.substeps as f32;
    let allowed = 0.5 * state.particle_count() as f32 / state.inverse_mass(0) * speed * speed;
    assert!(most < allowed, "{most} J of {allowed}");
}

/// A cloth of `cells`² cells that has fallen onto a collider for `seconds`; no point of it has been deeper than 1 % of its thickness and
/// 0.1 mm in any fifth tick.
fn fallen(
    (name, collider): &(&str, Collider),
    (cells, stiffness, seconds): (usize, f32, u32),
    settings: &StepSettings,
) -> Solver {
    let mut state = Solver::default();
    state.add_collider(collider.clone());
    let cloth = Cloth { cells, size: 0.9, radius: RADIUS, stiffness, areal_density: 0.2, damping: 0.2 };
    let triangles = cloth.add(&mut state, Vec3::new(-0.45, 0.33, -0.45), [Vec3::X, Vec3::Z]);
    let viscosity = 5.0 / state.inverse_mass(0);
    let settings = StepSettings { viscosity, ..*settings };
    let allowed = 0.01 * f64::from(2.0 * RADIUS) + 1e-4;
    for tick in 0..60 * seconds {
        state.step(&settings);
        if tick % 5 == 4 {
            let deepest = deepest_of_faces(&state, &triangles, collider, RADIUS, 4);
            let case = format!("{name}, {cells}², {:?}, tick {tick}", settings.integrator);
            assert!(deepest < allowed, "{case}: {deepest} m deep");
        }
    }
    state
}

fn falls_asleep(name: &str, state: &mut Solver, settings: &StepSettings) {
    let viscosity = 5.0 / state.inverse_mass(0);
    let settings = StepSettings { viscosity, sleep: Some(Sleep::default()), ..*settings };
    let awake = (0..600).take_while(|_| {
        state.step(&settings);
        state.asleep_count() == 0
    });
    let ticks = awake.count();
    let case = format!("{name}, {:?}", settings.integrator);
    assert_eq!(state.asleep_count(), state.particle_count(), "{case}: awake after {ticks} ticks");
}

/// Asserts that a cloth comes to rest by an implicit scheme: after `seconds` its energy of motion is no more than what is left of an
/// error that the solution of a step may have, a half per cent of the way g h² of its flight; then it falls asleep.
fn comes_to_rest(
    collider: &(&str, Collider),
    (cells, stiffness, seconds): (usize, f32, u32),
    (integrator, substeps): (Integrator, SubstepMode),
) {
    let settings = StepSettings { substeps, ..falling(integrator, 1) };
    let mut state = fallen(collider, (cells, stiffness, seconds), &settings);
    let moving = StepSettings { viscosity: 5.0 / state.inverse_mass(0), ..settings };
    let mut most = 0.0_f32;
    for _ in 0..30 {
        state.step(&moving);
        let squares: f32 = velocities(&state).iter().map(|velocity| velocity.length_squared()).sum();
        most = most.max(0.5 * squares / state.inverse_mass(0));
    }
    let left = 5e-3 * 9.81 * settings.time_step / state.outputs().plan.substeps as f32;
    let error = 0.5 * state.particle_count() as f32 / state.inverse_mass(0) * left * left;
    assert!(most < error, "{}, {integrator:?}: {most} J of {error}", collider.0);
    falls_asleep(collider.0, &mut state, &settings);
}

/// The curved ones: a cylinder, too.
fn round_colliders() -> Vec<(&'static str, Collider)> {
    let turn = Quat::from_rotation_z(FRAC_PI_2);
    let pose = Pose { point: Vec3::ZERO, rotation: turn };
    let cylinder = ("cylinder", with(Collider::resting(Shape::frustum([0.1; 2], 0.3), pose), 0.0, 0.6));
    colliders().into_iter().filter(|(name, _)| *name != "mesh").chain([cylinder]).collect()
}

#[test]
#[cfg_attr(debug_assertions, ignore = "takes minutes unoptimised")]
fn a_cloth_comes_to_rest_by_backward_euler() {
    for collider in round_colliders() {
        comes_to_rest(&collider, (12, 100.0, 6), (Integrator::ImplicitEuler, SubstepMode::Fixed(1)));
    }
}

#[test]
#[cfg_attr(debug_assertions, ignore = "takes minutes unoptimised")]
fn a_cloth_falls_asleep_on_a_mesh_by_backward_euler() {
    let mesh = colliders().into_iter().find(|(name, _)| *name == "mesh").unwrap();
    let settings = falling(Integrator::ImplicitEuler, 1);
    let mut state = fallen(&mesh, (8, 100.0, 3), &settings);
    falls_asleep("mesh", &mut state, &settings);
}

#[test]
#[cfg_attr(debug_assertions, ignore = "takes minutes unoptimised")]
fn a_cloth_comes_to_rest_by_tr_bdf2() {
    for collider in round_colliders() {
        comes_to_rest(&collider, (12, 1e3, 6), (Integrator::TrBdf2, SubstepMode::Fixed(2)));
    }
}

/// `Auto` takes TR-BDF2 for one as stiff as this.
#[test]
#[cfg_attr(debug_assertions, ignore = "takes minutes unoptimised")]
fn a_stiff_cloth_comes_to_rest_by_what_auto_picks() {
    for collider in round_colliders() {
        comes_to_rest(&collider, (12, 1e5, 8), (Integrator::Auto, SubstepMode::Auto));
    }
}

#[test]
#[cfg_attr(debug_assertions, ignore = "takes minutes unoptimised")]
fn a_cloth_of_64_by_64_cells_lies_on_every_shape() {
    let mut moved = Vec::new();
    for collider in colliders() {
        let scheme = (Integrator::SemiImplicitEuler, SubstepMode::Auto);
        moved.push((collider.0, lies(&collider, (64, 5.0), scheme)));
    }
    assert!(moved.iter().all(|(_, moved)| *moved < AT_REST), "{moved:?}");
}
