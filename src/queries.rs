//! Rays, balls and closest points against colliders, particles and nets, for games.

mod body;
mod filter;

use std::cmp::Ordering;

use bevy::ecs::entity::EntityHashMap;
use bevy::ecs::system::SystemParam;
use bevy::math::DVec3;
use bevy::prelude::*;
use bevy::transform::helper::TransformHelper;

use crate::collider::{ColliderShape, ContactLayers, ParticleCollider};
use crate::nets::ParticleNet;
use crate::particle::{Particle, Quarantined};
use crate::settings::Dimensions;
use crate::solver::{PlacedShape, Shape, Simplex};
use body::{Body, Found};
pub use filter::ParticleQueryFilter;

/// The longest way of a cast, m.
const MAX_WAY: f32 = 1e9;

/// What a ray, ball or point has found.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct ParticleHit {
    /// The collider, particle or net.
    pub entity: Entity,
    /// Of a net, the number of the particle that is nearest to [`point`](Self::point).
    pub index: Option<u32>,
    /// Of a net with triangles, the number of the one that was found, in its [`Topology`](crate::nets::Topology).
    pub triangle: Option<u32>,
    /// How far the ray or ball goes until it touches, or how far the point is from the surface, m; negative inside.
    pub distance: f32,
    /// The point of the surface, m.
    pub point: Vec3,
    /// Out of the surface, of length 1.
    pub normal: Vec3,
}

/// Spatial queries, against what particles and nets collide with, as thick as it is there.
///
/// - [`ParticleCollider`]s by their surface. What is inside of one touches it.
/// - Nets by their triangles, with their thickness, which are met from both sides: the inside of a balloon is not solid. Ropes, and
///   other nets without triangles, along their springs, as capsules. What is broken or quarantined is not there.
/// - [`Particle`]s as spheres. Loose [`Spring`](crate::Spring)s are not found.
///
/// A [filter](ParticleQueryFilter) says which of them count; sensors do only where it says so.
///
/// Places are those of the present `Transform`s and of the present positions of nets. In
/// [two dimensions](Dimensions::Two) z of all of them counts as 0, and so does that of rays and points: a ray goes along x and y
/// of its direction, distances are measured in the plane, and the points of hits have the z of the origin of the ray.
///
/// A query takes a time that is proportional to the number of bodies and, of nets near its way, of their triangles or
/// springs. Numbers that are not finite, or negative where they must not be, find nothing.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_mass_spring::prelude::*;
/// fn look_down(mut queries: ParticleQueries) {
///     let ray = Ray3d::new(Vec3::Y * 10.0, Dir3::NEG_Y);
///     if let Some(hit) = queries.cast_ray(ray, 20.0, ParticleQueryFilter::default()) {
///         println!("{} is {} m below", hit.entity, hit.distance);
///     }
/// }
/// ```
#[derive(SystemParam)]
pub struct ParticleQueries<'w, 's> {
    colliders: Query<'w, 's, (Entity, &'static ParticleCollider, Option<&'static ContactLayers>)>,
    particles:
        Query<'w, 's, (Entity, &'static Particle, Option<&'static ContactLayers>), Without<Quarantined>>,
    nets: Query<'w, 's, (Entity, &'static ParticleNet, Option<&'static ContactLayers>)>,
    places: TransformHelper<'w, 's>,
    dimensions: Option<Res<'w, Dimensions>>,
    built: Local<'s, EntityHashMap<Built>>,
}

/// The shape of a collider, as it was built last.
struct Built {
    described: ColliderShape,
    scale: Vec3,
    is_flat: bool,
    shape: Option<Shape>,
}

/// The way of a ball.
struct Way {
    from: DVec3,
    to: DVec3,
    /// m.
    length: f64,
    /// The direction of normals that have none in the plane.
    back: DVec3,
}

impl ParticleQueries<'_, '_> {
    /// The first thing on a ray, at most `max_distance` m away (infinite: 1e9 m). Where it starts inside of something, that is
    /// 0 m away.
    pub fn cast_ray(
        &mut self,
        ray: Ray3d,
        max_distance: f32,
        filter: ParticleQueryFilter,
    ) -> Option<ParticleHit> {
        self.cast_sphere(0.0, ray, max_distance, filter)
    }

    /// All things on a ray, at most `max_distance` m away (infinite: 1e9 m), from near to far: of each collider, particle and net
    /// where the ray meets it first.
    pub fn cast_ray_all(
        &mut self,
        ray: Ray3d,
        max_distance: f32,
        filter: ParticleQueryFilter,
    ) -> Vec<ParticleHit> {
        let mut hits = Vec::new();
        self.cast(0.0, ray, max_distance, filter, |hit| hits.push(hit));
        hits.sort_by(by_distance);
        hits
    }

    /// The first thing that a ball of `radius` m, >= 0, touches while its centre moves along a ray, by at most `max_distance` m
    /// (infinite: 1e9 m). What it touches at the start is 0 m away.
    pub fn cast_sphere(
        &mut self,
        radius: f32,
        ray: Ray3d,
        max_distance: f32,
        filter: ParticleQueryFilter,
    ) -> Option<ParticleHit> {
        let mut first = None;
        self.cast(radius, ray, max_distance, filter, |hit| keep_nearer(&mut first, hit));
        first
    }

    /// The surface that is next to a point, at most `max_distance` m, >= 0, away; the deepest one where it is inside.
    pub fn closest_point(
        &mut self,
        point: Vec3,
        max_distance: f32,
        filter: ParticleQueryFilter,
    ) -> Option<ParticleHit> {
        let mut nearest = None;
        self.find_near(point, max_distance, filter, |hit| keep_nearer(&mut nearest, hit));
        nearest
    }

