//! World transforms of parents, up to date within the tick (`GlobalTransform` is a frame old here).

use bevy::ecs::entity_disabling::Disabled;
use bevy::ecs::query::Allow;
use bevy::ecs::system::SystemParam;
use bevy::math::Affine3A;
use bevy::prelude::*;

/// Parents, and the present transforms of all entities.
#[derive(SystemParam)]
pub(super) struct Hierarchy<'w, 's> {
    parents: Query<'w, 's, &'static ChildOf, Allow<Disabled>>,
    transforms: Query<'w, 's, &'static Transform, Allow<Disabled>>,
}

impl Hierarchy<'_, '_> {
    /// An entity and all above it, from the bottom up.
    pub fn lineage(&self, entity: Entity) -> impl Iterator<Item = Entity> {
        let parent_of = |entity: &Entity| self.parents.get(*entity).ok().map(ChildOf::parent);
        std::iter::successors(Some(entity), parent_of)
    }

    /// The world transform that an entity would have with another `Transform`.
    pub fn frame_of(&self, entity: Entity, transform: &Transform) -> Affine3A {
        let own = transform.compute_affine();
        match self.parents.get(entity) {
            Ok(parent) => self.world_transform(parent.parent()).0 * own,
            Err(_) => own,
        }
    }

    /// See [`world_transform`].
    pub fn world_transform(&self, entity: Entity) -> (Affine3A, usize) {
        let parent_of = |entity| self.parents.get(entity).ok().map(ChildOf::parent);
        world_transform(entity, parent_of, |entity| self.transforms.get(entity).ok())
    }
}

/// The world transform of `entity`, composed from the present `Transform`s of it and its ancestors;
/// and how many ancestors it has. Entities without a `Transform` count as the identity.
pub(super) fn world_transform<'a>(
    entity: Entity,
    parent_of: impl Fn(Entity) -> Option<Entity>,
    transform_of: impl Fn(Entity) -> Option<&'a Transform>,
) -> (Affine3A, usize) {
    let mut affine = Affine3A::IDENTITY;
    let mut depth = 0;
    let mut current = Some(entity);
    while let Some(ancestor) = current {
        // An identity is skipped, so that a plain parent costs no rounding either.
        if let Some(transform) = transform_of(ancestor).filter(|transform| **transform != Transform::IDENTITY)
        {
            affine = transform.compute_affine() * affine;
        }
        current = parent_of(ancestor);
        depth += usize::from(current.is_some());
    }
    (affine, depth)
}

/// A point in the frame of a parent, seen from the world.
pub(super) fn to_world(parent: &Affine3A, local: Vec3) -> Vec3 {
    if *parent == Affine3A::IDENTITY { local } else { parent.transform_point3(local) }
}

/// A point in the world, seen from the frame of a parent.
pub(super) fn to_local(parent: &Affine3A, world: Vec3) -> Vec3 {
    if *parent == Affine3A::IDENTITY { world } else { parent.inverse().transform_point3(world) }
}
