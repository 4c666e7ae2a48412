//! The nets of scene files.

use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use bevy_mass_spring::prelude::*;
use bevy_mass_spring::scene::{Position, SceneNet};

/// The nets of the contract, to the letter but for the comments.
const NETS: &str = "(particles: [], nets: [
    Rope(from: (0.0, 0.0, 0.0), to: (1.0, 0.0, 0.0), segments: 20,
         radius: 0.0, linear_density: 0.1, stretch_stiffness: 1e4, bending_stiffness: 0.0,
         retardation_time: 0.0, tension_only: false, max_stretch: None, breaking_force: None, pinned: [0]),
    Cloth(corner: (0.0, 0.0, 0.0), width: (1.0, 0.0, 0.0), height: (0.0, 0.0, 1.0), cells: (20, 20),
          radius: 0.0, area_density: 0.2, stretch_stiffness: 1e3, shear_stiffness: 3e2, bending_stiffness: 0.0,
          retardation_time: 0.0, max_stretch: None, breaking_strain: None, pinned: [0, 20],
          drag_coefficient: 1.0, lift_coefficient: 0.0, self_collision: true),
    Jelly(min: (0.0, 0.0, 0.0), max: (1.0, 1.0, 1.0), cells: (4, 4, 4),
          radius: 0.0, density: 1e3, youngs_modulus: 1e5, retardation_time: 0.0, pinned: []),
    Balloon(centre: (0.0, 0.0, 0.0), radius: 0.5, subdivisions: 3, thickness: 0.0, area_density: 0.2,
            stretch_stiffness: 1e3, pressure: 100.0, retardation_time: 0.0),
])";

/// The same with what has a default left out.
const SHORT: &str = "(particles: [], nets: [
    Rope(from: (0, 0, 0), to: (1, 0, 0), segments: 20, linear_density: 0.1, stretch_stiffness: 1e4, pinned: [0]),
    Cloth(corner: (0, 0, 0), width: (1, 0, 0), height: (0, 0, 1), cells: (20, 20), area_density: 0.2,
          stretch_stiffness: 1e3, shear_stiffness: 3e2, pinned: [0, 20]),
    Jelly(min: (0, 0, 0), max: (1, 1, 1), cells: (4, 4, 4), density: 1e3, youngs_modulus: 1e5),
    Balloon(centre: (0, 0, 0), radius: 0.5, subdivisions: 3, area_density: 0.2, stretch_stiffness: 1e3,
            pressure: 100),
])";

#[test]
fn the_nets_of_the_contract_and_their_defaults() {
    let scene = MassSpringScene::from_ron(NETS).unwrap();
    assert_eq!(scene, MassSpringScene::from_ron(SHORT).unwrap());
    assert_eq!(scene, MassSpringScene::from_ron(&scene.to_ron()).unwrap());
    let counts: Vec<usize> = scene.nets.iter().map(SceneNet::particle_count).collect();
    assert_eq!(counts, [21, 441, 125, 642]);
}

