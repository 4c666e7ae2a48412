//! The end of a substep: nothing has passed through anything.

use super::{Caches, Inputs};
use crate::solver::state::State;

/// Number of times, at most, that what would pass through something is stopped at colliders and at surfaces in turn.
const MAX_STOPS: u32 = 4;

impl Caches {
    /// Stops what would pass through something; nothing rebounds below the `resting_speed`, m/s, and `have_touched` says
    /// whether surfaces have.
    pub(super) fn stop_crossings(
        &mut self,
        state: &mut State,
        inputs: &Inputs,
        resting_speed: f32,
        have_touched: bool,
    ) {
        let Inputs { colliders, skins, .. } = inputs;
        let Self { contacts, surfaces, .. } = self;
        let mut have_stopped = false;
        surfaces.begin_stops();
        // What stops at one may be in the way of the other.
        for round in 0..MAX_STOPS {
            let at_colliders =
                contacts.stop_at_colliders(&mut state.particles, (colliders, skins), resting_speed);
            let at_surfaces =
                (round == 0 || at_colliders) && surfaces.stop_crossings(&mut state.particles, skins);
            have_stopped |= at_colliders || at_surfaces;
            if !at_surfaces {
                break;
            }
        }
        if have_touched || have_stopped {
            self.scratch.disturb();
            if !state.pulls.is_empty() {
                self.surfaces.for_each_touching(|slot| state.pulls.touch(slot));
                let stopped = self.contacts.stopped_at_colliders();
                stopped.iter().for_each(|slot| state.pulls.touch(*slot as usize));
            }
        }
    }
}
