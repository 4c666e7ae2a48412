//! Scene files: what is read, what is refused and where, and what a scene becomes.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use bevy::asset::LoadState;
use bevy::prelude::*;
use bevy_mass_spring::prelude::*;
use bevy_mass_spring::scene::{
    Position, SceneCollisions, SceneEnvironment, SceneErrorReason, SceneParticle, ScenePlane, SceneSolver,
    SceneSpring, SpawnedScene,
};

/// The example of the contract, to the letter.
const EXAMPLE: &str = r#"(
    environment: (                       // optional; these are the defaults
        gravity: (0.0, -9.81, 0.0),      // m/s²
        viscosity: 0.0,                  // N·s/m
    ),
    solver: (                            // optional; these are the defaults
        time_step: 0.016666666666666666, // s, one fixed tick
        integrator: Auto,                // see below
        substeps: Auto,                  // Auto | Fixed(n), n >= 1
    ),
    collisions: (                        // optional; these are the defaults
        ground: true,                    // particles against planes
        particles: true,                 // particles against particles
        restitution: 0.0,                // particle against particle, 0..=1
        friction: 0.0,                   // particle against particle, Coulomb, >= 0
    ),
    particles: [
        // velocity: (0,0,0), radius: 0.0 and pinned: false are the defaults
        (position: (0.0, 2.0, 0.0), mass: 1.0, radius: 0.05, pinned: true),
        (position: (0.1, 2.0, 0.0), velocity: (0.0, 0.0, 0.0), mass: 1.0, radius: 0.05),
    ],
    springs: [                           // optional; damping: 0.0 is the default
        // particles: indices into the list above. rest_length omitted: the initial distance
        (particles: (0, 1), rest_length: 0.1, stiffness: 1000.0, damping: 1.0),
    ],
    planes: [                            // optional; point (0,0,0), restitution 0.0, friction 0.0 are the defaults
        (point: (0.0, 0.0, 0.0), normal: (0.0, 1.0, 0.0), restitution: 0.5, friction: 0.0),
    ],
)
"#;

fn shipped_scenes() -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/scenes");
    let mut files: Vec<PathBuf> =
        std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.sort();
    files
}

fn refusal(text: &str) -> String {
    MassSpringScene::from_ron(text).expect_err("this scene must be refused").to_string()
}

/// Two particles one below the other, so that the fields of each stand on a line of their own, and
/// whatever else the scene has.
fn two_particles_and(rest: &str) -> String {
    format!(
        "(\n  particles: [\n    (position: (0, 0, 0), mass: 1),\n    (position: (3, 4, 0), mass: 1),\n  ],\n{rest}\n)"
    )
}

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
    let environment = SceneEnvironment { gravity: Vec3::new(0.0, -9.81, 0.0), viscosity: 0.0 };
    assert_eq!(scene.environment, environment);
    let solver =
        SceneSolver { time_step: 1.0 / 60.0, integrator: Integrator::Auto, substeps: Substeps::Auto };
    assert_eq!(scene.solver, solver);
    let collisions = SceneCollisions { ground: true, particles: true, restitution: 0.0, friction: 0.0 };
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
    assert_eq!((scene.solver.time_step, scene.solver.substeps), (1.0 / 60.0, Substeps::Fixed(8)));
    assert!(scene.collisions.particles && !scene.collisions.ground);
}

#[test]
fn every_integrator_by_its_name() {
    for integrator in Integrator::ALL {
        let text = format!("(solver: (integrator: {integrator}), particles: [])");
        match MassSpringScene::from_ron(&text) {
            Ok(scene) => assert_eq!(scene.solver.integrator, integrator),
            Err(error) => {
                assert!(integrator.scheme().is_err(), "{integrator} is available, but: {error}");
                let message = format!(
                    "line 1, column 23: solver.integrator: the integrator {integrator} is not available"
                );
                assert!(error.to_string().starts_with(&message), "{error}");
            }
        }
    }
}