/// Each rule: the nets with one value replaced, and what the error says.
#[test]
fn bad_nets_are_refused_with_place_index_and_field() {
    let positive = "expected a finite number > 0";
    let cases = [
        ("linear_density: 0.1", "linear_density: §0", format!("nets[0].linear_density is 0.0, {positive}")),
        ("to: (1, 0, 0)", "to: §(0, 0, 0)", "nets[0].to is [0.0, 0.0, 0.0], expected another place".into()),
        ("segments: 20", "segments: §0", "nets[0].segments is 0, expected a number from 1".into()),
        (
            "pinned: [0])",
            "pinned: [0, §21])",
            "nets[0].pinned[1] is 21, expected the index of a particle".into(),
        ),
        ("1e4,", "1e4, radius: §-1,", "nets[0].radius is -1.0, expected a finite number >= 0".into()),
        ("1e4,", "1e4, breaking_force: §NaN,", "nets[0].breaking_force is NaN, expected".into()),
        ("cells: (20, 20)", "cells: §(20, 0)", "nets[1].cells is (20, 0), expected numbers >= 1".into()),
        (
            "cells: (20, 20)",
            "cells: §(100000, 100000)",
            "nets[1].cells is (100000, 100000), expected fewer than 2^24 particles".into(),
        ),
        (
            "height: (0, 0, 1)",
            "height: §(2, 0, 0)",
            "nets[1].height is [2.0, 0.0, 0.0], expected a vector that is not along `width`".into(),
        ),
        ("3e2,", "3e2, lift_coefficient: §-1,", "nets[1].lift_coefficient is -1.0, expected".into()),
        ("max: (1, 1, 1)", "max: §(1, 0, 1)", "nets[2].max is [1.0, 0.0, 1.0], expected coordinates".into()),
        (
            "cells: (4, 4, 4)",
            "cells: §(129, 128, 128)",
            "nets[2].cells is (129, 128, 128), expected at most 2^21 cells in all".into(),
        ),
        ("density: 1e3", "density: §-1", format!("nets[2].density is -1.0, {positive}")),
        (
            "subdivisions: 3",
            "subdivisions: §9",
            "nets[3].subdivisions is 9, expected a number from 0 to 8".into(),
        ),
        ("pressure: 100", "pressure: §0", format!("nets[3].pressure is 0.0, {positive}")),
    ];
    for (old, new, message) in cases {
        assert!(SHORT.contains(old), "{old}");
        let marked = SHORT.replacen(old, new, 1);
        let (before, after) = marked.split_once('§').expect("a mark where the value begins");
        let line = before.lines().count();
        let column = before.lines().last().unwrap().chars().count() + 1;
        let error = MassSpringScene::from_ron(&format!("{before}{after}")).expect_err(&message);
        assert_eq!(error.position, Some(Position { line, column }), "{error}");
        assert!(error.to_string().contains(&message), "expected: {message}\nfound:    {error}");
    }
}

/// A ribbon of 50 m: the number of cells in all is limited, not that along a side.
#[test]
fn a_long_strip_of_cloth_is_laid_out() {
    let ribbon = "width: (50, 0, 0), height: (0, 0, 0.01), cells: (5000, 1)";
    let text = SHORT.replace("width: (1, 0, 0), height: (0, 0, 1), cells: (20, 20)", ribbon);
    let scene = MassSpringScene::from_ron(&text).unwrap();
    assert_eq!(scene.layout().unwrap().topologies[1].positions.len(), 5001 * 2);
}

#[test]
fn a_scene_may_be_of_nets_only() {
    let scene = MassSpringScene::from_ron(&SHORT.replace("particles: [], ", "")).unwrap();
    assert_eq!(scene, MassSpringScene::from_ron(SHORT).unwrap());
}

#[test]
fn unknown_kinds_and_fields_are_refused_by_name() {
    let refusal = |text: &str| MassSpringScene::from_ron(text).expect_err(text).to_string();
    assert!(refusal("(particles: [], nets: [Chain(from: (0, 0, 0))])").contains("`Chain`"));
    assert!(refusal(&SHORT.replace("segments", "segmnts")).contains("`segmnts`"));
    assert!(refusal(&SHORT.replace("linear_density: 0.1, ", "")).contains("`linear_density`"));
}

fn headless_app() -> App {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, MassSpringPlugin::default()));
    app.insert_resource(TimeUpdateStrategy::FixedTimesteps(1));
    app
}

/// A load, a rope and a cloth: springs tie the load to the rope, the rope to the cloth, and the rope to itself.
const TIED: &str = "(
    particles: [(position: (0, 0, -3), mass: 1)],
    springs: [
        (particles: (0, 3), stiffness: 10),
        (particles: (3, 4), stiffness: 10),
        (particles: (1, 3), stiffness: 10, rest_length: 0.5, breaking_force: Some(70)),
    ],
    bends: [(particles: (2, 3, 0), stiffness: 2)],
    nets: [
        Rope(from: (0, 0, 0), to: (4, 0, 0), segments: 2, linear_density: 1, stretch_stiffness: 1e3,
             breaking_force: Some(50), pinned: [2, 0]),
        Cloth(corner: (4, 3, 0), width: (1, 0, 0), height: (0, 1, 0), cells: (1, 1), area_density: 1,
              stretch_stiffness: 1e3, shear_stiffness: 1e2, breaking_strain: Some(0.25)),
    ],
)";

