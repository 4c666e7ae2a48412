//! Extended position-based dynamics: each spring in turn pulls its ends towards each other. First order;
//! stable for every substep.
//!
//! Macklin, Müller and Chentanez, *XPBD: position-based simulation of compliant constrained dynamics*
//! (2016), with one round over the springs in each substep, as in Macklin et al., *Small steps in physics
//! simulation* (2019). From where the particles fly without springs, a spring of stiffness k and damping c
//! between the inverse masses w displaces its ends along its direction d by w Δλ:
//!
//! Δλ = −(k h² (l − l0) + c h d·Δ) / (1 + (k h² + c h) (w₁ + w₂))
//!
//! where Δ is how far the ends have moved relative to each other in this substep. That is equation 26 of
//! the paper with the compliance α = 1/k and β = c, times k h², so that k may be 0. The springs are
//! solved for one at a time, so a long stiff net needs many substeps until it is as stiff as they are.
//!
//! On many threads each takes blocks of particles, as the forces do: the springs within a block first, then,
//! in a row, the few between two blocks. In each of these the springs are ordered by colour.

use bevy::math::{DVec3, Vec3};

use super::super::SolverState;
use super::super::blocks;
use super::super::forces::Field;
use super::super::particles::{Particles, set};
use super::super::springs::Springs;
use super::free_velocity;
use super::net::Net;

/// What is kept from substep to substep.
#[derive(Debug, Clone, Default)]
pub(super) struct Xpbd {
    order: Order,
    motion: Motion,
}

/// The particles in f64, one entry a slot.
#[derive(Debug, Clone, Default)]
struct Motion {
    /// Positions before the substep, m.
    start: Vec<DVec3>,
    /// Velocities without springs, m/s.
    velocity: Vec<DVec3>,
    position: Vec<DVec3>,
    /// How far the springs have displaced each particle, m.
    displacement: Vec<DVec3>,
}

/// The particles of one block, or all.
struct Block<'a> {
    /// The first slot.
    first: usize,
    start: &'a mut [DVec3],
    velocity: &'a mut [DVec3],
    position: &'a mut [DVec3],
    displacement: &'a mut [DVec3],
}

/// The order in which the springs are solved.
///
/// No two springs of one colour share a free particle, so that their order among themselves changes nothing.
#[derive(Debug, Clone, Default)]
struct Order {
    /// The springs within each block, then those between blocks.
    springs: Vec<u32>,
    /// Where those of each block end in `springs`.
    block_ends: Vec<usize>,
    /// Particles in each block but the last.
    block_size: usize,
    net: Net,
}

impl Order {
    fn refresh(&mut self, springs: &Springs, inverse_mass: &[f32], block_size: usize) {
        let is_new = self.net.refresh(springs, inverse_mass);
        if is_new || self.block_size != block_size {
            self.block_size = block_size;
            self.sort(springs);
        }
    }

    /// Gives each spring in turn the first colour that none has at its ends, and sorts by block and colour.
    fn sort(&mut self, springs: &Springs) {
        let count = self.net.free.len().div_ceil(self.block_size);
        let mut taken: Vec<Vec<u32>> = vec![Vec::new(); self.net.free.len()];
        let mut colored: Vec<(usize, u32, u32)> = Vec::with_capacity(springs.len());
        for spring in 0..springs.len() {
            let (first, second) = springs.ends(spring);
            let ends = [first, second].map(|end| self.net.free[end].then_some(end));
            let is_free = |color: &u32| ends.iter().flatten().all(|end| !taken[*end].contains(color));
            let color = (0..).find(is_free).unwrap_or(0);
            for end in ends.into_iter().flatten() {
                taken[end].push(color);
            }
            let [block, other] = [first, second].map(|end| end / self.block_size);
            colored.push((if block == other { block } else { count }, color, spring as u32));
        }
        colored.sort_unstable();
        self.block_ends.clear();
        self.block_ends
            .extend((0..count).map(|block| colored.partition_point(|(found, ..)| *found <= block)));
        self.springs.clear();
        self.springs.extend(colored.into_iter().map(|(.., spring)| spring));
    }

    /// The springs within each block.
    fn within_blocks(&self) -> impl Iterator<Item = &[u32]> {
        let starts = std::iter::once(&0).chain(&self.block_ends);
        starts.zip(&self.block_ends).map(|(start, end)| &self.springs[*start..*end])
    }

    fn between_blocks(&self) -> &[u32] {
        &self.springs[self.block_ends.last().copied().unwrap_or(0)..]
    }
}

/// To be called before the first substep of a tick: within it, the order stays.
pub(super) fn begin_tick(state: &mut SolverState) {
    let SolverState { particles, springs, scratch, .. } = state;
    springs.prepare(particles.len());
    scratch.xpbd.order.refresh(springs, &particles.inverse_mass, springs.batches().block_size);
}

pub(super) fn advance(state: &mut SolverState, field: Field, substep: f32) {
    let SolverState { particles, springs, scratch, .. } = state;
    let h = f64::from(substep);
    let Xpbd { order, motion } = &mut scratch.xpbd;
    // Even few blocks are worth it: a spring costs several times what it does where only forces are computed.
    let parallel = order.block_ends.len() > 1;
    motion.resize(particles.len());
    let within = motion.blocks(order.block_size).zip(order.within_blocks());
    blocks::for_each(within, parallel, |(mut block, listed)| {
        block.predict(particles, field, h);
        block.solve(listed, springs, particles, h);
    });
    for mut all in motion.blocks(usize::MAX) {
        all.solve(order.between_blocks(), springs, particles, h);
    }
    motion.finish(particles, order.block_size, parallel, h);
}

