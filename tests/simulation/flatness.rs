//! Two dimensions: z of a `Transform` is a layer.

use bevy::prelude::*;
use bevy_mass_spring::nets::Cloth;
use bevy_mass_spring::prelude::*;

use crate::common::*;

fn flat_app(settings: SolverSettings) -> App {
    let mut app = app();
    app.insert_resource(settings);
    app.insert_resource(Dimensions::Two);
    *app.world_mut().resource_mut::<CollisionSettings>() =
        CollisionSettings { restitution: 0.3, friction: 0.4, ..default() };
    app
}

fn schemes() -> impl Iterator<Item = SolverSettings> {
    Integrator::ALL.into_iter().map(|integrator| match integrator {
        Integrator::Auto => SolverSettings::default(),
        named => scheme(named, 8),
    })
}

fn settle(app: &mut App, entity: Entity, bundle: impl Bundle) {
    app.world_mut().entity_mut(entity).insert(bundle);
}

/// A rope on alternating layers, balls, some in each other's way, a ground and a moving anchor; what is given a
/// velocity, a force or a gravity along z.
fn scene(app: &mut App) -> Vec<Entity> {
    app.world_mut().resource_mut::<Environment>().gravity = Vec3::new(0.0, -9.81, 3.0);
    let tilted = Transform::from_xyz(0.0, 0.0, -4.0).with_rotation(Quat::from_rotation_x(0.3));
    app.world_mut().spawn((ParticleCollider { restitution: 0.2, friction: 0.5, ..default() }, tilted));
    let rope = spawn_rope(app, Vec3::new(0.0, 1.0, 0.1), 10, 0.1, |spring| {
        spring.with_stiffness(300.0).with_damping(0.2)
    });
    let layer = |number: usize| [0.1, -7.3, 1e3, 1e-3][number % 4];
    for (number, knot) in rope.iter().enumerate() {
        app.world_mut().get_mut::<Transform>(*knot).unwrap().translation.z = layer(number);
    }
    settle(app, rope[4], ParticleVelocity(Vec3::new(0.0, 1.0, 9.0)));
    settle(app, rope[6], AppliedForce(Vec3::Z * 5.0));
    let root = Transform::from_xyz(0.3, 0.1, 2.2)
        .with_rotation(Quat::from_rotation_z(0.6))
        .with_scale(Vec3::splat(1.7));
    let root = app.world_mut().spawn(root).id();
    settle(app, rope[9], ChildOf(root));
    let mut all = rope;
    for ball in 0..8_u8 {
        let place =
            Vec3::new(0.3 + 0.05 * f32::from(ball % 3), 0.2 + 0.2 * f32::from(ball), layer(ball.into()));
        all.push(spawn(app, 0.3, 0.08, place));
    }
    all
}

/// The bar: after 10,000 ticks.
#[test]
fn layers_stay_to_the_bit() {
    for settings in schemes() {
        let mut app = flat_app(settings);
        let all = scene(&mut app);
        let layers = |app: &App| -> Vec<u32> {
            all.iter().map(|particle| position(app, *particle).z.to_bits()).collect()
        };
        let before = layers(&app);
        // Explicit schemes without damping explode, as they should; what is quarantined stays.
        let explodes =
            matches!(settings.integrator, Integrator::ExplicitEuler | Integrator::SecondOrderTaylor);
        for tick in 0..if explodes { 300_u16 } else { 10_000 } {
            let anchor = position(&app, all[0]) + Vec3::X * if tick % 100 < 50 { 0.01 } else { -0.01 };
            place(&mut app, all[0], anchor);
            if tick % 97 == 0 {
                Teleport::net(all[0], Vec3::new(0.1, 0.0, 5.0)).apply(app.world_mut());
                Teleport::net(all[0], Vec3::new(-0.1, 0.0, 5.0)).apply(app.world_mut());
            }
            run(&mut app, 1);
        }
        assert_eq!(layers(&app), before, "{}", settings.integrator);
        assert!(report(&app).contacts > 0 || explodes, "{}: nothing touches", settings.integrator);
        for particle in &all {
            assert_eq!(velocity(&app, *particle).z, 0.0, "{}", settings.integrator);
        }
    }
}