#[test]
fn nets_are_complete_when_they_are_spawned_and_springs_end_in_parts_of_them() {
    let scene = MassSpringScene::from_ron(TIED).unwrap();
    assert_eq!(scene.particle_count(), 8);
    assert_eq!(scene.net_of(4), Some((1, 0)));
    assert_eq!(scene.rest_length(&scene.springs[1]), Some(3.0));
    let mut app = headless_app();
    let spawned = scene.spawn(&mut app.world_mut().commands());
    app.world_mut().flush();

    let [rope, cloth] = spawned.nets[..] else { panic!("{spawned:?}") };
    let world = app.world();
    let net = world.get::<ParticleNet>(rope).unwrap();
    assert_eq!(net.positions(), [Vec3::ZERO, Vec3::X * 2.0, Vec3::X * 4.0]);
    assert_eq!(net.pinned(), [0, 2]);
    assert_eq!(world.get::<Breaking>(rope), Some(&Breaking { force: Some(50.0), ..default() }));
    assert_eq!(world.get::<Breaking>(cloth), Some(&Breaking { strain: Some(0.25), ..default() }));
    assert!(world.get::<Rope>(rope).is_some() && world.get::<Cloth>(cloth).is_some());

    let springs: Vec<Spring> = spawned.springs.iter().map(|spring| *world.get(*spring).unwrap()).collect();
    assert_eq!(springs.iter().map(|spring| spring.rest_length).collect::<Vec<_>>(), [5.0, 3.0, 0.5]);
    assert_eq!(springs[2].breaking_force, Some(70.0));
    let [_, end] = springs[0].particles;
    assert_eq!((world.get::<Part>(end), world.get(end)), (Some(&Part::Particle(2)), Some(&PartOf(rope))));
    // A particle has one part, however many springs end there.
    assert_eq!((springs[1].particles[0], springs[2].particles[1]), (end, end));
    assert_eq!(world.get::<Bend>(spawned.bends[0]).unwrap().particles[1..], [end, spawned.particles[0]]);
    assert_eq!(world.get::<Parts>(rope).unwrap().entities().len(), 3);

    for _ in 0..3 {
        app.update();
    }
    let report = app.world().resource::<TickReport>();
    assert_eq!((report.tick, report.particles, report.springs), (2, 8, 2 + 6 + 3));
    let net = app.world().get::<ParticleNet>(rope).unwrap();
    assert_eq!((net.pinned(), net.positions()[2]), (&[0, 2][..], Vec3::X * 4.0));
    // All of it leaves with the scene.
    let root = app.world_mut().spawn(spawned).id();
    app.world_mut().despawn(root);
    let mut left = app.world_mut().query_filtered::<(), Or<(With<ParticleNet>, With<Part>, With<Spring>)>>();
    assert_eq!(left.iter(app.world()).count(), 0);
}

#[test]
fn the_material_of_a_spawned_net_acts_live() {
    let scene = MassSpringScene::from_ron(TIED).unwrap();
    let mut app = headless_app();
    let spawned = scene.spawn(&mut app.world_mut().commands());
    app.update();
    app.update();
    app.world_mut().get_mut::<Rope>(spawned.nets[0]).unwrap().material.stretch_stiffness = 4e3;
    app.update();
    let net = app.world().get::<ParticleNet>(spawned.nets[0]).unwrap();
    assert_eq!(net.topology().springs[0].1.stiffness, 2e3, "EA / h");
    assert_eq!(net.pinned(), [0, 2]);
}

#[test]
fn indices_into_nets_are_checked() {
    let refusal = |text: &str| MassSpringScene::from_ron(text).expect_err(text).to_string();
    let all = "of the 8 particles, those of nets included, the first of which is 0";
    let error = refusal(&TIED.replace("(particles: (0, 3)", "(particles: (0, 8)"));
    assert!(
        error.contains(&format!("springs[0].particles is (0, 8), expected two indices {all}")),
        "{error}"
    );
    let error = refusal(&TIED.replace("(particles: (2, 3, 0)", "(particles: (2, 3, 8)"));
    assert!(
        error.contains(&format!("bends[0].particles is (2, 3, 8), expected three indices {all}")),
        "{error}"
    );
    let error = refusal(&TIED.replace("(particles: (2, 3, 0)", "(particles: (2, 3, 2)"));
    assert!(error.contains("expected the indices of three different particles"), "{error}");
    let error = refusal(&TIED.replace("linear_density: 1,", "linear_density: 3e38,"));
    let message = "nets[0] cannot be laid out: sizes and material do not go together: masses[1]: mass is inf";
    assert!(error.contains(message), "{error}");
}

