//! Draws particles, springs, colliders and contacts with Bevy's gizmos.
//!
//! Owns the gizmo group [`MassSpringGizmos`] and reads components and published results only. It
//! draws in `PostUpdate` from [`GlobalTransform`], hence where things are seen, after interpolation; nets where `render`
//! draws them.

mod colliders;
mod contacts;
mod nets;

use bevy::app::Plugin;
use bevy::color::Mix;
use bevy::gizmos::GizmoPlugin;
use bevy::prelude::*;
use bevy::transform::TransformSystems;

use crate::particle::{Particle, Pinned};
use crate::report::{InvalidColliders, SleepingParticles};
use crate::settings::Dimensions;
use crate::spring::Spring;

/// Draws the simulation with gizmos, loose particles and nets, as [`MassSpringGizmos`] says.
///
/// Add it after `DefaultPlugins`. In an app without Bevy's `GizmoPlugin`, such as a headless one, it
/// does nothing.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_mass_spring::prelude::*;
/// # let mut app = App::new();
/// # app.add_plugins(MinimalPlugins);
/// app.add_plugins((MassSpringPlugin::default(), MassSpringGizmosPlugin));
/// # app.update();
/// ```
#[derive(Debug, Clone, Copy, Default)]
pub struct MassSpringGizmosPlugin;

impl Plugin for MassSpringGizmosPlugin {
    fn build(&self, app: &mut App) {
        if !app.is_plugin_added::<GizmoPlugin>() {
            return;
        }
        app.init_gizmo_group::<MassSpringGizmos>()
            .init_resource::<SleepingParticles>()
            .init_resource::<InvalidColliders>()
            .add_systems(
                PostUpdate,
                (
                    draw_particles,
                    draw_springs,
                    nets::draw_particles,
                    nets::draw_springs,
                    colliders::draw_colliders,
                )
                    .after(TransformSystems::Propagate),
            )
            .add_systems(
                PostUpdate,
                contacts::draw_contacts
                    .run_if(resource_exists::<Messages<crate::collider::Contact>>)
                    .after(TransformSystems::Propagate),
            )
            .add_systems(
                PreUpdate,
                contacts::collect_contacts.run_if(resource_exists_and_changed::<GizmoConfigStore>),
            );
        #[cfg(feature = "drag")]
        app.add_systems(PostUpdate, draw_grip.after(TransformSystems::Propagate));
    }
}

/// What is drawn, and how: the gizmo group of [`MassSpringGizmosPlugin`].
///
/// Change it through Bevy's `GizmoConfigStore`:
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_mass_spring::prelude::*;
/// fn hide_colliders(mut store: ResMut<GizmoConfigStore>) {
///     store.config_mut::<MassSpringGizmos>().1.colliders = false;
/// }
/// ```
#[derive(Reflect, GizmoConfigGroup, Debug, Clone)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[reflect(Default)]
#[cfg_attr(feature = "serialize", reflect(Serialize, Deserialize))]
pub struct MassSpringGizmos {
    /// Whether the outline of each particle is drawn. Default true.
    pub particles: bool,
    /// Whether springs are drawn as lines coloured by their stretch. Default true.
    pub springs: bool,
    /// Whether the outline of each collider is drawn, of half-spaces a patch of grid and the normal. Default true.
    pub colliders: bool,
    /// Whether points, normals and impulses of contacts are drawn: those of the ticks of this frame, or, if it had none,
    /// of the last one that had. Default false.
    ///
    /// As long as they are, the messages [`Contact`](crate::Contact) are collected, as in an app with
    /// `add_message::<Contact>()`.
    pub contacts: bool,
    /// Whether a ring marks the particle under the pointer or in its grip (feature `drag`). Default true.
    pub grip: bool,
    /// Colour of free particles.
    pub particle_color: Color,
    /// Colour of particles that [sleep](crate::settings::SleepSettings).
    pub asleep_color: Color,
    /// Colour of [`Pinned`] particles.
    pub pinned_color: Color,
    /// Colour of springs at their rest length.
    pub relaxed_color: Color,
    /// Colour of springs stretched by [`full_stretch`](Self::full_stretch) or more.
    pub tension_color: Color,
    /// Colour of springs compressed by [`full_stretch`](Self::full_stretch) or more.
    pub compression_color: Color,
    /// The |l − l0| / l0 at which a spring has its full colour, > 0. Default 0.1.
    pub full_stretch: f32,
    /// Colour of colliders.
    pub collider_color: Color,
    /// Colour of colliders that are sensors.
    pub sensor_color: Color,
    /// Colour of colliders that are left out of the simulation: see [`InvalidColliders`].
    pub invalid_color: Color,
    /// Colour of contacts.
    pub contact_color: Color,
    /// The length of the arrow of a contact, m for each N·s of its impulse in the tick, >= 0. Default 1.
    pub contact_scale: f32,
    /// Side of the square of the surface of a half-space that is drawn, in m, > 0. Default 10.
    pub half_space_size: f32,
    /// Colour of the ring around the particle under the pointer.
    pub hovered_color: Color,
    /// Colour of the ring around the particle in the pointer's grip.
    pub dragged_color: Color,
}