/// What happens in the plane is what happens in three dimensions with all layers 0, to the bit.
#[test]
fn layers_change_nothing_in_the_plane() {
    for settings in schemes() {
        let [mut layered, mut plain] = [true, false].map(|is_layered| {
            let mut app = flat_app(settings);
            if !is_layered {
                app.insert_resource(Dimensions::Three);
            }
            let all = scene(&mut app);
            for particle in &all {
                let mut entity = app.world_mut().entity_mut(*particle);
                entity.remove::<ChildOf>();
                if !is_layered {
                    entity.get_mut::<Transform>().unwrap().translation.z = 0.0;
                    entity.get_mut::<ParticleVelocity>().unwrap().0.z = 0.0;
                    entity.remove::<AppliedForce>();
                }
            }
            if !is_layered {
                app.world_mut().resource_mut::<Environment>().gravity.z = 0.0;
                let mut planes = app.world_mut().query_filtered::<&mut Transform, With<ParticleCollider>>();
                planes.iter_mut(app.world_mut()).for_each(|mut plane| *plane = Transform::default());
            }
            (app, all)
        });
        // A tilted plane is where it cuts z = 0: here y = −(−4) tan 0.3, hence it is moved to where it does so at 0.
        let mut planes = layered.0.world_mut().query_filtered::<&mut Transform, With<ParticleCollider>>();
        planes.iter_mut(layered.0.world_mut()).for_each(|mut plane| plane.translation.z = 0.0);
        for tick in 0..120 {
            run(&mut layered.0, 1);
            run(&mut plain.0, 1);
            for (one, other) in layered.1.iter().zip(&plain.1) {
                let [found, expected] = [position(&layered.0, *one), position(&plain.0, *other)];
                assert_eq!(found.truncate(), expected.truncate(), "{}, tick {tick}", settings.integrator);
            }
        }
    }
}

/// The field cases: a spring between layers, and two balls on different ones that meet.
#[test]
fn springs_and_contacts_between_layers_are_in_the_plane() {
    let mut app = flat_app(SolverSettings::default());
    app.world_mut().resource_mut::<Environment>().gravity_enabled = false;
    let anchor = spawn_pinned(&mut app, Vec3::ZERO);
    let ball = spawn(&mut app, 1.0, 0.0, Vec3::new(100.0, 0.0, 10.0));
    join(&mut app, Spring::new(anchor, ball, 100.0).with_stiffness(100.0));
    let [left, right] =
        [(-50.0, 0.0), (50.0, 6.0)].map(|(x, z)| spawn(&mut app, 1.0, 10.0, Vec3::new(x, 200.0, z)));
    settle(&mut app, left, ParticleVelocity(Vec3::X * 100.0));
    settle(&mut app, right, ParticleVelocity(Vec3::X * -100.0));
    app.world_mut().resource_mut::<CollisionSettings>().restitution = 1.0;
    run(&mut app, 320);
    assert_eq!(position(&app, ball), Vec3::new(100.0, 0.0, 10.0), "at its rest length nothing pulls");
    for (ball, z, sign) in [(left, 0.0, -1.0), (right, 6.0, 1.0)] {
        assert_eq!(position(&app, ball).z, z);
        assert!((velocity(&app, ball) - Vec3::X * 100.0 * sign).length() < 1e-2, "{}", velocity(&app, ball));
    }
}

/// Snapshots of a scene in two dimensions bring back all bits.
#[test]
fn snapshots_in_two_dimensions() {
    for settings in schemes() {
        let mut app = flat_app(settings);
        let all = scene(&mut app);
        run(&mut app, 30);
        let snapshot = Snapshot::take(app.world());
        let follow = |app: &mut App| -> Vec<u64> {
            (0..30)
                .map(|_| {
                    run(app, 1);
                    hash(app, &all)
                })
                .collect()
        };
        let expected = follow(&mut app);
        snapshot.restore(app.world_mut());
        assert_eq!(follow(&mut app), expected, "{}", settings.integrator);
    }
}

/// Far from the origin, in pixels, with a floating one.
#[test]
fn two_dimensions_far_away() {
    let mut app = flat_app(SolverSettings::default());
    let all = scene(&mut app);
    run(&mut app, 10);
    let layers: Vec<f32> = all.iter().map(|particle| position(&app, *particle).z).collect();
    for sign in [1.0, -1.0] {
        Teleport::everything(Vec3::new(1e5, 2e4, 9.0) * sign).apply(app.world_mut());
        run(&mut app, 100);
        for (particle, layer) in all.iter().zip(&layers) {
            assert_eq!(position(&app, *particle).z, *layer);
            assert_eq!(position(&app, *particle).x > 5e4, sign > 0.0);
        }
        assert!(app.world().resource::<TickReport>().faults == 0);
    }
}

/// Balls in one place, and a spring whose ends are in one place, part within the plane of motion.
#[test]
fn what_is_in_one_place_parts_in_the_plane() {
    let (radius, rest_length) = (0.1, 0.5);
    let mut app = flat_app(scheme(Integrator::SemiImplicitEuler, 8));
    app.world_mut().resource_mut::<Environment>().gravity = Vec3::ZERO;
    let mut pairs = Vec::new();
    for number in 0..20_u8 {
        let place = Vec3::X * f32::from(number);
        pairs.push([spawn(&mut app, 1.0, radius, place), spawn(&mut app, 1.0, radius, place)]);
    }
    let ends = [-1.0; 2].map(|x| spawn(&mut app, 1.0, 0.0, Vec3::X * x));
    // At critical damping for the reduced mass of 0.5 kg, in the medium only.
    let spring = Spring::new(ends[0], ends[1], rest_length).with_stiffness(50.0).with_damping(10.0);
    app.world_mut().spawn(spring);
    run(&mut app, 300);
    let apart = |[one, other]: [Entity; 2]| {
        let place = |of| app.world().get::<Transform>(of).unwrap().translation.truncate();
        place(one).distance(place(other))
    };
    for pair in pairs {
        assert!(apart(pair) >= 2.0 * radius - 1e-5, "{}", apart(pair));
    }
    // e^(-10 · 4.7) of the way is left.
    assert!((apart(ends) - rest_length).abs() < 1e-5, "{}", apart(ends));
}

