//! A number that tells shapes apart by what they are, in any process.

use super::{Kind, Shape};

/// A hash of numbers in their order: each step is that of FxHash, and can be undone, so that a single difference shows.
#[derive(Debug, Clone, Copy, Default)]
pub(in crate::solver) struct Fingerprint(u64);

impl Fingerprint {
    pub fn add(&mut self, bits: u64) {
        self.0 = (self.0.rotate_left(5) ^ bits).wrapping_mul(0x517C_C1B7_2722_0A95);
    }

    pub fn add_floats<const N: usize>(&mut self, numbers: [f64; N]) {
        numbers.into_iter().for_each(|number| self.add(number.to_bits()));
    }

    pub fn finish(self) -> u64 {
        self.0
    }
}

impl Shape {
    /// Adds what it is.
    pub(in crate::solver) fn add_to(&self, fingerprint: &mut Fingerprint) {
        match &self.0 {
            Kind::HalfSpace => fingerprint.add(1),
            Kind::Ball { radius } => fingerprint.add_floats([2.0, *radius]),
            Kind::Capsule { radius, half_length } => fingerprint.add_floats([3.0, *radius, *half_length]),
            Kind::Cuboid { half_size } => {
                fingerprint.add(4);
                fingerprint.add_floats(half_size.to_array());
            }
            Kind::Frustum { radii: [bottom, top], half_height } => {
                fingerprint.add_floats([5.0, *bottom, *top, *half_height]);
            }
            Kind::Mesh(mesh) => fingerprint.add(mesh.fingerprint),
            Kind::Compound(parts) => {
                for part in parts.iter() {
                    fingerprint.add_floats(part.placement.rotation.to_cols_array());
                    fingerprint.add_floats(part.placement.point.to_array());
                    part.shape.add_to(fingerprint);
                }
                fingerprint.add(7);
            }
            Kind::Flat(shape) => {
                fingerprint.add(8);
                shape.add_to(fingerprint);
            }
        }
    }
}
