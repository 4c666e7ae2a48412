//! The forces that a tick publishes.

use super::{Caches, Field, Outputs, Plan, State, StepSettings};
use crate::solver::collision::ContactPartner;

impl Caches {
    /// Reads the tension of each element that implicit steps have solved for, N; NaN of others. Empty if none has.
    pub(super) fn read_solved_tensions(&mut self, plan: Plan, elements: usize) {
        self.tensions.clear();
        if plan.is_implicit() {
            self.tensions.resize(elements, f64::NAN);
            self.implicit_euler.read_tensions(&mut self.tensions);
        }
    }

    /// Writes tensions and reactions at the end of a tick into `outputs`, if they are asked for: of what rests those that balance
    /// the loads, of other elements those that were solved for, or measured.
    pub(super) fn publish_forces(
        &mut self,
        state: &State,
        outputs: &mut Outputs,
        settings: &StepSettings,
        plan: Plan,
    ) {
        if !outputs.record_forces {
            return;
        }
        self.read_solved_tensions(plan, state.elements.len());
        self.balance_tensions(state, settings, plan);
        outputs.end_tick(&state.elements, &state.particles, &self.tensions);
    }

    /// Replaces the tensions of what rests by those that balance the loads, N; of elements without one they become NaN.
    pub(super) fn balance_tensions(&mut self, state: &State, settings: &StepSettings, plan: Plan) {
        let State { elements, particles, .. } = state;
        self.tensions.resize(elements.len(), f64::NAN);
        let Self { balance, tensions, stopped: is_held, contacts, surfaces, implicit_euler, air, .. } = self;
        is_held.clear();
        is_held.resize(particles.len(), false);
        // Where all sleeps the contacts are those of an earlier tick, maybe of particles that are gone.
        let mut hold = |slot: usize| {
            if let Some(is_held) = is_held.get_mut(slot) {
                *is_held = true;
            }
        };
        contacts.for_each_touching(&mut hold);
        contacts.stopped_at_colliders().iter().for_each(|slot| hold(*slot as usize));
        surfaces.for_each_touching(&mut hold);
        if plan.is_implicit() {
            for contact in implicit_euler.touching() {
                hold(contact.slot);
                if let ContactPartner::Particle(other) = contact.other {
                    hold(other);
                }
            }
        }
        let field = Field::of(settings, air.load());
        let load = |slot: usize| {
            let mass = 1.0 / f64::from(particles.own_inverse_mass()[slot]);
            particles.applied_force.get(slot).as_dvec3() + mass * field.acceleration(slot)
        };
        balance.write_tensions(elements, particles, load, is_held, tensions);
    }
}
