//! The grip: which particle a press grabs, its target under the pointer, and its motion towards it.

use bevy::camera::visibility::RenderLayers;
use bevy::picking::backend::ray::RayMap;
use bevy::picking::hover::HoverMap;
use bevy::picking::pointer::{PointerAction, PointerButton, PointerId, PointerInput, PointerLocation};
use bevy::prelude::*;
use bevy::window::WindowFocused;

use super::picking::sees;
use super::{DragAnchor, ParticleDrag, ParticleDragSettings};
use crate::environment::Environment;
use crate::particle::{AppliedForce, Particle, ParticleVelocity, Pinned, Quarantined};
use crate::settings::Dimensions;

/// The particle in the pointer's grip, if any.
#[derive(Resource, Default)]
pub(super) struct Grip(Option<Held>);

struct Held {
    particle: Entity,
    pointer: PointerId,
    button: PointerButton,
    camera: Entity,
    /// The plane through the particle in which it is dragged: the one that faced the camera when it was grabbed, or in two
    /// dimensions its layer.
    plane: (Vec3, InfinitePlane3d),
    /// From the pointer to the particle's centre, in that plane, m.
    offset: Vec3,
    /// Whether this module inserted the `AppliedForce`, and removes it in the end.
    inserted_force: bool,
    /// The acceleration in m/s² that carries what hangs from the particle, found while pulling.
    load: Vec3,
    /// The force before the pull was added to it, and after, while a tick runs.
    pull: Option<(Vec3, Vec3)>,
}

impl Held {
    /// The target of the particle when the pointer looks along `ray`; `None` if the ray misses the plane.
    fn target(&self, ray: Ray3d) -> Option<Vec3> {
        Some(ray.plane_intersection_point(self.plane.0, self.plane.1)? + self.offset)
    }
}

type Particles<'w, 's> = Query<
    'w,
    's,
    (Entity, &'static GlobalTransform, Option<&'static RenderLayers>, Has<Pinned>, Has<DragAnchor>),
    (With<Particle>, Without<Quarantined>),
>;

/// Grabs on presses and releases on releases.
///
/// The raw stream of pointer inputs is read, and not the events that picking derives from it, because
/// Ctrl with a button may be pressed where nothing is under the pointer.
pub(super) fn follow_presses(
    (mut inputs, mut focus): (MessageReader<PointerInput>, MessageReader<WindowFocused>),
    keys: Res<ButtonInput<KeyCode>>,
    (settings, dimensions): (Res<ParticleDragSettings>, Res<Dimensions>),
    (hover, rays): (Res<HoverMap>, Res<RayMap>),
    cameras: Query<(&Camera, &GlobalTransform, Option<&RenderLayers>)>,
    particles: Particles,
    mut forces: Query<&AppliedForce>,
    mut grip: ResMut<Grip>,
    mut commands: Commands,
) {
    for input in inputs.read() {
        match input.action {
            PointerAction::Press(button) if grip.0.is_none() && settings.enabled => {
                let ctrl = keys.any_pressed([KeyCode::ControlLeft, KeyCode::ControlRight]);
                let pointer = input.pointer_id;
                let grabbed = match button {
                    PointerButton::Primary if !ctrl => hovered(pointer, &hover, &particles),
                    PointerButton::Secondary | PointerButton::Middle if ctrl => {
                        anchor(pointer, &hover, &rays, &cameras, &particles)
                    }
                    _ => None,
                };
                grip.0 = grabbed.and_then(|(particle, camera)| {
                    let center = particles.get(particle).ok()?.1.translation();
                    let (_, camera_transform, _) = cameras.get(camera).ok()?;
                    let ray = ray_of(&rays, camera, pointer)?;
                    let normal = match *dimensions {
                        Dimensions::Two => Dir3::Z,
                        Dimensions::Three => camera_transform.back(),
                    };
                    let plane = (center, InfinitePlane3d::new(normal));
                    let point = ray.plane_intersection_point(plane.0, plane.1)?;
                    let offset = center - point;
                    let held = Held {
                        particle,
                        pointer,
                        button,
                        camera,
                        plane,
                        offset,
                        inserted_force: false,
                        load: Vec3::ZERO,
                        pull: None,
                    };
                    Some(held)
                });
            }
            PointerAction::Release(button) => release_if(&mut grip, &mut forces, &mut commands, |held| {
                held.pointer == input.pointer_id && held.button == button
            }),
            PointerAction::Cancel => {
                release_if(&mut grip, &mut forces, &mut commands, |held| held.pointer == input.pointer_id);
            }
            _ => {}
        }
    }
    // A window that loses the focus may not get the release.
    let blurred = focus.read().any(|message| !message.focused);
    release_if(&mut grip, &mut forces, &mut commands, |held| {
        blurred || !settings.enabled || !particles.contains(held.particle) || !cameras.contains(held.camera)
    });
}

