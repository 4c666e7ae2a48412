//! Attachments in an app: parts that are tied to other entities.

use std::sync::Arc;

use bevy::prelude::*;
use bevy_mass_spring::nets::{Attachment, Cloth, ClothMaterial, Part, PartOf, ParticleNet, Topology};
use bevy_mass_spring::prelude::*;

use super::net_breaking::{net, rope, seen, watching};
use crate::common::{position, run, spawn, spawn_pinned};

/// A lamp of 2 kg on a rope that is tied to a hook, which is no particle: both ties bear it; then the hook turns, and the
/// lamp is too heavy.
#[test]
fn attachments_pull_and_break() {
    let mut app = watching();
    app.init_resource::<SpringForces>();
    let hook = app.world_mut().spawn(Transform::from_xyz(0.5, 0.0, 0.0)).id();
    let lamp = spawn(&mut app, 2.0, 0.0, Vec3::NEG_Y * 1.05);
    let rope = app.world_mut().spawn(ParticleNet::new(rope(10), &Transform::IDENTITY)).id();
    let start = app.world_mut().spawn((PartOf(rope), Part::Start, Attachment::to(hook))).id();
    let end = app.world_mut().spawn((PartOf(rope), Part::End, Attachment::to(lamp).breaking_at(40.0))).id();
    app.world_mut().resource_mut::<Environment>().viscosity = 2.0;
    run(&mut app, 600);
    let tension = |app: &App, part: Entity| {
        let forces = &app.world().resource::<SpringForces>().tensions;
        forces.iter().find(|(spring, _)| *spring == part).unwrap().1
    };
    assert!((tension(&app, end) - 2.0 * 9.81).abs() < 0.05, "{}", tension(&app, end));
    assert!((tension(&app, start) - 2.11 * 9.81).abs() < 0.05, "{}", tension(&app, start));
    app.world_mut().get_mut::<Transform>(hook).unwrap().translation.y = 0.5;
    run(&mut app, 60);
    let top = net(&app, rope).positions()[0];
    assert!((top.y - 0.5).abs() < 0.02, "{top}");
    app.world_mut().get_mut::<Particle>(lamp).unwrap().mass = 5.0;
    run(&mut app, 120);
    assert_eq!(seen(&app).iter().map(|broke| broke.entity).collect::<Vec<_>>(), [end]);
    assert!(app.world().get::<Broken>(end).is_some());
    // Without its attachment the rope falls.
    app.world_mut().resource_mut::<Environment>().viscosity = 0.0;
    app.world_mut().entity_mut(start).remove::<Attachment>();
    run(&mut app, 60);
    assert!(net(&app, rope).positions()[0].y < -1.0);
}

/// A body of the game's own, which moves by its own physics.
#[derive(Component)]
struct Body {
    mass: f32,
    velocity: Vec3,
}

/// The reactions on an entity, N.
fn reactions(app: &App, entity: Entity) -> Vec<Reaction> {
    let all = &app.world().resource::<SpringForces>().reactions;
    all.iter().filter(|reaction| reaction.entity == entity).copied().collect()
}

/// A rope between a hook and a lamp, which are no particles. The hook is pulled down by the lamp and by the rope, the lamp up by its
/// weight, as it hangs on nothing else: the game moves it by the reaction. Both are named themselves.
#[test]
fn a_rope_pulls_at_bodies_of_the_game() {
    let mut app = watching();
    app.init_resource::<SpringForces>();
    let hook = app.world_mut().spawn(Transform::from_xyz(0.5, 3.0, 0.0)).id();
    let lamp_place = Transform::from_xyz(0.5, 2.0, 0.0);
    let lamp = app.world_mut().spawn((Body { mass: 2.0, velocity: Vec3::ZERO }, lamp_place)).id();
    let net = ParticleNet::new(rope(10), &Transform::from_xyz(0.5, 3.0, 0.0));
    let rope = app.world_mut().spawn(net).id();
    app.world_mut().spawn((PartOf(rope), Part::Start, Attachment::to(hook)));
    app.world_mut().spawn((PartOf(rope), Part::End, Attachment::to(lamp)));
    app.world_mut().resource_mut::<Environment>().viscosity = 0.5;
    // It is tied where the lamp is at first; the lamp is let go then.
    run(&mut app, 1);
    app.add_systems(
        FixedUpdate,
        |forces: Res<SpringForces>, time: Res<Time>, mut bodies: Query<(&mut Body, &mut Transform)>| {
            let step = time.delta_secs();
            for reaction in &forces.reactions {
                if let Ok((mut body, _)) = bodies.get_mut(reaction.entity) {
                    let change = reaction.force * (step / body.mass);
                    body.velocity += change;
                }
            }
            for (mut body, mut place) in &mut bodies {
                // The reaction is a tick old, which feeds it with k h = 78 N·s/m of the tie: of its own it is braked with 100 N·s/m,
                // evaluated at the end of the tick.
                let braked = (body.velocity + Vec3::NEG_Y * (9.81 * step)) / (1.0 + 100.0 * step / body.mass);
                body.velocity = braked;
                place.translation += body.velocity * step;
            }
        },
    );
    run(&mut app, 1200);
    let [on_lamp] = reactions(&app, lamp)[..] else { panic!("{:?}", reactions(&app, lamp)) };
    let [on_hook] = reactions(&app, hook)[..] else { panic!("{:?}", reactions(&app, hook)) };
    assert!(on_lamp.force.distance(Vec3::Y * 2.0 * 9.81) < 0.02, "{}", on_lamp.force);
    // Eleven particles of 10 g.
    assert!(on_hook.force.distance(Vec3::NEG_Y * 2.11 * 9.81) < 0.02, "{}", on_hook.force);
    assert_eq!((on_lamp.index, on_hook.index), (None, None));
    assert!(on_hook.point.distance(Vec3::new(0.5, 3.0, 0.0)) < 1e-6, "{}", on_hook.point);
    assert!(on_lamp.point.distance(app.world().get::<Transform>(lamp).unwrap().translation) < 0.01);
    // Each of the ten links and the two ties, 5e3 N/m, gives by 4 mm.
    let stretch = 2.0 - app.world().get::<Transform>(lamp).unwrap().translation.y;
    assert!((stretch - 12.0 * 2.055 * 9.81 / 5e3).abs() < 1e-3, "{stretch} m");
    assert_eq!(app.world().resource::<SpringForces>().reactions.len(), 2, "none comes under a helper");
}

