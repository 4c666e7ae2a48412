//! Below its yield strain a net is as any other, and what has yielded stays so, whatever happens to the net.

use bevy::prelude::*;
use bevy_mass_spring::nets::{Part, PartOf, Rupture, tear};
use bevy_mass_spring::prelude::*;
use bevy_mass_spring::solver::Integrator;

use super::{EA, SCHEMES, lab, move_end, net, smooth, spawn_wire, strains, wire};
use crate::common::run;

fn bits(app: &App, nets: &[Entity]) -> Vec<[u32; 6]> {
    let all = nets.iter().flat_map(|entity| {
        let net = net(app, *entity);
        net.positions().iter().zip(net.velocities())
    });
    all.map(|(at, speed)| [at.x, at.y, at.z, speed.x, speed.y, speed.z].map(f32::to_bits)).collect()
}

/// A rope, a sheet, a cube and a ball that fall, hang and hit the ground.
fn bustle(scheme_of: (Integrator, u32), yielding: Option<Yielding>) -> (App, Vec<Entity>) {
    let mut app = lab(scheme_of);
    app.world_mut().resource_mut::<Environment>().gravity_enabled = true;
    app.world_mut().resource_mut::<CollisionSettings>().ground = true;
    let rope = Rope { material: RopeMaterial { stretch_stiffness: 200.0, ..wire(8).material }, ..wire(8) };
    let soft = ClothMaterial { stretch_stiffness: 100.0, shear_stiffness: 20.0, ..ClothMaterial::COTTON };
    let sheet = Cloth::sheet(Rectangle::new(0.6, 0.6)).with_cells(UVec2::splat(6)).with_material(soft);
    let cube = Jelly::lattice(Vec3::ZERO, Vec3::splat(0.3), UVec3::splat(2));
    let cube = cube.with_material(JellyMaterial { youngs_modulus: 3e3, ..JellyMaterial::GELATINE });
    let ball = Balloon { material: BalloonMaterial::LATEX, ..Balloon::sphere(Sphere::new(0.2)) }
        .with_subdivisions(1);
    let world = app.world_mut();
    let nets = vec![
        world.spawn((rope, Transform::from_xyz(0.0, 2.0, 0.0))).id(),
        world.spawn((sheet, Transform::from_xyz(2.0, 2.0, 0.0))).id(),
        world.spawn((cube, Transform::from_xyz(4.0, 0.3, 0.0))).id(),
        world.spawn((ball, Transform::from_xyz(6.0, 0.5, 0.0))).id(),
    ];
    world.spawn((PartOf(nets[0]), Part::Start, Pinned));
    world.spawn((PartOf(nets[1]), Part::Corner(Corner::TopLeft), Pinned));
    if let Some(yielding) = yielding {
        nets.iter().for_each(|net| _ = app.world_mut().entity_mut(*net).insert(yielding));
    }
    (app, nets)
}

#[test]
fn below_the_yield_strain_nothing_changes_to_the_bit() {
    for scheme_of in SCHEMES.into_iter().chain([(Integrator::Xpbd, 16)]) {
        let yielding = Yielding { strain: Some(10.0), max_strain: Some(1.0) };
        let (mut plastic, nets) = bustle(scheme_of, Some(yielding));
        let (mut elastic, _) = bustle(scheme_of, None);
        let (mut changing, _) = bustle(scheme_of, None);
        for tick in 0..60_u32 {
            if tick == 20 || tick == 40 {
                let yielding = Yielding { strain: (tick == 20).then_some(5.0), max_strain: None };
                nets.iter().for_each(|net| _ = changing.world_mut().entity_mut(*net).insert(yielding));
            }
            [&mut plastic, &mut elastic, &mut changing].into_iter().for_each(|app| run(app, 1));
            let expected = bits(&elastic, &nets);
            assert!(bits(&plastic, &nets) == expected, "{scheme_of:?}, tick {tick}");
            assert!(bits(&changing, &nets) == expected, "changing, {scheme_of:?}, tick {tick}");
        }
    }
}

