//! The first contact of a ball that moves in a straight line with a shape.
//!
//! Convex shapes: conservative advancement (Mirtich, *Impulse-based dynamic simulation*, 1996) up to the tangent plane. Meshes: the line
//! of the centre is intersected with the triangles, exactly; a cast, which has a ball of any size, advances to each of them.

use bevy::math::DVec3;

use super::{Crossing, Kind, Nearest, Part, Shape};

/// Steps of an advancement, at most: a ball that grazes a surface for longer than that ends there.
const MAX_STEPS: usize = 48;

/// A gap below this part of the coordinates is none.
const TOUCH: f64 = 1e-9;

/// A gap below this is none to a cast, m for each m of the radius and 1 m beside.
const CAST_TOUCH: f64 = 1e-7;

/// Whether what touches at the start, or on its way along a surface, counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Resting {
    Counts,
    IsIgnored,
}

impl Shape {
    /// Where a ball of this `radius` first touches the shape while its centre moves from `from` to `to`, in the axes of the
    /// shape; `None` where it goes past, away or along it. Of meshes, where the centre crosses them.
    pub(in crate::solver) fn first_touch(&self, from: DVec3, to: DVec3, radius: f64) -> Option<Crossing> {
        match &self.0 {
            Kind::Mesh(mesh) => mesh.crossing(from, to),
            Kind::Compound(parts) => {
                first_of(parts, from, to, |part, from, to| part.first_touch(from, to, radius))
            }
            Kind::Flat(shape) => shape.first_touch(from, to, radius),
            _ => self.advance(from, to, radius),
        }
    }

    /// When a ball first touches it on the way of its centre, in its own axes: as a part of the way, with the point of the
    /// surface and its normal; 0 where it does from the start.
    pub fn cast(&self, from: DVec3, to: DVec3, radius: f64) -> Option<(f64, DVec3, DVec3)> {
        let Crossing { time, foot, normal } = self.first_contact(from, to, radius)?;
        Some((time, foot, normal))
    }

    /// The same.
    pub(in crate::solver) fn first_contact(&self, from: DVec3, to: DVec3, radius: f64) -> Option<Crossing> {
        let at_start = self.nearest(from, 0.0);
        if at_start.distance - radius <= cast_touch(radius) {
            let foot = from - at_start.normal * at_start.distance;
            return Some(Crossing { time: 0.0, foot, normal: at_start.normal });
        }
        match &self.0 {
            Kind::Mesh(mesh) => mesh.cast(from, to, radius),
            Kind::Compound(parts) => {
                first_of(parts, from, to, |part, from, to| part.first_contact(from, to, radius))
            }
            Kind::Flat(shape) => shape.first_contact(from, to, radius),
            _ => cast_to_convex(|point| self.nearest(point, 0.0), from, to, radius),
        }
    }

    /// Advancement towards a convex shape, by as much as its tangent plane allows.
    fn advance(&self, from: DVec3, to: DVec3, radius: f64) -> Option<Crossing> {
        let touch = TOUCH * (1.0 + from.abs().max_element() + to.abs().max_element());
        advance(|point| self.nearest(point, 0.0), [from, to], [radius, touch], Resting::IsIgnored)
    }
}

/// The first of the contacts with the parts of a compound.
fn first_of(
    parts: &[Part],
    from: DVec3,
    to: DVec3,
    contact: impl Fn(&Shape, DVec3, DVec3) -> Option<Crossing>,
) -> Option<Crossing> {
    let contacts = parts.iter().filter_map(|Part { placement, shape, .. }| {
        let found = contact(shape, placement.to_local(from), placement.to_local(to))?;
        let normal = placement.rotation * found.normal;
        Some(Crossing { foot: placement.to_world(found.foot), normal, ..found })
    });
    contacts.min_by(|one, other| one.time.total_cmp(&other.time))
}

fn cast_touch(radius: f64) -> f64 {
    CAST_TOUCH * (1.0 + radius)
}

/// Where a ball first touches a convex solid, of which `nearest` is the nearest point of the surface, on the way of its centre.
pub(super) fn cast_to_convex(
    nearest: impl Fn(DVec3) -> Nearest,
    from: DVec3,
    to: DVec3,
    radius: f64,
) -> Option<Crossing> {
    advance(nearest, [from, to], [radius, cast_touch(radius)], Resting::Counts)
}

