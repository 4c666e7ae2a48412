//! The k-sweep: one sheet, springs from rubber to diamond, large ticks.

use std::error::Error;
use std::time::Instant;

use bevy_mass_spring::settings::{Integrator, SubstepMode};

use crate::Lab;
use crate::document::{Section, Table, brief};
use crate::findings::STIFFEST;
use crate::net::Net;
use crate::simulation::{Simulation, integrators};

const STIFFNESSES: [f64; 7] = [1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8];
const SECONDS: f64 = 2.0;
const SIDE: usize = 51;
const SUBSTEPS: u32 = 16;
/// Maximum energy above that of the start, J/N.
const MAX_ENERGY_GAIN: f64 = 0.01;
/// Maximum computing time of a run, s.
const MAX_COMPUTING_TIME: f64 = 3.0;

pub fn run(lab: &mut Lab) -> Result<Section, Box<dyn Error>> {
    let mut section = Section::titled("Every stiffness");
    section.paragraph(&format!(
        "A sheet of {SIDE}² particles of 10 g, 0.1 m apart, with structural and shear springs, nothing damped, \
         is let go from horizontal with two corners pinned, and runs {SECONDS} s. `ImplicitEuler` and `TrBdf2` get \
         one substep a tick, `Auto` what it chooses, the others {SUBSTEPS}. Given is by how \
         much the total energy exceeds that of the start at most, and in the end, in J per newton of weight; the \
         bar is +{MAX_ENERGY_GAIN} at most. Otherwise: when the first particle became infinite, or the sheet had gained its \
         own weight times 1 km. A run that takes more than {MAX_COMPUTING_TIME} s of computing is cut short, and it is said when."
    ));
    for (name, time_step) in [("1/60", 1.0 / 60.0), ("1/30", 1.0 / 30.0)] {
        let heads = ["scheme".to_owned()].into_iter();
        let heads = heads.chain(STIFFNESSES.map(|stiffness| format!("{stiffness:.0e} N/m")));
        let mut table = Table::new(heads);
        for integrator in integrators() {
            let mut cells = vec![format!("`{integrator}`")];
            let mut choices = vec!["chosen by `Auto`".to_owned()];
            let (mut within, mut limit) = (true, "none".to_owned());
            for stiffness in STIFFNESSES {
                let outcome = fall(integrator, stiffness, time_step);
                within &= outcome.within_bar;
                if within {
                    limit = format!("{stiffness:.0e} N/m");
                }
                cells.push(outcome.text);
                choices.push(outcome.choice);
            }
            table.row(cells);
            if integrator == Integrator::Auto {
                table.row(choices);
            }
            if name == "1/60" {
                lab.findings.note(STIFFEST, integrator, limit);
            }
        }
        section.paragraph(&format!("In ticks of {name} s:"));
        section.table(table);
    }
    Ok(section)
}

struct Outcome {
    within_bar: bool,
    text: String,
    choice: String,
}

fn fall(integrator: Integrator, stiffness: f64, time_step: f64) -> Outcome {
    let net = Net::sheet(SIDE, 0.01, stiffness, 0.0, false);
    let substeps = match integrator {
        Integrator::Auto => SubstepMode::Auto,
        Integrator::ImplicitEuler | Integrator::TrBdf2 => SubstepMode::Fixed(1),
        _ => SubstepMode::Fixed(SUBSTEPS),
    };
    let mut simulation = Simulation::new(&net, integrator, substeps, time_step);
    let (start, weight) = (simulation.energy(), net.weight());
    let (mut most, mut last, mut note) = (f64::NEG_INFINITY, 0.0, String::new());
    let mut choice = String::new();
    let begin = Instant::now();
    for tick in 1..=(SECONDS / time_step).round() as usize {
        simulation.tick();
        choice = simulation.choice();
        last = (simulation.energy() - start) / weight;
        if !simulation.is_finite() || last.is_nan() || last > 1e3 {
            // Stretched springs have energy without moving.
            let stretches = integrator == Integrator::Xpbd && simulation.is_finite();
            let what = if stretches { "stretches" } else { "explodes" };
            let text = format!("{what} in {:.2} s", tick as f64 * time_step);
            return Outcome { within_bar: false, text, choice };
        }
        most = f64::max(most, last);
        if begin.elapsed().as_secs_f64() > MAX_COMPUTING_TIME {
            note += &format!(" at {:.2} s", tick as f64 * time_step);
            break;
        }
    }
    Outcome {
        within_bar: most <= MAX_ENERGY_GAIN,
        text: format!("{}, {}{note}", brief(most), brief(last)),
        choice,
    }
}