/// A square of cloth in the plane of motion, on a layer, standing on a corner.
fn square(app: &mut App, layer: f32, place: Vec2) -> Entity {
    let cloth = Cloth::grid(Vec3::new(-0.3, -0.3, 0.0), Vec3::X * 0.6, Vec3::Y * 0.6, UVec2::splat(4));
    let topology = cloth.with_radius(0.03).topology().expect("it is sound");
    let frame = Transform::from_translation(place.extend(layer))
        .with_rotation(Quat::from_rotation_z(std::f32::consts::FRAC_PI_4));
    app.world_mut().spawn(ParticleNet::new(topology.into(), &frame)).id()
}

/// Σ m r × v about the centre of mass along z, and that centre.
fn turning(net: &ParticleNet) -> (f32, Vec3) {
    let mass: f32 = net.masses().iter().sum();
    let mean = |values: &[Vec3]| {
        net.masses().iter().zip(values).map(|(mass, value)| *mass * *value).sum::<Vec3>() / mass
    };
    let (middle, drift) = (mean(net.positions()), mean(net.velocities()));
    let moving = net.positions().iter().zip(net.velocities()).zip(net.masses());
    (moving.map(|((x, v), mass)| mass * (*x - middle).cross(*v - drift).z).sum(), middle)
}

/// A net that turns flies as its angular momentum says, lands on a slope of 51.6°, on which no square rests, rolls down it over its corners, and leaves its layer by
/// no bit.
#[test]
fn a_net_turns_on_a_plane_within_its_layer() {
    for settings in schemes() {
        if matches!(settings.integrator, Integrator::ExplicitEuler | Integrator::SecondOrderTaylor) {
            continue;
        }
        let is_explicit = matches!(
            settings.integrator,
            Integrator::SemiImplicitEuler | Integrator::VelocityVerlet | Integrator::RungeKutta4
        );
        // As many as the stiffness of cloth asks for.
        let substeps = if is_explicit { SubstepMode::Auto } else { settings.substeps };
        let settings = SolverSettings { substeps, ..settings };
        let mut app = flat_app(settings);
        let slope = Transform::from_rotation(Quat::from_rotation_z(-0.9));
        let plane = ParticleCollider { restitution: 0.0, friction: 1.5, ..default() };
        app.world_mut().spawn((plane, slope));
        let layer = -7.3;
        let net = square(&mut app, layer, Vec2::new(0.0, 1.0));
        let state = |app: &App| app.world().get::<ParticleNet>(net).expect("it exists").clone();
        run(&mut app, 1);
        // Clockwise, as it will roll.
        let spin = Vec3::NEG_Z * 3.0;
        let (_, middle) = turning(&state(&app));
        let mut edited = app.world_mut().get_mut::<ParticleNet>(net).expect("it exists");
        let places = edited.positions().to_vec();
        for (velocity, place) in edited.velocities_mut().iter_mut().zip(places) {
            *velocity = spin.cross(place - middle) + Vec3::Z * 2.0;
        }
        run(&mut app, 1);
        let (start, _) = turning(&state(&app));
        assert!(start < -1e-3, "{}: {start}", settings.integrator);
        let mut touched = 0;
        let mut turned = 0.0;
        let corner = |net: &ParticleNet, middle: Vec3| (net.positions()[0] - middle).truncate();
        let mut last = {
            let now = state(&app);
            corner(&now, turning(&now).1)
        };
        for tick in 0..150_u8 {
            run(&mut app, 1);
            let now = state(&app);
            let (angular, middle) = turning(&now);
            touched += report(&app).contacts;
            if touched == 0 {
                // Implicit steps, of a tick at most, turn about the middle by hω, and lose (hω)² of what turns.
                let share = if is_explicit { 0.0 } else { (3.0 * TICK).powi(2) * (f32::from(tick) + 1.0) };
                let lost = (angular - start).abs() / start.abs();
                assert!(lost < 1e-3 + share, "{}, tick {tick}: {angular}, {start}", settings.integrator);
            }
            let next = corner(&now, middle);
            turned += last.angle_to(next);
            last = next;
            for (place, velocity) in now.positions().iter().zip(now.velocities()) {
                assert_eq!(
                    (place.z.to_bits(), velocity.z),
                    (layer.to_bits(), 0.0),
                    "{}",
                    settings.integrator
                );
            }
        }
        let (_, middle) = turning(&state(&app));
        assert!(touched > 0 && middle.x > 0.5, "{}: it rolls down, to {middle}", settings.integrator);
        assert!(turned < -2.0, "{}: turned by {turned}", settings.integrator);
        assert_eq!(report(&app).faults, 0);
    }
}
