//! The physics once more, in f64 and as the textbook writes it: what the solver is compared with.
//!
//! It shares no code with the crate. Every scheme is its recurrence, line by line; a particle with a
//! prescribed velocity is one whose acceleration is zero.

use bevy::math::DVec3;
use bevy_mass_spring::solver::{Integrator, Solver};

use super::backward_euler;

/// A damped spring between two particles.
#[derive(Debug, Clone, Copy)]
pub struct ReferenceSpring {
    pub ends: [usize; 2],
    pub rest_length: f64,
    pub stiffness: f64,
    pub damping: f64,
}

/// Particles and springs in f64.
#[derive(Debug, Clone, Default)]
pub struct Reference {
    pub position: Vec<DVec3>,
    pub velocity: Vec<DVec3>,
    /// 0 for a pinned particle.
    pub inverse_mass: Vec<f64>,
    pub force: Vec<DVec3>,
    pub springs: Vec<ReferenceSpring>,
    pub gravity: DVec3,
    pub viscosity: f64,
    /// The acceleration of the next step of velocity Verlet or TR-BDF2: that of the end of the one before.
    pub carried_acceleration: Option<Vec<DVec3>>,
}

impl Reference {
    /// The solver's state as it is now, without gravity and viscosity.
    pub fn of(state: &Solver) -> Self {
        let slots = 0..state.particle_count();
        Self {
            position: slots.clone().map(|slot| state.position(slot).as_dvec3()).collect(),
            velocity: slots.clone().map(|slot| state.velocity(slot).as_dvec3()).collect(),
            force: slots.clone().map(|slot| state.applied_force(slot).as_dvec3()).collect(),
            inverse_mass: slots.map(|slot| state.inverse_mass(slot).into()).collect(),
            springs: (0..state.spring_count())
                .map(|number| {
                    let (ends, spring) = state.spring(number);
                    ReferenceSpring {
                        ends,
                        rest_length: spring.rest_length.into(),
                        stiffness: spring.stiffness.into(),
                        damping: spring.damping.into(),
                    }
                })
                .collect(),
            ..Self::default()
        }
    }

    /// Accelerations at positions `x` and velocities `v`: lab.md, section 2.
    pub fn acceleration(&self, x: &[DVec3], v: &[DVec3]) -> Vec<DVec3> {
        let mut force = self.force.clone();
        for (force, velocity) in force.iter_mut().zip(v) {
            *force -= self.viscosity * *velocity;
        }
        for spring in &self.springs {
            let [i, j] = spring.ends;
            let separation = x[i] - x[j];
            if separation == DVec3::ZERO {
                continue;
            }
            let direction = separation.normalize();
            let pull = spring.stiffness * (separation.length() - spring.rest_length)
                + spring.damping * (v[i] - v[j]).dot(direction);
            force[i] -= pull * direction;
            force[j] += pull * direction;
        }
        let newton = |(force, inverse): (&DVec3, &f64)| match *inverse {
            0.0 => DVec3::ZERO,
            inverse => *force * inverse + self.gravity,
        };
        force.iter().zip(&self.inverse_mass).map(newton).collect()
    }

    /// One step of `h` seconds.
    pub fn step(&mut self, scheme: Integrator, h: f64) {
        let (x, v) = (self.position.clone(), self.velocity.clone());
        let a = self.acceleration(&x, &v);
        match scheme {
            Integrator::ExplicitEuler => {
                self.position = sum(&x, h, &v);
                self.velocity = sum(&v, h, &a);
            }
            Integrator::SemiImplicitEuler => {
                self.velocity = sum(&v, h, &a);
                self.position = sum(&x, h, &self.velocity);
            }
            Integrator::SecondOrderTaylor => {
                self.position = sum(&sum(&x, h, &v), h * h / 2.0, &a);
                self.velocity = sum(&v, h, &a);
            }
            Integrator::VelocityVerlet => {
                let a = self.carried_acceleration.take().unwrap_or(a);
                self.position = sum(&sum(&x, h, &v), h * h / 2.0, &a);
                let new_a = self.acceleration(&self.position, &sum(&v, h, &a));
                self.velocity = sum(&sum(&v, h / 2.0, &a), h / 2.0, &new_a);
                self.carried_acceleration = Some(new_a);
            }
            Integrator::RungeKutta4 => {
                let (v1, a1) = (&v, &a);
                let v2 = &sum(&v, h / 2.0, a1);
                let a2 = &self.acceleration(&sum(&x, h / 2.0, v1), v2);
                let v3 = &sum(&v, h / 2.0, a2);
                let a3 = &self.acceleration(&sum(&x, h / 2.0, v2), v3);
                let v4 = &sum(&v, h, a3);
                let a4 = &self.acceleration(&sum(&x, h, v3), v4);
                let mean = |k1: &[DVec3], k2: &[DVec3], k3: &[DVec3], k4: &[DVec3]| {
                    sum(&sum(&sum(k1, 2.0, k2), 2.0, k3), 1.0, k4)
                };
                self.position = sum(&x, h / 6.0, &mean(v1, v2, v3, v4));
                self.velocity = sum(&v, h / 6.0, &mean(a1, a2, a3, a4));
            }
            Integrator::Xpbd => self.project_positions(h),
            Integrator::ImplicitEuler => {
                self.position = backward_euler::solve(self, &self.lengths(&x), h);
                self.velocity = sum(&self.position, -1.0, &x).iter().map(|moved| *moved / h).collect();
            }
            Integrator::TrBdf2 => {
                let a = self.carried_acceleration.take().unwrap_or(a);
                self.trapezoid_and_difference(&a, h);
            }
            other => unimplemented!("{other} has no recurrence"),
        }
    }
}

