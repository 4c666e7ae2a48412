//! Integration schemes, one a file: how positions and velocities follow from accelerations.
//!
//! In the formulas x is the position, v the velocity, a the acceleration and h the substep; a prime
//! marks the new value.

mod explicit_euler;
mod implicit_euler;
mod net;
mod runge_kutta_4;
mod second_order_taylor;
mod semi_implicit_euler;
mod velocity_verlet;
mod xpbd;

use bevy::math::DVec3;

use super::forces::Field;
use super::particles::{Particles, Vectors};
use super::{SolverState, StepSettings};

/// An integration scheme.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
pub enum Scheme {
    /// x' = x + h v, v' = v + h a(x, v).
    ExplicitEuler,
    /// v' = v + h a(x, v), x' = x + h v'.
    #[default]
    SemiImplicitEuler,
    /// x' = x + h v + h²/2 a, v' = v + h a.
    SecondOrderTaylor,
    /// x' = x + h v + h²/2 a, v' = v + h/2 (a + a'), a' = a(x', v + h a), which is the a of the next substep.
    VelocityVerlet,
    /// The classical fourth-order Runge–Kutta method.
    RungeKutta4,
    /// v' = v + h a(x', v'), x' = x + h v': backward Euler.
    ImplicitEuler,
    /// Extended position-based dynamics, one round over the springs in each substep.
    Xpbd,
}

impl Scheme {
    /// Every scheme.
    pub const ALL: [Self; 7] = [
        Self::ExplicitEuler,
        Self::SemiImplicitEuler,
        Self::SecondOrderTaylor,
        Self::VelocityVerlet,
        Self::RungeKutta4,
        Self::ImplicitEuler,
        Self::Xpbd,
    ];

    /// How far, in substeps, the scheme's velocity lags behind its position.
    ///
    /// Under a constant acceleration, the Euler schemes place positions as if the velocity at the time
    /// of the position were v + lag · h a: they are leapfrogs whose velocities live half a substep
    /// earlier (semi-implicit, implicit and position-based) or later (explicit). Impacts at exact speeds need
    /// this.
    pub fn velocity_lag(self) -> f32 {
        match self {
            Self::SemiImplicitEuler | Self::ImplicitEuler | Self::Xpbd => 0.5,
            Self::ExplicitEuler => -0.5,
            Self::SecondOrderTaylor | Self::VelocityVerlet | Self::RungeKutta4 => 0.0,
        }
    }

    /// How far a change of the velocity by a force displaces the particle in the same substep, in
    /// substeps: the share of h² a that a constant acceleration adds to the position.
    pub fn displacement_share(self) -> f32 {
        0.5 + self.velocity_lag()
    }
}

/// What schemes need besides the state, kept between ticks.
#[derive(Debug, Clone, Default)]
pub(super) struct Scratch {
    position: Vectors,
    velocity: Vectors,
    position_slope: Vectors,
    velocity_slope: Vectors,
    verlet: velocity_verlet::Carried,
    implicit_euler: implicit_euler::ImplicitEuler,
    xpbd: xpbd::Xpbd,
}

/// To be called before the first substep of a tick.
pub(super) fn begin_tick(state: &mut SolverState, settings: &StepSettings) {
    state.scratch.verlet = velocity_verlet::Carried::Nothing;
    if settings.scheme == Scheme::Xpbd {
        xpbd::begin_tick(state);
    }
}

/// To be called when something else than [`advance`] has moved particles within a tick.
pub(super) fn note_disturbance(state: &mut SolverState) {
    state.scratch.verlet.note_disturbance();
}

/// Advances positions and velocities by one substep of `substep` seconds.
pub(super) fn advance(state: &mut SolverState, settings: &StepSettings, substep: f32) {
    let field = Field { gravity: settings.gravity, viscosity: settings.viscosity };
    match settings.scheme {
        Scheme::ExplicitEuler => explicit_euler::advance(state, field, substep),
        Scheme::SemiImplicitEuler => semi_implicit_euler::advance(state, field, substep),
        Scheme::SecondOrderTaylor => second_order_taylor::advance(state, field, substep),
        Scheme::VelocityVerlet => velocity_verlet::advance(state, field, substep),
        Scheme::RungeKutta4 => runge_kutta_4::advance(state, field, substep),
        Scheme::ImplicitEuler => implicit_euler::advance(state, field, substep),
        Scheme::Xpbd => xpbd::advance(state, field, substep),
    }
}

/// The velocity of a free particle after `h` seconds without springs, in m/s:
/// (v + h (g + f/m)) / (1 + h ν/m).
fn free_velocity(particles: &Particles, slot: usize, field: Field, h: f64) -> DVec3 {
    let inverse_mass = f64::from(particles.inverse_mass[slot]);
    let force = particles.applied_force.get(slot).as_dvec3();
    let velocity = particles.velocity.get(slot).as_dvec3();
    (velocity + h * (field.gravity.as_dvec3() + inverse_mass * force))
        / (1.0 + h * f64::from(field.viscosity) * inverse_mass)
}

/// `values` += `factor` · `slopes`.
fn add_scaled(values: &mut Vectors, factor: f32, slopes: &Vectors) {
    for (values, slopes) in values.axes_mut().into_iter().zip(slopes.axes()) {
        for (value, slope) in values.iter_mut().zip(slopes) {
            *value += factor * slope;
        }
    }
}

/// `values` = `start` + `factor` · `slopes`.
fn set_to_sum(values: &mut Vectors, start: &Vectors, factor: f32, slopes: &Vectors) {
    values.copy_from(start);
    add_scaled(values, factor, slopes);
}
