//! The few widgets that the panel repeats: a section, a labelled slider with a unit.

use std::ops::RangeInclusive;

use bevy_egui::egui::{self, Response, Slider, SliderClamping, Ui};

/// The size of text that comments on other things, in points.
pub(super) const TEXT_SIZE: f32 = 11.0;

/// A collapsible section, open at first.
pub(super) fn section(ui: &mut Ui, title: &str, draw: impl FnOnce(&mut Ui)) {
    let heading = egui::RichText::new(title).strong();
    egui::CollapsingHeader::new(heading).id_salt(title).default_open(true).show_unindented(ui, |ui| {
        draw(ui);
        ui.add_space(4.0);
    });
}

/// How the range of a slider is spread over its length.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Scale {
    /// Evenly.
    Linear,
    /// By powers of ten, from this positive value on (below it, zero).
    Logarithmic(f64),
}

/// A line with a name, a slider and a unit. Numbers beyond the slider's range may be typed, down to
/// its lower end.
pub(super) fn parameter(
    ui: &mut Ui,
    name: &str,
    unit: &str,
    value: &mut f32,
    range: RangeInclusive<f32>,
    scale: Scale,
) -> Response {
    row(ui, name, |ui| slider(ui, unit, value, range, scale))
}

/// The slider of a [`parameter`], without the name.
pub(super) fn slider(
    ui: &mut Ui,
    unit: &str,
    value: &mut f32,
    range: RangeInclusive<f32>,
    scale: Scale,
) -> Response {
    let least = *range.start();
    let most = if unit.is_empty() { *range.end() } else { f32::MAX };
    let mut slider = Slider::from_get_set(f64::from(least)..=f64::from(*range.end()), |new| {
        if let Some(new) = new.filter(|new| new.is_finite()) {
            *value = (new as f32).clamp(least, most);
        }
        f64::from(*value)
    });
    if let Scale::Logarithmic(smallest) = scale {
        slider = slider.logarithmic(true).smallest_positive(smallest);
    }
    if !unit.is_empty() {
        slider = slider.suffix(format!(" {unit}"));
    }
    ui.add(slider.clamping(SliderClamping::Never).custom_formatter(|value, _| number(value)))
}

/// A line with a name at the left and something at the right, at the same place in each line.
pub(super) fn row<R>(ui: &mut Ui, name: &str, draw: impl FnOnce(&mut Ui) -> R) -> R {
    const NAME_WIDTH: f32 = 92.0;
    ui.horizontal(|ui| {
        let size = egui::vec2(NAME_WIDTH, ui.spacing().interact_size.y);
        ui.allocate_ui_with_layout(size, egui::Layout::left_to_right(egui::Align::Center), |ui| {
            ui.set_min_width(NAME_WIDTH);
            ui.label(name);
        });
        draw(ui)
    })
    .inner
}

/// A number in at most four significant digits, without a tail of zeros.
pub(super) fn number(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return value.to_string();
    }
    let digits = (3.0 - value.abs().log10().floor()).clamp(0.0, 9.0) as usize;
    let text = format!("{value:.digits$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short() {
        for (value, text) in [
            (0.0, "0"),
            (9.81, "9.81"),
            (1000.0, "1000"),
            (0.05, "0.05"),
            (1.0 / 60.0, "0.01667"),
            (12345.6, "12346"),
        ] {
            assert_eq!(number(value), text);
        }
    }
}
