//! Recipes that wait for a mesh.

use std::sync::Arc;

use bevy::prelude::*;
use bevy_mass_spring::nets::{RecipeMesh, TriangleMesh};
use bevy_mass_spring::prelude::*;

use crate::common::logged::Logged;
use crate::common::*;

/// A recipe from a mesh without one is named once, and laid out when the mesh comes.
#[test]
fn a_recipe_without_a_mesh_is_named_once() {
    let logged = Logged::start();
    let mut app = app();
    let cloth = app.world_mut().spawn(Cloth::from_mesh()).id();
    run(&mut app, 5);
    let line = logged.take_one();
    assert!(line.contains(&format!("cloth {cloth}")) && line.contains("RecipeMesh"), "{line:?}");
    assert_eq!(line.contains("feature `render`"), cfg!(not(feature = "render")), "{line:?}");
    // Inserted again it is named again.
    app.world_mut().entity_mut(cloth).insert(Cloth::from_mesh());
    run(&mut app, 5);
    assert_eq!(logged.take_one(), line);
    let mesh = TriangleMesh::new(vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]]);
    app.world_mut().entity_mut(cloth).insert(RecipeMesh(Arc::new(mesh)));
    run(&mut app, 5);
    assert_eq!(app.world().get::<ParticleNet>(cloth).unwrap().len(), 3);
    logged.assert_silent();
}

/// What is despawned, is made from no mesh any more, or gets its mesh within the next frame is not named.
#[test]
fn a_recipe_that_does_not_wait_is_not_named() {
    let logged = Logged::start();
    let mut app = app();
    let [gone, changed, late] = [0; 3].map(|_| app.world_mut().spawn(Balloon::from_mesh()).id());
    app.update();
    app.world_mut().despawn(gone);
    app.world_mut().entity_mut(changed).insert(Balloon::default());
    let corners = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z].to_vec();
    let mesh = TriangleMesh::new(corners, vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]);
    app.world_mut().entity_mut(late).insert(RecipeMesh(Arc::new(mesh)));
    run(&mut app, 5);
    logged.assert_silent();
    assert_eq!(app.world().get::<ParticleNet>(late).unwrap().len(), 4);
}
