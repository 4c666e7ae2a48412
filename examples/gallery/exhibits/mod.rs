//! The exhibits, one file each.

mod balloon;
mod bridge;
mod cape;
mod crane;
mod curtain;
mod flag;
mod hammock;
mod jelly;
mod mail;
mod mattress;
mod rods;
mod tear;

use bevy::prelude::*;
use bevy_egui::egui::{Slider, Ui};

/// Adds all exhibits, in the order in which they are listed.
pub fn plugin(app: &mut App) {
    app.add_plugins((
        bridge::plugin,
        flag::plugin,
        hammock::plugin,
        curtain::plugin,
        cape::plugin,
        crane::plugin,
        jelly::plugin,
        balloon::plugin,
        tear::plugin,
        mail::plugin,
        mattress::plugin,
        rods::plugin,
    ));
}

/// A slider for a parameter; whether it was moved.
fn slider(
    ui: &mut Ui,
    name: &str,
    unit: &str,
    value: &mut f32,
    range: std::ops::RangeInclusive<f32>,
) -> bool {
    let slider = Slider::new(value, range).suffix(format!(" {unit}")).text(name);
    ui.add(slider).changed()
}

/// A slider over several powers of ten.
fn log_slider(
    ui: &mut Ui,
    name: &str,
    unit: &str,
    value: &mut f32,
    range: std::ops::RangeInclusive<f32>,
) -> bool {
    let slider = Slider::new(value, range).logarithmic(true).suffix(format!(" {unit}")).text(name);
    ui.add(slider).changed()
}
