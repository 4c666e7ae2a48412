//! What breaks in an app: springs and nets; ropes on winches.

use std::sync::Arc;

use bevy::prelude::*;
use bevy_mass_spring::nets::{Breaking, Layout, Part, PartOf, ParticleNet, Topology, Winch, pieces};
use bevy_mass_spring::prelude::*;
use bevy_mass_spring::solver;

use crate::common::{app, bits, join, plain, report, run, spawn, spawn_pinned};

/// The events of the app.
#[derive(Resource, Default)]
struct Seen(Vec<Broke>);

/// Its messages.
#[derive(Resource, Default)]
struct Read(Vec<Broke>);

pub fn watching() -> App {
    let mut app = app();
    plain(&mut app);
    app.insert_resource(SolverSettings::default());
    app.world_mut().resource_mut::<Environment>().gravity_enabled = true;
    app.init_resource::<Seen>().init_resource::<Read>();
    app.add_systems(Last, |mut messages: MessageReader<Broke>, mut read: ResMut<Read>| {
        read.0.extend(messages.read());
    });
    app.add_observer(|broke: On<Broke>, mut seen: ResMut<Seen>| seen.0.push(*broke));
    app
}

pub fn seen(app: &App) -> &[Broke] {
    &app.world().resource::<Seen>().0
}

/// A rope of `links` links of 0.1 m and 10 g, straight down from the origin.
pub fn rope(links: u32) -> Arc<Topology> {
    let link = solver::Spring::elastic(0.1, 5e3, 5.0);
    Arc::new(Topology {
        positions: (0..=links).map(|number| Vec3::NEG_Y * (number as f32 * 0.1)).collect(),
        masses: vec![0.01; links as usize + 1],
        springs: (0..links).map(|number| ([number, number + 1], link)).collect(),
        layout: Layout::Rope { is_closed: false },
        ..Topology::default()
    })
}

pub fn net(app: &App, entity: Entity) -> &ParticleNet {
    app.world().get(entity).unwrap()
}

/// It exerts no force from the tick on in which it breaks, and a restart and a snapshot bring it back, with the same bits after.
#[test]
fn a_spring_breaks_and_comes_back() {
    let mut app = watching();
    let anchor = spawn_pinned(&mut app, Vec3::ZERO);
    let bob = spawn(&mut app, 1.0, 0.0, Vec3::NEG_Y);
    let spring =
        join(&mut app, Spring::new(anchor, bob, 1.0).with_stiffness(400.0).with_breaking_force(12.0));
    run(&mut app, 1);
    let snapshot = Snapshot::take(app.world());
    // The bob swings through to 2 m g = 19.6 N.
    run(&mut app, 20);
    assert_eq!((seen(&app).len(), seen(&app)[0].entity, report(&app).broken), (1, spring, 1));
    assert!((12.0..12.6).contains(&seen(&app)[0].tension), "{:?}", seen(&app)[0]);
    assert_eq!(app.world().resource::<Read>().0, seen(&app), "messages say the same");
    assert!(app.world().get::<Broken>(spring).is_some());
    let (tick, fallen) = (seen(&app)[0].tick, bits(&app, bob));
    run(&mut app, 40);
    assert!(crate::common::position(&app, bob).y < -3.0);
    snapshot.restore(app.world_mut());
    assert!(app.world().get::<Broken>(spring).is_none());
    run(&mut app, 20);
    assert_eq!((seen(&app).len(), bits(&app, bob)), (2, fallen));
    RestoreInitialState.apply(app.world_mut());
    run(&mut app, 21);
    assert_eq!((seen(&app).len(), seen(&app)[2].tick, bits(&app, bob)), (3, tick, fallen));
    // Mended, it pulls again.
    app.world_mut().entity_mut(spring).remove::<Broken>();
    let speed = crate::common::velocity(&app, bob).y;
    run(&mut app, 1);
    assert!(crate::common::velocity(&app, bob).y > speed);
}

#[test]
fn a_plastic_spring_shows_its_strain() {
    let mut app = watching();
    let anchor = spawn_pinned(&mut app, Vec3::ZERO);
    let bob = spawn(&mut app, 1.0, 0.0, Vec3::NEG_Y);
    let wire = Spring::new(anchor, bob, 1.0).with_stiffness(400.0).with_plasticity(0.02, 0.1);
    let spring = join(&mut app, wire);
    run(&mut app, 30);
    // Its yield force, 8 N, does not bear the bob: it flows to its limit.
    let found = app.world().get::<Spring>(spring).unwrap().plasticity.unwrap();
    assert_eq!(found.strain, 0.1);
}