/// The particle that a pointer is over, and the camera of its ray.
fn hovered(pointer: PointerId, hover: &HoverMap, particles: &Particles) -> Option<(Entity, Entity)> {
    let hits = hover.get(&pointer)?;
    hits.iter().find(|(entity, _)| particles.contains(**entity)).map(|(entity, hit)| (*entity, hit.camera))
}

/// The particle that Ctrl and a button drag from anywhere, and the camera through which it is seen.
fn anchor(
    pointer: PointerId,
    hover: &HoverMap,
    rays: &RayMap,
    cameras: &Query<(&Camera, &GlobalTransform, Option<&RenderLayers>)>,
    particles: &Particles,
) -> Option<(Entity, Entity)> {
    // An overlay such as egui reports the camera that shows it as what is under the pointer.
    let covered = hover.get(&pointer).is_some_and(|hits| hits.keys().any(|entity| cameras.contains(*entity)));
    if covered {
        return None;
    }
    let mut best: Option<((bool, f32), (Entity, Entity))> = None;
    for (id, ray) in rays.iter().filter(|(id, _)| id.pointer == pointer) {
        let Ok((_, _, camera_layers)) = cameras.get(id.camera) else { continue };
        for (entity, transform, layers, pinned, marked) in particles {
            if !(pinned || marked) || !sees(camera_layers, layers) {
                continue;
            }
            let to_center = transform.translation() - ray.origin;
            let angle = to_center.angle_between(*ray.direction);
            let rank = (!marked, angle);
            if best.is_none_or(|(best_rank, _)| rank < best_rank) {
                best = Some((rank, (entity, id.camera)));
            }
        }
    }
    best.map(|(_, found)| found)
}

fn ray_of(rays: &RayMap, camera: Entity, pointer: PointerId) -> Option<Ray3d> {
    rays.iter().find(|(id, _)| id.camera == camera && id.pointer == pointer).map(|(_, ray)| *ray)
}

fn release_if(
    grip: &mut Grip,
    forces: &mut Query<&AppliedForce>,
    commands: &mut Commands,
    condition: impl FnOnce(&Held) -> bool,
) {
    let Some(held) = grip.0.take_if(|held| condition(held)) else { return };
    // The game may have set the force in the meantime: only a zero one is removed.
    let idle = forces.get(held.particle).is_ok_and(|force| force.0 == Vec3::ZERO);
    if held.inserted_force && idle {
        commands.entity(held.particle).try_remove::<AppliedForce>();
    }
}

/// Publishes what is under the pointer and in its grip.
pub(super) fn publish_hovered(
    hover: Res<HoverMap>,
    particles: Particles,
    grip: Res<Grip>,
    mut drag: ResMut<ParticleDrag>,
) {
    let hovered = hover.keys().find_map(|pointer| hovered(*pointer, &hover, &particles));
    let held = grip.0.as_ref();
    let published = ParticleDrag {
        hovered: hovered.map(|(particle, _)| particle),
        dragged: held.map(|held| held.particle),
        target: held.and(drag.target),
        camera: held.map(|held| held.camera).or(hovered.map(|(_, camera)| camera)),
    };
    drag.set_if_neq(published);
}

