//! The start of a tick: sleeping particles are woken by what has happened to them.

use crate::solver::settings::StepSettings;
use crate::solver::state::Version;

use super::memory::SleepMemory;
use super::{SleepCaches, Sleepers, Surroundings, touching_gap};

/// Slots that are compared at a time.
const CHUNK: usize = 256;

impl SleepCaches {
    /// Wakes what sleep no longer is for, and has what was edited rest anew.
    pub fn begin_tick(&mut self, mut sleepers: Sleepers, around: Surroundings, settings: &StepSettings) {
        let Sleepers { memory, particles, elements, .. } = &mut sleepers;
        if settings.sleep.is_none() {
            if memory.settings.is_some() {
                self.wake_all(&mut sleepers);
                sleepers.memory.reset();
            }
            return;
        }
        self.parts.refresh(elements, particles);
        memory.resize(particles.len());
        let present = StepSettings { time_step: 0.0, sleep: None, ..*settings };
        if memory.settings.replace(present) != Some(present) {
            memory.rested.fill(0.0);
            self.wake_all(&mut sleepers);
        }
        let Sleepers { memory, .. } = &mut sleepers;
        memory.disturb_changed_properties(around.properties);
        if !memory.disturbed.is_empty() {
            self.find_disturbed(memory);
        }
        if memory.asleep > 0 {
            self.is_waking.clear();
            self.is_waking.resize(memory.group.len() + 1, false);
            self.find_changed(&sleepers);
            self.find_on_colliders(&sleepers, around, settings);
            self.find_held(&sleepers, around);
            if settings.pair_rules.is_some() {
                self.find_near(&sleepers, around, settings);
            }
            self.wake(&mut sleepers);
        }
        self.waking.clear();
        let Sleepers { memory, particles, .. } = sleepers;
        memory.disturbed.clear();
        memory.added.clear();
        memory.vanished.clear();
        memory.keep_colliders(around.colliders);
        if !self.is_all(memory) {
            self.start.copy_from(&particles.position);
        }
    }

    fn wake_all(&mut self, sleepers: &mut Sleepers) {
        if sleepers.memory.asleep > 0 {
            self.is_waking.clear();
            self.is_waking.resize(sleepers.memory.group.len() + 1, true);
            self.wake_marked(sleepers);
        }
    }

    /// Finds the parts at which something was edited.
    fn find_disturbed(&mut self, memory: &mut SleepMemory) {
        let Self { parts, waking, .. } = self;
        let mut disturb = |part: usize, memory: &mut SleepMemory| {
            memory.rested[parts.first(part)] = 0.0;
            // An edit may have joined what sleeps and what does not.
            let groups = parts.members(part).iter().map(|slot| memory.group[*slot as usize]);
            waking.extend(groups.filter(|group| *group != 0).map(|group| (group, 0.0)));
        };
        let mut own = Vec::new();
        for place in 0..memory.disturbed.len() {
            let slot = memory.disturbed[place] as usize;
            let Some(group) = memory.group.get(slot) else { continue };
            own.extend((*group != 0).then_some((*group, 0.0)));
            match parts.of(slot) {
                Some(part) => disturb(part, memory),
                None => parts.held_by(slot).for_each(|part| disturb(part, memory)),
            }
        }
        waking.append(&mut own);
        waking.sort_by_key(|(group, _)| *group);
        waking.dedup();
    }

    /// Finds sleepers that were moved, or to which a velocity or another force was given.
    fn find_changed(&mut self, Sleepers { memory, particles, .. }: &Sleepers) {
        // As bits and without a branch, so that it is done in vectors.
        let differ = |one: &[f32], other: &[f32], group: &[u32]| {
            let all = one.iter().zip(other).zip(group);
            all.fold(0, |all, ((one, other), group)| {
                let counts = if *group == 0 { 0 } else { u32::MAX };
                all | ((one.to_bits() ^ other.to_bits()) & counts)
            })
        };
        let zero = [0.0; CHUNK];
        for start in (0..memory.group.len()).step_by(CHUNK) {
            let range = start..memory.group.len().min(start + CHUNK);
            let group = &memory.group[range.clone()];
            let mut any = 0;
            for axis in 0..3 {
                let [position, place] =
                    [&particles.position, &memory.place].map(|of| &of.axes()[axis][range.clone()]);
                let [force, past] =
                    [&particles.applied_force, &memory.force].map(|of| &of.axes()[axis][range.clone()]);
                let velocity = &particles.velocity.axes()[axis][range.clone()];
                any |= differ(position, place, group)
                    | differ(force, past, group)
                    | differ(velocity, &zero, group);
            }
            if any == 0 {
                continue;
            }
            for slot in range.filter(|slot| memory.group[*slot] != 0) {
                let is_same = particles.position.get(slot) == memory.place.get(slot)
                    && particles.applied_force.get(slot) == memory.force.get(slot)
                    && particles.velocity.get(slot) == bevy::math::Vec3::ZERO;
                if !is_same {
                    self.waking.push((memory.group[slot], 0.0));
                }
            }
        }
    }

