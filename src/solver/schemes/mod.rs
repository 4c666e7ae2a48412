//! Integration schemes, one a file: how positions and velocities follow from accelerations.
//!
//! An explicit scheme advances the particles of the blocks that it is given, and may leave anything in the slots
//! of others; `interleaved.rs` says how two schemes share a tick.

mod closed;
mod explicit_euler;
mod gas;
mod implicit_euler;
mod interleaved;
mod runge_kutta_4;
mod second_order_taylor;
mod semi_implicit_euler;
mod velocity_verlet;
mod verlet_in_air;
mod xpbd;

use crate::solver::collision::{Evaluated, Surfaces, Surroundings};
use crate::solver::elements::Elements;
use crate::solver::field::Field;
use crate::solver::graph::{Blocks, Colouring};
use crate::solver::kernel::{self, Motion};
pub(super) use crate::solver::kernel::{Check, Substeps};
use crate::solver::particles::{Particles, PinnedMotions, Vectors};
use crate::solver::pulls::Pulls;
use crate::solver::settings::Integrator;
pub(super) use implicit_euler::{EnergyCorrection, ImplicitEuler, StepEndpoints};
pub(super) use interleaved::{Interleaved, SubstepIndex};

/// What schemes need besides the state: working memory, of which nothing outlasts a tick.
#[derive(Debug, Clone, Default)]
pub(super) struct Scratch {
    /// Accelerations of the last evaluation of the forces, m/s².
    pub acceleration: Vectors,
    /// Accelerations at the end of a substep of semi-implicit Euler, m/s²: see [`evaluate_end`].
    at_end: Vectors,
    steps: StepVectors,
    gas: gas::GasForces,
    xpbd: xpbd::Xpbd,
}

/// Vectors that an explicit scheme keeps within its step.
#[derive(Debug, Clone, Default)]
struct StepVectors {
    position: Vectors,
    velocity: Vectors,
    position_slope: Vectors,
    velocity_slope: Vectors,
    /// The accelerations at the start of a step of Runge–Kutta, m/s².
    start: Vectors,
    carried: velocity_verlet::Carried,
    air: verlet_in_air::Vectors,
}

impl Scratch {
    /// To be called before the first substep of a tick.
    pub fn begin_tick(&mut self, particles: usize) {
        self.acceleration.resize(particles);
        self.steps.carried = velocity_verlet::Carried::Nothing;
    }

    /// To be called when contacts have moved particles.
    pub fn disturb(&mut self) {
        self.steps.carried.disturb();
    }

    /// To be called when elements have broken or yielded.
    pub fn outdate(&mut self) {
        self.steps.carried.outdate();
    }
}

/// What an explicit scheme works on.
struct Stage<'a> {
    particles: &'a mut Particles,
    blocks: &'a mut Blocks,
    /// What the blocks know of the elements, but for those on ramps.
    elements: &'a Elements,
    /// The parts of the tick that are done at the start and at the end of the substep.
    elapsed: [f32; 2],
    field: Field<'a>,
    /// Where the pinned particles are at the end of the substep.
    pinned: PinnedMotions<'a>,
    acceleration: &'a mut Vectors,
    scratch: &'a mut StepVectors,
    gas: &'a mut gas::GasForces,
}

impl Stage<'_> {
    /// Gives springs on ramps the parameters that they have when `share` of the substep is done.
    fn ramp_to(&mut self, share: f32) {
        let [start, end] = self.elapsed;
        let elapsed = if share == 1.0 { end } else { start + share * (end - start) };
        self.blocks.ramp_to(self.elements, elapsed);
    }

    /// Evaluates the accelerations at the present state.
    fn evaluate(&mut self) {
        let field = self.gas.evaluate(self.elements.gases(), &self.particles.position, self.field);
        kernel::evaluate(Motion::of(self.particles), self.blocks, field, self.acceleration);
    }
}

/// What all particles have in common in a tick.
#[derive(Clone, Copy)]
pub(super) struct Net<'a> {
    pub elements: &'a Elements,
    pub colouring: &'a Colouring,
    pub field: Field<'a>,
    /// Where the pinned particles are at the end of the substep.
    pub pinned: PinnedMotions<'a>,
    /// What an implicit step may touch.
    pub surroundings: Surroundings<'a>,
    /// The part of the tick that is done at the start of the substep.
    pub elapsed: f32,
}

