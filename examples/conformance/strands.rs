//! The strands of *Vertex Block Descent* (2024): very stiff with a heavy end, and stiff and soft by turns.

use std::error::Error;

use bevy::math::DVec3;

use crate::Lab;
use crate::document::{Section, Table, number};
use crate::findings::STRETCH;
use crate::net::{GRAVITY, Net, gravity};
use crate::plot::{Axis, Line, Plot};
use crate::simulation::{Simulation, integrators};

const LINKS: usize = 20;
const LENGTH: f64 = 0.1_f32 as f64;
const TICK: f64 = 1.0 / 60.0;
/// kg, of each particle of the mixed strand.
const MASS: f64 = 100.0;

pub fn run(lab: &mut Lab) -> Result<Section, Box<dyn Error>> {
    let mut section = Section::titled("Stiff strands");
    section.paragraph(&format!(
        "20 links of 0.1 m and 10⁸ N/m, particles of 0.1 kg, at the end 1,000 kg, let go from horizontal, \
         undamped, 10 s in ticks of 1/60 s: the largest stretch of any link at the end of any tick (the bar: \
         2 %; at rest it would be {} %). The motion is chaotic once the strand goes slack, so there is no \
         reference to converge to.",
        number(1000.0 * GRAVITY / 1e8 / 0.1 * 100.0)
    ));
    let mut table = Table::new(["scheme", "substeps", "largest stretch", "ms a tick"]);
    let mut net = Net::strand(LINKS, 0.1, DVec3::X, 0.1, |_| 1e8, 0.0);
    net.set_mass(LINKS, 1000.0);
    for integrator in integrators() {
        let mut simulation = Simulation::stable(&net, integrator, TICK);
        let mut largest: f64 = 0.0;
        for _ in 0..600 {
            simulation.run(1);
            let stretch = simulation.solver.measure(gravity()).max_stretch;
            largest = if simulation.is_finite() { largest.max(stretch) } else { f64::INFINITY };
            if !largest.is_finite() {
                break;
            }
        }
        let stretch =
            if largest.is_finite() { format!("{} %", number(largest * 100.0)) } else { "explodes".into() };
        lab.findings.note(STRETCH, integrator, stretch.clone());
        let choice = simulation.choice();
        table.row([format!("`{integrator}`"), choice, stretch, number(simulation.milliseconds())]);
    }
    section.table(table);
    mixed(lab, &mut section)?;
    Ok(section)
}

/// The strand of soft and stiff links.
fn mixed(lab: &Lab, section: &mut Section) -> Result<(), Box<dyn Error>> {
    let mut net = Net::strand(LINKS, 0.1, DVec3::X, MASS, |link| [1e4, 1e8][link % 2], 2e3);
    net.viscosity = 100.0;
    net.set_mass(LINKS, f64::INFINITY);
    let truth = horizontal_tension();
    section.paragraph(&format!(
        "20 links of 0.1 m, by turns of 10⁴ and 10⁸ N/m and 2,000 N·s/m, particles of 100 kg in a medium of 100 \
         N·s/m, pinned at both ends 2 m apart, for 60 s in ticks of 1/60 s. At rest the horizontal tension is the same in every link: {} \
         N, from the equilibrium of the elastic polygon, solved in f64 by bisection to rounding. The bar: \
         equal within 2 %. (Rounding two positions makes up to 24 N in a stiff link.)",
        number(truth)
    ));
    let mut table = Table::new(["scheme", "substeps", "mean tension", "largest deviation from the true one"]);
    let mut lines = Vec::new();
    for integrator in integrators() {
        let mut simulation = Simulation::stable(&net, integrator, TICK);
        simulation.run(3600);
        let pulls: Vec<f64> =
            net.tensions(&simulation.positions()).iter().map(|tension| tension.x.abs()).collect();
        let mean = pulls.iter().sum::<f64>() / LINKS as f64;
        let worst = pulls.iter().map(|pull| (pull / truth - 1.0).abs()).fold(0.0, f64::max);
        let choice = simulation.choice();
        let cells = if mean.is_finite() {
            [format!("{} N", number(mean)), format!("{} %", number(worst * 100.0))]
        } else {
            ["explodes".to_owned(), String::new()]
        };
        table.row([format!("`{integrator}`"), choice].into_iter().chain(cells));
        let points = pulls.iter().enumerate().map(|(link, pull)| (link as f64 + 1.0, *pull)).collect();
        lines.push(Line { name: integrator.to_string(), points });
    }
    section.table(table);
    let plot = Plot {
        title: "Horizontal tension along the strand of 1e4 and 1e8 N/m".to_owned(),
        x: Axis { label: "link", logarithmic: false, range: 0.0..LINKS as f64 + 1.0 },
        y: Axis { label: "N", logarithmic: false, range: 0.9 * truth..1.1 * truth },
        lines,
    };
    lab.show(section, "mixed-strand.png", &plot)
}

/// The horizontal tension H of the mixed strand at rest.
///
/// A link with the vertical tension V has the tension T = √(H² + V²) and the length l0 + T/k, of which
/// H/T is horizontal and V/T vertical; V falls by a weight from link to link. H is found such that the
/// horizontal parts add up to the span, the V of the first link such that the vertical ones cancel.
fn horizontal_tension() -> f64 {
    let polygon = |horizontal: f64, first: f64| {
        let (mut across, mut down) = (0.0, 0.0);
        for link in 0..LINKS {
            let vertical = first - link as f64 * MASS * GRAVITY;
            let tension = horizontal.hypot(vertical);
            let length = LENGTH + tension / [1e4, 1e8][link % 2];
            across += length * horizontal / tension;
            down += length * vertical / tension;
        }
        (across, down)
    };
    let weight = LINKS as f64 * MASS * GRAVITY;
    let first = |horizontal: f64| bisect(0.0, weight, |first| polygon(horizontal, first).1 > 0.0);
    let span = LINKS as f64 * LENGTH;
    bisect(1e-3, 1e6, |horizontal| polygon(horizontal, first(horizontal)).0 > span)
}

/// Where `is_above` turns true between `low` and `high`.
fn bisect(mut low: f64, mut high: f64, is_above: impl Fn(f64) -> bool) -> f64 {
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if is_above(middle) { high = middle } else { low = middle }
    }
    0.5 * (low + high)
}
