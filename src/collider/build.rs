//! From `ParticleCollider`s to the colliders of the solver: checks, and the scale of the transform.

use bevy::prelude::*;

use super::{ColliderPart, ColliderShape};
use crate::parameter::{self, InvalidParameter};
use crate::solver::{MeshError, Shape};

/// The difference between two scales, as a part of them, below which they are rounded from the same one.
const SAME_SCALE: f32 = 1e-4;

fn refuse(field: &'static str, value: impl std::fmt::Display, expected: &'static str) -> InvalidParameter {
    InvalidParameter { field, value: value.to_string(), expected }
}

impl ColliderShape {
    /// Checks its sizes, and that a mesh or hull is one.
    ///
    /// # Errors
    /// Names the field at fault.
    pub fn validate(&self) -> Result<(), InvalidParameter> {
        self.build(Vec3::ONE).map(|_| ())
    }

    /// What the solver collides with, at a scale.
    pub(crate) fn build(&self, scale: Vec3) -> Result<Shape, InvalidParameter> {
        self.check_sizes()?;
        if matches!(self, Self::HalfSpace) {
            return Ok(Shape::HALF_SPACE);
        }
        if !scale.is_finite() || scale.abs().min_element() == 0.0 {
            return Err(refuse("scale", scale, "finite numbers that are not 0"));
        }
        let [x, y, z] = scale.to_array().map(f32::abs);
        let is_same = |one: f32, other: f32| (one - other).abs() <= SAME_SCALE * one.max(other);
        let needs =
            |is_met: bool, expected| if is_met { Ok(()) } else { Err(refuse("scale", scale, expected)) };
        let is_uniform = is_same(x, y) && is_same(y, z);
        match self {
            Self::HalfSpace => Ok(Shape::HALF_SPACE),
            Self::Sphere { radius } => {
                needs(is_uniform, "the same along all axes of a sphere")?;
                Ok(Shape::ball(radius * x))
            }
            Self::Capsule { radius, half_length } => {
                needs(is_uniform, "the same along all axes of a capsule")?;
                Ok(Shape::capsule(radius * x, half_length * x))
            }
            Self::Cuboid { half_size } => Ok(Shape::cuboid(*half_size * scale.abs())),
            Self::Cylinder { radius, half_height } => {
                needs(is_same(x, z), "the same across the axis of a cylinder")?;
                Ok(Shape::frustum([radius * x; 2], half_height * y))
            }
            Self::Cone { radius, height } => {
                needs(is_same(x, z), "the same across the axis of a cone")?;
                Ok(frustum([radius * x, 0.0], 0.5 * height * scale.y))
            }
            Self::ConicalFrustum { radius_top, radius_bottom, height } => {
                needs(is_same(x, z), "the same across the axis of a frustum")?;
                Ok(frustum([radius_bottom * x, radius_top * x], 0.5 * height * scale.y))
            }
            Self::ConvexHull { points } => hull(points.iter().map(|point| *point * scale).collect()),
            Self::Mesh { vertices, triangles, one_sided } => mesh(
                vertices.iter().map(|vertex| *vertex * scale).collect(),
                triangles.to_vec(),
                *one_sided,
                scale,
            ),
            Self::HeightField { size, heights } => {
                let (vertices, triangles) = grid(*size, heights);
                let vertices = vertices.into_iter().map(|vertex| vertex * scale).collect();
                mesh(vertices, triangles, true, scale)
            }
            Self::Compound { parts } => {
                needs(
                    is_uniform && scale.min_element() > 0.0,
                    "the same and > 0 along all axes of a compound",
                )?;
                compound(parts, x)
            }
        }
    }