/// The same, where a gap of less than `touch` m is none.
fn advance(
    nearest: impl Fn(DVec3) -> Nearest,
    [from, to]: [DVec3; 2],
    [radius, touch]: [f64; 2],
    resting: Resting,
) -> Option<Crossing> {
    let way = to - from;
    let length = way.length();
    // Written so that NaN takes this branch.
    if !(length >= 0.0 && length.is_finite()) {
        return None;
    }
    let mut time = 0.0;
    for step in 0.. {
        let point = from + way * time;
        let nearest = nearest(point);
        let gap = nearest.distance - radius;
        // Along a line the distance from a convex shape is a convex function: what leaves never comes back.
        let approach = -way.dot(nearest.normal);
        let counts = resting == Resting::Counts && gap <= touch;
        if approach <= 1e-12 * length && !counts {
            return None;
        }
        if gap <= touch || step == MAX_STEPS {
            let foot = point - nearest.normal * nearest.distance;
            return Some(Crossing { time, foot, normal: nearest.normal });
        }
        // It lies above its tangent, so that this is never too far (Newton's method, from the left).
        time += gap / approach;
        if time.is_nan() || time > 1.0 {
            return None;
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use bevy::math::{Quat, Vec3};

    use super::*;

    fn touch(shape: &Shape, from: Vec3, to: Vec3, radius: f64) -> Option<Crossing> {
        shape.first_touch(from.as_dvec3(), to.as_dvec3(), radius)
    }

    #[test]
    fn a_ball_meets_a_thin_box_where_it_should() {
        let wall = Shape::cuboid(Vec3::new(1e-3, 5.0, 5.0));
        let found = touch(&wall, Vec3::new(-10.0, 1.0, 0.0), Vec3::new(10.0, 2.0, 1.0), 0.1).unwrap();
        assert!((found.time - (10.0 - 0.101) / 20.0).abs() < 1e-6, "{found:?}");
        assert_eq!(found.normal, DVec3::NEG_X);
        assert!(touch(&wall, Vec3::new(-10.0, 6.0, 0.0), Vec3::new(10.0, 6.0, 0.0), 0.1).is_none());
        assert!(touch(&wall, Vec3::new(-0.5, 0.0, 0.0), Vec3::new(-9.0, 0.0, 0.0), 0.1).is_none());
    }

    #[test]
    fn a_point_on_a_surface_that_goes_along_it_meets_nothing_and_one_that_goes_in_does_at_once() {
        let block = Shape::cuboid(Vec3::ONE);
        assert!(touch(&block, Vec3::new(0.0, 1.0, 0.0), Vec3::new(9.0, 1.0, 0.0), 0.0).is_none());
        let found = touch(&block, Vec3::new(0.0, 1.0, 0.0), Vec3::new(0.5, -9.0, 0.0), 0.0).unwrap();
        assert_eq!((found.time, found.normal), (0.0, DVec3::Y));
    }

    #[test]
    fn the_first_part_of_a_compound_counts() {
        let parts = [2.0, -1.0].map(|x| (Vec3::X * x, Quat::IDENTITY, Shape::ball(0.5)));
        let both = Shape::compound(parts);
        let found = touch(&both, Vec3::X * -4.0, Vec3::X * 6.0, 0.0).unwrap();
        assert!((found.time - 0.25).abs() < 1e-9 && found.normal == DVec3::NEG_X, "{found:?}");
    }

    /// A ray that comes down at 1° from 10 m touches the ground after 10 m / sin 1°, a ball of 0.5 m at 9.5 m / sin 1°.
    #[test]
    fn a_cast_that_grazes_the_ground_meets_it() {
        let (sin, cos) = 1_f64.to_radians().sin_cos();
        let to = DVec3::new(cos, -sin, 0.0) * 1e4;
        for radius in [0.0, 0.5] {
            let start = DVec3::Y * 10.0;
            let (time, foot, normal) = Shape::HALF_SPACE.cast(start, start + to, radius).unwrap();
            // A gap of CAST_TOUCH is none.
            let expected = (10.0 - radius) / sin;
            assert!((time * 1e4 - expected).abs() < 2.0 * CAST_TOUCH / sin, "{}", time * 1e4);
            assert!(foot.y.abs() < 1e-6 && normal == DVec3::Y);
        }
    }

    /// A box and the mesh of the same box: all casts from outside meet both at the same time, or neither.
    #[test]
    fn a_ball_meets_a_mesh_where_it_meets_the_solid() {
        let (vertices, triangles) = super::super::mesh::tests::box_mesh();
        let mesh = Shape::mesh(&vertices, &triangles, false).unwrap();
        let solid = Shape::cuboid(Vec3::new(1.0, 2.0, 3.0));
        let mut seed = 1_u32;
        let mut random = || {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(seed >> 8) / f64::from(1_u32 << 24) - 0.5
        };
        let mut hits = 0;
        for number in 0..400 {
            let mut place = || DVec3::new(random(), random(), random()) * 10.0;
            let (from, to) = (place(), place());
            let radius = [0.0, 0.3][number % 2];
            let [one, other] = [&solid, &mesh].map(|shape| shape.cast(from, to, radius));
            let Some((time, foot, normal)) = one else {
                assert_eq!(other, None, "{from} to {to}");
                continue;
            };
            hits += 1;
            let (met, met_at, facing) = other.expect("the mesh is as large");
            // Gaps of CAST_TOUCH, met at a slope of 1 in 1000 at the least.
            assert!((time - met).abs() < 1e3 * CAST_TOUCH, "{from} to {to}: {time} and {met}");
            let is_edge = foot.distance(met_at) < 1e-3;
            assert!(is_edge && (time == 0.0 || normal.distance(facing) < 1e-3), "{from} to {to}");
        }
        assert!(hits > 60, "{hits}");
    }
}
