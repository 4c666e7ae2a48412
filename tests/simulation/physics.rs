//! The lab's physics end to end: components in, components out, under the default settings.

use bevy::math::DVec3;
use bevy::prelude::*;
use bevy_mass_spring::prelude::*;

use crate::common::*;

/// Fifteen particles of 1 kg hang below an anchor. At rest each spring carries what hangs below it,
/// whatever the scheme and its step: k Δl = n m g. Lengths of 16 m are rounded by 1e-6 m, 0.002 % of the
/// least stretch. The slowest motion dies out at the rate ν / 2m = 0.5 / s: e⁻²⁰ of the 6 m that the
/// chain sinks is negligible after 40 s.
#[test]
fn each_spring_of_a_hanging_chain_is_stretched_by_the_weight_below() {
    let mut app = app();
    app.world_mut().resource_mut::<Environment>().viscosity = 1.0;
    let mut chain = vec![spawn_pinned(&mut app, Vec3::Y * 20.0)];
    for number in 1..=15_u8 {
        let next = spawn(&mut app, 1.0, 0.1, Vec3::Y * (20.0 - f32::from(number)));
        let last = chain[chain.len() - 1];
        join(&mut app, Spring::new(last, next, 1.0).with_stiffness(200.0).with_damping(2.0));
        chain.push(next);
    }
    run(&mut app, 40 * 64);
    for upper in 0..15_usize {
        let length = position(&app, chain[upper]).distance(position(&app, chain[upper + 1]));
        let expected = (15 - upper) as f32 * 9.81 / 200.0;
        let stretch = length - 1.0;
        let case = format!("spring {upper}: stretched by {stretch} m instead of {expected} m");
        assert!((stretch / expected - 1.0).abs() < 0.002, "{case}");
    }
}

/// As the test of the same name in `energy.rs`, through the components: each tick writes and reads back
/// every bit, so the components add no error. 1e-5 of Σ m |v| is five times the random walk
/// of the roundings of 2,000 ticks of 4 substeps, √(8000 / 16) u = 1.3e-6.
#[test]
fn a_free_net_keeps_its_momentum() {
    let mut app = app_with((MassSpringPlugin::default(), MassSpringDiagnosticsPlugin));
    app.world_mut().resource_mut::<Environment>().gravity_enabled = false;
    let mut net: Vec<Entity> = Vec::new();
    for row in 0..4_u8 {
        for column in 0..4_u8 {
            let (row, column) = (f32::from(row), f32::from(column));
            let corner = Vec3::new(column, row, 0.3 * (row - column)) * 0.5;
            let particle = spawn(&mut app, 0.5 + row, 0.02, corner);
            let velocity = Vec3::new(1.0 + row, 0.5 - column, 0.2 * row * column);
            app.world_mut().entity_mut(particle).insert(ParticleVelocity(velocity));
            net.push(particle);
        }
    }
    for index in 0..16_usize {
        for next in [index + 1, index + 4, index + 5].into_iter().filter(|next| *next < 16) {
            if (index % 4).abs_diff(next % 4) <= 1 {
                join(
                    &mut app,
                    Spring::new(net[index], net[next], 0.5).with_stiffness(60.0).with_damping(0.05),
                );
            }
        }
    }
    let momentum = |app: &App| {
        let of = |particle: &Entity| {
            let mass = f64::from(app.world().get::<Particle>(*particle).unwrap().mass);
            mass * velocity(app, *particle).as_dvec3()
        };
        let momenta: Vec<DVec3> = net.iter().map(of).collect();
        (momenta.iter().sum::<DVec3>(), momenta.iter().map(|momentum| momentum.length()).sum::<f64>())
    };
    let (start, scale) = momentum(&app);
    for tick in 1..=2000 {
        run(&mut app, 1);
        let drift = (momentum(&app).0 - start).length() / scale;
        assert!(drift < 1e-5, "tick {tick}: {drift:e}");
    }
    assert_eq!(report(&app).springs, 33);
    let published = app.world().resource::<Measurements>().momentum;
    // The solver stores a mass as 1/m, rounded: 6e-8.
    assert!((published - momentum(&app).0).length() < 6e-8 * scale);
}

/// Seen at the ends of ticks a peak is missed by g (dt/2)² / 2 = 0.3 mm at most, 0.5 % of the lowest.
#[test]
fn a_dropped_ball_peaks_in_the_ratio_of_restitution_squared() {
    let mut app = app();
    app.world_mut().spawn(ParticleCollider { restitution: 0.8, friction: 0.0, ..default() });
    let ball = spawn(&mut app, 2.0, 0.1, Vec3::Y * 1.1);
    let (mut peaks, mut highest, mut rising) = (vec![1.0], 0.0_f32, false);
    while peaks.len() < 6 {
        run(&mut app, 1);
        assert!(report(&app).tick < 1000, "{peaks:?}");
        let falling = velocity(&app, ball).y < 0.0;
        highest = highest.max(position(&app, ball).y - 0.1);
        if falling && rising {
            peaks.push(highest);
        }
        if falling {
            highest = 0.0;
        }
        rising = !falling;
    }
    for pair in peaks.windows(2) {
        let ratio = pair[1] / pair[0];
        assert!((ratio / 0.64 - 1.0).abs() < 0.03, "{ratio} in {peaks:?}");
    }
}

/// It works in 2D as it is: forces and contacts between particles of one plane never leave it.
#[test]
fn particles_of_a_plane_stay_in_it() {
    let mut app = app();
    app.world_mut().spawn(ParticleCollider { restitution: 0.5, friction: 0.5, ..default() });
    let mut all = spawn_rope(&mut app, Vec3::new(-0.3, 0.6, 0.0), 10, 0.1, |spring| spring);
    for number in 0..5_u8 {
        all.push(spawn(
            &mut app,
            1.0,
            0.1,
            Vec3::new(0.05 * f32::from(number), 1.0 + f32::from(number), 0.0),
        ));
    }
    run(&mut app, 300);
    for particle in all {
        assert_eq!(position(&app, particle).z, 0.0);
        assert_eq!(velocity(&app, particle).z, 0.0);
        assert!(position(&app, particle).is_finite());
    }
}
