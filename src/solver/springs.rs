//! Springs as a structure of arrays.

use std::sync::atomic::{AtomicU64, Ordering};

use super::batches::Batches;

/// The springs, one slot each.
#[derive(Debug, Clone, Default)]
pub struct Springs {
    first: Vec<u32>,
    second: Vec<u32>,
    rest_length: Vec<f32>,
    stiffness: Vec<f32>,
    damping: Vec<f32>,
    ends_version: EndsVersion,
    /// The same springs in the order in which the kernel takes them.
    batches: Batches,
}

/// Springs of the same version have the same ends.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct EndsVersion(u64);

impl EndsVersion {
    /// One that no springs ever had.
    fn new() -> Self {
        static NEXT: AtomicU64 = AtomicU64::new(1);
        Self(NEXT.fetch_add(1, Ordering::Relaxed))
    }
}

impl Springs {
    /// The number of springs.
    pub fn len(&self) -> usize {
        self.first.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.first.is_empty()
    }

    /// Removes all springs.
    pub fn clear(&mut self) {
        self.first.clear();
        self.second.clear();
        self.rest_length.clear();
        self.stiffness.clear();
        self.damping.clear();
        self.ends_version = EndsVersion::new();
        self.batches.invalidate();
    }

    /// Appends a spring between the slots `first` and `second`, which differ: rest length in m,
    /// stiffness in N/m, damping in N·s/m.
    pub fn push(&mut self, first: usize, second: usize, rest_length: f32, stiffness: f32, damping: f32) {
        self.first.push(first as u32);
        self.second.push(second as u32);
        self.rest_length.push(rest_length);
        self.stiffness.push(stiffness);
        self.damping.push(damping);
        self.ends_version = EndsVersion::new();
        let (lower, upper) = (first.min(second), first.max(second));
        self.batches.append([lower as u32, upper as u32], [rest_length, stiffness, damping]);
    }

    /// Empties the slot of a spring: what is left exerts no force.
    pub fn remove(&mut self, index: usize) {
        self.set_parameters(index, 0.0, 0.0, 0.0);
    }

    /// The springs that end in a particle, in no particular order.
    pub fn ending_at(&self, slot: usize) -> Vec<usize> {
        if let Some(springs) = self.batches.ending_at(slot as u32) {
            return springs;
        }
        (0..self.len())
            .filter(|spring| [self.first[*spring], self.second[*spring]].contains(&(slot as u32)))
            .collect()
    }

    /// Changes the parameters of spring `index`: rest length in m, stiffness in N/m, damping in N·s/m.
    pub fn set_parameters(&mut self, index: usize, rest_length: f32, stiffness: f32, damping: f32) {
        self.rest_length[index] = rest_length;
        self.stiffness[index] = stiffness;
        self.damping[index] = damping;
        self.batches.set_parameters(index, [rest_length, stiffness, damping]);
    }

    /// Renames the particles: `new_slots[old]` is the new slot of each.
    pub fn renumber(&mut self, new_slots: &[u32]) {
        for end in self.first.iter_mut().chain(&mut self.second) {
            *end = new_slots[*end as usize];
        }
        self.ends_version = EndsVersion::new();
        self.batches.invalidate();
    }

    /// The two ends of spring `index`.
    #[inline]
    pub fn ends(&self, index: usize) -> (usize, usize) {
        (self.first[index] as usize, self.second[index] as usize)
    }

    /// Slot of the first particle of each spring.
    pub fn first(&self) -> &[u32] {
        &self.first
    }

    /// Slot of the second particle of each spring.
    pub fn second(&self) -> &[u32] {
        &self.second
    }

    /// Rest lengths, m.
    pub fn rest_length(&self) -> &[f32] {
        &self.rest_length
    }

    /// Stiffnesses, N/m.
    pub fn stiffness(&self) -> &[f32] {
        &self.stiffness
    }

    /// Damping coefficients, N·s/m.
    pub fn damping(&self) -> &[f32] {
        &self.damping
    }

    /// All springs as (first slot, second slot, stiffness in N/m, damping in N·s/m), as
    /// [`FrequencyBounds::of`](super::stability::FrequencyBounds::of) wants them.
    pub fn listed(&self) -> impl Iterator<Item = (usize, usize, f32, f32)> + Clone {
        (0..self.len()).map(|spring| {
            let (first, second) = self.ends(spring);
            (first, second, self.stiffness[spring], self.damping[spring])
        })
    }

    /// Changes whenever a spring gets other ends, or one comes.
    pub(super) fn ends_version(&self) -> EndsVersion {
        self.ends_version
    }

    /// Sorts the springs between `particles` particles into batches, if they are not yet.
    pub(super) fn prepare(&mut self, particles: usize) {
        let mut batches = std::mem::take(&mut self.batches);
        if !batches.grow(particles) {
            batches.build(self, particles);
        }
        self.batches = batches;
    }

    /// The springs in batches, as [`prepare`](Self::prepare) left them.
    pub(super) fn batches(&self) -> &Batches {
        &self.batches
    }
}
