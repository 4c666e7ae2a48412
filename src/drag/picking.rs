//! A picking backend: rays against particles, tiny ones enlarged to a few pixels, and the surfaces of nets.

use bevy::camera::visibility::RenderLayers;
use bevy::math::Vec3A;
use bevy::math::bounding::{Aabb3d, BoundingVolume, IntersectsVolume, RayCast3d};
use bevy::picking::backend::prelude::*;
use bevy::picking::backend::ray::RayId;
use bevy::picking::pointer::PointerId;
use bevy::prelude::*;

use super::ParticleDragSettings;
use super::handle::Handle;
use super::seen::{SeenNet, SeenNets};
use crate::nets::NetHit;
use crate::particle::{Particle, Quarantined};

/// Which particles of nets pointers are over, found anew in each frame. Hits name the entity of the net only.
#[derive(Resource, Default)]
pub(super) struct NetPicks(Vec<(RayId, Entity, u32)>);

impl NetPicks {
    /// The particle of a net that a pointer is over, seen by a camera.
    pub fn get(&self, pointer: PointerId, camera: Entity, net: Entity) -> Option<u32> {
        let ray = RayId::new(camera, pointer);
        self.0.iter().find(|(id, entity, _)| *id == ray && *entity == net).map(|(.., index)| *index)
    }
}

/// Reports the one particle that each pointer is over; of a net, with the [`NetHit`] as extra data.
pub(super) fn pick_particles(
    settings: Res<ParticleDragSettings>,
    rays: Res<RayMap>,
    cameras: Query<(&Camera, &GlobalTransform, Option<&RenderLayers>)>,
    particles: Query<(Entity, &Particle, &GlobalTransform, Option<&RenderLayers>), Without<Quarantined>>,
    nets: SeenNets,
    mut picks: ResMut<NetPicks>,
    mut hits: MessageWriter<PointerHits>,
) {
    picks.0.clear();
    if !settings.enabled || rays.iter().next().is_none() {
        return;
    }
    let nets = nets.seen();
    for (&id, &ray) in rays.iter() {
        let Ok((camera, camera_transform, camera_layers)) = cameras.get(id.camera) else { continue };
        let scale = PixelScale::new(camera, camera_transform);
        let spheres = particles.iter().filter(|(.., layers)| sees(camera_layers, *layers)).map(
            |(entity, particle, transform, _)| {
                (Handle { entity, index: None }, transform.translation(), particle.radius)
            },
        );
        let loose = nearest_hit(ray, spheres, &scale, settings.pick_radius);
        let of_nets = nets
            .iter()
            .filter(|net| sees(camera_layers, net.layers))
            .filter_map(|net| hit_net(ray, net, &scale, settings.pick_radius));
        let Some((Handle { entity, index }, hit)) = of_nets.chain(loose).reduce(nearer) else { continue };
        let point = ray.get_point(hit.depth);
        let data = match index {
            Some(particle) => {
                picks.0.push((id, entity, particle));
                let extra = NetHit { particle, triangle: hit.triangle, point, distance: hit.depth };
                HitData::new_with_extra(id.camera, hit.depth, Some(point), None, extra)
            }
            None => HitData::new(id.camera, hit.depth, Some(point), None),
        };
        hits.write(PointerHits::new(id.pointer, vec![(entity, data)], camera.order as f32));
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
    /// The triangle of a net that it goes through.
    triangle: Option<u32>,
}

/// Spheres that the ray goes through are preferred to those that are only near; then the nearest is taken.
fn nearest_hit(
    ray: Ray3d,
    spheres: impl Iterator<Item = (Handle, Vec3, f32)>,
    scale: &PixelScale,
    pick_radius: f32,
) -> Option<(Handle, Hit)> {
    spheres
        .filter_map(|(handle, center, radius)| {
            Some((handle, hit_sphere(ray, center, radius, scale.at(center), pick_radius)?))
        })
        .reduce(nearer)
}

fn nearer(best: (Handle, Hit), next: (Handle, Hit)) -> (Handle, Hit) {
    let rank = |(_, hit): &(Handle, Hit)| (hit.miss, hit.depth);
    if rank(&next) < rank(&best) { next } else { best }
}

/// Where a ray meets the particles or the surface of a net: the particle that is nearest to there.
fn hit_net(
    ray: Ray3d,
    &SeenNet { entity, net, ref places, .. }: &SeenNet,
    scale: &PixelScale,
    pick_radius: f32,
) -> Option<(Handle, Hit)> {
    let is_present = |index: &u32| net.quarantined().binary_search(index).is_err();
    let spheres = (0..).zip(&**places).filter(|(index, _)| is_present(index));
    let spheres = spheres.map(|(index, center)| (Handle::of_net(entity, index), *center, net.radius()));
    let sphere = nearest_hit(ray, spheres, scale, pick_radius);
    let surface = || {
        let bounds = Aabb3d::from_point_cloud(Isometry3d::IDENTITY, places.iter().copied());
        let bounds = Aabb3d::new(bounds.center(), bounds.half_size() + Vec3A::splat(net.radius()));
        if !RayCast3d::from_ray(ray, f32::MAX).intersects(&bounds) {
            return None;
        }
        let hit =
            net.cast_ray_at(places, ray.origin, ray.direction).filter(|hit| is_present(&hit.particle))?;
        let NetHit { particle, triangle, distance, .. } = hit;
        Some((Handle::of_net(entity, particle), Hit { depth: distance, miss: 0.0, triangle }))
    };
    let surface = if net.is_empty() { None } else { surface() };
    sphere.into_iter().chain(surface).reduce(nearer)
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
    Some(Hit { depth: along - half_chord, miss, triangle: None })
}

#[cfg(test)]
mod tests {
    use super::*;

    const FORWARD: Ray3d = Ray3d { origin: Vec3::ZERO, direction: Dir3::NEG_Z };

    #[test]
    fn a_ray_meets_the_near_side_of_a_sphere() {
        let hit = hit_sphere(FORWARD, Vec3::new(0.0, 0.0, -5.0), 1.0, 0.01, 10.0).unwrap();
        assert_eq!(hit, Hit { depth: 4.0, miss: 0.0, triangle: None });
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
        let [far, near] =
            [1, 2].map(|index| Handle { entity: Entity::from_raw_u32(index).unwrap(), index: None });
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
