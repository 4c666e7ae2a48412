//! The implicit schemes that TR-BDF2 was chosen from, in f64, for nets without damping.
//!
//! Each solves stages x = y + s² a(x) by [`backward_euler::stage`], and keeps the acceleration that a stage was solved for,
//! (x − y)/s², for the next: evaluated anew it would have the rounding of stiff springs.

use bevy::math::DVec3;

use crate::backward_euler;
use crate::net::{GRAVITY, Net};

/// A scheme.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Scheme {
    BackwardEuler,
    /// Bank et al. 1985, γ = 2 − √2.
    TrBdf2,
    /// Alexander 1977, γ = 1 − 1/√2.
    Sdirk2,
    /// The first step is of backward Euler.
    Bdf2,
    /// Chung and Hulbert 1993, by its ρ∞.
    GeneralisedAlpha(f64),
}

impl Scheme {
    pub const ALL: [Self; 6] = [
        Self::BackwardEuler,
        Self::TrBdf2,
        Self::Sdirk2,
        Self::Bdf2,
        Self::GeneralisedAlpha(0.0),
        Self::GeneralisedAlpha(0.5),
    ];

    pub fn name(self) -> String {
        match self {
            Self::BackwardEuler => "backward Euler".to_owned(),
            Self::TrBdf2 => "TR-BDF2".to_owned(),
            Self::Sdirk2 => "SDIRK2".to_owned(),
            Self::Bdf2 => "BDF2".to_owned(),
            Self::GeneralisedAlpha(radius) => format!("generalised-α, ρ∞ = {radius}"),
        }
    }

    /// Systems of equations that a step solves.
    pub fn stages(self) -> usize {
        if matches!(self, Self::TrBdf2 | Self::Sdirk2) { 2 } else { 1 }
    }

    /// What a step needs to know besides positions and velocities.
    pub fn memory(self) -> &'static str {
        match self {
            Self::BackwardEuler | Self::Sdirk2 => "",
            Self::TrBdf2 => "the last pull of each spring, which the positions give, too",
            Self::Bdf2 => "the state of the step before",
            Self::GeneralisedAlpha(_) => "its own accelerations",
        }
    }
}

/// A motion by one of them.
pub struct Motion {
    pub net: Net,
    scheme: Scheme,
    acceleration: Vec<DVec3>,
    /// Positions and velocities of the step before.
    before: Option<[Vec<DVec3>; 2]>,
}

/// What a stage was solved for.
struct Solved {
    position: Vec<DVec3>,
    acceleration: Vec<DVec3>,
}

impl Motion {
    pub fn new(net: &Net, scheme: Scheme) -> Self {
        let mut acceleration = vec![DVec3::ZERO; net.position.len()];
        for (link, pull) in net.links.iter().zip(net.tensions(&net.position)) {
            let [first, second] = link.ends;
            acceleration[first] -= pull * net.inverse_mass[first];
            acceleration[second] += pull * net.inverse_mass[second];
        }
        for (acceleration, inverse) in acceleration.iter_mut().zip(&net.inverse_mass) {
            *acceleration += if *inverse > 0.0 { GRAVITY * DVec3::NEG_Y } else { DVec3::ZERO };
        }
        Self { net: net.clone(), scheme, acceleration, before: None }
    }

    /// Takes a step of `h` seconds.
    pub fn step(&mut self, h: f64) {
        let old = [self.net.position.clone(), self.net.velocity.clone()];
        match self.scheme {
            Scheme::BackwardEuler => self.end_implicitly(&old, h),
            Scheme::TrBdf2 => self.trapezium_and_bdf2(&old, h),
            Scheme::Sdirk2 => self.sdirk2(&old, h),
            Scheme::Bdf2 => match self.before.take() {
                Some(before) => {
                    let known = [0, 1].map(|of| combine([(4.0 / 3.0, &old[of]), (-1.0 / 3.0, &before[of])]));
                    self.end_implicitly(&known, 2.0 / 3.0 * h);
                }
                None => self.end_implicitly(&old, h),
            },
            Scheme::GeneralisedAlpha(radius) => self.generalised_alpha(&old, radius, h),
        }
        self.before = Some(old);
    }

