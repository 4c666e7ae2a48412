//! Ropes that are paid out and taken in while they run.

use bevy::math::Vec3;
use bevy_mass_spring::nets::{Layout, Spool, Topology};
use bevy_mass_spring::solver::{Bend, Integrator, Solver, Spring, StepSettings, SubstepMode};

const LINK: f32 = 0.1;
const DENSITY: f32 = 0.2;
const LOAD: f32 = 1.0;

/// A rope of `links` links of 0.1 m, EA = 2000 N, 0.2 kg/m, with a load of 1 kg at its end.
fn rope(links: u32) -> Topology {
    let link = Spring::elastic(LINK, 2e4, 20.0);
    let straight = Bend { stiffness: 0.01, weights: [1.0, -2.0, 1.0], ..Bend::default() };
    let mut masses = vec![DENSITY * LINK; links as usize + 1];
    masses[0] = 0.5 * DENSITY * LINK;
    masses[links as usize] = 0.5 * DENSITY * LINK + LOAD;
    Topology {
        positions: (0..=links).map(|number| Vec3::NEG_Y * (number as f32 * LINK)).collect(),
        masses,
        springs: (0..links).map(|number| ([number, number + 1], link)).collect(),
        rods: (0..links - 1).map(|number| ([number, number + 1, number + 2], straight)).collect(),
        layout: Layout::Rope { is_closed: false },
        ..Topology::default()
    }
}

/// A rope in the solver, its winch at the origin.
struct Crane {
    solver: Solver,
    topology: Topology,
    spool: Spool,
    positions: Vec<Vec3>,
    velocities: Vec<Vec3>,
    settings: StepSettings,
}

impl Crane {
    fn new(links: u32, integrator: Integrator, substeps: SubstepMode) -> Self {
        let topology = rope(links);
        let spool = Spool::new(&topology).unwrap();
        let gravity = Vec3::new(0.0, -9.81, 0.0);
        let settings = StepSettings { integrator, substeps, gravity, ..StepSettings::default() };
        let mut positions = topology.positions.clone();
        // Stretched as the statics say.
        for number in 1..positions.len() {
            let below: f32 = topology.masses[number..].iter().sum();
            positions[number] = positions[number - 1] + Vec3::NEG_Y * LINK * (1.0 + below * 9.81 / 2000.0);
        }
        let velocities = vec![Vec3::ZERO; positions.len()];
        let mut crane = Self { solver: Solver::default(), topology, spool, positions, velocities, settings };
        crane.lay_out();
        crane
    }

    /// Fills a new solver.
    fn lay_out(&mut self) {
        let mut solver = Solver::default();
        for (number, position) in self.positions.iter().enumerate() {
            let is_held = self.spool.held().contains(&(number as u32));
            let mass = if is_held { f32::INFINITY } else { self.topology.masses[number] };
            solver.add_particle(*position, self.velocities[number], mass, 0.0).unwrap();
        }
        for (ends, spring) in &self.topology.springs {
            solver.add_spring(ends.map(|end| end as usize), *spring).unwrap();
        }
        solver.outputs_mut().record_forces = true;
        self.solver = solver;
    }

    /// A tick in which the winch turns by `speed` m/s; the tension of the first link at its end, N.
    fn tick(&mut self, speed: f64) -> f64 {
        let time_step = f64::from(self.settings.time_step);
        let Self { topology, positions, velocities, spool, .. } = self;
        spool.turn(speed * time_step, time_step, topology, positions, velocities);
        for (number, (_, spring)) in topology.springs.iter().enumerate() {
            if self.solver.spring(number).1 != *spring {
                self.solver.set_spring(number, *spring).unwrap();
            }
        }
        for number in 0..positions.len() {
            let is_held = spool.held().contains(&(number as u32));
            let mass = if is_held { f32::INFINITY } else { topology.masses[number] };
            self.solver.set_mass(number, mass).unwrap();
            self.solver.inputs_mut().pinned.retain(|motion| motion.slot != number);
            if is_held {
                self.solver.move_pinned(number, positions[number]);
            } else if self.solver.velocity(number) != velocities[number] {
                self.solver.set_velocity(number, velocities[number]);
            }
        }
        let (first, _) = spool.first_link();
        let tension = self.solver.step(&self.settings).tensions[first as usize];
        for number in 0..positions.len() {
            positions[number] = self.solver.position(number);
            velocities[number] = self.solver.velocity(number);
        }
        f64::from(tension)
    }

    /// The rest lengths of what is outside, as the solver has them, m.
    fn rest_length(&self) -> f64 {
        let springs = (0..self.solver.spring_count()).map(|number| self.solver.spring(number).1);
        springs.filter(|spring| spring.stiffness > 0.0).map(|spring| f64::from(spring.rest_length)).sum()
    }

