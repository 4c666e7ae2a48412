//! Materials and winches that change while a net runs: what happened to it stays.

use bevy::prelude::*;
use bevy_mass_spring::nets::{Part, PartOf, PartState, Side, Topology};
use bevy_mass_spring::prelude::*;

use super::shapes::net;
use crate::common::{app, run};

/// A rope of 1 kg/m, stiff against bending a little, that hangs from its start.
fn heavy_rope(segments: u32) -> Rope {
    Rope::new(1.0).with_segments(segments).with_radius(0.0).with_material(RopeMaterial {
        linear_density: 1.0,
        stretch_stiffness: 2e3,
        bending_stiffness: 1e-3,
        retardation_time: 2e-3,
    })
}

fn hanging(app: &mut App, rope: impl Bundle, start: impl Bundle) -> Entity {
    let rope = app.world_mut().spawn((rope, Transform::from_xyz(0.0, 5.0, 0.0))).id();
    app.world_mut().spawn((PartOf(rope), Part::Start, Pinned, start, Transform::from_xyz(0.0, 5.0, 0.0)));
    rope
}

/// The broken spring exerts no force, and no bend goes over it.
fn assert_broken(topology: &Topology, broken: u32) {
    let (ends, spring) = topology.springs[broken as usize];
    assert_eq!((spring.stiffness, spring.damping), (0.0, 0.0));
    let over = topology.rods.iter().filter(|(others, _)| ends.iter().all(|end| others.contains(end)));
    assert!(over.clone().count() > 0 && over.into_iter().all(|(_, rod)| rod.stiffness == 0.0));
}

#[test]
fn a_broken_rope_stays_broken_in_another_material() {
    let mut app = app();
    // It weighs 9.8 N.
    let rope = hanging(&mut app, (heavy_rope(10), Breaking { force: Some(6.0), ..default() }), ());
    run(&mut app, 30);
    let broken = net(&app, rope).broken().to_vec();
    assert!(!broken.is_empty());
    let before = net(&app, rope).topology().clone();
    let end = net(&app, rope).positions()[10];
    {
        let mut recipe = app.world_mut().get_mut::<Rope>(rope).unwrap();
        recipe.material.stretch_stiffness *= 2.0;
        recipe.material.bending_stiffness *= 3.0;
    }
    run(&mut app, 20);
    let after = net(&app, rope);
    assert_eq!(after.broken(), broken);
    broken.iter().for_each(|spring| assert_broken(after.topology(), *spring));
    for ((_, old), (_, new)) in before.springs.iter().zip(&after.topology().springs) {
        assert_eq!((new.stiffness, new.damping), (2.0 * old.stiffness, 2.0 * old.damping));
        assert_eq!(new.breaking_force, old.breaking_force);
    }
    for ((_, old), (_, new)) in before.rods.iter().zip(&after.topology().rods) {
        assert!((new.stiffness - 3.0 * old.stiffness).abs() <= 1e-6 * new.stiffness);
    }
    assert!(after.positions()[10].y < end.y - 0.5, "it goes on falling");
    // Without bends, and with them again.
    for (stiffness, expected) in [(0.0, 0.0), (1e-3, before.rods[8].1.stiffness)] {
        app.world_mut().get_mut::<Rope>(rope).unwrap().material.bending_stiffness = stiffness;
        run(&mut app, 2);
        let after = net(&app, rope);
        assert_eq!(after.broken(), broken);
        let last = after.topology().rods.iter().find(|(ends, _)| *ends == before.rods[8].0);
        assert_eq!(last.map_or(0.0, |(_, rod)| rod.stiffness), expected);
        assert!(after.topology().rods.iter().all(|(ends, rod)| {
            rod.stiffness == 0.0
                || !broken
                    .iter()
                    .any(|spring| before.springs[*spring as usize].0.iter().all(|end| ends.contains(end)))
        }));
    }
}

