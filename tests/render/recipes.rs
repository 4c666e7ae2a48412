//! Recipes that are made from meshes.

use std::sync::Arc;

use bevy::asset::{AssetPlugin, RenderAssetUsages};
use bevy::camera::CameraPlugin;
use bevy::mesh::{MeshPlugin, PrimitiveTopology};
use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use bevy_mass_spring::nets::RecipeMesh;
use bevy_mass_spring::prelude::*;

fn app() -> App {
    let mut app = App::new();
    app.add_plugins((
        MinimalPlugins,
        TransformPlugin,
        AssetPlugin::default(),
        MeshPlugin,
        CameraPlugin,
        MassSpringPlugin::default(),
    ))
    .insert_resource(TimeUpdateStrategy::FixedTimesteps(1));
    app.finish();
    app.cleanup();
    app
}

/// A square of 1 m with so many corners along its sides.
fn square(corners: u32) -> Mesh {
    Plane3d::default().mesh().size(1.0, 1.0).subdivisions(corners - 2).build()
}

fn particles(app: &App, net: Entity) -> Option<usize> {
    app.world().get::<ParticleNet>(net).map(ParticleNet::len)
}

#[test]
fn a_recipe_waits_for_its_mesh_and_equal_ones_share_it() {
    let mut app = app();
    let mesh = app.world().resource::<Assets<Mesh>>().reserve_handle();
    let cloths = [0.0, 5.0].map(|x| {
        let place = Transform::from_xyz(x, 2.0, 0.0);
        app.world_mut().spawn((Mesh3d(mesh.clone()), Cloth::from_mesh(), place)).id()
    });
    let sheet =
        app.world_mut().spawn((Mesh3d(mesh.clone()), Cloth::default().with_cells(UVec2::splat(2)))).id();
    app.update();
    app.update();
    assert_eq!(cloths.map(|cloth| particles(&app, cloth)), [None, None]);
    app.world_mut().resource_mut::<Assets<Mesh>>().insert(mesh.id(), square(4)).expect("a reserved place");
    app.update();
    app.update();
    assert_eq!(cloths.map(|cloth| particles(&app, cloth)), [Some(16), Some(16)]);
    let world = app.world();
    let triangles = cloths.map(|cloth| world.get::<RecipeMesh>(cloth).expect("it was read").0.clone());
    assert!(Arc::ptr_eq(&triangles[0], &triangles[1]));
    let topologies =
        cloths.map(|cloth| world.get::<ParticleNet>(cloth).expect("laid out").topology().clone());
    assert!(Arc::ptr_eq(&topologies[0], &topologies[1]));
    assert!(world.get::<RecipeMesh>(sheet).is_none(), "it needs none");
}

#[test]
fn what_is_drawn_is_not_read_again_but_a_changed_mesh_is() {
    let mut app = app();
    let mesh = app.world_mut().resource_mut::<Assets<Mesh>>().add(square(3));
    let cloth = app.world_mut().spawn((Mesh3d(mesh.clone()), Cloth::from_mesh(), NetMesh)).id();
    for _ in 0..10 {
        app.update();
    }
    let height = |app: &App| app.world().get::<ParticleNet>(cloth).expect("laid out").positions()[4].y;
    let fallen = height(&app);
    assert_ne!(app.world().get::<Mesh3d>(cloth), Some(&Mesh3d(mesh.clone())), "it is drawn by a copy");
    // Of nine ticks of free fall at least five, of 1/64 s.
    assert!(fallen < -0.5 * 9.81 * (5.0_f32 / 64.0).powi(2) && fallen.is_finite(), "{fallen}");
    // Other normals make no other net.
    let mut meshes = app.world_mut().resource_mut::<Assets<Mesh>>();
    meshes.get_mut(&mesh).expect("loaded").compute_smooth_normals();
    app.update();
    app.update();
    assert!(height(&app) < fallen);
    *app.world_mut().resource_mut::<Assets<Mesh>>().get_mut(&mesh).expect("loaded") = square(5);
    app.update();
    app.update();
    app.update();
    assert_eq!(particles(&app, cloth), Some(25));
    assert!(height(&app) > fallen, "laid out anew");
}

#[test]
fn a_mesh_that_cannot_be_read_is_no_net_and_another_one_is() {
    let mut app = app();
    let lines = Mesh::new(PrimitiveTopology::LineList, RenderAssetUsages::default());
    let lines = app.world_mut().resource_mut::<Assets<Mesh>>().add(lines);
    let jelly = app.world_mut().spawn((Mesh3d(lines), Jelly::fill_mesh(0.25), Name::new("bunny"))).id();
    app.update();
    app.update();
    assert_eq!(particles(&app, jelly), None);
    let ball = app.world_mut().resource_mut::<Assets<Mesh>>().add(Mesh::from(Sphere::new(0.5)));
    app.world_mut().entity_mut(jelly).insert(Mesh3d(ball));
    app.update();
    app.update();
    assert!(particles(&app, jelly) > Some(8));
    // That of the game counts.
    let own =
        RecipeMesh(Arc::new(bevy_mass_spring::nets::TriangleMesh::from_mesh(&square(3)).expect("sound")));
    let mesh = app.world_mut().resource_mut::<Assets<Mesh>>().add(square(6));
    let cloth = app.world_mut().spawn((Mesh3d(mesh), Cloth::from_mesh(), own)).id();
    app.update();
    app.update();
    assert_eq!(particles(&app, cloth), Some(9));
}
