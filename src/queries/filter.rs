//! What a query looks at.

use bevy::prelude::*;

use crate::collider::ContactLayers;

/// What a query looks at. Default: all layers, no sensors, every entity.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_mass_spring::prelude::*;
/// # fn look(mut queries: ParticleQueries, player: Entity, walls: Query<(), With<ParticleCollider>>) {
/// let ray = Ray3d::new(Vec3::Y, Dir3::NEG_Z);
/// // What is in layer 0b10, but the player.
/// let layers = ContactLayers::new(u32::MAX, 0b10);
/// let is_other = |entity: Entity| entity != player;
/// let filter = ParticleQueryFilter::from_layers(layers).with_predicate(&is_other);
/// let other = queries.cast_ray(ray, 20.0, filter);
/// // Colliders only, with the sensors among them.
/// let is_wall = |entity: Entity| walls.contains(entity);
/// let filter = ParticleQueryFilter::default().with_predicate(&is_wall).with_sensors();
/// let wall = queries.cast_ray(ray, 20.0, filter);
/// # }
/// ```
#[derive(Clone, Copy, Default)]
pub struct ParticleQueryFilter<'a> {
    /// The layers that the query is in, and those that it finds: it finds what it may [touch](ContactLayers::meet).
    /// Default: all.
    pub layers: ContactLayers,
    /// Whether it finds sensors. Default false.
    pub sensors: bool,
    /// Whether it looks at an entity: a collider, a particle or a net. Default: at each.
    pub predicate: Option<&'a dyn Fn(Entity) -> bool>,
}

impl<'a> ParticleQueryFilter<'a> {
    /// What may touch these layers.
    pub fn from_layers(layers: ContactLayers) -> Self {
        Self { layers, ..Self::default() }
    }

    /// The same with sensors.
    pub fn with_sensors(self) -> Self {
        Self { sensors: true, ..self }
    }

    /// The same of those entities only for which `predicate` is true.
    pub fn with_predicate(self, predicate: &'a dyn Fn(Entity) -> bool) -> Self {
        Self { predicate: Some(predicate), ..self }
    }

    /// Whether it looks at an entity with these layers.
    pub(super) fn admits(&self, entity: Entity, layers: Option<&ContactLayers>) -> bool {
        layers.copied().unwrap_or_default().meet(self.layers)
            && self.predicate.is_none_or(|predicate| predicate(entity))
    }
}