impl Reference {
    /// The length of each spring.
    fn lengths(&self, x: &[DVec3]) -> Vec<f64> {
        self.springs.iter().map(|spring| x[spring.ends[0]].distance(x[spring.ends[1]])).collect()
    }

    /// TR-BDF2 with γ = 2 − √2 (Hosea and Shampine 1996). The rates of the dampers' lengths follow from the lengths by
    /// the formulas by which velocities follow from positions.
    fn trapezoid_and_difference(&mut self, a: &[DVec3], h: f64) {
        let gamma = 2.0 - 2.0_f64.sqrt();
        let s = gamma * h / 2.0;
        let (x, v) = (self.position.clone(), self.velocity.clone());
        let rate = |spring: &ReferenceSpring| {
            let [i, j] = spring.ends;
            (v[i] - v[j]).dot((x[i] - x[j]).normalize())
        };
        let start_lengths = self.lengths(&x);
        let lengths: Vec<f64> = start_lengths
            .iter()
            .zip(&self.springs)
            .map(|(length, spring)| length + s * rate(spring))
            .collect();
        let velocity_after = |start: &[DVec3], end: &[DVec3]| -> Vec<DVec3> {
            start.iter().zip(end).map(|(start, end)| (*end - *start) / s).collect()
        };
        self.position = sum(&x, s, &v);
        self.velocity = sum(&v, s, a);
        let middle = backward_euler::solve(self, &lengths, s);
        let middle_velocity = velocity_after(&self.position, &middle);
        let weight = (1.0 - gamma).powi(2) / (gamma * (2.0 - gamma));
        let ahead = |middle: &[DVec3], start: &[DVec3]| -> Vec<DVec3> {
            middle
                .iter()
                .zip(start)
                .map(|(middle, start)| (1.0 + weight) * *middle - weight * *start)
                .collect()
        };
        let lengths: Vec<f64> = (self.lengths(&middle).iter().zip(&start_lengths))
            .map(|(middle, start)| (1.0 + weight) * middle - weight * start)
            .collect();
        self.position = ahead(&middle, &x);
        self.velocity = ahead(&middle_velocity, &v);
        let end = backward_euler::solve(self, &lengths, s);
        let velocity = velocity_after(&self.position, &end);
        self.carried_acceleration =
            Some(velocity.iter().zip(&self.velocity).map(|(new, old)| (*new - *old) / s).collect());
        (self.position, self.velocity) = (end, velocity);
    }

    /// One substep of XPBD, one round over the springs in their order (Macklin et al. 2016, algorithm 1
    /// with equation 26). The drag of the medium is implicit.
    fn project_positions(&mut self, h: f64) {
        let (start, old) = (self.position.clone(), self.velocity.clone());
        let mut x = start.clone();
        for i in 0..x.len() {
            let w = self.inverse_mass[i];
            let push = if w > 0.0 { self.gravity + w * self.force[i] } else { DVec3::ZERO };
            x[i] += h * (old[i] + h * push) / (1.0 + h * self.viscosity * w);
        }
        for spring in &self.springs {
            let [i, j] = spring.ends;
            let w = [self.inverse_mass[i], self.inverse_mass[j]];
            let d = (x[i] - x[j]).normalize();
            let (alpha, beta) = (1.0 / spring.stiffness / (h * h), h * h * spring.damping);
            let gamma = alpha * beta / h;
            let constraint = (x[i] - x[j]).length() - spring.rest_length;
            let drift = d.dot((x[i] - start[i]) - (x[j] - start[j]));
            let lambda = (-constraint - gamma * drift) / ((1.0 + gamma) * (w[0] + w[1]) + alpha);
            x[i] += w[0] * lambda * d;
            x[j] -= w[1] * lambda * d;
        }
        self.velocity = x.iter().zip(&start).map(|(new, old)| (*new - *old) / h).collect();
        self.position = x;
    }
}

/// `start` + `factor` · `slopes`.
fn sum(start: &[DVec3], factor: f64, slopes: &[DVec3]) -> Vec<DVec3> {
    start.iter().zip(slopes).map(|(start, slope)| *start + factor * *slope).collect()
}