/// Each refusal of the contract: what stands in the file, with a § where the value at fault begins, and
/// the message.
#[test]
fn bad_values_are_refused_with_place_index_and_field() {
    let particle = |fields: &str| format!("(particles: [\n(position: (0, 0, 0), mass: 1),\n({fields}),\n])");
    let spring = |fields: &str| two_particles_and(&format!("springs: [\n({fields})]"));
    let plane = |fields: &str| format!("(particles: [], planes: [\n({fields})])");
    let positive = "expected a finite number > 0";
    let not_negative = "expected a finite number >= 0";
    let fraction = "expected a number from 0 to 1";
    let vector = "expected a vector of finite numbers";
    let cases = [
        (particle("position: (0, 0, 0), mass: §-1"), format!("particles[1].mass is -1.0, {positive}")),
        (particle("position: (0, 0, 0), mass: §0"), format!("particles[1].mass is 0.0, {positive}")),
        (particle("position: (0, 0, 0), mass: §NaN"), format!("particles[1].mass is NaN, {positive}")),
        (particle("position: (0, 0, 0), mass: §inf"), format!("particles[1].mass is inf, {positive}")),
        (particle("position: (0, 0, 0), mass: §1e39"), format!("particles[1].mass is inf, {positive}")),
        (
            particle("position: (0, 0, 0), mass: 1, radius: §-0.1"),
            format!("particles[1].radius is -0.1, {not_negative}"),
        ),
        (
            particle("mass: 1, position: §(0, NaN, 0)"),
            format!("particles[1].position is [0.0, NaN, 0.0], {vector}"),
        ),
        (
            particle("mass: 1, position: (0, 0, 0), velocity: §(-inf, 0, 0)"),
            format!("particles[1].velocity is [-inf, 0.0, 0.0], {vector}"),
        ),
        (
            spring("particles: (0, 1), stiffness: §-5"),
            format!("springs[0].stiffness is -5.0, {not_negative}"),
        ),
        (
            spring("particles: (0, 1), stiffness: 5, damping: §-1e-3"),
            format!("springs[0].damping is -0.001, {not_negative}"),
        ),
        (
            spring("particles: (0, 1), rest_length: §-1, stiffness: 5"),
            format!("springs[0].rest_length is -1.0, {not_negative}"),
        ),
        (
            spring("stiffness: 5, particles: §(0, 2)"),
            "springs[0].particles is (0, 2), expected two indices into the list of 2 particles".to_owned(),
        ),
        (
            spring("stiffness: 5, particles: §(1, 1)"),
            "springs[0].particles is (1, 1), expected the indices of two different particles".to_owned(),
        ),
        (
            plane("normal: §(0, 0, 0)"),
            "planes[0].normal is [0.0, 0.0, 0.0], expected a vector that is not zero".to_owned(),
        ),
        (plane("normal: §(0, inf, 0)"), format!("planes[0].normal is [0.0, inf, 0.0], {vector}")),
        (
            plane("normal: (0, 1, 0), point: §(NaN, 0, 0)"),
            format!("planes[0].point is [NaN, 0.0, 0.0], {vector}"),
        ),
        (plane("normal: (0, 1, 0), restitution: §1.5"), format!("planes[0].restitution is 1.5, {fraction}")),
        (plane("normal: (0, 1, 0), friction: §-1"), format!("planes[0].friction is -1.0, {not_negative}")),
        (
            "(environment: (viscosity: §-1), particles: [])".to_owned(),
            format!("environment.viscosity is -1.0, {not_negative}"),
        ),
        (
            "(environment: (gravity: §(0, -inf, 0)), particles: [])".to_owned(),
            format!("environment.gravity is [0.0, -inf, 0.0], {vector}"),
        ),
        (
            "(collisions: (restitution: §-0.5), particles: [])".to_owned(),
            format!("collisions.restitution is -0.5, {fraction}"),
        ),
        (
            "(collisions: (friction: §inf), particles: [])".to_owned(),
            format!("collisions.friction is inf, {not_negative}"),
        ),
        (
            // A field that is not there: the place of its spring. The distance is too great for f32.
            "(particles: [
                (position: (-3e38, 0, 0), mass: 1),
                (position: (3e38, 0, 0), mass: 1),
            ], springs: [§(particles: (0, 1), stiffness: 5)])"
                .to_owned(),
            format!("springs[0].rest_length is inf, {not_negative}"),
        ),
        (
            "(solver: (substeps: §Fixed(0)), particles: [])".to_owned(),
            "solver.substeps is Fixed(0), expected Auto or Fixed(n) with n >= 1".to_owned(),
        ),
    ];
    for (marked, message) in cases {
        let (before, after) = marked.split_once('§').expect("a mark where the value begins");
        let line = before.lines().count();
        let column = before.lines().last().unwrap().chars().count() + 1;
        let text = format!("{before}{after}");
        let error = MassSpringScene::from_ron(&text).expect_err(&message);
        assert_eq!(error.position, Some(Position { line, column }), "{error}\n{text}");
        let message = format!("line {line}, column {column}: {message}");
        assert!(error.to_string().starts_with(&message), "expected: {message}\nfound:    {error}\n{text}");
    }
}

#[test]
fn bad_time_steps_are_refused() {
    for (time_step, printed) in [
        ("0", "0.0"),
        ("-0.01", "-0.01"),
        ("NaN", "NaN"),
        ("inf", "inf"),
        ("1e-12", "1e-12"),
        ("1e300", "1e300"),
    ] {
        let error = refusal(&format!("(\n\n  solver: (time_step: {time_step}),\n  particles: [])"));
        let message = format!("line 3, column 23: solver.time_step is {printed}, expected a ");
        assert!(error.starts_with(&message), "{error}");
    }
}

