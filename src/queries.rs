//! Rays, balls and closest points against colliders, particles and nets, for games.

use bevy::ecs::entity::EntityHashMap;
use bevy::ecs::system::SystemParam;
use bevy::math::{DMat3, DVec3};
use bevy::prelude::*;
use bevy::transform::helper::TransformHelper;

use crate::collider::{ColliderShape, ContactLayers, ParticleCollider};
use crate::nets::ParticleNet;
use crate::particle::Particle;
use crate::solver::Shape;

/// What a ray, ball or point has found.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct ParticleHit {
    /// The collider, particle or net.
    pub entity: Entity,
    /// The number of the particle in its net.
    pub index: Option<u32>,
    /// How far the ray or ball goes until it touches, or how far the point is from the surface, m; negative inside.
    pub distance: f32,
    /// The point of the surface, m.
    pub point: Vec3,
    /// Out of the surface.
    pub normal: Vec3,
}

/// Spatial queries: [`ParticleCollider`]s by their surface, particles and those of nets as spheres.
///
/// Queries find what meets their `layers` only. Places are those of the present `Transform`s.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_mass_spring::prelude::*;
/// fn look_down(mut queries: ParticleQueries) {
///     let ray = Ray3d::new(Vec3::Y * 10.0, Dir3::NEG_Y);
///     if let Some(hit) = queries.cast_ray(ray, 20.0, ContactLayers::default()) {
///         println!("{} is {} m below", hit.entity, hit.distance);
///     }
/// }
/// ```
#[derive(SystemParam)]
pub struct ParticleQueries<'w, 's> {
    colliders: Query<'w, 's, (Entity, &'static ParticleCollider, Option<&'static ContactLayers>)>,
    particles: Query<'w, 's, (Entity, &'static Particle, Option<&'static ContactLayers>)>,
    nets: Query<'w, 's, (Entity, &'static ParticleNet, Option<&'static ContactLayers>)>,
    places: TransformHelper<'w, 's>,
    built: Local<'s, EntityHashMap<Built>>,
}

/// The shape of a collider, as it was built last.
struct Built {
    described: ColliderShape,
    scale: Vec3,
    shape: Option<Shape>,
}

/// A collider where it is.
struct Placed {
    entity: Entity,
    shape: Shape,
    rotation: DMat3,
    point: DVec3,
}

impl ParticleQueries<'_, '_> {
    /// The first thing on a ray, at most `max_distance` m away.
    pub fn cast_ray(&mut self, ray: Ray3d, max_distance: f32, layers: ContactLayers) -> Option<ParticleHit> {
        self.cast_sphere(0.0, ray, max_distance, layers)
    }

    /// The first thing that a ball of `radius` m touches while its centre moves along a ray, by at most `max_distance` m.
    pub fn cast_sphere(
        &mut self,
        radius: f32,
        ray: Ray3d,
        max_distance: f32,
        layers: ContactLayers,
    ) -> Option<ParticleHit> {
        if !(max_distance > 0.0 && ray.origin.is_finite() && radius >= 0.0) {
            return None;
        }
        let max_distance = max_distance.min(1e9);
        let (start, way) = (ray.origin.as_dvec3(), ray.direction.as_dvec3() * f64::from(max_distance));
        let mut first: Option<ParticleHit> = None;
        let mut offer = |hit: ParticleHit| {
            if first.is_none_or(|known| hit.distance < known.distance) {
                first = Some(hit);
            }
        };
        self.for_each_collider(layers, |Placed { entity, shape, rotation, point }| {
            let local = |place: DVec3| rotation.transpose() * (place - point);
            let Some((time, foot, normal)) = shape.cast(local(start), local(start + way), radius.into())
            else {
                return;
            };
            let (distance, normal) = ((time * f64::from(max_distance)) as f32, (rotation * normal).as_vec3());
            let point = (rotation * foot + point).as_vec3();
            offer(ParticleHit { entity, index: None, distance, point, normal });
        });
        self.for_each_sphere(layers, |entity, index, centre, own| {
            // ‖s + t w‖ = R
            let (apart, reach) = (start - centre.as_dvec3(), f64::from(own + radius));
            let (square, half) = (way.length_squared(), apart.dot(way));
            let outside = apart.length_squared() - reach * reach;
            let discriminant = half * half - square * outside;
            if outside > 0.0 && (half >= 0.0 || discriminant < 0.0) {
                return;
            }
            let time = if outside <= 0.0 { 0.0 } else { outside / (discriminant.sqrt() - half) };
            if time > 1.0 {
                return;
            }
            let normal = (apart + way * time).normalize_or(-way.normalize()).as_vec3();
            let distance = (time * f64::from(max_distance)) as f32;
            offer(ParticleHit { entity, index, distance, point: centre + normal * own, normal });
        });
        first
    }

