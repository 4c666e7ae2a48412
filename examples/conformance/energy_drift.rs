//! Energy: which schemes keep it, lose it and gain it.

use std::error::Error;

use bevy::math::DVec3;
use bevy_mass_spring::settings::SubstepMode;

use crate::Lab;
use crate::document::{Section, Table, signed};
use crate::findings::ENERGY;
use crate::net::Net;
use crate::plot::{Axis, Line, Plot};
use crate::simulation::{Simulation, integrators};

const TICK: f64 = 1.0 / 60.0;
const SECONDS: usize = 20;

pub fn run(lab: &mut Lab) -> Result<Section, Box<dyn Error>> {
    let pendulum = Net::strand(1, 1.0, DVec3::X, 1.0, |_| 1e3, 0.0);
    let net = Net::sheet(10, 0.01, 25.0, 0.0, false);
    let mut table = Table::new(["scheme", "substeps", "pendulum, 20 s", "net, 20 s"]);
    let mut lines = [const { Vec::new() }; 2];
    for integrator in integrators() {
        let mut cells = vec![format!("`{integrator}`"), String::new()];
        for (index, scene) in [&pendulum, &net].into_iter().enumerate() {
            let mut simulation = Simulation::new(scene, integrator, SubstepMode::Fixed(4), TICK);
            let points = drift(&mut simulation, scene.weight());
            let last = points.last().map_or(f64::NAN, |(_, change)| *change);
            let finding = finding(&points, last);
            if index == 0 {
                cells[1] = simulation.choice();
                lab.findings.note(ENERGY, integrator, finding.clone());
            }
            cells.push(finding);
            lines[index].push(Line { name: integrator.to_string(), points });
        }
        table.row(cells);
    }
    let mut section = Section::titled("Energy");
    section.paragraph(
        "Nothing is damped, so the energy should stay what it is. A pendulum of 1 kg on a spring of 1 m and \
         1,000 N/m, let go from horizontal; and a sheet of 10² particles of 10 g, 0.1 m apart, 25 N/m, let go \
         from horizontal with two corners pinned. 4 substeps in each tick of 1/60 s. The change of the total \
         energy is given in parts of weight · 1 m: what the pendulum's fall sets free.",
    );
    section.table(table);
    let [pendulum, net] = lines;
    for (name, file, lines) in [("pendulum", "energy-pendulum.png", pendulum), ("net", "energy-net.png", net)]
    {
        let plot = Plot {
            title: format!("Energy of the undamped {name}, change in parts of weight · 1 m"),
            x: Axis { label: "time, s", logarithmic: false, range: 0.0..SECONDS as f64 + 1e-6 },
            y: Axis { label: "change of the energy", logarithmic: false, range: -0.8..0.4 },
            lines,
        };
        lab.show(&mut section, file, &plot)?;
    }
    Ok(section)
}

/// The change of the energy in parts of `weight` · 1 m, twenty times a second, up to the first infinity.
fn drift(simulation: &mut Simulation, weight: f64) -> Vec<(f64, f64)> {
    let start = simulation.energy();
    let mut points = vec![(0.0, 0.0)];
    for tick in 1..=SECONDS * 60 {
        simulation.tick();
        if tick % 3 == 0 {
            let change = (simulation.energy() - start) / weight;
            points.push((tick as f64 * TICK, change));
            // A gain of a million times that is an explosion.
            if change.is_nan() || change > 1e6 {
                break;
            }
        }
    }
    points
}

fn finding(points: &[(f64, f64)], last: f64) -> String {
    match points.last() {
        Some((time, _)) if last.is_nan() || last > 1e6 => format!("explodes in {time:.1} s"),
        _ => format!("{} %", signed(last * 100.0)),
    }
}