/// Advances positions and velocities by one substep of `substep` seconds of a named `integrator`. The elements are
/// those at the end of the substep, the blocks those at its start.
pub(super) fn advance(
    integrator: Integrator,
    net: Net,
    blocks: &mut Blocks,
    particles: &mut Particles,
    scratch: &mut Scratch,
    (implicit_euler, pulls, surfaces): (&mut ImplicitEuler, &mut Pulls, &mut Surfaces),
    substep: f32,
) {
    let Net { elements, field, pinned, surroundings, .. } = net;
    let Scratch { acceleration, steps, gas, xpbd, .. } = scratch;
    let elapsed = [net.elapsed, pinned.elapsed];
    let mut stage =
        Stage { particles, blocks, elements, elapsed, field, pinned, acceleration, scratch: steps, gas };
    match integrator {
        Integrator::ExplicitEuler => explicit_euler::advance(&mut stage, substep),
        Integrator::Auto | Integrator::SemiImplicitEuler => semi_implicit_euler::advance(&mut stage, substep),
        Integrator::SecondOrderTaylor => second_order_taylor::advance(&mut stage, substep),
        Integrator::VelocityVerlet => velocity_verlet::advance(&mut stage, substep),
        Integrator::RungeKutta4 => runge_kutta_4::advance(&mut stage, substep),
        Integrator::ImplicitEuler => {
            implicit_euler.advance(
                elements,
                stage.particles,
                field,
                stage.acceleration,
                (surroundings, surfaces),
                None,
                substep,
            );
        }
        Integrator::TrBdf2 => {
            implicit_euler.advance(
                elements,
                stage.particles,
                field,
                stage.acceleration,
                (surroundings, surfaces),
                Some(pulls),
                substep,
            );
        }
        Integrator::Xpbd => xpbd.advance(net, stage.blocks, stage.particles, stage.acceleration, substep),
    }
}

/// Whether [`advance_in_place`] may take all substeps of a block one after the other, where nothing but its own elements, constant
/// forces and the medium acts on it.
pub(super) fn may_advance_in_place(integrator: Integrator, blocks: &Blocks) -> bool {
    matches!(integrator, Integrator::SemiImplicitEuler | Integrator::VelocityVerlet) && blocks.are_closed()
}

/// Advances positions and velocities by all substeps of a tick, to the bit as [`advance`] does.
pub(super) fn advance_in_place(
    integrator: Integrator,
    field: Field,
    blocks: &Blocks,
    particles: &mut Particles,
    scratch: &mut Scratch,
    substeps: Substeps,
) {
    let Scratch { acceleration, steps, .. } = scratch;
    let pinned = PinnedMotions { motions: substeps.pinned, elapsed: 1.0, time_step: substeps.time_step };
    if integrator == Integrator::SemiImplicitEuler {
        semi_implicit_euler::advance_in_place(particles, blocks, (&field, acceleration), substeps);
    } else {
        velocity_verlet::advance_in_place(particles, blocks, (&field, steps, acceleration), substeps);
    }
    pinned.apply(particles);
}

/// To be called before [`evaluated`], when a substep of `substep` seconds that has begun at `start` has led the particles on, before
/// contacts change their velocities: semi-implicit Euler has not evaluated the accelerations there.
pub(super) fn evaluate_end(
    integrator: Integrator,
    (elements, field, blocks): (&Elements, Field, &Blocks),
    (particles, start): (&Particles, &Vectors),
    scratch: &mut Scratch,
    substep: f32,
) {
    if integrator != Integrator::SemiImplicitEuler {
        return;
    }
    let Scratch { at_end, gas, steps, .. } = scratch;
    at_end.resize(particles.len());
    let position = &mut steps.position;
    set_to_sum(position, start, substep, &particles.velocity);
    for slot in (0..particles.len()).filter(|slot| particles.is_pinned(*slot)) {
        position.set(slot, particles.position.get(slot));
    }
    let field = gas.evaluate(elements.gases(), position, field);
    kernel::evaluate(Motion::at(position, &particles.velocity, particles), blocks, field, at_end);
}

/// The accelerations at both ends of a substep; `None` for schemes that do not use them for rebounds.
pub(super) fn evaluated<'a>(
    integrator: Integrator,
    field: Field,
    scratch: &'a Scratch,
) -> Option<Evaluated<'a>> {
    let Scratch { acceleration, at_end, steps, .. } = scratch;
    match integrator {
        Integrator::SemiImplicitEuler => {
            Some(Evaluated { accelerations: [acceleration, at_end], shares: [0.0; 2] })
        }
        Integrator::VelocityVerlet if field.air.is_none() => {
            Some(Evaluated { accelerations: [&steps.velocity_slope, acceleration], shares: [0.0, 0.5] })
        }
        // As if they changed evenly.
        Integrator::RungeKutta4 => {
            Some(Evaluated { accelerations: [&steps.start, acceleration], shares: [1.0 / 6.0, 1.0 / 3.0] })
        }
        _ => None,
    }
}

/// After the last substep of a tick, of `substep` seconds, and its contacts: corrects the velocities where the scheme has evaluated
/// accelerations elsewhere than contacts have left the particles. Returns whether it has.
pub(super) fn end_tick(
    (elements, field): (&Elements, Field),
    pinned: PinnedMotions,
    blocks: &mut Blocks,
    particles: &mut Particles,
    scratch: &mut Scratch,
    substep: f32,
) -> bool {
    let Scratch { acceleration, steps, gas, .. } = scratch;
    if steps.carried != velocity_verlet::Carried::Disturbed {
        return false;
    }
    let elapsed = [pinned.elapsed; 2];
    let mut stage =
        Stage { particles, blocks, elements, elapsed, field, pinned, acceleration, scratch: steps, gas };
    velocity_verlet::evaluate_again(&mut stage, substep);
    true
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
