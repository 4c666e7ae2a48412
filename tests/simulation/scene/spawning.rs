//! What a scene becomes: entities and resources.

use std::time::Duration;

use bevy::prelude::*;
use bevy_mass_spring::prelude::*;

fn headless_app() -> App {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, MassSpringPlugin::default()));
    app
}

#[test]
fn spawning_makes_ordinary_entities_in_file_order() {
    let text = "(
        particles: [
            (position: (0, 1, 0), mass: 2, radius: 0.5, pinned: true),
            (position: (3, 5, 0), mass: 3, velocity: (0, 0, 7)),
        ],
        springs: [
            (particles: (1, 0), stiffness: 10, damping: 0.5),
            (particles: (0, 1), stiffness: 20, rest_length: 0),
        ],
        planes: [
            (point: (0, -1, 0), normal: (0, 1e-30, 0), restitution: 0.25, friction: 0.75),
            (normal: (0, -3e30, 0)),
            (normal: (3, 0, 4)),
            (normal: (0.0001, 1, 0)),
        ],
    )";
    let scene = MassSpringScene::from_ron(text).unwrap();
    let mut app = headless_app();
    let world = app.world_mut();
    let spawned = scene.spawn(&mut world.commands());
    world.flush();

    let [first, second] = spawned.particles[..] else { panic!("{spawned:?}") };
    assert_eq!(world.get::<Particle>(first), Some(&Particle::new(2.0, 0.5)));
    assert!(world.get::<Pinned>(first).is_some() && world.get::<Pinned>(second).is_none());
    assert_eq!(world.get::<Transform>(second).unwrap().translation, Vec3::new(3.0, 5.0, 0.0));
    assert_eq!(world.get::<ParticleVelocity>(second).unwrap().0, Vec3::new(0.0, 0.0, 7.0));

    let springs: Vec<Spring> =
        spawned.springs.iter().map(|&entity| *world.get::<Spring>(entity).unwrap()).collect();
    let expected = [
        Spring::new(second, first, 5.0).with_stiffness(10.0).with_damping(0.5),
        Spring::new(first, second, 0.0).with_stiffness(20.0).with_damping(0.0),
    ];
    assert_eq!(springs, expected);

    let normals = [Vec3::Y, Vec3::NEG_Y, Vec3::new(0.6, 0.0, 0.8), Vec3::new(0.0001, 1.0, 0.0)];
    for (&plane, normal) in spawned.planes.iter().zip(normals) {
        let up = world.get::<Transform>(plane).unwrap().up();
        assert!(up.distance(normal) < 1e-6, "{up:?} instead of {normal}");
    }
    assert_eq!(world.get::<Transform>(spawned.planes[0]).unwrap().translation, Vec3::NEG_Y);
    let collider = world.get::<ParticleCollider>(spawned.planes[0]);
    assert_eq!(collider, Some(&ParticleCollider { restitution: 0.25, friction: 0.75, ..default() }));
}

#[test]
fn settings_become_resources() {
    let text = "(
        environment: (gravity: (0, 0, -1.6), viscosity: 0.5),
        solver: (time_step: 0.5, integrator: RungeKutta4, substeps: Fixed(3)),
        collisions: (ground: false, particles: true, restitution: 0.25, friction: 0.75),
        particles: [],
    )";
    let scene = MassSpringScene::from_ron(text).unwrap();
    let mut app = headless_app();
    scene.apply_settings(app.world_mut());
    let world = app.world();
    let environment = world.resource::<Environment>();
    assert_eq!(environment.effective_gravity(), Vec3::new(0.0, 0.0, -1.6));
    assert_eq!(environment.effective_viscosity(), 0.5);
    let settings = SolverSettings { integrator: Integrator::RungeKutta4, substeps: SubstepMode::Fixed(3) };
    assert_eq!(*world.resource::<SolverSettings>(), settings);
    let collisions =
        CollisionSettings { ground: false, particles: true, restitution: 0.25, friction: 0.75, ..default() };
    assert_eq!(*world.resource::<CollisionSettings>(), collisions);
    let tick = Duration::from_millis(500);
    assert_eq!(world.resource::<Time<Fixed>>().timestep(), tick);
    assert_eq!(world.resource::<Time<Virtual>>().max_delta(), tick, "a whole tick fits into a frame");
}
