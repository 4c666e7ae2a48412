//! A picking backend for spheres: rays against particles, tiny ones enlarged to a few pixels.

use bevy::camera::visibility::RenderLayers;
use bevy::picking::backend::prelude::*;
use bevy::prelude::*;

use super::ParticleDragSettings;
use crate::particle::{Particle, Quarantined};

/// Reports the one particle that each pointer is over.
pub(super) fn pick_particles(
    settings: Res<ParticleDragSettings>,
    rays: Res<RayMap>,
    cameras: Query<(&Camera, &GlobalTransform, Option<&RenderLayers>)>,
    particles: Query<(Entity, &Particle, &GlobalTransform, Option<&RenderLayers>), Without<Quarantined>>,
    mut hits: MessageWriter<PointerHits>,
) {
    if !settings.enabled {
        return;
    }
    for (id, &ray) in rays.iter() {
        let Ok((camera, camera_transform, camera_layers)) = cameras.get(id.camera) else { continue };
        let scale = PixelScale::new(camera, camera_transform);
        let spheres = particles
            .iter()
            .filter(|(.., layers)| sees(camera_layers, *layers))
            .map(|(entity, particle, transform, _)| (entity, transform.translation(), particle.radius));
        if let Some((entity, hit)) = nearest_hit(ray, spheres, &scale, settings.pick_radius) {
            let data = HitData::new(id.camera, hit.depth, Some(ray.get_point(hit.depth)), None);
            hits.write(PointerHits::new(id.pointer, vec![(entity, data)], camera.order as f32));
        }
    }
}

/// Whether a camera sees what is on `layers`: an overlay's camera must not pick in the scene below it.
pub(super) fn sees(camera: Option<&RenderLayers>, layers: Option<&RenderLayers>) -> bool {
    camera.unwrap_or_default().intersects(layers.unwrap_or_default())
}

/// How large a pixel is, in m, at any place that a camera sees.
pub(super) struct PixelScale {
    view_from_world: Mat4,
    clip_from_view: Mat4,
    viewport_height: f32,
}

impl PixelScale {
    pub(super) fn new(camera: &Camera, transform: &GlobalTransform) -> Self {
        Self {
            view_from_world: Mat4::from(transform.affine().inverse()),
            clip_from_view: camera.clip_from_view(),
            viewport_height: camera.logical_viewport_size().map_or(1.0, |size| size.y),
        }
    }

    /// The size in m of a logical pixel at `point`.
    ///
    /// On screen, a length L at clip depth w spans L · m11 / w of the half height, where w is the
    /// distance along the view for a perspective and 1 for an orthographic projection.
    fn at(&self, point: Vec3) -> f32 {
        let view_z = self.view_from_world.transform_point3(point).z;
        let clip = &self.clip_from_view;
        let w = clip.z_axis.w * view_z + clip.w_axis.w;
        (2.0 * w / (clip.y_axis.y * self.viewport_height)).abs()
    }
}

/// Where a ray meets a particle.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Hit {
    /// Distance along the ray, m.
    depth: f32,
    /// How far the ray passes outside the sphere, in pixels; 0 if it goes through.
    miss: f32,
}

/// Spheres that the ray goes through are preferred to those that are only near; then the nearest is taken.
fn nearest_hit(
    ray: Ray3d,
    spheres: impl Iterator<Item = (Entity, Vec3, f32)>,
    scale: &PixelScale,
    pick_radius: f32,
) -> Option<(Entity, Hit)> {
    let better = |a: &Hit, b: &Hit| (a.miss, a.depth) < (b.miss, b.depth);
    spheres
        .filter_map(|(entity, center, radius)| {
            Some((entity, hit_sphere(ray, center, radius, scale.at(center), pick_radius)?))
        })
        .reduce(|best, next| if better(&next.1, &best.1) { next } else { best })
}

fn hit_sphere(ray: Ray3d, center: Vec3, radius: f32, pixel: f32, pick_radius: f32) -> Option<Hit> {
    let to_center = center - ray.origin;
    let along = to_center.dot(*ray.direction);
    let distance = (to_center - along * *ray.direction).length();
    let reach = radius.max(pick_radius * pixel);
    if along <= 0.0 || distance.is_nan() || distance > reach {
        return None;
    }
    // Half the chord that the ray cuts out of the sphere; none where it only passes near.
    let half_chord = (radius * radius - distance * distance).max(0.0).sqrt();
    let miss = if distance <= radius { 0.0 } else { (distance - radius) / pixel };
    Some(Hit { depth: along - half_chord, miss })
}

#[cfg(test)]
mod tests {
    use super::*;

    const FORWARD: Ray3d = Ray3d { origin: Vec3::ZERO, direction: Dir3::NEG_Z };

    #[test]
    fn a_ray_meets_the_near_side_of_a_sphere() {
        let hit = hit_sphere(FORWARD, Vec3::new(0.0, 0.0, -5.0), 1.0, 0.01, 10.0).unwrap();
        assert_eq!(hit, Hit { depth: 4.0, miss: 0.0 });
    }

    #[test]
    fn small_spheres_are_enlarged_and_those_behind_are_not_hit() {
        let beside = Vec3::new(0.05, 0.0, -5.0);
        let hit = hit_sphere(FORWARD, beside, 0.0, 0.01, 10.0).unwrap();
        assert!((hit.miss - 5.0).abs() < 1e-4 && (hit.depth - 5.0).abs() < 1e-4);
        assert!(hit_sphere(FORWARD, beside, 0.0, 0.001, 10.0).is_none());
        assert!(hit_sphere(FORWARD, Vec3::new(0.0, 0.0, 5.0), 1.0, 0.01, 10.0).is_none());
        assert!(hit_sphere(FORWARD, Vec3::NAN, 1.0, 0.01, 10.0).is_none());
    }

    #[test]
    fn a_sphere_that_is_hit_is_preferred_to_a_nearer_one_that_is_missed() {
        let [far, near] = [1, 2].map(|index| Entity::from_raw_u32(index).unwrap());
        let spheres = [(near, Vec3::new(0.05, 0.0, -2.0), 0.01), (far, Vec3::new(0.0, 0.0, -5.0), 0.1)];
        let scale = PixelScale {
            view_from_world: Mat4::IDENTITY,
            clip_from_view: Mat4::IDENTITY,
            viewport_height: 200.0,
        };
        let (picked, _) = nearest_hit(FORWARD, spheres.into_iter(), &scale, 10.0).unwrap();
        assert_eq!(picked, far);
    }

    #[test]
    fn pixels_grow_with_the_distance_in_perspective_only() {
        let perspective = Mat4::perspective_infinite_reverse_rh(std::f32::consts::FRAC_PI_2, 1.0, 0.1);
        let scale = |clip_from_view| PixelScale {
            view_from_world: Mat4::IDENTITY,
            clip_from_view,
            viewport_height: 100.0,
        };
        assert!((scale(perspective).at(Vec3::new(0.0, 0.0, -5.0)) - 0.1).abs() < 1e-6);
        let orthographic = Mat4::orthographic_rh(-1.0, 1.0, -1.0, 1.0, 0.0, 10.0);
        assert!((scale(orthographic).at(Vec3::new(0.0, 0.0, -5.0)) - 0.02).abs() < 1e-6);
    }
}
