//! The end of a tick: what has rested for long enough falls asleep.

use bevy::math::DVec3;

use crate::solver::collision::{ContactCaches, ContactPartner, ContactRecord};
use crate::solver::field::Field;
use crate::solver::particles::{Particles, Vectors};
use crate::solver::settings::{Sleep, StepSettings};
use crate::solver::state::Version;

use super::memory::SleepMemory;
use super::{
    BESIDE_RATIO, CHECKS_PER_DELAY, CONTACT_DISPLACEMENT_PART, MAX_DISPLACEMENT_RATIO, MAX_SPEED_RATIO,
    SleepCaches, Sleepers, Surroundings, touching_gap,
};

/// Number of particles of which the speeds are compared at a time.
const CHUNK: usize = 64;

impl SleepCaches {
    /// Takes note for how long each part has rested, and puts to sleep what has for long enough.
    pub fn end_tick(
        &mut self,
        mut sleepers: Sleepers,
        around: Surroundings,
        (contacts, touching): (&ContactCaches, &[ContactRecord]),
        (settings, field): (&StepSettings, Field),
    ) {
        let Some(sleep) = settings.sleep else { return };
        let Sleepers { memory, particles, elements, .. } = &mut sleepers;
        self.parts.refresh(elements, particles);
        memory.resize(particles.len());
        self.find_touching(contacts, touching, particles.len());
        let clock =
            Clock { sleep, time_step: settings.time_step, start: &self.start, touches: &self.touches };
        let mut any_ready = false;
        for range in self.parts.loose() {
            for start in range.clone().step_by(CHUNK) {
                any_ready |= clock.advance_loose(memory, particles, start..range.end.min(start + CHUNK));
            }
        }
        for part in self.parts.joined() {
            let members = self.parts.members(*part as usize);
            any_ready |= clock.advance_part(memory, particles, members);
        }
        for motion in around.moving() {
            self.parts.held_by(motion.slot).for_each(|part| memory.rested[self.parts.first(part)] = 0.0);
        }
        memory.since_check += settings.time_step;
        if any_ready && memory.since_check * CHECKS_PER_DELAY >= sleep.delay {
            self.consider(&mut sleepers, around, contacts, (settings, field), sleep);
        }
    }

    /// Finds what touched something in the last substep, or in the last implicit step.
    fn find_touching(&mut self, contacts: &ContactCaches, touching: &[ContactRecord], count: usize) {
        let Self { touches, .. } = self;
        touches.clear();
        let mut touch = |slot: usize| {
            touches.resize(count, false);
            touches[slot] = true;
        };
        contacts.for_each_touching(&mut touch);
        for record in touching {
            touch(record.slot);
            if let ContactPartner::Particle(other) = record.other {
                touch(other);
            }
        }
    }

    /// Puts to sleep the groups of which all parts are ready and no force is out of balance.
    fn consider(
        &mut self,
        sleepers: &mut Sleepers,
        around: Surroundings,
        contacts: &ContactCaches,
        (settings, field): (&StepSettings, Field),
        sleep: Sleep,
    ) {
        let Some(pairs) = contacts.near_pairs(sleepers.contacts, sleepers.particles, settings) else {
            return;
        };
        sleepers.memory.since_check = 0.0;
        let Self { parts, forest, stays, moves, .. } = self;
        forest.reset(parts.len());
        let Sleepers { memory, particles, .. } = &*sleepers;
        stays.clear();
        stays.extend((0..parts.len()).map(|part| {
            let first = parts.first(part);
            memory.group[first] != 0 || memory.rested[first] < sleep.delay
        }));
        let gap = touching_gap(settings);
        moves.clear();
        for motion in around.moving() {
            moves.resize(particles.len(), false);
            moves[motion.slot] = true;
        }
        let moves = |slot: usize| moves.get(slot) == Some(&true);
        for (one, other) in pairs.iter().map(|(one, other)| (*one as usize, *other as usize)) {
            let reach = particles.radius()[one] + particles.radius()[other] + gap;
            if particles.position.get(one).distance_squared(particles.position.get(other)) > reach * reach {
                continue;
            }
            match (parts.of(one), parts.of(other)) {
                (Some(one), Some(other)) => _ = forest.join(one, other),
                (Some(part), None) => stays[part] |= !stays[part] && moves(other),
                (None, Some(part)) => stays[part] |= !stays[part] && moves(one),
                (None, None) => {}
            }
        }
        if settings.gusts.is_some() && settings.air_density > 0.0 {
            sleepers.exposed.for_each_end(|slot| {
                if let Some(part) = parts.of(slot) {
                    stays[part] = true;
                }
            });
        }
        self.keep_carried_awake(sleepers, around, settings);
        self.spread();
        if self.stays.iter().all(|stays| *stays) {
            return;
        }
        self.check_balance(sleepers, field, sleep);
        self.spread();
        self.put_to_sleep(sleepers);
    }

