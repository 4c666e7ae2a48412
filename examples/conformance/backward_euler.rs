//! One step of backward Euler in f64, to the last digits: what an implicit scheme is to find; and the equation of
//! any other implicit stage, which differs from it in its start only.
//!
//! Newton's method on the potential Σ ½ m/h² ‖x' − y‖² + Σ ½ k (l(x') − l0)² with y = x + h v + h² g, by
//! conjugate gradients that stop where the curvature is negative, and a line search. No damping.

use bevy::math::{DMat3, DVec3};

use crate::net::{GRAVITY, Net, root_mean_square};
use crate::reference::Reference;

/// Maximum number of Newton steps.
const MAX_STEPS: usize = 200;

/// Where `net` is after one step of `h` seconds; the uncertainty is the last Newton step.
pub fn step(net: &Net, h: f64) -> Reference {
    let start = |slot: usize| net.position[slot] + h * net.velocity[slot];
    stage(net, &(0..net.position.len()).map(start).collect::<Vec<_>>(), h)
}

/// The solution of x' = `start` + h² a(x'); pinned particles stay where `net` has them.
pub fn stage(net: &Net, start: &[DVec3], h: f64) -> Reference {
    let problem = Problem::of(net, start, h);
    let mut x: Vec<DVec3> = problem.flight.clone();
    let (mut uncertainty, mut steps) = (f64::INFINITY, 0);
    // 1e-10 m: what rounding leaves of a metre after a solution of condition 1e4.
    while uncertainty > 1e-10 && steps < MAX_STEPS {
        let descent = problem.newton_step(&x);
        let potential = problem.potential(&x);
        let ahead = |share: f64| -> Vec<DVec3> {
            x.iter().zip(&descent).map(|(x, descent)| *x + share * *descent).collect()
        };
        let mut share = 1.0;
        let mut next = ahead(share);
        while problem.potential(&next) > potential + 1e-13 * potential.abs() && share > 1e-6 {
            share *= 0.5;
            next = ahead(share);
        }
        uncertainty = root_mean_square(&next, &x);
        x = next;
        steps += 1;
    }
    Reference { position: x, uncertainty, steps }
}

struct Problem<'a> {
    net: &'a Net,
    /// y, m
    flight: Vec<DVec3>,
    /// m/h², N/m; 0: pinned
    inertia: Vec<f64>,
}

/// The second derivatives of the potential.
struct Hessian<'a> {
    net: &'a Net,
    links: Vec<DMat3>,
    inertia: &'a [f64],
    /// The inverses of the diagonal blocks; 0: pinned.
    preconditioner: Vec<DMat3>,
}

impl<'a> Problem<'a> {
    fn of(net: &'a Net, start: &[DVec3], h: f64) -> Self {
        let fly = |slot: usize| match net.inverse_mass[slot] {
            0.0 => net.position[slot],
            _ => start[slot] + h * h * GRAVITY * DVec3::NEG_Y,
        };
        let inertia = |inverse: &f64| if *inverse == 0.0 { 0.0 } else { 1.0 / (inverse * h * h) };
        Self {
            net,
            flight: (0..net.position.len()).map(fly).collect(),
            inertia: net.inverse_mass.iter().map(inertia).collect(),
        }
    }

    fn potential(&self, x: &[DVec3]) -> f64 {
        let inertia = x.iter().zip(&self.flight).zip(&self.inertia);
        let springs = self.net.links.iter().map(|link| {
            let elongation = x[link.ends[0]].distance(x[link.ends[1]]) - link.rest_length;
            0.5 * link.stiffness * elongation * elongation
        });
        inertia.map(|((x, flight), inertia)| 0.5 * inertia * x.distance_squared(*flight)).sum::<f64>()
            + springs.sum::<f64>()
    }

