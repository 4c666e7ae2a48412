//! The first contact of a ball that moves in a straight line with a shape.
//!
//! Convex shapes: conservative advancement (Mirtich, *Impulse-based dynamic simulation*, 1996) up to the tangent plane. Meshes: the line
//! of the centre is intersected with the triangles, exactly.

use bevy::math::DVec3;

use super::{Crossing, Kind, Shape};

/// Steps of an advancement, at most: a ball that grazes a surface for longer than that ends there.
const MAX_STEPS: usize = 48;

/// Steps of a cast, at most: one that grazes a surface for longer than that misses it.
const MAX_CAST_STEPS: usize = 512;

/// A gap below this part of the coordinates is none.
const TOUCH: f64 = 1e-9;

impl Shape {
    /// Where a ball of this `radius` first touches the shape while its centre moves from `from` to `to`, in the axes of the
    /// shape; `None` where it goes past, away or along it. Of meshes, where the centre crosses them.
    pub(in crate::solver) fn first_touch(&self, from: DVec3, to: DVec3, radius: f64) -> Option<Crossing> {
        match &self.0 {
            Kind::Mesh(mesh) => mesh.crossing(from, to),
            Kind::Compound(parts) => {
                let touches = parts.iter().filter_map(|part| {
                    let (from, to) = (part.placement.to_local(from), part.placement.to_local(to));
                    let touch = part.shape.first_touch(from, to, radius)?;
                    let normal = part.placement.rotation * touch.normal;
                    Some(Crossing { foot: part.placement.to_world(touch.foot), normal, ..touch })
                });
                touches.min_by(|one, other| one.time.total_cmp(&other.time))
            }
            Kind::Flat(shape) => shape.first_touch(from, to, radius),
            _ => self.advance(from, to, radius),
        }
    }

    /// When a ball first touches it on the way of its centre, in its own axes: as a part of the way, with the point of the
    /// surface and its normal; 0 where it does from the start.
    pub fn cast(&self, from: DVec3, to: DVec3, radius: f64) -> Option<(f64, DVec3, DVec3)> {
        let (way, mut time) = (to - from, 0.0);
        let length = way.length();
        let touch = 1e-6 * (1.0 + radius);
        for _ in 0..MAX_CAST_STEPS {
            let point = from + way * time;
            let nearest = self.nearest(point, 0.0);
            let gap = nearest.distance - radius;
            if gap <= touch {
                return Some((time, point - nearest.normal * nearest.distance, nearest.normal));
            }
            time += gap / length;
            if time.is_nan() || time > 1.0 {
                return None;
            }
        }
        None
    }

    /// Advancement towards a convex shape, by as much as its tangent plane allows.
    fn advance(&self, from: DVec3, to: DVec3, radius: f64) -> Option<Crossing> {
        let way = to - from;
        let length = way.length();
        // Written so that NaN takes this branch.
        if !(length > 0.0 && length.is_finite()) {
            return None;
        }
        let touch = TOUCH * (1.0 + from.abs().max_element() + to.abs().max_element());
        let mut time = 0.0;
        for step in 0.. {
            let point = from + way * time;
            let nearest = self.nearest(point, 0.0);
            let gap = nearest.distance - radius;
            // Along a line the distance from a convex shape is a convex function: what leaves never comes back.
            let approach = -way.dot(nearest.normal);
            if approach <= 1e-12 * length {
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
}
