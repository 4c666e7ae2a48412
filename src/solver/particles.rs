//! Particles as a structure of arrays.

use bevy::math::Vec3;

/// What is smaller is a trace, m or m/s: its square is hardly a normal number any more.
const TRACE: f32 = 1e-18;

/// One vector a particle, stored as three arrays.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Vectors {
    /// The x components.
    pub x: Vec<f32>,
    /// The y components.
    pub y: Vec<f32>,
    /// The z components.
    pub z: Vec<f32>,
}

impl Vectors {
    /// The number of vectors.
    pub fn len(&self) -> usize {
        self.x.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.x.is_empty()
    }

    /// The vector in slot `index`.
    #[inline]
    pub fn get(&self, index: usize) -> Vec3 {
        Vec3::new(self.x[index], self.y[index], self.z[index])
    }

    /// Replaces the vector in slot `index`.
    #[inline]
    pub fn set(&mut self, index: usize, value: Vec3) {
        self.x[index] = value.x;
        self.y[index] = value.y;
        self.z[index] = value.z;
    }

    /// Adds `value` to the vector in slot `index`.
    #[inline]
    pub fn add(&mut self, index: usize, value: Vec3) {
        self.x[index] += value.x;
        self.y[index] += value.y;
        self.z[index] += value.z;
    }

    /// Appends a vector.
    pub fn push(&mut self, value: Vec3) {
        self.x.push(value.x);
        self.y.push(value.y);
        self.z.push(value.z);
    }

    /// Makes it `count` vectors; new ones are zero.
    pub fn resize(&mut self, count: usize) {
        for axis in self.axes_vec() {
            axis.resize(count, 0.0);
        }
    }

    /// Makes all vectors `value`.
    pub fn fill(&mut self, value: Vec3) {
        for (axis, value) in self.axes_mut().into_iter().zip(value.to_array()) {
            axis.fill(value);
        }
    }

    /// Makes components zero that are traces only: what decays would end as subnormal numbers, for which
    /// processors take ten times as long.
    pub(super) fn clear_traces(&mut self) {
        for axis in self.axes_mut() {
            for value in axis {
                *value = if value.abs() < TRACE { 0.0 } else { *value };
            }
        }
    }

    /// Becomes a copy of `other`, without allocating if it is large enough already.
    pub fn copy_from(&mut self, other: &Self) {
        self.x.clone_from(&other.x);
        self.y.clone_from(&other.y);
        self.z.clone_from(&other.z);
    }

    /// The three arrays, to be treated alike.
    #[inline]
    pub fn axes(&self) -> [&[f32]; 3] {
        [&self.x, &self.y, &self.z]
    }

    /// The three arrays, to be treated alike.
    #[inline]
    pub fn axes_mut(&mut self) -> [&mut [f32]; 3] {
        [&mut self.x, &mut self.y, &mut self.z]
    }

    /// The three arrays in pieces of `size` vectors, the last one shorter.
    pub(super) fn chunks(&self, size: usize) -> impl Iterator<Item = [&[f32]; 3]> {
        let [x, y, z] = self.axes().map(|axis| axis.chunks(size));
        x.zip(y).zip(z).map(|((x, y), z)| [x, y, z])
    }

    /// The three arrays in pieces of `size` vectors, the last one shorter.
    pub(super) fn chunks_mut(&mut self, size: usize) -> impl Iterator<Item = [&mut [f32]; 3]> {
        let [x, y, z] = self.axes_mut().map(|axis| axis.chunks_mut(size));
        x.zip(y).zip(z).map(|((x, y), z)| [x, y, z])
    }

    fn axes_vec(&mut self) -> [&mut Vec<f32>; 3] {
        [&mut self.x, &mut self.y, &mut self.z]
    }
}

/// Cuts off the first `count` vectors of a piece of [`Vectors`].
pub(crate) fn cut_off<'a>(piece: &mut [&'a mut [f32]; 3], count: usize) -> [&'a mut [f32]; 3] {
    piece.each_mut().map(|axis| axis.split_off_mut(..count).expect("there are so many vectors"))
}

/// Replaces the vector in place `place` of a piece of [`Vectors`].
#[inline]
pub(crate) fn set(piece: &mut [&mut [f32]; 3], place: usize, value: Vec3) {
    for (axis, value) in piece.iter_mut().zip(value.to_array()) {
        axis[place] = value;
    }
}

/// The particles, one slot each.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Particles {
    /// Positions, m.
    pub position: Vectors,
    /// Velocities, m/s.
    pub velocity: Vectors,
    /// The user's forces, N, constant over a tick.
    pub applied_force: Vectors,
    /// Accelerations of the last evaluation of the forces, m/s².
    pub acceleration: Vectors,
    /// 1 / mass, 1/kg; 0 for a pinned particle.
    pub inverse_mass: Vec<f32>,
    /// Radii, m.
    pub radius: Vec<f32>,
}

impl Particles {
    /// The number of particles.
    pub fn len(&self) -> usize {
        self.radius.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.radius.is_empty()
    }

    /// Appends a particle: position in m, velocity in m/s, mass in kg (`f32::INFINITY`: pinned), radius in m.
    pub fn push(&mut self, position: Vec3, velocity: Vec3, mass: f32, radius: f32) {
        self.position.push(position);
        self.velocity.push(velocity);
        self.applied_force.push(Vec3::ZERO);
        self.acceleration.push(Vec3::ZERO);
        self.inverse_mass.push(1.0 / mass);
        self.radius.push(radius);
    }

    /// Empties a slot: what is left is a pinned point that touches nothing.
    pub fn vacate(&mut self, slot: usize) {
        self.velocity.set(slot, Vec3::ZERO);
        self.applied_force.set(slot, Vec3::ZERO);
        self.acceleration.set(slot, Vec3::ZERO);
        self.inverse_mass[slot] = 0.0;
        self.radius[slot] = 0.0;
    }

    /// Makes it `count` particles; new ones are pinned at the origin until they are filled in.
    pub fn resize(&mut self, count: usize) {
        self.position.resize(count);
        self.velocity.resize(count);
        self.applied_force.resize(count);
        self.acceleration.resize(count);
        self.inverse_mass.resize(count, 0.0);
        self.radius.resize(count, 0.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn traces_are_cleared_and_nothing_else() {
        let mut vectors = Vectors::default();
        let kept = [Vec3::new(1e-17, -1e-17, 0.0), Vec3::new(f32::INFINITY, -3.0, f32::MAX)];
        let traces = Vec3::new(1e-19, -1e-40, f32::MIN_POSITIVE);
        for vector in [kept[0], traces, kept[1]] {
            vectors.push(vector);
        }
        vectors.clear_traces();
        assert_eq!([0, 1, 2].map(|slot| vectors.get(slot)), [kept[0], Vec3::ZERO, kept[1]]);
        vectors.set(0, Vec3::NAN);
        vectors.clear_traces();
        assert!(vectors.get(0).is_nan(), "faults stay to be found");
    }
}