    fn solve(&self, start: &[DVec3], s: f64) -> Solved {
        let position = backward_euler::stage(&self.net, start, s).position;
        let acceleration = position.iter().zip(start).zip(&self.net.inverse_mass);
        let acceleration = acceleration
            .map(|((x, y), inverse)| if *inverse > 0.0 { (x - y) / (s * s) } else { DVec3::ZERO })
            .collect();
        Solved { position, acceleration }
    }

    /// x' = X + s v', v' = V + s a(x').
    fn end_implicitly(&mut self, [x, v]: &[Vec<DVec3>; 2], s: f64) {
        let solved = self.solve(&combine([(1.0, x), (s, v)]), s);
        self.net.velocity = combine([(1.0, v), (s, &solved.acceleration)]);
        (self.net.position, self.acceleration) = (solved.position, solved.acceleration);
    }

    /// The trapezium rule up to γ h, from there BDF2.
    fn trapezium_and_bdf2(&mut self, [x, v]: &[Vec<DVec3>; 2], h: f64) {
        let gamma = 2.0 - 2.0_f64.sqrt();
        let s = 0.5 * gamma * h;
        let a = &self.acceleration;
        let middle = self.solve(&combine([(1.0, x), (2.0 * s, v), (s * s, a)]), s);
        let velocity = combine([(1.0, v), (s, a), (s, &middle.acceleration)]);
        let weight = 1.0 / (gamma * (2.0 - gamma));
        let x = combine([(weight, &middle.position), (1.0 - weight, x)]);
        let v = combine([(weight, &velocity), (1.0 - weight, v)]);
        self.end_implicitly(&[x, v], s);
    }

    fn sdirk2(&mut self, [x, v]: &[Vec<DVec3>; 2], h: f64) {
        let gamma = 1.0 - 0.5_f64.sqrt();
        let s = gamma * h;
        let first = self.solve(&combine([(1.0, x), (s, v)]), s);
        let velocity = combine([(1.0, v), (s, &first.acceleration)]);
        let x = combine([(1.0, x), (h - s, &velocity)]);
        let v = combine([(1.0, v), (h - s, &first.acceleration)]);
        self.end_implicitly(&[x, v], s);
    }

    /// (1 − α_m) a' + α_m a = F(z) at z = (1 − α_f) x' + α_f x, with Newmark's x' = x + h v + h² ((½ − β) a + β a').
    fn generalised_alpha(&mut self, [x, v]: &[Vec<DVec3>; 2], radius: f64, h: f64) {
        let (of_mass, of_force) = ((2.0 * radius - 1.0) / (radius + 1.0), radius / (radius + 1.0));
        let gamma = 0.5 - of_mass + of_force;
        let beta = 0.25 * (1.0 - of_mass + of_force).powi(2);
        let a = &self.acceleration;
        let known = h * h * (0.5 - beta - beta * of_mass / (1.0 - of_mass));
        let ahead = 1.0 - of_force;
        let start = combine([(1.0, x), (ahead * h, v), (ahead * known, a)]);
        let solved = self.solve(&start, h * (ahead * beta / (1.0 - of_mass)).sqrt());
        let share = 1.0 / (1.0 - of_mass);
        let next = combine([(share, &solved.acceleration), (-of_mass * share, a)]);
        self.net.position = combine([(1.0, x), (h, v), (h * h * (0.5 - beta), a), (h * h * beta, &next)]);
        self.net.velocity = combine([(1.0, v), (h * (1.0 - gamma), a), (h * gamma, &next)]);
        self.acceleration = next;
    }

    /// Kinetic, elastic and gravitational energy, J.
    pub fn energy(&self) -> f64 {
        let Net { position, velocity, inverse_mass, links, .. } = &self.net;
        let free = inverse_mass.iter().enumerate().filter(|(_, inverse)| **inverse > 0.0);
        let of_particles = free.map(|(slot, inverse)| {
            (0.5 * velocity[slot].length_squared() + GRAVITY * position[slot].y) / inverse
        });
        let of_links = links.iter().map(|link| {
            let elongation = position[link.ends[0]].distance(position[link.ends[1]]) - link.rest_length;
            0.5 * link.stiffness * elongation * elongation
        });
        of_particles.sum::<f64>() + of_links.sum::<f64>()
    }
}

/// A sum of vectors with factors.
fn combine<const N: usize>(terms: [(f64, &Vec<DVec3>); N]) -> Vec<DVec3> {
    (0..terms[0].1.len())
        .map(|slot| terms.iter().map(|(factor, vectors)| *factor * vectors[slot]).sum())
        .collect()
}
