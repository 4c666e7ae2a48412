//! Exactly what the next ticks depend on, and nothing else: what a snapshot holds.
//!
//! All that is derived from it (the graph, plans, candidate pairs, working memory) are caches, pure functions of
//! the state: with all of them dropped before each tick the results have the same bits. A cache remembers the
//! [`Version`] of what it was derived from, and compares.

mod bends;
mod bulk;

use std::sync::atomic::{AtomicU64, Ordering};

use bevy::math::Vec3;

use crate::solver::collision::ContactMemory;
use crate::solver::elements::{CollisionMesh, Elements, Exposed, Release, Spring};
use crate::solver::gusts::AirClock;
use crate::solver::particles::Particles;
use crate::solver::pulls::Pulls;
use crate::solver::sleep::SleepMemory;

pub(crate) use bulk::{NetElements, NetRanges};

/// Marks contents: what has the same version is the same.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct Version(u64);

impl Version {
    /// One that nothing else ever had in this process.
    pub fn new() -> Self {
        static NEXT: AtomicU64 = AtomicU64::new(1);
        Self(NEXT.fetch_add(1, Ordering::Relaxed))
    }
}

/// A version means nothing to another process: it is written as nothing, and read as a new one.
#[cfg(feature = "serialize")]
mod serialization {
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    use super::Version;

    impl Serialize for Version {
        fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
            serializer.serialize_unit()
        }
    }

    impl<'de> Deserialize<'de> for Version {
        fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
            <()>::deserialize(deserializer).map(|()| Self::new())
        }
    }
}

/// The state of a simulation between two ticks: particles, elements, what contacts remember, and the pulls at the
/// end of the last step of TR-BDF2.
#[derive(Debug, Clone, Default)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
pub struct State {
    /// The point of the world from which positions are measured, m: zero unless the particles are far from there.
    pub(crate) origin: Vec3,
    pub(crate) particles: Particles,
    pub(super) elements: Elements,
    pub(super) contacts: ContactMemory,
    pub(super) pulls: Pulls,
    /// The releases of broken springs that still go on.
    pub(super) releases: Vec<Release>,
    /// What the air blows at.
    pub(super) exposed: Exposed,
    pub(super) air_clock: AirClock,
    /// The edges and triangles of nets that collide.
    pub(super) mesh: CollisionMesh,
    /// Whether particles or springs were placed since the last tick so that the ends of a spring may coincide.
    pub(super) may_coincide: bool,
    pub(super) sleep: SleepMemory,
}

impl State {
    /// Removes all particles and elements; what is remembered of contacts waits for
    /// [`renumber_contacts`](Self::renumber_contacts).
    pub(crate) fn clear(&mut self) {
        self.sleep.before_clear(&self.particles);
        self.particles.clear();
        self.elements.clear();
        self.exposed.clear();
        self.mesh.clear();
    }

    /// Keeps what is remembered of contacts for particles that are back in other slots: `new_slots[old]`.
    pub(crate) fn renumber_contacts(&mut self, new_slots: &[Option<u32>]) {
        self.contacts.renumber(new_slots, self.particles.len());
        self.sleep.renumber(new_slots, &mut self.particles);
    }

    /// Takes the pulls out, before [`clear`](Self::clear) and what follows it would mix them up.
    pub(crate) fn take_pulls(&mut self) -> Pulls {
        std::mem::take(&mut self.pulls)
    }

    /// Puts the pulls back, for particles that are in other slots: `new_slots[old]`.
    pub(crate) fn put_back_pulls(&mut self, mut pulls: Pulls, new_slots: &[Option<u32>]) {
        pulls.renumber(new_slots, self.particles.len());
        self.pulls = pulls;
        self.releases.retain_mut(|release| release.renumber(new_slots));
    }

    /// Resets what is remembered of contacts, pulls and sleep, as if the simulation had just started.
    pub(crate) fn clear_contacts(&mut self) {
        self.sleep.clear(&mut self.particles);
        self.contacts.clear();
        self.pulls.clear();
        self.releases.clear();
    }

    /// Measures positions from `origin` from now on.
    pub(crate) fn move_origin(&mut self, origin: Vec3) {
        let shift = origin - std::mem::replace(&mut self.origin, origin);
        for (axis, shift) in self.particles.position.axes_mut().into_iter().zip(shift.to_array()) {
            axis.iter_mut().for_each(|coordinate| *coordinate -= shift);
        }
        self.sleep.shift(shift);
        self.contacts.request_search();
    }

    /// The number of particles that sleep.
    pub(crate) fn asleep_count(&self) -> usize {
        self.sleep.asleep()
    }

    /// Changes when anything falls asleep or wakes.
    pub(crate) fn sleep_version(&self) -> Version {
        self.sleep.version()
    }

    /// Whether no particle of some slots is both awake and moved by forces.
    pub(crate) fn rests(&self, mut slots: impl Iterator<Item = usize>) -> bool {
        slots.all(|slot| slot < self.particles.len() && self.particles.is_pinned(slot))
    }

    /// Whether the particle in a slot sleeps.
    pub(crate) fn is_asleep(&self, slot: usize) -> bool {
        self.sleep.is_asleep(slot)
    }

    /// Appends a particle: position in m, velocity in m/s, 1 / mass in 1/kg (0: pinned), radius in m.
    pub(crate) fn add_particle(&mut self, position: Vec3, velocity: Vec3, inverse_mass: f32, radius: f32) {
        self.sleep.add(self.particles.len());
        self.particles.push(position, velocity, inverse_mass, radius);
        self.contacts.request_search();
    }

