//! Newton's method on the potential of a step.

use bevy::math::DVec3;

use super::conjugate_gradient::{ConjugateGradient, FEATURE_TOLERANCE, REBOUND_TOLERANCE, STEP_TOLERANCE};
use super::system::System;
use crate::solver::graph::Elimination;

/// The error that is left, as a part of the displacement in the time step.
const TOLERANCE: f64 = 5e-4;

/// The same where something is touched: what folds over an obstacle has many ways that cost nothing.
const TOUCHING_TOLERANCE: f64 = 5e-3;

/// The energy of this error, as a part of what the displacement costs against inertia.
const ENERGY_TOLERANCE: f64 = 1e-4;

/// How much shorter a Newton step is taken to be than the one before, when it comes to the error, at
/// most. A sheet with compressed springs may crumple for dozens of steps, each a little further: that is
/// not waited for.
const MAX_RATIO: f64 = 0.5;

/// Maximal number of Newton steps.
pub(super) const MAX_STEPS: usize = 20;

/// Number of Newton steps that may raise the potential before the first of them is taken back.
const MAX_ASCENTS: usize = 3;

/// Number of times that a step which leads up is halved.
const MAX_HALVINGS: usize = 30;

/// The decrease of the potential in a step, at least, as a part of that at its start (Armijo, *Pacific J. Math.* 16, 1, 1966).
const MIN_DECREASE: f64 = 1e-4;

/// How much the energy of contacts may rise in a step that raises the potential, as a part of that of the step.
const MAX_CONTACT_RISE: f64 = 0.5;

/// Displacements below this part of a coordinate are rounding.
const ROUNDING: f64 = 1e-13;

/// The iteration; its arrays are kept from substep to substep.
#[derive(Debug, Clone, Default)]
pub(super) struct Newton {
    conjugate_gradient: ConjugateGradient,
    /// The point of the least potential so far.
    best: Vec<DVec3>,
    /// Where the step begins.
    from: Vec<DVec3>,
    progress: Progress,
}

/// How far the iteration has come: sums of squares, m², and energies, J.
#[derive(Debug, Clone, Copy, Default)]
struct Progress {
    /// Whether it is not solved directly.
    has_core: bool,
    /// Of the displacement in free flight.
    flight: f64,
    flight_energy: f64,
    /// Of the displacement by springs, before the Newton step.
    pulled: f64,
    pulled_energy: f64,
    /// Of the Newton step.
    step: f64,
    step_energy: f64,
    /// Of the Newton step before.
    last_step: f64,
    /// Of what may be rounding.
    rounding: f64,
}

impl Progress {
    /// Whether the error that is left after the step is small enough.
    ///
    /// When each step is q times the one before, those to come add up to step · q / (1 − q). The part
    /// that is solved directly converges quadratically, so that q is soon small.
    fn is_enough(&self, tolerance: f64) -> bool {
        let ratio = match self.last_step > 0.0 && !self.has_core {
            true => (self.step / self.last_step).sqrt().min(MAX_RATIO),
            false => MAX_RATIO,
        };
        let left = (ratio / (1.0 - ratio)).powi(2);
        left * self.step <= tolerance.powi(2) * (self.flight + self.pulled) + self.rounding
            && left * self.step_energy <= ENERGY_TOLERANCE * (self.flight_energy + self.pulled_energy)
    }
}

impl Newton {
    /// Moves the positions of `system` towards the minimum of its potential, by at most `max_steps` steps;
    /// whether it has come close enough.
    ///
    /// Full steps are best, though the first few may raise the potential: turning a stiff spring
    /// stretches it a little, until the next step. So up to [`MAX_ASCENTS`] steps may go up; then the
    /// search goes back to the best point and takes a part of the step from there that goes down. (The watchdog:
    /// Chamberlain, Powell, Lemarechal and Pedersen, *Math. Programming Study* 16, 1, 1982.)
    ///
    /// Where edges and faces touch something curved, many contacts are nearly closed, and a full step runs far into those that did not
    /// hold at its start: there each step is [searched along](Self::search).
    pub fn minimise(&mut self, system: &mut System, elimination: &Elimination, max_steps: usize) -> bool {
        self.measure_flight(system, elimination);
        let (mut least, mut ascents, mut rises) = (f64::INFINITY, 0, 0);
        for _ in 0..max_steps {
            let potential = system.linearise(elimination);
            // The potential is a sum: it does not show what its rounding hides.
            if potential <= least + 1e-12 * least.abs() {
                (least, ascents) = (potential, 0);
                self.best.clone_from(&system.position);
            } else {
                ascents += 1;
            }
            if ascents > MAX_ASCENTS {
                system.position.clone_from(&self.best);
                system.linearise(elimination);
            }
            let is_searched = system.contacts.has_features;
            let accuracy = if is_searched { FEATURE_TOLERANCE } else { STEP_TOLERANCE };
            self.conjugate_gradient.solve(system, elimination, accuracy);
            self.find_step(system, elimination);
            if is_searched {
                let is_whole = self.search(system, elimination, (potential, &mut rises));
                ascents = 0;
                if is_whole && self.is_solved(system) {
                    return true;
                }
                continue;
            }
            if ascents > MAX_ASCENTS {
                self.descend(system, elimination, least);
                continue;
            }
            self.take_step(system, elimination, 1.0);
            if self.is_solved(system) {
                return true;
            }
        }
        // The last step has not been looked at yet.
        if system.potential(elimination) > least {
            system.position.clone_from(&self.best);
        }
        false
    }

