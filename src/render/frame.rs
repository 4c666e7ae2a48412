//! From the world, where particles live, into the space of the entity that is drawn.

use bevy::math::{Affine3A, Mat3A, Vec3A, ops};
use bevy::prelude::*;

use super::easing::NetView;

/// The space of an entity, by what it takes to get there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Frame {
    World,
    Moved(Vec3A),
    Affine(Affine3A),
}

impl Frame {
    /// The space of an entity; `None` of one that is flat or nowhere.
    pub fn new(place: &GlobalTransform) -> Option<Self> {
        let affine = place.affine();
        if !affine.is_finite() {
            return None;
        }
        if affine.matrix3 == Mat3A::IDENTITY {
            let is_moved = affine.translation != Vec3A::ZERO;
            return Some(if is_moved { Self::Moved(affine.translation) } else { Self::World });
        }
        let inverse = affine.inverse();
        inverse.is_finite().then_some(Self::Affine(inverse))
    }

    /// How long a metre of the world is there: exact for a uniform scale.
    pub fn scale(&self) -> f32 {
        match self {
            Self::World | Self::Moved(_) => 1.0,
            Self::Affine(affine) => ops::cbrt(affine.matrix3.determinant().abs()),
        }
    }

    /// A direction of the world.
    pub fn turn(&self, direction: Vec3A) -> Vec3A {
        match self {
            Self::World | Self::Moved(_) => direction,
            Self::Affine(affine) => affine.transform_vector3a(direction),
        }
    }

    /// Fills `places` with the positions of the particles in this space.
    pub fn place(&self, view: &NetView, places: &mut Vec<Vec3A>) {
        match *self {
            Self::World => gather(view, places, |place| place),
            Self::Moved(origin) => gather(view, places, |place| place - origin),
            Self::Affine(affine) => gather(view, places, |place| affine.transform_point3a(place)),
        }
    }

    /// The box around all of a box of the world.
    pub fn enclose(&self, [low, high]: [Vec3A; 2]) -> [Vec3A; 2] {
        match *self {
            Self::World => [low, high],
            Self::Moved(origin) => [low - origin, high - origin],
            Self::Affine(affine) => {
                let centre = affine.transform_point3a(0.5 * (low + high));
                let half = affine.matrix3.abs() * (0.5 * (high - low));
                [centre - half, centre + half]
            }
        }
    }
}

fn gather(view: &NetView, places: &mut Vec<Vec3A>, to_local: impl Fn(Vec3A) -> Vec3A) {
    places.clear();
    let Some(start) = view.start else {
        places.extend(view.end.iter().map(|place| to_local(Vec3A::from(*place))));
        return;
    };
    let fraction = view.fraction;
    let (old, new) = view.end.split_at(start.len().min(view.end.len()));
    places.extend(old.iter().zip(start).map(|(end, start)| {
        let (start, end) = (Vec3A::from(*start), Vec3A::from(*end));
        to_local(start + (end - start) * fraction)
    }));
    places.extend(new.iter().map(|place| to_local(Vec3A::from(*place))));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn positions_return_to_where_they_are_in_the_world() {
        let end = [Vec3::new(1.0, 2.0, 3.0), Vec3::new(-4.0, 0.5, 2.0)];
        let start = [Vec3::new(0.0, 2.0, 1.0)];
        for place in [
            Transform::IDENTITY,
            Transform::from_xyz(3.0, -1.0, 2.0),
            Transform::from_xyz(1.0, 2.0, 3.0)
                .with_rotation(Quat::from_rotation_y(0.7))
                .with_scale(Vec3::new(2.0, 0.5, 1.5)),
        ] {
            let place = GlobalTransform::from(place);
            let frame = Frame::new(&place).unwrap();
            let mut places = Vec::new();
            frame.place(&NetView { start: Some(&start), end: &end, fraction: 0.25 }, &mut places);
            let expected = [Vec3::new(0.25, 2.0, 1.5), end[1]];
            for (local, expected) in places.iter().zip(expected) {
                let world = place.transform_point(Vec3::from(*local));
                // A few roundings of coordinates below 8.
                assert!(world.distance(expected) < 16.0 * 8.0 * f32::EPSILON, "{world} {expected}");
            }
        }
    }

    #[test]
    fn flat_entities_have_no_space() {
        let flat = Transform::from_scale(Vec3::new(1.0, 0.0, 1.0));
        assert_eq!(Frame::new(&flat.into()), None);
        assert_eq!(Frame::new(&Transform::from_xyz(f32::NAN, 0.0, 0.0).into()), None);
    }
}
