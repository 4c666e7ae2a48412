//! The long steps of stiff islands beside an explicit scheme.

use super::{Caches, Inputs};
use crate::solver::collision::{ContactCaches, ContactMemory, Surroundings};
use crate::solver::field::Field;
use crate::solver::schemes::SubstepIndex;
use crate::solver::settings::StepSettings;
use crate::solver::state::State;

/// What a step has around it that ends when this part of the tick has `elapsed`.
pub(super) fn surroundings<'a>(
    (contacts, memory): (&'a ContactCaches, &'a ContactMemory),
    inputs: &'a Inputs,
    settings: &'a StepSettings,
    elapsed: f32,
) -> Surroundings<'a> {
    let (features, features_version) = contacts.features();
    Surroundings {
        colliders: &inputs.colliders,
        properties: &inputs.contact_properties,
        features,
        features_version,
        settings,
        memory,
        elapsed,
        covered: contacts.covered(),
    }
}

impl Caches {
    /// Advances the stiff islands by a long step, which ends when this part of the tick has `elapsed`, if one begins; or has them
    /// follow what contacts have done to them.
    pub(super) fn advance_stiff(
        &mut self,
        state: &mut State,
        inputs: &Inputs,
        settings: &StepSettings,
        (index, elapsed): (SubstepIndex, f32),
    ) {
        let State { particles, elements, contacts, pulls, sleep, .. } = state;
        if elements.any_ramps() {
            elements.ramp_to(elapsed);
        }
        if index.done > 0 {
            self.interleaved.follow_contacts(particles, index);
            return;
        }
        self.interleaved.begin_step(particles);
        let duration = index.count as f32 * index.substep;
        let field = Field::of(settings, self.air.load());
        let surroundings = surroundings((&self.contacts, contacts), inputs, settings, elapsed);
        let around = (surroundings, &mut self.surfaces);
        let acceleration = &mut self.scratch.acceleration;
        self.implicit_euler.advance(elements, particles, field, acceleration, around, Some(pulls), duration);
        self.implicit_euler.remember_forces(contacts, |slot| sleep.is_asleep(slot));
        self.endpoints.end(particles);
        // Where colliders are at the end of a long step is not known yet.
        if !self.contacts.any_moving() {
            self.stop_crossings(state, inputs, (settings, duration), (Some([duration, elapsed]), false));
        }
        self.interleaved.begin_paths(&self.implicit_euler, &state.particles);
    }
}
