//! The accelerations by elements at the end of a step of TR-BDF2, with which the next one begins.
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
    validity: Vec<Validity>,
}

/// Of when the acceleration of a particle by elements is.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
pub(crate) enum Validity {
    /// Unknown: TR-BDF2 has not advanced the particle, or its elements have changed since.
    #[default]
    Unknown,
    /// Unknown, as the particle touches something.
    Touching,
    /// Of the end of the last step, which was in the previous tick.
    PreviousTick,
    /// Of the end of the last step, which was in this tick.
    CurrentTick,
}

impl Pulls {
    /// To be called before the first substep of a tick in which TR-BDF2 advances some of `count` particles.
    pub fn begin_tick(&mut self, count: usize) {
        self.acceleration.resize(count);
        self.validity.resize(count, Validity::Unknown);
        for validity in &mut self.validity {
            *validity = if *validity == Validity::CurrentTick { Validity::PreviousTick } else { *validity };
        }
    }

    /// To be called at the end of such a tick: what is left of the previous one belongs to particles that other schemes advance now.
    pub fn end_tick(&mut self) {
        for validity in &mut self.validity {
            *validity = if *validity == Validity::PreviousTick { Validity::Unknown } else { *validity };
        }
    }

    /// Whether TR-BDF2 advances no particle.
    pub fn is_empty(&self) -> bool {
        self.validity.is_empty()
    }

    /// Invalidates those of all particles.
    pub fn clear(&mut self) {
        self.acceleration.resize(0);
        self.validity.clear();
    }

    /// Invalidates that of the particle in `slot`.
    pub fn invalidate(&mut self, slot: usize) {
        self.set_validity(slot, Validity::Unknown);
    }

    /// Turns that of the particle in `slot`, as the net around it was turned.
    pub fn rotate(&mut self, slot: usize, rotate: impl FnOnce(Vec3) -> Vec3) {
        if slot < self.acceleration.len() {
            self.acceleration.set(slot, rotate(self.acceleration.get(slot)));
        }
    }

    /// The particle in `slot` touches something.
    pub fn set_touching(&mut self, slot: usize) {
        self.set_validity(slot, Validity::Touching);
    }

    fn set_validity(&mut self, slot: usize, validity: Validity) {
        if let Some(old) = self.validity.get_mut(slot) {
            *old = validity;
        }
    }

    pub fn validity(&self, slot: usize) -> Validity {
        self.validity[slot]
    }

    /// The acceleration by elements, m/s²; meaningless where it is unknown.
    pub fn get(&self, slot: usize) -> Vec3 {
        self.acceleration.get(slot)
    }

    pub fn set(&mut self, slot: usize, acceleration: Vec3) {
        self.acceleration.set(slot, acceleration);
        self.validity[slot] = Validity::CurrentTick;
    }

    /// Moves that of the particle in slot `old` to `new_slots[old]`, of `count` slots.
    pub fn renumber(&mut self, new_slots: &[Option<u32>], count: usize) {
        let old = std::mem::take(self);
        if old.validity.is_empty() {
            return;
        }
        self.acceleration.resize(count);
        self.validity.resize(count, Validity::Unknown);
        for (slot, validity) in old.validity.iter().enumerate() {
            if let Some(new) = new_slots.get(slot).copied().flatten() {
                self.acceleration.set(new as usize, old.acceleration.get(slot));
                self.validity[new as usize] = *validity;
            }
        }
    }
}
