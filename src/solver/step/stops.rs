//! The end of a substep in which anything may touch: contacts are solved, and nothing has passed through anything.

use super::stiff::surroundings;
use super::{Caches, Inputs};
use crate::solver::collision::{ContactCaches, ContactMemory, ContactRecord, Evaluated, Substep, Surfaces};
use crate::solver::elements::Elements;
use crate::solver::field::Field;
use crate::solver::outputs::Outputs;
use crate::solver::particles::{Particles, Vectors};
use crate::solver::schemes::{self, EnergyCorrection};
use crate::solver::settings::StepSettings;
use crate::solver::stability::Plan;
use crate::solver::state::State;

/// Number of times, at most, that what would pass through something is stopped at colliders and at surfaces in turn.
const MAX_STOPS: u32 = 4;

/// What is done in turn about implicit steps that gain energy where particles are stopped.
const ENERGY_CORRECTIONS: [EnergyCorrection; 5] = [
    EnergyCorrection::SolveWithHeld,
    EnergyCorrection::SolveWithHeld,
    EnergyCorrection::SolveWithHeld,
    EnergyCorrection::ScaleStep,
    EnergyCorrection::RejectStep,
];

/// Solves the contacts of surfaces; whether there are any. What is squeezed between a half-space and others ends above it.
fn resolve_surfaces(
    (contacts, surfaces, memory): (&ContactCaches, &mut Surfaces, &mut ContactMemory),
    particles: &mut Particles,
    (substep, evaluated): (Substep, Option<Evaluated>),
    records: Option<&mut Vec<ContactRecord>>,
) -> bool {
    let any = surfaces.resolve(memory, particles, (substep, evaluated), contacts, records);
    if any {
        contacts.put_onto_half_spaces(|visit| surfaces.for_each_in_contact(visit), particles, substep);
    }
    any
}

/// The substep of `duration` seconds that ends when the part `elapsed` of the tick is done.
fn ending<'a>(
    inputs: &'a Inputs,
    (elements, acceleration): (&'a Elements, &'a Vectors),
    (settings, plan): (&'a StepSettings, Plan),
    [duration, elapsed]: [f32; 2],
) -> Substep<'a> {
    let Inputs { colliders, contact_properties: properties, .. } = inputs;
    let integrator = plan.integrator;
    Substep { elements, colliders, properties, acceleration, settings, integrator, duration, elapsed }
}

impl Caches {
    /// Solves all contacts at the end of a substep of `duration` seconds, when the part `elapsed` of the tick is done; whether those
    /// of surfaces have moved anything.
    pub(super) fn resolve_contacts(
        &mut self,
        state: &mut State,
        inputs: &Inputs,
        outputs: &mut Outputs,
        (settings, plan): (&StepSettings, Plan),
        [duration, elapsed]: [f32; 2],
    ) -> bool {
        self.surfaces.end_advance(&state.particles);
        let mut records = outputs.record_contacts.then_some(&mut outputs.contacts);
        let is_recorded = records.is_some();
        let State { particles, elements, contacts: memory, .. } = &mut *state;
        let elements = &*elements;
        let (by, end) = ((settings, plan), [duration, elapsed]);
        let substep = ending(inputs, (elements, &self.scratch.acceleration), by, end);
        self.contacts.find_all(memory, particles, substep, is_recorded);
        let integrator = plan.integrator;
        let of_balls = self.contacts.any_rebounds_on_springs();
        let field = Field::of(settings, self.air.load());
        let evaluated = if of_balls || self.surfaces.may_rebound(settings, &inputs.contact_properties) {
            let motion = (&*particles, self.contacts.start());
            let net = (elements, field, &self.blocks);
            schemes::evaluate_end(integrator, net, motion, &mut self.scratch, duration);
            schemes::evaluated(integrator, field, &self.scratch)
        } else {
            None
        };
        if let Some(evaluated) = evaluated.filter(|_| of_balls) {
            let substep = ending(inputs, (elements, evaluated.accelerations[0]), by, end);
            self.contacts.adjust_rebounds(particles, substep, evaluated);
        }
        let substep = ending(inputs, (elements, &self.scratch.acceleration), by, end);
        self.contacts.solve(particles, substep, records.as_deref_mut());
        let parts = (&self.contacts, &mut self.surfaces, memory);
        let have_touched = resolve_surfaces(parts, particles, (substep, evaluated), records);
        if self.contacts.have_moved() {
            self.scratch.disturb();
            if !state.pulls.is_empty() {
                self.contacts.for_each_touching(|slot| state.pulls.set_touching(slot));
            }
        }
        have_touched
    }