/// Faults that RON itself finds: the place, the field that was being read, and what was expected.
#[test]
fn malformed_text_is_refused_with_place_and_field() {
    let cases = [
        // A missing comma.
        (two_particles_and("springs: [\n(particles: (0, 1) stiffness: 5)]"), 7, "springs[0]", "comma"),
        // A field that does not exist.
        (two_particles_and("springs: [\n(particles: (0, 1), stifness: 5)]"), 7, "springs[0]", "stifness"),
        (two_particles_and("sprigns: []"), 6, "", "`sprigns`"),
        // A field that must be there.
        (two_particles_and("springs: [\n(particles: (0, 1))]"), 7, "springs[0]", "`stiffness`"),
        ("(\n)".to_owned(), 2, "", "`particles`"),
        // Wrong types.
        ("(particles: [\n(position: (0, 0), mass: 1)])".to_owned(), 2, "particles[0].position", "3"),
        ("(particles: [\n(position: (0, 0, 0), mass: \"1\")])".to_owned(), 2, "particles[0].mass", "float"),
        (
            two_particles_and("springs: [\n(particles: (0, -1), stiffness: 5)]"),
            7,
            "springs[0].particles[1]",
            "whole number",
        ),
        (
            "(particles: [\n(position: (0, 0, 0), mass: 1, pinned: 1)])".to_owned(),
            2,
            "particles[0].pinned",
            "bool",
        ),
        // Names that are none.
        (
            "(\nsolver: (integrator: Leapfrog), particles: [])".to_owned(),
            2,
            "solver.integrator",
            "VelocityVerlet",
        ),
        ("(\nsolver: (substeps: Fixed(-1)), particles: [])".to_owned(), 2, "solver.substeps", "whole number"),
        // Not a scene at all.
        (String::new(), 1, "", ""),
        ("{\"particles\": []}".to_owned(), 1, "", ""),
        ("(particles: [])\n(particles: [])".to_owned(), 2, "", "trailing"),
        ("(\nparticles: [(position: (0, 0, 0), mass: 1)".to_owned(), 2, "particles", ""),
    ];
    for (text, line, path, expected) in cases {
        let error = MassSpringScene::from_ron(&text).expect_err(&text);
        assert_eq!(error.position.map(|position| position.line), Some(line), "{error}\n{text}");
        let SceneErrorReason::Malformed { path: found, message } = &error.reason else {
            panic!("{error}\n{text}");
        };
        assert!(found.starts_with(path), "{error}\n{text}");
        assert!(message.to_lowercase().contains(expected) || message.contains(expected), "{error}\n{text}");
    }
}

#[test]
fn a_file_is_named_in_its_errors() {
    let folder = tempfile::tempdir().unwrap();
    let missing = folder.path().join("missing.scene.ron");
    let error = MassSpringScene::read(&missing).unwrap_err().to_string();
    assert!(error.starts_with(&format!("{}: cannot be read: ", missing.display())), "{error}");

    let negative = folder.path().join("negative.scene.ron");
    std::fs::write(&negative, "(particles: [\n  (position: (0, 0, 0), mass: -1),\n])").unwrap();
    let error = MassSpringScene::read(&negative).unwrap_err().to_string();
    let message = "particles[0].mass is -1.0, expected a finite number > 0";
    assert_eq!(error, format!("{}:2:31: {message}", negative.display()));

    let binary = folder.path().join("binary.scene.ron");
    std::fs::write(&binary, b"(\n  \xff)").unwrap();
    let error = MassSpringScene::read(&binary).unwrap_err().to_string();
    assert_eq!(error, format!("{}:2:3: expected UTF-8 text", binary.display()));
}

#[test]
fn shipped_scenes_load_and_round_trip() {
    let files = shipped_scenes();
    let names: Vec<_> = files.iter().map(|file| file.file_name().unwrap().to_str().unwrap()).collect();
    let expected = ["bounce", "chain", "net", "pendulum", "pile"].map(|name| format!("{name}.scene.ron"));
    assert_eq!(names, expected);
    for file in files {
        let text = std::fs::read_to_string(&file).unwrap();
        assert!(text.starts_with("// "), "{} begins with what to look at", file.display());
        let scene = MassSpringScene::read(&file).unwrap();
        assert_eq!(MassSpringScene::from_ron(&scene.to_ron()).unwrap(), scene, "{}", file.display());
    }
    let chain = &shipped_scenes()[1];
    let chain = MassSpringScene::read(chain).unwrap();
    assert_eq!((chain.particles.len(), chain.springs.len(), chain.planes.len()), (20, 19, 1));
    assert!(chain.particles[0].pinned && chain.particles[0].position == Vec3::new(0.0, 3.0, 0.0));
}