/// Pinned particles of a net come under it, by their numbers; a loose one has none.
#[test]
fn reactions_name_the_particles_of_nets() {
    let mut app = watching();
    app.init_resource::<SpringForces>();
    app.world_mut().resource_mut::<Environment>().viscosity = 2.0;
    let anchor = spawn_pinned(&mut app, Vec3::X);
    let bob = spawn(&mut app, 1.0, 0.0, Vec3::X - Vec3::Y);
    crate::common::join(&mut app, Spring::new(anchor, bob, 1.0).with_stiffness(400.0));
    // Ten links between two ends that are held, one below the other.
    let rope = app.world_mut().spawn(ParticleNet::new(rope(10), &Transform::IDENTITY)).id();
    for part in [Part::Start, Part::End] {
        app.world_mut().spawn((PartOf(rope), part, Pinned));
    }
    run(&mut app, 1200);
    let [loose] = reactions(&app, anchor)[..] else { panic!("{:?}", reactions(&app, anchor)) };
    assert!(loose.index.is_none() && loose.force.distance(Vec3::NEG_Y * 9.81) < 0.01, "{loose:?}");
    let [start, end] = reactions(&app, rope)[..] else { panic!("{:?}", reactions(&app, rope)) };
    assert_eq!((start.index, end.index), (Some(0), Some(10)));
    // Together they bear the nine particles between them.
    let sum = start.force + end.force;
    assert!(sum.distance(Vec3::NEG_Y * 0.09 * 9.81) < 0.01, "{sum}");
    assert!(end.point.distance(Vec3::NEG_Y) < 1e-6, "{}", end.point);
}

/// Two ropes, spawned in the same tick as the parts that tie them: the tie is as long as they are apart.
#[test]
fn ropes_are_tied_to_each_other_where_they_are() {
    let mut app = watching();
    app.world_mut().resource_mut::<Environment>().viscosity = 1.0;
    let place = Transform::from_xyz(2.0, 3.0, 0.0);
    let upper = app.world_mut().spawn(ParticleNet::new(rope(5), &place)).id();
    app.world_mut().spawn((PartOf(upper), Part::Start, Pinned));
    let end = app.world_mut().spawn((PartOf(upper), Part::End)).id();
    let below = place.with_translation(place.translation - Vec3::Y * 0.6);
    let lower = app.world_mut().spawn(ParticleNet::new(rope(5), &below)).id();
    app.world_mut().spawn((PartOf(lower), Part::Start, Attachment::to(end)));
    run(&mut app, 300);
    let [bottom, top] = [net(&app, upper).positions()[5], net(&app, lower).positions()[0]];
    // It bears 55 g: 5e3 N/m give by 1e-4 m.
    assert!((bottom.distance(top) - 0.1).abs() < 3e-4, "{bottom} {top}");
}

/// A cape of 0.6 m × 1 m and 0.12 kg that hangs by the five particles of its upper edge, which are painted, on a neck; this is
/// on a moving figure.
struct Caped {
    app: App,
    figure: Entity,
    neck: Entity,
    cape: Entity,
    held: Entity,
}

const NECK: Vec3 = Vec3::new(0.0, 1.0, -0.2);

