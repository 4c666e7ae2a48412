//! Reads the position of the last tick behind a `Transform` that interpolation has eased; without that feature, the `Transform`.

#[cfg(feature = "interpolation")]
pub(super) use eased::{Easing, exact_translation, reset};
#[cfg(not(feature = "interpolation"))]
pub(super) use exact::{Easing, exact_translation, reset};

#[cfg(feature = "interpolation")]
mod eased {
    use bevy::ecs::system::SystemParam;
    use bevy::prelude::*;
    use bevy_transform_interpolation::{LastEasingTick, TranslationEasingState};

    /// The eased entities, in a tick.
    #[derive(SystemParam)]
    pub struct Easing<'w, 's> {
        states: Query<'w, 's, (&'static Transform, &'static mut TranslationEasingState)>,
    }

    impl Easing<'_, '_> {
        /// Eases the entity from where it is now, not from where it was at the start of the tick.
        pub fn restart(&mut self, entity: Entity) {
            if let Ok((transform, mut state)) = self.states.get_mut(entity) {
                state.start = Some(transform.translation);
            }
        }
    }

    /// The translation from which the next tick will start, in whatever frame between two ticks.
    ///
    /// That is the end of the last tick, which easing approaches, unless the entity was moved
    /// since then: the same rule as that of bevy_transform_interpolation.
    pub fn exact_translation(world: &World, entity: EntityRef) -> Option<Vec3> {
        let transform = entity.get_ref::<Transform>()?;
        let shown = transform.translation;
        let Some(&TranslationEasingState { start: Some(start), end: Some(end) }) = entity.get() else {
            return Some(shown);
        };
        let touched = world.get_resource::<LastEasingTick>().is_some_and(|last_easing| {
            transform.last_changed().is_newer_than(**last_easing, world.read_change_tick())
        });
        let moved = touched && shown != start && shown != end;
        Some(if moved { shown } else { end })
    }

    /// Lets interpolation begin anew from where the entity has been put.
    ///
    /// It would take a place that equals the start of the last tick for its own doing, not for a change,
    /// and put the end of that tick in its stead when the next one begins.
    pub fn reset(entity: &mut EntityWorldMut) {
        if let Some(mut easing) = entity.get_mut::<TranslationEasingState>() {
            (easing.start, easing.end) = (None, None);
        }
    }
}

#[cfg(not(feature = "interpolation"))]
mod exact {
    use std::marker::PhantomData;

    use bevy::ecs::system::SystemParam;
    use bevy::prelude::*;

    #[derive(SystemParam)]
    pub struct Easing<'w, 's> {
        marker: PhantomData<(&'w (), &'s ())>,
    }

    impl Easing<'_, '_> {
        pub fn restart(&mut self, _entity: Entity) {}
    }

    pub fn exact_translation(_world: &World, entity: EntityRef) -> Option<Vec3> {
        Some(entity.get::<Transform>()?.translation)
    }

    pub fn reset(_entity: &mut EntityWorldMut) {}
}
