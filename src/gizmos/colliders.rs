//! Outlines of colliders.

use bevy::prelude::*;

use super::MassSpringGizmos;
use crate::collider::{ColliderShape, ParticleCollider, SharedList};
use crate::report::InvalidColliders;

/// Triangles of a mesh that are drawn, at most.
const MAX_TRIANGLES: usize = 20_000;

/// Length of the cross at a point of a hull that there is not, m.
const POINT: f32 = 0.05;

/// The edges of the convex hulls that were drawn in the last frame: to find them takes much longer than to draw them.
#[derive(Default)]
pub(super) struct Hulls(Vec<Hull>);

struct Hull {
    points: SharedList<Vec3>,
    edges: Vec<[Vec3; 2]>,
    is_drawn: bool,
}

impl Hulls {
    /// The edges of the hull of these points; none if they have none.
    fn edges(&mut self, points: &SharedList<Vec3>) -> &[[Vec3; 2]] {
        let place = self.0.iter().position(|hull| hull.points == *points).unwrap_or_else(|| {
            let edges = ColliderShape::hull_edges(points);
            self.0.push(Hull { points: points.clone(), edges, is_drawn: true });
            self.0.len() - 1
        });
        self.0[place].is_drawn = true;
        &self.0[place].edges
    }

    /// Drops those that were not drawn since the last call.
    fn drop_unused(&mut self) {
        self.0.retain_mut(|hull| std::mem::take(&mut hull.is_drawn));
    }
}

pub(super) fn draw_colliders(
    mut gizmos: Gizmos<MassSpringGizmos>,
    colliders: Query<(Entity, &ParticleCollider, &GlobalTransform)>,
    invalid: Option<Res<InvalidColliders>>,
    mut hulls: Local<Hulls>,
) {
    if gizmos.config_ext.colliders {
        for (entity, collider, transform) in &colliders {
            let is_invalid = invalid.as_ref().is_some_and(|invalid| invalid.contains(entity));
            let color = gizmos.config_ext.color_of_collider(is_invalid, collider.is_sensor);
            draw_shape(&mut gizmos, &mut hulls, &collider.shape, *transform, color);
        }
    }
    hulls.drop_unused();
}

fn draw_shape(
    gizmos: &mut Gizmos<MassSpringGizmos>,
    hulls: &mut Hulls,
    shape: &ColliderShape,
    transform: GlobalTransform,
    color: Color,
) {
    let (scale, rotation, center) = transform.to_scale_rotation_translation();
    let scale = scale.abs();
    let at = Isometry3d::new(center, rotation);
    match shape {
        ColliderShape::HalfSpace => draw_half_space(gizmos, at, color),
        ColliderShape::Sphere { radius } => {
            gizmos.primitive_3d(&Sphere::new(radius * scale.x), at, color);
        }
        ColliderShape::Capsule { radius, half_length } => {
            let capsule = Capsule3d::new(radius * scale.x, 2.0 * half_length * scale.x);
            gizmos.primitive_3d(&capsule, at, color);
        }
        ColliderShape::Cuboid { half_size } => {
            gizmos.primitive_3d(&Cuboid { half_size: *half_size * scale }, at, color);
        }
        ColliderShape::Cylinder { radius, half_height } => {
            let cylinder = Cylinder { radius: radius * scale.x, half_height: half_height * scale.y };
            gizmos.primitive_3d(&cylinder, at, color);
        }
        ColliderShape::Cone { radius, height } => {
            gizmos.primitive_3d(&Cone { radius: radius * scale.x, height: height * scale.y }, at, color);
        }
        ColliderShape::ConicalFrustum { radius_top, radius_bottom, height } => {
            let (radius_top, radius_bottom) = (radius_top * scale.x, radius_bottom * scale.x);
            let frustum = ConicalFrustum { radius_top, radius_bottom, height: height * scale.y };
            gizmos.primitive_3d(&frustum, at, color);
        }
        ColliderShape::ConvexHull { points } => {
            let edges = hulls.edges(points);
            for ends in edges {
                let [from, to] = ends.map(|end| transform.transform_point(end));
                gizmos.line(from, to, color);
            }
            // Points without a hull are to be seen, too.
            for point in points.iter().filter(|_| edges.is_empty()) {
                let point = transform.transform_point(*point);
                gizmos.cross(Isometry3d::from_translation(point), POINT, color);
            }
        }
        ColliderShape::Mesh { vertices, triangles, .. } => {
            for corners in triangles.iter().take(MAX_TRIANGLES) {
                let corner = |number: u32| vertices.get(number as usize);
                if let [Some(a), Some(b), Some(c)] = corners.map(corner) {
                    let places = [a, b, c, a].map(|corner| transform.transform_point(*corner));
                    gizmos.linestrip(places, color);
                }
            }
        }
        ColliderShape::HeightField { size, heights } => {
            draw_heights(gizmos, *size, heights, transform, color)
        }
        ColliderShape::Compound { parts } => {
            for part in parts.iter() {
                let place = Transform::from_translation(part.position).with_rotation(part.rotation);
                draw_shape(gizmos, hulls, &part.shape, transform * place, color);
            }
        }
    }
}

fn draw_half_space(gizmos: &mut Gizmos<MassSpringGizmos>, at: Isometry3d, color: Color) {
    const CELLS: u32 = 10;
    let size = gizmos.config_ext.half_space_size;
    // Gizmo grids lie in the local xy plane; half-spaces end in the local xz plane.
    let lying = Quat::from_rotation_arc(Vec3::Z, Vec3::Y);
    let (center, rotation) = (Vec3::from(at.translation), at.rotation);
    let spacing = Vec2::splat(size / CELLS as f32);
    gizmos.grid(Isometry3d::new(center, rotation * lying), UVec2::splat(CELLS), spacing, color).outer_edges();
    gizmos.arrow(center, center + rotation * Vec3::Y * (0.1 * size), color);
}

fn draw_heights(
    gizmos: &mut Gizmos<MassSpringGizmos>,
    size: Vec2,
    heights: &[Vec<f32>],
    transform: GlobalTransform,
    color: Color,
) {
    let columns = heights.first().map_or(0, Vec::len);
    let part = |number: usize, count: usize| number as f32 / count.saturating_sub(1).max(1) as f32 - 0.5;
    let place = |row: usize, column: usize| {
        let height = heights[row].get(column).copied().unwrap_or(0.0);
        let (x, z) = (size.x * part(column, columns), size.y * part(row, heights.len()));
        transform.transform_point(Vec3::new(x, height, z))
    };
    for row in 0..heights.len() {
        gizmos.linestrip((0..columns).map(|column| place(row, column)), color);
    }
    for column in 0..columns {
        gizmos.linestrip((0..heights.len()).map(|row| place(row, column)), color);
    }
}
