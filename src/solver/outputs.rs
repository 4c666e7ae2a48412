//! What a tick publishes: contacts, and the forces that elements exert at its end.

use bevy::math::{DVec3, Vec3};

use crate::solver::collision::ContactRecord;
use crate::solver::elements::{Elements, Enclosure, GasReading};
use crate::solver::particles::{Particles, Vectors};
use crate::solver::stability::Plan;

/// A spring that broke.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Broken {
    /// Its number.
    pub spring: usize,
    /// Its tension when it broke, N.
    pub tension: f32,
    /// How much longer it was then than without force, m.
    pub elongation: f32,
    /// The middle between its ends then, m, as positions are measured.
    pub point: Vec3,
}

/// What the last tick did, apart from the state that it left.
#[derive(Debug, Clone, Default)]
#[non_exhaustive]
pub struct Outputs {
    /// Whether [`contacts`](Self::contacts) are recorded. Default false.
    pub record_contacts: bool,
    /// Whether [`tensions`](Self::tensions) and [`reactions`](Self::reactions) are computed. Default false.
    pub record_forces: bool,
    /// What ran.
    pub plan: Plan,
    /// Whether all positions and velocities are known to be finite.
    pub is_finite: bool,
    /// Touching pairs at the end of the tick: of particles and of particles with colliders.
    pub contact_count: usize,
    /// The contacts of all substeps, in the order of these.
    pub contacts: Vec<ContactRecord>,
    /// The tension of each spring at the end of the tick, damper included, and after them those of the bends, N; negative where it pushes, 0 where
    /// it was removed. Of what rests, but for rounding, it is that which balances the loads. Of other springs that an implicit
    /// scheme advances it is that of the solved equations; of the rest it follows from the positions, and its error is their
    /// rounding times the stiffness.
    pub tensions: Vec<f32>,
    /// The slot of each pinned particle with springs or a gas, and the force with which these pull at it at the end of the
    /// tick, N; by slot.
    pub reactions: Vec<(usize, Vec3)>,
    /// The springs that broke in the tick, in the order in which they did. They are removed, but for those that
    /// [tear](crate::solver::Spring::tears).
    pub broken: Vec<Broken>,
    /// The springs that yielded in the tick, by their number.
    pub(crate) yielded: Vec<u32>,
    /// Volume and pressure of each gas at the end of the tick.
    pub gases: Vec<GasReading>,
    /// Force on the particle in each slot: working memory.
    forces: Vec<DVec3>,
    /// Of the volume of a gas, m²: working memory.
    gradient: Vec<DVec3>,
}

impl Outputs {
    pub(super) fn begin_tick(&mut self, plan: Plan) {
        self.plan = plan;
        self.is_finite = false;
        self.contacts.clear();
        self.tensions.clear();
        self.reactions.clear();
        self.broken.clear();
        self.yielded.clear();
    }

    /// Measures the gases.
    pub(super) fn read_gases(&mut self, elements: &Elements, position: &Vectors) {
        let reading = |enclosure: &Enclosure| {
            let volume = enclosure.volume(|place| position.get(enclosure.slots[place] as usize).as_dvec3());
            let pressure = if enclosure.acts() { enclosure.gas.pressure_at(volume) } else { 0.0 };
            GasReading { volume, pressure }
        };
        self.gases.clear();
        self.gases.extend(elements.gases().all().iter().map(reading));
    }

    /// Computes the forces. `solved` has the tensions, N, of elements that rest and of elements in implicit steps, and NaN for all others.
    pub(super) fn end_tick(&mut self, elements: &Elements, particles: &Particles, solved: &[f64]) {
        let Self { tensions, reactions, forces, gradient, .. } = self;
        tensions.resize(elements.len(), 0.0);
        forces.clear();
        forces.resize(particles.len(), DVec3::NAN);
        let on_element = |element: u32, measured: f64| {
            let element = element as usize;
            let solved = solved.get(element).copied().filter(|tension| !tension.is_nan());
            let tension = solved.unwrap_or(measured);
            tensions[element] = tension as f32;
            tension
        };
        elements.for_each_force(particles, on_element, |slot, force| {
            let sum = &mut forces[slot];
            *sum = if sum.is_nan() { force } else { *sum + force };
        });
        for (_, enclosure) in elements.gases().acting() {
            let at = |place: usize| particles.position.get(enclosure.slots[place] as usize).as_dvec3();
            let pressure = enclosure.gas.pressure_at(enclosure.measure(at, gradient));
            for (slot, gradient) in enclosure.slots.iter().zip(&*gradient) {
                let sum = &mut forces[*slot as usize];
                *sum = if sum.is_nan() { pressure * *gradient } else { *sum + pressure * *gradient };
            }
        }
        let pinned =
            (0..particles.len()).filter(|slot| !particles.is_movable(*slot) && !forces[*slot].is_nan());
        reactions.extend(pinned.map(|slot| (slot, forces[slot].as_vec3())));
    }
}
