//! Reads the pose of the last tick behind a `Transform` that interpolation has eased; without that feature, the `Transform`.

#[cfg(feature = "interpolation")]
pub(crate) use eased::keep_untouched;
#[cfg(feature = "interpolation")]
pub(super) use eased::{Easing, exact_transform, exact_translation, reset};
#[cfg(not(feature = "interpolation"))]
pub(super) use exact::{Easing, exact_transform, exact_translation, reset};

#[cfg(feature = "interpolation")]
mod eased {
    use bevy::ecs::system::{SystemChangeTick, SystemParam};
    use bevy::prelude::*;
    use bevy_transform_interpolation::{
        LastEasingTick, NonlinearRotationEasing, NonlinearTranslationEasing, RotationEasingState,
        ScaleEasingState, TranslationEasingState,
    };

    use crate::collider::ParticleCollider;
    use crate::particle::Particle;
    use crate::solver::Pose;

    /// The eased entities, in a tick.
    #[derive(SystemParam)]
    pub struct Easing<'w, 's> {
        states: Query<'w, 's, (&'static Transform, &'static mut TranslationEasingState)>,
        rotations: Query<'w, 's, &'static mut RotationEasingState>,
    }

    impl Easing<'_, '_> {
        /// Eases the entity from where it is now, not from where it was at the start of the tick.
        pub fn restart(&mut self, entity: Entity) {
            if let Ok((transform, mut state)) = self.states.get_mut(entity) {
                state.start = Some(transform.translation);
                if let Ok(mut state) = self.rotations.get_mut(entity) {
                    state.start = Some(transform.rotation);
                }
            }
        }

        /// Eases an entity without a parent from this pose, not from where it was at the start of the tick.
        pub fn restart_at(&mut self, entity: Entity, Pose { point, rotation }: Pose) {
            if let Ok((_, mut state)) = self.states.get_mut(entity) {
                state.start = Some(point);
            }
            if let Ok(mut state) = self.rotations.get_mut(entity) {
                state.start = Some(rotation);
            }
        }
    }

    /// The translation from which the next tick will start, in whatever frame between two ticks: see [`exact_transform`].
    pub fn exact_translation(world: &World, entity: EntityRef) -> Option<Vec3> {
        exact_transform(world, entity).map(|transform| transform.translation)
    }

    /// The transform from which the next tick will start, in whatever frame between two ticks.
    ///
    /// That is the end of the last tick, which easing approaches; but what was written since easing wrote it stays.
    /// Translation, rotation and scale are decided on each by itself.
    pub fn exact_transform(world: &World, entity: EntityRef) -> Option<Transform> {
        let transform = entity.get_ref::<Transform>()?;
        let is_touched = world.get_resource::<LastEasingTick>().is_some_and(|last_easing| {
            transform.last_changed().is_newer_than(**last_easing, world.read_change_tick())
        });
        let fraction = world.get_resource::<Time<Fixed>>().map(|time| time.overstep_fraction());
        let mut exact = *transform;
        if let Some(&TranslationEasingState { start: Some(start), end: Some(end) }) = entity.get() {
            let shown = fraction.map(|fraction| start.lerp(end, fraction));
            finish(&mut exact.translation, shown, end, is_touched);
        }
        if let Some(&RotationEasingState { start: Some(start), end: Some(end) }) = entity.get() {
            let shown = fraction.map(|fraction| start.slerp(end, fraction));
            finish(&mut exact.rotation, shown, end, is_touched);
        }
        if let Some(&ScaleEasingState { start: Some(start), end: Some(end) }) = entity.get() {
            let shown = fraction.map(|fraction| start.lerp(end, fraction));
            finish(&mut exact.scale, shown, end, is_touched);
        }
        Some(exact)
    }

    /// Replaces what easing shows by the end that it approaches. Returns whether it did: not where another value has been
    /// written.
    fn finish<T: PartialEq>(present: &mut T, shown: Option<T>, end: T, is_touched: bool) -> bool {
        let is_shown = !is_touched || *present == end || shown.as_ref() == Some(&*present);
        if is_shown {
            *present = end;
        }
        is_shown
    }

