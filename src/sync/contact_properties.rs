//! The surfaces of particles and nets into the solver's inputs.

use bevy::prelude::*;

use crate::collider::{ContactLayers, ContactMaterial};
use crate::particle::Particle;
use crate::solver::{ContactProperties, Layers, Material};

use super::Simulation;
use super::exemptions::{ExemptionQueries, GatheredExemptions};
use super::hierarchy::Hierarchy;
use super::registry::Slot;
use super::state::{MassSpringState, Warnings};

/// Particles and nets with a surface of their own.
type ContactPropertiesQuery<'w, 's> = Query<
    'w,
    's,
    (
        Entity,
        Option<&'static Slot<Particle>>,
        Option<&'static ContactMaterial>,
        Option<&'static ContactLayers>,
    ),
    (
        Or<(With<ContactMaterial>, With<ContactLayers>)>,
        Or<(With<Slot<Particle>>, With<crate::nets::ParticleNet>)>,
    ),
>;

/// What surfaces are read from.
pub(super) type ContactPropertiesQueries<'w, 's> = (ContactPropertiesQuery<'w, 's>, ExemptionQueries<'w, 's>);

/// Writes the surfaces that are not as those of all others; none, where there are none.
pub(super) fn gather_contact_properties(
    state: &MassSpringState,
    simulation: &mut Simulation,
    warnings: &mut Warnings,
    (query, queries): &ContactPropertiesQueries,
    (exemptions, hierarchy): (&mut GatheredExemptions, &Hierarchy),
) {
    let properties = &mut simulation.inputs.contact_properties;
    properties.clear();
    for (entity, slot, material, layers) in query {
        let material = material.filter(|material| match material.validate() {
            Ok(()) => true,
            Err(problem) => {
                let message = format_args!("the ContactMaterial of {entity} does not count: {problem}");
                warnings.warn_once(entity, message);
                false
            }
        });
        let material = material.map(|material| {
            let ContactMaterial { restitution, friction, restitution_rule, friction_rule } = *material;
            Material { restitution, friction, restitution_rule, friction_rule }
        });
        let ContactLayers { memberships, filters } = layers.copied().unwrap_or_default();
        let found = ContactProperties { material, layers: Layers::new(memberships, filters) };
        properties.resize(state.solver.particles.len(), ContactProperties::default());
        let place = state.nets.get(entity).and_then(|net| net.place.as_ref());
        let of_net = place.into_iter().flat_map(|place| place.slots());
        let own = slot.and_then(Slot::get);
        own.into_iter().chain(of_net).for_each(|slot| properties[slot] = found);
    }
    exemptions.for_each_concerned(queries, |exemptions, entity, slot| {
        let place = state.nets.get(entity).and_then(|net| net.place.as_ref());
        if slot.is_none() && place.is_none() {
            return;
        }
        let of_entity = exemptions.of(entity, queries, hierarchy);
        properties.resize(state.solver.particles.len(), ContactProperties::default());
        let of_net = place.into_iter().flat_map(|place| place.slots());
        slot.into_iter().chain(of_net).for_each(|slot| properties[slot].layers.exemptions = of_entity);
    });
}
