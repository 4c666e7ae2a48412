//! Second-order implicit schemes: which one, and what it is worth beside backward Euler.

use std::error::Error;

use bevy::math::DVec3;
use bevy_mass_spring::settings::{Integrator, SubstepMode};

use crate::Lab;
use crate::document::{Section, Table, number};
use crate::findings::ORDER_ON_GROUND;
use crate::net::{Net, root_mean_square};
use crate::plot::{Axis, Line, Plot};
use crate::reference;
use crate::second_order_f64::{Motion, Scheme};
use crate::simulation::Simulation;
use crate::stiff_energy::{SECONDS, TICK, rope, swing, swing_energy};

/// Systems of equations that are solved in a tick of the comparison.
const SOLUTIONS: usize = 4;
/// Ticks that the sheets fall.
const FALL: usize = 15;
const STIFFNESSES: [f64; 3] = [1e4, 1e6, 1e9];
const BUILT: [Integrator; 2] = [Integrator::ImplicitEuler, Integrator::TrBdf2];

pub fn run(lab: &mut Lab) -> Result<Section, Box<dyn Error>> {
    let mut section = Section::titled("Second-order implicit schemes");
    choice(&mut section);
    orders(lab, &mut section)?;
    swings(lab, &mut section)?;
    sheets(&mut section);
    Ok(section)
}

/// What one of the schemes in f64 makes of the comparison.
struct Candidate {
    scheme: Scheme,
    order: f64,
    /// What is left of the energy of a swing for each stiffness, and of the rope's, %.
    kept: [f64; 4],
    /// What is left of an oscillation that is not resolved after one tick and after ten, %.
    ringing: [f64; 2],
}

/// The schemes that could have been built, in f64.
fn choice(section: &mut Section) {
    section.paragraph(&format!(
        "**Which one.** The schemes in f64, written for this comparison, all with {SOLUTIONS} solutions of the equations in a \
         tick of 1/60 s; nothing is damped. Order: of the strand of the section on convergence, between 256 and 512 \
         steps in a second. Swing: what is left after {SECONDS} s of the energy of the pendulum of the section \
         above, for its stiffness, and of the rope of 10⁶ N/m. Ringing: of the energy of an oscillation along \
         the hanging pendulum of 10⁹ N/m, 10⁻⁶ m to and fro, which no step resolves, what is left after one tick and after ten."
    ));
    let heads = [
        "scheme",
        "order",
        "swing, 1e4 N/m",
        "1e6 N/m",
        "1e9 N/m",
        "rope, 1e6 N/m",
        "ringing, 1 tick",
        "10 ticks",
        "remembers",
    ];
    let mut table = Table::new(heads);
    let candidates = Scheme::ALL.map(candidate);
    for Candidate { scheme, order, kept, ringing } in &candidates {
        let percents = kept.iter().map(|kept| format!("{kept:.2} %"));
        let left = ringing.iter().map(|left| format!("{} %", number(*left)));
        let head = [scheme.name(), format!("{order:.2}")];
        table.row(head.into_iter().chain(percents).chain(left).chain([scheme.memory().to_owned()]));
    }
    section.table(table);
    let off = |candidate: &Candidate| {
        candidate.kept.into_iter().map(|kept| (kept - 100.0).abs()).fold(0.0, f64::max)
    };
    let best = |candidates: &mut dyn Iterator<Item = &Candidate>| {
        let best = candidates.min_by(|one, other| off(one).total_cmp(&off(other)));
        best.map_or_else(String::new, |best| format!("{} ({:.2} %)", best.scheme.name(), off(best)))
    };
    let quiet = best(&mut candidates.iter().filter(|candidate| candidate.ringing[0] < 1e-3));
    let any = best(&mut candidates.iter());
    section.paragraph(&format!(
        "By the swing that changes its energy most the best is {any}; of those that leave less than 0.001 % of an \
         unresolved oscillation after one tick it is {quiet}. TR-BDF2 is the one that was built: `TrBdf2`."
    ));
}

