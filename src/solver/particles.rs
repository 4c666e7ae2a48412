//! Particles as a structure of arrays.

mod vectors;

use bevy::math::Vec3;

use crate::solver::state::Version;
pub use vectors::Vectors;
pub(crate) use vectors::{set, split_off};

/// The prescribed motion of a pinned particle in one tick: a straight line at constant velocity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PinnedMotion {
    /// Slot of the particle, which is pinned.
    pub slot: usize,
    /// Position at the start of the tick, m.
    pub start: Vec3,
    /// Position at the end of the tick, m, reached exactly.
    pub target: Vec3,
}

impl PinnedMotion {
    /// Position and velocity after the fraction `elapsed` of a tick of `time_step` seconds, m and m/s.
    #[inline]
    pub(super) fn at(&self, elapsed: f32, time_step: f32) -> [Vec3; 2] {
        let Self { start, target, .. } = *self;
        if self.stands_still() {
            return [if elapsed == 1.0 { target } else { start }, Vec3::ZERO];
        }
        let position = if elapsed == 1.0 { target } else { start.lerp(target, elapsed) };
        [position, (target - start) / time_step]
    }

    /// Whether it ends where it starts, as most do: where the particle is, to the bit, all the time.
    #[inline]
    pub(super) fn stands_still(&self) -> bool {
        self.start == self.target
    }
}

/// Where the pinned particles are after the fraction `elapsed` of a tick of `time_step` seconds.
#[derive(Debug, Clone, Copy)]
pub(super) struct PinnedMotions<'a> {
    pub motions: &'a [PinnedMotion],
    pub elapsed: f32,
    pub time_step: f32,
}

impl PinnedMotions<'_> {
    /// Puts them there.
    pub fn apply(self, particles: &mut Particles) {
        // Slices of one length: a slot is checked for all of them at once.
        let (mut positions, mut velocities) = (particles.position.axes_mut(), particles.velocity.axes_mut());
        let count = positions[0].len();
        for axes in [&mut positions, &mut velocities] {
            let [x, y, z] = std::mem::take(axes);
            *axes = [&mut x[..count], &mut y[..count], &mut z[..count]];
        }
        for motion in self.motions {
            let [position, velocity] = motion.at(self.elapsed, self.time_step);
            set(&mut positions, motion.slot, position);
            set(&mut velocities, motion.slot, velocity);
        }
    }
}

/// The particles, one slot each.
#[derive(Debug, Clone, Default)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Particles {
    /// Positions, m.
    pub position: Vectors,
    /// Velocities, m/s.
    pub velocity: Vectors,
    /// The user's forces, N, constant over a tick.
    pub applied_force: Vectors,
    /// Whether the tick that was begun last has found all of them zero.
    #[cfg_attr(feature = "serialize", serde(skip))]
    is_unpushed: bool,
    /// 0 of those that sleep.
    inverse_mass: Vec<f32>,
    own_inverse_mass: Vec<f32>,
    radius: Vec<f32>,
    /// Those of one family, which is not 0, do not collide with each other.
    family: Vec<u32>,
    families: u32,
    mass_version: Version,
    free_version: Version,
    movable_version: Version,
    added_version: Version,
    #[cfg_attr(feature = "serialize", serde(default))]
    shape_version: Version,
}

impl Particles {
    /// The number of slots.
    pub fn len(&self) -> usize {
        self.radius.len()
    }

    /// 1 / mass with which each answers to forces, 1/kg; 0 for a pinned particle, one that sleeps and an empty slot.
    pub fn inverse_mass(&self) -> &[f32] {
        &self.inverse_mass
    }

    /// 1 / mass of each, asleep or awake, 1/kg; 0 for a pinned particle and an empty slot.
    pub fn own_inverse_mass(&self) -> &[f32] {
        &self.own_inverse_mass
    }

    /// Radii, m.
    pub fn radius(&self) -> &[f32] {
        &self.radius
    }

    /// Positions and velocities to be written, beside inverse masses and radii; those that sleep have their own.
    pub fn motion_mut(&mut self) -> (&mut Vectors, &mut Vectors, &[f32], &[f32]) {
        (&mut self.position, &mut self.velocity, &self.own_inverse_mass, &self.radius)
    }

    /// Positions and velocities to be written, beside the inverse masses with which particles answer to forces.
    pub fn answers_mut(&mut self) -> (&mut Vectors, &mut Vectors, &[f32]) {
        (&mut self.position, &mut self.velocity, &self.inverse_mass)
    }

    /// The same with the applied forces before the inverse masses.
    pub fn answers_to_forces_mut(&mut self) -> (&mut Vectors, &mut Vectors, &Vectors, &[f32]) {
        (&mut self.position, &mut self.velocity, &self.applied_force, &self.inverse_mass)
    }

    /// Finds out whether any force is applied, for the tick that begins.
    pub fn note_applied_forces(&mut self) {
        let is_zero = |axis: &[f32]| {
            // By pieces: where forces are applied, the first one is found soon.
            axis.chunks(1024).all(|piece| piece.iter().fold(true, |all, force| all & (*force == 0.0)))
        };
        self.is_unpushed = self.applied_force.axes().into_iter().all(is_zero);
    }

    /// Whether it is known that all applied forces are zero in this tick.
    pub fn is_unpushed(&self) -> bool {
        self.is_unpushed
    }

    /// Whether no force moves the particle: it is pinned, or asleep.
    #[inline]
    pub fn is_pinned(&self, slot: usize) -> bool {
        self.inverse_mass[slot] == 0.0
    }

    /// Whether forces move the particle while it is awake.
    #[inline]
    pub fn is_movable(&self, slot: usize) -> bool {
        self.own_inverse_mass[slot] != 0.0
    }

