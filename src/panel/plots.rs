//! The plots: energy over the last seconds, tension along the springs.

use bevy::prelude::*;
use bevy_egui::egui::{self, Color32, Ui};
use egui_plot::{AxisHints, Corner, HLine, Legend, Line, Plot, PlotPoints};

use super::history::{EnergySample, History, SECONDS};
use super::widgets::number;

const HEIGHT: f32 = 128.0;
/// Beyond this magnitude a value is not plotted: egui's arithmetic on pixels is in f32.
const LARGEST: f64 = 1e30;

/// Kinetic, elastic, gravitational and total energy over the last seconds.
pub(super) fn draw_energy(mut ui: InMut<Ui>, history: Res<History>) {
    type Quantity = (&'static str, Color32, fn(&EnergySample) -> f64);
    const QUANTITIES: [Quantity; 4] = [
        ("total", Color32::from_gray(235), |sample| sample.kinetic + sample.elastic + sample.gravitational),
        ("kinetic", Color32::from_rgb(240, 120, 90), |sample| sample.kinetic),
        ("elastic", Color32::from_rgb(110, 200, 120), |sample| sample.elastic),
        ("gravity", Color32::from_rgb(100, 160, 250), |sample| sample.gravitational),
    ];
    title(&mut ui, "Energy (J) over the last 10 s");
    let now = history.energy.back().map_or(0.0, |last| last.time);
    plain_plot("energy")
        .legend(
            Legend::default().position(Corner::LeftBottom).background_alpha(0.5).follow_insertion_order(true),
        )
        .default_x_bounds(-SECONDS, 0.0)
        .show(&mut ui, |plot| {
            plot.set_plot_bounds_x(-SECONDS..=0.0);
            for (name, color, quantity) in QUANTITIES {
                let points: PlotPoints = history
                    .energy
                    .iter()
                    .map(|sample| [sample.time - now, quantity(sample)])
                    .filter(|point| point[1].abs() < LARGEST)
                    .collect();
                plot.line(Line::new(name, points).color(color).width(1.5));
            }
        });
}

/// The tension of each spring at the last tick.
pub(super) fn draw_tension(mut ui: InMut<Ui>, history: Res<History>) {
    title(&mut ui, "Tension (N) along the springs");
    plain_plot("tension").show(&mut ui, |plot| {
        let points: PlotPoints =
            history.tension.iter().copied().filter(|point| point[1].abs() < LARGEST).collect();
        plot.hline(HLine::new("", 0.0).color(Color32::from_gray(90)).width(1.0));
        plot.line(
            Line::new("tension", points).color(Color32::from_rgb(240, 190, 90)).fill(0.0).fill_alpha(0.15),
        );
    });
}

fn title(ui: &mut Ui, text: &str) {
    ui.label(egui::RichText::new(text).small().strong());
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
        .custom_y_axes(vec![AxisHints::new_y().formatter(|mark, _| number(mark.value)).min_thickness(36.0)])
}