impl Default for MassSpringGizmos {
    fn default() -> Self {
        Self {
            particles: true,
            springs: true,
            colliders: true,
            contacts: false,
            grip: true,
            particle_color: Color::srgb(0.35, 0.75, 1.0),
            asleep_color: Color::srgb(0.2, 0.35, 0.5),
            pinned_color: Color::srgb(1.0, 0.55, 0.2),
            relaxed_color: Color::srgb(0.8, 0.8, 0.8),
            tension_color: Color::srgb(1.0, 0.2, 0.15),
            compression_color: Color::srgb(0.25, 0.4, 1.0),
            full_stretch: 0.1,
            collider_color: Color::srgb(0.45, 0.5, 0.55),
            sensor_color: Color::srgb(0.3, 0.8, 0.4),
            invalid_color: Color::srgb(0.95, 0.1, 0.5),
            contact_color: Color::srgb(1.0, 0.3, 0.8),
            contact_scale: 1.0,
            half_space_size: 10.0,
            hovered_color: Color::srgb(1.0, 1.0, 1.0),
            dragged_color: Color::srgb(1.0, 0.85, 0.2),
        }
    }
}

impl MassSpringGizmos {
    /// The colour of a spring that is `length` m long.
    pub fn spring_color(&self, spring: &Spring, length: f32) -> Color {
        self.color_of_stretch(spring.rest_length, spring.tension_only, length)
    }

    fn color_of_particle(&self, is_pinned: bool, is_asleep: bool) -> Color {
        match (is_pinned, is_asleep) {
            (true, _) => self.pinned_color,
            (false, true) => self.asleep_color,
            (false, false) => self.particle_color,
        }
    }

    fn color_of_collider(&self, is_invalid: bool, is_sensor: bool) -> Color {
        match (is_invalid, is_sensor) {
            (true, _) => self.invalid_color,
            (false, true) => self.sensor_color,
            (false, false) => self.collider_color,
        }
    }

    fn color_of_stretch(&self, rest_length: f32, tension_only: bool, length: f32) -> Color {
        // A spring of rest length 0 has no relative stretch: its length in m stands in for it.
        let unit = if rest_length > 0.0 { rest_length } else { 1.0 };
        let elongation = length - rest_length;
        let elongation = if tension_only { elongation.max(0.0) } else { elongation };
        let share = elongation / (unit * self.full_stretch);
        let far = if share < 0.0 { self.compression_color } else { self.tension_color };
        self.relaxed_color.mix(&far, share.abs().min(1.0))
    }
}

fn draw_particles(
    mut gizmos: Gizmos<MassSpringGizmos>,
    particles: Query<(Entity, &Particle, &GlobalTransform, Has<Pinned>)>,
    sleeping: Option<Res<SleepingParticles>>,
) {
    if !gizmos.config_ext.particles {
        return;
    }
    for (entity, particle, transform, pinned) in &particles {
        let is_asleep = sleeping.as_ref().is_some_and(|sleeping| sleeping.contains(entity, None));
        let color = gizmos.config_ext.color_of_particle(pinned, is_asleep);
        gizmos.sphere(transform.translation(), particle.radius, color).resolution(16);
    }
}

