//! What a scene file means.

use std::path::{Path, PathBuf};

use bevy::prelude::*;
use bevy_mass_spring::prelude::*;
use bevy_mass_spring::scene::{SceneParticle, ScenePlane, SceneSolver, SceneSpring};

use super::EXAMPLE;

#[test]
fn the_example_of_the_contract() {
    let scene = MassSpringScene::from_ron(EXAMPLE).unwrap();
    let particle = |x: f32, pinned| SceneParticle {
        position: Vec3::new(x, 2.0, 0.0),
        velocity: Vec3::ZERO,
        mass: 1.0,
        radius: 0.05,
        pinned,
    };
    let expected = MassSpringScene {
        particles: vec![particle(0.0, true), particle(0.1, false)],
        springs: vec![SceneSpring {
            particles: (0, 1),
            rest_length: Some(0.1),
            stiffness: 1000.0,
            damping: 1.0,
            tension_only: false,
            max_stretch: None,
            breaking_force: None,
        }],
        planes: vec![ScenePlane { point: Vec3::ZERO, normal: Vec3::Y, restitution: 0.5, friction: 0.0 }],
        ..MassSpringScene::default()
    };
    assert_eq!(scene, expected, "what the example calls defaults are the defaults");
}

#[test]
fn the_defaults() {
    let text = "(
        particles: [(position: (0, 0, 0), mass: 2), (position: (3, 4, 0), mass: 2)],
        springs: [(particles: (1, 0), stiffness: 5)],
        planes: [(normal: (0, 0, 1))],
    )";
    let scene = MassSpringScene::from_ron(text).unwrap();
    let environment = Environment {
        gravity: Vec3::new(0.0, -9.81, 0.0),
        gravity_enabled: true,
        viscosity: 0.0,
        viscosity_enabled: true,
        wind: Vec3::ZERO,
        air_density: 0.0,
        air_enabled: true,
        gusts: None,
    };
    assert_eq!(scene.environment, environment);
    let solver =
        SceneSolver { time_step: 1.0 / 60.0, integrator: Integrator::Auto, substeps: SubstepMode::Auto };
    assert_eq!(scene.solver, solver);
    let collisions =
        CollisionSettings { ground: true, particles: true, springs: false, restitution: 0.0, friction: 0.0 };
    assert_eq!(scene.collisions, collisions);
    let SceneParticle { velocity, radius, pinned, .. } = scene.particles[0];
    assert_eq!((velocity, radius, pinned), (Vec3::ZERO, 0.0, false));
    assert_eq!((scene.springs[0].damping, scene.springs[0].rest_length), (0.0, None));
    assert_eq!(scene.rest_length(&scene.springs[0]), Some(5.0), "the initial distance");
    let ScenePlane { point, restitution, friction, .. } = scene.planes[0];
    assert_eq!((point, restitution, friction), (Vec3::ZERO, 0.0, 0.0));
}

#[test]
fn a_section_may_be_written_in_part() {
    let text = "(environment: (viscosity: 0.5), solver: (substeps: Fixed(8)), collisions: (ground: false), particles: [])";
    let scene = MassSpringScene::from_ron(text).unwrap();
    assert_eq!(scene.environment.gravity.y, -9.81);
    assert_eq!((scene.solver.time_step, scene.solver.substeps), (1.0 / 60.0, SubstepMode::Fixed(8)));
    assert!(scene.collisions.particles && !scene.collisions.ground);
}

#[test]
fn forces_may_be_switched_off_without_losing_their_values() {
    let text =
        "(environment: (gravity_enabled: false, viscosity: 2, viscosity_enabled: false), particles: [])";
    let scene = MassSpringScene::from_ron(text).unwrap();
    assert_eq!((scene.environment.gravity.y, scene.environment.viscosity), (-9.81, 2.0));
    assert_eq!(scene.environment.effective_gravity(), Vec3::ZERO);
    assert_eq!(scene.environment.effective_viscosity(), 0.0);
    assert_eq!(MassSpringScene::from_ron(&scene.to_ron()).unwrap(), scene);
}

#[test]
fn a_section_may_be_named() {
    let text = "(environment: Environment(), solver: Solver(), collisions: Collisions(), particles: [])";
    assert_eq!(MassSpringScene::from_ron(text).unwrap(), MassSpringScene::default());
}

fn shipped_scenes() -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/scenes");
    let mut files: Vec<PathBuf> =
        std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.sort();
    files
}

#[test]
fn shipped_scenes_load_and_round_trip() {
    let files = shipped_scenes();
    let names: Vec<_> = files.iter().map(|file| file.file_name().unwrap().to_str().unwrap()).collect();
    let expected = [
        "balloon", "bounce", "chain", "crossed", "drape", "drum", "flag", "jelly", "net", "pendulum", "pile",
        "rod", "rope", "tear",
    ];
    assert_eq!(names, expected.map(|name| format!("{name}.scene.ron")));
    for file in files {
        let text = std::fs::read_to_string(&file).unwrap();
        assert!(text.starts_with("// "), "{} begins with what to look at", file.display());
        let scene = MassSpringScene::read(&file).unwrap();
        assert_eq!(MassSpringScene::from_ron(&scene.to_ron()).unwrap(), scene, "{}", file.display());
    }
    let chain = &shipped_scenes()[2];
    let chain = MassSpringScene::read(chain).unwrap();
    assert_eq!((chain.particles.len(), chain.springs.len(), chain.planes.len()), (20, 19, 1));
    assert!(chain.particles[0].pinned && chain.particles[0].position == Vec3::new(0.0, 3.0, 0.0));
}

/// What springs have besides: a cable with a strain limit, and one that says that it has none.
#[test]
fn cables_and_strain_limits_are_read_and_written() {
    let scene = MassSpringScene::from_ron(
        "(
            particles: [(position: (0, 0, 0), mass: 1), (position: (1, 0, 0), mass: 1)],
            springs: [
                (particles: (0, 1), stiffness: 5, tension_only: true, max_stretch: Some(0.25)),
                (particles: (0, 1), stiffness: 5, tension_only: false, max_stretch: None),
            ],
        )",
    )
    .unwrap();
    let read: Vec<_> = scene.springs.iter().map(|spring| (spring.tension_only, spring.max_stretch)).collect();
    assert_eq!(read, [(true, Some(0.25)), (false, None)]);
    assert_eq!(MassSpringScene::from_ron(&scene.to_ron()).unwrap(), scene);
}
