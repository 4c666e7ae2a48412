//! Ropes, cloths and other surfaces against each other and against themselves: nothing ever passes through anything.

mod balls;
mod conservation;
mod holding_knots;
mod impacts;
mod knots;
mod piles;
mod rebounds;
mod rules;
mod shots;

use bevy_mass_spring::nets::{ClothMaterial, RopeMaterial};
use bevy_mass_spring::solver::Integrator;

/// One of each kind of scheme.
const SCHEMES: [Integrator; 4] =
    [Integrator::SemiImplicitEuler, Integrator::Xpbd, Integrator::ImplicitEuler, Integrator::TrBdf2];

/// The same for long scenes.
const LONG_SCHEMES: [Integrator; 3] = [Integrator::SemiImplicitEuler, Integrator::Xpbd, Integrator::TrBdf2];

/// A cloth that explicit schemes can follow in a millisecond.
const SOFT: ClothMaterial = ClothMaterial {
    area_density: 0.15,
    stretch_stiffness: 100.0,
    shear_stiffness: 30.0,
    bending_stiffness: 1e-5,
    retardation_time: 2e-4,
};

/// A rope that they can follow.
const ELASTIC: RopeMaterial = RopeMaterial {
    linear_density: 0.1,
    stretch_stiffness: 50.0,
    bending_stiffness: 0.0,
    retardation_time: 1e-4,
};
