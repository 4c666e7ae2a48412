//! Steps that end with stretched springs, because some of their particles were stopped and others were not.
//!
//! What keeps surfaces apart after a step knows nothing of springs. Where it has stopped single particles of a stiff net, the
//! elastic energy may be many times what there was; the next steps would set it free. Such a step is shortened, as in a
//! backtracking line search: all particles of the island, or of the islands that were solved together, go the same part of
//! their ways, so that none is stretched by what stopped another one. The velocities stay those after the impact, as far as
//! there is energy for them.

use bevy::math::Vec3;

use super::surplus::MAX_GAIN;
use super::tr_bdf2::{Context, Motion, energy};
use super::{ImplicitEuler, Island};
use crate::solver::elements::Elements;
use crate::solver::particles::{Particles, Vectors};
use crate::solver::settings::Field;

/// Below this part of its way an island stays where it was.
const LEAST_PART: f32 = 1e-3;

/// The start of a step, and its end as it was solved: positions, m, and velocities, m/s.
#[derive(Debug, Clone, Default)]
pub(in crate::solver) struct Course {
    start: [Vectors; 2],
    end: [Vectors; 2],
}

impl Course {
    /// To be called before a step.
    pub fn begin(&mut self, particles: &Particles) {
        keep(&mut self.start, particles);
    }

    /// To be called after it.
    pub fn end(&mut self, particles: &Particles) {
        keep(&mut self.end, particles);
    }

    /// The part of its way that a particle has gone in the direction of its way, 0 to 1.
    fn part(&self, particles: &Particles, slot: usize) -> f32 {
        let [from, to] = [&self.start, &self.end].map(|[position, _]| position.get(slot));
        let way = to - from;
        let part = (particles.position.get(slot) - from).dot(way) / way.length_squared();
        if part.is_nan() { 1.0 } else { part.clamp(0.0, 1.0) }
    }
}

fn keep([position, velocity]: &mut [Vectors; 2], particles: &Particles) {
    position.copy_from(&particles.position);
    velocity.copy_from(&particles.velocity);
}

impl ImplicitEuler {
    /// Shortens the last step of `h` seconds where the particles that were `stopped` have given an island more energy than it
    /// had; where it is the `last` time, islands stay where they were. Calls `visit` with the slots of these islands; whether
    /// there are any.
    pub fn backtrack(
        &self,
        (elements, field, h): (&Elements, Field, f32),
        course: &Course,
        (particles, acceleration): (&mut Particles, &mut Vectors),
        (stopped, is_last): (&[bool], bool),
        mut visit: impl FnMut(usize),
    ) -> bool {
        let mut any = false;
        let alone = self.islands.iter().enumerate().filter(|(number, _)| !self.clusters.has_joined(*number));
        for island in alone.map(|(_, island)| island).chain(self.clusters.islands()) {
            if island.slots().any(|slot| stopped[slot])
                && island.backtrack((elements, field, h), course, (particles, acceleration), is_last)
            {
                any = true;
                island.slots().for_each(&mut visit);
            }
        }
        any
    }
}

impl Island {
    fn backtrack(
        &self,
        (elements, field, h): (&Elements, Field, f32),
        course: &Course,
        (particles, acceleration): (&mut Particles, &mut Vectors),
        is_last: bool,
    ) -> bool {
        let h = f64::from(h);
        let context = Context { elimination: &self.elimination, elements, field, h };
        let energy_of = |particles: &Particles, [position, velocity]: [&Vectors; 2]| {
            let motion = |node: usize| {
                let slot = self.elimination.slots[node] as usize;
                Motion { position: position.get(slot).as_dvec3(), velocity: velocity.get(slot).as_dvec3() }
            };
            let [kinetic, potential] = energy(context, particles, motion);
            [kinetic, potential + self.system.gases.energy(&self.elimination, |node| motion(node).position)]
        };
        let present =
            |particles: &Particles| energy_of(particles, [&particles.position, &particles.velocity]);
        let [kinetic, potential] = energy_of(particles, course.start.each_ref());
        let solved: f64 = energy_of(particles, course.end.each_ref()).into_iter().sum();
        let mass = |slot: usize| 1.0 / f64::from(particles.inverse_mass()[slot]);
        let fallen: f64 =
            self.slots().map(|slot| 0.5 * mass(slot) * (h * field.acceleration(slot)).length_squared()).sum();
        let allowed = (kinetic + potential).max(solved) + MAX_GAIN * kinetic + fallen;
        let [new_kinetic, new_potential] = present(particles);
        // False of NaN.
        if !(new_kinetic + new_potential > allowed) {
            return false;
        }
        let least = self.slots().map(|slot| course.part(particles, slot)).fold(1.0, f32::min);
        let mut part = if is_last || least < LEAST_PART { 0.0 } else { least };
        loop {
            for slot in self.slots() {
                let [from, to] = [&course.start, &course.end].map(|[position, _]| position.get(slot));
                let position: Vec3 = if part == 0.0 { from } else { from.lerp(to, part) };
                particles.position.set(slot, position);
            }
            let [kinetic, potential] = present(particles);
            if potential > allowed && part > 0.0 {
                part = 0.0;
                continue;
            }
            if kinetic + potential > allowed {
                self.slow_down((allowed - potential).max(0.0), particles, acceleration, h);
            }
            return true;
        }
    }
}
