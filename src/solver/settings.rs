//! The parameters of a tick.

use bevy::math::Vec3;
use bevy::reflect::Reflect;
use bevy::reflect::prelude::ReflectDefault;

/// An integration scheme: how positions and velocities follow from accelerations.
///
/// In the formulas x is the position, v the velocity, a the acceleration and h the substep; a prime marks the new
/// value.
#[derive(Reflect, Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serialize", reflect(Serialize, Deserialize))]
#[reflect(Default, Debug, Clone, PartialEq, Hash)]
#[non_exhaustive]
pub enum Integrator {
    /// Stable for every stiffness, mass ratio and time step, at the least cost. Chosen at each tick, for each
    /// island (the particles that springs connect), from the springs and masses:
    /// [`VelocityVerlet`](Self::VelocityVerlet) with as many substeps as its stability bound asks for;
    /// [`SemiImplicitEuler`](Self::SemiImplicitEuler) where damped springs ask it for fewer;
    /// or [`TrBdf2`](Self::TrBdf2), where those would cost more than it does, or springs are so stiff for their masses
    /// (above 13,000 rad/s) that rounding would heat them. So a stiff rope takes nothing
    /// from the motion of a soft cloth beside it. Pinned particles connect nothing; particles without
    /// springs go with the explicit islands unless the medium stops them at once. Where nothing has springs, it is
    /// [`SemiImplicitEuler`](Self::SemiImplicitEuler) in vacuum, and [`TrBdf2`](Self::TrBdf2) in a medium, in which it
    /// is exact, and with dampers.
    #[default]
    Auto,
    /// Explicit (forward) Euler: x' = x + h v, v' = v + h a(x, v). First order; gains energy, and explodes if
    /// undamped.
    ExplicitEuler,
    /// Semi-implicit (symplectic) Euler: v' = v + h a(x, v), x' = x + h v'. First order; keeps energy within
    /// bounds.
    SemiImplicitEuler,
    /// x' = x + h v + h²/2 a, v' = v + h a. Exact for constant acceleration, first order otherwise.
    SecondOrderTaylor,
    /// x' = x + h v + h²/2 a, v' = v + h/2 (a + a'), a' = a(x', v + h a), which is the a of the next substep.
    /// Second order, symplectic without damping.
    VelocityVerlet,
    /// The classical Runge–Kutta method: four evaluations of the forces, fourth order.
    RungeKutta4,
    /// Backward Euler: v' = v + h a(x', v'), x' = x + h v', solved by Newton's method. First order; stable for
    /// every stiffness, mass ratio and time step, and dissipates what it does not resolve.
    ImplicitEuler,
    /// TR-BDF2: a step of the trapezoidal rule and one of the second backward difference formula, each solved for as
    /// in [`ImplicitEuler`](Self::ImplicitEuler). Second order; stable for every stiffness, mass ratio and time
    /// step. Slow motions of stiff nets keep their energy, what it does not resolve is dissipated. While particles
    /// of an island touch something, the island takes a step of backward Euler instead.
    TrBdf2,
    /// Extended position-based dynamics: each substep is one iteration over the springs. First order; stays finite,
    /// but stiff nets stretch and gain elastic energy unless substeps are many. [`Auto`](Self::Auto) never takes it.
    Xpbd,
}

#[cfg(feature = "serialize")]
use bevy::reflect::{ReflectDeserialize, ReflectSerialize};

impl Integrator {
    /// Every integrator, in the order of their declaration.
    pub const ALL: [Self; 9] = [
        Self::Auto,
        Self::ExplicitEuler,
        Self::SemiImplicitEuler,
        Self::SecondOrderTaylor,
        Self::VelocityVerlet,
        Self::RungeKutta4,
        Self::ImplicitEuler,
        Self::TrBdf2,
        Self::Xpbd,
    ];

    /// Whether its steps are solved for, for each island by itself.
    pub(super) fn is_implicit(self) -> bool {
        matches!(self, Self::ImplicitEuler | Self::TrBdf2)
    }

    /// Every integrator but [`Auto`](Self::Auto).
    pub fn named() -> impl Iterator<Item = Self> {
        Self::ALL.into_iter().skip(1)
    }

    /// How far, in substeps, the scheme's velocity lags behind its position.
    ///
    /// Under a constant acceleration, the Euler schemes place positions as if the velocity at the time
    /// of the position were v + lag · h a: they are leapfrogs with velocities of half a substep
    /// earlier (semi-implicit, implicit and position-based) or later (explicit). Impacts at exact speeds need
    /// this.
    pub(super) fn velocity_lag(self) -> f32 {
        match self {
            Self::SemiImplicitEuler | Self::ImplicitEuler | Self::Xpbd => 0.5,
            Self::ExplicitEuler => -0.5,
            Self::Auto
            | Self::SecondOrderTaylor
            | Self::VelocityVerlet
            | Self::RungeKutta4
            | Self::TrBdf2 => 0.0,
        }
    }