#[test]
fn bends_breaking_forces_and_wind_are_read_written_and_refused() {
    let text = "(
        environment: (wind: (1, 2, 3), air_density: 1.225),
        particles: [
            (position: (0, 0, 0), mass: 1), (position: (1, 0, 0), mass: 1), (position: (2, 0, 0), mass: 1),
        ],
        springs: [(particles: (0, 1), stiffness: 1, breaking_force: Some(3))],
        bends: [(particles: (0, 1, 2), stiffness: 10, damping: 0.5)],
    )";
    let scene = MassSpringScene::from_ron(text).unwrap();
    assert_eq!(scene.environment.wind, Vec3::new(1.0, 2.0, 3.0));
    assert_eq!(scene.environment.air_density, 1.225);
    assert_eq!(scene.springs[0].breaking_force, Some(3.0));
    assert_eq!((scene.bends[0].stiffness, scene.bends[0].damping), (10.0, 0.5));
    assert_eq!(scene, MassSpringScene::from_ron(&scene.to_ron()).unwrap());
    let not_negative = "expected a finite number >= 0";
    for (old, new, message) in [
        ("wind: (1, 2, 3)", "wind: (1, NaN, 3)", "environment.wind is [1.0, NaN, 3.0], expected a vector"),
        (
            "air_density: 1.225",
            "air_density: -1",
            "environment.air_density is -1.0, expected a finite number",
        ),
        (
            "breaking_force: Some(3)",
            "breaking_force: Some(-3)",
            "springs[0].breaking_force is -3.0, expected",
        ),
        ("stiffness: 10", "stiffness: -10", "bends[0].stiffness is -10.0, expected"),
        ("damping: 0.5", "damping: inf", "bends[0].damping is inf, expected"),
        (
            "(0, 1, 2)",
            "(0, 1, 3)",
            "bends[0].particles is (0, 1, 3), expected three indices into the list of 3",
        ),
    ] {
        let error = MassSpringScene::from_ron(&text.replace(old, new)).expect_err(message).to_string();
        assert!(error.contains(message), "{error}");
        assert!(error.contains(not_negative) || !message.ends_with("expected"), "{error}");
    }
}

/// Two layers of a cloth, one of them pinned, that fly into each other. Returns whether they kept their distance for 20
/// ticks.
fn layers_stay_apart(self_collision: bool, integrator: Integrator, stiffness: f32) -> bool {
    let text = format!(
        "(environment: (gravity: (0, 0, 0)), solver: (integrator: {integrator}),
          particles: [],
          nets: [Cloth(corner: (0, 0, 0), width: (1, 0, 0), height: (0, 0.2, 0), cells: (10, 2), radius: 0.03,
                       area_density: 1, stretch_stiffness: {stiffness}, shear_stiffness: {stiffness},
                       pinned: [0, 1, 2, 3, 4, 11, 12, 13, 14, 15, 22, 23, 24, 25, 26],
                       self_collision: {self_collision})])"
    );
    let scene = MassSpringScene::from_ron(&text).unwrap();
    let mut app = headless_app();
    scene.apply_settings(app.world_mut());
    let spawned = scene.spawn(&mut app.world_mut().commands());
    app.world_mut().flush();
    let mut net = app.world_mut().get_mut::<ParticleNet>(spawned.nets[0]).unwrap();
    for particle in 0..net.len() {
        let place = net.positions()[particle];
        if place.x > 0.55 {
            // Folded about x = 0.5, the upper layer 0.1 m above the lower one.
            net.positions_mut()[particle] = Vec3::new(1.0 - place.x, place.y, 0.1);
            net.velocities_mut()[particle] = Vec3::NEG_Z;
        }
    }
    (0..20).all(|_| {
        app.update();
        let net = app.world().get::<ParticleNet>(spawned.nets[0]).unwrap();
        // The last column, which lies over the first one: both are 0.03 m thick on either side.
        [10, 21, 32].iter().all(|particle| net.positions()[*particle].z > 0.05)
    })
}

#[test]
fn a_cloth_collides_with_itself_or_not() {
    for integrator in
        [Integrator::Auto, Integrator::VelocityVerlet, Integrator::ImplicitEuler, Integrator::Xpbd]
    {
        for stiffness in [1.0, 1e3] {
            assert!(layers_stay_apart(true, integrator, stiffness), "{integrator}, {stiffness} N/m");
            assert!(!layers_stay_apart(false, integrator, stiffness), "{integrator}, {stiffness} N/m");
        }
    }
}
