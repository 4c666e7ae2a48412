//! The hanging sheet of *Fast Simulation of Mass-Spring Systems* (Liu et al. 2013): one tick of it.

use std::error::Error;

use bevy_mass_spring::settings::{Integrator, SubstepMode};

use crate::Lab;
use crate::document::{Section, Table, number};
use crate::net::{Net, root_mean_square};
use crate::plot::{Axis, Line, Plot};
use crate::simulation::{Simulation, integrators};
use crate::{backward_euler, reference};

const TICK: f64 = 1.0 / 60.0;
/// Number of ticks before the one that is measured.
const TICKS_BEFORE: usize = 30;
/// What Liu et al. take for a frame, ms.
const THEIR_FRAME: f64 = 50.0;

pub fn run(lab: &mut Lab) -> Result<Section, Box<dyn Error>> {
    let mut net = Net::sheet(81, 0.01, 1e5, 0.0, false);
    let mut before = Simulation::new(&net, Integrator::ImplicitEuler, SubstepMode::Fixed(1), TICK);
    before.run(TICKS_BEFORE);
    net.take(&before.solver);
    let seconds = f64::from(TICK as f32);
    let truth = reference::motion(&net, seconds, 1e-8);
    let converged = backward_euler::step(&net, seconds);
    let way = root_mean_square(&truth.position, &net.position);
    let step = root_mean_square(&converged.position, &net.position);

    let mut table =
        Table::new(["scheme", "substeps", "ms", "error of the motion", "error of the converged step"]);
    let mut lines = Vec::new();
    for integrator in integrators() {
        let mut points = Vec::new();
        for substeps in candidates(integrator) {
            let (simulation, milliseconds) = one_tick(&net, integrator, substeps);
            let error = root_mean_square(&simulation.positions(), &truth.position) / way;
            // One substep of backward Euler is what the converged step is of.
            let is_step = substeps == SubstepMode::Fixed(1) && integrator == Integrator::ImplicitEuler;
            let deviation = root_mean_square(&simulation.positions(), &converged.position) / step;
            if error < 1.0 {
                table.row([
                    format!("`{integrator}`"),
                    simulation.choice(),
                    number(milliseconds),
                    number(error),
                    if is_step { number(deviation) } else { String::new() },
                ]);
                points.push((milliseconds, error));
            }
        }
        lines.push(Line { name: integrator.to_string(), points });
    }
    lines.push(Line {
        name: "Liu et al. 2013".into(),
        points: vec![(THEIR_FRAME, 1e-6), (THEIR_FRAME, 0.999)],
    });
    let mut section = Section::titled("A sheet of 6,561 particles");
    section.paragraph(&format!(
        "81² particles of 10 g, 0.1 m apart, {} springs of 10⁵ N/m, undamped, two corners pinned, falling from \
         horizontal: the tick of 1/60 s after {TICKS_BEFORE} of them by `ImplicitEuler`, which leaves no fast oscillation. The cost is the least of five runs, errors are root mean squares in parts of \
         the distance that the particles move in this tick, {} m. The true motion is Runge–Kutta in f64 in {} \
         steps, {} m from that with half as many; the converged step is backward Euler in f64, its last \
         Newton step {} m. Liu et al. take {THEIR_FRAME} ms a frame for a cloth of as many vertices (on the \
         processor of their day). Runs that miss by more than the distance itself are left out. The bar: the \
         implicit step to 0.001 in 50 ms.",
        net.links.len(),
        number(way),
        truth.steps,
        number(truth.uncertainty),
        number(converged.uncertainty)
    ));
    section.table(table);
    let plot = Plot {
        title: "One tick of a sheet of 81²: error against cost".to_owned(),
        x: Axis { label: "ms", logarithmic: true, range: 0.2..500.0 },
        y: Axis { label: "error, in parts of the motion", logarithmic: true, range: 1e-6..1.0 },
        lines,
    };
    lab.show(&mut section, "sheet.png", &plot)?;
    Ok(section)
}

/// Numbers of substeps to try: from 1 for what is stable with any, from the bound for others.
fn candidates(integrator: Integrator) -> Vec<SubstepMode> {
    if integrator == Integrator::Auto {
        return vec![SubstepMode::Auto];
    }
    let counts: &[u32] = match integrator {
        Integrator::ImplicitEuler | Integrator::TrBdf2 => &[1, 2, 4],
        Integrator::Xpbd => &[1, 4, 16],
        _ => &[64, 128, 256, 512],
    };
    counts.iter().map(|count| SubstepMode::Fixed(*count)).collect()
}

/// The tick, and its cost after a first run: the minimum of five, ms.
fn one_tick(net: &Net, integrator: Integrator, substeps: SubstepMode) -> (Simulation, f64) {
    let mut simulation = Simulation::new(net, integrator, substeps, TICK);
    simulation.tick();
    let mut least = f64::INFINITY;
    for _ in 0..5 {
        simulation.restart(net);
        least = least.min(simulation.tick());
    }
    (simulation, least)
}