    fn downhill(&self, x: &[DVec3]) -> Vec<DVec3> {
        let mut downhill: Vec<DVec3> =
            (0..x.len()).map(|slot| self.inertia[slot] * (self.flight[slot] - x[slot])).collect();
        for (link, pull) in self.net.links.iter().zip(self.net.tensions(x)) {
            downhill[link.ends[0]] -= pull;
            downhill[link.ends[1]] += pull;
        }
        for (downhill, inertia) in downhill.iter_mut().zip(&self.inertia) {
            if *inertia == 0.0 {
                *downhill = DVec3::ZERO;
            }
        }
        downhill
    }

    fn hessian(&self, x: &[DVec3]) -> Hessian<'_> {
        let mut diagonal: Vec<DMat3> =
            self.inertia.iter().map(|inertia| DMat3::from_diagonal(DVec3::splat(*inertia))).collect();
        let mut links = Vec::with_capacity(self.net.links.len());
        for link in &self.net.links {
            let [i, j] = link.ends;
            let separation = x[i] - x[j];
            let length = separation.length();
            let direction = separation / length;
            let along =
                DMat3::from_cols(direction * direction.x, direction * direction.y, direction * direction.z);
            let across = DMat3::IDENTITY - along;
            let slack = 1.0 - link.rest_length / length;
            links.push(link.stiffness * (along + slack * across));
            // The preconditioner must be positive definite where springs are compressed, too.
            let definite = link.stiffness * (along + slack.max(0.0) * across);
            diagonal[i] += definite;
            diagonal[j] += definite;
        }
        let invert = |(block, inertia): (&DMat3, &f64)| match *inertia {
            0.0 => DMat3::ZERO,
            _ => block.inverse(),
        };
        let preconditioner = diagonal.iter().zip(&self.inertia).map(invert).collect();
        Hessian { net: self.net, links, inertia: &self.inertia, preconditioner }
    }

    /// Preconditioned conjugate gradients.
    fn newton_step(&self, x: &[DVec3]) -> Vec<DVec3> {
        let hessian = self.hessian(x);
        let mut residual = self.downhill(x);
        let mut step = vec![DVec3::ZERO; x.len()];
        let mut conditioned = hessian.precondition(&residual);
        let mut direction = conditioned.clone();
        let mut progress = dot(&residual, &conditioned);
        let enough = 1e-20 * progress;
        for iteration in 0..20_000 {
            if progress <= enough {
                break;
            }
            let image = hessian.times(&direction);
            let curvature = dot(&direction, &image);
            if curvature <= 0.0 {
                return if iteration == 0 { direction } else { step };
            }
            let length = progress / curvature;
            for slot in 0..x.len() {
                step[slot] += length * direction[slot];
                residual[slot] -= length * image[slot];
            }
            conditioned = hessian.precondition(&residual);
            let next = dot(&residual, &conditioned);
            for slot in 0..x.len() {
                direction[slot] = conditioned[slot] + next / progress * direction[slot];
            }
            progress = next;
        }
        step
    }
}

impl Hessian<'_> {
    fn times(&self, vector: &[DVec3]) -> Vec<DVec3> {
        let mut image: Vec<DVec3> =
            vector.iter().zip(self.inertia).map(|(vector, inertia)| *inertia * *vector).collect();
        for (link, block) in self.net.links.iter().zip(&self.links) {
            let [i, j] = link.ends;
            let pull = *block * (vector[i] - vector[j]);
            image[i] += pull;
            image[j] -= pull;
        }
        for (image, inertia) in image.iter_mut().zip(self.inertia) {
            if *inertia == 0.0 {
                *image = DVec3::ZERO;
            }
        }
        image
    }

    fn precondition(&self, residual: &[DVec3]) -> Vec<DVec3> {
        residual.iter().zip(&self.preconditioner).map(|(residual, inverse)| *inverse * *residual).collect()
    }
}

fn dot(first: &[DVec3], second: &[DVec3]) -> f64 {
    first.iter().zip(second).map(|(first, second)| first.dot(*second)).sum()
}
