//! Error against milliseconds, every scheme on the same axes.

use std::error::Error;

use bevy::math::DVec3;
use bevy_mass_spring::settings::{Integrator, SubstepMode};

use crate::Lab;
use crate::document::{Section, Table, number};
use crate::findings::{CLOTH, ROPE};
use crate::net::{Net, root_mean_square};
use crate::plot::{Axis, Line, Plot};
use crate::reference;
use crate::simulation::{Simulation, integrators};

const TICK: f64 = 1.0 / 60.0;
const TICKS: usize = 30;
const REPEATS: usize = 3;

/// A scene of this comparison.
struct Scene {
    name: &'static str,
    description: &'static str,
    file: &'static str,
    column: &'static str,
    net: Net,
    /// Errors to be reached, m.
    goals: [f64; 3],
}

/// What a run cost and how wrong it was.
struct Run {
    substeps: String,
    milliseconds: f64,
    error: f64,
}

pub fn run(lab: &mut Lab) -> Result<Section, Box<dyn Error>> {
    let mut section = Section::titled("Error against cost");
    section.paragraph(&format!(
        "Two scenes are let go from horizontal and run 0.5 s, 30 ticks of 1/60 s, with 1, 2, 4 … substeps, or \
         what `Auto` chooses. The error is the root of the mean square distance of the particles to the \
         reference, Runge–Kutta in f64. The tables give the cheapest run of each scheme that reaches an error: \
         ms a tick (substeps), of each tick the least of {REPEATS} runs."
    ));
    let scenes = [
        Scene {
            name: "Rope of 1,000",
            description: "1,000 links of 0.1 m, 10⁴ N/m and 1 N·s/m, particles of 1 kg, one end pinned.",
            file: "cost-rope.png",
            column: ROPE,
            net: Net::strand(1000, 0.1, DVec3::X, 1.0, |_| 1e4, 1.0),
            goals: [3e-2, 1e-3, 1e-4],
        },
        Scene {
            name: "Cloth of 32²",
            description: "32² particles of 10 g, 0.1 m apart, structural, shear and skip-one springs of 10³ N/m \
                          and 1 N·s/m, two corners pinned.",
            file: "cost-cloth.png",
            column: CLOTH,
            net: Net::sheet(32, 0.01, 1e3, 1.0, true),
            goals: [3e-2, 1e-2, 1e-3],
        },
    ];
    for scene in scenes {
        compare(lab, &mut section, &scene)?;
    }
    Ok(section)
}

fn compare(lab: &mut Lab, section: &mut Section, scene: &Scene) -> Result<(), Box<dyn Error>> {
    let truth = reference::motion(&scene.net, f64::from(TICK as f32) * TICKS as f64, 1e-7);
    let goals = scene.goals.map(|goal| format!("{} mm", number(goal * 1e3)));
    let mut table =
        Table::new(["scheme".to_owned()].into_iter().chain(goals).chain(["smallest error".into()]));
    let mut lines = Vec::new();
    for integrator in integrators() {
        let runs = runs(integrator, &scene.net, &truth.position);
        let cheapest = |goal: f64| {
            let good = runs.iter().filter(|run| run.error <= goal);
            good.min_by(|a, b| a.milliseconds.total_cmp(&b.milliseconds))
        };
        let cell = |goal: f64| match cheapest(goal) {
            Some(run) => format!("{} ({})", number(run.milliseconds), run.substeps),
            None => "—".to_owned(),
        };
        let smallest = runs.iter().map(|run| run.error).fold(f64::INFINITY, f64::min);
        let smallest =
            if smallest < 1e3 { format!("{} mm", number(smallest * 1e3)) } else { "explodes".into() };
        table.row([format!("`{integrator}`")].into_iter().chain(scene.goals.map(cell)).chain([smallest]));
        lab.findings.note(scene.column, integrator, cell(scene.goals[0]));
        let points = runs.iter().map(|run| (run.milliseconds, run.error)).collect();
        lines.push(Line { name: integrator.to_string(), points });
    }
    section.paragraph(&format!(
        "**{}.** {} Reference in {} steps, {} m from that with half as many.",
        scene.name,
        scene.description,
        truth.steps,
        number(truth.uncertainty)
    ));
    section.table(table);
    let plot = Plot {
        title: format!("{}: error after 0.5 s against the cost of a tick", scene.name),
        x: Axis { label: "ms a tick", logarithmic: true, range: 1e-3..30.0 },
        y: Axis { label: "error, m", logarithmic: true, range: 1e-6..10.0 },
        lines,
    };
    lab.show(section, scene.file, &plot)
}

/// Runs with more and more substeps, up to a number at which all of them cost about the same.
fn runs(integrator: Integrator, net: &Net, truth: &[DVec3]) -> Vec<Run> {
    let choices: Vec<SubstepMode> = match integrator {
        Integrator::Auto => vec![SubstepMode::Auto],
        Integrator::ImplicitEuler | Integrator::TrBdf2 => doublings(16),
        _ => doublings(512),
    };
    let mut runs = Vec::new();
    for choice in choices {
        let mut simulation = Simulation::new(net, integrator, choice, TICK);
        let milliseconds = run_repeatedly(&mut simulation, net);
        let error = root_mean_square(&simulation.positions(), truth);
        if error.is_finite() {
            runs.push(Run { substeps: simulation.choice(), milliseconds, error });
        }
    }
    runs
}

/// 1, 2, 4 … `most` substeps.
fn doublings(most: u32) -> Vec<SubstepMode> {
    (0..=most.ilog2()).map(|power| SubstepMode::Fixed(1 << power)).collect()
}

/// The cost of a tick, ms: the mean over the ticks of the minimum of several runs, which all do the same
/// work, to which other programs only add.
fn run_repeatedly(simulation: &mut Simulation, net: &Net) -> f64 {
    let mut least = [f64::INFINITY; TICKS];
    for _ in 0..REPEATS {
        simulation.restart(net);
        for least in &mut least {
            *least = least.min(simulation.tick());
        }
    }
    least.iter().sum::<f64>() / TICKS as f64
}
