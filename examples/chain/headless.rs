//! `--headless`: the same physics without a window.

use std::process::ExitCode;
use std::time::Instant;

use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use bevy_mass_spring::prelude::*;

/// Simulates `seconds` of `scene` as fast as it can and prints a summary.
pub fn run(scene: &MassSpringScene, seconds: f64) -> ExitCode {
    let mut app = App::new();
    app.add_plugins((
        MinimalPlugins,
        TransformPlugin,
        bevy::diagnostic::DiagnosticsPlugin,
        MassSpringPlugin::default().physics_only(),
        MassSpringDiagnosticsPlugin,
    ))
    .insert_resource(TimeUpdateStrategy::FixedTimesteps(1));
    let world = app.world_mut();
    scene.apply_settings(world);
    let mut commands = world.commands();
    let _ = scene.spawn(&mut commands);
    world.flush();
    app.finish();
    app.cleanup();

    let step = app.world().resource::<Time<Fixed>>().timestep().as_secs_f64();
    let ticks = (seconds / step - 1e-9).ceil().max(0.0) as u64;
    app.update(); // the first update has no time to spend and runs no tick
    let start = Instant::now();
    for _ in 0..ticks {
        app.update();
    }
    let cost = start.elapsed().as_secs_f64() * 1e3 / ticks.max(1) as f64;

    let report = app.world().resource::<TickReport>();
    let measured = app.world().resource::<Measurements>();
    println!("{} particles, {} springs, {} contacts", report.particles, report.springs, report.contacts);
    println!("{ticks} ticks of {:.3} ms: {:.3} s simulated", step * 1e3, ticks as f64 * step);
    println!("{}, {cost:.4} ms a tick", report.schemes());
    println!(
        "energy: kinetic {} J, elastic {} J, gravitational {} J",
        number(measured.kinetic_energy),
        number(measured.elastic_energy),
        number(measured.gravitational_energy)
    );
    let (stretch, speed) = (number(measured.max_stretch * 1e2), number(measured.max_speed));
    println!("largest stretch {stretch} %, largest speed {speed} m/s");
    if report.faults > 0 {
        eprintln!("the simulation diverged: {} particles became non-finite", report.faults);
        return ExitCode::FAILURE;
    }
    ExitCode::SUCCESS
}

/// A readable number: those of a diverged simulation have many digits.
fn number(value: f64) -> String {
    if value.abs() < 1e6 { format!("{value:.6}") } else { format!("{value:.3e}") }
}
