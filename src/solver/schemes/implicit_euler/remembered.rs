//! What a step takes over from the contacts of the one before: their forces, and which of them stuck.
//!
//! So few contacts have to be found anew. Without that, the friction of a rope that is wound
//! round a pole for several turns would never settle: each turn depends on the normal forces of the last one, and would need a solution more.
//!
//! Where faces touch, several contacts share one force, in another way in each step: they begin without.

use super::contacts::Contacts;
use super::friction::FrictionState;
use crate::solver::collision::{Assigned, ContactForce, ContactMemory};
use crate::solver::graph::Elimination;

/// The part of the depth that may be left by which a contact holds less than in the step before: the forces of stiff nets with many contacts
/// would drift apart, as the rounding of positions adds to them in each step.
const LEAK: f64 = 0.5;

impl Contacts {
    /// To be called when all contacts have been added: they begin with the forces of the last step.
    pub fn recall(&mut self, memory: &ContactMemory, elimination: &Elimination) {
        if memory.forces.is_empty() || self.has_faces {
            return;
        }
        let mut assigned = Assigned::default();
        for contact in &mut self.contacts {
            let Some(ends) = contact.ends(elimination) else { continue };
            if let Some(known) = memory.forces.find(ends, contact.normal, &mut assigned) {
                contact.lagged = f64::from(known.force);
                let leak = LEAK * self.max_depth * self.stiffness * contact.inertia;
                contact.multiplier = (contact.lagged - leak).max(0.0);
                contact.friction_state =
                    if known.sticks { FrictionState::Sticking } else { FrictionState::Unknown };
            }
        }
    }

    /// Calls `remember` with the forces at the end of the step.
    pub fn forces(&self, elimination: &Elimination, mut remember: impl FnMut(ContactForce)) {
        if self.has_faces {
            return;
        }
        for contact in &self.contacts {
            let (normal, force) = (contact.normal.as_vec3(), contact.force as f32);
            if let Some(ends) = contact.ends(elimination).filter(|_| force > 0.0 && force.is_finite()) {
                let sticks = contact.friction_state == FrictionState::Sticking;
                remember(ContactForce { ends, normal, force, sticks });
            }
        }
    }
}
