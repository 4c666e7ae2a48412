//! Switches, pause, single steps, restart, and what a tick publishes.

use bevy::diagnostic::{DiagnosticPath, DiagnosticsStore};
use bevy::prelude::*;
use bevy_mass_spring::prelude::*;

use crate::common::*;

/// Changes a resource.
fn change<R: Resource<Mutability = bevy::ecs::component::Mutable>>(app: &mut App, edit: impl FnOnce(&mut R)) {
    edit(&mut app.world_mut().resource_mut::<R>());
}

fn apply(app: &mut App, command: impl Command<Out = ()>) {
    command.apply(app.world_mut());
}

#[test]
fn gravity_is_switched_off_and_on_without_losing_its_value() {
    let mut app = app();
    let ball = spawn(&mut app, 1.0, 0.1, Vec3::ZERO);
    change::<Environment>(&mut app, |environment| {
        environment.gravity = Vec3::X * 2.0;
        environment.gravity_enabled = false;
    });
    run(&mut app, 5);
    assert_eq!([position(&app, ball), velocity(&app, ball)], [Vec3::ZERO; 2]);
    change::<Environment>(&mut app, |environment| environment.gravity_enabled = true);
    run(&mut app, 32);
    // 128 substeps or so of h g = 2⁻⁷: dyadic numbers, no rounding.
    assert_eq!(velocity(&app, ball), Vec3::X);
}

#[test]
fn viscosity_is_switched_off_and_on_without_losing_its_value() {
    let mut app = app();
    plain(&mut app);
    let ball = spawn(&mut app, 2.0, 0.1, Vec3::ZERO);
    app.world_mut().entity_mut(ball).insert(ParticleVelocity(Vec3::X));
    change::<Environment>(&mut app, |environment| {
        environment.viscosity = 16.0;
        environment.viscosity_enabled = false;
    });
    run(&mut app, 5);
    assert_eq!(velocity(&app, ball), Vec3::X);
    change::<Environment>(&mut app, |environment| environment.viscosity_enabled = true);
    run(&mut app, 1);
    // v −= h ν v / m = v / 8.
    assert_eq!(velocity(&app, ball), Vec3::X * 0.875);
}

#[test]
fn collisions_are_switched_off_and_on_without_losing_their_values() {
    let mut app = app();
    change::<Environment>(&mut app, |environment| environment.gravity_enabled = false);
    app.insert_resource(CollisionSettings {
        ground: false,
        particles: false,
        springs: false,
        restitution: 1.0,
        friction: 0.0,
    });
    app.world_mut().spawn(ParticleCollider { restitution: 1.0, friction: 0.0, ..default() });
    let sinking = spawn(&mut app, 1.0, 0.25, Vec3::Y);
    app.world_mut().entity_mut(sinking).insert(ParticleVelocity(Vec3::NEG_Y));
    let (left, right) = (
        spawn(&mut app, 1.0, 0.25, Vec3::new(4.0, 5.0, 0.0)),
        spawn(&mut app, 1.0, 0.25, Vec3::new(5.0, 5.0, 0.0)),
    );
    app.world_mut().entity_mut(left).insert(ParticleVelocity(Vec3::X));
    run(&mut app, 60);
    assert_eq!(velocity(&app, sinking), Vec3::NEG_Y, "it sinks through the ground");
    assert_eq!(
        [velocity(&app, left), velocity(&app, right)],
        [Vec3::X, Vec3::ZERO],
        "they pass through each other"
    );
    assert_eq!(report(&app).contacts, 0);

    change::<CollisionSettings>(&mut app, |collisions| {
        (collisions.ground, collisions.particles) = (true, true);
    });
    for (particle, place_at) in
        [(sinking, Vec3::Y), (left, Vec3::new(4.0, 5.0, 0.0)), (right, Vec3::new(5.0, 5.0, 0.0))]
    {
        place(&mut app, particle, place_at);
    }
    run(&mut app, 60);
    assert_eq!(velocity(&app, sinking), Vec3::Y, "elastic, as it was set");
    assert_eq!([velocity(&app, left), velocity(&app, right)], [Vec3::ZERO, Vec3::X]);
}

