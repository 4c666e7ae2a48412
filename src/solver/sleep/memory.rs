//! The part of the state that belongs to sleep.

use bevy::math::Vec3;

use crate::solver::collision::{ContactProperties, Presence};
use crate::solver::particles::{Particles, Vectors};
use crate::solver::settings::StepSettings;
use crate::solver::state::Version;

/// Which particles sleep, how long the others have rested, and the conditions at which they fell asleep: a part of the state.
#[derive(Debug, Clone, Default)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
pub(in crate::solver) struct SleepMemory {
    /// By slot, the ID of the sleeping group: its first slot + 1; 0 while awake.
    pub(super) group: Vec<u32>,
    /// Where each particle was when it began to rest, m; of a sleeper where it is.
    pub(super) place: Vectors,
    /// The user's force then, N.
    pub(super) force: Vectors,
    /// For how long each part has rested, s: at the slot by which it is known.
    pub(super) rested: Vec<f32>,
    /// Time since it was last asked which particles may fall asleep, s.
    pub(super) since_check: f32,
    /// Number of sleepers.
    pub(super) asleep: usize,
    /// The settings of the last tick; `None` before the first one.
    pub(super) settings: Option<StepSettings>,
    /// What the last tick left of the colliders.
    pub(super) colliders: Vec<Presence>,
    /// The surfaces of particles in the last tick.
    pub(super) properties: Vec<ContactProperties>,
    /// The slots at which something was edited since then.
    pub(super) disturbed: Vec<u32>,
    /// The slots of particles that were added since then.
    pub(super) added: Vec<u32>,
    /// Spheres that were there until then, as centre (m) and radius (m): what rested on them wakes.
    pub(super) vanished: Vec<(Vec3, f32)>,
    /// The pinned spheres that were there when all particles were removed, to come back in other slots: old slot, centre
    /// (m) and radius (m).
    leaving: Vec<(u32, Vec3, f32)>,
    /// The old slots at which something was edited before that.
    leaving_disturbed: Vec<u32>,
    /// Changes when anything falls asleep or wakes.
    pub(super) version: Version,
}

impl SleepMemory {
    /// Changes when anything falls asleep or wakes.
    pub fn version(&self) -> Version {
        self.version
    }

    /// The number of sleeping particles.
    pub fn asleep(&self) -> usize {
        self.asleep
    }

    /// Whether the particle in a slot sleeps.
    pub fn is_asleep(&self, slot: usize) -> bool {
        self.group.get(slot).is_some_and(|group| *group != 0)
    }

    /// Whether sleep is off, or no tick has run yet.
    fn is_off(&self) -> bool {
        self.settings.is_none()
    }

    /// Takes note that something at a particle was edited: what sleeps there wakes, what rests begins anew.
    pub fn disturb(&mut self, slot: usize) {
        if !self.is_off() {
            self.disturbed.push(slot as u32);
        }
    }

    /// Takes note that a particle was added: what sleeps where it is wakes.
    pub fn add(&mut self, slot: usize) {
        if self.asleep > 0 {
            self.added.push(slot as u32);
        }
    }

    /// Takes note that the particle in a slot is about to vanish from where it is.
    pub fn vanish(&mut self, slot: usize, particles: &Particles) {
        if !self.is_off() {
            self.disturbed.push(slot as u32);
            let radius = particles.radius()[slot];
            if self.asleep > 0 && radius > 0.0 {
                self.vanished.push((particles.position.get(slot), radius));
            }
        }
    }

    /// Resets it, as if the simulation had just started.
    pub fn clear(&mut self, particles: &mut Particles) {
        if self.asleep > 0 {
            particles.wake((0..particles.len().min(self.group.len())).filter(|slot| self.group[*slot] != 0));
        }
        self.reset();
    }

    /// Is as before the first tick; nothing sleeps by now.
    pub(super) fn reset(&mut self) {
        *self = Self { version: Version::new(), ..Self::default() };
    }

