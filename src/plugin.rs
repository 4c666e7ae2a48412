//! Wiring: which resources exist and which system runs when. No physics here.

use bevy::ecs::intern::Interned;
use bevy::ecs::schedule::ScheduleLabel;
use bevy::prelude::*;

use crate::collider::{CollisionSettings, PlaneCollider};
use crate::environment::Environment;
use crate::particle::{AppliedForce, Particle, ParticleVelocity, Pinned, Quarantined};
use crate::report::{ParticleFault, TickReport};
use crate::settings::SolverSettings;
use crate::spring::Spring;
use crate::{sync, time_control};

/// The stages of a tick, chained in this order, in the plugin's schedule.
#[derive(SystemSet, Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum MassSpringSystems {
    /// Components are copied into the solver.
    Gather,
    /// The solver integrates one tick.
    Step,
    /// The solver's state is copied back into the components; messages are sent.
    Scatter,
}

/// Mass-spring physics: add it after `DefaultPlugins` or `MinimalPlugins`.
#[derive(Debug, Clone)]
pub struct MassSpringPlugin {
    schedule: Interned<dyn ScheduleLabel>,
    interpolation: Option<bool>,
}

impl Default for MassSpringPlugin {
    fn default() -> Self {
        Self::new(FixedPostUpdate)
    }
}

impl MassSpringPlugin {
    /// Runs the simulation in `schedule`; the default is [`FixedPostUpdate`], so that a game pushes
    /// forces in `FixedUpdate`. The time step is that of [`Time`] there.
    pub fn new(schedule: impl ScheduleLabel) -> Self {
        Self { schedule: schedule.intern(), interpolation: None }
    }

    /// Switches the smoothing of motion between ticks on or off (feature `interpolation`).
    ///
    /// By default it is on in apps that somebody watches, that is with Bevy's `InputPlugin`, which is
    /// part of `DefaultPlugins`, and off in headless ones. It eases each particle's `Transform`
    /// between the last two ticks while a frame is drawn, by `bevy_transform_interpolation`.
    pub fn with_interpolation(mut self, interpolation: bool) -> Self {
        self.interpolation = Some(interpolation);
        self
    }

    #[cfg(feature = "interpolation")]
    fn build_interpolation(&self, app: &mut App) {
        use bevy_transform_interpolation::prelude::*;

        let watched = app.is_plugin_added::<bevy::input::InputPlugin>();
        if !self.interpolation.unwrap_or(watched) {
            return;
        }
        if !app.is_plugin_added::<TransformInterpolationPlugin>() {
            app.add_plugins(TransformInterpolationPlugin::default());
        }
        if app.try_register_required_components::<Particle, TranslationInterpolation>().is_ok() {
            return;
        }
        // There are particles already: what is required of them cannot be changed any more.
        let world = app.world_mut();
        let existing: Vec<Entity> = world.query_filtered::<Entity, With<Particle>>().iter(world).collect();
        for particle in existing {
            world.entity_mut(particle).insert(TranslationInterpolation);
        }
        app.add_observer(|added: On<Add, Particle>, mut commands: Commands| {
            commands.entity(added.entity).try_insert(TranslationInterpolation);
        });
    }
}

impl Plugin for MassSpringPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<Environment>()
            .init_resource::<SolverSettings>()
            .init_resource::<CollisionSettings>()
            .init_resource::<TickReport>()
            .add_message::<ParticleFault>()
            .configure_sets(
                self.schedule,
                (MassSpringSystems::Gather, MassSpringSystems::Step, MassSpringSystems::Scatter).chain(),
            )
            .configure_sets(
                self.schedule,
                (MassSpringSystems::Gather, MassSpringSystems::Step, MassSpringSystems::Scatter)
                    .run_if(time_advances),
            )
            .add_plugins(time_control::plugin);
        sync::build(app, self.schedule);
        #[cfg(feature = "scene")]
        app.add_plugins(crate::scene::plugin);
        register_types(app);
        #[cfg(feature = "interpolation")]
        self.build_interpolation(app);
    }

    #[cfg(feature = "scene")]
    fn finish(&self, app: &mut App) {
        crate::scene::finish(app);
    }
}

/// In a schedule that runs each frame, such as `Update`, nothing moves while time is paused.
fn time_advances(time: Res<Time>) -> bool {
    !time.delta().is_zero()
}

fn register_types(app: &mut App) {
    app.register_type::<(Particle, ParticleVelocity, Pinned, Quarantined, AppliedForce, Spring, PlaneCollider)>()
        .register_type::<(Environment, SolverSettings, CollisionSettings, TickReport)>()
        .register_type::<(crate::collider::Contact, ParticleFault, crate::diagnostics::Measurements)>();
}