/// A rope that hangs from a pinned particle with a weight that it does not bear.
#[test]
fn a_rope_breaks_in_two() {
    let mut app = watching();
    let mut topology = (*rope(10)).clone();
    topology.masses[10] = 2.0;
    let net_of = ParticleNet::new(Arc::new(topology), &Transform::IDENTITY).with_pinned([0]);
    let rope = app.world_mut().spawn((net_of, Breaking { force: Some(15.0), ..default() })).id();
    run(&mut app, 60);
    assert_eq!(seen(&app).len(), 1, "{:?}", seen(&app));
    let Broke { entity, pieces: count, spring, tension, .. } = seen(&app)[0];
    assert_eq!((entity, count, report(&app).broken), (rope, Some(2), 1));
    assert_eq!(app.world().resource::<Read>().0, seen(&app), "messages say the same");
    assert!(tension > 15.0);
    let broken = spring.unwrap();
    assert_eq!(net(&app, rope).broken(), [broken]);
    assert!(net(&app, rope).positions()[10].y < -3.0, "it falls");
    assert!(net(&app, rope).positions()[broken as usize].y > -1.2, "the rest hangs");
}

/// A sheet of 6 × 6 cells that hangs by its upper row, torn by its lower one: the mesh opens.
#[test]
fn a_cloth_tears() {
    let mut app = watching();
    let of = |i: u32, j: u32| j * 7 + i;
    let mut sheet = Topology { layout: Layout::Grid { cells: [6, 6] }, ..Topology::default() };
    for (j, i) in (0..7).flat_map(|j| (0..7).map(move |i| (j, i))) {
        sheet.positions.push(Vec3::new(i as f32 * 0.1, j as f32 * 0.1, 0.0));
        sheet.masses.push(0.01);
        let mut add = |ends: [u32; 2], length: f32| {
            sheet.springs.push((ends, solver::Spring::elastic(length, 200.0, 0.2)))
        };
        if i < 6 {
            add([of(i, j), of(i + 1, j)], 0.1);
        }
        if j < 6 {
            add([of(i, j), of(i, j + 1)], 0.1);
        }
        if i < 6 && j < 6 {
            add([of(i, j), of(i + 1, j + 1)], 0.02_f32.sqrt());
            add([of(i + 1, j), of(i, j + 1)], 0.02_f32.sqrt());
            sheet.triangles.extend([
                [of(i, j), of(i + 1, j), of(i + 1, j + 1)],
                [of(i, j), of(i + 1, j + 1), of(i, j + 1)],
            ]);
        }
    }
    let count = sheet.positions.len();
    let mass: f32 = sheet.masses.iter().sum();
    let upper = (0..7).map(|i| of(i, 6));
    let net_of = ParticleNet::new(Arc::new(sheet), &Transform::IDENTITY).with_pinned(upper);
    let cloth = app.world_mut().spawn((net_of, Breaking { strain: Some(0.3), ..default() })).id();
    run(&mut app, 10);
    assert!(seen(&app).is_empty());
    for i in 0..7 {
        app.world_mut().get_mut::<ParticleNet>(cloth).unwrap().applied_forces_mut()[i] = Vec3::NEG_Y * 40.0;
    }
    run(&mut app, 10);
    assert!(!seen(&app).is_empty());
    app.world_mut().get_mut::<ParticleNet>(cloth).unwrap().clear_applied_forces();
    run(&mut app, 60);
    let net = net(&app, cloth);
    assert!(net.len() > count && net.len() == net.topology().positions.len());
    assert_eq!(net.topology().triangles.len(), 72);
    let parts = pieces(net.topology());
    assert_ne!(parts[of(3, 0) as usize], parts[of(3, 6) as usize], "it is torn off");
    assert!((net.topology().masses.iter().sum::<f32>() / mass - 1.0).abs() < 1e-5);
    assert!(net.positions().iter().all(|position| position.is_finite()));
    assert!(net.positions()[of(3, 0) as usize].y < -3.0, "it falls");
    // No triangle is drawn out between the parts.
    let longest = net.topology().triangles.iter().flat_map(|corners| {
        let places = corners.map(|corner| net.positions()[corner as usize]);
        [places[0].distance(places[1]), places[1].distance(places[2]), places[2].distance(places[0])]
    });
    let longest = longest.fold(0.0, f32::max);
    assert!(longest < 0.3, "{longest} m");
}

