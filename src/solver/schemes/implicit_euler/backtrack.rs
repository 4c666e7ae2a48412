//! Steps that end with stretched springs, because some of their particles were stopped and others were not.
//!
//! The final check that keeps surfaces apart does not solve for springs. Where it has stopped single particles of a stiff net, the
//! elastic energy may be many times that before, and the next steps would turn it into motion. Such a step is solved again, with these
//! particles held where they were stopped. Where that does not help, it is shortened, as in a backtracking line search: the displacements
//! of all particles of the island, or of the islands that were solved together, are scaled by one factor, so that no spring is stretched
//! because one of its ends was stopped. Their velocities stay those after the impact, as far as the energy allows.

use bevy::math::{DVec3, Vec3};

use super::surplus::MAX_GAIN;
use super::surplus::energy;
use super::tr_bdf2::Motion;
use super::{ImplicitEuler, Island, Step, write};
use crate::solver::collision::Surroundings;
use crate::solver::elements::Elements;
use crate::solver::field::Field;
use crate::solver::particles::{Particles, Vectors};

/// Below this part of its way an island stays where it was.
const MIN_PART: f32 = 1e-3;

/// What holds a particle where it was stopped, as a multiple of its inertia: far stiffer than any spring.
const HELD_INERTIA_RATIO: f64 = 1e10;

/// The start of a step, and its end as it was solved: positions, m, and velocities, m/s.
#[derive(Debug, Clone, Default)]
pub(in crate::solver) struct StepEndpoints {
    start: [Vectors; 2],
    end: [Vectors; 2],
}

impl StepEndpoints {
    /// To be called before a step.
    pub fn begin(&mut self, particles: &Particles) {
        keep(&mut self.start, particles);
    }

    /// To be called after it.
    pub fn end(&mut self, particles: &Particles) {
        keep(&mut self.end, particles);
    }

    /// The part of its way that a particle has gone in the direction of its way, 0 to 1.
    fn part(&self, particles: &Particles, slot: usize) -> f32 {
        let [from, to] = [&self.start, &self.end].map(|[position, _]| position.get(slot));
        let displacement = to - from;
        let part = (particles.position.get(slot) - from).dot(displacement) / displacement.length_squared();
        if part.is_nan() { 1.0 } else { part.clamp(0.0, 1.0) }
    }
}

fn keep([position, velocity]: &mut [Vectors; 2], particles: &Particles) {
    position.copy_from(&particles.position);
    velocity.copy_from(&particles.velocity);
}

/// What is done about a step in which stopped particles give an island energy.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::solver) enum EnergyCorrection {
    /// It is solved again, with what was stopped held.
    SolveWithHeld,
    /// The displacements of the island are scaled by one factor.
    ScaleStep,
    /// The island stays where the step began.
    RejectStep,
}

impl ImplicitEuler {
    /// Solves the last step again or shortens it where the particles that were `stopped` have given an island more energy than it
    /// had. Calls `visit` with the slots of these islands; whether there are any.
    pub fn backtrack(
        &mut self,
        (elements, field, h, surroundings): (&Elements, Field, f32, Surroundings),
        endpoints: &StepEndpoints,
        (particles, acceleration): (&mut Particles, &mut Vectors),
        (stopped, correction): (&[bool], EnergyCorrection),
        mut visit: impl FnMut(usize),
    ) -> bool {
        let Self { islands, clusters, obstacles, sprung, .. } = self;
        let step = Step { elements, field, h: h.into(), obstacles, sprung, surroundings };
        let mut any = false;
        let mut mend = |island: &mut Island| {
            let excess =
                island.slots().any(|slot| stopped[slot]).then(|| island.gain(step, endpoints, particles));
            let Some(allowed) = excess.flatten() else { return };
            any = true;
            island.slots().for_each(&mut visit);
            let parts = (&mut *particles, &mut *acceleration);
            match correction {
                EnergyCorrection::SolveWithHeld => island.solve_held(step, endpoints, parts, stopped),
                EnergyCorrection::ScaleStep => island.scale_step(step, endpoints, parts, (allowed, false)),
                EnergyCorrection::RejectStep => island.scale_step(step, endpoints, parts, (allowed, true)),
            }
        };
        for (number, island) in islands.iter_mut().enumerate() {
            if !clusters.has_joined(number) {
                mend(island);
            }
        }
        clusters.islands_mut().for_each(mend);
        any
    }
}

