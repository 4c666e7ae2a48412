//! The optional components that the next ticks depend on, as a snapshot holds them.

use bevy::ecs::entity::{EntityHashSet, EntityMapper, MapEntities};
use bevy::prelude::*;

use crate::collider::{ColliderMotion, ContactExemptions, ContactLayers, ContactMaterial};
use crate::nets::{Breaking, Winch, Yielding};

macro_rules! define_options {
    ($($name:ident: $component:ty),*) => {
        /// Those of an entity that has any.
        #[derive(Debug, Clone)]
        #[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
        struct Options {
            entity: Entity,
            $($name: Option<$component>,)*
        }

        impl Options {
            fn of(world: &World, entity: Entity) -> Option<Self> {
                let entity = world.get_entity(entity).ok()?;
                let options = Self { entity: entity.id(), $($name: entity.get().cloned(),)* };
                ($(options.$name.is_some())||*).then_some(options)
            }

            /// Gives the entity these, and takes away any others of them.
            fn restore(&self, world: &mut World) {
                let Ok(mut entity) = world.get_entity_mut(self.entity) else { return };
                $(match &self.$name {
                    Some(component) if entity.get() == Some(component) => {}
                    Some(component) => _ = entity.insert(component.clone()),
                    None if entity.contains::<$component>() => _ = entity.remove::<$component>(),
                    None => {}
                })*
            }

            fn none(entity: Entity) -> Self {
                Self { entity, $($name: None,)* }
            }
        }

        /// The entities in a world that have any.
        fn entities_with_any(world: &mut World) -> Vec<Entity> {
            world.query_filtered::<Entity, Or<($(With<$component>,)*)>>().iter(world).collect()
        }
    };
}
define_options!(
    material: ContactMaterial,
    layers: ContactLayers,
    exemptions: ContactExemptions,
    motion: ColliderMotion,
    breaking: Breaking,
    winch: Winch,
    yielding: Yielding
);

/// The optional components of the entities of a snapshot.
#[derive(Debug, Clone, Default)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct OptionalComponents(Vec<Options>);

impl OptionalComponents {
    pub fn of(world: &World, entities: impl Iterator<Item = Entity>) -> Self {
        Self(entities.filter_map(|entity| Options::of(world, entity)).collect())
    }

    /// Puts them back, and takes away what the `entities` of the snapshot did not have.
    pub fn restore(&self, world: &mut World, entities: &EntityHashSet) {
        let recorded: EntityHashSet = self.0.iter().map(|options| options.entity).collect();
        for entity in entities_with_any(world) {
            if entities.contains(&entity) && !recorded.contains(&entity) {
                Options::none(entity).restore(world);
            }
        }
        self.0.iter().for_each(|options| options.restore(world));
    }
}

impl MapEntities for OptionalComponents {
    fn map_entities<M: EntityMapper>(&mut self, mapper: &mut M) {
        for options in &mut self.0 {
            options.entity = mapper.get_mapped(options.entity);
            if let Some(ContactExemptions(entities)) = &mut options.exemptions {
                entities.iter_mut().for_each(|entity| *entity = mapper.get_mapped(*entity));
            }
        }
    }
}
