//! The scenes: ropes and cloths, the same numbers for every peer.

use std::hash::{DefaultHasher, Hash, Hasher};

use bevy::math::Vec3;

/// Duration of a tick in s. Sixty of them are the second after which positions are compared.
pub const TICK: f32 = 1.0 / 60.0;
/// Number of ticks in the second that is simulated.
pub const TICKS: usize = 60;
/// Acceleration of gravity, m/s².
pub const GRAVITY: Vec3 = Vec3::new(0.0, -9.81, 0.0);
/// Distance between neighbours at rest, m.
const SPACING: f32 = 0.1;

/// A net of equal particles and equal springs, at rest at the start and let go.
pub struct Scene {
    pub name: &'static str,
    /// Where the particles start, m.
    pub positions: Vec<Vec3>,
    /// The particles that do not move.
    pub pinned: Vec<usize>,
    /// The two ends of each spring.
    pub springs: Vec<[usize; 2]>,
    /// Mass of a particle, kg.
    pub mass: f32,
    /// Stiffness of a spring, N/m.
    pub stiffness: f32,
    /// Damping along a spring, N·s/m.
    pub damping: f32,
}

impl Scene {
    /// All scenes, in the order of the tables.
    pub fn all() -> Vec<Self> {
        vec![
            rope("rope of 100", 100),
            rope("rope of 1,000", 1_000),
            rope("rope of 10,000", 10_000),
            cloth("cloth of 32²", 32),
            cloth("cloth of 100²", 100),
        ]
    }

    /// The length at which a spring starts, and at which it exerts no force, m.
    pub fn rest_length(&self, [first, second]: [usize; 2]) -> f32 {
        self.positions[first].distance(self.positions[second])
    }

    /// 1/kg; 0 for what is pinned.
    pub fn inverse_mass(&self, particle: usize) -> f32 {
        if self.pinned.contains(&particle) { 0.0 } else { 1.0 / self.mass }
    }

    /// Changes with everything that decides on the motion.
    pub fn fingerprint(&self) -> u64 {
        let mut hasher = DefaultHasher::new();
        for position in &self.positions {
            position.to_array().map(f32::to_bits).hash(&mut hasher);
        }
        (&self.pinned, &self.springs).hash(&mut hasher);
        [self.mass, self.stiffness, self.damping, GRAVITY.y, TICK].map(f32::to_bits).hash(&mut hasher);
        hasher.finish()
    }
}

/// A rope along +X whose first particle is pinned.
fn rope(name: &'static str, count: usize) -> Scene {
    Scene {
        name,
        positions: (0..count).map(|number| Vec3::X * SPACING * number as f32).collect(),
        pinned: vec![0],
        springs: (1..count).map(|number| [number - 1, number]).collect(),
        mass: 1.0,
        stiffness: 1e4,
        damping: 1.0,
    }
}

/// A horizontal square cloth, two neighbouring corners pinned.
fn cloth(name: &'static str, side: usize) -> Scene {
    let mut springs = Vec::new();
    // Structural (to the right and below), shear (both diagonals), and over one's neighbour.
    for (columns, rows) in [(1, 0), (0, 1), (1, 1), (-1, 1), (2, 0), (0, 2)] {
        for particle in 0..side * side {
            let (column, row) = ((particle % side) as isize + columns, particle / side + rows);
            if (0..side as isize).contains(&column) && row < side {
                springs.push([particle, row * side + column as usize]);
            }
        }
    }
    let place =
        |particle: usize| Vec3::new((particle % side) as f32, 0.0, (particle / side) as f32) * SPACING;
    Scene {
        name,
        positions: (0..side * side).map(place).collect(),
        pinned: vec![0, side - 1],
        springs,
        mass: 0.01,
        stiffness: 1e3,
        damping: 1.0,
    }
}
