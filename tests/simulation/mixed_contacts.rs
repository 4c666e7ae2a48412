//! `Auto` with soft and stiff nets of balls that run into each other: nets that touch take one scheme, and an impact puts no
//! energy into the springs.

use bevy::math::Vec3;
use bevy_mass_spring::solver::{Integrator, PairRules, Solver, Spring, StepSettings, SubstepMode};

use crate::common::bodies::{GRAVITY, falling, with_ground};

const RADIUS: f32 = 0.02;

/// The part of the energy of the fall that may be gained: a step of TR-BDF2 is given up for one of backward Euler where it gains
/// more than so much of the kinetic energy.
const MAX_GAIN: f64 = 1e-3;

/// Nets, and what their energy follows from.
#[derive(Default)]
struct Nets {
    solver: Solver,
    masses: Vec<f32>,
    springs: Vec<([usize; 2], f64, f64)>,
    /// The height below which nothing falls, m.
    lowest: f64,
}

impl Nets {
    fn add_ball(&mut self, mass: f32, place: Vec3) -> usize {
        self.masses.push(mass);
        self.solver.add_particle(place, Vec3::ZERO, mass, RADIUS).unwrap()
    }

    fn add_spring(&mut self, ends: [usize; 2], stiffness: f32, damping: f32) {
        let [one, other] = ends.map(|end| self.solver.position(end));
        let rest_length = one.distance(other);
        let spring = Spring { rest_length, stiffness, damping, ..Spring::default() };
        self.solver.add_spring(ends, spring).unwrap();
        self.springs.push((ends, stiffness.into(), rest_length.into()));
    }

    /// A cube of balls of 20 g, 0.1 m apart, joined to all that are next to them; one corner is at a place.
    fn add_cube(&mut self, side: usize, stiffness: f32, place: Vec3) {
        let first = self.solver.particle_count();
        let cell = |number: usize| [number / side / side, number / side % side, number % side];
        for number in 0..side.pow(3) {
            let offset = Vec3::from_array(cell(number).map(|cell| 0.1 * cell as f32));
            self.add_ball(0.02, place + offset);
            for other in 0..number {
                let is_near = (0..3).all(|axis| cell(number)[axis].abs_diff(cell(other)[axis]) <= 1);
                if is_near {
                    self.add_spring([first + other, first + number], stiffness, 0.5);
                }
            }
        }
    }

    /// A rope of 21 balls of 10 g that touch; its middle is at a place. It may be held at both ends.
    fn add_rope(&mut self, stiffness: f32, place: Vec3, direction: Vec3, is_held: bool) {
        for number in 0..21_u8 {
            let mass = if is_held && number % 20 == 0 { f32::INFINITY } else { 0.01 };
            let place = place + direction * 0.04 * (f32::from(number) - 10.0);
            let slot = self.add_ball(mass, place);
            if number > 0 {
                self.add_spring([slot - 1, slot], stiffness, 0.1);
            }
        }
    }

    /// Of motion, weight and all springs, J.
    fn energy(&self) -> f64 {
        let free = (0..).zip(&self.masses).filter(|(_, mass)| mass.is_finite());
        let own = free.map(|(slot, mass)| {
            let height = f64::from(self.solver.position(slot).y) - self.lowest;
            let speed = self.solver.velocity(slot).as_dvec3().length();
            f64::from(*mass) * (0.5 * speed * speed + f64::from(GRAVITY) * height)
        });
        let elastic = self.springs.iter().map(|([one, other], stiffness, rest_length)| {
            let [one, other] = [one, other].map(|end| self.solver.position(*end).as_dvec3());
            0.5 * stiffness * (one.distance(other) - rest_length).powi(2)
        });
        own.sum::<f64>() + elastic.sum::<f64>()
    }

    /// Steps, and looks that no energy is gained; that there are two schemes at first, and one where nets touch.
    fn fall(mut self, ticks: u32, what: &str) {
        let settings = StepSettings {
            substeps: SubstepMode::Auto,
            pair_rules: Some(PairRules { restitution: 0.0, friction: 0.0 }),
            ..falling(Integrator::Auto, 1)
        };
        let start = self.energy();
        let (mut divided, mut joined, mut contacts) = (0, 0, 0);
        for tick in 0..ticks {
            self.solver.step(&settings);
            let outputs = self.solver.outputs();
            let is_divided = outputs.plan.stiff_substeps > 0;
            (divided, joined) = (divided + u32::from(is_divided), joined + u32::from(!is_divided));
            contacts += outputs.contact_count;
            let energy = self.energy();
            assert!(energy < (1.0 + MAX_GAIN) * start, "{what}, tick {tick}: {energy} J of {start} J");
            assert!(tick > 0 || is_divided, "{what}: {:?}", outputs.plan);
        }
        assert!(divided > 5 && joined > 5 && contacts > 20, "{what}: {divided} {joined} {contacts}");
    }
}

#[test]
fn a_soft_cube_and_a_stiff_one_that_falls_on_it_gain_no_energy() {
    for stiffness in [1e6, 1e7, 1e8, 1e9] {
        for soft_falls in [true, false] {
            let mut nets = Nets { solver: with_ground(Solver::default(), 0.0, 0.0), ..Nets::default() };
            nets.lowest = RADIUS.into();
            let (low, high) = (Vec3::Y * RADIUS, Vec3::new(0.02, 0.52, 0.01));
            let (soft, stiff) = if soft_falls { (high, low) } else { (low, high) };
            nets.add_cube(3, stiffness, stiff);
            nets.add_cube(2, 1e4, soft);
            nets.fall(90, &format!("{stiffness} N/m, the soft one falls: {soft_falls}"));
        }
    }
}

/// One is held at its ends, the other falls across it.
#[test]
fn a_soft_rope_and_a_stiff_one_across_it_gain_no_energy() {
    for (soft, stiff) in [(1e3, 1e6), (1e4, 1e6), (1e4, 1e7), (1e3, 1e8), (1e4, 1e8)] {
        for soft_falls in [true, false] {
            // In a second nothing falls by more than 5 m.
            let mut nets = Nets { lowest: 1.0 - 0.5 * f64::from(GRAVITY), ..Nets::default() };
            let [held, falls] = if soft_falls { [stiff, soft] } else { [soft, stiff] };
            nets.add_rope(held, Vec3::Y, Vec3::X, true);
            nets.add_rope(falls, Vec3::Y * 1.3, Vec3::Z, false);
            nets.fall(60, &format!("{soft} and {stiff} N/m, the soft one falls: {soft_falls}"));
        }
    }
}
