//! The forces of the air on all particles: derived from the state in each substep.

use bevy::math::Vec3;

use crate::solver::buckets::Buckets;
use crate::solver::elements::{CrossFlow, Exposed, FacePush, FilamentPush, Push};
use crate::solver::field::{AirLoad, FilamentLoad};
use crate::solver::gusts::{AirClock, GustField};
use crate::solver::parallel;
use crate::solver::particles::{Particles, Vectors, set};
use crate::solver::settings::StepSettings;
use crate::solver::state::Version;

/// Particles, faces or filaments that one task takes.
const CHUNK: usize = 1024;

/// Number of faces and filaments from which on they are shared among all threads.
const MIN_SHARED: usize = 8192;

/// The air of a tick; a cache.
#[derive(Debug, Clone, Default)]
pub(super) struct Air {
    /// Whether there is air, and anything that it acts on.
    is_active: bool,
    wind: Vec3,
    density: f32,
    /// The faces and filaments at each particle.
    faces_at: Buckets<u32>,
    filaments_at: Buckets<u32>,
    /// Whether any particle of each chunk has some.
    chunks: Vec<bool>,
    key: Option<(Version, usize)>,
    /// What the wind has more or less at each particle in this tick, m/s.
    gusts: Option<Vectors>,
    faces: Vec<FacePush>,
    filaments: Vec<FilamentPush>,
    load: AirLoad,
}

impl Air {
    /// To be called before the first substep of a tick. Positions are measured from `origin`.
    pub fn begin_tick(
        &mut self,
        exposed: &Exposed,
        particles: &Particles,
        settings: &StepSettings,
        (origin, clock): (Vec3, AirClock),
    ) {
        (self.wind, self.density) = (settings.wind, settings.air_density);
        self.is_active = self.density > 0.0 && !exposed.is_empty();
        if !self.is_active {
            return;
        }
        self.refresh(exposed, particles.len());
        let usable = settings.gusts.filter(|gusts| gusts.length > 0.0 && gusts.time > 0.0);
        let Some(gusts) = usable else {
            self.gusts = None;
            return;
        };
        let Self { gusts: velocities, chunks, .. } = self;
        let velocities = velocities.get_or_insert_default();
        velocities.resize(particles.len());
        let parts = velocities.chunks_mut(CHUNK).zip(&*chunks).enumerate();
        parallel::for_each(parts.filter(|(_, (_, any))| **any), exposed.faces.len() >= MIN_SHARED, |part| {
            let (chunk, (mut velocities, _)) = part;
            let mut field = GustField::new(gusts, clock);
            for place in 0..velocities[0].len() {
                let position = particles.position.get(chunk * CHUNK + place);
                let gust = field.at(origin.as_dvec3() + position.as_dvec3());
                set(&mut velocities, place, gust);
            }
        });
    }

    /// Lists what is at each particle.
    fn refresh(&mut self, exposed: &Exposed, count: usize) {
        let key = Some((exposed.version(), count));
        if self.key == key {
            return;
        }
        self.key = key;
        fn ends<const N: usize, T>(all: &[([u32; N], T)], count: usize, add: &mut dyn FnMut(usize, u32)) {
            for (number, (ends, _)) in (0..).zip(all) {
                for end in ends.iter().map(|end| *end as usize).filter(|end| *end < count) {
                    add(end, number);
                }
            }
        }
        self.faces_at.fill(count, |add| ends(&exposed.faces, count, add));
        self.filaments_at.fill(count, |add| ends(&exposed.filaments, count, add));
        let any = |slot: usize| !self.faces_at.of(slot).is_empty() || !self.filaments_at.of(slot).is_empty();
        self.chunks.clear();
        self.chunks.extend((0..count).step_by(CHUNK).map(|start| (start..count.min(start + CHUNK)).any(any)));
        let AirLoad { push, rate, gain, filaments } = &mut self.load;
        // Particles at which filaments end have no entries in the arrays.
        filaments.clear();
        let slots = (0..count).filter(|slot| !self.filaments_at.of(*slot).is_empty());
        filaments.extend(slots.map(|slot| FilamentLoad::of(slot as u32)));
        for values in [rate, &mut *gain] {
            values.clear();
            values.resize(count, 0.0);
        }
        gain.fill(1.0);
        push.resize(0);
        push.resize(count);
        if let Some(gusts) = &mut self.gusts {
            gusts.resize(0);
        }
    }

