//! What a tick costs: the model by which `Auto` chooses.
//!
//! ```text
//! explicit    n (A + B e + s)   n substeps of velocity Verlet, with e elements in all islands that take part
//! implicit    m (C e + a)       m steps of TR-BDF2; C depends on whether the elements of the island form loops
//! ```
//!
//! s is what the air and gases take in a substep, a the part of the air: the implicit scheme evaluates it once a step, and
//! what gases cost it is in C.
//!
//! Measured in ns on one core of the processor of docs/performance.md, and the same on every machine: the choice
//! must not depend on it. What TR-BDF2 takes counts twice, as it dissipates the fast motions that velocity Verlet
//! resolves; and what an explicit tick takes up to [`BUDGET`] counts nothing.

/// A, ns a substep.
const SUBSTEP: f64 = 130.0;

/// B, ns for an element in a substep; with the pass over its particles.
const ELEMENT: f64 = 3.0;

/// The drag of a face, ns a substep, with what its corners take: a sheet of 32² cells in the wind.
pub(super) const FACE: f64 = 45.0;

/// The same with lift.
pub(super) const LIFTED_FACE: f64 = 80.0;

/// The drag of a filament, ns a substep: a rope of 1000 in the wind.
pub(super) const FILAMENT: f64 = 150.0;

/// A face around a gas, ns a substep: balloons of 320 and 1280.
pub(super) const GAS_FACE: f64 = 40.0;

/// C where islands are trees of springs, which are solved directly: a rope of 20 that swings takes five Newton steps
/// in the two stages.
const DIRECT: f64 = 500.0;

/// C by conjugate gradients: a sheet of 51² of 10⁶ N/m that falls.
const ITERATED: f64 = 2000.0;

/// How much a nanosecond of the implicit scheme counts.
const LOSS: f64 = 2.0;

/// What an explicit tick may take whatever the implicit scheme would, ns: 0.4 % of a frame.
const BUDGET: f64 = 60e3;

/// What `substeps` of velocity Verlet count for on this number of elements, and with air and gases that take `surface` ns.
pub(super) fn explicit(substeps: u32, elements: usize, surface: f64) -> f64 {
    (f64::from(substeps) * (SUBSTEP + ELEMENT * elements as f64 + surface) - BUDGET).max(0.0)
}

/// What `steps` of TR-BDF2 count for on an island of this number of elements, on which the air takes `air` ns.
pub(super) fn implicit(steps: u32, elements: usize, has_loops: bool, air: f64) -> f64 {
    LOSS * f64::from(steps) * (elements as f64 * if has_loops { ITERATED } else { DIRECT } + air)
}