fn draw_springs(
    mut gizmos: Gizmos<MassSpringGizmos>,
    springs: Query<&Spring>,
    particles: Query<&GlobalTransform, With<Particle>>,
    dimensions: Option<Res<Dimensions>>,
) {
    if !gizmos.config_ext.springs {
        return;
    }
    let is_flat = dimensions.is_some_and(|dimensions| *dimensions == Dimensions::Two);
    for spring in &springs {
        if let Ok([first, second]) = particles.get_many(spring.particles) {
            let (first, second) = (first.translation(), second.translation());
            let color = gizmos.config_ext.spring_color(spring, length([first, second], is_flat));
            gizmos.line(first, second, color);
        }
    }
}

/// The length of a spring, m; in two dimensions that in the plane of motion.
fn length([first, second]: [Vec3; 2], is_flat: bool) -> f32 {
    if is_flat { first.truncate().distance(second.truncate()) } else { first.distance(second) }
}

/// Draws a ring, facing the camera, around the particle under the pointer or in its grip.
#[cfg(feature = "drag")]
fn draw_grip(
    mut gizmos: Gizmos<MassSpringGizmos>,
    drag: Option<Res<crate::drag::ParticleDrag>>,
    particles: Query<(&Particle, &GlobalTransform)>,
    nets: nets::SeenNets,
    cameras: Query<&GlobalTransform, With<Camera>>,
) {
    let Some(drag) = drag.filter(|_| gizmos.config_ext.grip) else { return };
    let (entity, index, color) = match (drag.dragged, drag.hovered) {
        (Some(dragged), _) => (dragged, drag.dragged_index, gizmos.config_ext.dragged_color),
        (None, Some(hovered)) => (hovered, drag.hovered_index, gizmos.config_ext.hovered_color),
        (None, None) => return,
    };
    let Some(camera) = drag.camera.and_then(|camera| cameras.get(camera).ok()) else { return };
    let found = match index {
        Some(index) => nets.get(entity).and_then(|net| Some((net.place(index)?, net.net.radius()))),
        None => particles.get(entity).ok().map(|(particle, place)| (place.translation(), particle.radius)),
    };
    let Some((center, radius)) = found else { return };
    // Around a tiny particle the ring would be too small to see: at least 1 % of the distance.
    let radius = (1.4 * radius).max(0.01 * center.distance(camera.translation()));
    gizmos.circle(Isometry3d::new(center, camera.rotation()), radius, color);
    if let Some(target) = drag.target {
        gizmos.line(center, target, color);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn redness(color: Color) -> f32 {
        let color = color.to_srgba();
        color.red - color.blue
    }

    #[test]
    fn springs_are_coloured_by_their_stretch() {
        let gizmos = MassSpringGizmos::default();
        let spring = Spring::new(Entity::PLACEHOLDER, Entity::PLACEHOLDER, 1.0);
        assert_eq!(gizmos.spring_color(&spring, 1.0).to_srgba(), gizmos.relaxed_color.to_srgba());
        assert!(redness(gizmos.spring_color(&spring, 1.05)) > 0.0);
        assert!(redness(gizmos.spring_color(&spring, 0.95)) < 0.0);
        assert_eq!(gizmos.spring_color(&spring, 9.0).to_srgba(), gizmos.tension_color.to_srgba());
    }

    #[test]
    fn a_spring_of_rest_length_zero_has_a_finite_colour() {
        let spring = Spring::new(Entity::PLACEHOLDER, Entity::PLACEHOLDER, 0.0);
        let color = MassSpringGizmos::default().spring_color(&spring, 0.0).to_srgba();
        assert!(color.red.is_finite());
    }

    #[test]
    fn the_plugin_does_nothing_without_gizmos() {
        let mut app = App::new();
        app.add_plugins((MinimalPlugins, MassSpringGizmosPlugin));
        app.update();
    }
}