fn candidate(scheme: Scheme) -> Candidate {
    let h = 1.0 / (60.0 * SOLUTIONS as f64) * scheme.stages() as f64;
    let run = |net: &Net, steps: usize, h: f64| {
        let mut motion = Motion::new(net, scheme);
        (0..steps).for_each(|_| motion.step(h));
        motion
    };
    let kept = |net: Net| {
        let start = Motion::new(&net, scheme).energy();
        let end = run(&net, (SECONDS as f64 / h).round() as usize, h).energy();
        100.0 * (1.0 + (end - start) / swing_energy(&net))
    };
    let [soft, stiff, stiffest] = STIFFNESSES.map(|stiffness| kept(swing(stiffness)));
    let ringing = [1, 10].map(|ticks| {
        let net = hanging(1e-6);
        let lowest = Motion::new(&hanging(0.0), scheme).energy();
        let end = run(&net, ticks * SOLUTIONS / scheme.stages(), h).energy();
        100.0 * (end - lowest).max(0.0) / (Motion::new(&net, scheme).energy() - lowest)
    });
    let mut strand = strand(40.0);
    strand.links.iter_mut().for_each(|link| link.damping = 0.0);
    let truth = reference::motion(&strand, 1.0, 1e-11);
    let error = |steps: usize| {
        root_mean_square(&run(&strand, steps, 1.0 / steps as f64).net.position, &truth.position)
    };
    let order = (error(256) / error(512)).log2();
    Candidate { scheme, order, kept: [soft, stiff, stiffest, kept(rope(0.1, 0.1, 1e6))], ringing }
}

/// The pendulum of 10⁹ N/m straight down, `stretch` m below its equilibrium.
fn hanging(stretch: f64) -> Net {
    let mut net = Net::strand(1, 1.0, DVec3::NEG_Y, 1.0, |_| 1e9, 0.0);
    net.position[1].y = -1.0 - crate::net::GRAVITY / 1e9 - stretch;
    net
}

/// The strand of the section on convergence.
fn strand(stiffness: f64) -> Net {
    Net::strand(4, 0.25, DVec3::new(0.75_f64.sqrt(), -0.5, 0.0), 1.0, |_| stiffness, 0.2)
}

/// The measured orders of the implicit schemes of the crate, free and in contact.
fn orders(lab: &mut Lab, section: &mut Section) -> Result<(), Box<dyn Error>> {
    let on_ground = |stiffness: f64| {
        let mut net = strand(stiffness);
        net.set_mass(4, 20.0);
        net.on_ground = Some(4);
        net
    };
    let scenes = [
        ("40 N/m", strand(40.0)),
        ("1e6 N/m", strand(1e6)),
        ("40 N/m, on the ground", on_ground(40.0)),
        ("1e6 N/m, on the ground", on_ground(1e6)),
    ];
    let truths = scenes.each_ref().map(|(_, net)| reference::motion(net, 1.0, 1e-9));
    section.paragraph(&format!(
        "**Orders, free and in contact.** The strand of the section on convergence, with links of 40 and of 10⁶ N/m, \
         free, and with a ball of 20 kg at the end that slides on frictionless ground all the time, where each step is one of backward \
         Euler. Error after 1 s with 64 and 512 steps, and the order between these; the references, Runge–Kutta in f64, which \
         leaves the end on the ground, took {} steps at most and are {} m from those with half as many at most.",
        truths.iter().map(|truth| truth.steps).max().unwrap_or(0),
        number(truths.iter().map(|truth| truth.uncertainty).fold(0.0, f64::max))
    ));
    let mut table = Table::new(["scheme", "links", "error with h = 1/64 s", "1/512 s", "order"]);
    let mut lines = Vec::new();
    for integrator in BUILT {
        for ((name, net), truth) in scenes.iter().zip(&truths) {
            let points: Vec<(f64, f64)> = [8, 16, 32, 64, 128, 256, 512, 1024]
                .into_iter()
                .map(|substeps| {
                    let mut simulation = Simulation::new(net, integrator, SubstepMode::Fixed(substeps), 1.0);
                    simulation.tick();
                    let error = root_mean_square(&simulation.positions(), &truth.position);
                    (1.0 / f64::from(substeps), error)
                })
                .collect();
            let [coarse, fine] = [3, 6].map(|index| points[index].1);
            let order = format!("{:.2}", (coarse / fine).log2() / 3.0);
            if net.on_ground.is_some() && name.starts_with("40") {
                lab.findings.note(ORDER_ON_GROUND, integrator, order.clone());
            }
            let [coarse, fine] = [coarse, fine].map(|error| format!("{} mm", number(error * 1e3)));
            table.row([format!("`{integrator}`"), (*name).to_owned(), coarse, fine, order]);
            // As long as the legend is wide.
            let short = name.replace(" N/m", "").replace(", on the", ",");
            lines.push(Line { name: format!("{integrator}, {short}"), points });
        }
    }
    section.table(table);
    let plot = Plot {
        title: "Error after 1 s, links of 40 and 1e6 N/m, free and on the ground".to_owned(),
        x: Axis { label: "substep, s", logarithmic: true, range: 8e-4..0.2 },
        y: Axis { label: "error, m", logarithmic: true, range: 1e-7..1.0 },
        lines,
    };
    lab.show(section, "second-order.png", &plot)
}

