//! What elements pull at particles with at the end of a step of TR-BDF2, which begins the next one.
//!
//! Positions are rounded to f32 between the steps. Forces that were evaluated from them would have the rounding times
//! the stiffness in them, and throw stiff nets about; these are those of the solution itself.

use bevy::math::Vec3;

use crate::solver::particles::Vectors;

/// The accelerations of the particles by elements, as the last step left them; part of the state.
#[derive(Debug, Clone, Default)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Pulls {
    acceleration: Vectors,
    knowledge: Vec<Knowledge>,
}

/// What is known of the pull at a particle.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
pub(crate) enum Knowledge {
    /// Nothing: it has not been advanced by TR-BDF2, or its elements are others since.
    #[default]
    Nothing,
    /// It touches something.
    Touching,
    /// The pull at the end of the last step, which was in the last tick.
    Earlier,
    /// The pull at the end of the last step, which was in this tick.
    Present,
}

impl Pulls {
    /// To be called before the first substep of a tick in which TR-BDF2 advances some of `count` particles.
    pub fn begin_tick(&mut self, count: usize) {
        self.acceleration.resize(count);
        self.knowledge.resize(count, Knowledge::Nothing);
        for knowledge in &mut self.knowledge {
            *knowledge = if *knowledge == Knowledge::Present { Knowledge::Earlier } else { *knowledge };
        }
    }

    /// To be called at the end of such a tick: nothing is known of what other schemes advance by now.
    pub fn end_tick(&mut self) {
        for knowledge in &mut self.knowledge {
            *knowledge = if *knowledge == Knowledge::Earlier { Knowledge::Nothing } else { *knowledge };
        }
    }

    /// Whether TR-BDF2 advances no particle.
    pub fn is_empty(&self) -> bool {
        self.knowledge.is_empty()
    }

    /// Nothing is known of any particle.
    pub fn clear(&mut self) {
        self.acceleration.resize(0);
        self.knowledge.clear();
    }

    /// Nothing is known of the particle in `slot` any more.
    pub fn forget(&mut self, slot: usize) {
        self.know(slot, Knowledge::Nothing);
    }

    /// What pulls at the particle in `slot` has turned.
    pub fn turn(&mut self, slot: usize, turn: impl FnOnce(Vec3) -> Vec3) {
        if slot < self.acceleration.len() {
            self.acceleration.set(slot, turn(self.acceleration.get(slot)));
        }
    }

    /// The particle in `slot` touches something.
    pub fn touch(&mut self, slot: usize) {
        self.know(slot, Knowledge::Touching);
    }

    fn know(&mut self, slot: usize, knowledge: Knowledge) {
        if let Some(old) = self.knowledge.get_mut(slot) {
            *old = knowledge;
        }
    }

    pub fn knowledge(&self, slot: usize) -> Knowledge {
        self.knowledge[slot]
    }

    /// The acceleration by elements, m/s²; means something where it is known.
    pub fn get(&self, slot: usize) -> Vec3 {
        self.acceleration.get(slot)
    }

    pub fn set(&mut self, slot: usize, acceleration: Vec3) {
        self.acceleration.set(slot, acceleration);
        self.knowledge[slot] = Knowledge::Present;
    }

    /// Moves what is known of the particle in slot `old` to `new_slots[old]`, of `count` slots.
    pub fn renumber(&mut self, new_slots: &[Option<u32>], count: usize) {
        let old = std::mem::take(self);
        if old.knowledge.is_empty() {
            return;
        }
        self.acceleration.resize(count);
        self.knowledge.resize(count, Knowledge::Nothing);
        for (slot, knowledge) in old.knowledge.iter().enumerate() {
            if let Some(new) = new_slots.get(slot).copied().flatten() {
                self.acceleration.set(new as usize, old.acceleration.get(slot));
                self.knowledge[new as usize] = *knowledge;
            }
        }
    }
}
