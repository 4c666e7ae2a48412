//! All plugins of the crate, in one group.

use bevy::app::PluginGroupBuilder;
use bevy::ecs::intern::Interned;
use bevy::ecs::schedule::ScheduleLabel;
use bevy::prelude::*;

use crate::MassSpringPlugin;
use crate::diagnostics::MassSpringDiagnosticsPlugin;
use crate::time_control::SingleStepPlugin;

/// All plugins of the crate. Add it after `DefaultPlugins` or `MinimalPlugins`.
///
/// | plugin | feature | what it does |
/// | --- | --- | --- |
/// | [`MassSpringPlugin`] | | the physics, in the schedule of the group |
/// | [`SingleStepPlugin`] | | single ticks while time is paused |
/// | [`MassSpringDiagnosticsPlugin`] | | energies, momentum, extremes and costs, after each tick |
/// | `MassSpringScenePlugin` | `scene` | loads and spawns scene files, in apps with assets |
/// | `MassSpringInterpolationPlugin` | `interpolation` | smooth motion between ticks, in apps with input |
/// | `MassSpringRenderPlugin` | `render` | draws nets, in apps with meshes |
/// | `MassSpringCrowdPlugin` | `crowd` | draws crowds of ropes, in apps with `PbrPlugin` |
/// | `MassSpringGltfPlugin` | `gltf` | makes nets of the nodes of glTF files |
/// | `MassSpringGizmosPlugin` | `gizmos` | draws particles, springs, colliders and contacts, in apps with gizmos |
/// | `ParticleDragPlugin` | `drag` | drags particles by the pointer, in apps with picking |
/// | `MassSpringPanelPlugin` | `panel` | the egui panel, in apps with a window |
///
/// Diagnostics, interpolation, dragging and the panel are set up in `Plugin::finish`, where the order of plugins
/// does not matter: an app that is updated by hand calls `App::finish` and `App::cleanup` first.
///
/// Each can be disabled, and those with fields can be set:
///
/// ```
/// use bevy::prelude::*;
/// use bevy_mass_spring::prelude::*;
///
/// # let mut app = App::new();
/// # app.add_plugins(MinimalPlugins);
/// app.add_plugins(MassSpringPlugins::default().build().disable::<SingleStepPlugin>());
/// # app.finish();
/// # app.update();
/// ```
#[derive(Debug, Clone)]
pub struct MassSpringPlugins {
    schedule: Interned<dyn ScheduleLabel>,
}

impl MassSpringPlugins {
    /// Runs the simulation, and what belongs to each of its ticks, in `schedule`; the default is
    /// [`FixedPostUpdate`]. The time step is that of [`Time`] there.
    ///
    /// ```
    /// use bevy::prelude::*;
    /// use bevy_mass_spring::prelude::*;
    ///
    /// # let mut app = App::new();
    /// # app.add_plugins(MinimalPlugins);
    /// app.add_plugins(MassSpringPlugins::new(FixedUpdate));
    /// # app.finish();
    /// # app.update();
    /// ```
    pub fn new(schedule: impl ScheduleLabel) -> Self {
        Self { schedule: schedule.intern() }
    }
}

impl Default for MassSpringPlugins {
    fn default() -> Self {
        Self::new(FixedPostUpdate)
    }
}

impl PluginGroup for MassSpringPlugins {
    fn build(self) -> PluginGroupBuilder {
        let group = PluginGroupBuilder::start::<Self>();
        // Before the physics, which adds them where it is set to anything but `physics_only`.
        let group = group.add(SingleStepPlugin);
        #[cfg(feature = "scene")]
        let group = group.add(crate::scene::MassSpringScenePlugin);
        #[cfg(feature = "interpolation")]
        let group = group.add(crate::interpolation::MassSpringInterpolationPlugin::default());
        #[cfg(feature = "render")]
        let group = group.add(crate::render::MassSpringRenderPlugin);
        #[cfg(feature = "crowd")]
        let group = group.add(crate::render::MassSpringCrowdPlugin::default());
        let group =
            group.add(MassSpringPlugin::new(self.schedule).physics_only()).add(MassSpringDiagnosticsPlugin);
        #[cfg(feature = "gltf")]
        let group = group.add(crate::gltf::MassSpringGltfPlugin);
        #[cfg(feature = "gizmos")]
        let group = group.add(crate::gizmos::MassSpringGizmosPlugin);
        #[cfg(feature = "drag")]
        let group = group.add(crate::drag::ParticleDragPlugin);
        #[cfg(feature = "panel")]
        let group = group.add(crate::panel::MassSpringPanelPlugin);
        group
    }
}
