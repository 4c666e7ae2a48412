//! Stiff nets that fall onto the ground.

use std::error::Error;

use bevy::math::Vec3;
use bevy_mass_spring::settings::{Integrator, SubstepMode};
use bevy_mass_spring::solver::{Collider, Solver, Spring, StepSettings};

use crate::Lab;
use crate::document::{Section, Table, number};

const TICK: f32 = 1.0 / 60.0;
const GRAVITY: f32 = 9.81;
const SPACING: f32 = 0.1;
const HEIGHT: f32 = 1.5;
const MASS: f32 = 0.02;
const RADIUS: f32 = 0.02;
const STIFFNESSES: [f32; 4] = [1e4, 1e6, 1e7, 1e9];
const SHAPES: [(&str, [usize; 3]); 3] = [("2³", [2, 2, 2]), ("8 × 2 × 2", [8, 2, 2]), ("5³", [5, 5, 5])];

/// The schemes, and their substeps.
const RUNS: [(Integrator, SubstepMode); 5] = [
    (Integrator::Auto, SubstepMode::Auto),
    (Integrator::ImplicitEuler, SubstepMode::Fixed(1)),
    (Integrator::TrBdf2, SubstepMode::Fixed(2)),
    (Integrator::Xpbd, SubstepMode::Fixed(20)),
    (Integrator::Xpbd, SubstepMode::Fixed(100)),
];

pub fn run(_: &mut Lab) -> Result<Section, Box<dyn Error>> {
    let mut section = Section::titled("Stiff nets on the ground");
    section.paragraph(&format!(
        "Lattices of springs (neighbours and diagonals; points of {MASS} kg, {SPACING} m apart, damped by 0.5 N·s/m) fall \
         {HEIGHT} m onto the ground, ticks of 1/60 s. Given is the most elastic energy that they ever have, as a part \
         of what the fall brought, and after 5 s the force of their contacts as a part of their weight. More than \
         1 is energy from nowhere. The implicit schemes solve contacts within their steps. Position-based dynamics \
         lifts the lowest points in each of its substeps and spreads that by one round over the springs: it needs \
         many of them for stiff nets, and what it puts into the springs is gone in the next ones."
    ));
    for (name, size) in SHAPES {
        let heads = STIFFNESSES.map(|stiffness| format!("{stiffness:.0e} N/m"));
        let mut table = Table::new([name.to_owned()].into_iter().chain(heads));
        for (integrator, substeps) in RUNS {
            let label = match substeps {
                SubstepMode::Fixed(count) => format!("`{integrator}` × {count}"),
                _ => format!("`{integrator}`"),
            };
            let cells = STIFFNESSES.map(|stiffness| drop_lattice(size, stiffness, integrator, substeps));
            table.row([label].into_iter().chain(cells));
        }
        section.table(table);
    }
    Ok(section)
}

fn drop_lattice(size: [usize; 3], stiffness: f32, integrator: Integrator, substeps: SubstepMode) -> String {
    let mut solver = lattice(size, stiffness);
    let gravity = Vec3::NEG_Y * GRAVITY;
    let settings = StepSettings { integrator, substeps, gravity, time_step: TICK, ..StepSettings::default() };
    let weight = f64::from(MASS * GRAVITY) * solver.particle_count() as f64;
    let (mut most, ticks) = (0.0_f64, 300);
    for tick in 1..=ticks {
        solver.outputs_mut().record_contacts = tick == ticks;
        solver.step(&settings);
        most = most.max(solver.measure(gravity).elastic_energy);
    }
    let contacts = &solver.outputs().contacts;
    let impulse: f64 = contacts.iter().map(|contact| f64::from(contact.impulse * contact.normal.y)).sum();
    let carried = impulse / f64::from(TICK) / weight;
    format!("{} / {}", number(most / (weight * f64::from(HEIGHT))), number(carried))
}

fn lattice([nx, ny, nz]: [usize; 3], stiffness: f32) -> Solver {
    let mut solver = Solver::default();
    let places = (0..nx).flat_map(|i| (0..ny).flat_map(move |j| (0..nz).map(move |k| [i, j, k])));
    for place in places {
        let position = Vec3::from(place.map(|number| number as f32)) * SPACING + Vec3::Y * (HEIGHT + RADIUS);
        solver.add_particle(position, Vec3::ZERO, MASS, RADIUS).expect("the lattice is valid");
    }
    for first in 0..solver.particle_count() {
        for second in first + 1..solver.particle_count() {
            let apart = solver.position(second) - solver.position(first);
            if apart.abs().max_element() < 1.5 * SPACING {
                let spring =
                    Spring { rest_length: apart.length(), stiffness, damping: 0.5, ..Spring::default() };
                solver.add_spring([first, second], spring).expect("the lattice is valid");
            }
        }
    }
    solver.add_collider(Collider::half_space(Vec3::ZERO, Vec3::Y, 0.0, 0.0));
    solver
}
