//! What a net is known by, for what is worked out once for each.

use super::super::springs::{EndsVersion, Springs};

/// Where springs are, and which particles are free.
#[derive(Debug, Clone, Default)]
pub(super) struct Net {
    ends: EndsVersion,
    /// Whether the particle in each slot is free.
    pub free: Vec<bool>,
}

impl Net {
    /// Makes it that of `springs` between particles of `inverse_mass`; says whether it was not yet.
    pub fn refresh(&mut self, springs: &Springs, inverse_mass: &[f32]) -> bool {
        let is_free = |inverse: &f32| *inverse > 0.0;
        if self.ends == springs.ends_version()
            && self.free.iter().copied().eq(inverse_mass.iter().map(is_free))
        {
            return false;
        }
        self.ends = springs.ends_version();
        self.free.clear();
        self.free.extend(inverse_mass.iter().map(is_free));
        true
    }
}
