//! The chain of *Small Steps in Physics Simulation* (2019): a hundred tons on links of a kilogram.

use std::error::Error;

use bevy::math::DVec3;
use bevy_mass_spring::settings::Integrator;

use crate::Lab;
use crate::document::{Section, Table, number};
use crate::findings::HEAVY;
use crate::net::{GRAVITY, Net};
use crate::reference;
use crate::simulation::{Simulation, integrators};

const LINKS: usize = 20;
const TICK: f64 = 1.0 / 60.0;
/// A quarter of a period is 50.
const SWING_TICKS: usize = 75;

pub fn run(lab: &mut Lab) -> Result<Section, Box<dyn Error>> {
    let mut section = Section::titled("A hundred tons on a chain of 20 kg");
    // The link to the heavy end carries 10⁵ kg, those above a kilogram more each.
    let carried: f64 = (0..LINKS).map(|above| 1e5 + above as f64).sum();
    let equilibrium = -(0.1 * LINKS as f64) - carried * GRAVITY / 1e9;
    let rigid = 1.854_074_677 * (2.0 / GRAVITY).sqrt();
    let (truth, uncertainty) = true_swing();
    section.paragraph(&format!(
        "20 links of 0.1 m and 10⁹ N/m, particles of 1 kg and at the end 100,000 kg; nothing is damped, ticks \
         of 1/60 s. Hanging straight down, the end belongs at {equilibrium:.4} m; given is how far from there it \
         is after 5 s (the bar: 0.03 m; an undamped end bobs by 0.02 m about it). Macklin et al. report 322 and \
         3.2 m for theirs. Let go from horizontal, a rigid pendulum would be lowest, 2.0 m below, after \
         K(1/√2) √(L/g) = {rigid:.3} s; this elastic one after {:.4} s, {:.4} m below, by Runge–Kutta in f64 \
         ({} s and {} m from that with half as many steps). The bar: 0.837 s and 2.0 m, 3 % of each.",
        truth.time,
        truth.depth,
        number(uncertainty.time),
        number(uncertainty.depth)
    ));
    let mut table =
        Table::new(["scheme", "substeps", "off after 5 s", "lowest at", "lowest point", "ms a tick"]);
    for integrator in integrators() {
        let off = hang(integrator, equilibrium);
        let (swing, cost) = swing(integrator);
        lab.findings.note(HEAVY, integrator, off.clone());
        table.row([
            format!("`{integrator}`"),
            cost.choice,
            off,
            if swing.depth.is_finite() { format!("{:.3} s", swing.time) } else { "explodes".to_owned() },
            if swing.depth.is_finite() { format!("{:.3} m", swing.depth) } else { String::new() },
            number(cost.milliseconds),
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

/// The first lowest point of the end.
struct Swing {
    /// s
    time: f64,
    /// m
    depth: f64,
}

struct Cost {
    choice: String,
    milliseconds: f64,
}

fn swing(integrator: Integrator) -> (Swing, Cost) {
    let mut simulation = Simulation::stable(&net(DVec3::X), integrator, TICK);
    let mut heights = vec![0.0];
    for _ in 0..SWING_TICKS {
        simulation.run(1);
        heights.push(simulation.position(LINKS).y);
    }
    let cost = Cost { choice: simulation.choice(), milliseconds: simulation.milliseconds() };
    (lowest(&heights), cost)
}

/// The swing in f64, and how much it differs from that with half as many steps.
fn true_swing() -> (Swing, Swing) {
    let run = |refinement: usize| {
        let mut net = net(DVec3::X);
        let steps = refinement * reference::least_steps(&net, TICK);
        let mut heights = vec![0.0];
        for _ in 0..SWING_TICKS {
            reference::advance(&mut net, TICK, steps);
            heights.push(net.position[LINKS].y);
        }
        lowest(&heights)
    };
    let (coarse, fine) = (run(2), run(4));
    let uncertainty =
        Swing { time: (coarse.time - fine.time).abs(), depth: (coarse.depth - fine.depth).abs() };
    (fine, uncertainty)
}

/// The lowest of heights at every tick; between ticks by the parabola through three of them.
fn lowest(heights: &[f64]) -> Swing {
    let lowest = (1..heights.len() - 1).min_by(|a, b| heights[*a].total_cmp(&heights[*b])).unwrap_or(1);
    let [before, at, after] = [heights[lowest - 1], heights[lowest], heights[lowest + 1]];
    let bend = before - 2.0 * at + after;
    let shift = if bend > 0.0 { 0.5 * (before - after) / bend } else { 0.0 };
    let all_finite = heights.iter().all(|height| height.is_finite());
    let depth = if all_finite { 0.25 * (before - after) * shift - at } else { f64::NAN };
    Swing { time: (lowest as f64 + shift) * TICK, depth }
}
