//! What is published of the contacts of a substep.

use bevy::math::Vec3;

use super::ContactCaches;
use super::touch::Touch;
use crate::solver::particles::Particles;

/// A contact in one substep.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct ContactRecord {
    /// Slot of the particle that is pushed along the normal.
    pub slot: usize,
    /// What it touches.
    pub other: ContactPartner,
    /// Where, m.
    pub point: Vec3,
    /// Unit vector towards the particle.
    pub normal: Vec3,
    /// Normal impulse, N·s.
    pub impulse: f32,
}

/// What a particle touches.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
#[non_exhaustive]
pub enum ContactPartner {
    /// The collider of this number.
    Collider(usize),
    /// The particle in this slot.
    Particle(usize),
}

impl ContactCaches {
    /// Touching pairs at the end of the last substep: of particles and of particles with planes.
    pub fn count(&self) -> usize {
        self.pair_count() + self.plane_contacts.len() + self.touches.all.len()
    }

    /// Calls `visit` with the slots of the particles that touched something in the last substep, of some more than
    /// once.
    pub fn for_each_touching(&self, mut visit: impl FnMut(usize)) {
        self.plane_contacts.iter().for_each(|contact| visit(contact.slot));
        for touch in &self.touches.all {
            touch.slots[..touch.count as usize].iter().for_each(|slot| visit(*slot as usize));
        }
        self.sweep.for_each_sliding(&mut visit);
        let slot_of = &self.candidates.regions.slot_of;
        for group in self.candidates.groups.iter() {
            for contact in self.pair_contacts.of(group) {
                for body in [contact.first(), contact.second()] {
                    visit(slot_of[group.bodies.start + body] as usize);
                }
            }
        }
    }

    pub(super) fn pair_count(&self) -> usize {
        self.candidates.groups.contacts()
    }

    /// Appends the contacts of the last substep: those with colliders first.
    pub(super) fn record(&mut self, particles: &Particles, records: &mut Vec<ContactRecord>) {
        self.first_record = records.len();
        for contact in &self.plane_contacts {
            let normal = Vec3::from(self.surfaces[contact.plane].normal);
            records.push(ContactRecord {
                slot: contact.slot,
                other: ContactPartner::Collider(contact.collider),
                point: particles.position.get(contact.slot) - normal * particles.radius()[contact.slot],
                normal,
                impulse: contact.impulse,
            });
        }
        for touch in &self.touches.all {
            records.push(touch.record(particles));
        }
        for (slot, collider) in &self.touches.sensed {
            let slot = *slot as usize;
            records.push(ContactRecord {
                slot,
                other: ContactPartner::Collider(*collider as usize),
                point: particles.position.get(slot),
                normal: Vec3::ZERO,
                impulse: 0.0,
            });
        }
        self.sweep.record(particles, records);
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

impl Touch {
    fn record(&self, particles: &Particles) -> ContactRecord {
        let count = self.count as usize;
        let each = self.slots[..count].iter().zip(self.weights);
        let centre: Vec3 = each.map(|(slot, weight)| particles.position.get(*slot as usize) * weight).sum();
        let heaviest = (0..count).max_by(|one, other| self.weights[*one].total_cmp(&self.weights[*other]));
        let normal = Vec3::from(self.normal);
        ContactRecord {
            slot: self.slots[heaviest.unwrap_or(0)] as usize,
            other: ContactPartner::Collider(self.collider as usize),
            point: centre - normal * self.radius,
            normal,
            impulse: self.impulse,
        }
    }
}
