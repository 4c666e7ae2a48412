//! The inner loops over the springs and particles of one block.
//!
//! They are plain loops over slices, written so that the compiler turns them into vector instructions,
//! and compiled for each instruction set that is worth it; which one runs is chosen once, when the
//! program starts (by the crate `pulp`). No operation is reordered or contracted, so all of them give the
//! same bits, those of [`Element::pull`](crate::solver::elements::Element::pull) one element after the other, but for
//! bends of parallelograms, which are summed in another order (`parallelograms.rs`).

mod accelerations;
mod bends;
mod closed;
mod in_air;
mod parallelograms;
mod semi_implicit;
mod springs;
mod verlet;
mod workspace;

use crate::solver::field::Field;
use crate::solver::graph::Blocks;
use crate::solver::graph::block::{Block, MIN_RUN};
use crate::solver::parallel;
use crate::solver::particles::{Particles, Vectors};
use accelerations::block_accelerations;
pub(super) use closed::{Check, Closed, Substeps};
pub(super) use in_air::{CorrectInAir, PredictInAir};
pub(super) use semi_implicit::{Advance, AdvanceInPlace, Moved};
pub(super) use verlet::{Correct, Predict, VerletInPlace};

/// What the forces depend on: all particles, or those from some slot on; three arrays for each vector.
#[derive(Clone, Copy)]
pub(super) struct Motion<'a> {
    /// The slot with which the arrays begin.
    pub first: usize,
    /// Whether it is known that all applied forces are zero.
    pub is_unpushed: bool,
    pub position: [&'a [f32]; 3],
    pub velocity: [&'a [f32]; 3],
    pub applied_force: [&'a [f32]; 3],
    pub inverse_mass: &'a [f32],
}

/// Writes the accelerations of the particles of one block.
pub(super) struct Accelerate<'a> {
    pub block: &'a Block,
    pub motion: &'a Motion<'a>,
    pub field: &'a Field<'a>,
    pub acceleration: [&'a mut [f32]; 3],
}

/// From this number of particles on it pays to begin vectors where those of the whole arrays do.
const MIN_ALIGNED: usize = 512;

/// The indices of a slice of `count` numbers that begins in a slot; of a long one, those before the first vector of
/// the whole array apart, so that fewer vectors lie across two cache lines. Measured on a rope of 10,000 that
/// begins in slot 1: a tick takes a tenth less.
#[inline(always)]
fn in_vectors(start: usize, count: usize) -> impl Iterator<Item = std::ops::Range<usize>> {
    let head = if count < MIN_ALIGNED { 0 } else { start.next_multiple_of(MIN_RUN) - start };
    let first = 0..if head == 0 { count } else { head };
    std::iter::successors(Some(first), move |part| (part.end < count).then_some(part.end..count))
}

/// Does the work with the best instructions that the processor has.
pub(super) fn run(work: impl pulp::WithSimd<Output = ()>) {
    pulp::Arch::new().dispatch(work);
}

impl<'a> Motion<'a> {
    /// The present motion of `particles`.
    pub fn of(particles: &'a Particles) -> Self {
        Self::at(&particles.position, &particles.velocity, particles)
    }

    /// With other positions and velocities.
    pub fn at(position: &'a Vectors, velocity: &'a Vectors, particles: &'a Particles) -> Self {
        Self {
            first: 0,
            is_unpushed: particles.is_unpushed(),
            position: position.axes(),
            velocity: velocity.axes(),
            applied_force: particles.applied_force.axes(),
            inverse_mass: particles.inverse_mass(),
        }
    }
}

/// Evaluates the accelerations of `motion`, for the particles in `blocks`.
pub(super) fn evaluate(motion: Motion, blocks: &Blocks, field: Field, acceleration: &mut Vectors) {
    let parts = blocks.blocks.iter().zip(blocks.split(acceleration.axes_mut()));
    parallel::for_each(parts, blocks.are_worth_sharing(), |(block, acceleration)| {
        run(Accelerate { block, motion: &motion, field: &field, acceleration });
    });
}

impl pulp::WithSimd for Accelerate<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(mut self, _: S) {
        block_accelerations(self.block, self.motion, self.field, &mut self.acceleration);
    }
}

#[cfg(test)]
mod tests {
    use bevy::math::Vec3;
    use pulp::WithSimd;

    use super::*;
    use crate::solver::elements::{Bend, Element, Elements, Holds, Spring};

    const FIELD: Field = Field { gravity: Vec3::new(0.0, -9.81, 0.0), viscosity: 0.2, air: None, gas: None };

    /// A strip of cloth of three blocks, a few springs and bends from anywhere to anywhere, and a pinned corner.
    fn net() -> (Particles, Elements, Blocks) {
        let (width, count) = (37, 5000);
        let (mut particles, mut elements) = (Particles::default(), Elements::default());
        let wobble = |slot: usize, factor: usize| (slot * factor % 101) as f32 * 0.002;
        for slot in 0..count {
            let (column, row) = ((slot % width) as f32, (slot / width) as f32);
            let position = Vec3::new(column + wobble(slot, 7), wobble(slot, 13), row + wobble(slot, 29));
            let velocity = Vec3::new(wobble(slot, 3), wobble(slot, 17), -wobble(slot, 5));
            particles.push(position, velocity, if slot == 0 { 0.0 } else { 1.0 / 0.3 }, 0.0);
        }
        for (columns, rows) in [(1, 0), (2, 0), (0, 1), (1, 1)] {
            for slot in (0..count).filter(|slot| slot % width + columns < width) {
                let other = slot + columns + rows * width;
                if other < count {
                    // One in three the other way round, and a softer one here and there.
                    let ends = if slot % 3 == 0 { [other, slot] } else { [slot, other] };
                    let stiffness = if slot % 500 == 7 { 20.0 } else { 80.0 };
                    let spring = Spring {
                        rest_length: 1.0 + wobble(slot, 11),
                        stiffness,
                        damping: 0.5,
                        ..Spring::default()
                    };
                    elements.push(ends.map(|end| end as u32), spring);
                }
            }
        }
        for slot in (0..count).step_by(61) {
            let far = slot * 31 % count + 1;
            let spring = Spring { rest_length: 5.0, stiffness: 3.0, damping: 0.1, ..Spring::default() };
            elements.push([slot as u32, far as u32], spring);
            let ends = [slot as u32, (slot + 5) as u32, far as u32];
            elements.push(
                ends,
                Bend { rest_length: 0.0, stiffness: 0.5, damping: 0.1, weights: [1.0, -2.0, 1.0] },
            );
        }
        bend(&mut elements, width, count);
        let blocks = Blocks::of(elements.clone(), &particles);
        assert!(blocks.blocks.len() > 1);
        (particles, elements, blocks)
    }

    /// Rods along rows and columns, straight and curved, damped and not, and hinges with weights of one kind and of
    /// their own.
    fn bend(elements: &mut Elements, width: usize, count: usize) {
        for slot in 0..count - 2 * width - 1 {
            let slots = |steps: [usize; 3]| steps.map(|step| (slot + step) as u32);
            let rod = Bend { rest_length: 0.0, stiffness: 2.0, damping: 0.0, weights: [1.0, -2.0, 1.0] };
            elements.push(slots([0, 1, 2]), rod);
            let rest_length = if slot % 100 == 3 { 0.4 } else { 0.0 };
            elements.push(slots([2 * width, width, 0]), Bend { rest_length, damping: 0.2, ..rod });
            // None at the ends of rows: holes in runs.
            if slot % width == width - 1 {
                continue;
            }
            let own = if slot > count / 2 { (slot % 7) as f32 * 0.01 } else { 0.0 };
            let weights = [0.5 + own, 0.75, -1.5, 0.25 - own];
            let ends = [0, 1, width, width + 1].map(|step| (slot + step) as u32);
            let (rest_length, stiffness) = (own, if slot % 300 == 9 { 1.0 } else { 3.0 });
            elements.push(ends, Bend { rest_length, stiffness, damping: own, weights });
            // Parallelograms: three kinds of the same particles.
            let flat =
                Bend { rest_length: 0.0, stiffness: 2.0, damping: 0.0, weights: [1.0, 1.0, -1.0, -1.0] };
            let mut add = |steps: [usize; 4]| _ = elements.push(steps.map(|step| (slot + step) as u32), flat);
            add([1, width, 0, width + 1]);
            add([0, 2 * width + 1, width, width + 1]);
            if slot % width < width - 2 {
                add([0, width + 2, 1, width + 1]);
            }
        }
    }

    /// The forces as one would write them first: one element after the other.
    fn plain(particles: &Particles, elements: &Elements) -> Vectors {
        let mut force = Vectors::default();
        for slot in 0..particles.len() {
            force.push(particles.applied_force.get(slot) - FIELD.viscosity * particles.velocity.get(slot));
        }
        let springs = elements.springs().all_ends().iter().zip(elements.springs().elements());
        for (&[first, second], spring) in springs {
            let [first, second] = [first as usize, second as usize];
            let between = |vectors: &Vectors| vectors.get(first) - vectors.get(second);
            let pull = spring.pull(between(&particles.position), between(&particles.velocity));
            force.add(first, pull);
            force.add(second, -pull);
        }
        add_plain::<3>(particles, elements, &mut force);
        add_plain::<4>(particles, elements, &mut force);
        for slot in 0..particles.len() {
            let inverse_mass = particles.inverse_mass()[slot];
            let free = force.get(slot) * inverse_mass + FIELD.gravity;
            force.set(slot, if inverse_mass > 0.0 { free } else { Vec3::ZERO });
        }
        force
    }

    fn add_plain<const N: usize>(particles: &Particles, elements: &Elements, force: &mut Vectors)
    where
        Elements: Holds<Bend<N>, N>,
    {
        let bends = Holds::<Bend<N>, N>::table(elements);
        for (ends, bend) in bends.all_ends().iter().zip(bends.elements()) {
            let combine = |vectors: &Vectors| -> Vec3 {
                ends.iter().zip(bend.weights).map(|(end, weight)| vectors.get(*end as usize) * weight).sum()
            };
            let pull = bend.pull(combine(&particles.position), combine(&particles.velocity));
            ends.iter().zip(bend.weights).for_each(|(end, weight)| force.add(*end as usize, pull * weight));
        }
    }

    fn evaluated(particles: &Particles, blocks: &Blocks) -> Vectors {
        let mut acceleration = Vectors::default();
        acceleration.resize(particles.len());
        evaluate(Motion::of(particles), blocks, FIELD, &mut acceleration);
        acceleration
    }

    /// Each particle has fewer than n = 48 forces of at most 500 N; sums of n terms differ by at most
    /// 2 n u times the sum of their sizes, which 1/m turns into accelerations.
    #[test]
    fn the_kernel_does_what_the_plain_loop_does() {
        let (particles, elements, blocks) = net();
        let (expected, found) = (plain(&particles, &elements), evaluated(&particles, &blocks));
        let tolerance = 2.0 * 48.0 * (0.5 * f32::EPSILON) * (48.0 * 500.0) / 0.3;
        let mut largest = 0.0_f32;
        for slot in 0..particles.len() {
            let difference = found.get(slot) - expected.get(slot);
            assert!(difference.length() < tolerance, "slot {slot}: {difference}");
            largest = largest.max(expected.get(slot).length());
        }
        assert!(largest > 100.0 && found.get(0) == Vec3::ZERO);
        let in_runs: usize = blocks.blocks.iter().map(|block| block.bends.rods.len()).sum();
        let hinges = || blocks.blocks.iter().flat_map(|block| &block.bends.hinges.runs);
        let holes: usize = hinges().map(|run| run.holes.len()).sum();
        assert!(holes > 100 && hinges().any(|run| run.weights.is_none() && !run.holes.is_empty()), "{holes}");
        let parallelograms: Vec<bool> = hinges().map(|run| run.parallelograms().is_some()).collect();
        assert!(parallelograms.windows(3).any(|three| three == [true; 3]), "three are computed together");
        assert!(in_runs > 9000, "most of 9,850 rods are in runs: {in_runs}");
    }

    #[test]
    fn every_instruction_set_gives_the_same_bits() {
        let (particles, _, blocks) = net();
        let mut portable = Vectors::default();
        portable.resize(particles.len());
        let motion = Motion::of(&particles);
        for (block, acceleration) in blocks.blocks.iter().zip(blocks.split(portable.axes_mut())) {
            Accelerate { block, motion: &motion, field: &FIELD, acceleration }.with_simd(pulp::Scalar::new());
        }
        assert_eq!(evaluated(&particles, &blocks), portable);
        // Springs and bends in runs are work of their own.
        let mut forces = [Vectors::default(), Vectors::default()];
        for (forces, is_portable) in forces.iter_mut().zip([true, false]) {
            forces.resize(particles.len());
            for (block, mut force) in blocks.blocks.iter().zip(blocks.split(forces.axes_mut())) {
                let (mut pulls, mut buffers) = (springs::SpringForces::new(), bends::BendBuffers::new());
                let work =
                    springs::AddSprings { block, motion: &motion, force: &mut force, forces: &mut pulls };
                if is_portable {
                    work.with_simd(pulp::Scalar::new())
                } else {
                    run(work)
                }
                let work =
                    bends::AddBends { block, motion: &motion, force: &mut force, buffers: &mut buffers };
                if is_portable { work.with_simd(pulp::Scalar::new()) } else { run(work) }
            }
        }
        assert_eq!(forces[0], forces[1]);
        assert_ne!(forces[0].get(particles.len() / 2), Vec3::ZERO);
    }

    /// Ropes of 20 links that hang from their first particle, one held at both ends, one listed upside down, one with a stiffer
    /// first link, and two of cables, one of which has a spring in place of its first; in the order of the particles.
    fn anchored_ropes() -> (Particles, Elements) {
        let (mut particles, mut elements) = (Particles::default(), Elements::default());
        for slot in 0..7 * 21 {
            let (rope, number) = (slot / 21, slot % 21);
            let wobble = |factor: usize| (slot * factor % 101) as f32 * 0.002;
            let position = Vec3::new(0.1 * number as f32 + wobble(7), wobble(13), rope as f32);
            let is_pinned = number == 0 || (rope == 1 && number == 20);
            let inverse_mass = if is_pinned { 0.0 } else { 3.0 };
            particles.push(position, Vec3::new(wobble(3), -wobble(17), wobble(5)), inverse_mass, 0.0);
            if number > 0 {
                let ends = if rope == 2 { [slot, slot - 1] } else { [slot - 1, slot] };
                let spring = Spring {
                    rest_length: 0.1 + wobble(11),
                    stiffness: if rope == 3 && number == 1 { 900.0 } else { 300.0 },
                    damping: 0.5,
                    tension_only: rope == 5 || (rope == 6 && number > 1),
                    ..Spring::default()
                };
                elements.push(ends.map(|end| end as u32), spring);
            }
        }
        (particles, elements)
    }

    /// Drag and the other springs come first in the sum of forces, so that another order would show.
    #[test]
    fn springs_at_pinned_particles_are_computed_in_runs_to_the_bit_as_one_by_one() {
        let (particles, mut elements) = anchored_ropes();
        let mut blocks = Blocks::of(elements.clone(), &particles);
        let computed = |blocks: &Blocks| {
            let loose = blocks.blocks.iter().flat_map(|block| &block.loose.springs);
            (loose.clone().filter(|loose| loose.computed.is_some()).count(), loose.count())
        };
        // All but the spring in a rope of cables.
        assert_eq!(computed(&blocks), (7, 8));
        for stiffness in [300.0, 500.0] {
            let link = Spring { stiffness, ..elements.springs().elements()[20] };
            elements.set(20, link);
            blocks.set_parameters(20, link);
            let found = evaluated(&particles, &blocks);
            let mut one_by_one = blocks.clone();
            let loose = one_by_one.blocks.iter_mut().flat_map(|block| &mut block.loose.springs);
            loose.for_each(|loose| loose.computed = None);
            assert_eq!(found, evaluated(&particles, &one_by_one), "{stiffness}");
            assert_eq!(
                found,
                evaluated(&particles, &Blocks::of(elements.clone(), &particles)),
                "{stiffness}"
            );
        }
    }

    fn pair(velocities: [Vec3; 2], inverse_mass: f32, springs: bool) -> (Particles, Blocks) {
        let (mut particles, mut elements) = (Particles::default(), Elements::default());
        particles.push(Vec3::new(0.1, 0.7, -0.3), velocities[0], inverse_mass, 0.0);
        particles.push(Vec3::new(-0.4, 0.2, 0.9), velocities[1], inverse_mass, 0.0);
        if springs {
            elements.push(
                [0, 1],
                Spring { rest_length: 0.3, stiffness: 123.4, damping: 5.6, ..Spring::default() },
            );
        }
        let blocks = Blocks::of(elements, &particles);
        (particles, blocks)
    }

    #[test]
    fn action_and_reaction_cancel_to_the_last_bit() {
        let (particles, blocks) = pair([Vec3::new(3.0, -2.0, 0.5), Vec3::new(-1.0, 0.3, 0.2)], 1.0, true);
        let mut acceleration = Vectors::default();
        acceleration.resize(2);
        let field = Field { gravity: Vec3::ZERO, viscosity: 0.0, ..FIELD };
        evaluate(Motion::of(&particles), &blocks, field, &mut acceleration);
        assert_eq!(acceleration.get(0), -acceleration.get(1));
        assert!(acceleration.get(0).length() > 1.0);
    }

    #[test]
    fn weight_viscosity_and_applied_force_add_up_and_move_no_pinned_particle() {
        let (mut particles, blocks) = pair([Vec3::X * 2.0; 2], 0.25, false);
        particles.applied_force.fill(Vec3::Z * 8.0);
        particles.set_inverse_mass(1, 0.0);
        let mut acceleration = Vectors::default();
        acceleration.resize(2);
        evaluate(Motion::of(&particles), &blocks, Field { viscosity: 6.0, ..FIELD }, &mut acceleration);
        assert_eq!(acceleration.get(0), Vec3::new(-3.0, -9.81, 2.0));
        assert_eq!(acceleration.get(1), Vec3::ZERO);
    }
}