impl Motion {
    fn resize(&mut self, count: usize) {
        for vectors in [&mut self.start, &mut self.velocity, &mut self.position, &mut self.displacement] {
            vectors.resize(count, DVec3::ZERO);
        }
    }

    /// The particles in blocks of `size`.
    fn blocks(&mut self, size: usize) -> impl Iterator<Item = Block<'_>> {
        let starts = self.start.chunks_mut(size).zip(self.velocity.chunks_mut(size));
        let positions = self.position.chunks_mut(size).zip(self.displacement.chunks_mut(size));
        starts.zip(positions).enumerate().map(
            move |(number, ((start, velocity), (position, displacement)))| Block {
                first: number * size,
                start,
                velocity,
                position,
                displacement,
            },
        )
    }

    /// Writes positions, velocities and accelerations back.
    fn finish(&mut self, particles: &mut Particles, size: usize, parallel: bool, h: f64) {
        let Particles { position, velocity, acceleration, inverse_mass, .. } = particles;
        let written =
            position.chunks_mut(size).zip(velocity.chunks_mut(size)).zip(acceleration.chunks_mut(size));
        let parts = self.blocks(size).zip(inverse_mass.chunks(size)).zip(written);
        blocks::for_each(parts, parallel, |((block, inverse_mass), ((position, velocity), acceleration))| {
            let [mut position, mut velocity, mut acceleration] = [position, velocity, acceleration];
            for (slot, &inverse_mass) in inverse_mass.iter().enumerate() {
                if inverse_mass == 0.0 {
                    set(&mut acceleration, slot, Vec3::ZERO);
                    continue;
                }
                let old = Vec3::from(velocity.each_ref().map(|axis| axis[slot])).as_dvec3();
                let new = block.velocity[slot] + block.displacement[slot] / h;
                set(&mut position, slot, block.position[slot].as_vec3());
                set(&mut velocity, slot, new.as_vec3());
                set(&mut acceleration, slot, ((new - old) / h).as_vec3());
            }
        });
    }
}

impl Block<'_> {
    /// Lets the particles fly, and pinned ones go where they will be.
    fn predict(&mut self, particles: &Particles, field: Field, h: f64) {
        self.displacement.fill(DVec3::ZERO);
        for place in 0..self.start.len() {
            let slot = self.first + place;
            let start = particles.position.get(slot).as_dvec3();
            let velocity = match particles.inverse_mass[slot] > 0.0 {
                true => free_velocity(particles, slot, field, h),
                false => particles.velocity.get(slot).as_dvec3(),
            };
            self.start[place] = start;
            self.velocity[place] = velocity;
            self.position[place] = start + h * velocity;
        }
    }

    /// Solves for the `listed` springs, one after the other; all their ends are in the block.
    fn solve(&mut self, listed: &[u32], springs: &Springs, particles: &Particles, h: f64) {
        for &spring in listed {
            let spring = spring as usize;
            let (first, second) = springs.ends(spring);
            let inverse_mass = [first, second].map(|end| f64::from(particles.inverse_mass[end]));
            let impulse = self.impulse(springs, spring, inverse_mass[0] + inverse_mass[1], h);
            self.displace(first, impulse * inverse_mass[0]);
            self.displace(second, impulse * -inverse_mass[1]);
        }
    }

    /// Δλ d of a spring, kg·m: on its first end.
    fn impulse(&self, springs: &Springs, spring: usize, inverse_mass: f64, h: f64) -> DVec3 {
        let (first, second) = springs.ends(spring);
        let (first, second) = (first - self.first, second - self.first);
        let separation = self.position[first] - self.position[second];
        let length = separation.length();
        if length == 0.0 {
            return DVec3::ZERO;
        }
        let direction = separation / length;
        let stiffness = f64::from(springs.stiffness()[spring]) * h * h;
        let damping = f64::from(springs.damping()[spring]) * h;
        let elongation = length - f64::from(springs.rest_length()[spring]);
        let moved = direction.dot(separation - (self.start[first] - self.start[second]));
        let pull = stiffness * elongation + damping * moved;
        direction * (-pull / (1.0 + (stiffness + damping) * inverse_mass))
    }

    fn displace(&mut self, slot: usize, displacement: DVec3) {
        self.position[slot - self.first] += displacement;
        self.displacement[slot - self.first] += displacement;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn springs_of_one_colour_share_no_free_particle() {
        let mut springs = Springs::default();
        for (first, second) in [(0, 1), (1, 2), (2, 3), (3, 1), (0, 3)] {
            springs.push(first, second, 1.0, 1.0, 0.0);
        }
        let mut order = Order::default();
        order.refresh(&springs, &[0.0, 1.0, 1.0, 1.0], 4);
        // The colours are 0, 1, 0, 2, 1.
        assert_eq!(order.springs, [0, 2, 1, 4, 3]);
        // Of the blocks {0, 1} and {2, 3}, each has one to itself.
        order.refresh(&springs, &[0.0, 1.0, 1.0, 1.0], 2);
        assert_eq!(order.within_blocks().collect::<Vec<_>>(), [[0], [2]]);
        assert_eq!(order.between_blocks(), [1, 4, 3]);
    }
}