    fn check_sizes(&self) -> Result<(), InvalidParameter> {
        match self {
            Self::HalfSpace => Ok(()),
            Self::Sphere { radius } => parameter::positive("radius", *radius),
            Self::Capsule { radius, half_length } => {
                parameter::positive("radius", *radius)?;
                parameter::positive("half_length", *half_length)
            }
            Self::Cuboid { half_size } => {
                parameter::finite("half_size", *half_size)?;
                match half_size.min_element() > 0.0 {
                    true => Ok(()),
                    false => Err(refuse("half_size", half_size, "three numbers > 0")),
                }
            }
            Self::Cylinder { radius, half_height } => {
                parameter::positive("radius", *radius)?;
                parameter::positive("half_height", *half_height)
            }
            Self::Cone { radius, height } => {
                parameter::positive("radius", *radius)?;
                parameter::positive("height", *height)
            }
            Self::ConicalFrustum { radius_top, radius_bottom, height } => {
                parameter::non_negative("radius_top", *radius_top)?;
                parameter::non_negative("radius_bottom", *radius_bottom)?;
                parameter::positive("radius_bottom", radius_top.max(*radius_bottom))?;
                parameter::positive("height", *height)
            }
            Self::HeightField { size, heights } => check_heights(*size, heights),
            Self::Compound { parts } if parts.is_empty() => {
                Err(refuse("parts", "empty", "at least one part"))
            }
            Self::Compound { parts } => parts.iter().try_for_each(|part| {
                parameter::finite("position", part.position)?;
                if !part.rotation.is_finite() || part.rotation.length_squared() == 0.0 {
                    return Err(refuse("rotation", part.rotation, "a finite rotation that is not 0"));
                }
                match &part.shape {
                    Self::Compound { .. } => {
                        Err(refuse("parts", "a compound", "shapes that are no compounds"))
                    }
                    shape => shape.check_sizes(),
                }
            }),
            Self::ConvexHull { .. } | Self::Mesh { .. } => Ok(()),
        }
    }
}

/// Of this signed half height: a negative one stands on its head.
fn frustum([bottom, top]: [f32; 2], half_height: f32) -> Shape {
    let radii = if half_height < 0.0 { [top, bottom] } else { [bottom, top] };
    Shape::frustum(radii, half_height.abs())
}

fn mesh(
    vertices: Vec<Vec3>,
    mut triangles: Vec<[u32; 3]>,
    one_sided: bool,
    scale: Vec3,
) -> Result<Shape, InvalidParameter> {
    // A reflection turns all triangles round.
    if scale.x * scale.y * scale.z < 0.0 {
        triangles.iter_mut().for_each(|[_, second, third]| std::mem::swap(second, third));
    }
    Shape::mesh(&vertices, &triangles, one_sided).map_err(|problem| {
        let field = if matches!(problem, MeshError::NotFinite(_)) { "vertices" } else { "triangles" };
        refuse(field, format_args!("such that {problem}"), "a surface of triangles")
    })
}

#[cfg(feature = "parry")]
fn hull(points: Vec<Vec3>) -> Result<Shape, InvalidParameter> {
    Shape::convex_hull(&points).map_err(|problem| match problem {
        MeshError::NotFinite(point) => {
            refuse("points", format_args!("such that point {point} is not"), "finite points")
        }
        _ => refuse("points", "such that all are in one plane", "points that enclose a volume"),
    })
}

#[cfg(not(feature = "parry"))]
fn hull(_: Vec<Vec3>) -> Result<Shape, InvalidParameter> {
    Err(refuse("shape", "ConvexHull", "another shape: hulls need the feature `parry` of bevy_mass_spring"))
}

fn check_heights(size: Vec2, heights: &[Vec<f32>]) -> Result<(), InvalidParameter> {
    if !(size.is_finite() && size.min_element() > 0.0) {
        return Err(refuse("size", size, "two finite numbers > 0"));
    }
    let columns = heights.first().map_or(0, Vec::len);
    if heights.len() < 2 || columns < 2 || heights.iter().any(|row| row.len() != columns) {
        let lengths = format_args!("of {} rows, the first of {columns}", heights.len()).to_string();
        return Err(refuse("heights", lengths, "at least 2 rows of the same number of heights, at least 2"));
    }
    match heights.iter().flatten().find(|height| !height.is_finite()) {
        Some(height) => Err(refuse("heights", format_args!("such that one is {height}"), "finite heights")),
        None => Ok(()),
    }
}

