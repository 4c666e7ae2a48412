//! What the pointer can grab: loose particles and those of nets.

use bevy::camera::visibility::RenderLayers;
use bevy::ecs::system::SystemParam;
use bevy::prelude::*;

use super::DragAnchor;
use crate::nets::{PartState, ParticleNet, Parts};
use crate::particle::{Particle, Pinned, Quarantined};

/// A particle.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Handle {
    /// The entity of a loose particle, or the net.
    pub entity: Entity,
    /// Its number in the net; `None` of a loose particle.
    pub index: Option<u32>,
}

impl Handle {
    pub fn of_net(net: Entity, index: u32) -> Self {
        Self { entity: net, index: Some(index) }
    }
}

type LooseData =
    (Entity, &'static GlobalTransform, Option<&'static RenderLayers>, Has<Pinned>, Has<DragAnchor>);

/// All particles, where they are, and what holds them.
#[derive(SystemParam)]
pub(super) struct Grabbable<'w, 's> {
    loose: Query<'w, 's, LooseData, (With<Particle>, Without<Quarantined>)>,
    nets:
        Query<'w, 's, (Entity, &'static ParticleNet, Option<&'static Parts>, Option<&'static RenderLayers>)>,
    parts: Query<'w, 's, (&'static PartState, &'static GlobalTransform, Has<Pinned>, Has<DragAnchor>)>,
}

impl Grabbable<'_, '_> {
    /// Where a particle is; `None` if it is not in the simulation (any more).
    pub fn center(&self, Handle { entity, index }: Handle) -> Option<Vec3> {
        match index {
            None => Some(self.loose.get(entity).ok()?.1.translation()),
            Some(index) => place(self.nets.get(entity).ok()?.1, index),
        }
    }

    /// The pinned part that a particle of a net goes with, and the way from the particle to the part's centre, m. Of
    /// several it is the last one, as it is in a tick.
    pub fn holder(&self, Handle { entity, index }: Handle) -> Option<(Entity, Vec3)> {
        let index = index?;
        let (_, net, parts, _) = self.nets.get(entity).ok()?;
        parts?.entities().iter().rev().find_map(|&part| {
            let (state, transform, is_pinned, _) = self.parts.get(part).ok()?;
            let holds = is_pinned && state.particles().binary_search(&index).is_ok();
            holds.then_some((part, transform.translation() - place(net, index)?))
        })
    }

    /// What can be dragged from anywhere: the particles that are pinned or marked, where they are, on which layers, and
    /// whether they are marked.
    pub fn anchors(&self) -> impl Iterator<Item = (Handle, Vec3, Option<&RenderLayers>, bool)> {
        let loose = self.loose.iter().filter(|(.., is_pinned, is_marked)| *is_pinned || *is_marked).map(
            |(entity, transform, layers, _, is_marked)| {
                (Handle { entity, index: None }, transform.translation(), layers, is_marked)
            },
        );
        let of_nets = self.nets.iter().flat_map(|(entity, net, parts, layers)| {
            let parts = parts.map_or(&[][..], Parts::entities).iter();
            let of_parts = parts
                .filter_map(|part| self.parts.get(*part).ok())
                .filter(|(.., is_pinned, is_marked)| *is_pinned || *is_marked)
                .flat_map(|(state, .., is_marked)| {
                    state.particles().iter().map(move |index| (*index, is_marked))
                });
            let pinned = net.pinned().iter().map(|index| (*index, false));
            pinned.chain(of_parts).filter_map(move |(index, is_marked)| {
                Some((Handle::of_net(entity, index), place(net, index)?, layers, is_marked))
            })
        });
        loose.chain(of_nets)
    }
}

/// Where a particle of a net is; `None` if it has none or that was taken out.
fn place(net: &ParticleNet, index: u32) -> Option<Vec3> {
    let is_absent = net.quarantined().binary_search(&index).is_ok();
    net.positions().get(index as usize).filter(|_| !is_absent).copied()
}
