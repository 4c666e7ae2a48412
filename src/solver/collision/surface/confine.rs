//! Limits displacements in substeps in which there are too many possible contacts to list, so that no crossing is missed.
//!
//! That happens where no scheme resolves the motion, as to a cloth that is squeezed by pinned particles until it bursts apart: each
//! vertex could meet a large part of all others in one substep. Then none moves by more than its radius.

use bevy::math::Vec3A;

use super::primitives::Primitives;
use crate::solver::particles::{Particles, Vectors};

/// Whether what bodies have in common is left to them, at the first and at a further attempt: there may be too many pairs
/// between bodies, too.
pub(super) const ATTEMPTS: [bool; 2] = [true, false];

/// The free vertices that are held back, with the fractions of their displacements that are left, and what their bodies have in common.
#[derive(Debug, Clone, Default)]
pub(super) struct Confinement {
    held: Vec<(u32, f32, u32)>,
    /// By body: its displacement, m, and velocity, m/s.
    common: Vec<[Vec3A; 2]>,
}

impl Confinement {
    /// Shortens the displacements from `start` to where they `end`.
    pub fn shorten(&self, start: &Vectors, end: &mut Vectors) {
        for (slot, part, body) in self.held.iter().copied() {
            let [common, _] = self.common[body as usize];
            let [from, to] = [start, &*end].map(|places| Vec3A::from(places.get(slot as usize)));
            end.set(slot as usize, (from + common.lerp(to - from, part)).into());
        }
    }

    /// Slows them down by as much.
    pub fn slow(&self, velocity: &mut Vectors) {
        for (slot, part, body) in self.held.iter().copied() {
            let [_, common] = self.common[body as usize];
            let own = Vec3A::from(velocity.get(slot as usize));
            velocity.set(slot as usize, common.lerp(own, part).into());
        }
    }

    /// Finds what is to be held back on its way from `start` to where it would `end`: vertices of bodies, and loose balls if
    /// `with_common` is off.
    pub fn find(
        &mut self,
        primitives: &Primitives,
        (start, end, particles): (&Vectors, &Vectors, &Particles),
        with_common: bool,
    ) {
        let Self { held, common, .. } = self;
        held.clear();
        common.clear();
        let displacement = |slot: usize| Vec3A::from(end.get(slot) - start.get(slot));
        let mut hold = |slot: u32, common: Vec3A, body: usize| {
            let length = displacement(slot as usize).distance(common);
            let most = particles.radius()[slot as usize];
            if length > most && !particles.is_pinned(slot as usize) {
                held.push((slot, most / length, body as u32));
            }
        };
        for (number, body) in primitives.forest.bodies.iter().enumerate() {
            let vertices = primitives.forest.vertices_of(body);
            let mean = |of: &dyn Fn(usize) -> Vec3A| -> Vec3A {
                let free = vertices.iter().filter(|slot| !particles.is_pinned(**slot as usize));
                let present = free.map(|slot| of(*slot as usize)).filter(|vector| vector.is_finite());
                let (sum, count) =
                    present.fold((Vec3A::ZERO, 0.0), |(sum, count), one| (sum + one, count + 1.0));
                if with_common && count > 0.0 { sum / count } else { Vec3A::ZERO }
            };
            common.push([mean(&displacement), mean(&|slot| particles.velocity.get(slot).into())]);
            vertices.iter().for_each(|slot| hold(*slot, common[number][0], number));
        }
        if !with_common {
            common.push([Vec3A::ZERO; 2]);
            primitives.balls.iter().for_each(|slot| hold(*slot, Vec3A::ZERO, common.len() - 1));
        }
    }
}