/// Moves the target with the pointer, also from outside of the window while a button is held.
pub(super) fn move_target(
    grip: Res<Grip>,
    pointers: Query<(&PointerId, &PointerLocation)>,
    cameras: Query<(&Camera, &GlobalTransform)>,
    mut drag: ResMut<ParticleDrag>,
) {
    let Some(held) = &grip.0 else { return };
    let target = || {
        let (_, location) = pointers.iter().find(|(id, _)| **id == held.pointer)?;
        let (camera, transform) = cameras.get(held.camera).ok()?;
        let ray = camera.viewport_to_world(transform, location.location()?.position).ok()?;
        held.target(ray)
    };
    if let Some(target) = target().filter(|target| target.is_finite()) {
        drag.target = Some(target);
    }
}

/// Moves a pinned particle to the target; a free one too while time is paused, when no force acts.
pub(super) fn place_particle(
    drag: Res<ParticleDrag>,
    (time, dimensions): (Res<Time<Virtual>>, Res<Dimensions>),
    mut particles: Query<(&mut Transform, Option<&ChildOf>, Has<Pinned>), With<Particle>>,
    parents: Query<&GlobalTransform>,
) {
    let (Some(particle), Some(target)) = (drag.dragged, drag.target) else { return };
    let Ok((mut transform, parent, pinned)) = particles.get_mut(particle) else { return };
    if !pinned && !time.is_paused() {
        return;
    }
    let local = match parent.and_then(|parent| parents.get(parent.parent()).ok()) {
        Some(parent) => parent.affine().inverse().transform_point3(target),
        None => target,
    };
    let local = match *dimensions {
        Dimensions::Two => local.with_z(transform.translation.z),
        Dimensions::Three => local,
    };
    if local.is_finite() && transform.translation != local {
        transform.translation = local;
    }
}

/// Adds the pull to the force on a free particle, for this tick only.
pub(super) fn pull_particle(
    time: Res<Time>,
    settings: Res<ParticleDragSettings>,
    environment: Option<Res<Environment>>,
    (drag, mut grip): (Res<ParticleDrag>, ResMut<Grip>),
    mut particles: Query<(&Particle, &ParticleVelocity, Option<&mut AppliedForce>), Without<Pinned>>,
    helper: TransformHelper,
    mut commands: Commands,
) {
    let (Some(held), Some(target)) = (&mut grip.0, drag.target) else { return };
    let Ok((particle, velocity, force)) = particles.get_mut(held.particle) else { return };
    let Some(mut force) = force else {
        // From the next tick on; commands cannot reach this one in every schedule.
        commands.entity(held.particle).try_insert(AppliedForce::default());
        held.inserted_force = true;
        return;
    };
    let Ok(position) = helper.compute_global_transform(held.particle) else { return };
    let gravity = environment.map_or(Vec3::ZERO, |environment| environment.effective_gravity());
    let away = target - position.translation();
    let acceleration = pull_acceleration(away, velocity.0, &mut held.load, time.delta_secs(), &settings);
    let pull = particle.mass * (acceleration - gravity);
    if pull.is_finite() {
        let before = force.0;
        force.0 += pull;
        held.pull = Some((before, force.0));
    }
}

