//! The contacts of a step as they are published.

use bevy::math::DVec3;

use super::balance::MIN_ANGLE;
use super::contact::{Contact, Partner};
use super::contacts::Contacts;
use crate::solver::collision::{ContactPartner, ContactRecord};
use crate::solver::graph::Elimination;

impl Contacts {
    /// Takes note of the force that has moved the island beyond that of its contacts and tethers, N. Where one surface, or parallel ones, hold
    /// it, the whole is known better than its parts: contacts are published with what it takes to move the island as it has moved.
    pub fn publish_with(&mut self, surplus: DVec3) {
        self.published_share = 1.0;
        let Some(normal) = self.held_from_outside().next().map(|contact| contact.normal) else {
            return;
        };
        if self
            .held_from_outside()
            .all(|contact| contact.normal.dot(normal) > 1.0 - 0.5 * MIN_ANGLE * MIN_ANGLE)
        {
            let force = self.force().dot(normal);
            self.published_share = ((force + surplus.dot(normal)) / force).max(0.0);
        }
    }

    /// Calls `visit` with each free node at which a contact held in the last linearisation, of some more than once.
    pub fn for_each_touching_node(&self, free: usize, mut visit: impl FnMut(usize)) {
        for contact in self.contacts.iter().filter(|contact| contact.force > 0.0) {
            let partner = if let Partner::Node { node, .. } = contact.partner { Some(node) } else { None };
            let others = contact.others[..contact.count].iter().map(|(node, _)| *node);
            let nodes = others.chain([contact.node]).chain(partner);
            nodes.filter(|node| *node < free).for_each(&mut visit);
        }
    }

    /// The particles that were held by themselves in the last linearisation.
    pub fn held_nodes(&self) -> impl Iterator<Item = usize> {
        let held = self.contacts.iter().filter(|contact| contact.force > 0.0 && contact.is_particle());
        held.map(|contact| contact.node)
    }

    /// The contacts that have held a particle in a step of `h` seconds, at its end.
    pub fn records(
        &self,
        elimination: &Elimination,
        position: &[DVec3],
        h: f64,
        mut record: impl FnMut(ContactRecord),
    ) {
        for contact in self.contacts.iter().filter(|contact| contact.force > 0.0) {
            let Contact { node, normal, radius, force, restitution, .. } = *contact;
            let force = force * if contact.outer_part() != 0.0 { self.published_share } else { 1.0 };
            let again = if contact.rebound > 0.0 { restitution } else { 0.0 };
            let other = match &contact.partner {
                Partner::Obstacle(obstacle) => obstacle.partner,
                Partner::Node { node, .. } => ContactPartner::Particle(elimination.slots[*node] as usize),
                Partner::Surface { slot, .. } => ContactPartner::Particle(*slot),
            };
            // Of another surface it may be the first side or the second.
            let is_surface = matches!(contact.partner, Partner::Surface { .. });
            let side = if is_surface { contact.weight.signum() } else { 1.0 };
            let point = if is_surface { position[node] } else { contact.point(position) };
            let normal = normal * side;
            record(ContactRecord {
                slot: elimination.slots[node] as usize,
                other,
                point: (point - normal * radius).as_vec3(),
                normal: normal.as_vec3(),
                impulse: (h * force * (1.0 + again)) as f32,
            });
        }
    }
}