/// A winch lifts a load by v t, ends at its shortest length, pays out beyond what was laid out, and stalls at its greatest force.
#[test]
fn a_winch_lifts_lowers_and_stalls() {
    let mut app = watching();
    let mut topology = (*rope(10)).clone();
    topology.masses[0] = 0.005;
    topology.masses[10] = 1.005;
    let rope = app.world_mut().spawn(ParticleNet::new(Arc::new(topology), &Transform::IDENTITY)).id();
    let winch = Winch { speed: 0.0, min_length: 0.3, max_length: Some(1.5), ..default() };
    let jib = app.world_mut().spawn((PartOf(rope), Part::Start, Pinned, winch)).id();
    let length = |app: &App| net(app, rope).wound_out().unwrap();
    let load = |app: &App| -net(app, rope).positions()[10].y;
    let turn = |app: &mut App, speed: f32| app.world_mut().get_mut::<Winch>(jib).unwrap().speed = speed;
    run(&mut app, 1);
    turn(&mut app, -0.2);
    run(&mut app, 128);
    assert!((length(&app) - 0.6).abs() < 1e-3, "{}", length(&app));
    assert!((load(&app) - 0.6).abs() < 0.02, "{}", load(&app));
    run(&mut app, 128);
    assert!((length(&app) - 0.3).abs() < 1e-6, "{}", length(&app));
    turn(&mut app, 0.25);
    run(&mut app, 640);
    assert!((length(&app) - 1.5).abs() < 1e-6, "{}", length(&app));
    assert!((load(&app) - 1.5).abs() < 0.03, "{}", load(&app));
    assert_eq!(net(&app, rope).len(), 11 + 16);
    // 1.15 kg hang on it: it stalls at 11.3 N, where it is as fast as 10 % of its greatest force allow.
    turn(&mut app, -0.25);
    app.world_mut().get_mut::<Winch>(jib).unwrap().max_force = Some(9.0);
    run(&mut app, 128);
    assert!((length(&app) - 1.5).abs() < 0.01, "{}", length(&app));
}

/// A crane in an app, its rope with bending stiffness: within 1 mm of L₀ + v t, the tension in steps below 5 % as links come
/// and go.
#[test]
fn a_winch_with_a_stiff_rope_turns_without_a_jerk() {
    let mut app = watching();
    app.init_resource::<SpringForces>();
    let mut topology = (*rope(20)).clone();
    let straight = solver::Bend { stiffness: 0.01, weights: [1.0, -2.0, 1.0], ..default() };
    topology.rods = (0..19).map(|number| ([number, number + 1, number + 2], straight)).collect();
    topology.masses[20] += 1.0;
    let rope = app.world_mut().spawn(ParticleNet::new(Arc::new(topology), &Transform::IDENTITY)).id();
    let jib = app.world_mut().spawn((PartOf(rope), Part::Start, Pinned, Winch::default())).id();
    app.world_mut().resource_mut::<Environment>().viscosity = 0.05;
    run(&mut app, 600);
    // The top link bears most.
    let tension = |app: &App| {
        let net = net(app, rope);
        (0..net.topology().springs.len()).map(|spring| net.tension(spring)).fold(0.0, f32::max)
    };
    for direction in [-1.0, 1.0_f32] {
        let start = net(&app, rope).wound_out().unwrap();
        let (mut turned, mut last, mut largest) = (0.0_f64, tension(&app), 0.0_f32);
        for tick in 0..300 {
            let speed = direction * 0.3 * (tick.min(299 - tick) as f32 / 64.0).min(1.0);
            app.world_mut().get_mut::<Winch>(jib).unwrap().speed = speed;
            run(&mut app, 1);
            turned += f64::from(speed) / 64.0;
            let length = net(&app, rope).wound_out().unwrap();
            assert!((length - start - turned).abs() < 1e-3, "{length} m, {start} + {turned} m");
            let now = tension(&app);
            largest = largest.max((now / last - 1.0).abs());
            last = now;
        }
        assert!(turned.abs() > 1.0, "a dozen links");
        assert!(largest < 0.05, "{largest} of the tension, turning by {direction}");
    }
}