/// The acceleration that brings a particle to rest at `away` from here.
///
/// a = ω² away − 2 ω v, critically damped, and in addition the `load`, the integral of ω³/8 away: it
/// converges to the weight of what hangs from the particle, which would else sag below the pointer.
/// All is held constant over a time step h. For u = ωh < 0.9 the eigenvalues of that recurrence are
/// inside the unit circle; 0.5 leaves a margin for the springs and dampers that pull as well.
fn pull_acceleration(
    away: Vec3,
    velocity: Vec3,
    load: &mut Vec3,
    step: f32,
    settings: &ParticleDragSettings,
) -> Vec3 {
    let limit = settings.max_acceleration;
    let frequency = if step > 0.0 { settings.frequency.min(0.5 / step) } else { settings.frequency };
    let wanted = frequency * frequency * away - 2.0 * frequency * velocity + *load;
    if wanted.length() <= limit {
        // Only while the pull is not at its limit: the load must not wind up towards a target out of reach.
        *load += step * 0.125 * frequency.powi(3) * away;
        *load = load.clamp_length_max(0.5 * limit);
    }
    wanted.clamp_length_max(limit)
}

/// Puts the force back to what the game had set, to the last bit.
pub(super) fn remove_pull(mut grip: ResMut<Grip>, mut forces: Query<&mut AppliedForce>) {
    let Some(held) = &mut grip.0 else { return };
    let Some((before, after)) = held.pull.take() else { return };
    if let Ok(mut force) = forces.get_mut(held.particle)
        && force.0 == after
    {
        force.0 = before;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Pulls a particle that something else pulls down; returns where it comes to rest and how far it went.
    fn settle(step: f32, burden: Vec3, target: Vec3) -> (Vec3, Vec3, f32) {
        let settings = ParticleDragSettings::default();
        let (mut position, mut velocity) = (Vec3::ZERO, Vec3::new(0.0, 3.0, 0.0));
        let (mut load, mut farthest) = (Vec3::ZERO, 0.0f32);
        for _ in 0..(5.0 / step) as usize {
            let acceleration =
                burden + pull_acceleration(target - position, velocity, &mut load, step, &settings);
            position += step * velocity + 0.5 * step * step * acceleration;
            velocity += step * acceleration;
            farthest = farthest.max(position.distance(target));
        }
        (position, velocity, farthest)
    }

    #[test]
    fn the_pull_brings_a_particle_to_rest_on_the_target_at_any_time_step() {
        let target = Vec3::new(1.0, 0.5, -0.2);
        for step in [1.0 / 240.0, 1.0 / 60.0, 1.0 / 20.0] {
            for burden in [Vec3::ZERO, Vec3::new(0.0, -100.0, 0.0)] {
                let (position, velocity, farthest) = settle(step, burden, target);
                assert!(position.distance(target) < 1e-3, "{step} {burden}: {position}");
                assert!(velocity.length() < 1e-2, "{step} {burden}: {velocity}");
                assert!(farthest < 1.5, "{step} {burden}: overshoots to {farthest}");
            }
        }
    }

    #[test]
    fn the_pull_is_limited() {
        let settings = ParticleDragSettings { max_acceleration: 50.0, ..Default::default() };
        let mut load = Vec3::ZERO;
        let acceleration = pull_acceleration(Vec3::X * 1e6, Vec3::ZERO, &mut load, 1.0 / 60.0, &settings);
        assert!((acceleration.length() - 50.0).abs() < 1e-3 && load == Vec3::ZERO);
    }

    #[test]
    fn the_target_keeps_the_offset_from_the_pointer() {
        let held = Held {
            particle: Entity::PLACEHOLDER,
            pointer: PointerId::Mouse,
            button: PointerButton::Primary,
            camera: Entity::PLACEHOLDER,
            plane: (Vec3::new(0.0, 0.0, -5.0), InfinitePlane3d::new(Vec3::Z)),
            offset: Vec3::new(0.1, 0.0, 0.0),
            inserted_force: false,
            load: Vec3::ZERO,
            pull: None,
        };
        let ray = Ray3d { origin: Vec3::ZERO, direction: Dir3::NEG_Z };
        assert_eq!(held.target(ray), Some(Vec3::new(0.1, 0.0, -5.0)));
        let sideways = Ray3d { origin: Vec3::ZERO, direction: Dir3::X };
        assert_eq!(held.target(sideways), None);
    }
}