#[test]
fn snapshots_and_restarts_repeat_what_yields_to_the_bit() {
    for scheme_of in [SCHEMES[0], SCHEMES[1], SCHEMES[6], (Integrator::Xpbd, 16)] {
        let yielding = Yielding { strain: Some(1e-3), max_strain: Some(0.3) };
        let state = |app: &App, nets: &[Entity]| {
            let strains = nets.iter().flat_map(|entity| strains(net(app, *entity).topology()));
            (bits(app, nets), strains.map(f32::to_bits).collect::<Vec<u32>>())
        };
        let (mut app, nets) = bustle(scheme_of, Some(yielding));
        run(&mut app, 20);
        let (snapshot, at_20) = (Snapshot::take(app.world()), state(&app, &nets));
        run(&mut app, 40);
        let at_60 = state(&app, &nets);
        for entity in &nets {
            let [early, late] =
                [&at_20, &at_60].map(|(_, strains)| strains.iter().filter(|of| **of != 0).count());
            assert!(early > 0 && late > early, "{early} and {late} springs have yielded, of {entity}");
        }
        snapshot.restore(app.world_mut());
        assert!(state(&app, &nets) == at_20);
        run(&mut app, 40);
        assert!(state(&app, &nets) == at_60, "{scheme_of:?}, after a snapshot");
        RestoreInitialState.apply(app.world_mut());
        run(&mut app, 60);
        assert!(state(&app, &nets) == at_60, "{scheme_of:?}, after a restart");
        let (mut other, nets) = bustle(scheme_of, Some(yielding));
        run(&mut other, 1);
        #[cfg(feature = "scene")]
        let snapshot: Snapshot = ron::from_str(&ron::to_string(&snapshot).unwrap()).unwrap();
        snapshot.restore_in_order(other.world_mut()).unwrap();
        run(&mut other, 40);
        assert!(state(&other, &nets) == at_60, "{scheme_of:?}, in another app");
    }
}

/// A rope that has yielded.
fn yielded_wire(app: &mut App) -> [Entity; 2] {
    let yielding = Yielding { strain: Some(0.02), max_strain: None };
    let wire = spawn_wire(app, (wire(20), yielding));
    move_end(app, wire[1], 1.1);
    wire
}

#[test]
fn what_has_yielded_stays_so_in_another_material_and_when_it_yields_no_more() {
    let mut app = lab(SCHEMES[0]);
    let wire = yielded_wire(&mut app);
    let found = |app: &App| strains(net(app, wire[0]).topology());
    let before = found(&app);
    {
        let mut recipe = app.world_mut().get_mut::<Rope>(wire[0]).unwrap();
        recipe.material.linear_density *= 2.0;
        recipe.material.stretch_stiffness *= 0.5;
        recipe.material.bending_stiffness = 1e-3;
        recipe.radius = 0.001;
    }
    run(&mut app, 2);
    assert_eq!(found(&app), before);
    assert_eq!(net(&app, wire[0]).topology().springs[3].1.stiffness, 0.5 * EA / 0.05);
    // It was at its yield strain, and is elastic from now on.
    app.world_mut().entity_mut(wire[0]).insert(Yielding::default());
    move_end(&mut app, wire[1], 1.2);
    assert_eq!(found(&app), before);
    let tension = net(&app, wire[0]).tension(10);
    assert!((tension / (0.5 * EA * 0.12) - 1.0).abs() < 0.02, "{tension}");
    // A limit below what it has: it goes no further.
    let limited = Yielding { strain: Some(0.01), max_strain: Some(0.03) };
    app.world_mut().entity_mut(wire[0]).insert(limited);
    run(&mut app, 5);
    assert!(found(&app).iter().zip(&before).all(|(now, before)| now == before || *now <= 0.03));
    // Bad values change nothing.
    app.world_mut().entity_mut(wire[0]).insert(Yielding { strain: Some(-1.0), max_strain: None });
    run(&mut app, 1);
    let plasticity = net(&app, wire[0]).topology().springs[0].1.plasticity.unwrap();
    assert_eq!((plasticity.yield_strain, plasticity.max_strain), (0.01, 0.03));
}

