//! The scheme of nets that touch.

use super::Caches;
use crate::solver::collision::Skin;
use crate::solver::settings::StepSettings;
use crate::solver::stability::Plan;
use crate::solver::state::State;

impl Caches {
    /// The plan where nets that touch, or would in the tick, are advanced by one scheme; the `first` one does not know of that.
    /// Where one scheme solves a step for its springs, and sees only afterwards what the other one has run into them, the contacts
    /// stretch these springs.
    pub(super) fn plan_touching(
        &mut self,
        state: &State,
        settings: &StepSettings,
        skins: &[Skin],
        first: Plan,
    ) -> Plan {
        if first.stiff_substeps == 0 {
            return first;
        }
        let Self { planner, surfaces, touching, .. } = self;
        touching.clear();
        surfaces.find_touching(&state.particles, (settings, skins), |slots| {
            planner.note_islands(slots, touching);
        });
        if touching.is_empty() { first } else { planner.plan_joined(&state.elements, settings, touching) }
    }
}
