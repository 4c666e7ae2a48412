//! The memory of an app in which nets move and are drawn for a long time. It is that of the process, as Bevy frees on one
//! thread what it allocates on another: this is the only test of its binary.
#![cfg(target_os = "linux")]

mod common;

use bevy::asset::AssetPlugin;
use bevy::camera::CameraPlugin;
use bevy::mesh::MeshPlugin;
use bevy::prelude::*;
use bevy_mass_spring::prelude::*;

use common::{app_with, report, run, scheme};

/// Of each of the five kinds.
const NETS: usize = 20;
const FRAMES: u32 = 10_000;
/// In which arrays grow to their sizes.
const FIRST_FRAMES: u32 = 1000;

fn spawn(world: &mut World, kind: usize, number: usize) {
    let place = Transform::from_xyz(number as f32 - 10.0, kind as f32 - 2.0, 0.0);
    let cord = || {
        let material =
            RopeMaterial { stretch_stiffness: 30.0, retardation_time: 1e-4, ..RopeMaterial::RUBBER_CORD };
        let rope = Rope::between(Vec3::ZERO, Vec3::new(0.6, 0.3, 0.0)).with_segments(8);
        (rope.with_material(material), place, related!(Parts[(Part::Start, Pinned)]))
    };
    let soft = ClothMaterial {
        area_density: 0.2,
        stretch_stiffness: 50.0,
        shear_stiffness: 20.0,
        bending_stiffness: 0.0,
        retardation_time: 1e-3,
    };
    match kind {
        0 => {
            let sheet = Cloth::sheet(Rectangle::new(0.6, 0.6)).with_cells(UVec2::splat(5));
            let top = related!(Parts[(Part::Edge(Side::Top), Pinned)]);
            world.spawn((sheet.with_material(soft), NetMesh, place, top));
        }
        1 => {
            world.spawn((cord(), RopeMesh::default()));
        }
        2 => {
            world.spawn((cord(), RopeRibbon::default()));
        }
        3 => {
            let mesh = world.resource_mut::<Assets<Mesh>>().add(Cuboid::from_length(0.05));
            let net = world.spawn(cord()).id();
            let template = world.spawn((Mesh3d(mesh), Visibility::Hidden, ChildOf(net))).id();
            world.entity_mut(net).insert(RopeLinks::new(template));
        }
        _ => {
            let mesh = world.resource_mut::<Assets<Mesh>>().add(Sphere::new(0.25).mesh().ico(2).unwrap());
            let jelly = Jelly::cuboid(Cuboid::from_length(0.4)).with_cells(UVec3::splat(2));
            let material = JellyMaterial { youngs_modulus: 500.0, ..JellyMaterial::GELATINE };
            let top = related!(Parts[(Part::Particle(26), Pinned)]);
            let net = world.spawn((jelly.with_material(material), place, top)).id();
            world.spawn((Mesh3d(mesh), NetSkin(net), place, ChildOf(net)));
        }
    }
}

fn draw(app: &mut App, frames: u32) {
    for frame in 0..frames {
        // What has come to rest is not written: the wind turns.
        let wind = Vec3::new(2.0, 0.0, 4.0) * (frame as f32 * 0.02).cos();
        app.world_mut().resource_mut::<Environment>().wind = wind;
        run(app, 1);
    }
}

/// The memory that the process takes, bytes.
fn resident() -> i64 {
    let status = std::fs::read_to_string("/proc/self/status").expect("on Linux there is one");
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).expect("it has this line");
    let kilobytes = line.trim().strip_suffix(" kB").and_then(|number| number.trim().parse::<i64>().ok());
    1024 * kilobytes.expect("a number of kB")
}

/// The bar: memory is flat over 10,000 frames of 100 nets that are drawn.
#[test]
fn memory_is_flat_over_ten_thousand_frames() {
    let plugins = (
        TransformPlugin,
        AssetPlugin::default(),
        MeshPlugin,
        CameraPlugin,
        MassSpringPlugin::default().physics_only(),
        MassSpringRenderPlugin,
    );
    let mut app = app_with(plugins);
    app.insert_resource(scheme(Integrator::SemiImplicitEuler, 8));
    app.world_mut().resource_mut::<Environment>().air_density = 1.2;
    app.world_mut().resource_mut::<CollisionSettings>().particles = false;
    app.world_mut().spawn((Camera3d::default(), Transform::from_xyz(0.0, 0.0, 30.0)));
    for number in 0..5 * NETS {
        spawn(app.world_mut(), number / NETS, number % NETS);
    }
    draw(&mut app, FIRST_FRAMES);
    let first = resident();
    let meshes = app.world().resource::<Assets<Mesh>>().len();
    draw(&mut app, FRAMES);
    let growth = resident() - first;
    println!("{growth} bytes in {FRAMES} frames after {first}");
    assert_eq!(app.world().resource::<Assets<Mesh>>().len(), meshes);
    assert_eq!(report(&app).faults, 0);
    app.world_mut().resource_mut::<Messages<AssetEvent<Mesh>>>().clear();
    run(&mut app, 1);
    let mut events = app.world_mut().resource_mut::<Messages<AssetEvent<Mesh>>>();
    let written = events.drain().filter(|event| matches!(event, AssetEvent::Modified { .. })).count();
    assert_eq!(written, 4 * NETS, "all are drawn, but for links, which have no mesh of their own");
    // A byte for each net and frame.
    assert!(growth < i64::from(FRAMES) * 5 * NETS as i64, "{growth} bytes after {first}");
}
