//! The scenes of the lab's questions. Each is put together as scene files are, particle by particle.

use bevy::prelude::*;
use bevy_mass_spring::prelude::*;
use bevy_mass_spring::scene::{SceneParticle, ScenePlane, SceneSolver, SceneSpring};

/// A scene and the question that it answers.
pub struct Preset {
    /// What it is called.
    pub name: &'static str,
    /// What to look at.
    pub question: &'static str,
    /// Puts it together.
    pub build: fn() -> MassSpringScene,
}

/// The place of the chain in [`ALL`].
pub const CHAIN: usize = 2;

/// All presets, in the order of the lab.
pub const ALL: [Preset; 6] = [
    Preset {
        name: "Free fall",
        question: "The lab's scheme is exact for constant acceleration: compare others, and viscosity (v).",
        build: free_fall,
    },
    Preset {
        name: "One spring",
        question: "A mass on a spring: watch elastic, kinetic and gravitational energy change places.",
        build: one_spring,
    },
    Preset {
        name: "Chain",
        question: "The upper springs carry the most: see the tension. Drag the red ball, or any other.",
        build: chain_file,
    },
    Preset {
        name: "Viscosity or damping",
        question: "Left no damper, right a strong one: it stops the stretching, not the swinging. \
                   The viscosity of the medium (v) stops both.",
        build: viscosity_or_damping,
    },
    Preset {
        name: "Bounce",
        question: "Each peak is the one before times the restitution squared: 0.64 with 0.8.",
        build: bounce,
    },
    Preset {
        name: "Two masses",
        question: "1 kg meets 4 kg without gravity: the light one is thrown back, momentum is kept.",
        build: two_masses,
    },
];

/// The chain that the example starts with, as shipped.
pub fn chain_file() -> MassSpringScene {
    let text = include_str!("../../../assets/scenes/chain.scene.ron");
    MassSpringScene::from_ron(text).expect("the shipped scene is valid")
}

/// What can be changed about the chain as a whole.
#[derive(Resource, Debug, Clone, Copy, PartialEq)]
pub struct ChainPlan {
    /// The number of particles, the fixed one included.
    pub particles: usize,
    /// The velocity with which all free particles start, m/s.
    pub velocity: Vec3,
    /// The turn around the vertical through the fixed particle with which they start, rad/s.
    pub spin: f32,
}

impl Default for ChainPlan {
    fn default() -> Self {
        Self { particles: chain_file().particles.len(), velocity: Vec3::ZERO, spin: 0.0 }
    }
}

impl ChainPlan {
    /// The chain of this plan, with particles like `particle` and springs like `spring`.
    pub fn build(&self, particle: Particle, spring: Spring) -> MassSpringScene {
        const MIN_HEIGHT: f32 = 0.3;
        let mut scene = chain_file();
        let (first, second) = (scene.particles[0], scene.particles[1]);
        let length = spring.rest_length * (self.particles - 1) as f32;
        // As slanted as the shipped chain, but no lower than above the ground.
        let slope = -(second.position - first.position).normalize().y;
        let drop = (slope * length).min(first.position.y - MIN_HEIGHT);
        let across = (length * length - drop * drop).max(0.0).sqrt();
        let (end, anchor) = (Vec3::new(across, -drop, 0.0), first.position);
        let share = |index: usize| index as f32 / (self.particles - 1) as f32;
        scene.particles = (0..self.particles)
            .map(|index| {
                let arm = end * share(index);
                let velocity = if index == 0 { Vec3::ZERO } else { self.velocity_at(arm) };
                let Particle { mass, radius } = particle;
                SceneParticle { position: anchor + arm, velocity, mass, radius, pinned: index == 0 }
            })
            .collect();
        let Spring { rest_length, stiffness, damping, .. } = spring;
        scene.springs = (1..self.particles)
            .map(|index| link(index - 1, index, rest_length, stiffness, damping))
            .collect();
        scene
    }

