//! Lattices of springs above level, frictionless ground, in f64: what an impact does to them, and how they rest.

use bevy::math::DVec3;
use bevy_mass_spring::solver::{Collider, Solver, Spring};

use bevy::math::Vec3;

use crate::net::GRAVITY;

/// Between neighbours, m.
pub const SPACING: f64 = 0.1;
/// Of a point, kg.
pub const MASS: f64 = 0.02;
/// Of a point, m.
pub const RADIUS: f64 = 0.02;
/// Of a spring, N·s/m.
pub const DAMPING: f64 = 0.5;

/// A block of points, joined to their neighbours and along all diagonals.
#[derive(Debug, Clone)]
pub struct Lattice {
    pub name: &'static str,
    /// Where points are above the lowest layer, m.
    places: Vec<DVec3>,
    /// Ends and rest length, m.
    springs: Vec<([usize; 2], f64)>,
}

/// What a fall does to a net, or how it rests.
#[derive(Debug, Clone, Copy, Default)]
pub struct Strain {
    /// J
    pub elastic_energy: f64,
    /// Of the most strained spring, in parts of its rest length.
    pub stretch: f64,
}

impl Lattice {
    pub fn new(name: &'static str, [nx, ny, nz]: [u8; 3]) -> Self {
        let places: Vec<DVec3> = (0..nx)
            .flat_map(|i| (0..ny).flat_map(move |j| (0..nz).map(move |k| [i, j, k])))
            .map(|place| DVec3::from(place.map(f64::from)) * SPACING)
            .collect();
        let mut springs = Vec::new();
        for first in 0..places.len() {
            for second in first + 1..places.len() {
                let apart = places[second] - places[first];
                if apart.abs().max_element() < 1.5 * SPACING {
                    springs.push(([first, second], apart.length()));
                }
            }
        }
        Self { name, places, springs }
    }

    /// N
    pub fn weight(&self) -> f64 {
        self.places.len() as f64 * MASS * GRAVITY
    }

    /// The lattice with its lowest points `height` above the ground, as the solver has it.
    pub fn solver(&self, stiffness: f64, height: f64) -> Solver {
        let mut solver = Solver::default();
        for place in &self.places {
            let position = (*place + DVec3::Y * (height + RADIUS)).as_vec3();
            solver
                .add_particle(position, Vec3::ZERO, MASS as f32, RADIUS as f32)
                .expect("the lattice is valid");
        }
        for ([first, second], _) in &self.springs {
            let rest_length = solver.position(*first).distance(solver.position(*second));
            let (stiffness, damping) = (stiffness as f32, DAMPING as f32);
            let spring = Spring { rest_length, stiffness, damping, ..Spring::default() };
            solver.add_spring([*first, *second], spring).expect("the lattice is valid");
        }
        solver.add_collider(Collider::half_space(Vec3::ZERO, Vec3::Y, 0.0, 0.0));
        solver
    }

    /// The most that a fall from `height` does, by the symplectic Euler method with a ground that absorbs all: the lowest points stop
    /// where they are. The step is a part of 1/ω of the fastest mode, and the time enough for the impact to run through.
    pub fn impact(&self, stiffness: f64, height: f64, steps_per_radian: f64) -> Strain {
        let fastest = (2.0 * 26.0 * stiffness / MASS).sqrt();
        let h = 1.0 / (fastest * steps_per_radian);
        let mut x = self.places.clone();
        let mut v = vec![DVec3::NEG_Y * (2.0 * GRAVITY * height).sqrt(); x.len()];
        let mut most = Strain::default();
        for _ in 0..(300.0 * steps_per_radian) as usize {
            let mut now = Strain::default();
            let mut force = vec![DVec3::NEG_Y * (GRAVITY * MASS); x.len()];
            for ([first, second], rest_length) in &self.springs {
                let apart = x[*second] - x[*first];
                let length = apart.length();
                let along = apart / length;
                let elongation = length - rest_length;
                let rate = (v[*second] - v[*first]).dot(along);
                let pull = along * (stiffness * elongation + DAMPING * rate);
                force[*first] += pull;
                force[*second] -= pull;
                now.elastic_energy += 0.5 * stiffness * elongation * elongation;
                now.stretch = now.stretch.max((elongation / rest_length).abs());
            }
            most.elastic_energy = most.elastic_energy.max(now.elastic_energy);
            most.stretch = most.stretch.max(now.stretch);
            for ((x, v), force) in x.iter_mut().zip(&mut v).zip(force) {
                *v += force * (h / MASS);
                *x += *v * h;
                if x.y < 0.0 {
                    (x.y, v.y) = (0.0, v.y.max(0.0));
                }
            }
        }
        most
    }

    /// How it rests on its lowest layer: the displacements u where K u = weight, by conjugate gradients, without those of the
    /// lowest points that the ground would have to hold down. At these stiffnesses angles change by less than a thousandth, and all is
    /// proportional to 1/k.
    pub fn at_rest(&self, stiffness: f64) -> Strain {
        let mut is_held: Vec<bool> = self.places.iter().map(|place| place.y == 0.0).collect();
        loop {
            let displacement = self.settle(&is_held);
            let image = self.times(&displacement);
            let lifted = |slot: &usize| is_held[*slot] && image[*slot].y + MASS * GRAVITY < -1e-9;
            let Some(lifted) = (0..is_held.len()).find(lifted) else {
                let mut strain = Strain::default();
                for ([first, second], rest_length) in &self.springs {
                    let along = (self.places[*second] - self.places[*first]) / *rest_length;
                    let tension = (displacement[*second] - displacement[*first]).dot(along);
                    strain.elastic_energy += 0.5 * tension * tension / stiffness;
                    strain.stretch = strain.stretch.max(tension.abs() / (stiffness * rest_length));
                }
                return strain;
            };
            is_held[lifted] = false;
        }
    }

    /// u, m, for springs of 1 N/m.
    fn settle(&self, is_held: &[bool]) -> Vec<DVec3> {
        let hold = |forces: &mut [DVec3]| {
            for (force, is_held) in forces.iter_mut().zip(is_held) {
                force.y = if *is_held { 0.0 } else { force.y };
            }
        };
        let mut displacement = vec![DVec3::ZERO; self.places.len()];
        let mut residual = vec![DVec3::NEG_Y * (MASS * GRAVITY); self.places.len()];
        hold(&mut residual);
        let mut direction = residual.clone();
        let dot =
            |one: &[DVec3], other: &[DVec3]| -> f64 { one.iter().zip(other).map(|(a, b)| a.dot(*b)).sum() };
        let start = dot(&residual, &residual);
        let mut left = start;
        for _ in 0..10_000 {
            if left <= 1e-24 * start {
                break;
            }
            let mut image = self.times(&direction);
            hold(&mut image);
            let step = left / dot(&direction, &image);
            for slot in 0..displacement.len() {
                displacement[slot] += step * direction[slot];
                residual[slot] -= step * image[slot];
            }
            let next = dot(&residual, &residual);
            for (direction, residual) in direction.iter_mut().zip(&residual) {
                *direction = *residual + next / left * *direction;
            }
            left = next;
        }
        displacement
    }

    /// K u for springs of 1 N/m.
    fn times(&self, displacement: &[DVec3]) -> Vec<DVec3> {
        let mut image = vec![DVec3::ZERO; displacement.len()];
        for ([first, second], rest_length) in &self.springs {
            let along = (self.places[*second] - self.places[*first]) / *rest_length;
            let pull = along * (displacement[*second] - displacement[*first]).dot(along);
            image[*first] -= pull;
            image[*second] += pull;
        }
        image
    }
}
