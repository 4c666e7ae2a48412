//! Contacts of surfaces in an implicit step: a point of one is held at a distance from a point of another one, along a direction
//! that is fixed for the step.

use bevy::math::DVec3;

use super::contact::{Contact, Partner};
use super::contacts::{Contacts, MAX_SURFACE_PASSES, Motion, RECOVERY_SPEED};
use crate::solver::collision::StiffContact;

/// Least allowed penetration, as a fraction of the contact distance: of a contact that begins where surfaces are stopped.
const MIN_DEPTH: f64 = 0.02;

/// Number of contacts of surfaces, and of particles that are not solved for directly, up to which further solutions follow one that has not
/// come close enough: a ball that strikes a rope would lose most of its momentum to it. Many contacts do much the same.
const MAX_CONVERGED: usize = 64;

impl Contacts {
    /// Adds contacts of surfaces; `node_of` has the nodes of their free corners.
    pub fn add_surfaces(&mut self, motion: &Motion, found: &[StiffContact], node_of: &[u32]) {
        let Motion { particles, start, flight, inertia, h, .. } = *motion;
        if !found.is_empty() {
            self.has_faces = true;
            self.max_passes = MAX_SURFACE_PASSES;
            let core = motion.elimination.free - motion.elimination.trees;
            self.goes_on = core.max(found.len()) <= MAX_CONVERGED;
        }
        for contact in found {
            let corners = || contact.corners().filter(|(slot, _)| !particles.is_pinned(*slot));
            let nodes = || corners().map(|(slot, weight)| (node_of[slot] as usize, weight));
            let (mut pinned, mut pinned_displacement, mut held) = (DVec3::ZERO, DVec3::ZERO, 0.0);
            for (slot, weight) in contact.corners().filter(|(slot, _)| particles.is_pinned(*slot)) {
                let displacement = h * particles.velocity.get(slot).as_dvec3();
                pinned += weight * (particles.position.get(slot).as_dvec3() + displacement);
                pinned_displacement += weight * displacement;
                held += weight;
            }
            let sum = |vectors: &[DVec3]| nodes().map(|(node, weight)| vectors[node] * weight).sum::<DVec3>();
            let Some((node, weight)) = nodes().next() else { continue };
            let is_opposite = |(_, other): &(usize, f64)| (*other > 0.0) != (weight > 0.0);
            let heaviest = contact
                .corners()
                .filter(is_opposite)
                .max_by(|(_, one), (_, other)| one.abs().total_cmp(&other.abs()));
            let mut others = [(0, 0.0); 3];
            nodes().skip(1).zip(&mut others).for_each(|(corner, other)| *other = corner);
            let (begin, reach, normal) = (sum(start), contact.reach, contact.normal);
            let gap = (begin + pinned).dot(normal) - reach;
            let allowed = (gap + RECOVERY_SPEED * h).min(0.0);
            self.contacts.push(Contact {
                weight,
                others,
                count: nodes().count() - 1,
                radius: 0.5 * reach,
                inertia: 1.0 / nodes().map(|(node, weight)| weight * weight / inertia[node]).sum::<f64>(),
                allowed,
                max_depth: (allowed + reach - contact.least).max(MIN_DEPTH * reach),
                origin: begin - pinned_displacement,
                approach: -(sum(flight) - begin + pinned_displacement).dot(normal) / h,
                normal,
                restitution: contact.restitution,
                friction: contact.friction,
                ..Contact::new(
                    node,
                    Partner::Surface {
                        slot: heaviest.map_or(0, |(slot, _)| slot),
                        normal,
                        reach,
                        pinned,
                        free_weight: -held,
                    },
                )
            });
        }
    }
}