    /// The surface that is next to a point, at most `max_distance` m away; the deepest one where it is inside.
    pub fn closest_point(
        &mut self,
        point: Vec3,
        max_distance: f32,
        layers: ContactLayers,
    ) -> Option<ParticleHit> {
        if !point.is_finite() {
            return None;
        }
        let mut nearest: Option<ParticleHit> = None;
        let mut offer = |hit: ParticleHit| {
            let is_near = hit.distance <= max_distance;
            if is_near && nearest.is_none_or(|known| hit.distance < known.distance) {
                nearest = Some(hit);
            }
        };
        self.for_each_collider(layers, |placed| {
            let local = placed.rotation.transpose() * (point.as_dvec3() - placed.point);
            let (distance, normal) = placed.shape.nearest_surface(local);
            let (distance, normal) = (distance as f32, (placed.rotation * normal).as_vec3());
            let entity = placed.entity;
            offer(ParticleHit { entity, index: None, distance, point: point - normal * distance, normal });
        });
        self.for_each_sphere(layers, |entity, index, centre, radius| {
            let normal = (point - centre).normalize_or(Vec3::Y);
            let distance = point.distance(centre) - radius;
            offer(ParticleHit { entity, index, distance, point: centre + normal * radius, normal });
        });
        nearest
    }

    fn for_each_collider(&mut self, layers: ContactLayers, mut visit: impl FnMut(Placed)) {
        let Self { colliders, places, built, .. } = self;
        for (entity, collider, own) in &*colliders {
            if !own.copied().unwrap_or_default().meet(layers) {
                continue;
            }
            let Ok(transform) = places.compute_global_transform(entity) else { continue };
            let (scale, rotation, point) = transform.affine().to_scale_rotation_translation();
            let is_known = |built: &Built| built.scale == scale && built.described == collider.shape;
            if !built.get(&entity).is_some_and(is_known) {
                let shape = collider.shape.build(scale).ok();
                built.insert(entity, Built { described: collider.shape.clone(), scale, shape });
            }
            let shape = built.get(&entity).and_then(|built| built.shape.clone());
            if let Some(shape) = shape.filter(|_| rotation.is_finite() && point.is_finite()) {
                let rotation = DMat3::from_quat(rotation.as_dquat().normalize());
                visit(Placed { entity, shape, rotation, point: point.as_dvec3() });
            }
        }
    }

    fn for_each_sphere(&self, layers: ContactLayers, mut visit: impl FnMut(Entity, Option<u32>, Vec3, f32)) {
        let meets = |own: Option<&ContactLayers>| own.copied().unwrap_or_default().meet(layers);
        for (entity, particle, own) in &self.particles {
            let place = self.places.compute_global_transform(entity);
            if let (true, Ok(place)) = (meets(own), place) {
                visit(entity, None, place.translation(), particle.radius);
            }
        }
        for (entity, net, own) in &self.nets {
            if meets(own) {
                let particles = (0..).zip(net.positions());
                particles.for_each(|(number, place)| visit(entity, Some(number), *place, net.radius()));
            }
        }
    }
}
