//! A step of backward Euler with what touches: the equations are solved until the contacts hold, then what hits rebounds, and no more
//! energy is left than there was.

use super::contacts::{Motion, PairFilter};
use super::system::System;
use super::{Island, Step, Touched};
use crate::solver::collision::Surroundings;
use crate::solver::particles::{Particles, Vectors};

impl Island {
    /// Solves the equations of the step, which the system has begun; whether the solution has come close enough.
    pub(super) fn solve(&mut self, particles: &Particles, step: Step) -> bool {
        let Step { obstacles, sprung, surroundings, h, .. } = step;
        let Surroundings { memory, settings, .. } = surroundings;
        let Self { elimination, system, newton, excluded, pairs, surfaces, node_of, features, .. } = self;
        let filter = PairFilter { excluded, sprung, memory, families: particles.families() };
        let rules = settings.pair_rules.unwrap_or_default();
        let mut reach = 0.0;
        loop {
            let System { start, flight, inertia, contacts, .. } = &mut *system;
            let motion = Motion { elimination, particles, start, flight, inertia, h };
            contacts.begin(&motion, (obstacles, surroundings), &filter, reach);
            contacts.add_pairs(&motion, pairs, node_of, rules);
            contacts.add_surfaces(&motion, surfaces, node_of);
            if obstacles.any_thin() {
                contacts.add_features(&motion, features, (obstacles, surroundings));
            }
            contacts.recall(memory, elimination);
            contacts.estimate_forces(flight);
            if !surfaces.is_empty() || contacts.has_features {
                system.begin_low(elimination);
            }
            let is_solved = loop {
                let max_steps = system.contacts.max_steps();
                let is_solved = newton.minimise(system, elimination, max_steps);
                let System { start, flight, inertia, contacts, position, .. } = &mut *system;
                let motion = Motion { elimination, particles, start, flight, inertia, h };
                let around = (obstacles, surroundings);
                if !contacts.refine(position, is_solved)
                    && !contacts.add_missed(&motion, position, features, around)
                {
                    break is_solved;
                }
            };
            if reach > 0.0 || obstacles.is_empty() {
                return is_solved;
            }
            let System { start, position, contacts, .. } = &*system;
            match contacts.missing_reach(elimination.free, start, position) {
                Some(missing) => reach = 2.0 * missing,
                None => return is_solved,
            }
        }
    }

    /// Backward Euler; what holds the particles is a part of the step.
    pub(super) fn advance_backward_euler(
        &mut self,
        step: Step,
        particles: &mut Particles,
        acceleration: &mut Vectors,
        touched: &mut Touched,
    ) {
        let Step { elements, field, h, .. } = step;
        self.stages.clear();
        if step.obstacles.any_thin() {
            let Surroundings { features, features_version, .. } = step.surroundings;
            self.refresh_features(features, features_version, particles.len());
        }
        self.system.begin(&self.elimination, particles, elements, field, h);
        let is_solved = self.solve(particles, step);
        self.balance();
        let Self { elimination, system, newton, .. } = self;
        let resting_speed = f64::from(field.gravity.length()) * h;
        let may_rebound = system.contacts.may_rebound();
        if may_rebound {
            system.find_start_pull(elimination, elements);
        }
        let System { contacts, position, start_pull, .. } = &mut *system;
        let rebounds = may_rebound && contacts.begin_rebound(position, start_pull, resting_speed, h);
        system.contacts.records(elimination, &system.position, h, |record| touched.records.push(record));
        system.contacts.forces(elimination, |force| touched.forces.push(force));
        if rebounds {
            system.load = 0.0;
            newton.solve_once(system, elimination);
            self.balance_rebound();
        }
        if is_solved && self.dissipates() || !self.is_left_alone(particles) {
            self.finish(particles, acceleration, h, rebounds);
            return;
        }
        let mut before = self.energy_before(step, particles);
        before[1] += self.system.contacts.recovery(&self.system.start, h);
        let start = rebounds.then(|| self.start_velocities(particles));
        self.finish(particles, acceleration, h, rebounds);
        let mut excess = self.excess(step, particles, before);
        if let Some(start) = start.filter(|_| excess.is_some()) {
            self.finish_without_rebound(particles, acceleration, (&start, h));
            excess = self.excess(step, particles, before);
        }
        if let Some(allowed) = excess {
            self.shed(step, particles, acceleration, allowed);
        }
    }
}
