//! The chain of *Small Steps in Physics Simulation* (2019): a hundred tons on links of a kilogram.

use std::error::Error;

use bevy::math::DVec3;
use bevy_mass_spring::settings::Integrator;

use crate::Lab;
use crate::document::{Section, Table, number};
use crate::net::{GRAVITY, Net};
use crate::simulation::{Simulation, integrators};

const LINKS: usize = 20;
const TICK: f64 = 1.0 / 60.0;

pub fn run(lab: &mut Lab) -> Result<Section, Box<dyn Error>> {
    let mut section = Section::titled("A hundred tons on a chain of 20 kg");
    // The link to the heavy end carries 10⁵ kg, those above a kilogram more each.
    let carried: f64 = (0..LINKS).map(|above| 1e5 + above as f64).sum();
    let equilibrium = -(0.1 * LINKS as f64) - carried * GRAVITY / 1e9;
    let expected = 1.854_074_677 * (2.0 / GRAVITY).sqrt();
    section.paragraph(&format!(
        "20 links of 0.1 m and 10⁹ N/m, particles of 1 kg and at the end 100,000 kg; nothing is damped, ticks \
         of 1/60 s. Hanging straight down, the end belongs at {equilibrium:.4} m; given is how far from there it \
         is after 5 s (the bar: 0.03 m; an undamped end bobs by 0.02 m about it). Macklin et al. report 322 m \
         with iterations and 3.2 m with substeps, of a chain of 20 m. Let go from horizontal, the chain is a \
         pendulum of 2 m: its lowest point, 2.0 m below, comes after K(1/√2) √(L/g) = {expected:.3} s (the bar: \
         3 % of each).",
    ));
    let mut table =
        Table::new(["scheme", "substeps", "off after 5 s", "lowest at", "lowest point", "ms a tick"]);
    for integrator in integrators() {
        let off = hang(integrator, equilibrium);
        let swing = swing(integrator);
        lab.findings.note("100,000 kg on 1 kg links: off by", integrator, off.clone());
        table.row([
            format!("`{integrator}`"),
            swing.choice,
            off,
            format!("{:.3} s", swing.time),
            format!("{} m", number(swing.depth)),
            number(swing.milliseconds),
        ]);
    }
    section.table(table);
    Ok(section)
}

fn net(direction: DVec3) -> Net {
    let mut net = Net::strand(LINKS, 0.1, direction, 1.0, |_| 1e9, 0.0);
    net.set_mass(LINKS, 1e5);
    net
}

fn hang(integrator: Integrator, equilibrium: f64) -> String {
    let mut simulation = Simulation::stable(&net(DVec3::NEG_Y), integrator, TICK);
    simulation.run(300);
    let off = simulation.position(LINKS).distance(DVec3::Y * equilibrium);
    if off.is_finite() { format!("{} m", number(off)) } else { "explodes".to_owned() }
}

struct Swing {
    choice: String,
    time: f64,
    depth: f64,
    milliseconds: f64,
}

/// The first lowest point; between ticks by the parabola through three of them.
fn swing(integrator: Integrator) -> Swing {
    let mut simulation = Simulation::stable(&net(DVec3::X), integrator, TICK);
    let mut heights = vec![0.0];
    for _ in 0..75 {
        simulation.run(1);
        heights.push(simulation.position(LINKS).y);
    }
    let lowest = (1..heights.len() - 1).min_by(|a, b| heights[*a].total_cmp(&heights[*b])).unwrap_or(1);
    let [before, at, after] = [heights[lowest - 1], heights[lowest], heights[lowest + 1]];
    let bend = before - 2.0 * at + after;
    let shift = if bend > 0.0 { 0.5 * (before - after) / bend } else { 0.0 };
    Swing {
        choice: simulation.choice(integrator),
        time: (lowest as f64 + shift) * TICK,
        depth: -(at - 0.25 * (before - after) * shift),
        milliseconds: simulation.milliseconds(),
    }
}
