//! Shapes of colliders from Bevy's primitives.

use bevy::prelude::*;

use super::{ColliderShape, ParticleCollider, SharedList};

impl<T: Into<ColliderShape>> From<T> for ParticleCollider {
    fn from(shape: T) -> Self {
        Self::new(shape)
    }
}

impl From<Sphere> for ColliderShape {
    fn from(Sphere { radius }: Sphere) -> Self {
        Self::Sphere { radius }
    }
}

impl From<Cuboid> for ColliderShape {
    fn from(Cuboid { half_size }: Cuboid) -> Self {
        Self::Cuboid { half_size }
    }
}

impl From<Capsule3d> for ColliderShape {
    fn from(Capsule3d { radius, half_length }: Capsule3d) -> Self {
        Self::Capsule { radius, half_length }
    }
}

impl From<Cylinder> for ColliderShape {
    fn from(Cylinder { radius, half_height }: Cylinder) -> Self {
        Self::Cylinder { radius, half_height }
    }
}

impl From<Cone> for ColliderShape {
    fn from(Cone { radius, height }: Cone) -> Self {
        Self::Cone { radius, height }
    }
}

impl From<ConicalFrustum> for ColliderShape {
    fn from(ConicalFrustum { radius_top, radius_bottom, height }: ConicalFrustum) -> Self {
        Self::ConicalFrustum { radius_top, radius_bottom, height }
    }
}

impl From<Circle> for ColliderShape {
    fn from(Circle { radius }: Circle) -> Self {
        Self::Sphere { radius }
    }
}

impl From<Capsule2d> for ColliderShape {
    fn from(Capsule2d { radius, half_length }: Capsule2d) -> Self {
        Self::Capsule { radius, half_length }
    }
}

/// A box that is deeper than it is wide and high: what is in it leaves by a side.
impl From<Rectangle> for ColliderShape {
    fn from(Rectangle { half_size }: Rectangle) -> Self {
        Self::Cuboid { half_size: half_size.extend(half_size.element_sum()) }
    }
}

/// The prism above and below it.
impl From<Triangle2d> for ColliderShape {
    fn from(Triangle2d { vertices }: Triangle2d) -> Self {
        prism(vertices.to_vec())
    }
}

/// The prism above and below it.
impl From<RegularPolygon> for ColliderShape {
    fn from(polygon: RegularPolygon) -> Self {
        prism(polygon.vertices(0.0).into_iter().collect())
    }
}

/// The prism above and below it.
impl From<Rhombus> for ColliderShape {
    fn from(Rhombus { half_diagonals: Vec2 { x, y } }: Rhombus) -> Self {
        prism(vec![Vec2::new(x, 0.0), Vec2::new(0.0, y), Vec2::new(-x, 0.0), Vec2::new(0.0, -y)])
    }
}

/// The prism above and below it. It is to be convex: `new_unchecked` does not check that.
impl From<ConvexPolygon> for ColliderShape {
    fn from(polygon: ConvexPolygon) -> Self {
        prism(polygon.vertices().to_vec())
    }
}

/// The sheet above and below it, which is met from both sides; [`one_sided`](ColliderShape::one_sided), all to the right of
/// it, seen along the line, is solid.
impl From<Segment2d> for ColliderShape {
    fn from(Segment2d { vertices }: Segment2d) -> Self {
        sheet(&vertices)
    }
}

/// The sheet above and below it, which is met from both sides; [`one_sided`](ColliderShape::one_sided), all to the right of
/// it, seen along the line, is solid: ground, where it runs along +x.
impl From<Polyline2d> for ColliderShape {
    fn from(Polyline2d { vertices }: Polyline2d) -> Self {
        sheet(&vertices)
    }
}

/// The solid prism of a convex polygon, whichever way round its corners go; without triangles if it has no area.
fn prism(mut corners: Vec<Vec2>) -> ColliderShape {
    let next = corners.iter().cycle().skip(1);
    let cross = |(one, other): (&Vec2, &Vec2)| one.as_dvec2().perp_dot(other.as_dvec2());
    let area = corners.iter().zip(next).map(cross).sum::<f64>();
    if area < 0.0 {
        corners.reverse();
    }
    let count = if area == 0.0 { 0 } else { corners.len() as u32 };
    // Of corner i, i is at the front and `count` + i at the back.
    let ends = (2..count).flat_map(|i| [[0, i - 1, i], [count, count + i, count + i - 1]]);
    let sides = (0..count).flat_map(|i| {
        let j = (i + 1) % count;
        [[count + i, count + j, j], [count + i, j, i]]
    });
    let triangles = ends.chain(sides).collect();
    ColliderShape::Mesh { vertices: extruded(&corners), triangles, one_sided: false }
}

