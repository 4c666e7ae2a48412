//! Outlines of colliders.

use bevy::prelude::*;

use super::MassSpringGizmos;
use crate::collider::{ColliderShape, ParticleCollider};

/// Triangles of a mesh that are drawn, at most.
const MAX_TRIANGLES: usize = 20_000;

pub(super) fn draw_colliders(
    mut gizmos: Gizmos<MassSpringGizmos>,
    colliders: Query<(&ParticleCollider, &GlobalTransform)>,
) {
    if !gizmos.config_ext.planes {
        return;
    }
    for (collider, transform) in &colliders {
        draw_shape(&mut gizmos, &collider.shape, *transform);
    }
}

fn draw_shape(gizmos: &mut Gizmos<MassSpringGizmos>, shape: &ColliderShape, transform: GlobalTransform) {
    let MassSpringGizmos { plane_color, plane_size, .. } = *gizmos.config_ext;
    let (scale, rotation, center) = transform.to_scale_rotation_translation();
    let scale = scale.abs();
    let at = Isometry3d::new(center, rotation);
    match shape {
        ColliderShape::HalfSpace => draw_plane(gizmos, at, plane_size, plane_color),
        ColliderShape::Sphere { radius } => {
            gizmos.primitive_3d(&Sphere::new(radius * scale.x), at, plane_color);
        }
        ColliderShape::Capsule { radius, half_length } => {
            let capsule = Capsule3d::new(radius * scale.x, 2.0 * half_length * scale.x);
            gizmos.primitive_3d(&capsule, at, plane_color);
        }
        ColliderShape::Cuboid { half_size } => {
            gizmos.primitive_3d(&Cuboid { half_size: *half_size * scale }, at, plane_color);
        }
        ColliderShape::Cylinder { radius, half_height } => {
            let cylinder = Cylinder { radius: radius * scale.x, half_height: half_height * scale.y };
            gizmos.primitive_3d(&cylinder, at, plane_color);
        }
        ColliderShape::Cone { radius, height } => {
            gizmos.primitive_3d(
                &Cone { radius: radius * scale.x, height: height * scale.y },
                at,
                plane_color,
            );
        }
        ColliderShape::ConicalFrustum { radius_top, radius_bottom, height } => {
            let (radius_top, radius_bottom) = (radius_top * scale.x, radius_bottom * scale.x);
            let frustum = ConicalFrustum { radius_top, radius_bottom, height: height * scale.y };
            gizmos.primitive_3d(&frustum, at, plane_color);
        }
        ColliderShape::ConvexHull { points } => {
            for point in points.iter() {
                let point = transform.transform_point(*point);
                gizmos.cross(Isometry3d::from_translation(point), 0.05, plane_color);
            }
        }
        ColliderShape::Mesh { vertices, triangles, .. } => {
            for corners in triangles.iter().take(MAX_TRIANGLES) {
                let corner = |number: u32| vertices.get(number as usize);
                if let [Some(a), Some(b), Some(c)] = corners.map(corner) {
                    let places = [a, b, c, a].map(|corner| transform.transform_point(*corner));
                    gizmos.linestrip(places, plane_color);
                }
            }
        }
        ColliderShape::HeightField { size, heights } => draw_heights(gizmos, *size, heights, transform),
        ColliderShape::Compound { parts } => {
            for part in parts.iter() {
                let place = Transform::from_translation(part.position).with_rotation(part.rotation);
                draw_shape(gizmos, &part.shape, transform * place);
            }
        }
    }
}

fn draw_plane(gizmos: &mut Gizmos<MassSpringGizmos>, at: Isometry3d, size: f32, color: Color) {
    const CELLS: u32 = 10;
    // Gizmo grids lie in the local xy plane; planes lie in the local xz plane.
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
) {
    let color = gizmos.config_ext.plane_color;
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