    /// Derives the forces for a substep of `substep` seconds; the longest step that begins now has `longest`.
    pub fn evaluate(&mut self, exposed: &Exposed, particles: &Particles, [substep, longest]: [f32; 2]) {
        if !self.is_active {
            return;
        }
        let density = self.density;
        let is_shared = exposed.faces.len() + exposed.filaments.len() >= MIN_SHARED;
        self.faces.resize(exposed.faces.len(), FacePush::default());
        let parts = self.faces.chunks_mut(CHUNK).zip(exposed.faces.chunks(CHUNK));
        parallel::for_each(parts, is_shared, |(found, faces)| {
            for (found, face) in found.iter_mut().zip(faces) {
                *found = FacePush::of(face, &particles.position, density);
            }
        });
        self.filaments.resize(exposed.filaments.len(), FilamentPush::default());
        let parts = self.filaments.chunks_mut(CHUNK).zip(exposed.filaments.chunks(CHUNK));
        parallel::for_each(parts, is_shared, |(found, filaments)| {
            for (found, filament) in found.iter_mut().zip(filaments) {
                *found = FilamentPush::of(filament, &particles.position, density);
            }
        });
        let mut load = std::mem::take(&mut self.load);
        let AirLoad { push, rate, gain, filaments } = &mut load;
        let rates = rate.chunks_mut(CHUNK).zip(gain.chunks_mut(CHUNK));
        let parts = push.chunks_mut(CHUNK).zip(rates).zip(&self.chunks).enumerate();
        parallel::for_each(
            parts.filter(|(_, (_, any))| **any),
            is_shared,
            |(chunk, ((mut push, rates), _))| {
                let (rate, gain) = rates;
                for place in 0..rate.len() {
                    let slot = chunk * CHUNK + place;
                    if !self.filaments_at.of(slot).is_empty() {
                        continue;
                    }
                    let inverse_mass = particles.inverse_mass()[slot];
                    let (decay, pushed) =
                        self.faces_push(slot, particles.velocity.get(slot)).by_mass(inverse_mass, longest);
                    let air = self.velocity_at(slot);
                    set(&mut push, place, decay * air + pushed);
                    rate[place] = decay;
                    gain[place] = 1.0 / (1.0 + substep * decay);
                }
            },
        );
        parallel::for_each(filaments.chunks_mut(CHUNK), is_shared, |loads| {
            for load in loads {
                let slot = load.slot as usize;
                let inverse_mass = particles.inverse_mass()[slot];
                let velocity = particles.velocity.get(slot);
                let faces = self.faces_push(slot, velocity).by_mass(inverse_mass, longest);
                let across = self.cross_flow(slot, velocity).by_mass(inverse_mass, longest);
                *load = FilamentLoad::new(load.slot, self.velocity_at(slot), faces, across, substep);
            }
        });
        self.load = load;
    }

    /// The velocity of the air at a particle, m/s.
    fn velocity_at(&self, slot: usize) -> Vec3 {
        self.wind + self.gusts.as_ref().map_or(Vec3::ZERO, |gusts| gusts.get(slot))
    }

    /// What the air does to a particle of this velocity by its faces.
    #[inline(always)]
    fn faces_push(&self, slot: usize, velocity: Vec3) -> Push {
        let mut sum = Push::new(self.velocity_at(slot) - velocity);
        self.faces_at.of(slot).iter().for_each(|face| sum.add(&self.faces[*face as usize]));
        sum
    }

    /// What it does by its filaments.
    fn cross_flow(&self, slot: usize, velocity: Vec3) -> CrossFlow {
        let mut sum = CrossFlow::new(self.velocity_at(slot) - velocity);
        self.filaments_at.of(slot).iter().for_each(|filament| sum.add(&self.filaments[*filament as usize]));
        sum
    }

    /// The forces that were derived last; `None`: there are none.
    pub fn load(&self) -> Option<&AirLoad> {
        self.is_active.then_some(&self.load)
    }
}
