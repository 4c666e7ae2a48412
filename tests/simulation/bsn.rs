//! Nets and their parts in Bevy's scene notation.

use bevy::asset::AssetPlugin;
use bevy::prelude::*;
use bevy::scene::ScenePlugin;
use bevy_mass_spring::prelude::*;

use crate::common::{app_with, run, spawn_pinned};

fn app() -> App {
    app_with((AssetPlugin::default(), ScenePlugin, MassSpringPlugin::default()))
}

fn get<T: Component>(app: &App, entity: Entity) -> &T {
    app.world().get(entity).expect("the scene has one")
}

/// The rope that the other scenes change.
fn cord() -> impl Scene {
    bsn! {
        Rope {
            path: {vec![Vec3::Y * 3.0, Vec3::Y * 2.0]},
            segments: {Some(10)},
            material: RopeMaterial { stretch_stiffness: 2e3, linear_density: 0.1 },
        }
        Transform
        Parts [ Part::Start Pinned ]
    }
}

#[test]
fn a_rope_hangs_by_its_part() {
    let mut app = app();
    let rope = app.world_mut().spawn_scene(cord()).expect("it has no assets").id();
    run(&mut app, 60);
    let net = get::<ParticleNet>(&app, rope);
    assert_eq!((net.len(), net.positions()[0]), (11, Vec3::Y * 3.0));
    assert!(net.positions()[10].distance(Vec3::Y * 2.0) < 0.01, "{}", net.positions()[10]);
    // What is not named is as in the default.
    let recipe = get::<Rope>(&app, rope);
    let hemp = RopeMaterial::default();
    assert_eq!((recipe.spacing, recipe.material.bending_stiffness), (0.1, hemp.bending_stiffness));
    let part = get::<Parts>(&app, rope).entities()[0];
    assert_eq!((get::<Part>(&app, part), get::<PartOf>(&app, part)), (&Part::Start, &PartOf(rope)));
}

/// Fields of fields are patched one by one; parts are added to those that were there.
#[test]
fn a_scene_patches_another_one() {
    let mut app = app();
    let load = spawn_pinned(&mut app, Vec3::Y);
    let scene = bsn! {
        cord()
        Rope { radius: 0.05, material: RopeMaterial { bending_stiffness: 0.0 } }
        Breaking { force: {Some(100.0)} }
        Yielding { strain: {Some(0.05)} }
        Parts [
            Part::End Attachment { entity: load, stiffness: {Some(10.0)} },
            Part::Particle(5) AppliedForce({Vec3::X}),
        ]
    };
    let rope = app.world_mut().spawn_scene(scene).expect("it has no assets").id();
    run(&mut app, 2);
    let recipe = get::<Rope>(&app, rope);
    let Rope { radius, segments, material, .. } = recipe;
    assert_eq!((*radius, *segments), (0.05, Some(10)));
    assert_eq!(
        *material,
        RopeMaterial {
            stretch_stiffness: 2e3,
            linear_density: 0.1,
            bending_stiffness: 0.0,
            ..RopeMaterial::default()
        }
    );
    let topology = get::<ParticleNet>(&app, rope).topology();
    assert!(topology.rods.is_empty() && topology.springs[0].1.plasticity.is_some());
    assert_eq!(topology.springs[0].1.breaking_force, Some(100.0));
    let parts = get::<Parts>(&app, rope).entities().to_vec();
    let kinds: Vec<&Part> = parts.iter().map(|part| get::<Part>(&app, *part)).collect();
    assert_eq!(kinds, [&Part::Start, &Part::End, &Part::Particle(5)]);
    assert_eq!(*get::<Attachment>(&app, parts[1]), Attachment::to(load).with_stiffness(10.0));
    assert_eq!(get::<Spring>(&app, parts[1]).particles, [parts[1], load]);
    assert!(get::<ParticleNet>(&app, rope).positions()[5].x > 0.0);
}

/// A part may be anywhere in the scene and name its net; an attachment what it is tied to.
#[test]
fn parts_and_attachments_name_entities_of_the_scene() {
    let mut app = app();
    let scene = bsn! {
        #Hand
        Transform { translation: Vec3 { y: 4.0 } }
        Children [
            (
                #Rope
                Rope { segments: {Some(4)} }
                Parts [ Part::End Attachment { entity: #Load } ]
            ),
            (#Load Particle { mass: 0.1 } Transform { translation: Vec3 { y: -1.5 } }),
            (PartOf(#Rope) Part::Start Pinned),
        ]
    };
    let hand = app.world_mut().spawn_scene(scene).expect("it has no assets").id();
    run(&mut app, 2);
    let children: Vec<Entity> = get::<Children>(&app, hand).iter().collect();
    let [rope, load, start] = children[..] else { panic!("{children:?}") };
    assert_eq!(*get::<PartOf>(&app, start), PartOf(rope));
    assert_eq!(get::<ParticleNet>(&app, rope).positions()[0], Vec3::Y * 4.0);
    let end = get::<Parts>(&app, rope).entities().iter().find(|part| **part != start).expect("it has two");
    assert_eq!(get::<Attachment>(&app, *end).entity, load);
    app.world_mut().get_mut::<Transform>(hand).expect("it has one").translation.x = 1.0;
    run(&mut app, 1);
    assert_eq!(get::<ParticleNet>(&app, rope).positions()[0], Vec3::new(1.0, 4.0, 0.0));
}

#[test]
fn cloths_jellies_and_balloons_come_from_scenes() {
    let mut app = app();
    let cloth = bsn! {
        Cloth {
            shape: ClothShape::Sheet { corner: {Vec3::ZERO}, width: {Vec3::X}, height: {Vec3::Y * 2.0} },
            cells: {Some(UVec2::new(2, 4))},
            material: ClothMaterial { area_density: 0.3 },
        }
        Parts [
            (Part::Edge(Side::Top) Pinned),
            (Part::Corner(Corner::BottomRight) AppliedForce({Vec3::Z})),
        ]
    };
    let jelly = bsn! {
        Jelly { shape: JellyShape::Cuboid { min: {Vec3::ZERO}, max: {Vec3::ONE} }, cells: {Some(UVec3::ONE)} }
    };
    let balloon = bsn! {
        Balloon { shape: BalloonShape::Sphere { centre: {Vec3::ZERO}, radius: 0.3 }, subdivisions: 1 }
    };
    let cloth = app.world_mut().spawn_scene(cloth).expect("it has no assets").id();
    let jelly = app.world_mut().spawn_scene(jelly).expect("it has no assets").id();
    let balloon = app.world_mut().spawn_scene(balloon).expect("it has no assets").id();
    run(&mut app, 2);
    let net = get::<ParticleNet>(&app, cloth);
    assert_eq!((net.len(), net.positions()[14]), (15, Vec3::new(1.0, 2.0, 0.0)));
    assert!((net.mass() / 0.6 - 1.0).abs() < 1e-6);
    assert!(net.velocities()[2].z > 0.0 && (12..15).all(|particle| net.is_pinned(particle)));
    assert_eq!(get::<ParticleNet>(&app, jelly).len(), 8);
    let extent = get::<ParticleNet>(&app, balloon).topology().positions[0].length();
    assert!((extent / 0.3 - 1.0).abs() < 1e-6);
}
