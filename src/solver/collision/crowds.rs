//! Crowds: spheres with more partners than can be solved for, as where many are put in one place. The pairs of n spheres that all overlap
//! are n²/2; of each sphere in a crowd a few are listed.

use bevy::math::Vec3;

/// Greatest number of listed partners of a sphere in a crowd that are of its own size or larger: the densest packing of spheres
/// that do not overlap has about half as many within thick skins.
pub(super) const MAX_PARTNERS: usize = 64;

/// Interval, in listed partners, at which [`is_crowd`] is evaluated.
pub(super) const CHECKED_PARTNERS: usize = 16;

/// Number of partners that are kept of a sphere in a crowd: enough to come apart, and few enough to be solved.
pub(super) const CROWDED_PARTNERS: usize = 10;

/// Least number of partners with centres within [`DEEP_DISTANCE`] in a crowd. Impacts do not cause overlaps of that depth: such spheres
/// were spawned or moved into each other.
const DEEP_PARTNERS: usize = 2;

/// Distance of the centres in a deep overlap, as a part of the sum of the radii.
const DEEP_DISTANCE: f32 = 0.5;

/// Appends a pair to those of its first sphere, which begin at the index `first`; whether that sphere is in a crowd, evaluated at every
/// `checked`-th pair.
pub(super) fn push_pair(
    pairs: &mut Vec<(u32, u32)>,
    (first, checked): (usize, usize),
    pair: (u32, u32),
    is_crowded: impl Fn(u32, &[(u32, u32)]) -> bool,
) -> bool {
    pairs.push(pair);
    let listed = &pairs[first..];
    listed.len().is_multiple_of(checked) && is_crowded(pair.0, listed)
}

/// Whether the sphere that has these partners is in a crowd. `sphere` gives the centre and the radius of the sphere in a slot, m.
pub(super) fn is_crowd(listed: &[(u32, u32)], sphere: impl Fn(u32) -> (Vec3, f32)) -> bool {
    let overlap_deeply = |(a, b): &&(u32, u32)| {
        let [(place, radius), (other, other_radius)] = [*a, *b].map(&sphere);
        let distance = DEEP_DISTANCE * (radius + other_radius);
        place.distance_squared(other) < distance * distance
    };
    listed.len() >= MAX_PARTNERS || listed.iter().filter(overlap_deeply).nth(DEEP_PARTNERS - 1).is_some()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_crowd_is_told_by_its_number_or_by_deep_overlaps() {
        let listed: Vec<(u32, u32)> = (1..=16).map(|other| (0, other)).collect();
        // Spheres of 1 m: `deep` of them at 0.9 m, the others at 1.5 m.
        let is_crowd_with = |deep: u32| {
            let place = |slot: u32| match slot {
                0 => 0.0,
                _ if slot <= deep => 0.9,
                _ => 1.5,
            };
            is_crowd(&listed, |slot| (Vec3::X * place(slot), 1.0))
        };
        assert_eq!([0, 1, 2, 16].map(is_crowd_with), [false, false, true, true]);
        let many: Vec<(u32, u32)> = (1..=64).map(|other| (0, other)).collect();
        assert!(is_crowd(&many, |slot| (Vec3::X * 10.0 * slot as f32, 1.0)));
    }
}
