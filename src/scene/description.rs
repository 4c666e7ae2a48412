//! What a scene file contains: its fields, units and defaults.

use bevy::asset::Asset;
use bevy::math::{DVec3, Vec3};
use bevy::reflect::TypePath;
use serde::{Deserialize, Serialize};

use crate::collider::CollisionSettings;
use crate::environment::Environment;
use crate::settings::{Integrator, SolverSettings, SubstepMode};

use super::colliders::SceneCollider;
use super::nets::SceneNet;

/// The content of a scene file: settings, particles, nets, springs, bends, planes and colliders.
///
/// Springs and bends refer to particles by their index: in the list, and beyond it among those of the nets, net after net,
/// each in its order.
///
/// [`from_ron`](Self::from_ron) and [`read`](Self::read) refuse bad values; a scene that was put
/// together in code is checked by [`validate`](Self::validate).
#[derive(Asset, TypePath, Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MassSpringScene {
    /// Gravity and viscosity. Optional in the file.
    #[serde(default)]
    pub environment: Environment,
    /// Time step, scheme and substeps. Optional in the file.
    #[serde(default)]
    pub solver: SceneSolver,
    /// Which collisions act, and how particles rebound from each other. Optional in the file.
    #[serde(default)]
    pub collisions: CollisionSettings,
    /// The particles that belong to no net. Optional in the file.
    #[serde(default)]
    pub particles: Vec<SceneParticle>,
    /// The springs. Optional in the file.
    #[serde(default)]
    pub springs: Vec<SceneSpring>,
    /// The bends. Optional in the file.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub bends: Vec<SceneBend>,
    /// The nets. Optional in the file.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub nets: Vec<SceneNet>,
    /// The solid half-spaces. Optional in the file.
    #[serde(default)]
    pub planes: Vec<ScenePlane>,
    /// The colliders. Optional in the file.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub colliders: Vec<SceneCollider>,
}

/// The time step and how it is integrated.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename = "Solver", default, deny_unknown_fields)]
pub struct SceneSolver {
    /// One fixed tick in s, finite and > 0. Default 1/60.
    ///
    /// Bevy's clock counts whole nanoseconds: see [`tick`](Self::tick).
    pub time_step: f64,
    /// The integration scheme. Default [`Integrator::Auto`].
    pub integrator: Integrator,
    /// How many substeps a tick is divided into. Default [`SubstepMode::Auto`].
    pub substeps: SubstepMode,
}

impl Default for SceneSolver {
    fn default() -> Self {
        Self { time_step: 1.0 / 60.0, integrator: Integrator::Auto, substeps: SubstepMode::Auto }
    }
}

impl From<SceneSolver> for SolverSettings {
    fn from(scene: SceneSolver) -> Self {
        Self { integrator: scene.integrator, substeps: scene.substeps }
    }
}

/// One particle.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename = "Particle", deny_unknown_fields)]
pub struct SceneParticle {
    /// Position in m, finite.
    pub position: Vec3,
    /// Velocity in m/s, finite. Default 0.
    #[serde(default)]
    pub velocity: Vec3,
    /// Mass in kg, finite and > 0.
    pub mass: f32,
    /// Radius in m of the sphere that collides, finite and >= 0. Default 0: it collides with colliders only.
    #[serde(default)]
    pub radius: f32,
    /// Whether it has infinite mass. Default false.
    #[serde(default)]
    pub pinned: bool,
}

/// One spring.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename = "Spring", deny_unknown_fields)]
pub struct SceneSpring {
    /// The two ends: different indices into [`MassSpringScene::particles`], or beyond them into those of the nets.
    pub particles: (usize, usize),
    /// The length in m at which it exerts no force, finite and >= 0. Omitted: the initial distance of
    /// the two ends.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rest_length: Option<f32>,
    /// Stiffness in N/m, finite and >= 0.
    pub stiffness: f32,
    /// Damping along the spring in N·s/m, finite and >= 0. Default 0.
    #[serde(default)]
    pub damping: f32,
    /// Whether it only pulls, as a cable does. Default false.
    #[serde(default, skip_serializing_if = "is_false")]
    pub tension_only: bool,
    /// The strain limit, finite and >= 0: never longer than (1 + this) rest lengths. Default none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max_stretch: Option<f32>,
    /// The tension in N beyond which it breaks, finite and >= 0. Default none: it never does.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub breaking_force: Option<f32>,
}

/// One bend: the energy ½ k ‖x_a − 2 x_b + x_c‖².
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename = "Bend", deny_unknown_fields)]
pub struct SceneBend {
    /// a, b and c: different indices, as of the ends of springs. It resists the bend at b.
    pub particles: (usize, usize, usize),
    /// Stiffness k in N/m, finite and >= 0.
    pub stiffness: f32,
    /// Damping in N·s/m, finite and >= 0. Default 0.
    #[serde(default)]
    pub damping: f32,
}

fn is_false(value: &bool) -> bool {
    !value
}

/// One solid half-space.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename = "Plane", deny_unknown_fields)]
pub struct ScenePlane {
    /// A point of its surface in m, finite. Default 0.
    #[serde(default)]
    pub point: Vec3,
    /// The direction out of the solid, finite and not zero; of any length.
    pub normal: Vec3,
    /// Coefficient of restitution, 0 to 1. Default 0.
    #[serde(default)]
    pub restitution: f32,
    /// Coefficient of Coulomb friction, finite and >= 0. Default 0.
    #[serde(default)]
    pub friction: f32,
}

impl ScenePlane {
    /// The normal at length 1; `None` if it is zero or not finite.
    ///
    /// In f64, where no f32 vector is too short or too long to be normalised.
    pub fn unit_normal(&self) -> Option<DVec3> {
        self.normal.as_dvec3().try_normalize()
    }
}