    /// Parts stay awake beside one that does.
    fn spread(&mut self) {
        let Self { stays, forest, .. } = self;
        for part in 0..stays.len() {
            if stays[part] {
                stays[forest.root(part)] = true;
            }
        }
        for part in 0..stays.len() {
            stays[part] = stays[forest.root(part)];
        }
    }

    /// Keeps the parts awake that creep against drag or dampers, or that are pushed otherwise than when they began to rest.
    fn check_balance(
        &mut self,
        Sleepers { memory, particles, elements, .. }: &mut Sleepers,
        field: Field,
        sleep: Sleep,
    ) {
        let Self { parts, stays, braking, .. } = self;
        let is_considered = |slot: usize| parts.of(slot).is_some_and(|part| !stays[part]);
        let rested =
            |slot: usize| parts.of(slot).map_or(0.0, |part| f64::from(memory.rested[parts.first(part)]));
        let velocity = |slot: usize| match rested(slot) {
            0.0 => DVec3::ZERO,
            time => (particles.position.get(slot) - memory.place.get(slot)).as_dvec3() / time,
        };
        braking.clear();
        braking.extend((0..particles.len()).map(|slot| match is_considered(slot) {
            true => field.braking(slot, f64::from(particles.own_inverse_mass()[slot]), velocity(slot)),
            false => DVec3::ZERO,
        }));
        elements.for_each_damping(&particles.position, is_considered, velocity, |slot, force| {
            braking[slot] += force * f64::from(particles.own_inverse_mass()[slot]);
        });
        let limit = 2.0 * f64::from(sleep.speed) / f64::from(sleep.delay.max(f32::MIN_POSITIVE));
        for (slot, braking) in braking.iter().enumerate() {
            let Some(part) = parts.of(slot).filter(|part| !stays[*part]) else { continue };
            let is_balanced = braking.length_squared() <= limit * limit;
            if !is_balanced || particles.applied_force.get(slot) != memory.force.get(slot) {
                stays[part] = true;
                memory.rested[parts.first(part)] = 0.0;
            }
        }
    }

    fn put_to_sleep(&mut self, sleepers: &mut Sleepers) {
        let Self { parts, stays, forest, .. } = self;
        let Sleepers { memory, particles, contacts, pulls, .. } = sleepers;
        let before = memory.asleep;
        // The parts are in the order of their first slots: the first part of a group gives the group its number.
        let mut names = vec![0; parts.len()];
        for part in (0..parts.len()).filter(|part| !stays[*part]) {
            let name = &mut names[forest.root(part)];
            *name = if *name == 0 { parts.first(part) as u32 + 1 } else { *name };
            for slot in parts.members(part).iter().map(|slot| *slot as usize) {
                memory.group[slot] = *name;
                memory.place.set(slot, particles.position.get(slot));
                memory.force.set(slot, particles.applied_force.get(slot));
                memory.rested[slot] = 0.0;
                memory.asleep += 1;
                pulls.invalidate(slot);
            }
        }
        if memory.asleep > before {
            particles.put_to_sleep((0..memory.group.len()).filter(|slot| memory.group[*slot] != 0));
            contacts.put_to_sleep(|slot| particles.is_pinned(slot));
            memory.version = Version::new();
        }
    }
}

/// Whether a number is more than a limit; NaN is.
#[inline]
fn exceeds(number: f32, limit: f32) -> bool {
    number.is_nan() | (number > limit)
}

/// What measures rest.
struct Clock<'a> {
    sleep: Sleep,
    time_step: f32,
    /// Positions when the tick began, m.
    start: &'a Vectors,
    /// Of each slot whether it touched something; empty where none did.
    touches: &'a [bool],
}

