//! The momentum of an island after its step, which elements and contacts within it do not change.

use bevy::math::DVec3;

use super::Island;
use super::contact::Contact;
use super::contacts::{Contacts, max_displacement};
use super::system::System;

/// The longest correction of what touches something, as a part of the longest displacement of a particle in free flight.
const MAX_DRIFT: f64 = 0.02;

/// The sine of the angle between two normals that are taken for different ones.
pub(super) const MIN_ANGLE: f64 = 1e-6;

impl Island {
    /// Moves an island that hangs on nothing as a whole, to where it has the momentum that it must have:
    /// Σ (m/h² + ν/h) (x' − y) = 0, as elements add none. It would be so by itself, had the equations of the core
    /// been solved to the last bit. The force of a stiff contact is known less well than that where Newton's method has not come
    /// close: with contacts from outside the island is moved by no more than [`MAX_DRIFT`].
    pub(super) fn balance(&mut self) {
        let Self { elimination, system, .. } = self;
        if elimination.trees == elimination.free || elimination.is_anchored() {
            return;
        }
        let (mut drift, mut inertia) = (-system.contacts.force(), 0.0);
        for node in 0..elimination.free {
            drift += system.inertia[node] * (system.position[node] - system.flight[node]);
            inertia += system.inertia[node];
        }
        system.tethers.iter().for_each(|tether| drift -= tether.force(&system.position));
        let surplus = drift;
        let drift = system.share(drift, inertia);
        let mut drift = system.contacts.along_surfaces(drift);
        system.contacts.publish_with(surplus);
        if system.contacts.are_held_from_outside() {
            let longest = max_displacement(0..elimination.free, &system.start, &system.flight);
            drift = drift.clamp_length_max(MAX_DRIFT * longest);
        }
        for position in &mut system.position[..elimination.free] {
            *position -= drift;
        }
    }

    /// Has what rebounds from nothing but itself keep its momentum: Σ (m/h² + ν/h) s = 0 of the steps s that send it back.
    pub(super) fn balance_rebound(&mut self) {
        let Self { elimination, system, surfaces, .. } = self;
        if surfaces.is_empty() || elimination.is_anchored() || system.contacts.are_held_from_outside() {
            return;
        }
        let (mut drift, mut inertia) = (DVec3::ZERO, 0.0);
        for node in 0..elimination.free {
            drift += system.inertia[node] * system.step[node];
            inertia += system.inertia[node];
        }
        drift += system.tethers.resistance(&system.step);
        let drift = system.share(drift, inertia);
        system.step[..elimination.free].iter_mut().for_each(|step| *step -= drift);
    }
}

impl System {
    /// The displacement of all nodes that a force (N) costs against their `inertia` (N/m) and the air, m.
    fn share(&self, force: DVec3, inertia: f64) -> DVec3 {
        match self.tethers.is_empty() {
            true => force / inertia,
            false => self.tethers.stiffness().plus_diagonal(inertia).factor(inertia).solve(force),
        }
    }
}

impl Contacts {
    /// The contacts that held in the last linearisation with what nothing in the step can move.
    pub(super) fn held_from_outside(&self) -> impl Iterator<Item = &Contact> {
        self.contacts.iter().filter(|contact| contact.force > 0.0 && contact.outer_part() != 0.0)
    }

    /// Whether there are any such.
    pub fn are_held_from_outside(&self) -> bool {
        self.held_from_outside().next().is_some()
    }

    /// Their force, N.
    pub fn force(&self) -> DVec3 {
        let of =
            |contact: &Contact| (contact.normal * contact.force + contact.rubbing) * contact.outer_part();
        self.held_from_outside().map(of).sum()
    }

    /// The part of a displacement that leads into no obstacle and away from none.
    pub fn along_surfaces(&self, displacement: DVec3) -> DVec3 {
        let mut basis = [DVec3::ZERO; 3];
        let mut count = 0;
        for contact in self.held_from_outside() {
            let outside = perpendicular(contact.normal, &basis);
            if count < 3 && outside.length_squared() > MIN_ANGLE * MIN_ANGLE {
                basis[count] = outside.normalize();
                count += 1;
            }
        }
        perpendicular(displacement, &basis)
    }
}

/// The part of a vector perpendicular to orthonormal ones, or zeros.
fn perpendicular(vector: DVec3, basis: &[DVec3]) -> DVec3 {
    basis.iter().fold(vector, |rest, direction| rest - *direction * rest.dot(*direction))
}
