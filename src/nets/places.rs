//! Particles of a net by where they are: ends, corners, sides, painted groups, the nearest.

use bevy::prelude::*;

use super::{Layout, Topology};

/// A side of a sheet, as seen from its front with its height upwards.
#[derive(Reflect, Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serialize", reflect(Serialize, Deserialize))]
#[reflect(Default, Debug, Clone, PartialEq, Hash)]
pub enum Side {
    /// i = 0.
    #[default]
    Left,
    /// i = nx.
    Right,
    /// j = 0.
    Bottom,
    /// j = ny.
    Top,
}

/// A corner of a sheet, as seen from its front with its height upwards.
#[derive(Reflect, Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serialize", reflect(Serialize, Deserialize))]
#[reflect(Default, Debug, Clone, PartialEq, Hash)]
pub enum Corner {
    /// Where `Bottom` meets `Left`.
    #[default]
    BottomLeft,
    /// Where `Bottom` meets `Right`.
    BottomRight,
    /// Where `Top` meets `Left`.
    TopLeft,
    /// Where `Top` meets `Right`.
    TopRight,
}

#[cfg(feature = "serialize")]
use bevy::reflect::{ReflectDeserialize, ReflectSerialize};

impl Topology {
    /// The first particle of a rope; `None` of other nets and of loops.
    pub fn start(&self) -> Option<u32> {
        (self.layout == Layout::Rope { is_closed: false }).then_some(0)
    }

    /// The last particle of a rope; `None` of other nets and of loops. What a winch adds comes in before it.
    pub fn end(&self) -> Option<u32> {
        let last = self.start().and_then(|_| (self.positions.len() as u32).checked_sub(1))?;
        if !self.is_numbered_by_springs() {
            return Some(last);
        }
        let mut springs_at = vec![0_u32; self.positions.len()];
        self.springs.iter().flat_map(|(ends, _)| ends).for_each(|end| springs_at[*end as usize] += 1);
        (1..=last).rev().find(|particle| springs_at[*particle as usize] == 1).or(Some(last))
    }

    /// The ends of the segments of a rope, in no order. Without a spring for each of them, as they follow by number.
    pub(super) fn segments(&self) -> impl Iterator<Item = [u32; 2]> {
        let by_springs = self.is_numbered_by_springs();
        let is_closed = self.layout == Layout::Rope { is_closed: true };
        let count = self.positions.len() as u32;
        let segments = if is_closed { count } else { count.saturating_sub(1) };
        (0..segments).map(move |first| match by_springs {
            true => self.springs[first as usize].0,
            false => [first, (first + 1) % count],
        })
    }

    /// Whether it is an open rope with a spring for each segment: of one on a winch, only these know what follows what.
    fn is_numbered_by_springs(&self) -> bool {
        let count = self.positions.len();
        self.layout == Layout::Rope { is_closed: false }
            && self.springs.len() + 1 == count
            && self.springs.iter().all(|(ends, _)| ends.iter().all(|end| (*end as usize) < count))
    }

    /// The particles along a side of a sheet, in ascending order; `None` of other nets.
    pub fn edge(&self, side: Side) -> Option<Vec<u32>> {
        let Layout::Grid { cells: [nx, ny] } = self.layout else { return None };
        let of = |i: u32, j: u32| j * (nx + 1) + i;
        Some(match side {
            Side::Left => (0..=ny).map(|j| of(0, j)).collect(),
            Side::Right => (0..=ny).map(|j| of(nx, j)).collect(),
            Side::Bottom => (0..=nx).map(|i| of(i, 0)).collect(),
            Side::Top => (0..=nx).map(|i| of(i, ny)).collect(),
        })
    }

    /// The particle at a corner of a sheet; `None` of other nets.
    pub fn corner(&self, corner: Corner) -> Option<u32> {
        let Layout::Grid { cells: [nx, ny] } = self.layout else { return None };
        let [i, j] = match corner {
            Corner::BottomLeft => [0, 0],
            Corner::BottomRight => [nx, 0],
            Corner::TopLeft => [0, ny],
            Corner::TopRight => [nx, ny],
        };
        Some(j * (nx + 1) + i)
    }

    /// The particles of a painted group; `None` if there is no such group.
    pub fn painted(&self, name: &str) -> Option<&[u32]> {
        let group = self.painted.iter().find(|(other, _)| other == name)?;
        Some(&group.1)
    }

    /// The [weight](Self::weights) of a particle in a painted group; 1 without one.
    pub fn weight(&self, name: &str, particle: u32) -> f32 {
        let weights = self.weights.iter().find(|(other, _)| other == name);
        let place = self.painted(name).and_then(|group| group.binary_search(&particle).ok());
        let weight = weights.zip(place).and_then(|((_, weights), place)| weights.get(place));
        weight.copied().unwrap_or(1.0)
    }

