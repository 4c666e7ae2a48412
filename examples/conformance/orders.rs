//! Convergence: how the error falls with the substep.

use std::error::Error;

use bevy::math::DVec3;
use bevy_mass_spring::settings::{Integrator, SubstepMode};

use crate::Lab;
use crate::document::{Section, Table, number};
use crate::findings::ORDER;
use crate::net::{Net, root_mean_square};
use crate::plot::{Axis, Line, Plot};
use crate::reference;
use crate::simulation::{Simulation, integrators};

const SUBSTEPS: [u32; 10] = [8, 16, 32, 64, 128, 256, 512, 1024, 2048, 4096];

/// Errors below are rounding of positions of about 1 m, m.
const ROUNDING: f64 = 5e-6;

pub fn run(lab: &mut Lab) -> Result<Section, Box<dyn Error>> {
    // 30° below the horizontal: it swings and oscillates.
    let direction = DVec3::new(0.75_f64.sqrt(), -0.5, 0.0);
    let net = Net::strand(4, 0.25, direction, 1.0, |_| 40.0, 0.2);
    let truth = reference::motion(&net, 1.0, 1e-11);
    let mut lines = Vec::new();
    let mut table = Table::new(["scheme", "error with h = 1/64 s", "1/256 s", "1/1024 s", "order"]);
    for integrator in integrators().filter(|integrator| *integrator != Integrator::Auto) {
        let errors: Vec<(f64, f64)> = SUBSTEPS
            .into_iter()
            .map(|substeps| {
                let mut simulation = Simulation::new(&net, integrator, SubstepMode::Fixed(substeps), 1.0);
                simulation.tick();
                (1.0 / f64::from(substeps), root_mean_square(&simulation.positions(), &truth.position))
            })
            .collect();
        let order = order(&errors);
        lab.findings.note(ORDER, integrator, format!("{order:.2}"));
        let cell = |index: usize| format!("{} mm", number(errors[index].1 * 1e3));
        table.row([format!("`{integrator}`"), cell(3), cell(5), cell(7), format!("{order:.2}")]);
        lines.push(Line { name: integrator.to_string(), points: errors });
    }
    let mut section = Section::titled("Convergence");
    section.paragraph(&format!(
        "A strand of 4 links of 0.25 m, 40 N/m and 0.2 N·s/m, with particles of 1 kg, is let go 30° below the \
         horizontal; error is the root of the mean square distance to the reference after 1 s. Reference: \
         Runge–Kutta in f64 with {} steps, {} m from the result with half as many. The order is the slope \
         between the two smallest substeps whose error is above the rounding of f32 ({} m after as many \
         steps) and below 0.1 m.",
        truth.steps,
        number(truth.uncertainty),
        number(ROUNDING)
    ));
    section.table(table);
    let plot = Plot {
        title: "Error after 1 s against the substep".to_owned(),
        x: Axis { label: "substep, s", logarithmic: true, range: 2e-4..0.2 },
        y: Axis { label: "error, m", logarithmic: true, range: 1e-7..10.0 },
        lines,
    };
    lab.show(&mut section, "orders.png", &plot)?;
    Ok(section)
}

/// The slope where the error still falls with the substep, before it becomes rounding.
fn order(errors: &[(f64, f64)]) -> f64 {
    let sensible = errors.iter().skip_while(|(_, error)| error.is_nan() || *error > 0.1);
    let good: Vec<&(f64, f64)> = sensible.take_while(|(_, error)| *error > ROUNDING).collect();
    match good[..] {
        [.., coarse, fine] => (coarse.1 / fine.1).ln() / (coarse.0 / fine.0).ln(),
        _ => f64::NAN,
    }
}
