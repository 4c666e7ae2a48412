//! Start, pause, step and restart; what the last tick did and what it cost.

use bevy::prelude::*;
use bevy_egui::egui::{self, Color32, RichText, Ui};

use super::RestartWithParameters;
use super::history::History;
use super::widgets::{TEXT_SIZE, number};
use crate::diagnostics::Measurements;
use crate::nets::ParticleNet;
use crate::particle::{Particle, Quarantined};
use crate::report::TickReport;
use crate::spring::Spring;
use crate::time_control::SingleStep;

/// The buttons, and the state of the clock.
pub(super) fn draw_transport(
    mut ui: InMut<Ui>,
    mut time: ResMut<Time<Virtual>>,
    single_step: Option<ResMut<SingleStep>>,
    report: Res<TickReport>,
    fixed_time: Res<Time<Fixed>>,
    mut commands: Commands,
) {
    ui.horizontal(|ui| {
        let paused = time.is_paused();
        if ui.button(if paused { "▶ Start" } else { "⏸ Pause" }).clicked() {
            if paused { time.unpause() } else { time.pause() }
        }
        // Without `SingleStepPlugin` there is no such button.
        if let Some(mut single_step) = single_step
            && ui.add_enabled(paused, egui::Button::new("⏭ Step")).clicked()
        {
            single_step.request();
        }
        if ui.button("⟲ Restart").on_hover_text("positions and velocities; the parameters stay").clicked() {
            commands.queue(RestartWithParameters);
        }
        let seconds = report.tick as f64 * fixed_time.timestep().as_secs_f64();
        ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
            ui.label(RichText::new(format!("{seconds:.2} s")).monospace());
        });
    });
}

/// The size of the simulation, what ran, and the cost of a tick.
pub(super) fn draw_cost(
    mut ui: InMut<Ui>,
    report: Res<TickReport>,
    measurements: Res<Measurements>,
    history: Res<History>,
    particles: Query<(), (With<Particle>, Without<Quarantined>)>,
    springs: Query<(), With<Spring>>,
    nets: Query<&ParticleNet>,
) {
    ui.separator();
    // They are counted here, as the report has them only once a tick has run.
    let in_nets = nets.iter().map(|net| net.len() - net.quarantined().len()).sum::<usize>();
    let springs_in_nets =
        nets.iter().map(|net| net.topology().springs.len() - net.broken().len()).sum::<usize>();
    let particles = particles.iter().count() + in_nets;
    let springs = springs.iter().count() + springs_in_nets;
    let TickReport { contacts, faults, asleep, .. } = &*report;
    let cost = history.mean_cost();
    let total = format!("{:.3}", cost[0] + cost[1] + cost[2]);
    let [gather, step, scatter] = cost.map(|milliseconds| format!("{milliseconds:.3}"));
    let speed = number(measurements.max_speed);
    let lines = [
        format!("{particles} particles ({asleep} asleep), {springs} springs, {contacts} contacts"),
        format!("{}, fastest {speed} m/s", report.schemes()),
        format!("tick {total} ms = gather {gather} + step {step} + scatter {scatter}"),
    ];
    for line in lines {
        ui.label(RichText::new(line).size(TEXT_SIZE));
    }
    if *faults > 0 {
        let warning = format!("{faults} particles became non-finite and were taken out");
        ui.label(RichText::new(warning).size(TEXT_SIZE).color(Color32::from_rgb(255, 120, 100)));
    }
}