#[test]
fn a_scene_made_in_code_is_checked_by_the_same_rules() {
    let mut scene = MassSpringScene::from_ron(EXAMPLE).unwrap();
    assert!(scene.validate().is_ok());
    scene.springs[0].particles = (0, 9);
    let error = scene.validate().unwrap_err().to_string();
    assert!(error.starts_with("springs[0].particles is (0, 9), expected two indices"), "{error}");
}

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
    let collider = world.get::<PlaneCollider>(spawned.planes[0]);
    assert_eq!(collider, Some(&PlaneCollider { restitution: 0.25, friction: 0.75 }));
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
    let settings = SolverSettings { integrator: Integrator::RungeKutta4, substeps: Substeps::Fixed(3) };
    assert_eq!(*world.resource::<SolverSettings>(), settings);
    let collisions = CollisionSettings { ground: false, particles: true, restitution: 0.25, friction: 0.75 };
    assert_eq!(*world.resource::<CollisionSettings>(), collisions);
    let tick = Duration::from_millis(500);
    assert_eq!(world.resource::<Time<Fixed>>().timestep(), tick);
    assert_eq!(world.resource::<Time<Virtual>>().max_delta(), tick, "a whole tick fits into a frame");
}

/// An app with assets from `folder`; the physics comes before the assets if `physics_first`.
fn app_with_assets(folder: &Path, physics_first: bool) -> App {
    let assets = AssetPlugin { file_path: folder.display().to_string(), ..default() };
    let mut app = App::new();
    app.add_plugins(MinimalPlugins);
    if physics_first {
        app.add_plugins((MassSpringPlugin::default(), assets));
    } else {
        app.add_plugins((assets, MassSpringPlugin::default()));
    }
    app.finish();
    app.cleanup();
    app
}

fn update_until(app: &mut App, mut done: impl FnMut(&World) -> bool) {
    let start = Instant::now();
    while !done(app.world()) {
        assert!(start.elapsed() < Duration::from_secs(30), "nothing happened for 30 s");
        app.update();
    }
}

#[test]
fn a_root_spawns_its_scene_and_takes_it_away() {
    for physics_first in [false, true] {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets");
        let mut app = app_with_assets(&folder, physics_first);
        let handle = app.world().resource::<AssetServer>().load("scenes/pendulum.scene.ron");
        let root = app.world_mut().spawn(MassSpringSceneRoot(handle)).id();
        update_until(&mut app, |world| world.get::<SpawnedScene>(root).is_some());

        let spawned = app.world().get::<SpawnedScene>(root).unwrap().clone();
        assert_eq!((spawned.particles.len(), spawned.springs.len(), spawned.planes.len()), (2, 1, 1));
        assert!(app.world().get::<Pinned>(spawned.particles[0]).is_some());
        app.update();
        assert_eq!(app.world().get::<SpawnedScene>(root), Some(&spawned), "spawned once");

        // One that the game despawned by itself is no matter.
        app.world_mut().despawn(spawned.springs[0]);
        app.world_mut().despawn(root);
        app.world_mut().flush();
        assert!(spawned.iter().all(|entity| app.world().get_entity(entity).is_err()));
    }
}

#[test]
fn removing_the_spawned_scene_spawns_it_afresh() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets");
    let mut app = app_with_assets(&folder, false);
    let handle = app.world().resource::<AssetServer>().load("scenes/pendulum.scene.ron");
    let root = app.world_mut().spawn(MassSpringSceneRoot(handle)).id();
    update_until(&mut app, |world| world.get::<SpawnedScene>(root).is_some());
    let before = app.world_mut().entity_mut(root).take::<SpawnedScene>().unwrap();
    app.world_mut().flush();
    update_until(&mut app, |world| world.get::<SpawnedScene>(root).is_some());
    let after = app.world().get::<SpawnedScene>(root).unwrap();
    assert!(after.particles.iter().all(|entity| app.world().get_entity(*entity).is_ok()));
    assert!(before.iter().all(|entity| app.world().get_entity(entity).is_err()), "{before:?} {after:?}");
}

#[test]
fn a_scene_that_fails_to_load_says_why() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("bad.scene.ron"), "(particles: [(position: (0, 0, 0), mass: 0)])")
        .unwrap();
    let mut app = app_with_assets(folder.path(), false);
    let handle: Handle<MassSpringScene> = app.world().resource::<AssetServer>().load("bad.scene.ron");
    app.world_mut().spawn(MassSpringSceneRoot(handle.clone()));
    let state = |world: &World| world.resource::<AssetServer>().load_state(&handle);
    update_until(&mut app, |world| state(world).is_failed());
    let LoadState::Failed(error) = state(app.world()) else { panic!("not failed") };
    let message = "bad.scene.ron:1:42: particles[0].mass is 0.0, expected a finite number > 0";
    assert!(error.to_string().contains(message), "{error}");
}