    /// The particle at rest nearest to a point in the frame of the recipe; `None` of a net without particles. Of those
    /// equally near it is the first.
    pub fn nearest(&self, point: Vec3) -> Option<u32> {
        let distance = |place: &Vec3| place.as_dvec3().distance_squared(point.as_dvec3());
        let all = self.positions.iter().enumerate();
        let nearest = all.min_by(|(_, one), (_, other)| distance(one).total_cmp(&distance(other)))?;
        Some(nearest.0 as u32)
    }

    /// Adds a group of the particles that `is_in` chooses by number and place at rest.
    pub fn paint(&mut self, name: impl Into<String>, is_in: impl Fn(u32, Vec3) -> bool) {
        let all = self.positions.iter().enumerate().map(|(number, place)| (number as u32, *place));
        let group = all.filter(|(number, place)| is_in(*number, *place)).map(|(number, _)| number).collect();
        self.painted.push((name.into(), group));
    }

    /// Adds a group of the particles with a [weight](Self::weights) above 0, by number and place at rest; above 1 it counts
    /// as 1.
    pub fn paint_weights(&mut self, name: impl Into<String>, weight: impl Fn(u32, Vec3) -> f32) {
        let all = self.positions.iter().enumerate().map(|(number, place)| (number as u32, *place));
        let weighted = all.map(|(number, place)| (number, weight(number, place)));
        let weighted = weighted.filter(|(_, weight)| *weight > 0.0);
        let (group, weights) = weighted.map(|(number, weight)| (number, weight.min(1.0))).unzip();
        let name = name.into();
        self.painted.push((name.clone(), group));
        self.weights.push((name, weights));
    }

    /// Adds a group of the particles nearest to points in the frame of the recipe.
    pub fn paint_nearest(&mut self, name: impl Into<String>, points: &[Vec3]) {
        let mut group: Vec<u32> = points.iter().filter_map(|point| self.nearest(*point)).collect();
        group.sort_unstable();
        group.dedup();
        self.painted.push((name.into(), group));
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Cloth, Part, Rope};
    use super::*;

    #[test]
    fn places_of_a_sheet() {
        let cloth = Cloth::grid(Vec3::ZERO, Vec3::X * 3.0, Vec3::Y * 2.0, UVec2::new(3, 2));
        let mut net = cloth.topology().expect("sound");
        assert_eq!(net.edge(Side::Left), Some(vec![0, 4, 8]));
        assert_eq!(net.edge(Side::Right), Some(vec![3, 7, 11]));
        assert_eq!(net.edge(Side::Bottom), Some(vec![0, 1, 2, 3]));
        assert_eq!(net.edge(Side::Top), Some(vec![8, 9, 10, 11]));
        let corners = [Corner::BottomLeft, Corner::BottomRight, Corner::TopLeft, Corner::TopRight];
        assert_eq!(corners.map(|corner| net.corner(corner)), [Some(0), Some(3), Some(8), Some(11)]);
        assert_eq!(net.nearest(Vec3::new(1.2, 0.9, 5.0)), Some(5));
        let nearest =
            Part::Nearest(vec![Vec3::new(9.0, 9.0, 0.0), Vec3::new(1.2, 0.9, 5.0), Vec3::splat(8.0)]);
        assert_eq!(nearest.particles(&net), Some(vec![5, 11]));
        assert_eq!(Part::Nearest(Vec::new()).particles(&net), None);
        assert_eq!((net.start(), net.end()), (None, None));
        net.paint("HIGH", |_, place| place.y > 1.5);
        assert_eq!(net.painted("HIGH"), Some(&[8, 9, 10, 11][..]));
        net.paint_nearest("ENDS", &[Vec3::X * 9.0, Vec3::ZERO, Vec3::X * 8.0]);
        assert_eq!(net.painted("ENDS"), Some(&[0, 3][..]));
        assert_eq!(net.painted("none"), None);
        net.paint_weights("FADING", |_, place| 0.25 * place.x - 0.5 * place.y);
        assert_eq!(net.painted("FADING"), Some(&[1, 2, 3, 7][..]));
        let weight = |particle: u32| net.weight("FADING", particle);
        assert_eq!([1, 2, 3, 7, 0].map(weight), [0.25, 0.5, 0.75, 0.25, 1.0]);
        assert_eq!(net.weight("HIGH", 8), 1.0);
    }

    #[test]
    fn ends_of_a_rope() {
        let net = Rope::new(1.0).with_segments(7).topology().expect("sound");
        assert_eq!((net.start(), net.end()), (Some(0), Some(7)));
        assert_eq!(net.edge(Side::Top), None);
        let ring = Rope { path: vec![Vec3::ZERO, Vec3::X, Vec3::Y], ..Rope::default() }.with_closed();
        assert_eq!(ring.topology().expect("sound").start(), None);
    }
}
