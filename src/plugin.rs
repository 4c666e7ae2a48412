//! Wiring: which resources exist and which system runs when. No physics here.

use bevy::ecs::intern::Interned;
use bevy::ecs::schedule::ScheduleLabel;
use bevy::prelude::*;

use crate::bend::Bend;
use crate::collider::{
    ColliderMotion, ColliderShape, CollisionSettings, ContactEvents, ContactExemptions, ContactLayers,
    ContactMaterial, ParticleCollider,
};
use crate::environment::Environment;
use crate::nets::{
    self, Attachment, Balloon, Breaking, Cloth, Jelly, Part, PartOf, PartState, ParticleNet, Parts, Rope,
    Winch, Yielding,
};
use crate::particle::{AppliedForce, Particle, ParticleVelocity, Pinned, Quarantined, SimulationOrder};
use crate::report::{
    Broke, InvalidColliders, ParticleFault, Reaction, SleepingParticles, SpringForces, TickReport,
};
use crate::schedule::{MassSpringSystems, SimulationSchedule, Tick, time_advances};
use crate::settings::{Dimensions, OrphanedSprings, SleepSettings, SolverSettings};
use crate::spring::{Broken, Spring};
use crate::sync;
use crate::time_control::SingleStepPlugin;

/// Mass-spring physics, beside `DefaultPlugins` or `MinimalPlugins`.
///
/// It also adds [`SingleStepPlugin`], `MassSpringScenePlugin` (feature `scene`), `MassSpringRenderPlugin` (feature
/// `render`) and `MassSpringInterpolationPlugin` (feature `interpolation`), unless they were added before it.
/// [`MassSpringPlugins`](crate::MassSpringPlugins) holds these and all others of the crate, each of which
/// can be configured and disabled there.
#[derive(Debug, Clone)]
pub struct MassSpringPlugin {
    schedule: Interned<dyn ScheduleLabel>,
    companions: bool,
    #[cfg(feature = "interpolation")]
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
        Self {
            schedule: schedule.intern(),
            companions: true,
            #[cfg(feature = "interpolation")]
            interpolation: None,
        }
    }

    /// The physics alone: it adds no other plugin.
    pub fn physics_only(mut self) -> Self {
        self.companions = false;
        self
    }

    /// Switches the smoothing of motion between ticks on or off (feature `interpolation`).
    ///
    /// By default it is on in apps with Bevy's `InputPlugin`, which is part of `DefaultPlugins`, and off in
    /// others: see [`MassSpringInterpolationPlugin`](crate::MassSpringInterpolationPlugin), which this
    /// configures. A plugin of that type that was added before keeps its own configuration.
    #[cfg(feature = "interpolation")]
    pub fn with_interpolation(mut self, interpolation: bool) -> Self {
        self.interpolation = Some(interpolation);
        self
    }

    fn add_companions(&self, app: &mut App) {
        add_once(app, SingleStepPlugin);
        #[cfg(feature = "scene")]
        add_once(app, crate::scene::MassSpringScenePlugin);
        #[cfg(feature = "render")]
        add_once(app, crate::render::MassSpringRenderPlugin);
        #[cfg(feature = "crowd")]
        add_once(app, crate::render::MassSpringCrowdPlugin::default());
        #[cfg(feature = "interpolation")]
        if self.interpolation != Some(false) {
            let headless = self.interpolation == Some(true);
            add_once(app, crate::interpolation::MassSpringInterpolationPlugin { headless });
        }
    }
}

impl Plugin for MassSpringPlugin {
    fn build(&self, app: &mut App) {
        app.insert_resource(SimulationSchedule(self.schedule))
            .init_resource::<Environment>()
            .init_resource::<SolverSettings>()
            .init_resource::<SleepSettings>()
            .init_resource::<CollisionSettings>()
            .init_resource::<Dimensions>()
            .init_resource::<OrphanedSprings>()
            .init_resource::<TickReport>()
            .add_message::<ParticleFault>()
            .add_message::<Broke>()
            .configure_sets(
                self.schedule,
                (MassSpringSystems::Gather, MassSpringSystems::Step, MassSpringSystems::Scatter)
                    .chain()
                    .in_set(Tick),
            )
            .configure_sets(self.schedule, Tick.run_if(time_advances));
        sync::build(app, self.schedule);
        nets::build(app, self.schedule);
        register_types(app);
        if self.companions {
            self.add_companions(app);
        }
    }
}

/// Adds a plugin unless one of its type is there.
fn add_once<P: Plugin>(app: &mut App, plugin: P) {
    if !app.is_plugin_added::<P>() {
        app.add_plugins(plugin);
    }
}

fn register_types(app: &mut App) {
    app.register_type::<(Particle, ParticleVelocity, Pinned, Quarantined, AppliedForce, Spring, Bend, ParticleCollider)>()
        .register_type::<(ColliderMotion, ColliderShape, ContactEvents)>()
        .register_type::<(ContactExemptions, ContactLayers, ContactMaterial)>()
        .register_type::<(Environment, SolverSettings, SleepSettings, Dimensions, OrphanedSprings, CollisionSettings)>()
        .register_type::<(Rope, Cloth, Jelly, Balloon)>()
        .register_type::<(ParticleNet, Part, PartOf, Parts, PartState, Breaking, Yielding, Attachment, Winch)>()
        .register_type::<(TickReport, SleepingParticles, InvalidColliders, SpringForces, Reaction, SimulationOrder, Broken, Broke)>()
        .register_type::<(crate::collider::Contact, crate::collider::ContactStarted, crate::collider::ContactEnded, ParticleFault, crate::diagnostics::Measurements)>();
}