    /// What hangs on the first link, N: rope outside below its middle, and the load.
    fn weight(&self) -> f64 {
        (f64::from(LOAD) + f64::from(DENSITY) * self.spool.length()) * 9.81
    }
}

/// The speed of a winch that starts and stops smoothly: 0.4 m/s within a second.
fn ramp(tick: u32, up: u32, top: f64) -> f64 {
    top * (f64::from(tick) / f64::from(up)).min(1.0)
}

/// The bars: the length within 1 mm of L₀ ± v t, tension steps under 5 % as links come and go.
fn run(top: f64, ticks: u32, integrator: Integrator, substeps: SubstepMode) {
    let mut crane = Crane::new(20, integrator, substeps);
    if top > 0.0 {
        // Take in most of it first.
        for tick in 0..240 {
            crane.tick(-ramp(tick.min(239 - tick), 60, 0.4));
        }
    }
    for _ in 0..120 {
        crane.tick(0.0);
    }
    let start = crane.spool.length();
    let (mut paid, mut last) = (0.0, crane.tick(0.0));
    let (mut largest_step, mut events) = (0.0_f64, 0);
    for tick in 0..ticks {
        let held = crane.spool.held().len();
        let speed = ramp(tick, 60, top);
        paid += speed * f64::from(crane.settings.time_step);
        let tension = crane.tick(speed);
        assert!(
            (crane.rest_length() - (start + paid)).abs() < 1e-3,
            "{integrator} {tick}: {}",
            crane.rest_length()
        );
        events += usize::from(crane.spool.held().len() != held);
        let step = (tension - last).abs() / last;
        largest_step = largest_step.max(step);
        last = tension;
        let load = *crane.positions.last().unwrap();
        assert!(load.is_finite() && load.x.abs() < 1e-3, "{load}");
    }
    assert!(events >= 8, "{integrator}: {events} particles came or went");
    assert!(largest_step < 0.05, "{integrator}: a tension step of {largest_step}");
    assert!((last / crane.weight() - 1.0).abs() < 0.05, "{integrator}: {last} N of {} N", crane.weight());
}

#[test]
fn a_rope_is_taken_in_without_a_jerk() {
    for (integrator, substeps) in [
        (Integrator::Auto, SubstepMode::Auto),
        (Integrator::ImplicitEuler, SubstepMode::Fixed(1)),
        (Integrator::VelocityVerlet, SubstepMode::Auto),
        (Integrator::TrBdf2, SubstepMode::Fixed(2)),
        // The tension of 21 links converges with the substeps.
        (Integrator::Xpbd, SubstepMode::Fixed(400)),
    ] {
        run(-0.4, 240, integrator, substeps);
    }
}

#[test]
fn a_rope_is_paid_out_without_a_jerk() {
    for (integrator, substeps) in [
        (Integrator::Auto, SubstepMode::Auto),
        (Integrator::ImplicitEuler, SubstepMode::Fixed(1)),
        (Integrator::VelocityVerlet, SubstepMode::Auto),
        (Integrator::TrBdf2, SubstepMode::Fixed(2)),
        // The tension of 21 links converges with the substeps.
        (Integrator::Xpbd, SubstepMode::Fixed(400)),
    ] {
        run(0.4, 200, integrator, substeps);
    }
}

/// Beyond what was laid out, new particles get new numbers, the old ones keep theirs.
#[test]
fn a_rope_is_longer_than_it_was_laid_out() {
    let mut crane = Crane::new(5, Integrator::Auto, SubstepMode::Auto);
    let Crane { topology, positions, velocities, spool, .. } = &mut crane;
    spool.extend(8, topology, positions, velocities);
    assert_eq!(positions.len(), 14);
    assert_eq!(spool.held(), [0, 6, 7, 8, 9, 10, 11, 12, 13]);
    assert_eq!(spool.first_link(), (0, [13, 1]));
    crane.lay_out();
    let start = crane.spool.length();
    let speed = |tick: u32| ramp(tick.min(200 - tick), 60, 0.4);
    for tick in 0..200 {
        crane.tick(speed(tick));
    }
    let paid = (0..200).map(speed).sum::<f64>() * f64::from(crane.settings.time_step);
    assert!((crane.rest_length() - start - paid).abs() < 1e-3);
    let tension = crane.tick(0.0);
    assert!((tension / crane.weight() - 1.0).abs() < 0.1, "{tension}");
    assert!((-crane.positions[5].y - crane.spool.length() as f32).abs() < 0.02, "{}", crane.positions[5]);
}