    /// How far a change of the velocity by a force displaces the particle in the same substep, in
    /// substeps: the share of h² a that a constant acceleration adds to the position.
    pub(super) fn displacement_share(self) -> f32 {
        0.5 + self.velocity_lag()
    }
}

impl std::fmt::Display for Integrator {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(formatter, "{self:?}")
    }
}

/// A name that belongs to no [`Integrator`].
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("no integrator is called {name:?}, expected one of {}", Integrator::ALL.map(|known| known.to_string()).join(", "))]
pub struct UnknownIntegrator {
    /// The name that was given.
    pub name: String,
}

impl std::str::FromStr for Integrator {
    type Err = UnknownIntegrator;

    fn from_str(name: &str) -> Result<Self, Self::Err> {
        Self::ALL
            .into_iter()
            .find(|integrator| integrator.to_string() == name)
            .ok_or_else(|| UnknownIntegrator { name: name.to_owned() })
    }
}

/// How many equal substeps a tick is divided into.
#[derive(Reflect, Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serialize", reflect(Serialize, Deserialize))]
#[reflect(Default, Debug, Clone, PartialEq, Hash)]
#[non_exhaustive]
pub enum SubstepMode {
    /// As many as the stability bound of the integrator asks for, and at least 4; of
    /// [`Integrator::TrBdf2`] 2; of [`Integrator::ImplicitEuler`] 4, or 2 where springs form loops; of
    /// [`Integrator::Xpbd`] 20.
    #[default]
    Auto,
    /// Exactly this many, >= 1; 0 counts as 1. (With [`Integrator::Auto`]: at least this many.)
    Fixed(u32),
}

impl SubstepMode {
    /// The number of substeps that are asked for at least.
    pub(super) fn minimum(self) -> u32 {
        match self {
            Self::Auto => 1,
            Self::Fixed(count) => count.max(1),
        }
    }
}

/// How particles collide with each other.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
pub struct PairRules {
    /// Coefficient of restitution, 0 to 1.
    pub restitution: f32,
    /// Coefficient of Coulomb friction, >= 0.
    pub friction: f32,
}

/// Gusts: a velocity that is added to the wind, smooth in place and time, carried along by the wind.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
pub struct Gusts {
    /// The greatest gust along each axis, m/s.
    pub strength: Vec3,
    /// The distance over which gusts differ, m, > 0.
    pub length: f32,
    /// The time in which a gust turns into another one for what drifts along, s, > 0.
    pub time: f32,
    /// Other seeds, other gusts.
    pub seed: u32,
}

/// When particles fall asleep: what rests costs nothing until something happens to it.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
pub struct Sleep {
    /// The speed that counts as rest, m/s, >= 0: over the delay a particle moves by less than a fifth of the way at it, and
    /// is never faster than ten times it. Default 0.001.
    pub speed: f32,
    /// For how long particles rest before they fall asleep, s, > 0. Default 0.5.
    pub delay: f32,
}

impl Default for Sleep {
    fn default() -> Self {
        Self { speed: 0.001, delay: 0.5 }
    }
}

/// The parameters of one tick.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
pub struct StepSettings {
    /// The integration scheme. Default [`Integrator::Auto`].
    pub integrator: Integrator,
    /// The number of its substeps. Default [`SubstepMode::Auto`].
    pub substeps: SubstepMode,
    /// Duration of the whole tick in s, > 0. Default 1/60.
    pub time_step: f32,
    /// Acceleration of gravity, m/s². Default 0.
    pub gravity: Vec3,
    /// Viscosity of the medium ν, N·s/m, >= 0. Default 0.
    pub viscosity: f32,
    /// Velocity of the air, m/s. Default 0.
    pub wind: Vec3,
    /// Density of the air, kg/m³, >= 0; 0: it acts on nothing. Default 0.
    pub air_density: f32,
    /// How the wind varies in place and time; `None`: it does not. Default `None`.
    pub gusts: Option<Gusts>,
    /// Whether particles collide with colliders. Default true.
    pub collide_with_colliders: bool,
    /// How particles collide with each other; `None`: not at all. Default `None`.
    pub pair_rules: Option<PairRules>,
    /// When particles fall asleep; `None`: never. Default `None`.
    pub sleep: Option<Sleep>,
    /// Whether springs that belong to no net collide along their length, as capsules that taper from the radius of one end
    /// to that of the other, where particles collide. Default false.
    pub collide_springs: bool,
    /// Whether all motion is in a plane of constant z: what is in one place parts within it. Default false.
    pub is_flat: bool,
}

impl Default for StepSettings {
    fn default() -> Self {
        Self {
            integrator: Integrator::Auto,
            substeps: SubstepMode::Auto,
            time_step: 1.0 / 60.0,
            gravity: Vec3::ZERO,
            viscosity: 0.0,
            wind: Vec3::ZERO,
            air_density: 0.0,
            gusts: None,
            collide_with_colliders: true,
            pair_rules: None,
            sleep: None,
            collide_springs: false,
            is_flat: false,
        }
    }
}
