//! The few widgets that the panel repeats: a section, a labelled slider with a unit.

use std::ops::RangeInclusive;

use bevy_egui::egui::{self, DragValue, Response, Slider, SliderClamping, Ui};

/// The size of annotations, in points.
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
    let ends = f64::from(least)..=f64::from(*range.end());
    let mut slider = Slider::from_get_set(ends, |new| take_over(new, value, least..=most));
    if let Scale::Logarithmic(smallest) = scale {
        slider = slider.logarithmic(true).smallest_positive(smallest);
    }
    if !unit.is_empty() {
        slider = slider.suffix(format!(" {unit}"));
    }
    let slider = slider.clamping(SliderClamping::Never).custom_formatter(|value, _| number(value));
    ui.add(slider.update_while_editing(false))
}

/// A number to drag or to type, without a slider.
pub(super) fn field(ui: &mut Ui, value: &mut f32, range: RangeInclusive<f32>) -> Response {
    let field = DragValue::from_get_set(|new| take_over(new, value, range.clone())).speed(0.05);
    ui.add(field.custom_formatter(|value, _| number(value)).update_while_editing(false))
}

/// Sets `value` to what was dragged or typed, and returns it.
///
/// A field that was focused but not edited returns its rounded text: that is no edit.
fn take_over(new: Option<f64>, value: &mut f32, range: RangeInclusive<f32>) -> f64 {
    let shown = number(f64::from(*value)).parse();
    if let Some(new) = new.filter(|new| new.is_finite() && shown != Ok(*new)) {
        *value = (new as f32).clamp(*range.start(), *range.end());
    }
    f64::from(*value)
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

/// A number in about four significant digits, without a tail of zeros.
pub(super) fn number(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return value.to_string();
    }
    if !(1e-4..1e6).contains(&value.abs()) {
        return format!("{value:.1e}");
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
            (-3.2e20, "-3.2e20"),
        ] {
            assert_eq!(number(value), text);
        }
    }

    #[test]
    fn what_is_typed_counts_and_an_untouched_field_does_not() {
        let mut value = 1.0 / 60.0;
        for (typed, taken) in [
            (0.01667, 1.0 / 60.0), // the text of the field
            (0.016671, 0.016671),
            (f64::NAN, 0.016671),
            (-1.0, 0.0),
            (7.0, 2.0),
        ] {
            take_over(Some(typed), &mut value, 0.0..=2.0);
            assert_eq!(value, taken, "{typed}");
        }
        assert_eq!(take_over(None, &mut value, 0.0..=2.0), 2.0);
    }
}