/// The ground carries a resting ball with the impulse m g dt in each tick, whatever the substeps. A sum of
/// a few roundings of it.
#[test]
fn contacts_are_reported_with_the_impulse_of_the_tick() {
    for settings in [scheme(Integrator::VelocityVerlet, 1), scheme(Integrator::SemiImplicitEuler, 8)] {
        let mut app = app();
        app.insert_resource(settings).add_message::<Contact>();
        let ground =
            app.world_mut().spawn(ParticleCollider { restitution: 0.5, friction: 0.2, ..default() }).id();
        let ball = spawn(&mut app, 3.0, 0.1, Vec3::new(0.5, 0.1, -2.0));
        spawn(&mut app, 1.0, 0.1, Vec3::Y * 50.0);
        run(&mut app, 3);
        messages::<Contact>(&mut app);
        run(&mut app, 1);
        let contacts = messages::<Contact>(&mut app);
        assert_eq!(contacts.len(), 1, "one for each touching pair and tick: {contacts:?}");
        let contact = contacts[0];
        assert_eq!((contact.particle, contact.other, contact.normal), (ball, ground, Vec3::Y));
        assert!((contact.point - Vec3::new(0.5, 0.0, -2.0)).length() < 1e-7);
        let weight = 3.0 * 9.81 * TICK;
        assert!((contact.impulse / weight - 1.0).abs() < 1e-5, "{} N·s instead of {weight}", contact.impulse);
        assert_eq!(report(&app).contacts, 1);
    }
}

#[test]
fn particles_report_what_they_hit() {
    let mut app = app();
    plain(&mut app);
    app.insert_resource(CollisionSettings { restitution: 1.0, ..CollisionSettings::default() });
    app.add_message::<Contact>();
    let (left, right) = (spawn(&mut app, 1.0, 0.25, Vec3::ZERO), spawn(&mut app, 1.0, 0.25, Vec3::X));
    app.world_mut().entity_mut(left).insert(ParticleVelocity(Vec3::X * 2.0));
    let mut contacts = Vec::new();
    for _ in 0..32 {
        run(&mut app, 1);
        contacts.extend(messages::<Contact>(&mut app).into_iter().filter(|contact| contact.impulse > 0.0));
    }
    assert_eq!(contacts.len(), 1, "{contacts:?}");
    let Contact { particle, other, point, normal, impulse, .. } = contacts[0];
    assert!([(left, right), (right, left)].contains(&(particle, other)));
    assert_eq!(normal, if particle == left { Vec3::NEG_X } else { Vec3::X });
    // Equal masses exchange velocities: 1 kg · 2 m/s.
    assert!((impulse - 2.0).abs() < 1e-5);
    assert!((point.x - 0.75).abs() < 2.0 * TICK && point.y == 0.0, "{point}");
}

#[test]
fn contacts_are_not_collected_unless_requested() {
    let mut app = app();
    app.world_mut().spawn(ParticleCollider::default());
    spawn(&mut app, 1.0, 0.1, Vec3::Y * 0.1);
    run(&mut app, 3);
    assert!(!app.world().contains_resource::<Messages<Contact>>());
    assert_eq!(report(&app).contacts, 1);
}

#[test]
fn pausing_stops_and_unpausing_continues_unchanged() {
    let (mut paused, mut straight) = (app(), app());
    let rope = spawn_rope(&mut paused, Vec3::Y, 6, 0.1, |spring| spring);
    let twin = spawn_rope(&mut straight, Vec3::Y, 6, 0.1, |spring| spring);
    run(&mut paused, 10);
    change::<Time<Virtual>>(&mut paused, |time| time.pause());
    let (before, tick) = (hash(&paused, &rope), report(&paused).tick);
    run(&mut paused, 25);
    assert_eq!((hash(&paused, &rope), report(&paused).tick), (before, tick));
    change::<Time<Virtual>>(&mut paused, |time| time.unpause());
    run(&mut paused, 10);
    run(&mut straight, 20);
    assert_eq!(hash(&paused, &rope), hash(&straight, &twin));
}

#[test]
fn single_steps_run_one_tick_each_while_paused() {
    let (mut stepped, mut straight) = (app(), app());
    let rope = spawn_rope(&mut stepped, Vec3::Y, 6, 0.1, |spring| spring);
    let twin = spawn_rope(&mut straight, Vec3::Y, 6, 0.1, |spring| spring);
    change::<Time<Virtual>>(&mut stepped, |time| time.pause());
    for tick in 1..=5 {
        change(&mut stepped, SingleStep::request);
        run(&mut stepped, 3);
        assert_eq!(report(&stepped).tick, tick);
    }
    change(&mut stepped, |single_step: &mut SingleStep| {
        single_step.request();
        single_step.request();
    });
    run(&mut stepped, 2);
    run(&mut straight, 7);
    assert_eq!(report(&stepped).tick, 7);
    assert_eq!(hash(&stepped, &rope), hash(&straight, &twin), "the same steps as of a run");

    change::<Time<Virtual>>(&mut stepped, |time| time.unpause());
    change(&mut stepped, SingleStep::request);
    run(&mut stepped, 4);
    assert_eq!(report(&stepped).tick, 11, "requests while time runs are dropped");
}