/// What is left of swings, against the cost.
fn swings(lab: &mut Lab, section: &mut Section) -> Result<(), Box<dyn Error>> {
    section.paragraph(&format!(
        "**Swings.** Of the energy of the rope and of the load of the section above, at 10⁶ N/m, what is lost after {SECONDS} s, \
         and what a tick of 1/60 s costs."
    ));
    let scenes = [("rope", rope(0.1, 0.1, 1e6)), ("load", rope(0.01, 10.0, 1e6))];
    let mut table = Table::new(["scheme", "substeps", "rope: lost", "ms a tick", "load: lost", "ms a tick"]);
    let mut lines = Vec::new();
    for integrator in BUILT {
        let mut points = [const { Vec::new() }; 2];
        for substeps in [1, 2, 4, 8, 16] {
            let mut cells = vec![format!("`{integrator}`"), substeps.to_string()];
            for ((_, net), points) in scenes.iter().zip(&mut points) {
                let mut simulation = Simulation::new(net, integrator, SubstepMode::Fixed(substeps), TICK);
                let start = simulation.energy();
                simulation.run(SECONDS * 60);
                let lost = (start - simulation.energy()) / swing_energy(net);
                cells.push(format!("{} %", number(100.0 * lost)));
                cells.push(number(simulation.milliseconds()));
                points.push((simulation.milliseconds(), lost));
            }
            table.row(cells);
        }
        for ((name, _), points) in scenes.iter().zip(points) {
            // As long as the legend is wide.
            let short = name.replace(" N/m", "").replace(", on the", ",");
            lines.push(Line { name: format!("{integrator}, {short}"), points });
        }
    }
    section.table(table);
    let plot = Plot {
        title: format!("Energy that swings of 1e6 N/m lose in {SECONDS} s, against the cost of a tick"),
        x: Axis { label: "ms", logarithmic: true, range: 1e-3..0.5 },
        y: Axis { label: "part of the energy", logarithmic: true, range: 1e-5..2.0 },
        lines,
    };
    lab.show(section, "second-order-swings.png", &plot)
}

/// The sheets of the sweep, and how far they are from the truth.
fn sheets(section: &mut Section) {
    section.paragraph(&format!(
        "**Sheets.** The sheet of 51² of the section on every stiffness falls for {FALL} ticks of 1/60 s: root of the mean square distance to \
         Runge–Kutta in f64. The bar: at least twice nearer than backward Euler, at no more than 1.5 times its cost."
    ));
    let heads = ["scheme", "substeps", "1e6 N/m: error", "ms a tick", "1e7 N/m: error", "ms a tick"];
    let mut table = Table::new(heads);
    let sheets = [1e6, 1e7].map(|stiffness| {
        let net = Net::sheet(51, 0.01, stiffness, 0.0, false);
        let truth = reference::motion(&net, FALL as f64 * f64::from(TICK as f32), 1e-5);
        (net, truth)
    });
    let mut found = Vec::new();
    for integrator in BUILT {
        for substeps in [1, 2] {
            let mut cells = vec![format!("`{integrator}`"), substeps.to_string()];
            for (net, truth) in &sheets {
                let mut simulation = Simulation::new(net, integrator, SubstepMode::Fixed(substeps), TICK);
                simulation.run(FALL);
                let error = root_mean_square(&simulation.positions(), &truth.position);
                cells.push(format!("{} mm", number(1e3 * error)));
                cells.push(number(simulation.milliseconds()));
                found.push((error, simulation.milliseconds()));
            }
            table.row(cells);
        }
    }
    section.table(table);
    let steps = sheets.map(|(_, truth)| format!("{} steps, {} m", truth.steps, number(truth.uncertainty)));
    // Two rows of backward Euler with two sheets each, then those of TR-BDF2.
    let ratios = [0, 1].map(|sheet| {
        let ((first, cost), (second, other)) = (found[2 + sheet], found[4 + sheet]);
        format!("{} times nearer at {} times the cost", number(first / second), number(other / cost))
    });
    section.paragraph(&format!(
        "The references took {} and {} from those with half as many. One step of `TrBdf2`, for two of `ImplicitEuler`: \
         at 10⁶ N/m {}, at 10⁷ N/m {}.",
        steps[0], steps[1], ratios[0], ratios[1]
    ));
}
