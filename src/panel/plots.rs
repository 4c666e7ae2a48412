//! The plots: energy over the last seconds, tension along the springs.

use bevy::prelude::*;
use bevy_egui::egui::{self, Color32, Ui};
use egui_plot::{AxisHints, GridInput, HLine, Line, Plot, PlotPoints, Points};

use crate::spring::Spring;

use super::history::{EnergySample, History, SECONDS};
use super::widgets::{TEXT_SIZE, number};

const HEIGHT: f32 = 92.0;
/// Maximum number of springs that are marked one by one.
const MAX_MARKED_SPRINGS: usize = 40;
/// Maximum magnitude that is plotted: egui's arithmetic on pixels is in f32.
const MAX_VALUE: f64 = 1e30;

/// Kinetic, elastic, gravitational and total energy over the last seconds.
pub(super) fn draw_energy(mut ui: InMut<Ui>, history: Res<History>) {
    type Quantity = (&'static str, Color32, fn(&EnergySample) -> f64);
    const QUANTITIES: [Quantity; 4] = [
        ("total", Color32::from_gray(235), |sample| sample.kinetic + sample.elastic + sample.gravitational),
        ("kinetic", Color32::from_rgb(240, 120, 90), |sample| sample.kinetic),
        ("elastic", Color32::from_rgb(110, 200, 120), |sample| sample.elastic),
        ("gravity", Color32::from_rgb(100, 160, 250), |sample| sample.gravitational),
    ];
    ui.horizontal(|ui| {
        ui.spacing_mut().item_spacing.x = 6.0;
        title(ui, "Energy (J)");
        for (name, color, _) in QUANTITIES {
            ui.label(egui::RichText::new(name).size(TEXT_SIZE).color(color));
        }
    });
    let now = history.energy.back().map_or(0.0, |last| last.time);
    plain_plot("energy")
        .x_axis_formatter(|mark, _| format!("{} s", number(mark.value)))
        .default_x_bounds(-SECONDS, 0.0)
        .show(&mut ui, |plot| {
            plot.set_plot_bounds_x(-SECONDS..=0.0);
            for (name, color, quantity) in QUANTITIES {
                let points: PlotPoints = history
                    .energy
                    .iter()
                    .map(|sample| [sample.time - now, quantity(sample)])
                    .filter(|point| point[1].abs() < MAX_VALUE)
                    .collect();
                plot.line(Line::new(name, points).color(color).width(1.5));
            }
        });
}

/// The tension of each spring at the last tick, or of those of a rope; nothing where there are neither.
pub(super) fn draw_tension(mut ui: InMut<Ui>, history: Res<History>, springs: Query<(), With<Spring>>) {
    if springs.is_empty() && history.tension.is_empty() {
        return;
    }
    title(&mut ui, "Tension (N) along the springs");
    let points = || -> PlotPoints {
        history.tension.iter().copied().filter(|point| point[1].abs() < MAX_VALUE).collect()
    };
    let color = Color32::from_rgb(240, 190, 90);
    plain_plot("tension").x_grid_spacer(egui_plot::uniform_grid_spacer(whole_steps)).show(&mut ui, |plot| {
        plot.hline(HLine::new("", 0.0).color(Color32::from_gray(90)).width(1.0));
        plot.line(Line::new("tension", points()).color(color).fill(0.0).fill_alpha(0.15));
        if history.tension.len() <= MAX_MARKED_SPRINGS {
            plot.points(Points::new("tension", points()).color(color).radius(2.0));
        }
    });
}

/// Springs are counted: no grid line stands between two of them.
fn whole_steps(input: GridInput) -> [f64; 3] {
    let least = 10.0f64.powf(input.base_step_size.log10().ceil().max(0.0));
    [100.0 * least, 10.0 * least, least]
}

fn title(ui: &mut Ui, text: &str) {
    ui.label(egui::RichText::new(text).size(TEXT_SIZE).strong());
}

/// A plot that the pointer cannot move: it follows the simulation.
fn plain_plot(id: &str) -> Plot<'_> {
    Plot::new(id)
        .height(HEIGHT)
        .allow_drag(false)
        .allow_zoom(false)
        .allow_scroll(false)
        .allow_boxed_zoom(false)
        .allow_axis_zoom_drag(false)
        .allow_double_click_reset(false)
        .show_crosshair(false)
        .set_margin_fraction(egui::vec2(0.02, 0.08))
        .custom_y_axes(vec![
            AxisHints::new_y()
                .formatter(|mark, _| number(mark.value))
                .min_thickness(36.0)
                .label_spacing(egui::Rangef::new(14.0, 26.0)),
        ])
}
