//! Recipes become nets, and share what is equal.

use std::sync::Arc;

use bevy::prelude::*;
use bevy_mass_spring::nets::{Cloth, Rope, RopeMaterial};
use bevy_mass_spring::prelude::*;

use super::shapes::{net, net_bits, rope, spawn_net};
use crate::common::{app, run};

#[test]
fn a_recipe_is_laid_out_where_its_entity_is() {
    let mut app = app();
    let frame = Transform::from_xyz(1.0, 2.0, 3.0).with_rotation(Quat::from_rotation_z(1.0));
    let parent = app.world_mut().spawn(frame).id();
    let recipe = Rope::between(Vec3::ZERO, Vec3::X).with_segments(4);
    let child = app.world_mut().spawn((recipe.clone(), Transform::from_xyz(0.0, 0.0, 1.0))).id();
    app.world_mut().entity_mut(parent).add_child(child);
    let lone = app.world_mut().spawn(recipe).id();
    let sheet = app.world_mut().spawn(Cloth::grid(Vec3::ZERO, Vec3::X, Vec3::Y, UVec2::splat(3))).id();
    crate::common::plain(&mut app);
    run(&mut app, 1);
    let expected = frame.transform_point(Vec3::new(0.75, 0.0, 1.0));
    assert!(net(&app, child).positions()[3].distance(expected) < 1e-5);
    assert!(Arc::ptr_eq(net(&app, child).topology(), net(&app, lone).topology()), "equal recipes share");
    assert_eq!(app.world().resource::<TickReport>().particles, 5 + 5 + 16);
    assert_eq!(net(&app, sheet).len(), 16);
}

#[test]
fn a_material_is_live_and_the_rest_acts_on_insertion() {
    let mut app = app();
    let entity = app.world_mut().spawn(Rope::new(1.0).with_segments(4)).id();
    run(&mut app, 1);
    let before = net(&app, entity).topology().springs[0].1.stiffness;
    {
        let mut recipe = app.world_mut().get_mut::<Rope>(entity).unwrap();
        recipe.material =
            RopeMaterial { stretch_stiffness: 2.0 * recipe.material.stretch_stiffness, ..recipe.material };
        recipe.segments = Some(9);
    }
    run(&mut app, 1);
    assert_eq!(net(&app, entity).topology().springs[0].1.stiffness, 2.0 * before);
    assert_eq!(net(&app, entity).len(), 5);
    let recipe = app.world().get::<Rope>(entity).unwrap().clone();
    app.world_mut().entity_mut(entity).insert(recipe);
    run(&mut app, 1);
    assert_eq!(net(&app, entity).len(), 10, "inserted again, it is laid out anew");
    assert_eq!(app.world().resource::<TickReport>().particles, 10);
    // A bad one leaves the net as it is.
    app.world_mut().get_mut::<Rope>(entity).unwrap().material.linear_density = -1.0;
    run(&mut app, 1);
    assert_eq!(net(&app, entity).len(), 10);
}

/// All that is known of a net turns and moves with it; nothing else does.
#[test]
fn a_net_is_teleported_as_a_whole() {
    let [mut here, mut there] = [app(), app()];
    let isometry = Isometry3d::new(Vec3::new(100.0, 8.0, -50.0), Quat::from_rotation_y(2.0));
    let mut nets = Vec::new();
    for app in [&mut here, &mut there] {
        app.insert_resource(crate::common::scheme(
            bevy_mass_spring::solver::Integrator::SemiImplicitEuler,
            8,
        ));
        nets.push(spawn_net(app, &rope(12), Vec3::Y, &[0]));
        run(app, 20);
    }
    let other = spawn_net(&mut there, &rope(3), Vec3::ZERO, &[0, 1, 2]);
    run(&mut there, 1);
    run(&mut here, 1);
    there.world_mut().commands().queue(Teleport::entity(nets[1], isometry));
    there.world_mut().flush();
    run(&mut here, 30);
    run(&mut there, 30);
    for (here, there) in net(&here, nets[0]).positions().iter().zip(net(&there, nets[1]).positions()) {
        let expected = isometry * *here;
        // Coordinates of 100 m are 8e-6 m fine.
        assert!(there.distance(expected) < 1e-3, "{there} instead of {expected}");
    }
    assert_eq!(net_bits(&there, other)[2][..3], Vec3::new(0.2, 0.0, 0.0).to_array().map(f32::to_bits));
}

/// 471 substeps of an explicit scheme on 480 springs and a gas behind 320 faces would cost some times what the implicit scheme
/// does; on the springs alone they would not.
#[test]
fn the_scheme_of_a_balloon_is_chosen_with_its_gas() {
    let mut app = app();
    let balloon =
        Balloon::sphere(Sphere::new(0.15)).with_subdivisions(2).with_material(BalloonMaterial::LATEX);
    app.world_mut().spawn(balloon);
    run(&mut app, 2);
    let report = app.world().resource::<TickReport>();
    assert_eq!((report.springs, report.integrator), (480, Integrator::TrBdf2));
}