/// A scene with everything that a restart must restore.
fn restart_scene() -> (App, Vec<Entity>) {
    let mut app = app();
    app.insert_resource(scheme(Integrator::SemiImplicitEuler, 4));
    app.world_mut().spawn(ParticleCollider { restitution: 0.4, friction: 0.3, ..default() });
    let mut all = spawn_rope(&mut app, Vec3::Y * 0.7, 9, 0.1, |spring| spring.with_stiffness(300.0));
    for number in 0..6_u8 {
        let ball = spawn(&mut app, 1.0, 0.1, Vec3::new(0.02, 0.5 + 0.3 * f32::from(number), 0.01));
        app.world_mut().entity_mut(ball).insert(ParticleVelocity(Vec3::X * 0.1));
        all.push(ball);
    }
    app.world_mut().entity_mut(all[3]).insert(AppliedForce(Vec3::Z * 0.2));
    (app, all)
}

fn history(app: &mut App, particles: &[Entity], ticks: u32) -> Vec<u64> {
    let step = |_| {
        run(app, 1);
        hash(app, particles)
    };
    (0..ticks).map(step).collect()
}

#[test]
fn a_restart_restores_and_repeats_everything_bit_for_bit() {
    let (mut app, all) = restart_scene();
    let start = hash(&app, &all);
    let first = history(&mut app, &all, 90);
    // Edits of all kinds, which the restart undoes.
    let world = app.world_mut();
    world.entity_mut(all[0]).remove::<Pinned>();
    world.entity_mut(all[5]).insert(Pinned);
    world.entity_mut(all[3]).remove::<AppliedForce>();
    world.entity_mut(all[4]).insert(AppliedForce(Vec3::ONE));
    world.get_mut::<Particle>(all[10]).unwrap().mass = 9.0;
    world.get_mut::<Particle>(all[11]).unwrap().radius = 0.3;
    world.get_mut::<Transform>(all[12]).unwrap().translation.x = f32::NAN;
    let mut springs = world.query::<&mut Spring>();
    springs.iter_mut(world).for_each(|mut spring| spring.stiffness = 7.0);
    run(&mut app, 20);
    assert_eq!(report(&app).faults, 1);

    apply(&mut app, RestoreInitialState);
    assert_eq!(hash(&app, &all), start);
    assert_eq!((report(&app).tick, report(&app).faults), (0, 0));
    let second = history(&mut app, &all, 90);
    let differs = first.iter().zip(&second).position(|(one, other)| one != other);
    assert_eq!(differs, None, "the second run differs from the first after this many ticks");
}

#[test]
fn a_state_taken_on_request_is_the_one_that_is_restored() {
    let (mut app, all) = restart_scene();
    run(&mut app, 30);
    apply(&mut app, TakeInitialState);
    let taken = hash(&app, &all);
    run(&mut app, 30);
    assert_ne!(hash(&app, &all), taken);
    apply(&mut app, RestoreInitialState);
    assert_eq!(hash(&app, &all), taken);
    let first = history(&mut app, &all, 30);
    apply(&mut app, RestoreInitialState);
    assert_eq!(history(&mut app, &all, 30), first);
}

#[test]
fn despawned_particles_stay_despawned_and_later_ones_restart() {
    let (mut app, all) = restart_scene();
    run(&mut app, 10);
    app.world_mut().despawn(all[12]);
    let late = spawn(&mut app, 1.0, 0.1, Vec3::X * 7.0);
    run(&mut app, 10);
    apply(&mut app, RestoreInitialState);
    assert_eq!(position(&app, late), Vec3::X * 7.0);
    run(&mut app, 1);
    assert_eq!(report(&app).particles, all.len());
}

