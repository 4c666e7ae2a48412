//! The forces that a tick publishes.

use super::{Caches, Field, Outputs, Plan, State, StepSettings};
use crate::solver::collision::ContactPartner;

impl Caches {
    /// The tension of each element that implicit steps have solved for, N; NaN of others.
    pub(super) fn solved_tensions(&mut self, plan: Plan, elements: usize) -> &[f64] {
        self.tensions.clear();
        if plan.is_implicit() {
            self.tensions.resize(elements, f64::NAN);
            self.implicit_euler.read_tensions(&mut self.tensions);
        }
        &self.tensions
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
        let State { elements, particles, .. } = state;
        self.solved_tensions(plan, elements.len());
        self.tensions.resize(elements.len(), f64::NAN);
        let Self { balance, tensions, stopped: is_held, contacts, surfaces, implicit_euler, air, .. } = self;
        is_held.clear();
        is_held.resize(particles.len(), false);
        contacts.for_each_touching(|slot| is_held[slot] = true);
        contacts.stopped_at_colliders().iter().for_each(|slot| is_held[*slot as usize] = true);
        surfaces.for_each_touching(|slot| is_held[slot] = true);
        if plan.is_implicit() {
            for contact in implicit_euler.touching() {
                is_held[contact.slot] = true;
                if let ContactPartner::Particle(other) = contact.other {
                    is_held[other] = true;
                }
            }
        }
        let field = Field::of(settings, air.load());
        let load = |slot: usize| {
            let mass = 1.0 / f64::from(particles.own_inverse_mass()[slot]);
            particles.applied_force.get(slot).as_dvec3() + mass * field.acceleration(slot)
        };
        balance.write_tensions(elements, particles, load, is_held, tensions);
        outputs.end_tick(elements, particles, tensions);
    }
}
