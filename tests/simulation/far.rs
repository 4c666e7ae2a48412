//! Far from the origin of the world nets are as quiet as the coordinates of a `Transform` allow.

use bevy::prelude::*;
use bevy_mass_spring::prelude::*;

use crate::common::*;

/// The distance of neighbouring numbers of f32 at `x`.
fn ulp(x: f32) -> f32 {
    f32::from_bits(x.abs().to_bits() + 1) - x.abs()
}

/// A cloth of `side`² particles, 0.1 m apart, that hangs from two corners at `corner`.
fn cloth(app: &mut App, corner: Vec3, side: usize, stiffness: f32) -> Vec<Entity> {
    let mut cloth: Vec<Entity> = Vec::new();
    for slot in 0..side * side {
        let (row, column) = (slot / side, slot % side);
        let place = corner + Vec3::new(column as f32, 0.0, row as f32) * 0.125;
        let particle = match (row, column) {
            (0, 0) => spawn_pinned(app, place),
            (0, last) if last == side - 1 => spawn_pinned(app, place),
            _ => spawn(app, 0.02, 0.03, place),
        };
        cloth.push(particle);
        for (exists, back) in [(column > 0, 1), (row > 0, side)] {
            if exists {
                let spring = Spring::new(cloth[slot - back], particle, 0.125);
                join(app, spring.with_stiffness(stiffness).with_damping(0.2));
            }
        }
    }
    cloth
}

fn places(app: &App, particles: &[Entity]) -> Vec<Vec3> {
    particles.iter().map(|particle| position(app, *particle)).collect()
}

/// The bar: at 100 km, a hung cloth moves by at most one ulp of its coordinates a tick.
#[test]
fn a_hung_cloth_is_quiet_at_a_hundred_kilometres() {
    let corner = Vec3::new(1e5, -3e4, -7e4);
    for (integrator, stiffness) in [
        (Integrator::Auto, 200.0),
        (Integrator::Auto, 1e6),
        (Integrator::SemiImplicitEuler, 200.0),
        (Integrator::RungeKutta4, 200.0),
        (Integrator::ImplicitEuler, 1e4),
        (Integrator::Xpbd, 1e4),
    ] {
        let mut app = app();
        app.insert_resource(SolverSettings { integrator, ..default() });
        app.world_mut().resource_mut::<Environment>().viscosity = 0.05;
        app.insert_resource(Measurements::default());
        let cloth = cloth(&mut app, corner, 10, stiffness);
        run(&mut app, 2500);
        for _ in 0..200 {
            let before = places(&app, &cloth);
            run(&mut app, 1);
            let after = places(&app, &cloth);
            for (before, after) in before.into_iter().zip(after) {
                for axis in 0..3 {
                    let moved = (after[axis] - before[axis]).abs();
                    assert!(moved <= ulp(before[axis]), "{integrator}, {stiffness}: {before} to {after}");
                }
            }
        }
        let speed = app.world().resource::<Measurements>().max_speed;
        // Coordinates of up to 2 m are rounded by 1e-7 m; at √(4k/m) = 14,000 rad/s that is 1.4e-3 m/s, and several
        // roundings add up.
        assert!(speed < 1.5e-2, "{integrator}, {stiffness}: {speed} m/s");
    }
}