    /// Whether no more than the tolerance is left after the whole step.
    fn is_solved(&self, system: &System) -> bool {
        let tolerance = if system.contacts.hold() { TOUCHING_TOLERANCE } else { TOLERANCE };
        self.progress.is_enough(tolerance) && !system.contacts.changed
    }

    /// Takes the step, or the first of its half, its quarter, … that leads down from the `potential` at its start; whether it is the whole
    /// one. Up to [`MAX_ASCENTS`] steps, counted by `rises`, may raise the potential of the elements, if not that of the contacts.
    fn search(
        &mut self,
        system: &mut System,
        elimination: &Elimination,
        (potential, rises): (f64, &mut usize),
    ) -> bool {
        self.from.clone_from(&system.position);
        let touching = system.contacts.energy(&system.position);
        let fall = self.progress.step_energy;
        let mut share = 1.0;
        for _ in 0..MAX_HALVINGS {
            self.take_step(system, elimination, share);
            let allowed = potential - MIN_DECREASE * share * fall + 1e-12 * potential.abs();
            if system.potential(elimination) <= allowed {
                *rises = 0;
                return share == 1.0;
            }
            let rise = system.contacts.energy(&system.position) - touching;
            if share == 1.0 && *rises < MAX_ASCENTS && rise <= MAX_CONTACT_RISE * fall {
                *rises += 1;
                return true;
            }
            system.position.clone_from(&self.from);
            share *= 0.5;
        }
        false
    }

    /// Takes the first of the half, the quarter, … of the step that leads below the potential `least`.
    fn descend(&mut self, system: &mut System, elimination: &Elimination, least: f64) {
        let mut share = 0.5;
        for _ in 0..MAX_HALVINGS {
            self.take_step(system, elimination, share);
            if system.potential(elimination) < least {
                return;
            }
            system.position.clone_from(&self.best);
            share *= 0.5;
        }
    }

    /// Solves the system once, as it is linearised at the present positions, for the `step` of each node.
    pub fn solve_once(&mut self, system: &mut System, elimination: &Elimination) {
        system.linearise(elimination);
        self.conjugate_gradient.solve(system, elimination, REBOUND_TOLERANCE);
        self.find_step(system, elimination);
    }

    /// The displacements that Newton steps are compared with.
    fn measure_flight(&mut self, system: &System, elimination: &Elimination) {
        let mut progress = Progress { has_core: elimination.trees < elimination.free, ..Progress::default() };
        for node in 0..elimination.free {
            let flown = system.flight[node].distance_squared(system.start[node]);
            progress.flight += flown;
            progress.flight_energy += system.inertia[node] * flown;
            progress.rounding += ROUNDING * ROUNDING * system.start[node].length_squared();
        }
        self.progress = progress;
    }

    /// Finds the Newton step of the trees, that of the core being known.
    fn find_step(&mut self, system: &mut System, elimination: &Elimination) {
        let progress = &mut self.progress;
        (progress.last_step, progress.step, progress.step_energy) =
            (progress.step, 0.0, system.sums.step_energy);
        (progress.pulled, progress.pulled_energy) = (system.sums.pulled, system.sums.pulled_energy);
        for node in (0..elimination.free).rev() {
            if node < elimination.trees {
                system.substitute(elimination, node);
            } else {
                progress.step_energy += system.right[node].dot(system.step[node]);
            }
            progress.step += system.step[node].length_squared();
        }
    }

    /// Takes `share` of the Newton step.
    fn take_step(&self, system: &mut System, elimination: &Elimination, share: f64) {
        system.contacts.is_whole_step = share == 1.0;
        let free = ..elimination.free;
        for (position, step) in system.position[free].iter_mut().zip(&system.step[free]) {
            *position += *step * share;
        }
    }
}
