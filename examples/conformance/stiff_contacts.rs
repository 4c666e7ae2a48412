//! Stiff nets that fall onto the ground, and lie on it.

use std::error::Error;

use bevy_mass_spring::settings::{Integrator, SubstepMode};
use bevy_mass_spring::solver::{Solver, StepSettings};

use crate::Lab;
use crate::document::{Section, Table, number};
use crate::lattice::{DAMPING, Lattice, MASS, SPACING, Strain};
use crate::net::gravity;

const HEIGHT: f64 = 1.5;
/// From where nets fall that are to rest, m.
const LOW: f64 = 0.05;
const STIFFNESSES: [f64; 6] = [1e4, 1e5, 1e6, 1e7, 1e8, 1e9];
const TICKS: [(&str, f32); 3] = [("1/120", 1.0 / 120.0), ("1/60", 1.0 / 60.0), ("1/30", 1.0 / 30.0)];
/// Of coordinates of about 0.1 m, m.
const ULP: f64 = 7e-9;
/// The shares of 1/ω that the references take as steps are the inverses of these.
const RESOLUTIONS: [f64; 2] = [25.0, 50.0];

/// A scheme, and its substeps.
type Run = (Integrator, SubstepMode);

const RUNS: [Run; 5] = [
    AUTO,
    (Integrator::ImplicitEuler, SubstepMode::Fixed(1)),
    (Integrator::TrBdf2, SubstepMode::Fixed(2)),
    (Integrator::Xpbd, SubstepMode::Fixed(20)),
    (Integrator::Xpbd, SubstepMode::Fixed(100)),
];
const AUTO: Run = (Integrator::Auto, SubstepMode::Auto);
/// Those whose state of rest is looked at, in ticks of which lengths.
const RESTING: [(Run, usize); 5] = [(AUTO, 0), (AUTO, 1), (AUTO, 2), (RUNS[1], 1), (RUNS[2], 1)];

fn label((integrator, substeps): Run) -> String {
    match substeps {
        SubstepMode::Fixed(count) => format!("`{integrator}` × {count}"),
        _ => format!("`{integrator}`"),
    }
}

fn table(name: &str) -> Table {
    let heads = STIFFNESSES.map(|stiffness| format!("{stiffness:.0e} N/m"));
    Table::new([name.to_owned()].into_iter().chain(heads))
}

pub fn run(_: &mut Lab) -> Result<Section, Box<dyn Error>> {
    let shapes =
        [Lattice::new("2³", [2, 2, 2]), Lattice::new("8 × 2 × 2", [8, 2, 2]), Lattice::new("5³", [5, 5, 5])];
    let mut section = Section::titled("Stiff nets on the ground");
    falls(&mut section, &shapes);
    rests(&mut section, &shapes);
    Ok(section)
}

/// The falls.
fn falls(section: &mut Section, shapes: &[Lattice]) {
    section.paragraph(&format!(
        "Lattices of springs (neighbours and diagonals; points of {MASS} kg, {SPACING} m apart, damped by {DAMPING} N·s/m) fall \
         {HEIGHT} m onto the ground, ticks of 1/60 s. Given is the most elastic energy that they ever have, as a part \
         of what the fall brought, and the force of their contacts in the last of 5 s as a part of their weight. More than \
         1 is energy from nowhere. The implicit schemes solve contacts within their steps. Position-based dynamics \
         lifts the lowest points in each of its substeps and spreads that by one round over the springs: it needs \
         many of them for stiff nets, and what it puts into the springs is gone in the next ones. In the last row is what the impact brings by the symplectic Euler method \
         in f64, in {} steps for each 1/ω of the fastest mode.",
        RESOLUTIONS[1]
    ));
    let truths: Vec<[[Strain; 2]; 6]> = shapes
        .iter()
        .map(|shape| {
            STIFFNESSES.map(|stiffness| RESOLUTIONS.map(|steps| shape.impact(stiffness, HEIGHT, steps)))
        })
        .collect();
    for (shape, truths) in shapes.iter().zip(&truths) {
        let mut table = table(shape.name);
        let fall = shape.weight() * HEIGHT;
        for run in RUNS {
            let cells = STIFFNESSES.map(|stiffness| {
                let fallen = drop_lattice(shape, stiffness, run, 1.0 / 60.0, HEIGHT, 5.0);
                format!("{} / {:.3}", number(fallen.peak.elastic_energy / fall), fallen.carried)
            });
            table.row([label(run)].into_iter().chain(cells));
        }
        let cells = truths.map(|[_, truth]| number(truth.elastic_energy / fall));
        table.row(["the impact, in f64".to_owned()].into_iter().chain(cells));
        section.table(table);
    }
    let mut most = 0.0_f64;
    let change = |[coarse, fine]: &[Strain; 2]| (coarse.stretch / fine.stretch - 1.0).abs();
    let uncertainty = truths.iter().flatten().map(change).fold(0.0, f64::max);
    let mut table = table("`Auto`, ticks of");
    for (shape, truths) in shapes.iter().zip(&truths) {
        for (name, time_step) in TICKS {
            let mut cells = vec![format!("{}, {name} s", shape.name)];
            for (stiffness, [_, truth]) in STIFFNESSES.into_iter().zip(truths) {
                let fallen = drop_lattice(shape, stiffness, AUTO, time_step, HEIGHT, 1.0);
                let ratio = fallen.peak.stretch / truth.stretch;
                most = most.max(ratio);
                cells.push(format!("{} ({})", number(ratio), fallen.choice));
            }
            table.row(cells);
        }
    }
    section.paragraph(&format!(
        "**The peak of the stretch** of any spring at the end of any tick of the first second, in parts of the peak in f64 (within {} % \
         of that with steps of twice the length). The bar: at most twice as much; the largest is {}. Where a step is longer \
         than an impact it does not see its peak.",
        number(100.0 * uncertainty),
        number(most)
    ));
    section.table(table);
}