/// Two particles on a spring, 1 m apart and 3 m up: all energies computed by hand.
#[test]
fn measurements_are_those_of_the_last_tick() {
    let mut app = app_with((MassSpringPlugin::default(), MassSpringDiagnosticsPlugin));
    let (left, right) =
        (spawn(&mut app, 2.0, 0.0, Vec3::Y * 3.0), spawn(&mut app, 1.0, 0.0, Vec3::new(1.0, 3.0, 0.0)));
    join(&mut app, Spring::new(left, right, 0.5).with_stiffness(8.0).with_damping(0.0));
    run(&mut app, 7);
    let found = *app.world().resource::<Measurements>();
    let velocities = [left, right].map(|particle| velocity(&app, particle).as_dvec3());
    let positions = [left, right].map(|particle| position(&app, particle).as_dvec3());
    let length = positions[0].distance(positions[1]);
    let close = |found: f64, expected: f64| (found - expected).abs() <= 1e-9 * expected.abs();
    assert!(close(
        found.kinetic_energy,
        velocities[0].length_squared() + 0.5 * velocities[1].length_squared()
    ));
    assert!(close(found.elastic_energy, 4.0 * (length - 0.5).powi(2)));
    let gravity = f64::from(9.81_f32);
    assert!(close(found.gravitational_energy, gravity * (2.0 * positions[0].y + positions[1].y)));
    assert!((found.momentum - (2.0 * velocities[0] + velocities[1])).length() < 1e-9);
    assert!(close(found.max_speed, velocities[0].length().max(velocities[1].length())));
    assert!(close(found.max_stretch, (length - 0.5) / 0.5) && found.max_stretch == found.mean_stretch);
    assert!(found.kinetic_energy > 0.0 && found.elastic_energy > 0.0);

    type Paths = MassSpringDiagnosticsPlugin;
    run(&mut app, 1);
    let now = *app.world().resource::<Measurements>();
    let store = app.world().resource::<DiagnosticsStore>();
    let value = |path: &DiagnosticPath| store.get_measurement(path).expect("it is measured").value;
    assert_eq!(value(&Paths::KINETIC_ENERGY), now.kinetic_energy);
    assert_eq!(value(&Paths::TOTAL_ENERGY), now.total_energy());
    assert_eq!(value(&Paths::SUBSTEPS), f64::from(report(&app).substeps));
    for path in [&Paths::GATHER_TIME, &Paths::STEP_TIME, &Paths::SCATTER_TIME] {
        assert!(value(path) > 0.0 && value(path) < 1000.0, "{path}");
    }
    apply(&mut app, RestoreInitialState);
    assert_eq!(*app.world().resource::<Measurements>(), Measurements::default(), "there was no tick yet");
}

#[cfg(feature = "interpolation")]
#[test]
fn headless_apps_do_not_interpolate_unless_asked() {
    use bevy_transform_interpolation::prelude::{TransformInterpolationPlugin, TranslationInterpolation};

    for (plugin, expected) in
        [(MassSpringPlugin::default(), false), (MassSpringPlugin::default().with_interpolation(true), true)]
    {
        let mut app = app_with(plugin);
        let particle = spawn(&mut app, 1.0, 0.1, Vec3::ZERO);
        assert_eq!(app.is_plugin_added::<TransformInterpolationPlugin>(), expected);
        assert_eq!(app.world().entity(particle).contains::<TranslationInterpolation>(), expected);
    }
}

/// A frame in the middle of a tick shows an eased position. The state is still that of the last tick, or
/// the place to which a particle has been moved since then.
#[cfg(feature = "interpolation")]
#[test]
fn a_state_taken_between_ticks_is_exact() {
    use bevy::time::TimeUpdateStrategy;

    let rope_in = |interpolation: bool| {
        let mut app = app_with(MassSpringPlugin::default().with_interpolation(interpolation));
        let rope = spawn_rope(&mut app, Vec3::Y, 6, 0.1, |spring| spring.with_stiffness(300.0));
        run(&mut app, 30);
        (app, rope)
    };
    let ((mut eased, rope), (mut straight, twin)) = (rope_in(true), rope_in(false));
    let quarter = TimeUpdateStrategy::ManualDuration(std::time::Duration::from_secs_f32(TICK / 4.0));
    eased.insert_resource(quarter);
    run(&mut eased, 2);
    assert_eq!(report(&eased).tick, 30);
    let (shown, last) = (hash(&eased, &rope), hash(&straight, &twin));
    assert_ne!(shown, last, "the frame shows the middle of a tick");
    apply(&mut eased, TakeInitialState);
    assert_eq!(hash(&eased, &rope), shown, "the frame is not disturbed");
    apply(&mut eased, RestoreInitialState);
    assert_eq!(hash(&eased, &rope), last);

    // The following ticks are the same, also after a restart between ticks.
    eased.insert_resource(TimeUpdateStrategy::FixedTimesteps(1));
    run(&mut eased, 20);
    run(&mut straight, 20);
    place(&mut straight, twin[0], Vec3::Y * 1.5);
    place(&mut eased, rope[0], Vec3::Y * 1.5);
    apply(&mut eased, TakeInitialState);
    run(&mut eased, 3);
    apply(&mut eased, RestoreInitialState);
    assert_eq!(position(&eased, rope[0]), Vec3::Y * 1.5);
    assert_eq!(hash(&eased, &rope), hash(&straight, &twin));
}

/// In a schedule that runs each frame, its delta is the tick; without time nothing moves.
#[test]
fn the_plugin_takes_another_schedule() {
    let mut app = app_with(MassSpringPlugin::new(Update));
    let ball = spawn(&mut app, 1.0, 0.1, Vec3::ZERO);
    run(&mut app, 1);
    assert!((velocity(&app, ball).y + 9.81 * TICK).abs() < 1e-6);
    change::<Time<Virtual>>(&mut app, |time| time.pause());
    let before = bits(&app, ball);
    run(&mut app, 5);
    assert_eq!(bits(&app, ball), before);
}