    /// The velocity at `arm` from the fixed particle: that of all, and that of the turn.
    pub fn velocity_at(&self, arm: Vec3) -> Vec3 {
        self.velocity + self.spin * Vec3::Y.cross(arm)
    }
}

fn ball(position: [f32; 3], mass: f32, radius: f32) -> SceneParticle {
    SceneParticle { position: position.into(), velocity: Vec3::ZERO, mass, radius, pinned: false }
}

fn pinned(position: [f32; 3], radius: f32) -> SceneParticle {
    SceneParticle { pinned: true, ..ball(position, 1.0, radius) }
}

fn link(first: usize, second: usize, rest_length: f32, stiffness: f32, damping: f32) -> SceneSpring {
    SceneSpring {
        particles: (first, second),
        rest_length: Some(rest_length),
        stiffness,
        damping,
        tension_only: false,
        max_stretch: None,
        breaking_force: None,
    }
}

fn ground(restitution: f32) -> Vec<ScenePlane> {
    vec![ScenePlane { point: Vec3::ZERO, normal: Vec3::Y, restitution, friction: 0.0 }]
}

/// A medium whose viscosity is switched off at the start.
fn medium(viscosity: f32) -> Environment {
    Environment { viscosity, viscosity_enabled: false, ..default() }
}

fn free_fall() -> MassSpringScene {
    let solver = SceneSolver {
        integrator: Integrator::SecondOrderTaylor,
        substeps: SubstepMode::Fixed(1),
        ..default()
    };
    MassSpringScene {
        environment: medium(1.0),
        solver,
        particles: vec![ball([-0.4, 3.0, 0.0], 1.0, 0.12), ball([0.4, 3.0, 0.0], 4.0, 0.19)],
        planes: ground(0.0),
        ..default()
    }
}

fn one_spring() -> MassSpringScene {
    MassSpringScene {
        environment: medium(0.2),
        particles: vec![pinned([0.0, 2.6, 0.0], 0.08), ball([0.0, 1.35, 0.0], 1.0, 0.15)],
        springs: vec![link(0, 1, 0.8, 60.0, 0.2)],
        planes: ground(0.5),
        ..default()
    }
}

fn viscosity_or_damping() -> MassSpringScene {
    let pendulum = |x: f32| [pinned([x, 2.6, 0.0], 0.07), ball([x + 0.55, 1.5, 0.0], 1.0, 0.13)];
    MassSpringScene {
        environment: medium(0.8),
        particles: [pendulum(-1.1), pendulum(0.7)].concat(),
        springs: vec![link(0, 1, 0.9, 80.0, 0.0), link(2, 3, 0.9, 80.0, 12.0)],
        planes: ground(0.5),
        ..default()
    }
}

fn bounce() -> MassSpringScene {
    let drop = |index: usize| {
        let height = 0.7 + 0.45 * index as f32;
        ball([0.5 * (index as f32 - 2.0), height, 0.0], 1.0, 0.12)
    };
    MassSpringScene {
        environment: medium(0.3),
        collisions: CollisionSettings { restitution: 0.8, ..default() },
        particles: (0..5).map(drop).collect(),
        planes: ground(0.8),
        ..default()
    }
}

fn two_masses() -> MassSpringScene {
    let light = SceneParticle { velocity: Vec3::new(1.5, 0.0, 0.0), ..ball([-1.5, 1.0, 0.0], 1.0, 0.15) };
    let heavy = SceneParticle { velocity: Vec3::new(-0.5, 0.0, 0.0), ..ball([1.0, 1.0, 0.0], 4.0, 0.24) };
    MassSpringScene {
        environment: Environment { gravity: Vec3::ZERO, ..medium(0.5) },
        collisions: CollisionSettings { restitution: 1.0, ..default() },
        particles: vec![light, heavy],
        planes: ground(0.5),
        ..default()
    }
}
