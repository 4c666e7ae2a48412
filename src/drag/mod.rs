//! Picks particles with the pointer and drags them.
//!
//! `picking` is a backend of Bevy's picking that needs no meshes; `grip` follows the pointer, `pull` moves what is in the
//! grip. This module owns [`ParticleDrag`] and is the only one that names `Pointer`. It moves pinned particles by their
//! `Transform`, or that of the [`Part`](crate::nets::Part) that holds them, and free ones by the force that is applied to
//! them, and is independent of the solver.

mod grip;
mod handle;
mod picking;
mod pull;
mod seen;

use bevy::app::Plugin;
use bevy::input::InputSystems;
use bevy::picking::{InteractionPlugin, PickingSystems};
use bevy::prelude::*;

use crate::schedule::{MassSpringSystems, simulation_schedule};

/// Lets the pointer drag particles, loose ones and those of nets.
///
/// The left button drags any particle: a [`Pinned`](crate::particle::Pinned) one follows the pointer
/// in the plane through it that faces the camera (in [two dimensions](crate::Dimensions), in its layer), a free one is pulled towards it by a force in
/// proportion to its mass (see [`ParticleDragSettings`]). While `Time<Virtual>` is paused a free one
/// follows too, since no force acts then. Ctrl with the middle or right button, anywhere in the scene,
/// drags the anchor: the particle marked with [`DragAnchor`], else the pinned one that is nearest to
/// the pointer.
///
/// A net is grabbed at the particle that is nearest to where the pointer meets its surface, or at one near the pointer.
/// Its hit in Bevy's picking has the entity of the net, and a [`NetHit`](crate::nets::NetHit) as extra data. A particle
/// that a pinned [`Part`](crate::nets::Part) holds takes that part along.
///
/// What is under the pointer and in its grip is published as [`ParticleDrag`], where
/// `MassSpringGizmosPlugin` (feature `gizmos`) finds it to draw a ring. Anything that
/// covers the scene for Bevy's picking, such as an egui panel, covers the particles as well.
///
/// In an app without Bevy's picking, which is part of `DefaultPlugins`, it does nothing.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_mass_spring::prelude::*;
/// # let mut app = App::new();
/// # app.add_plugins(MinimalPlugins);
/// app.add_plugins((MassSpringPlugin::default(), ParticleDragPlugin));
/// # app.update();
/// ```
#[derive(Debug, Clone, Copy, Default)]
pub struct ParticleDragPlugin;

impl Plugin for ParticleDragPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<ParticleDrag>().init_resource::<ParticleDragSettings>().register_type::<(
            ParticleDrag,
            ParticleDragSettings,
            DragAnchor,
        )>();
    }

    fn finish(&self, app: &mut App) {
        let Some(schedule) = simulation_schedule(app) else { return };
        if !app.is_plugin_added::<InteractionPlugin>() {
            return;
        }
        app.init_resource::<grip::Grip>()
            .init_resource::<picking::NetPicks>()
            .add_systems(
                PreUpdate,
                (
                    picking::pick_particles.in_set(PickingSystems::Backend),
                    (grip::follow_presses, grip::publish_hovered, grip::move_target, pull::place_particle)
                        .chain()
                        .in_set(PickingSystems::PostHover)
                        .after(InputSystems),
                ),
            )
            .add_systems(
                schedule,
                (
                    pull::pull_particle.before(MassSpringSystems::Gather),
                    pull::remove_pull.after(MassSpringSystems::Scatter),
                ),
            );
    }
}

/// Which particle the pointer is over, and which it drags. Written by [`ParticleDragPlugin`] once a frame.
#[derive(Resource, Reflect, Debug, Clone, Copy, Default, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[reflect(Resource, Default, Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serialize", reflect(Serialize, Deserialize))]
#[non_exhaustive]
pub struct ParticleDrag {
    /// The particle under the pointer, or the net of which it is one.
    pub hovered: Option<Entity>,
    /// Its number in the net; `None` of a loose particle.
    pub hovered_index: Option<u32>,
    /// The particle in the pointer's grip, or the net of which it is one.
    pub dragged: Option<Entity>,
    /// Its number in the net; `None` of a loose particle.
    pub dragged_index: Option<u32>,
    /// The target of the dragged particle, in world space, m.
    pub target: Option<Vec3>,
    /// The camera through which the pointer sees the particle that is hovered or dragged.
    pub camera: Option<Entity>,
}

/// How [`ParticleDragPlugin`] picks and pulls.
#[derive(Resource, Reflect, Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[reflect(Resource, Default, Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serialize", reflect(Serialize, Deserialize))]
pub struct ParticleDragSettings {
    /// Whether particles can be picked and dragged. Default true.
    pub enabled: bool,
    /// Particles that look smaller than this radius, in logical pixels, are picked as if they had it.
    /// Finite and >= 0, default 10.
    pub pick_radius: f32,
    /// The angular frequency ω, in rad/s, of the critically damped pull on a free particle:
    /// F = m (ω² (target − x) − 2 ω v − g), plus the weight of what hangs from it. Finite and
    /// > 0, default 25.
    ///
    /// At time steps above 1/60 s, a smaller one is used where this one would be unstable.
    pub frequency: f32,
    /// The largest acceleration in m/s² that the pull gives to a particle, gravity aside. Finite and
    /// >= 0, default 400.
    pub max_acceleration: f32,
}

impl Default for ParticleDragSettings {
    fn default() -> Self {
        Self { enabled: true, pick_radius: 10.0, frequency: 25.0, max_acceleration: 400.0 }
    }
}

/// Marks the particle that Ctrl with the middle or right button drags from anywhere.
#[derive(Component, Reflect, Debug, Clone, Copy, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serialize", reflect(Serialize, Deserialize))]
pub struct DragAnchor;