/// Places that f32 holds far away, too: then everything there is what it is here, but for the rounding of what is
/// written. Within 20 ticks, in which nothing is chaotic.
#[test]
fn a_scene_far_away_moves_as_one_here() {
    let scene = |corner: Vec3| {
        let mut app = app();
        *app.world_mut().resource_mut::<CollisionSettings>() =
            CollisionSettings { restitution: 0.3, friction: 0.4, ..default() };
        let particles = cloth(&mut app, corner + Vec3::Y * 0.5, 6, 200.0);
        let ball = spawn(&mut app, 0.5, 0.25, corner + Vec3::new(0.25, 1.0, 0.25));
        // Its own point is where the world has its origin.
        app.world_mut()
            .spawn((ParticleCollider { restitution: 0.3, friction: 0.4, ..default() }, Transform::default()));
        app.add_message::<Contact>();
        (app, particles.into_iter().chain([ball]).collect::<Vec<_>>())
    };
    let away = Vec3::new(65_536.0, 0.0, -131_072.0);
    let ((mut here, near), (mut there, far)) = (scene(Vec3::ZERO), scene(away));
    let mut contacts = 0;
    for _ in 0..60 {
        run(&mut here, 1);
        run(&mut there, 1);
        for (near, far) in near.iter().zip(&far) {
            let gap = position(&there, *far) - away - position(&here, *near);
            assert!(gap.abs().max_element() <= 0.5 * ulp(away.z) + 1e-4, "{gap}");
            assert!(velocity(&there, *far).distance(velocity(&here, *near)) < 1e-2);
        }
        let [found, expected] = [&mut there, &mut here].map(messages::<Contact>);
        assert_eq!(found.len(), expected.len());
        for (found, expected) in found.iter().zip(&expected) {
            assert!((found.point - away - expected.point).length() < 0.02, "{found:?} {expected:?}");
        }
        contacts += found.len();
    }
    assert!(contacts > 20, "{contacts}");
}

/// A plane whose own point is 100 km away is where it is: balls come to rest on a slope without friction nowhere, and
/// with friction at once.
#[test]
fn a_slope_far_away_holds() {
    let mut app = app();
    let slope = Quat::from_rotation_z(0.5);
    let along = slope * Vec3::X * 1e5;
    app.world_mut().spawn((
        ParticleCollider { restitution: 0.0, friction: 5.0, ..default() },
        Transform::from_translation(along).with_rotation(slope),
    ));
    let normal = slope * Vec3::Y;
    let start = along * 0.75 + normal * 0.1;
    let ball = spawn(&mut app, 1.0, 0.1, start);
    run(&mut app, 200);
    assert!(position(&app, ball).distance(start) < 0.02, "{}", position(&app, ball) - start);
    assert!(velocity(&app, ball).length() < 0.01, "{}", velocity(&app, ball));
}

/// The gravitational energy is that of the place in the world.
#[test]
fn energies_are_those_of_the_world() {
    let mut app = app();
    app.insert_resource(Measurements::default());
    spawn_pinned(&mut app, Vec3::ZERO);
    spawn(&mut app, 2.0, 0.0, Vec3::Y * 4096.0);
    spawn(&mut app, 3.0, 0.0, Vec3::Y * 4097.0);
    run(&mut app, 1);
    let energy = app.world().resource::<Measurements>().total_energy();
    let expected = f64::from(9.81_f32) * (2.0 * 4096.0 + 3.0 * 4097.0);
    assert!((energy / expected - 1.0).abs() < 1e-6, "{energy} {expected}");
}

/// A body that crosses the world keeps the bits of its state through snapshots, on both sides of a change of origin.
#[test]
fn snapshots_hold_the_origin() {
    let mut app = app();
    app.world_mut().resource_mut::<Environment>().gravity_enabled = false;
    let rope = spawn_rope(&mut app, Vec3::ZERO, 8, 0.1, |spring| spring.with_stiffness(400.0));
    app.world_mut().entity_mut(rope[0]).remove::<Pinned>();
    for knot in &rope {
        app.world_mut().entity_mut(*knot).insert(ParticleVelocity(Vec3::new(300.0, 20.0, 0.0)));
    }
    app.world_mut().entity_mut(rope[7]).insert(AppliedForce(Vec3::Z));
    let follow = |app: &mut App, ticks: u32| -> Vec<u64> {
        (0..ticks)
            .map(|_| {
                run(app, 1);
                hash(app, &rope)
            })
            .collect()
    };
    follow(&mut app, 3);
    for _ in 0..12 {
        let snapshot = Snapshot::take(app.world());
        let expected = follow(&mut app, 9);
        snapshot.restore(app.world_mut());
        assert_eq!(follow(&mut app, 9), expected);
    }
    assert!(position(&app, rope[0]).x > 450.0);
}
