//! The grip: which particle a press grabs, and its target under the pointer.

use bevy::camera::visibility::RenderLayers;
use bevy::picking::backend::ray::RayMap;
use bevy::picking::hover::HoverMap;
use bevy::picking::pointer::{PointerAction, PointerButton, PointerId, PointerInput, PointerLocation};
use bevy::prelude::*;
use bevy::window::WindowFocused;

use super::handle::{Grabbable, Handle};
use super::picking::{NetPicks, sees};
use super::{ParticleDrag, ParticleDragSettings};
use crate::particle::AppliedForce;
use crate::settings::Dimensions;

/// The particle in the pointer's grip, if any.
#[derive(Resource, Default)]
pub(super) struct Grip(pub(super) Option<Held>);

pub(super) struct Held {
    pub(super) handle: Handle,
    /// The pinned part that holds it, and the way from it to the centre of that part, m.
    pub(super) holder: Option<(Entity, Vec3)>,
    pointer: PointerId,
    button: PointerButton,
    camera: Entity,
    /// The plane through the particle in which it is dragged: the one that faced the camera when it was grabbed, or in two
    /// dimensions its layer.
    plane: (Vec3, InfinitePlane3d),
    /// From the pointer to the particle's centre, in that plane, m.
    offset: Vec3,
    /// Whether the pull inserted the `AppliedForce`, or made the forces of the net, and removes them in the end.
    pub(super) inserted_force: bool,
    /// The acceleration in m/s² that carries what hangs from the particle, found while pulling.
    pub(super) load: Vec3,
    /// The force before the pull was added to it, and after, while a tick runs.
    pub(super) pull: Option<(Vec3, Vec3)>,
}

impl Held {
    /// The target of the particle when the pointer looks along `ray`; `None` if the ray misses the plane.
    fn target(&self, ray: Ray3d) -> Option<Vec3> {
        Some(ray.plane_intersection_point(self.plane.0, self.plane.1)? + self.offset)
    }
}

/// Grabs on presses and releases on releases.
///
/// The raw stream of pointer inputs is read, and not the events that picking derives from it, because
/// Ctrl with a button may be pressed where nothing is under the pointer.
pub(super) fn follow_presses(
    (mut inputs, mut focus): (MessageReader<PointerInput>, MessageReader<WindowFocused>),
    keys: Res<ButtonInput<KeyCode>>,
    (settings, dimensions): (Res<ParticleDragSettings>, Res<Dimensions>),
    (hover, picks, rays): (Res<HoverMap>, Res<NetPicks>, Res<RayMap>),
    cameras: Query<(&Camera, &GlobalTransform, Option<&RenderLayers>)>,
    particles: Grabbable,
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
                    PointerButton::Primary if !ctrl => hovered(pointer, &hover, &picks, &particles),
                    PointerButton::Secondary | PointerButton::Middle if ctrl => {
                        anchor(pointer, &hover, &rays, &cameras, &particles)
                    }
                    _ => None,
                };
                grip.0 = grabbed.and_then(|(handle, camera)| {
                    let center = particles.center(handle)?;
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
                        handle,
                        holder: None,
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
        blurred
            || !settings.enabled
            || particles.center(held.handle).is_none()
            || !cameras.contains(held.camera)
    });
}

/// The particle that a pointer is over, and the camera of its ray.
fn hovered(
    pointer: PointerId,
    hover: &HoverMap,
    picks: &NetPicks,
    particles: &Grabbable,
) -> Option<(Handle, Entity)> {
    hover.get(&pointer)?.iter().find_map(|(&entity, hit)| {
        let index = picks.get(pointer, hit.camera, entity);
        let handle = Handle { entity, index };
        particles.center(handle).map(|_| (handle, hit.camera))
    })
}

/// The particle that Ctrl and a button drag from anywhere, and the camera through which it is seen.
fn anchor(
    pointer: PointerId,
    hover: &HoverMap,
    rays: &RayMap,
    cameras: &Query<(&Camera, &GlobalTransform, Option<&RenderLayers>)>,
    particles: &Grabbable,
) -> Option<(Handle, Entity)> {
    // An overlay such as egui reports the camera that shows it as what is under the pointer.
    let covered = hover.get(&pointer).is_some_and(|hits| hits.keys().any(|entity| cameras.contains(*entity)));
    if covered {
        return None;
    }
    let mut best: Option<((bool, f32), (Handle, Entity))> = None;
    for (id, ray) in rays.iter().filter(|(id, _)| id.pointer == pointer) {
        let Ok((_, _, camera_layers)) = cameras.get(id.camera) else { continue };
        for (handle, center, layers, marked) in particles.anchors() {
            if !sees(camera_layers, layers) {
                continue;
            }
            let to_center = center - ray.origin;
            let angle = to_center.angle_between(*ray.direction);
            let rank = (!marked, angle);
            if best.is_none_or(|(best_rank, _)| rank < best_rank) {
                best = Some((rank, (handle, id.camera)));
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
    let idle = forces.get(held.handle.entity).is_ok_and(|force| force.0 == Vec3::ZERO);
    if held.inserted_force && idle {
        commands.entity(held.handle.entity).try_remove::<AppliedForce>();
    }
}

/// Publishes what is under the pointer and in its grip.
pub(super) fn publish_hovered(
    (hover, picks): (Res<HoverMap>, Res<NetPicks>),
    particles: Grabbable,
    grip: Res<Grip>,
    mut drag: ResMut<ParticleDrag>,
) {
    let hovered = hover.keys().find_map(|pointer| hovered(*pointer, &hover, &picks, &particles));
    let held = grip.0.as_ref();
    let published = ParticleDrag {
        hovered: hovered.map(|(handle, _)| handle.entity),
        hovered_index: hovered.and_then(|(handle, _)| handle.index),
        dragged: held.map(|held| held.handle.entity),
        dragged_index: held.and_then(|held| held.handle.index),
        target: held.and(drag.target),
        camera: held.map(|held| held.camera).or(hovered.map(|(_, camera)| camera)),
    };
    drag.set_if_neq(published);
}

/// Moves the target with the pointer, also from outside of the window while a button is held.
pub(super) fn move_target(
    mut grip: ResMut<Grip>,
    pointers: Query<(&PointerId, &PointerLocation)>,
    cameras: Query<(&Camera, &GlobalTransform)>,
    particles: Grabbable,
    mut drag: ResMut<ParticleDrag>,
) {
    let Some(held) = &mut grip.0 else { return };
    let holder = particles.holder(held.handle);
    if holder.map(|(part, _)| part) != held.holder.map(|(part, _)| part) {
        held.holder = holder;
    }
    let held = &*held;
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_target_keeps_the_offset_from_the_pointer() {
        let held = Held {
            handle: Handle { entity: Entity::PLACEHOLDER, index: None },
            holder: None,
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