/// The mesh of a height field: each cell is two triangles, which look up.
fn grid(size: Vec2, heights: &[Vec<f32>]) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let (rows, columns) = (heights.len(), heights[0].len());
    let part = |number: usize, count: usize| number as f32 / (count - 1) as f32 - 0.5;
    let vertices = heights.iter().enumerate().flat_map(|(row, heights)| {
        let z = size.y * part(row, rows);
        heights
            .iter()
            .enumerate()
            .map(move |(column, height)| Vec3::new(size.x * part(column, columns), *height, z))
    });
    let corner = |row: usize, column: usize| (row * columns + column) as u32;
    let cells = (0..rows - 1).flat_map(|row| (0..columns - 1).map(move |column| (row, column)));
    let triangles = cells.flat_map(|(row, column)| {
        let [a, b] = [corner(row, column), corner(row, column + 1)];
        let [c, d] = [corner(row + 1, column), corner(row + 1, column + 1)];
        [[a, c, b], [b, c, d]]
    });
    (vertices.collect(), triangles.collect())
}

fn compound(parts: &[ColliderPart], scale: f32) -> Result<Shape, InvalidParameter> {
    let parts = parts.iter().map(|ColliderPart { shape, position, rotation }| {
        Ok((*position * scale, rotation.normalize(), shape.build(Vec3::splat(scale))?))
    });
    Ok(Shape::compound(parts.collect::<Result<Vec<_>, InvalidParameter>>()?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bad_shapes_are_refused_by_the_name_of_the_field() {
        let sphere = |radius| ColliderShape::Sphere { radius };
        let cuboid = |half_size| ColliderShape::Cuboid { half_size };
        let mesh = |triangles: Vec<[u32; 3]>| ColliderShape::Mesh {
            vertices: vec![Vec3::ZERO, Vec3::X, Vec3::Z, Vec3::X * 2.0].into(),
            triangles: triangles.into(),
            one_sided: false,
        };
        let heights =
            |heights: Vec<Vec<f32>>| ColliderShape::HeightField { size: Vec2::ONE, heights: heights.into() };
        let cases = [
            (sphere(0.0), "radius"),
            (sphere(f32::NAN), "radius"),
            (cuboid(Vec3::new(1.0, 0.0, 1.0)), "half_size"),
            (ColliderShape::Capsule { radius: 1.0, half_length: -1.0 }, "half_length"),
            (ColliderShape::Cone { radius: 1.0, height: 0.0 }, "height"),
            (
                ColliderShape::ConicalFrustum { radius_top: 0.0, radius_bottom: 0.0, height: 1.0 },
                "radius_bottom",
            ),
            (ColliderShape::ConvexHull { points: vec![Vec3::ZERO, Vec3::X, Vec3::Y].into() }, "points"),
            (mesh(vec![[0, 1, 3]]), "triangles"),
            (mesh(vec![[0, 1, 7]]), "triangles"),
            (heights(vec![vec![0.0, 1.0]]), "heights"),
            (heights(vec![vec![0.0, 1.0], vec![0.0]]), "heights"),
            (heights(vec![vec![0.0, 1.0], vec![0.0, f32::INFINITY]]), "heights"),
            (ColliderShape::Compound { parts: Vec::new().into() }, "parts"),
        ];
        for (shape, field) in cases {
            assert_eq!(shape.validate().unwrap_err().field, field, "{shape:?}");
        }
        assert!(mesh(vec![[0, 2, 1]]).validate().is_ok());
        assert!(heights(vec![vec![0.0, 1.0], vec![2.0, 3.0]]).validate().is_ok());
    }

    #[test]
    fn scales_that_change_the_kind_of_a_shape_are_refused() {
        let wide = Vec3::new(2.0, 1.0, 1.0);
        let sphere = ColliderShape::Sphere { radius: 1.0 };
        assert_eq!(sphere.build(wide).unwrap_err().field, "scale");
        assert!(sphere.build(Vec3::splat(2.0)).is_ok());
        assert!(ColliderShape::Cuboid { half_size: Vec3::ONE }.build(wide).is_ok());
        let cylinder = ColliderShape::Cylinder { radius: 1.0, half_height: 1.0 };
        assert!(cylinder.build(Vec3::new(2.0, 7.0, 2.0)).is_ok() && cylinder.build(wide).is_err());
        assert!(cylinder.build(Vec3::ZERO).is_err());
    }
}
