//! The surfaces of particles and nets into the solver's inputs.

use bevy::prelude::*;

use crate::collider::{ContactLayers, ContactMaterial};
use crate::particle::Particle;
use crate::solver::{Layers, Material, Skin};

use super::Simulation;
use super::registry::Slot;
use super::state::{MassSpringState, Warnings};

/// Particles and nets with a surface of their own.
pub(super) type SkinnedQuery<'w, 's> = Query<
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

/// Writes the surfaces that are not as those of all others; none, where there are none.
pub(super) fn gather_skins(
    state: &MassSpringState,
    simulation: &mut Simulation,
    warnings: &mut Warnings,
    skinned: &SkinnedQuery,
) {
    let skins = &mut simulation.inputs.skins;
    skins.clear();
    for (entity, slot, material, layers) in skinned {
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
        let skin = Skin { material, layers: Layers { memberships, filters } };
        skins.resize(state.solver.particles.len(), Skin::default());
        let place = state.nets.get(entity).and_then(|net| net.place.as_ref());
        let of_net = place.into_iter().flat_map(|place| place.slots());
        let own = slot.and_then(Slot::get);
        own.into_iter().chain(of_net).for_each(|slot| skins[slot] = skin);
    }
}