    /// To be called before all particles are removed, to come back in other slots.
    pub fn before_clear(&mut self, particles: &Particles) {
        self.leaving_disturbed.append(&mut self.disturbed);
        self.leaving_disturbed.append(&mut self.added);
        if self.asleep > 0 {
            let held = (0..particles.len())
                .filter(|slot| !particles.is_movable(*slot) && particles.radius()[*slot] > 0.0);
            self.leaving.extend(
                held.map(|slot| (slot as u32, particles.position.get(slot), particles.radius()[slot])),
            );
        }
    }

    /// All positions are measured from elsewhere: `shift` m from where they were.
    pub fn shift(&mut self, shift: Vec3) {
        for (axis, shift) in self.place.axes_mut().into_iter().zip(shift.to_array()) {
            axis.iter_mut().for_each(|coordinate| *coordinate -= shift);
        }
        self.colliders.iter_mut().for_each(|collider| collider.shift(shift));
        self.vanished.iter_mut().for_each(|(centre, _)| *centre -= shift);
        self.leaving.iter_mut().for_each(|(_, centre, _)| *centre -= shift);
    }

    /// To be called when the particles have got other slots: `new_slots[old]` is the new slot of each, `None` for those
    /// that were removed.
    pub fn renumber(&mut self, new_slots: &[Option<u32>], particles: &mut Particles) {
        if self.is_off() {
            return;
        }
        let old = std::mem::replace(
            self,
            Self { settings: self.settings, since_check: self.since_check, ..Self::default() },
        );
        let new_slot = |old: usize| new_slots.get(old).copied().flatten().map(|slot| slot as usize);
        self.colliders = old.colliders;
        self.properties.resize(
            if old.properties.is_empty() { 0 } else { particles.len() },
            ContactProperties::default(),
        );
        for (slot, own_properties) in old.properties.into_iter().enumerate() {
            if let Some(place) = new_slot(slot).and_then(|new| self.properties.get_mut(new)) {
                *place = own_properties;
            }
        }
        self.resize(particles.len());
        let mut names = vec![0; old.group.len() + 1];
        for slot in 0..old.group.len() {
            let Some(new) = new_slot(slot) else { continue };
            self.place.set(new, old.place.get(slot));
            self.force.set(new, old.force.get(slot));
            self.rested[new] = old.rested[slot];
            let group = old.group[slot] as usize;
            if group != 0 {
                let name = &mut names[group];
                *name = if *name == 0 { new as u32 + 1 } else { (*name).min(new as u32 + 1) };
            }
        }
        for slot in 0..old.group.len() {
            let (group, new) = (old.group[slot] as usize, new_slot(slot));
            if let Some(new) = new.filter(|_| group != 0) {
                self.group[new] = names[group];
                self.asleep += 1;
            } else if group != 0 && names[group] != 0 {
                self.disturbed.push(names[group] - 1);
            }
        }
        self.disturbed.extend(old.disturbed);
        let edited = old.leaving_disturbed.into_iter().filter_map(|slot| new_slot(slot as usize));
        self.disturbed.extend(edited.map(|slot| slot as u32));
        let mut is_back = vec![false; particles.len()];
        new_slots.iter().flatten().for_each(|slot| is_back[*slot as usize] = true);
        self.added.extend(old.added.into_iter().filter(|slot| is_back.get(*slot as usize) == Some(&false)));
        self.vanished = old.vanished;
        let gone = old.leaving.into_iter().filter(|(slot, ..)| new_slot(*slot as usize).is_none());
        self.vanished.extend(gone.map(|(_, centre, radius)| (centre, radius)));
        let Self { group, .. } = &*self;
        if self.asleep > 0 {
            particles.put_to_sleep((0..particles.len()).filter(|slot| group[*slot] != 0));
        }
        self.version = Version::new();
    }

    /// Makes room for `count` particles; new ones are awake.
    pub(super) fn resize(&mut self, count: usize) {
        self.group.resize(count, 0);
        self.rested.resize(count, 0.0);
        self.place.resize(count);
        self.force.resize(count);
    }
}