    /// Stops what would pass through something in a substep of `duration` seconds; `have_touched` says whether surfaces have. An
    /// implicit `step`, which ends here, is mended where that gives an island energy: its duration, s, and the part of the tick that
    /// has elapsed at its end.
    pub(super) fn stop_crossings(
        &mut self,
        state: &mut State,
        inputs: &Inputs,
        (settings, duration): (&StepSettings, f32),
        (step, have_touched): (Option<[f32; 2]>, bool),
    ) {
        // Nothing rebounds below this speed, m/s.
        let resting_speed = settings.gravity.length() * duration;
        self.surfaces.begin_stops();
        let mut have_stopped = self.stop_all(state, inputs, resting_speed, step.is_some());
        if let Some(step) = step.filter(|_| have_stopped) {
            for correction in ENERGY_CORRECTIONS {
                if !self.backtrack(state, inputs, settings, (step, correction)) {
                    break;
                }
                have_stopped |= self.stop_all(state, inputs, resting_speed, true);
            }
        }
        if have_touched || have_stopped {
            self.scratch.disturb();
            if !state.pulls.is_empty() {
                self.surfaces.for_each_touching(|slot| state.pulls.set_touching(slot));
                let stopped = self.contacts.stopped_at_colliders();
                stopped.iter().for_each(|slot| state.pulls.set_touching(*slot as usize));
            }
        }
    }

    /// Stops what would pass through something, at colliders and at surfaces; whether there was any.
    fn stop_all(
        &mut self,
        state: &mut State,
        inputs: &Inputs,
        resting_speed: f32,
        is_implicit: bool,
    ) -> bool {
        let Inputs { colliders, contact_properties: properties, .. } = inputs;
        let Self { contacts, surfaces, .. } = self;
        let mut have_stopped = false;
        // What stops at one may be in the way of the other.
        for round in 0..MAX_STOPS {
            let at_colliders =
                contacts.stop_at_colliders(&mut state.particles, (colliders, properties), resting_speed);
            let at_surfaces = (round == 0 || at_colliders)
                && surfaces.stop_crossings(&mut state.particles, properties, is_implicit);
            have_stopped |= at_colliders || at_surfaces;
            if !at_surfaces {
                break;
            }
        }
        have_stopped
    }

    /// Mends the implicit step of islands to which what was stopped gives energy; whether there are any. It takes the first of
    /// `step`, s, and ends when the second part of the tick has elapsed.
    fn backtrack(
        &mut self,
        state: &mut State,
        inputs: &Inputs,
        settings: &StepSettings,
        ([h, elapsed], correction): ([f32; 2], EnergyCorrection),
    ) -> bool {
        let State { particles, elements, pulls, contacts: memory, .. } = state;
        let Self { contacts, surfaces, implicit_euler, endpoints, stopped, scratch, air, .. } = self;
        if contacts.any_moving() || surfaces.any_pushing(particles) {
            return false;
        }
        stopped.clear();
        stopped.resize(particles.len(), false);
        surfaces.for_each_touching(|slot| stopped[slot] = true);
        contacts.stopped_at_colliders().iter().for_each(|slot| stopped[*slot as usize] = true);
        let field = Field::of(settings, air.load());
        let surroundings = surroundings((contacts, memory), inputs, settings, elapsed);
        let parts = (particles, &mut scratch.acceleration);
        let step = (&*elements, field, h, surroundings);
        implicit_euler.backtrack(step, endpoints, parts, (stopped, correction), |slot| {
            if !pulls.is_empty() {
                pulls.set_touching(slot);
            }
        })
    }
}