    /// What [`keep_untouched`] reads and writes.
    type TouchedData = (
        &'static mut Transform,
        Option<&'static mut TranslationEasingState>,
        Option<&'static mut RotationEasingState>,
        Option<&'static mut ScaleEasingState>,
    );

    /// Particles and colliders that easing moves along straight lines.
    type TouchedFilter = (
        Changed<Transform>,
        Or<(With<Particle>, With<ParticleCollider>)>,
        Without<NonlinearTranslationEasing>,
        Without<NonlinearRotationEasing>,
    );

    /// Finds, before the ticks of a frame, what of a `Transform` has been written since easing wrote it: only that stays as it
    /// is and is not eased, the rest goes where the last tick left it.
    ///
    /// bevy_transform_interpolation takes all that is neither where the tick began nor where it ended for written: of a
    /// wheel with a translation that is written in each frame, the rotation that was shown would stay, and it would turn too
    /// slowly.
    pub fn keep_untouched(
        mut touched: Query<TouchedData, TouchedFilter>,
        time: Res<Time<Fixed>>,
        last_easing: Res<LastEasingTick>,
        ticks: SystemChangeTick,
    ) {
        let fraction = time.overstep_fraction();
        for (mut transform, translation, rotation, scale) in &mut touched {
            if !transform.last_changed().is_newer_than(**last_easing, ticks.this_run()) {
                continue;
            }
            if let Some(mut state) = translation
                && let (Some(start), Some(end)) = (state.start, state.end)
                && !finish(&mut transform.translation, Some(start.lerp(end, fraction)), end, true)
            {
                (state.start, state.end) = (None, None);
            }
            if let Some(mut state) = rotation
                && let (Some(start), Some(end)) = (state.start, state.end)
                && !finish(&mut transform.rotation, Some(start.slerp(end, fraction)), end, true)
            {
                (state.start, state.end) = (None, None);
            }
            if let Some(mut state) = scale
                && let (Some(start), Some(end)) = (state.start, state.end)
                && !finish(&mut transform.scale, Some(start.lerp(end, fraction)), end, true)
            {
                (state.start, state.end) = (None, None);
            }
        }
    }

    /// Lets interpolation begin anew from where the entity has been put.
    ///
    /// It would take a place that equals the start of the last tick for its own doing, not for a change,
    /// and put the end of that tick in its stead when the next one begins.
    pub fn reset(entity: &mut EntityWorldMut) {
        if let Some(mut easing) = entity.get_mut::<TranslationEasingState>() {
            (easing.start, easing.end) = (None, None);
        }
        if let Some(mut easing) = entity.get_mut::<RotationEasingState>() {
            (easing.start, easing.end) = (None, None);
        }
        if let Some(mut easing) = entity.get_mut::<ScaleEasingState>() {
            (easing.start, easing.end) = (None, None);
        }
    }
}

#[cfg(not(feature = "interpolation"))]
mod exact {
    use std::marker::PhantomData;

    use bevy::ecs::system::SystemParam;
    use bevy::prelude::*;

    use crate::solver::Pose;

    #[derive(SystemParam)]
    pub struct Easing<'w, 's> {
        marker: PhantomData<(&'w (), &'s ())>,
    }

    impl Easing<'_, '_> {
        pub fn restart(&mut self, _entity: Entity) {}

        pub fn restart_at(&mut self, _entity: Entity, _pose: Pose) {}
    }

    pub fn exact_translation(_world: &World, entity: EntityRef) -> Option<Vec3> {
        Some(entity.get::<Transform>()?.translation)
    }

    pub fn exact_transform(_world: &World, entity: EntityRef) -> Option<Transform> {
        entity.get::<Transform>().copied()
    }

    pub fn reset(_entity: &mut EntityWorldMut) {}
}