impl Island {
    fn energy_of(&self, step: Step, particles: &Particles, [position, velocity]: [&Vectors; 2]) -> [f64; 2] {
        let motion = |node: usize| {
            let slot = self.elimination.slots[node] as usize;
            Motion { position: position.get(slot).as_dvec3(), velocity: velocity.get(slot).as_dvec3() }
        };
        let [kinetic, potential] = energy(step.context(&self.elimination), particles, motion);
        [kinetic, potential + self.system.gases.energy(&self.elimination, |node| motion(node).position)]
    }

    /// Whether it has more energy than at the start and at the end of the step as it was solved, and than gravity brings in it; how
    /// much it may have, J.
    fn gain(&self, step: Step, endpoints: &StepEndpoints, particles: &Particles) -> Option<f64> {
        let [kinetic, potential] = self.energy_of(step, particles, endpoints.start.each_ref());
        let solved: f64 = self.energy_of(step, particles, endpoints.end.each_ref()).into_iter().sum();
        let fall = |slot: usize| {
            let mass = 1.0 / f64::from(particles.inverse_mass()[slot]);
            0.5 * mass * (step.h * step.field.acceleration(slot)).length_squared()
        };
        let allowed =
            (kinetic + potential).max(solved) + MAX_GAIN * kinetic + self.slots().map(fall).sum::<f64>();
        let present = self.energy_of(step, particles, [&particles.position, &particles.velocity]);
        // `None` for NaN.
        (present.into_iter().sum::<f64>() > allowed).then_some(allowed)
    }

    /// Solves a step of backward Euler with what was `stopped` held where it is. What holds it is within the island, or at rest: the
    /// momentum stays what it is.
    fn solve_held(
        &mut self,
        step: Step,
        endpoints: &StepEndpoints,
        (particles, acceleration): (&mut Particles, &mut Vectors),
        stopped: &[bool],
    ) {
        let Step { elements, field, h, .. } = step;
        let slots: Vec<usize> = self.slots().collect();
        let places: Vec<Vec3> = slots.iter().map(|slot| particles.position.get(*slot)).collect();
        let momentum = |particles: &Particles| -> DVec3 {
            let of = |slot: &usize| {
                particles.velocity.get(*slot).as_dvec3() / f64::from(particles.inverse_mass()[*slot])
            };
            slots.iter().map(of).sum()
        };
        let before = momentum(particles);
        let [position, velocity] = &endpoints.start;
        for slot in slots.iter().copied() {
            particles.position.set(slot, position.get(slot));
            particles.velocity.set(slot, velocity.get(slot));
        }
        self.stages.clear();
        if step.obstacles.any_thin() {
            let Surroundings { features, features_version, .. } = step.surroundings;
            self.refresh_features(features, features_version, particles.len());
        }
        self.system.begin(&self.elimination, particles, elements, field, h);
        for (node, place) in places.iter().enumerate().filter(|(node, _)| stopped[slots[*node]]) {
            self.system.inertia[node] *= HELD_INERTIA_RATIO;
            self.system.flight[node] = place.as_dvec3();
            self.system.position[node] = place.as_dvec3();
        }
        self.solve(particles, step);
        for (node, slot) in slots.iter().copied().enumerate() {
            let position = self.system.position[node];
            let velocity = (position - self.system.start[node]) / h;
            write(particles, acceleration, slot, [position, velocity], h);
        }
        if !self.elimination.is_anchored() && !self.system.contacts.are_held_from_outside() {
            let mass: f64 = slots.iter().map(|slot| 1.0 / f64::from(particles.inverse_mass()[*slot])).sum();
            let change = ((before - momentum(particles)) / mass).as_vec3();
            for slot in slots {
                particles.velocity.set(slot, particles.velocity.get(slot) + change);
            }
        }
    }

    /// Scales the displacements of all its particles by one factor, possibly 0, with at most the energy `allowed`, J.
    fn scale_step(
        &self,
        step: Step,
        endpoints: &StepEndpoints,
        (particles, acceleration): (&mut Particles, &mut Vectors),
        (allowed, rejects): (f64, bool),
    ) {
        let least = self.slots().map(|slot| endpoints.part(particles, slot)).fold(1.0, f32::min);
        let mut part = if rejects || least < MIN_PART { 0.0 } else { least };
        loop {
            for slot in self.slots() {
                let [from, to] = [&endpoints.start, &endpoints.end].map(|[position, _]| position.get(slot));
                particles.position.set(slot, if part == 0.0 { from } else { from.lerp(to, part) });
            }
            let [kinetic, potential] =
                self.energy_of(step, particles, [&particles.position, &particles.velocity]);
            if potential > allowed && part > 0.0 {
                part = 0.0;
                continue;
            }
            if kinetic + potential > allowed {
                self.slow_down((allowed - potential).max(0.0), particles, acceleration, step.h);
            }
            return;
        }
    }
}
