//! The end of a substep: contacts of surfaces are solved, and nothing has passed through anything.

use super::{Caches, Inputs};
use crate::solver::collision::{ContactCaches, ContactRecord, Substep, Surfaces};
use crate::solver::particles::Particles;
use crate::solver::state::State;

/// Number of times, at most, that what would pass through something is stopped at colliders and at surfaces in turn.
const MAX_STOPS: u32 = 4;

/// Number of times, at most, that contacts of surfaces are solved in a substep, each time with what they have pressed into
/// half-spaces put back onto these: two that press a third one onto the ground part by the weights of the upper ones.
const MAX_SURFACE_ROUNDS: u32 = 8;

/// Solves the contacts of surfaces, in turn with those of half-spaces; whether there are any. What is squeezed between a
/// half-space and others ends above it.
pub(super) fn resolve_surfaces(
    (contacts, surfaces): (&ContactCaches, &mut Surfaces),
    particles: &mut Particles,
    substep: Substep,
    mut records: Option<&mut Vec<ContactRecord>>,
) -> bool {
    let mut any = false;
    for _ in 0..MAX_SURFACE_ROUNDS {
        // The impulses of later rounds are corrections of the first ones.
        if !surfaces.resolve(particles, substep, contacts.implicit(), records.take()) {
            break;
        }
        any = true;
        if !contacts.put_onto_half_spaces(|visit| surfaces.for_each_touching(visit), particles, substep) {
            break;
        }
    }
    any
}

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
