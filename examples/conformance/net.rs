//! Nets of particles and springs, from which both the solver's state and the f64 reference are made.

use bevy::math::{DVec3, Vec3};
use bevy_mass_spring::solver::{Collider, FrequencyBounds, Solver, Spring};

/// m/s², as the solver has it.
pub const GRAVITY: f64 = 9.81_f32 as f64;

/// The radius of a ball on the ground, which so is far below all others; m.
const BALL: f32 = 2.0;

/// A damped spring.
#[derive(Debug, Clone, Copy)]
pub struct Link {
    pub ends: [usize; 2],
    /// m
    pub rest_length: f64,
    /// N/m
    pub stiffness: f64,
    /// N·s/m
    pub damping: f64,
}

/// Particles and springs. Every value is one that f32 holds exactly, so that solver and reference begin
/// with the same.
#[derive(Debug, Clone, Default)]
pub struct Net {
    /// m
    pub position: Vec<DVec3>,
    /// m/s
    pub velocity: Vec<DVec3>,
    /// kg; infinite: pinned
    mass: Vec<f32>,
    /// 1/kg, as the solver computes it; 0: pinned
    pub inverse_mass: Vec<f64>,
    pub links: Vec<Link>,
    /// Of the medium, N·s/m
    pub viscosity: f64,
    /// A ball of [`BALL`] that slides on level, frictionless ground; all others are points.
    pub on_ground: Option<usize>,
}

impl Net {
    /// A strand of `links` springs, each `length` long, from a pinned particle at the origin along
    /// `direction`; the stiffness depends on the number of the link.
    pub fn strand(
        links: usize,
        length: f64,
        direction: DVec3,
        mass: f64,
        stiffness: impl Fn(usize) -> f64,
        damping: f64,
    ) -> Self {
        let mut net = Self::default();
        for number in 0..=links {
            net.add_particle(direction * length * number as f64, mass);
        }
        net.set_mass(0, f64::INFINITY);
        for link in 0..links {
            net.add_link([link, link + 1], length, stiffness(link), damping);
        }
        net
    }

    /// A horizontal sheet of `side`² particles 0.1 m apart, pinned at two corners, with structural and
    /// shear springs; springs that skip one particle make it stiff against bending.
    pub fn sheet(side: usize, mass: f64, stiffness: f64, damping: f64, skip: bool) -> Self {
        let mut net = Self::default();
        for slot in 0..side * side {
            net.add_particle(DVec3::new((slot % side) as f64, 0.0, (slot / side) as f64) * 0.1, mass);
        }
        net.set_mass(0, f64::INFINITY);
        net.set_mass(side - 1, f64::INFINITY);
        let offsets: [(isize, usize); 6] = [(1, 0), (0, 1), (1, 1), (-1, 1), (2, 0), (0, 2)];
        for (columns, rows) in offsets.into_iter().take(if skip { 6 } else { 4 }) {
            let length = 0.1 * f64::hypot(columns as f64, rows as f64);
            for slot in 0..side * side {
                let (column, row) = ((slot % side) as isize + columns, slot / side + rows);
                if (0..side as isize).contains(&column) && row < side {
                    net.add_link([slot, row * side + column as usize], length, stiffness, damping);
                }
            }
        }
        net
    }

    /// Adds a rope of `links` undamped springs, each as long as `link` and along it, from `top`: a particle that exists, or a new,
    /// pinned one at this place.
    pub fn add_rope(
        &mut self,
        end: Option<usize>,
        top: DVec3,
        link: DVec3,
        links: usize,
        mass: f64,
        stiffness: f64,
    ) {
        let mut last = end.unwrap_or_else(|| {
            self.add_particle(top, f64::INFINITY);
            self.position.len() - 1
        });
        for number in 1..=links {
            self.add_particle(top + link * number as f64, mass);
            let next = self.position.len() - 1;
            self.add_link([last, next], link.length(), stiffness, 0.0);
            last = next;
        }
    }

    fn add_particle(&mut self, position: DVec3, mass: f64) {
        self.position.push(position.as_vec3().as_dvec3());
        self.velocity.push(DVec3::ZERO);
        self.mass.push(0.0);
        self.inverse_mass.push(0.0);
        self.set_mass(self.mass.len() - 1, mass);
    }

    fn add_link(&mut self, ends: [usize; 2], rest_length: f64, stiffness: f64, damping: f64) {
        let [rest_length, stiffness, damping] = [rest_length, stiffness, damping].map(rounded);
        self.links.push(Link { ends, rest_length, stiffness, damping });
    }

    /// Replaces the mass of a particle: kg, or infinite.
    pub fn set_mass(&mut self, slot: usize, mass: f64) {
        self.mass[slot] = mass as f32;
        self.inverse_mass[slot] = f64::from(1.0 / self.mass[slot]);
    }

    /// The weight of all free particles, N.
    pub fn weight(&self) -> f64 {
        self.inverse_mass.iter().filter(|inverse| **inverse > 0.0).map(|inverse| GRAVITY / inverse).sum()
    }

    /// The same net as the solver has it.
    pub fn solver(&self) -> Solver {
        let mut solver = Solver::default();
        for slot in 0..self.position.len() {
            let (position, velocity) = (self.position[slot].as_vec3(), self.velocity[slot].as_vec3());
            let radius = if self.on_ground == Some(slot) { BALL } else { 0.0 };
            solver.add_particle(position, velocity, self.mass[slot], radius).expect("masses are > 0");
        }
        for link in &self.links {
            let [rest_length, stiffness, damping] =
                [link.rest_length, link.stiffness, link.damping].map(|value| value as f32);
            let spring = Spring { rest_length, stiffness, damping, ..Spring::default() };
            solver.add_spring(link.ends, spring).expect("links join different particles");
        }
        if let Some(slot) = self.on_ground {
            let ground = Vec3::Y * (self.position[slot].as_vec3() - BALL);
            solver.add_collider(Collider::half_space(ground, Vec3::Y, 0.0, 0.0));
        }
        solver
    }

    /// What limits the substeps of this net.
    pub fn frequency_bounds(&self) -> FrequencyBounds {
        self.solver().frequency_bounds(self.viscosity as f32)
    }

    /// Continues from the positions and velocities of `solver`.
    pub fn take(&mut self, solver: &Solver) {
        for slot in 0..self.position.len() {
            self.position[slot] = solver.position(slot).as_dvec3();
            self.velocity[slot] = solver.velocity(slot).as_dvec3();
        }
    }

    /// The pull of each link, N.
    pub fn tensions(&self, position: &[DVec3]) -> Vec<DVec3> {
        let pull = |link: &Link| {
            let separation = position[link.ends[0]] - position[link.ends[1]];
            link.stiffness * (separation.length() - link.rest_length) * separation.normalize()
        };
        self.links.iter().map(pull).collect()
    }
}

/// The nearest f32.
fn rounded(value: f64) -> f64 {
    f64::from(value as f32)
}

/// Downwards, as the solver takes it.
pub fn gravity() -> Vec3 {
    Vec3::NEG_Y * GRAVITY as f32
}

/// The root of the mean square distance of two sets of points, m.
pub fn root_mean_square(first: &[DVec3], second: &[DVec3]) -> f64 {
    let sum: f64 = first.iter().zip(second).map(|(first, second)| first.distance_squared(*second)).sum();
    (sum / first.len() as f64).sqrt()
}
