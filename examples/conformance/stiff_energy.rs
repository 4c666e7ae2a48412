//! Slow motions of stiff nets: what the implicit schemes leave of their energy, and where they are.

use std::error::Error;

use bevy::math::DVec3;
use bevy_mass_spring::settings::{Integrator, SubstepMode};

use crate::Lab;
use crate::document::{Section, Table, number};
use crate::findings::STIFF_SWING;
use crate::net::{GRAVITY, Net};
use crate::simulation::Simulation;

pub const TICK: f64 = 1.0 / 60.0;
pub const SECONDS: usize = 20;
const STIFFNESSES: [f64; 6] = [1e4, 1e5, 1e6, 1e7, 1e8, 1e9];
/// With these substeps the two named schemes solve for as many stages.
const RUNS: [(Integrator, SubstepMode); 3] = [
    (Integrator::ImplicitEuler, SubstepMode::Fixed(4)),
    (Integrator::TrBdf2, SubstepMode::Fixed(2)),
    (Integrator::Auto, SubstepMode::Auto),
];

pub fn run(lab: &mut Lab) -> Result<Section, Box<dyn Error>> {
    let mut section = Section::titled("Energy of stiff nets");
    section.paragraph(&format!(
        "Let go taut, 60° from the vertical, nothing damped, ticks of 1/60 s: a pendulum of 1 kg on a spring of 1 m; a \
         rope of 20 links of 0.1 m and 0.1 kg; and 10 kg on such a rope with links of 0.01 kg. Given is what is left \
         after {SECONDS} s of the energy that each has above hanging at rest; the bar is 97 % under `Auto`. A rope \
         or load on 10⁴ N/m has part of it in oscillations along the springs, which a scheme that does not resolve \
         them takes."
    ));
    for (name, net) in [
        ("pendulum", swing as fn(f64) -> Net),
        ("rope", |stiffness| rope(0.1, 0.1, stiffness)),
        ("load", |stiffness| rope(0.01, 10.0, stiffness)),
    ] {
        let heads = STIFFNESSES.map(|stiffness| format!("{stiffness:.0e} N/m"));
        let mut table = Table::new([name.to_owned()].into_iter().chain(heads));
        for (integrator, substeps) in RUNS {
            let mut cells = vec![format!("`{integrator}`")];
            for stiffness in STIFFNESSES {
                let (kept, choice) = energy_kept(&net(stiffness), integrator, substeps);
                if name == "load" && stiffness == 1e6 {
                    lab.findings.note(STIFF_SWING, integrator, format!("{} %", number(kept)));
                }
                cells.push(format!("{} % ({choice})", number(kept)));
            }
            table.row(cells);
        }
        section.table(table);
    }
    Ok(section)
}

pub fn swing(stiffness: f64) -> Net {
    Net::strand(1, 1.0, direction(), 1.0, |_| stiffness, 0.0)
}

pub fn rope(mass: f64, load: f64, stiffness: f64) -> Net {
    let mut net = Net::strand(20, 0.1, direction(), mass, |_| stiffness, 0.0);
    net.set_mass(20, load);
    net
}

/// 60° from the vertical.
fn direction() -> DVec3 {
    DVec3::new(0.75_f64.sqrt(), -0.5, 0.0)
}

/// %, and the substeps or what `Auto` chose.
fn energy_kept(net: &Net, integrator: Integrator, substeps: SubstepMode) -> (f64, String) {
    let mut simulation = Simulation::new(net, integrator, substeps, TICK);
    let start = simulation.energy();
    simulation.run(SECONDS * 60);
    (100.0 * (1.0 + (simulation.energy() - start) / swing_energy(net)), simulation.choice())
}

/// What `net`, taut and 60° from the vertical, has above hanging straight down, where each particle is twice as deep, as cos 60°
/// = 1/2; J.
pub fn swing_energy(net: &Net) -> f64 {
    let heights = net.position.iter().zip(&net.inverse_mass).filter(|(_, inverse)| **inverse > 0.0);
    heights.map(|(position, inverse)| -position.y * GRAVITY / inverse).sum()
}
