//! Which integration scheme runs, and in how many substeps.

use bevy::prelude::*;

use crate::solver::Scheme;
use crate::solver::stability::{Choice, Components, FrequencyBounds};

/// How a tick is integrated.
///
/// A named [`integrator`](Self::integrator) with [`Substeps::Fixed`] runs exactly that, whatever comes
/// of it: explicit Euler may be watched exploding. The defaults never do.
#[derive(Resource, Reflect, Debug, Clone, Copy, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[reflect(Resource, Default, Debug, Clone, PartialEq)]
pub struct SolverSettings {
    /// The integration scheme. Default [`Integrator::Auto`].
    pub integrator: Integrator,
    /// How many substeps a tick is divided into. Default [`Substeps::Auto`].
    pub substeps: Substeps,
}

impl SolverSettings {
    /// The scheme and the number of substeps that these settings mean for a net within `bounds` and a
    /// tick of `time_step` seconds. [`Substeps::Fixed`] of 0 counts as 1.
    pub fn choose(&self, bounds: &FrequencyBounds, time_step: f32) -> (Scheme, u32) {
        match (self.integrator.scheme(), self.substeps) {
            (Some(scheme), Substeps::Fixed(_)) => (scheme, self.least_substeps()),
            (Some(scheme), Substeps::Auto) => (scheme, bounds.auto_substeps(scheme, time_step)),
            (None, _) => bounds.cheapest(time_step, self.least_substeps()),
        }
    }

    /// What these settings mean for a net within `bounds` when each of its components may go its own way:
    /// [`Integrator::Auto`] then takes those that are stiff by implicit Euler, and the others by an explicit
    /// scheme. It asks for the `components` only where they may differ.
    pub fn choose_by_component<'a>(
        &self,
        bounds: &FrequencyBounds,
        time_step: f32,
        components: impl FnOnce() -> &'a mut Components,
    ) -> Choice {
        let least = self.least_substeps();
        if self.integrator == Integrator::Auto && bounds.may_divide(time_step, least) {
            return components().choose(bounds, time_step, least);
        }
        self.choose(bounds, time_step).into()
    }

    /// Whether the choice depends on the bounds.
    pub(crate) fn wants_bounds(&self) -> bool {
        self.integrator == Integrator::Auto || self.substeps == Substeps::Auto
    }

    /// So many substeps the user asks for.
    fn least_substeps(&self) -> u32 {
        match self.substeps {
            Substeps::Auto => 1,
            Substeps::Fixed(count) => count.max(1),
        }
    }
}

/// An integration scheme: how positions and velocities follow from accelerations.
#[derive(Reflect, Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[reflect(Default, Debug, Clone, PartialEq, Hash)]
pub enum Integrator {
    /// Stable for every stiffness, mass ratio and time step, at the least cost. Chosen at each tick, for each
    /// part of the net that springs connect, from the springs and masses:
    /// [`VelocityVerlet`](Self::VelocityVerlet) with as many substeps as its stability bound asks for;
    /// [`SemiImplicitEuler`](Self::SemiImplicitEuler) where damped springs ask it for fewer;
    /// or, where those would be hundreds, [`ImplicitEuler`](Self::ImplicitEuler). So a stiff rope takes nothing
    /// from the motion of a soft cloth beside it. Pinned particles connect nothing; particles without
    /// springs go with the explicit part. Where nothing has springs, it is
    /// [`SemiImplicitEuler`](Self::SemiImplicitEuler).
    #[default]
    Auto,
    /// x += h v, then v += h a(old state). First order; gains energy, and explodes if undamped.
    ExplicitEuler,
    /// v += h a, then x += h v(new). First order, symplectic: keeps energy within bounds.
    SemiImplicitEuler,
    /// x += h v + h²/2 a, v += h a. Exact for constant acceleration, first order otherwise.
    SecondOrderTaylor,
    /// x += h v + h²/2 a, v += h/2 (a(old) + a(new)); a(new) is a(old) of the next substep. Second order,
    /// symplectic without damping.
    VelocityVerlet,
    /// The classical Runge–Kutta method: four evaluations of the forces, fourth order.
    RungeKutta4,
    /// v += h a(new state), then x += h v(new), solved by Newton's method. First order; stable for every
    /// stiffness, mass ratio and time step, and dissipates what it does not resolve.
    ImplicitEuler,
    /// Extended position-based dynamics: each substep is one round over the springs. First order; stable for
    /// every stiffness, mass ratio and time step, but long stiff nets stretch unless substeps are many.
    Xpbd,
}

impl Integrator {
    /// Every integrator, in the order of their declaration.
    pub const ALL: [Self; 8] = [
        Self::Auto,
        Self::ExplicitEuler,
        Self::SemiImplicitEuler,
        Self::SecondOrderTaylor,
        Self::VelocityVerlet,
        Self::RungeKutta4,
        Self::ImplicitEuler,
        Self::Xpbd,
    ];

    /// The solver's scheme of this name; `None` for [`Integrator::Auto`], which chooses at each tick.
    pub fn scheme(self) -> Option<Scheme> {
        match self {
            Self::Auto => None,
            Self::ExplicitEuler => Some(Scheme::ExplicitEuler),
            Self::SemiImplicitEuler => Some(Scheme::SemiImplicitEuler),
            Self::SecondOrderTaylor => Some(Scheme::SecondOrderTaylor),
            Self::VelocityVerlet => Some(Scheme::VelocityVerlet),
            Self::RungeKutta4 => Some(Scheme::RungeKutta4),
            Self::ImplicitEuler => Some(Scheme::ImplicitEuler),
            Self::Xpbd => Some(Scheme::Xpbd),
        }
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

impl From<Scheme> for Integrator {
    fn from(scheme: Scheme) -> Self {
        match scheme {
            Scheme::ExplicitEuler => Self::ExplicitEuler,
            Scheme::SemiImplicitEuler => Self::SemiImplicitEuler,
            Scheme::SecondOrderTaylor => Self::SecondOrderTaylor,
            Scheme::VelocityVerlet => Self::VelocityVerlet,
            Scheme::RungeKutta4 => Self::RungeKutta4,
            Scheme::ImplicitEuler => Self::ImplicitEuler,
            Scheme::Xpbd => Self::Xpbd,
        }
    }
}

/// How many equal substeps a tick is divided into.
#[derive(Reflect, Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[reflect(Default, Debug, Clone, PartialEq, Hash)]
pub enum Substeps {
    /// As many as the stability bound of the integrator asks for, and at least 4; of
    /// [`Integrator::ImplicitEuler`] 4, or 2 where springs form loops; of [`Integrator::Xpbd`] 20.
    #[default]
    Auto,
    /// Exactly this many, >= 1. (With [`Integrator::Auto`]: at least this many.)
    Fixed(u32),
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_read_back() {
        for integrator in Integrator::ALL {
            assert_eq!(integrator.to_string().parse(), Ok(integrator));
        }
        let error = "Leapfrog".parse::<Integrator>().unwrap_err();
        assert!(error.to_string().contains("Leapfrog") && error.to_string().contains("VelocityVerlet"));
    }

    #[test]
    fn schemes_read_back() {
        for integrator in Integrator::ALL {
            match integrator.scheme() {
                Some(scheme) => assert_eq!(Integrator::from(scheme), integrator),
                None => assert_eq!(integrator, Integrator::Auto),
            }
        }
    }
}
