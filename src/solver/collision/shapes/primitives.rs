//! Signed distances of the shapes that have a closed form, in their own axes.
//!
//! The formulas are those of any textbook (Ericson, *Real-Time Collision Detection*, 2005, chapter 5): the distance to
//! the nearest point of the boundary, negative inside, with the outward normal there. All in f64, as implicit steps
//! are solved far below the rounding of f32.

use bevy::math::{DVec2, DVec3};

use super::Nearest;

/// The ball of this radius, m.
pub(super) fn ball(point: DVec3, radius: f64) -> Nearest {
    let distance = point.length();
    let normal = if distance > 0.0 { point / distance } else { DVec3::Y };
    Nearest { distance: distance - radius, normal }
}

/// All within `radius` of the segment of the half length `half_length` along y, m.
pub(super) fn capsule(point: DVec3, radius: f64, half_length: f64) -> Nearest {
    let apart = point.with_y(point.y - point.y.clamp(-half_length, half_length));
    let distance = apart.length();
    // On the axis every direction across it is as good.
    let normal = if distance > 0.0 { apart / distance } else { DVec3::X };
    Nearest { distance: distance - radius, normal }
}

/// The box of these half sizes, m.
pub(super) fn cuboid(point: DVec3, half_size: DVec3) -> Nearest {
    let beyond = point.abs() - half_size;
    let sign = DVec3::ONE.copysign(point);
    let outside = beyond.max(DVec3::ZERO);
    let distance = outside.length();
    if distance > 0.0 {
        return Nearest { distance, normal: sign * outside / distance };
    }
    let deepest = beyond.max_element();
    let axis = if beyond.x == deepest {
        DVec3::X
    } else if beyond.y == deepest {
        DVec3::Y
    } else {
        DVec3::Z
    };
    Nearest { distance: deepest, normal: sign * axis }
}

/// A frustum about y from −`half_height`, where its radius is the first one, to `half_height`, where it is the
/// second; a cylinder where they are equal, a cone where the second is 0. m.
pub(super) fn frustum(point: DVec3, [bottom, top]: [f64; 2], half_height: f64) -> Nearest {
    let radial = DVec2::new(point.x, point.z);
    let from_axis = radial.length();
    let radial = if from_axis > 0.0 { radial / from_axis } else { DVec2::X };
    let (distance, normal) = profile(DVec2::new(from_axis, point.y), [bottom, top], half_height);
    Nearest { distance, normal: DVec3::new(radial.x * normal.x, normal.y, radial.y * normal.x) }
}

/// The same in the half-plane of the distance from the axis and y: a trapezium, of which the side on the axis does not
/// count.
fn profile(point: DVec2, [bottom, top]: [f64; 2], half_height: f64) -> (f64, DVec2) {
    let [low, high] = [DVec2::new(bottom, -half_height), DVec2::new(top, half_height)];
    let slant = high - low;
    let length = slant.length();
    let side_normal = DVec2::new(slant.y, -slant.x) / length;
    let beyond_side = (point - low).dot(side_normal);
    let (below, above) = (-half_height - point.y, point.y - half_height);
    if beyond_side <= 0.0 && below <= 0.0 && above <= 0.0 {
        let deepest = beyond_side.max(below).max(above);
        return match deepest {
            _ if deepest == beyond_side => (deepest, side_normal),
            _ if deepest == above => (deepest, DVec2::Y),
            _ => (deepest, DVec2::NEG_Y),
        };
    }
    let along = (point - low).dot(slant) / (length * length);
    if below > 0.0 && point.x <= bottom {
        return (below, DVec2::NEG_Y);
    }
    if above > 0.0 && point.x <= top {
        return (above, DVec2::Y);
    }
    if beyond_side > 0.0 && (0.0..=1.0).contains(&along) {
        return (beyond_side, side_normal);
    }
    let apart = point - if along < 0.5 { low } else { high };
    let distance = apart.length();
    (distance, if distance > 0.0 { apart / distance } else { side_normal })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The nearest point must lie on the boundary, and nothing of the boundary be nearer: by brute force over points of
    /// the profile.
    #[test]
    fn a_frustum_is_as_far_as_the_nearest_point_of_its_boundary() {
        for (radii, half) in [([1.0, 0.4], 0.7), ([0.5, 0.5], 1.0), ([0.8, 0.0], 0.5), ([0.2, 1.1], 0.4)] {
            let corners = [
                DVec2::new(0.0, -half),
                DVec2::new(radii[0], -half),
                DVec2::new(radii[1], half),
                DVec2::new(0.0, half),
            ];
            for sample in 0..400 {
                let point = DVec3::new(
                    f64::from(sample % 20) * 0.17 - 1.6,
                    f64::from(sample / 20) * 0.17 - 1.6,
                    f64::from(sample % 7) * 0.2 - 0.6,
                );
                let flat = DVec2::new(point.xz_length(), point.y);
                let on_edges = corners.windows(2).flat_map(|edge| {
                    (0..=2000).map(move |part| edge[0].lerp(edge[1], f64::from(part) / 2000.0))
                });
                let nearest = on_edges.map(|place| place.distance(flat)).fold(f64::INFINITY, f64::min);
                let found = frustum(point, radii, half);
                assert!((found.distance.abs() - nearest).abs() < 1e-3, "{point} of {radii:?}: {found:?}");
                assert!((found.normal.length() - 1.0).abs() < 1e-12);
                // The foot is on the boundary.
                let foot = frustum(point - found.normal * found.distance, radii, half);
                assert!(foot.distance.abs() < 1e-9, "{point} of {radii:?}: {foot:?}");
            }
        }
    }

    trait Flat {
        fn xz_length(self) -> f64;
    }

    impl Flat for DVec3 {
        fn xz_length(self) -> f64 {
            DVec2::new(self.x, self.z).length()
        }
    }

    #[test]
    fn a_box_pushes_out_of_its_nearest_face_edge_and_corner() {
        let half = DVec3::new(1.0, 2.0, 3.0);
        let inside = cuboid(DVec3::new(0.9, -1.5, 0.0), half);
        assert!((inside.distance + 0.1).abs() < 1e-15 && inside.normal == DVec3::X);
        let corner = cuboid(DVec3::new(2.0, -3.0, 4.0), half);
        assert!((corner.distance - 3.0_f64.sqrt()).abs() < 1e-15);
        assert!(corner.normal.distance(DVec3::new(1.0, -1.0, 1.0).normalize()) < 1e-15);
        let face = cuboid(DVec3::new(0.2, 0.3, -3.5), half);
        assert_eq!((face.distance, face.normal), (0.5, DVec3::NEG_Z));
    }

    #[test]
    fn a_capsule_ends_in_hemispheres() {
        let end = capsule(DVec3::new(3.0, 5.0, 0.0), 0.5, 1.0);
        assert_eq!((end.distance, end.normal), (4.5, DVec3::new(0.6, 0.8, 0.0)));
        let side = capsule(DVec3::new(0.0, 0.5, 2.0), 0.5, 1.0);
        assert_eq!((side.distance, side.normal), (1.5, DVec3::Z));
        assert_eq!(ball(DVec3::ZERO, 1.0), Nearest { distance: -1.0, normal: DVec3::Y });
    }
}