#[test]
fn a_torn_cloth_stays_torn_in_another_material() {
    let mut app = app();
    let sheet = Cloth::grid(Vec3::Y * 2.0, Vec3::X, Vec3::Y, UVec2::splat(6)).with_radius(0.0);
    let soft = ClothMaterial { stretch_stiffness: 200.0, shear_stiffness: 60.0, ..ClothMaterial::COTTON };
    let breaking = Breaking { strain: Some(0.2), ..default() };
    let cloth = app.world_mut().spawn((sheet.with_material(soft), breaking)).id();
    app.world_mut().spawn((PartOf(cloth), Part::Edge(Side::Top), Pinned));
    app.world_mut().spawn((PartOf(cloth), Part::Edge(Side::Bottom), AppliedForce(Vec3::NEG_Y * 60.0)));
    run(&mut app, 40);
    let torn = net(&app, cloth).clone();
    assert!(torn.len() > 49, "it tore");
    let (before, mass) = (torn.topology().clone(), torn.mass());
    {
        let mut recipe = app.world_mut().get_mut::<Cloth>(cloth).unwrap();
        let material = &mut recipe.material;
        material.area_density *= 2.0;
        material.stretch_stiffness *= 4.0;
        material.shear_stiffness *= 4.0;
    }
    app.world_mut().get_mut::<ParticleNet>(cloth).unwrap().velocities_mut().fill(Vec3::ZERO);
    // What pulls at it is gone, so that it tears no further.
    let parts: Vec<Entity> = app.world().get::<Parts>(cloth).unwrap().entities().to_vec();
    app.world_mut().entity_mut(parts[1]).remove::<AppliedForce>();
    run(&mut app, 1);
    let after = net(&app, cloth);
    assert_eq!((after.len(), &after.topology().triangles), (torn.len(), &before.triangles));
    assert_eq!(after.broken(), torn.broken());
    assert!((after.mass() / mass - 2.0).abs() < 1e-5, "{} {mass}", after.mass());
    assert_eq!(after.topology().springs.len(), before.springs.len());
    for ((ends, old), (new_ends, new)) in before.springs.iter().zip(&after.topology().springs) {
        assert_eq!((ends, old.rest_length), (new_ends, new.rest_length));
        assert!((new.stiffness - 4.0 * old.stiffness).abs() <= 1e-5 * new.stiffness, "{old:?} {new:?}");
        assert_eq!(new.breaking_force.is_some(), old.breaking_force.is_some());
    }
}

#[test]
fn a_winch_goes_on_in_another_material_and_mends_nothing() {
    let mut app = app();
    let winch = Winch { speed: -0.2, ..default() };
    let rope = hanging(&mut app, heavy_rope(10), winch);
    run(&mut app, 60);
    let before = net(&app, rope).clone();
    app.world_mut().get_mut::<Rope>(rope).unwrap().material.stretch_stiffness *= 2.0;
    run(&mut app, 1);
    let step = 0.2 * app.world().resource::<Time<Fixed>>().timestep().as_secs_f64();
    let out = net(&app, rope).wound_out().unwrap();
    assert!((before.wound_out().unwrap() - step - out).abs() < 1e-6, "{out}");
    let last = |net: &ParticleNet| net.topology().springs[9].1.stiffness;
    assert_eq!(last(net(&app, rope)), 2.0 * last(&before));
    // It breaks at what hangs from it, and the winch takes in the rest.
    app.world_mut().entity_mut(rope).insert(Breaking { force: Some(4.0), ..default() });
    run(&mut app, 60);
    let after = net(&app, rope);
    assert!(!after.broken().is_empty());
    after.broken().iter().for_each(|spring| assert_broken(after.topology(), *spring));
    assert_eq!(after.pieces(), after.broken().len() + 1);
}

/// Its end stays its end, however much rope comes in before it.
#[test]
fn what_hangs_from_a_rope_stays_at_its_end() {
    let mut app = app();
    let load = app.world_mut().spawn((Particle::new(2.0, 0.0), Transform::from_xyz(0.0, 3.8, 0.0))).id();
    let rope = hanging(&mut app, heavy_rope(10), Winch { speed: 0.5, ..default() });
    let end = app.world_mut().spawn((PartOf(rope), Part::End, Attachment::to(load))).id();
    let mut lowest = f32::INFINITY;
    for _ in 0..128 {
        run(&mut app, 1);
        lowest = lowest.min(app.world().get::<Transform>(load).unwrap().translation.y);
    }
    let net = net(&app, rope);
    assert!(net.len() > 11, "rope was added");
    assert_eq!(app.world().get::<PartState>(end).unwrap().particles(), [10]);
    let (length, out) = (net.length().unwrap(), net.wound_out().unwrap() as f32);
    // EA = 2 kN bears 30 N at 1.5 %, and swings by as much again.
    assert!((length / out - 1.0).abs() < 0.05, "{length} {out}");
    let depth = 5.0 - app.world().get::<Transform>(load).unwrap().translation.y;
    assert!((depth - 0.2 - out).abs() < 0.1 * out && 5.0 - lowest < 1.1 * (0.2 + out), "{depth} {out}");
}