    /// Empties the slot of a particle. Its springs are to be removed, too; faces and filaments there leave with it, and a
    /// gas escapes if the particle was a part of its surface.
    pub(crate) fn remove_particle(&mut self, slot: usize) {
        self.sleep.vanish(slot, &self.particles);
        self.particles.vacate(slot);
        self.exposed.remove_particle(slot);
        self.mesh.remove_particle(slot);
        self.remove_gases_at(slot);
        self.pulls.invalidate(slot);
        self.contacts.clear_particle(slot);
        self.contacts.request_search();
    }

    /// Changes the inverse mass (1/kg; 0: pinned) and the radius (m) of a particle, where they are others.
    pub(crate) fn set_particle(&mut self, slot: usize, inverse_mass: f32, radius: f32) {
        if self.particles.own_inverse_mass()[slot] != inverse_mass {
            self.may_coincide |= !self.particles.is_movable(slot);
            self.particles.set_inverse_mass(slot, inverse_mass);
            self.sleep.disturb(slot);
            self.pulls.invalidate(slot);
            self.contacts.request_search();
        }
        if self.particles.radius()[slot] != radius {
            self.sleep.vanish(slot, &self.particles);
            self.particles.set_radius(slot, radius);
            self.contacts.request_search();
        }
    }

    /// Puts a particle somewhere else, without a motion from where it was.
    pub(crate) fn teleport(&mut self, slot: usize, position: Vec3) {
        self.sleep.vanish(slot, &self.particles);
        self.particles.position.set(slot, position);
        self.pulls.invalidate(slot);
        self.contacts.clear_particle(slot);
        self.may_coincide = true;
    }

    /// Puts a particle somewhere else together with all that elements join to it, without a motion from where they
    /// were; `turn` turns vectors as the whole has turned.
    pub(crate) fn carry(&mut self, slot: usize, position: Vec3, turn: impl FnOnce(Vec3) -> Vec3) {
        self.sleep.vanish(slot, &self.particles);
        self.particles.position.set(slot, position);
        self.pulls.rotate(slot, turn);
    }

    /// Takes note that an element at a particle is longer or shorter than the last tick left it.
    pub(crate) fn strain(&mut self, slot: usize) {
        self.sleep.disturb(slot);
        self.pulls.invalidate(slot);
    }

    /// Appends a spring between the slots `ends`, which differ; its index.
    pub(crate) fn add_spring(&mut self, ends: [usize; 2], spring: Spring) -> usize {
        self.contacts.request_search();
        ends.into_iter().for_each(|end| self.strain(end));
        self.may_coincide = true;
        self.elements.push(ends.map(|end| end as u32), spring)
    }

    /// Removes a spring; its place stays empty.
    pub(crate) fn remove_spring(&mut self, index: usize) {
        self.invalidate_pulls(index);
        self.elements.remove::<Spring, 2>(index);
        self.contacts.request_search();
    }

    /// Changes the parameters of a spring, if they are others.
    pub(crate) fn set_spring(&mut self, index: usize, spring: Spring) {
        if let Some(old) = self.spring(index).filter(|old| **old != spring) {
            let acts = |spring: &Spring| spring.stiffness > 0.0 || spring.damping > 0.0;
            let (did_act, acts) = (acts(old), acts(&spring));
            self.may_coincide |= old.length_at_rest() == 0.0 || !did_act;
            if !(did_act && acts) {
                // Else its parameters, and with them the pulls, go on from where they are.
                self.invalidate_pulls(index);
            }
            let (ends, _) = self.spring_with_ends(index);
            ends.into_iter().for_each(|end| self.sleep.disturb(end));
            self.elements.set(index, spring);
            self.contacts.request_search();
        }
    }

    /// The pulls at the ends of a spring are others by now.
    fn invalidate_pulls(&mut self, index: usize) {
        let (ends, _) = self.spring_with_ends(index);
        ends.into_iter().for_each(|end| self.strain(end));
    }

    /// The parameters of the springs that were there when the last tick ended, as they were then.
    pub(crate) fn past_springs(&self) -> Vec<Spring> {
        self.elements.springs().past()
    }

    /// Takes it that a spring that was added anew was there when the last tick ended, with the parameters `past`.
    pub(crate) fn set_past_spring(&mut self, index: usize, past: Spring) {
        self.elements.set_past(index, past);
    }

    /// The parameters of a spring; `None` beyond the last one. Those of an empty place are zero.
    pub(crate) fn spring(&self, index: usize) -> Option<&Spring> {
        self.elements.springs().element(index)
    }

    /// Whether a spring joins the particles in these slots, in this order.
    pub(crate) fn spring_joins(&self, index: usize, ends: [usize; 2]) -> bool {
        self.elements.springs().joins(index, ends.map(|end| end as u32))
    }

    /// The number of springs, removed ones included.
    pub(crate) fn spring_count(&self) -> usize {
        self.elements.springs().len()
    }

    /// The ends and parameters of a spring, for readers outside the solver.
    pub(super) fn spring_with_ends(&self, index: usize) -> ([usize; 2], Spring) {
        self.elements.springs().with_ends(index)
    }

    /// Moves each particle to the slot `new_slots[old]`.
    pub(crate) fn renumber(&mut self, new_slots: &[u32]) {
        self.sleep.before_clear(&self.particles);
        self.particles.renumber(new_slots);
        self.elements.renumber(new_slots);
        self.exposed.renumber(new_slots);
        self.mesh.renumber(new_slots);
        let new_slots: Vec<Option<u32>> = new_slots.iter().map(|slot| Some(*slot)).collect();
        self.renumber_contacts(&new_slots);
        let pulls = self.take_pulls();
        self.put_back_pulls(pulls, &new_slots);
    }
}
