//! Springs as a structure of arrays.

/// The springs, one slot each.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Springs {
    /// Slot of the first particle of each spring.
    pub first: Vec<u32>,
    /// Slot of the second particle, different from the first.
    pub second: Vec<u32>,
    /// Rest lengths, m.
    pub rest_length: Vec<f32>,
    /// Stiffnesses, N/m.
    pub stiffness: Vec<f32>,
    /// Damping coefficients, N·s/m.
    pub damping: Vec<f32>,
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
    }

    /// Appends a spring between the slots `first` and `second`: rest length in m, stiffness in N/m,
    /// damping in N·s/m.
    pub fn push(&mut self, first: usize, second: usize, rest_length: f32, stiffness: f32, damping: f32) {
        self.first.push(first as u32);
        self.second.push(second as u32);
        self.rest_length.push(rest_length);
        self.stiffness.push(stiffness);
        self.damping.push(damping);
    }

    /// The two ends of spring `index`.
    #[inline]
    pub fn ends(&self, index: usize) -> (usize, usize) {
        (self.first[index] as usize, self.second[index] as usize)
    }
}
