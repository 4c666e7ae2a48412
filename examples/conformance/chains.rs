//! The chain of *XPBD: Position-Based Simulation of Compliant Constrained Dynamics* (2016).

use std::error::Error;

use bevy::math::DVec3;

use crate::Lab;
use crate::document::{Section, Table, number};
use crate::net::{GRAVITY, Net};
use crate::simulation::{Simulation, integrators};

const LINKS: usize = 20;
const TICK: f64 = 1.0 / 60.0;

pub fn run(_lab: &mut Lab) -> Result<Section, Box<dyn Error>> {
    let net = Net::strand(LINKS, 0.1, DVec3::NEG_Y, 1.0, |_| 1e5, 1e3);
    let top = LINKS as f64 * GRAVITY;
    let mut section = Section::titled("A chain of 20 kg");
    section.paragraph(&format!(
        "20 particles of 1 kg hang from each other by links of 0.1 m and 10⁵ N/m (and 1,000 N·s/m, so that \
         what conserves energy settles, too), for 10 s in ticks of 1/60 s. Each link must carry what hangs \
         below it, the top one {} N. Macklin, Müller and Chentanez report errors of the top force of 6, 2 and \
         0.5 % with 50, 100 and 1,000 iterations of XPBD. The bar: every link within 0.2 % of the top force. \
         (Rounding positions of 2 m to f32 makes up to 0.02 N, 0.012 %.)",
        number(top)
    ));
    let mut table = Table::new([
        "scheme",
        "substeps",
        "error of the top force",
        "largest error, of the top force",
        "ms a tick",
    ]);
    for integrator in integrators() {
        let mut simulation = Simulation::stable(&net, integrator, TICK);
        simulation.run(600);
        let tensions = net.tensions(&simulation.positions());
        let error = |link: usize| (tensions[link].y - (LINKS - link) as f64 * GRAVITY).abs() / top;
        let largest = (0..LINKS).map(error).fold(0.0, f64::max);
        table.row([
            format!("`{integrator}`"),
            simulation.choice(),
            format!("{} %", number(error(0) * 100.0)),
            format!("{} %", number(largest * 100.0)),
            number(simulation.milliseconds()),
        ]);
    }
    section.table(table);
    Ok(section)
}
