//! The scheme of nets that touch.

use super::Caches;
use crate::solver::collision::{ContactProperties, Scene};
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
        properties: &[ContactProperties],
        first: Plan,
    ) -> Plan {
        if first.stiff_substeps == 0 || settings.pair_rules.is_none() {
            return first;
        }
        let State { particles, elements, exposed, .. } = state;
        let Self { planner, surfaces, touching, near_islands, .. } = self;
        touching.clear();
        let (islands, _) = planner.stiff_islands();
        surfaces.find_touching(particles, (settings, properties, islands), touching);
        touching.sort_unstable();
        touching.dedup();
        let covered = surfaces.covered();
        near_islands.begin_tick(Scene { islands, particles, covered, properties, settings });
        let (mut plan, mut known) = (first, 0);
        // What touches what has become stiff becomes so; and a plan that divides them in another place may part others.
        loop {
            if touching.len() > known {
                known = touching.len();
                plan = planner.plan_joined((elements, exposed), settings, touching);
            }
            if plan.stiff_substeps > 0 {
                let (islands, stiff) = planner.stiff_islands();
                near_islands.find(
                    Scene { islands, particles, covered, properties, settings },
                    stiff,
                    touching,
                );
            }
            if touching.len() == known {
                return plan;
            }
        }
    }
}