fn caped(attach: impl Fn(Entity) -> Attachment) -> Caped {
    let mut app = watching();
    app.init_resource::<SpringForces>();
    app.world_mut().resource_mut::<Environment>().viscosity = 0.02;
    let figure = app.world_mut().spawn(Transform::IDENTITY).id();
    let neck = app.world_mut().spawn((Transform::from_translation(NECK), ChildOf(figure))).id();
    let material = ClothMaterial { area_density: 0.2, stretch_stiffness: 500.0, ..default() };
    let sheet = Cloth::grid(Vec3::new(-0.3, 0.0, -0.3), Vec3::X * 0.6, Vec3::Y, UVec2::new(4, 6));
    let mut topology = sheet.with_material(material).topology().unwrap();
    topology.paint("PIN", |_, place| place.y > 0.99);
    let cape = app.world_mut().spawn(ParticleNet::new(Arc::new(topology), &Transform::IDENTITY)).id();
    let part = Part::Painted("PIN".into());
    let held = app.world_mut().spawn((PartOf(cape), part, attach(neck))).id();
    Caped { app, figure, neck, cape, held }
}

impl Caped {
    /// The painted particles, and where they were laid out.
    fn painted(&self) -> Vec<(Vec3, Vec3)> {
        let net = net(&self.app, self.cape);
        let topology = net.topology();
        let painted = topology.painted("PIN").unwrap().iter().map(|particle| *particle as usize);
        painted.map(|particle| (net.positions()[particle], topology.positions[particle])).collect()
    }

    /// The entities of the ties.
    fn ties(&self) -> Vec<Entity> {
        self.app.world().get::<Children>(self.held).map_or(Vec::new(), |children| children.to_vec())
    }

    fn net_bits(&self) -> Vec<[u32; 3]> {
        net(&self.app, self.cape).positions().iter().map(|at| at.to_array().map(f32::to_bits)).collect()
    }
}

/// Each painted particle is tied by itself, to its place in the frame of the neck: they follow it, turned as it is. Together
/// they bear the cape; a restart ties it in the same way; without the attachment it falls.
#[test]
fn a_cape_hangs_by_its_painted_part_on_a_moving_figure() {
    let mut caped = caped(|neck| Attachment::to(neck).with_stiffness(2e3));
    run(&mut caped.app, 60);
    let first = caped.net_bits();
    RestoreInitialState.apply(caped.app.world_mut());
    run(&mut caped.app, 60);
    assert!(caped.net_bits() == first, "a restart changes no bit");
    // Round a corner: 2 m along x within a second, while it turns by a quarter.
    for tick in 1..=60 {
        let share = tick as f32 / 60.0;
        let turn = Quat::from_rotation_y(share * std::f32::consts::FRAC_PI_2);
        let place = Transform::from_xyz(2.0 * share, 0.0, 0.0).with_rotation(turn);
        *caped.app.world_mut().get_mut::<Transform>(caped.figure).unwrap() = place;
        run(&mut caped.app, 1);
    }
    run(&mut caped.app, 600);
    let ties = caped.ties();
    assert_eq!(ties.len(), 5);
    let forces = &caped.app.world().resource::<SpringForces>().tensions;
    let tension: f32 =
        forces.iter().filter(|(spring, _)| ties.contains(spring)).map(|(_, force)| force).sum();
    // They pull sideways a little, too.
    assert!((tension / (0.12 * 9.81) - 1.0).abs() < 0.02, "{tension} N");
    let frame = *caped.app.world().get::<Transform>(caped.figure).unwrap();
    for (found, laid_out) in caped.painted() {
        // They give by the weight of a quarter of the cape at most.
        let place = frame.transform_point(laid_out);
        assert!(found.distance(place) < 0.25 * 0.12 * 9.81 / 2e3 * 1.2, "{found} {place}");
    }
    let parts = caped.app.world().get::<Parts>(caped.cape).unwrap().entities().len();
    assert_eq!((parts, caped.app.world().get::<Children>(caped.neck).unwrap().len()), (6, 5));
    caped.app.world_mut().entity_mut(caped.held).remove::<Attachment>();
    run(&mut caped.app, 30);
    assert!(caped.ties().is_empty() && caped.app.world().get::<Children>(caped.neck).is_none());
    // It would have fallen by 1.1 m in vacuum.
    assert!(caped.painted().iter().all(|(place, _)| place.y < 0.6), "{:?}", caped.painted());
    // Attached again it is tied where it is by then.
    let low = caped.painted()[0].0;
    caped.app.world_mut().entity_mut(caped.held).insert(Attachment::to(caped.neck));
    run(&mut caped.app, 300);
    assert!(caped.painted()[0].0.distance(low) < 0.2, "{low} {:?}", caped.painted());
    assert!(seen(&caped.app).is_empty());
}

