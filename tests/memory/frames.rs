//! Nets that move and are drawn for a long time.

use allocation_counter::measure;
use bevy::app::TaskPoolOptions;
use bevy::asset::AssetPlugin;
use bevy::camera::CameraPlugin;
use bevy::mesh::MeshPlugin;
use bevy::prelude::*;
use bevy_mass_spring::prelude::*;

use crate::common::{app_on, run, scheme};
use crate::run_on_one_thread;

/// Of each of the five kinds.
const NETS: usize = 20;
const FRAMES: u32 = 10_000;
/// In which arrays grow to their sizes.
const FIRST_FRAMES: u32 = 1000;
/// Frames from one net that is replaced to the next.
const RENEWAL: u32 = 10;

/// A net, and what belongs to it.
#[derive(Component, Default)]
struct Drawn;

fn spawn(world: &mut World, kind: usize, number: usize) -> Entity {
    let place = Transform::from_xyz(number as f32 - 10.0, kind as f32 - 2.0, 0.0);
    let cord = || {
        let material = RopeMaterial { stretch_stiffness: 100.0, ..RopeMaterial::RUBBER_CORD };
        let rope = Rope::between(Vec3::ZERO, Vec3::new(0.6, 0.3, 0.0)).with_segments(8);
        (rope.with_material(material), Drawn, place, related!(Parts[(Part::Start, Pinned)]))
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
            world.spawn((sheet.with_material(soft), NetMesh, Drawn, place, top)).id()
        }
        1 => world.spawn((cord(), RopeMesh::default())).id(),
        2 => world.spawn((cord(), RopeRibbon::default())).id(),
        3 => {
            let mesh = world.resource_mut::<Assets<Mesh>>().add(Cuboid::from_length(0.05));
            let net = world.spawn(cord()).id();
            let template = world.spawn((Mesh3d(mesh), Visibility::Hidden, ChildOf(net))).id();
            world.entity_mut(net).insert(RopeLinks::new(template));
            net
        }
        _ => {
            let mesh = world.resource_mut::<Assets<Mesh>>().add(Sphere::new(0.25).mesh().ico(2).unwrap());
            let jelly = Jelly::cuboid(Cuboid::from_length(0.4)).with_cells(UVec3::splat(2));
            let material = JellyMaterial { youngs_modulus: 500.0, ..JellyMaterial::GELATINE };
            let top = related!(Parts[(Part::Particle(26), Pinned)]);
            let net = world.spawn((jelly.with_material(material), Drawn, place, top)).id();
            world.spawn((Mesh3d(mesh), NetSkin(net), place, ChildOf(net)));
            net
        }
    }
}

/// The bytes that are on the heap after a number of frames, and were not before.
fn growth(app: &mut App, nets: &mut [Entity], renews: bool, frames: u32) -> i64 {
    let all = measure(|| {
        for frame in 0..frames {
            // What has come to rest is not written: the wind turns.
            let wind = Vec3::new(2.0, 0.0, 4.0) * (frame as f32 * 0.02).cos();
            app.world_mut().resource_mut::<Environment>().wind = wind;
            if renews && frame.is_multiple_of(RENEWAL) {
                let index = (frame / RENEWAL) as usize % nets.len();
                app.world_mut().entity_mut(nets[index]).despawn();
                nets[index] = spawn(app.world_mut(), index / NETS, index % NETS);
            }
            run(app, 1);
        }
    });
    all.bytes_current
}

/// The bar: memory is flat over 10,000 frames of 100 nets that are drawn. Also where one is replaced in each tenth frame.
#[test]
fn memory_is_flat_over_ten_thousand_frames() {
    for renews in [false, true] {
        let plugins = (
            TransformPlugin,
            AssetPlugin::default(),
            MeshPlugin,
            CameraPlugin,
            MassSpringPlugin::default().physics_only(),
            MassSpringRenderPlugin,
        );
        let mut app = app_on(TaskPoolOptions::with_num_threads(1), plugins);
        run_on_one_thread(&mut app);
        app.insert_resource(scheme(Integrator::SemiImplicitEuler, 8));
        app.world_mut().resource_mut::<Environment>().air_density = 1.2;
        app.world_mut().resource_mut::<CollisionSettings>().particles = false;
        app.world_mut().spawn((Camera3d::default(), Transform::from_xyz(0.0, 0.0, 30.0)));
        let mut nets: Vec<Entity> =
            (0..5 * NETS).map(|number| spawn(app.world_mut(), number / NETS, number % NETS)).collect();
        let first = growth(&mut app, &mut nets, renews, FIRST_FRAMES);
        let meshes = app.world().resource::<Assets<Mesh>>().len();
        let then = growth(&mut app, &mut nets, renews, FRAMES);
        println!("{first} bytes in the first {FIRST_FRAMES} frames, {then} in the next {FRAMES}");
        assert_eq!(app.world().resource::<Assets<Mesh>>().len(), meshes);
        app.world_mut().resource_mut::<Messages<AssetEvent<Mesh>>>().clear();
        run(&mut app, 1);
        let mut events = app.world_mut().resource_mut::<Messages<AssetEvent<Mesh>>>();
        let written = events.drain().filter(|event| matches!(event, AssetEvent::Modified { .. })).count();
        assert_eq!(written, 4 * NETS, "all are drawn, but for links, which have no mesh of their own");
        assert!(then < first / 100, "{then} bytes after {first}");
    }
}