    /// All things that a ball of `radius` m, >= 0, touches: of each collider, particle and net the point of the surface that is
    /// next to the centre, with its distance from there; the deepest first.
    pub fn overlap_sphere(
        &mut self,
        centre: Vec3,
        radius: f32,
        filter: ParticleQueryFilter,
    ) -> Vec<ParticleHit> {
        let mut hits = Vec::new();
        self.find_near(centre, radius, filter, |hit| hits.push(hit));
        hits.sort_by(by_distance);
        hits
    }

    /// Calls `visit` with where a ball first touches each body.
    fn cast(
        &mut self,
        radius: f32,
        ray: Ray3d,
        max_distance: f32,
        filter: ParticleQueryFilter,
        mut visit: impl FnMut(ParticleHit),
    ) {
        if !(max_distance >= 0.0 && ray.origin.is_finite() && radius >= 0.0 && radius.is_finite()) {
            return;
        }
        let Way { from, to, length, back } = self.way(ray, max_distance.min(MAX_WAY));
        let is_flat = self.is_flat();
        self.for_each_body(filter, |entity, body| {
            if let Some(found) = body.cast(from, to, radius.into()) {
                let distance = found.measure * length;
                visit(hit(entity, found, distance, is_flat.then_some((ray.origin.z, back))));
            }
        });
    }

    /// Calls `visit` with the nearest point of each body that is at most so far away.
    fn find_near(
        &mut self,
        point: Vec3,
        max_distance: f32,
        filter: ParticleQueryFilter,
        mut visit: impl FnMut(ParticleHit),
    ) {
        if !(point.is_finite() && max_distance >= 0.0) {
            return;
        }
        let is_flat = self.is_flat();
        let place = if is_flat { point.with_z(0.0) } else { point }.as_dvec3();
        self.for_each_body(filter, |entity, body| {
            if let Some(found) = body.nearest(place, max_distance.into()) {
                let distance = found.measure;
                visit(hit(entity, found, distance, is_flat.then_some((point.z, DVec3::Y))));
            }
        });
    }

    fn is_flat(&self) -> bool {
        self.dimensions.as_deref() == Some(&Dimensions::Two)
    }

    fn way(&self, ray: Ray3d, length: f32) -> Way {
        let (mut from, mut direction) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
        if self.is_flat() {
            // A ray that looks along z stays where it is.
            (from.z, direction) = (0.0, direction.with_z(0.0).normalize_or_zero());
        }
        let length = f64::from(length);
        Way { from, to: from + direction * length, length, back: -direction }
    }

    /// Calls `visit` with each body that a query looks at, where it is.
    fn for_each_body(&mut self, filter: ParticleQueryFilter, mut visit: impl FnMut(Entity, Body)) {
        let is_flat = self.is_flat();
        let Self { colliders, particles, nets, places, built, .. } = self;
        for (entity, collider, layers) in &*colliders {
            if collider.is_sensor && !filter.sensors || !filter.admits(entity, layers) {
                continue;
            }
            let Ok(transform) = places.compute_global_transform(entity) else { continue };
            let Ok((pose, scale)) = collider.shape.place(&transform.affine(), is_flat) else { continue };
            let is_known = |built: &Built| {
                built.scale == scale && built.is_flat == is_flat && built.described == collider.shape
            };
            if !built.get(&entity).is_some_and(is_known) {
                let shape = collider.shape.build_for(scale, is_flat).ok();
                built.insert(entity, Built { described: collider.shape.clone(), scale, is_flat, shape });
            }
            if let Some(shape) = built.get(&entity).and_then(|built| built.shape.clone()) {
                visit(entity, Body::Collider(PlacedShape::new(shape, pose)));
            }
        }
        if built.len() > 2 * colliders.iter().len() {
            built.retain(|entity, _| colliders.contains(*entity));
        }
        for (entity, particle, layers) in &*particles {
            if !filter.admits(entity, layers) || particle.validate().is_err() {
                continue;
            }
            if let Ok(transform) = places.compute_global_transform(entity) {
                let place = transform.translation();
                let place = if is_flat { place.with_z(0.0) } else { place };
                visit(entity, Body::Particle(Simplex::new([place.as_dvec3()], particle.radius.into())));
            }
        }
        for (entity, net, layers) in &*nets {
            if filter.admits(entity, layers) {
                visit(entity, Body::Net(net.body(is_flat)));
            }
        }
    }
}

/// From near to far; of what is equally near, by entity.
fn by_distance(one: &ParticleHit, other: &ParticleHit) -> Ordering {
    one.distance.total_cmp(&other.distance).then(one.entity.cmp(&other.entity))
}

fn keep_nearer(best: &mut Option<ParticleHit>, hit: ParticleHit) {
    if best.is_none_or(|best| by_distance(&hit, &best).is_lt()) {
        *best = Some(hit);
    }
}

/// What is told of what was found. `layer`: in two dimensions, the z of the query, and the normal of what has none in the plane.
fn hit(entity: Entity, found: Found, distance: f64, layer: Option<(f32, DVec3)>) -> ParticleHit {
    let Found { point, normal, feature, .. } = found;
    let (mut point, mut normal, distance) = (point.as_vec3(), normal.as_vec3(), distance as f32);
    if let Some((z, fallback)) = layer {
        let fallback = fallback.as_vec3().normalize_or(Vec3::Y);
        (point.z, normal) = (z, normal.with_z(0.0).normalize_or(fallback));
    }
    let (index, triangle) = (feature.map(|net| net.particle), feature.and_then(|net| net.triangle));
    ParticleHit { entity, index, triangle, distance, point, normal }
}