/// Balls of 0.1 kg that nothing joins are painted by a closure of their places: each hangs by its weight times the stiffness.
#[test]
fn a_painted_weight_is_a_part_of_the_stiffness() {
    let mut app = watching();
    app.world_mut().resource_mut::<Environment>().viscosity = 0.5;
    let count = 5_u16;
    let mut balls = Topology {
        positions: (0..count).map(|number| Vec3::X * f32::from(number)).collect(),
        masses: vec![0.1; count.into()],
        ..Topology::default()
    };
    balls.paint_weights("SOFT", |_, place| 0.25 * place.x);
    let net_of = app.world_mut().spawn(ParticleNet::new(Arc::new(balls), &Transform::IDENTITY)).id();
    let frame = app.world_mut().spawn(Transform::IDENTITY).id();
    let tie = Attachment::to(frame).with_stiffness(100.0);
    let part = app.world_mut().spawn((PartOf(net_of), Part::Painted("SOFT".into()), tie)).id();
    run(&mut app, 1200);
    let net = net(&app, net_of);
    for number in 1..count {
        let sag = 0.1 * 9.81 / (100.0 * 0.25 * f32::from(number));
        let place = net.positions()[usize::from(number)];
        assert!((-place.y / sag - 1.0).abs() < 1e-3, "{place}, expected {sag} m");
    }
    assert!(net.positions()[0].y < -5.0, "what has no weight falls");
    assert_eq!(app.world().get::<Children>(part).map(|ties| ties.len()), Some(4));
}

/// Each particle has the whole breaking force: the seam rips tie by tie.
#[test]
fn a_seam_rips_tie_by_tie() {
    // The ties bear 0.12 kg · g / 5 = 0.24 N each, and 0.29 N at most.
    let mut caped = caped(|neck| Attachment::to(neck).breaking_at(0.6));
    run(&mut caped.app, 300);
    assert!(seen(&caped.app).is_empty(), "{:?}", seen(&caped.app));
    let ties = caped.ties();
    // A hand at one corner.
    let hand =
        caped.app.world_mut().spawn((PartOf(caped.cape), Part::Particle(0), AppliedForce(Vec3::NEG_Y * 2.0)));
    let hand = hand.id();
    run(&mut caped.app, 120);
    let mut broken: Vec<Entity> = seen(&caped.app).iter().map(|broke| broke.entity).collect();
    assert!(seen(&caped.app).iter().all(|broke| broke.tension > 0.6 && broke.spring.is_none()));
    let ticks: Vec<u64> = seen(&caped.app).iter().map(|broke| broke.tick).collect();
    assert!(ticks.first() < ticks.last(), "not all at once: {ticks:?}");
    assert!(broken.iter().all(|tie| caped.app.world().get::<Broken>(*tie).is_some()));
    broken.sort_unstable();
    let mut expected = ties.clone();
    expected.sort_unstable();
    assert_eq!(broken, expected);
    assert!(position(&caped.app, hand).y < -1.0);
    // With the part its ties go.
    caped.app.world_mut().despawn(caped.held);
    run(&mut caped.app, 1);
    assert!(ties.iter().all(|tie| caped.app.world().get_entity(*tie).is_err()));
    assert!(caped.app.world().get::<Children>(caped.neck).is_none());
}

/// An edge that is tied to a particle: each of its particles as far from it as it was, and it is pulled along.
#[test]
fn an_edge_is_tied_to_a_particle_as_it_is() {
    let mut app = watching();
    let sheet = Cloth::grid(Vec3::NEG_X * 0.3, Vec3::X * 0.6, Vec3::Y, UVec2::new(4, 6)).topology().unwrap();
    let ring = spawn_pinned(&mut app, Vec3::new(0.0, 1.5, 0.0));
    let cloth = app.world_mut().spawn(ParticleNet::new(Arc::new(sheet), &Transform::IDENTITY)).id();
    let edge = (PartOf(cloth), Part::Edge(bevy_mass_spring::nets::Side::Top), Attachment::to(ring));
    app.world_mut().spawn(edge);
    app.world_mut().resource_mut::<Environment>().viscosity = 0.02;
    run(&mut app, 300);
    let net = net(&app, cloth);
    for particle in net.topology().edge(bevy_mass_spring::nets::Side::Top).unwrap() {
        let laid_out = net.topology().positions[particle as usize].distance(Vec3::Y * 1.5);
        let found = net.positions()[particle as usize].distance(Vec3::Y * 1.5);
        assert!(found < 1.02 * laid_out, "{found} {laid_out}");
    }
    let before = net.centre();
    app.world_mut().get_mut::<Transform>(ring).unwrap().translation.x += 0.5;
    run(&mut app, 300);
    let moved = self::net(&app, cloth).centre() - before;
    assert!((moved.x - 0.5).abs() < 0.05, "{moved}");
}