/// The sheet of a line. Its triangles face the left side of the line, seen along it.
fn sheet(line: &[Vec2]) -> ColliderShape {
    let count = line.len() as u32;
    let triangles = (1..count).flat_map(|j| {
        let i = j - 1;
        [[count + i, j, count + j], [count + i, i, j]]
    });
    ColliderShape::Mesh { vertices: extruded(line), triangles: triangles.collect(), one_sided: false }
}

/// Points in front, then behind the plane z = 0, farther from it than any of them is from the origin: what is in the prism
/// leaves by a side.
fn extruded(points: &[Vec2]) -> SharedList<Vec3> {
    let depth = points.iter().map(|point| point.length()).fold(0.0, f32::max) * 2.0;
    [depth, -depth].into_iter().flat_map(|z| points.iter().map(move |point| point.extend(z))).collect()
}

#[cfg(test)]
mod tests {
    use bevy::math::DVec3;

    use super::*;

    /// How far points are from a shape in the plane z = 0, m; negative inside.
    #[track_caller]
    fn assert_distances(shape: impl Into<ColliderShape>, distances: &[([f64; 2], f64)]) {
        let depth = shape.into().depth_meter().expect("valid");
        for &([x, y], expected) in distances {
            let found = -depth(DVec3::new(x, y, 0.0), 0.0);
            // Corners are rounded to f32.
            assert!((found - expected).abs() < 4e-7, "({x}, {y}): {found}, expected {expected}");
        }
    }

    #[test]
    fn polygons_are_solid_whichever_way_round_they_go() {
        let square = [Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y];
        let distances = [([0.5, 0.25], -0.25), ([0.5, -0.25], 0.25), ([2.0, 2.0], f64::sqrt(2.0))];
        let mut reversed = square;
        reversed.reverse();
        for corners in [square, reversed] {
            assert_distances(ConvexPolygon::new(corners).unwrap(), &distances);
        }
        let half = f64::sqrt(0.5);
        assert_distances(
            Rhombus::new(2.0, 2.0),
            &[([0.0, 0.0], -half), ([1.0, 1.0], half), ([0.0, 3.0], 2.0)],
        );
        assert_distances(RegularPolygon::new(1.0, 4), &[([0.0, 0.0], -half), ([0.0, 3.0], 2.0)]);
        let triangle = Triangle2d::new(Vec2::ZERO, Vec2::Y * 2.0, Vec2::X * 2.0);
        assert_distances(
            triangle,
            &[([0.5, 0.25], -0.25), ([-3.0, -4.0], 5.0), ([2.0, 2.0], f64::sqrt(2.0))],
        );
    }

    #[test]
    fn polygons_without_an_area_are_refused() {
        let line = Triangle2d::new(Vec2::ZERO, Vec2::X, Vec2::X * 2.0);
        let shapes: [ColliderShape; 6] = [
            line.into(),
            Rhombus::new(1.0, 0.0).into(),
            RegularPolygon::new(0.0, 3).into(),
            ConvexPolygon::new_unchecked([Vec2::X, Vec2::Y]).into(),
            Polyline2d::new([Vec2::X]).into(),
            Segment2d::new(Vec2::X, Vec2::X).into(),
        ];
        for shape in shapes {
            assert_eq!(shape.validate().unwrap_err().field, "triangles", "{shape:?}");
        }
        let rhombus = ColliderShape::from(Rhombus::new(f32::NAN, 1.0));
        assert_eq!(rhombus.validate().unwrap_err().field, "vertices");
    }

    #[test]
    fn lines_have_two_sides_unless_they_are_one_sided() {
        let line = Polyline2d::new([Vec2::new(-1.0, 0.0), Vec2::new(1.0, 0.0), Vec2::new(2.0, 1.0)]);
        let half = f64::sqrt(0.5);
        assert_distances(line.clone(), &[([0.0, 0.5], 0.5), ([0.0, -0.5], 0.5), ([2.0, 0.0], half)]);
        let ground = ColliderShape::from(line).one_sided();
        assert_distances(ground, &[([0.0, 0.5], 0.5), ([0.0, -0.5], -0.5), ([2.0, 0.0], -half)]);
        assert_distances(Segment2d::new(Vec2::ZERO, Vec2::Y), &[([-1.0, 0.5], 1.0), ([3.0, 5.0], 5.0)]);
    }
}
