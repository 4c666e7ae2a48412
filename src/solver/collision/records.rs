//! What a substep publishes of its contacts.

use bevy::math::Vec3;

use super::{ContactCaches, ContactPartner, ContactRecord};
use crate::solver::particles::Particles;

impl ContactCaches {
    /// Appends the contacts of the last substep.
    pub(super) fn record(&self, particles: &Particles, records: &mut Vec<ContactRecord>) {
        for contact in &self.plane_contacts {
            let normal = Vec3::from(self.surfaces[contact.plane].normal);
            records.push(ContactRecord {
                slot: contact.slot,
                other: ContactPartner::Plane(contact.plane),
                point: particles.position.get(contact.slot) - normal * particles.radius()[contact.slot],
                normal,
                impulse: contact.impulse,
            });
        }
        let slot_of = &self.candidates.regions.slot_of;
        for group in self.candidates.groups.iter() {
            let slot = |place: usize| slot_of[group.bodies.start + place] as usize;
            for contact in self.pair_contacts.of(group) {
                let (first, second) = (slot(contact.first()), slot(contact.second()));
                // By slot, since the upper and the lower one may change places within a tick.
                let (slot, other, normal) = if first < second {
                    (first, second, contact.normal)
                } else {
                    (second, first, -contact.normal)
                };
                let normal = Vec3::from(normal);
                records.push(ContactRecord {
                    slot,
                    other: ContactPartner::Particle(other),
                    point: particles.position.get(slot) - normal * particles.radius()[slot],
                    normal,
                    impulse: contact.impulses.normal,
                });
            }
        }
    }
}