/// Its halves have the plastic strain of the spring that a tear divides.
#[test]
fn a_tear_keeps_what_has_yielded() {
    let sheet = Cloth::grid(Vec3::ZERO, Vec3::X, Vec3::Y, UVec2::splat(4));
    let mut topology = sheet.topology().unwrap();
    Yielding { strain: Some(0.1), max_strain: None }.give_to(&mut topology);
    let strain = |number: usize| 1e-3 * (number + 1) as f32;
    for (number, (_, spring)) in topology.springs.iter_mut().enumerate() {
        spring.plasticity.as_mut().unwrap().strain = strain(number);
    }
    let (before, mut positions) = (topology.clone(), topology.positions.clone());
    let mut velocities = vec![Vec3::ZERO; positions.len()];
    for spring in [20, 33, 47, 60] {
        tear(&mut topology, &mut positions, &mut velocities, &[Rupture { spring, elongation: 0.1 }]);
    }
    let count = before.springs.len();
    assert!(topology.springs.len() > count, "springs are divided");
    for (number, (_, spring)) in topology.springs.iter().enumerate().filter(|(_, (_, of))| of.stiffness > 0.0)
    {
        let found = spring.plasticity.unwrap().strain;
        if number < count {
            assert_eq!(found, strain(number));
        } else {
            let divided = before.springs.iter().zip(&topology.springs).find(|((_, old), (_, new))| {
                old.plasticity.unwrap().strain == found && new.stiffness < old.stiffness
            });
            assert!(divided.is_some(), "{number}: {found}");
        }
    }
}

/// A rope that is stretched by a tenth for good is wound up so and comes out so; fresh rope does not. The length without
/// tension is within 1 mm of what is outside, the tension as it was within 5 %.
#[test]
fn a_winch_takes_in_and_pays_out_what_has_yielded() {
    let mut app = lab(SCHEMES[0]);
    let (yielding, segments) = (Yielding { strain: Some(0.02), max_strain: None }, 20);
    let mut topology = wire(segments).topology().unwrap();
    yielding.give_to(&mut topology);
    topology.springs.iter_mut().for_each(|(_, spring)| spring.plasticity.as_mut().unwrap().strain = 0.1);
    let force = 5.0;
    let stretch = Transform::from_scale(Vec3::splat(1.1 + force / EA));
    let rope = app.world_mut().spawn((ParticleNet::new(topology.into(), &stretch), yielding)).id();
    let winch = app.world_mut().spawn((PartOf(rope), Part::Start, Pinned, Winch::default())).id();
    app.world_mut().spawn((PartOf(rope), Part::End, AppliedForce(Vec3::X * force)));
    run(&mut app, 30);
    let mut last = force;
    // In by 0.4 m, out by 0.8 m.
    for (speed, ticks) in [(-0.2, 160), (0.2, 288)] {
        for tick in 0..ticks {
            let ramp = smooth(tick, 32).min(smooth(ticks - tick, 32));
            app.world_mut().get_mut::<Winch>(winch).unwrap().speed = speed * ramp;
            run(&mut app, 1);
            let net = net(&app, rope);
            let out = net.wound_out().unwrap() as f32;
            let acting = net.topology().springs.iter().filter(|(_, spring)| spring.stiffness > 0.0);
            let free: f32 = acting.map(|(_, spring)| spring.length_at_rest()).sum();
            let expected = if out > 1.0 { out + 0.1 } else { 1.1 * out };
            assert!(
                (free - expected).abs() < 1e-3,
                "tick {tick}: {free} m without tension, {expected} expected"
            );
            let tension = net.tension(segments as usize - 1);
            assert!((tension / last - 1.0).abs() < 0.05, "tick {tick}: from {last} N to {tension} N");
            assert!((tension / force - 1.0).abs() < 0.1, "tick {tick}: {tension} N");
            last = tension;
        }
    }
    assert!(net(&app, rope).len() > 21, "rope was added");
}