impl Clock<'_> {
    /// The square of the speed above which nothing rests, m²/s².
    fn speed_limit(&self) -> f32 {
        (MAX_SPEED_RATIO * self.sleep.speed) * (MAX_SPEED_RATIO * self.sleep.speed)
    }

    /// Whether a particle is faster than what rests; true of a velocity that is not finite. Of what touches something, and of what is
    /// `beside` that, the velocity is that of the whole tick: at its end contacts may leave what gravity gives in some substeps.
    #[inline]
    fn is_fast(&self, particles: &Particles, slot: usize, beside: bool) -> bool {
        let (velocity, limit) = (particles.velocity.get(slot), self.speed_limit());
        let touches = self.touches(slot);
        if !(touches || beside) {
            return exceeds(velocity.length_squared(), limit);
        }
        let mean = (particles.position.get(slot) - self.start.get(slot)) / self.time_step;
        let vibrates = exceeds(velocity.length_squared(), BESIDE_RATIO * BESIDE_RATIO * limit);
        exceeds(mean.length_squared(), limit) || (vibrates && !touches)
    }

    fn touches(&self, slot: usize) -> bool {
        self.touches.get(slot) == Some(&true)
    }

    /// How far a particle may be from where it began to rest, m.
    fn drift(&self) -> f32 {
        MAX_DISPLACEMENT_RATIO * self.sleep.speed * self.sleep.delay
    }

    /// The same of one that is a part of its own.
    fn drift_of_loose(&self, particles: &Particles, slot: usize) -> f32 {
        if self.touches(slot) {
            self.drift().max(CONTACT_DISPLACEMENT_PART * particles.radius()[slot])
        } else {
            self.drift()
        }
    }

    /// Whether a particle is further than `allowed` m from where it began to rest.
    #[inline]
    fn has_drifted(memory: &SleepMemory, particles: &Particles, slot: usize, allowed: f32) -> bool {
        let squared = particles.position.get(slot).distance_squared(memory.place.get(slot));
        exceeds(squared, allowed * allowed)
    }

    fn begin(memory: &mut SleepMemory, particles: &Particles, slot: usize) {
        memory.place.set(slot, particles.position.get(slot));
        memory.force.set(slot, particles.applied_force.get(slot));
    }

    /// Particles that are parts of their own; whether any of them has rested for long enough.
    fn advance_loose(
        &self,
        memory: &mut SleepMemory,
        particles: &Particles,
        slots: std::ops::Range<usize>,
    ) -> bool {
        let limit = self.speed_limit();
        let [x, y, z] = particles.velocity.axes().map(|axis| &axis[slots.clone()]);
        let squares = x.iter().zip(y).zip(z).map(|((x, y), z)| x * x + y * y + z * z);
        // Without a branch a particle, as most move where any do.
        let any_touches = self.touches.get(slots.clone()).is_some_and(|touches| touches.contains(&true));
        if !any_touches && squares.fold(true, |all_fast, square| all_fast & exceeds(square, limit)) {
            memory.rested[slots].fill(0.0);
            return false;
        }
        let mut any_ready = false;
        for slot in slots {
            if memory.group[slot] != 0 {
                continue;
            }
            let rested = memory.rested[slot];
            if self.is_fast(particles, slot, false) {
                memory.rested[slot] = 0.0;
            } else if rested == 0.0
                || Self::has_drifted(memory, particles, slot, self.drift_of_loose(particles, slot))
            {
                Self::begin(memory, particles, slot);
                memory.rested[slot] = self.time_step;
            } else {
                memory.rested[slot] = rested + self.time_step;
                any_ready |= memory.rested[slot] >= self.sleep.delay;
            }
        }
        any_ready
    }

    /// A part of several particles; whether it has rested for long enough.
    fn advance_part(&self, memory: &mut SleepMemory, particles: &Particles, members: &[u32]) -> bool {
        let first = members[0] as usize;
        if memory.group[first] != 0 {
            return false;
        }
        let slots = || members.iter().map(|slot| *slot as usize);
        let rested = std::mem::replace(&mut memory.rested[first], 0.0);
        // Particles beside those that touch move with them, and which touch changes from substep to substep.
        let beside = slots().any(|slot| self.touches(slot));
        // The last one first: the free end of what hangs or is thrown.
        if slots().rev().any(|slot| self.is_fast(particles, slot, beside)) {
            return false;
        }
        if rested == 0.0 || slots().any(|slot| Self::has_drifted(memory, particles, slot, self.drift())) {
            slots().for_each(|slot| Self::begin(memory, particles, slot));
            memory.rested[first] = self.time_step;
            return false;
        }
        memory.rested[first] = rested + self.time_step;
        memory.rested[first] >= self.sleep.delay
    }
}
