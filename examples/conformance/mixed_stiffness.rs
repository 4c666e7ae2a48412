//! Soft and stiff parts in one scene: what `Auto` takes for each, and what that is worth.

use std::error::Error;

use bevy::math::DVec3;
use bevy_mass_spring::settings::{Integrator, SubstepMode};

use crate::Lab;
use crate::document::{Section, Table, number};
use crate::net::{Net, root_mean_square};
use crate::reference;
use crate::simulation::Simulation;

const TICK: f64 = 1.0 / 60.0;
const TICKS: usize = 30;
/// Particles along an edge of the cloth.
const SIDE: usize = 21;
const LINKS: usize = 20;
const SOFT: f64 = 1e3;

/// Named schemes beside `Auto`.
const RUNS: [(Integrator, SubstepMode); 6] = [
    (Integrator::Auto, SubstepMode::Auto),
    (Integrator::SemiImplicitEuler, SubstepMode::Auto),
    (Integrator::VelocityVerlet, SubstepMode::Auto),
    (Integrator::ImplicitEuler, SubstepMode::Fixed(2)),
    (Integrator::TrBdf2, SubstepMode::Fixed(1)),
    (Integrator::TrBdf2, SubstepMode::Fixed(2)),
];

pub fn run(_: &mut Lab) -> Result<Section, Box<dyn Error>> {
    let mut section = Section::titled("Soft and stiff parts in one scene");
    section.paragraph(&format!(
        "A cloth of {SIDE}² particles of 10 g, 0.1 m apart, structural and shear springs of 10³ N/m, let go from horizontal with two \
         corners pinned; and a rope of {LINKS} links of 0.1 m, particles of 50 g, of 10⁵, 10⁷ and 10⁸ N/m: hanging from the middle \
         of the free edge (one island), or beside the cloth from an end of its own, taut and 60° from the vertical (two islands). \
         Nothing is damped. Errors are root mean square distances to Runge–Kutta in f64 after {TICKS} ticks of 1/60 s, \
         separately for cloth and rope; the cost is the median of a tick. Explicit schemes take the substeps that the \
         stability bound asks for, which is that of the whole scene."
    ));
    let mut uncertainty = 0.0_f64;
    for (title, net) in [("One island", hung as fn(f64) -> Net), ("Two islands", beside as fn(f64) -> Net)] {
        for stiffness in [1e5, 1e7, 1e8] {
            let net = net(stiffness);
            let truth = reference::motion(&net, TICKS as f64 * f64::from(TICK as f32), 1e-5);
            uncertainty = uncertainty.max(truth.uncertainty);
            let head = format!("{title}, {stiffness:.0e} N/m");
            let mut table = Table::new([&*head, "what ran", "cloth: error", "rope: error", "ms a tick"]);
            for (integrator, substeps) in RUNS {
                let mut simulation = Simulation::new(&net, integrator, substeps, TICK);
                simulation.run(TICKS);
                let found = simulation.positions();
                let error = |slots: std::ops::Range<usize>| {
                    let error = root_mean_square(&found[slots.clone()], &truth.position[slots]);
                    format!("{} mm", number(1e3 * error))
                };
                let (cloth, rope) = (error(0..SIDE * SIDE), error(SIDE * SIDE..found.len()));
                let label = format!("`{integrator}`");
                table.row([label, simulation.choice(), cloth, rope, number(simulation.milliseconds())]);
            }
            section.table(table);
        }
    }
    section.paragraph(&format!(
        "The references are {} m from those with half as many steps at most.",
        number(uncertainty)
    ));
    Ok(section)
}

fn cloth() -> Net {
    Net::sheet(SIDE, 0.01, SOFT, 0.0, false)
}

/// The rope hangs from the middle of the free edge.
fn hung(stiffness: f64) -> Net {
    let mut net = cloth();
    let edge = SIDE * (SIDE - 1) + SIDE / 2;
    let top = net.position[edge];
    net.add_rope(Some(edge), top, DVec3::NEG_Y * 0.1, LINKS, 0.05, stiffness);
    net
}

/// The rope hangs from a pinned particle 3 m beside the cloth.
fn beside(stiffness: f64) -> Net {
    let mut net = cloth();
    let direction = DVec3::new(0.75_f64.sqrt(), -0.5, 0.0) * 0.1;
    net.add_rope(None, DVec3::X * 5.0, direction, LINKS, 0.05, stiffness);
    net
}