/// The states of rest.
fn rests(section: &mut Section, shapes: &[Lattice]) {
    section.paragraph(&format!(
        "**At rest** {LOW} m below, after 8 s, in ticks of three lengths: elastic energy and the stretch of the most strained spring \
         by the published tensions, T² / 2 k and T / k l₀, in parts of those of the statics, solved in f64; and the \
         force of the contacts in parts of the weight, in the mean of the last second, with the most of any of its ticks where \
         that is more than 2 % above. The bar: 1 within 2 %. Points that touch the ground are held where f32 \
         has them, so the tension between two of them has an error of some k ulp, {ULP:.0e} m for coordinates of 0.1 m; where one \
         ulp is more than 0.2 % of the largest stretch of the statics the cell has the contacts alone.",
    ));
    for shape in shapes {
        let mut table = table(shape.name);
        for (run, tick) in RESTING {
            let (name, time_step) = TICKS[tick];
            let cells = STIFFNESSES.map(|stiffness| {
                let truth = shape.at_rest(stiffness);
                let rests = drop_lattice(shape, stiffness, run, time_step, LOW, 8.0);
                let mut carried = format!("{:.3}", rests.carried);
                if rests.most_carried > 1.02 {
                    carried += &format!(" (≤ {:.2})", rests.most_carried);
                }
                if ULP / SPACING > 0.002 * truth.stretch {
                    return carried;
                }
                let energy = rests.last.elastic_energy / truth.elastic_energy;
                let stretch = rests.last.stretch / truth.stretch;
                format!("{energy:.3} / {stretch:.3} / {carried}")
            });
            table.row([format!("{}, {name} s", label(run))].into_iter().chain(cells));
        }
        section.table(table);
    }
}

/// What came of a fall.
struct Fallen {
    peak: Strain,
    /// At the end, by the published tensions.
    last: Strain,
    /// The force of the contacts in parts of the weight: the mean of the last second, and the most in one of its ticks.
    carried: f64,
    most_carried: f64,
    /// The scheme of the tick with the most elastic energy.
    choice: &'static str,
}

fn drop_lattice(
    shape: &Lattice,
    stiffness: f64,
    (integrator, substeps): Run,
    time_step: f32,
    height: f64,
    seconds: f64,
) -> Fallen {
    let mut solver = shape.solver(stiffness, height);
    let settings =
        StepSettings { integrator, substeps, gravity: gravity(), time_step, ..StepSettings::default() };
    let ticks = (seconds / f64::from(time_step)).round() as usize;
    let last_second = (1.0 / time_step).round() as usize;
    let (mut peak, mut choice) = (Strain::default(), "");
    let mut carried = Vec::with_capacity(last_second);
    for tick in 1..=ticks {
        let is_last_second = tick + last_second > ticks;
        let outputs = solver.outputs_mut();
        (outputs.record_contacts, outputs.record_forces) = (is_last_second, tick == ticks);
        solver.step(&settings);
        let now = solver.measure(settings.gravity);
        let outputs = solver.outputs();
        if is_last_second {
            let contacts = outputs.contacts.iter();
            let impulse: f64 = contacts.map(|contact| f64::from(contact.impulse * contact.normal.y)).sum();
            carried.push(impulse / f64::from(time_step) / shape.weight());
        }
        if now.elastic_energy > peak.elastic_energy {
            let plan = outputs.plan;
            let is_stiff = matches!(plan.integrator, Integrator::ImplicitEuler | Integrator::TrBdf2);
            choice = if is_stiff || plan.stiff_substeps > 0 { "implicit" } else { "explicit" };
        }
        peak.elastic_energy = peak.elastic_energy.max(now.elastic_energy);
        peak.stretch = peak.stretch.max(now.max_stretch);
    }
    Fallen {
        peak,
        last: by_tensions(&solver, stiffness),
        carried: carried.iter().sum::<f64>() / last_second as f64,
        most_carried: carried.into_iter().fold(0.0, f64::max),
        choice,
    }
}

/// What the published tensions say.
fn by_tensions(solver: &Solver, stiffness: f64) -> Strain {
    let mut strain = Strain::default();
    for (number, tension) in solver.outputs().tensions.iter().enumerate() {
        let tension = f64::from(*tension);
        let rest_length = f64::from(solver.spring(number).1.rest_length);
        strain.elastic_energy += 0.5 * tension * tension / stiffness;
        strain.stretch = strain.stretch.max(tension.abs() / (stiffness * rest_length));
    }
    strain
}