    /// Finds what hangs from pinned particles that move.
    fn find_held(&mut self, Sleepers { memory, .. }: &Sleepers, around: Surroundings) {
        for motion in around.moving() {
            let slots = self.parts.held_by(motion.slot).map(|part| self.parts.first(part));
            self.waking.extend(slots.map(|slot| (memory.group[slot], 0.0)).filter(|(group, _)| *group != 0));
        }
    }

    /// Finds sleepers that something awake may touch in this tick, or could rest on.
    fn find_near(&mut self, sleepers: &Sleepers, around: Surroundings, settings: &StepSettings) {
        let Sleepers { memory, particles, .. } = sleepers;
        let all_sleep = self.is_all(memory);
        let Self { spheres, waking, .. } = self;
        spheres.refresh(memory, particles);
        let gap = touching_gap(settings);
        let mut search = |sphere, reach: f32| {
            // Its impact may give others up to twice its speed.
            spheres
                .near(particles, sphere, gap + reach, |slot| waking.push((memory.group[slot], 2.0 * reach)));
        };
        let radius = particles.radius();
        let awake = if all_sleep { 0 } else { particles.len() };
        for slot in (0..awake).filter(|slot| particles.inverse_mass()[*slot] != 0.0) {
            if radius[slot] > 0.0 {
                let reach = particles.velocity.get(slot).length() * settings.time_step;
                search((particles.position.get(slot), radius[slot]), reach);
            }
        }
        for motion in around.moving().filter(|motion| radius[motion.slot] > 0.0) {
            search((motion.start, radius[motion.slot]), motion.start.distance(motion.target));
        }
        memory.vanished.iter().for_each(|sphere| search(*sphere, 0.0));
        let edited = memory.disturbed.iter().chain(&memory.added).map(|slot| *slot as usize);
        for slot in edited.filter(|slot| *slot < particles.len()) {
            if radius[slot] > 0.0 {
                search((particles.position.get(slot), radius[slot]), 0.0);
            }
        }
    }

    /// Wakes the groups that were found, and those that an impact on them may reach in this tick.
    fn wake(&mut self, sleepers: &mut Sleepers) {
        let mut done = 0;
        while let Some(&(group, reach)) = self.waking.get(done) {
            done += 1;
            if std::mem::replace(&mut self.is_waking[group as usize], true) || reach == 0.0 {
                continue;
            }
            let Sleepers { memory, particles, .. } = &*sleepers;
            let Self { spheres, waking, is_waking, .. } = self;
            for slot in (0..particles.len()).filter(|slot| memory.group[*slot] == group) {
                let sphere = (particles.position.get(slot), particles.radius()[slot]);
                if sphere.1 > 0.0 {
                    spheres.near(particles, sphere, reach, |slot| {
                        let other = memory.group[slot];
                        if !is_waking[other as usize] {
                            waking.push((other, reach));
                        }
                    });
                }
            }
        }
        if done > 0 {
            self.wake_marked(sleepers);
        }
    }

    /// Wakes the groups that are marked.
    fn wake_marked(&mut self, Sleepers { memory, particles, contacts, pulls, .. }: &mut Sleepers) {
        let Self { is_waking, .. } = self;
        particles.wake((0..memory.group.len()).filter(|slot| {
            let group = memory.group[*slot] as usize;
            group != 0 && is_waking[group]
        }));
        for slot in 0..memory.group.len() {
            let group = memory.group[slot] as usize;
            if group != 0 && is_waking[group] {
                memory.group[slot] = 0;
                memory.rested[slot] = 0.0;
                memory.asleep -= 1;
                pulls.invalidate(slot);
            }
        }
        contacts.wake(|slot| memory.group[slot] != 0);
        memory.version = Version::new();
    }
}