    /// Puts particles to sleep: no force moves them until they are woken.
    pub fn put_to_sleep(&mut self, slots: impl Iterator<Item = usize>) {
        for slot in slots {
            self.velocity.set(slot, Vec3::ZERO);
            self.inverse_mass[slot] = 0.0;
        }
        self.mass_version = Version::new();
        self.free_version = self.mass_version;
    }

    /// Wakes particles.
    pub fn wake(&mut self, slots: impl Iterator<Item = usize>) {
        slots.for_each(|slot| self.inverse_mass[slot] = self.own_inverse_mass[slot]);
        self.mass_version = Version::new();
        self.free_version = self.mass_version;
    }

    /// Appends a particle: position in m, velocity in m/s, 1 / mass in 1/kg, radius in m.
    pub fn push(&mut self, position: Vec3, velocity: Vec3, inverse_mass: f32, radius: f32) {
        self.position.push(position);
        self.velocity.push(velocity);
        self.applied_force.push(Vec3::ZERO);
        self.inverse_mass.push(inverse_mass);
        self.own_inverse_mass.push(inverse_mass);
        self.radius.push(radius);
        self.family.push(0);
        self.note_added();
    }

    /// Appends particles: position in m, velocity in m/s, 1 / mass in 1/kg; all of the same radius, m.
    pub fn extend(&mut self, added: impl ExactSizeIterator<Item = (Vec3, Vec3, f32)>, radius: f32) {
        let count = self.len() + added.len();
        for (position, velocity, inverse_mass) in added {
            self.position.push(position);
            self.velocity.push(velocity);
            self.inverse_mass.push(inverse_mass);
            self.own_inverse_mass.push(inverse_mass);
        }
        self.applied_force.resize(count);
        self.radius.resize(count, radius);
        self.family.resize(count, 0);
        self.note_added();
    }

    fn note_added(&mut self) {
        self.added_version = Version::new();
        self.free_version = self.added_version;
        self.movable_version = self.added_version;
    }

    /// Empties a slot: a pinned point is left that touches nothing.
    pub fn vacate(&mut self, slot: usize) {
        self.velocity.set(slot, Vec3::ZERO);
        self.applied_force.set(slot, Vec3::ZERO);
        self.inverse_mass[slot] = 0.0;
        self.own_inverse_mass[slot] = 0.0;
        self.radius[slot] = 0.0;
        self.note_added();
    }

    /// Gives a particle another mass; one that sleeps answers to forces with it once it wakes.
    pub fn set_inverse_mass(&mut self, slot: usize, inverse_mass: f32) {
        let is_asleep = self.is_movable(slot) && self.is_pinned(slot);
        let old = std::mem::replace(&mut self.own_inverse_mass[slot], inverse_mass);
        if !is_asleep {
            self.inverse_mass[slot] = inverse_mass;
        }
        self.mass_version = Version::new();
        if (old > 0.0) != (inverse_mass > 0.0) {
            self.free_version = self.mass_version;
            self.movable_version = self.mass_version;
        }
    }

    pub fn set_radius(&mut self, slot: usize, radius: f32) {
        self.radius[slot] = radius;
        self.shape_version = Version::new();
    }

    /// Whether a particle belongs to a family.
    pub fn has_family(&self, slot: usize) -> bool {
        self.family[slot] != 0
    }

    /// The family of each particle; 0: none. Empty if no particle ever had one.
    pub fn families(&self) -> &[u32] {
        if self.families == 0 { &[] } else { &self.family }
    }

    /// Makes particles a family of their own, or of none.
    pub fn set_family(&mut self, slots: impl Iterator<Item = usize>, is_one: bool) {
        self.families += u32::from(is_one);
        let family = if is_one { self.families } else { 0 };
        slots.for_each(|slot| self.family[slot] = family);
        self.shape_version = Version::new();
    }

    /// Removes all particles.
    pub fn clear(&mut self) {
        *self = Self::default();
        self.mass_version = Version::new();
        self.free_version = self.mass_version;
        self.movable_version = self.mass_version;
        self.added_version = self.mass_version;
        self.shape_version = self.mass_version;
    }

    /// Moves each particle to the slot `new_slots[old]`.
    pub fn renumber(&mut self, new_slots: &[u32]) {
        let old = self.clone();
        for (slot, &new) in new_slots.iter().enumerate() {
            let new = new as usize;
            self.position.set(new, old.position.get(slot));
            self.velocity.set(new, old.velocity.get(slot));
            self.applied_force.set(new, old.applied_force.get(slot));
            self.inverse_mass[new] = old.inverse_mass[slot];
            self.own_inverse_mass[new] = old.own_inverse_mass[slot];
            self.radius[new] = old.radius[slot];
            self.family[new] = old.family[slot];
        }
        self.mass_version = Version::new();
        self.free_version = self.mass_version;
        self.shape_version = self.mass_version;
        self.movable_version = self.mass_version;
    }

    /// Changes with the mass of a particle, or when one is pinned or freed.
    pub(super) fn mass_version(&self) -> Version {
        self.mass_version
    }

    /// Changes when the set of free particles does: of those that forces move.
    pub(super) fn free_version(&self) -> Version {
        self.free_version
    }

    /// Changes with radii and families.
    pub(super) fn shape_version(&self) -> Version {
        self.shape_version
    }

    /// Changes when the set of movable particles does, asleep or awake.
    pub(super) fn movable_version(&self) -> Version {
        self.movable_version
    }

    /// Changes when a particle is added or removed.
    pub(super) fn added_version(&self) -> Version {
        self.added_version
    }
}
