//! A tick: plan → substeps → outputs.

mod forces;
mod in_place;
mod plans;
mod stiff;
mod stops;
mod substep;

use crate::solver::air::Air;
use crate::solver::collision::{Collider, ContactCaches, ContactProperties, NearIslands, Surfaces};
use crate::solver::elements::Balance;
use crate::solver::failures::Failures;
use crate::solver::field::Field;
use crate::solver::graph::{Blocks, Colouring, IslandSet, Neighbours, Nets, better_order, part_coincident};
use crate::solver::outputs::Outputs;
use crate::solver::particles::{PinnedMotion, PinnedMotions, Vectors};
use crate::solver::schemes::{self, ImplicitEuler, Interleaved, Scratch, StepEndpoints};
use crate::solver::settings::{Integrator, StepSettings};
use crate::solver::sleep::{SleepCaches, Sleepers, Surroundings as Around};
use crate::solver::stability::{FrequencyBounds, Plan, Planner};
use crate::solver::state::{State, Version};
use crate::solver::strain_limit::StrainLimits;

/// What moves the particles and colliders in a tick, apart from the physics.
#[derive(Debug, Clone, Default)]
pub struct Inputs {
    /// Where each pinned particle goes; one that is not listed moves at its velocity. [`Solver::step`](super::Solver::step) drops
    /// those of particles that do not exist.
    pub pinned: Vec<PinnedMotion>,
    /// The colliders.
    pub colliders: Vec<Collider>,
    /// How particles touch others, by slot; those beyond its end have the default properties.
    pub contact_properties: Vec<ContactProperties>,
}

/// All that is derived from the state, and working memory. New ones give the same results.
#[derive(Debug, Clone, Default)]
pub(crate) struct Caches {
    planner: Planner,
    /// The pairs of islands that touch, if the plan depends on them: working memory.
    touching: Vec<[usize; 2]>,
    near_islands: NearIslands,
    neighbours: Neighbours,
    nets: Nets,
    blocks: Blocks,
    colouring: Colouring,
    implicit_euler: ImplicitEuler,
    endpoints: StepEndpoints,
    /// Working memory: whether the particle in each slot was stopped.
    stopped: Vec<bool>,
    air: Air,
    /// Working memory.
    motions: Vec<PinnedMotion>,
    tensions: Vec<f64>,
    balance: Balance,
    interleaved: Interleaved,
    scratch: Scratch,
    /// Working memory: positions and velocities at the start of a tick.
    before: [Vectors; 2],
    contacts: ContactCaches,
    surfaces: Surfaces,
    strain_limits: StrainLimits,
    failures: Failures,
    sleep: SleepCaches,
}

/// Advances `state` by one tick of `settings.time_step` seconds.
///
/// The motions in `inputs` are of particles that exist. Never panics on values: what overflows becomes non-finite, and is the caller's to
/// find.
pub(crate) fn step(
    state: &mut State,
    inputs: &Inputs,
    caches: &mut Caches,
    outputs: &mut Outputs,
    settings: &StepSettings,
) {
    state.elements.settle(state.particles.own_inverse_mass());
    state.elements.begin_ramps();
    let Inputs { pinned: motions, colliders, contact_properties: properties } = inputs;
    let around = Around { motions, colliders, properties };
    caches.sleep.begin_tick(sleepers(state), around, settings);
    let plan = caches.plan(state, settings);
    if caches.sleep.is_all(&state.sleep) {
        outputs.begin_tick(plan);
        caches.rest(state, inputs, outputs, settings);
        return;
    }
    let nets = (&state.mesh, &state.elements, &state.particles);
    caches.surfaces.begin_tick(&mut state.contacts, nets, (settings, properties));
    let plan = caches.plan_touching(state, settings, properties, plan);
    outputs.begin_tick(plan);
    caches.prepare(state, plan);
    if !plan.is_implicit() {
        let State { contacts, sleep, .. } = &mut *state;
        contacts.forces.keep_asleep(|slot| sleep.is_asleep(slot));
    }
    state.particles.note_applied_forces();
    for motion in &inputs.pinned {
        state.particles.position.set(motion.slot, motion.start);
        state.particles.velocity.set(motion.slot, (motion.target - motion.start) / settings.time_step);
    }
    if std::mem::take(&mut state.may_coincide) {
        part_coincident(&state.elements, &mut state.particles, (settings.gravity, settings.is_flat));
    }
    caches.air.begin_tick(&state.exposed, &state.particles, settings, (state.origin, state.air_clock));
    let nets = (&state.mesh, &state.elements);
    let count = state.particles.len();
    caches.contacts.begin_tick(&mut state.contacts, &inputs.colliders, nets, (settings, count));
    caches.contacts.set_covered(&mut state.contacts, &state.particles, caches.surfaces.covered());
    let duration = settings.time_step / plan.substeps as f32;
    if !caches.advance_in_place(state, inputs, settings, (plan, duration)) {
        for index in 0..plan.substeps {
            caches.run_substep(state, inputs, outputs, (settings, plan), (index, duration));
        }
    }
    caches.correct_velocities(state, inputs, outputs, settings, duration);
    caches.end_tick(state, plan);
    let are_finite =
        [state.particles.position.clear_negligible(), state.particles.velocity.clear_negligible()];
    outputs.is_finite = are_finite == [true; 2];
    if settings.sleep.is_some() {
        let Caches { sleep, contacts, air, implicit_euler, .. } = caches;
        let touching = if plan.is_implicit() { implicit_euler.touching() } else { &[] };
        let field = Field::of(settings, air.load());
        sleep.end_tick(sleepers(state), around, (contacts, touching), (settings, field));
    }
    state.air_clock.advance(settings.wind, settings.time_step);
    state.pulls.end_tick();
    let in_implicit_step = if plan.is_implicit() { caches.implicit_euler.touching().len() } else { 0 };
    outputs.contact_count = caches.contacts.count() + caches.surfaces.count() + in_implicit_step;
    caches.publish_forces(state, outputs, settings, plan);
    outputs.read_gases(&state.elements, &state.particles.position);
}

/// What sleep has to do with of the state.
fn sleepers(state: &mut State) -> Sleepers<'_> {
    let State { sleep: memory, particles, elements, exposed, mesh, contacts, pulls, .. } = state;
    Sleepers { memory, particles, elements, exposed, mesh, contacts, pulls }
}

impl Caches {
    /// A tick in which all sleeps: only pinned particles move.
    fn rest(&mut self, state: &mut State, inputs: &Inputs, outputs: &mut Outputs, settings: &StepSettings) {
        PinnedMotions { motions: &inputs.pinned, elapsed: 1.0, time_step: settings.time_step }
            .apply(&mut state.particles);
        state.may_coincide = false;
        self.contacts.rest();
        state.elements.end_ramps();
        state.releases.iter_mut().for_each(|release| release.time_left -= settings.time_step);
        state.releases.retain(|release| release.time_left > 0.0);
        state.air_clock.advance(settings.wind, settings.time_step);
        outputs.contact_count = 0;
        self.publish_forces(state, outputs, settings, Plan::default());
        outputs.read_gases(&state.elements, &state.particles.position);
    }

    /// What a tick with these settings would run.
    pub fn plan(&mut self, state: &State, settings: &StepSettings) -> Plan {
        self.planner.plan((&state.elements, &state.exposed), &state.particles, settings)
    }

    /// Bounds on the frequencies of the whole net in a medium of `viscosity` N·s/m.
    pub fn frequency_bounds(&mut self, state: &State, viscosity: f32) -> FrequencyBounds {
        *self.planner.refresh_bounds(&state.elements, &state.particles, viscosity)
    }

    /// The springs that end in a particle.
    pub fn springs_at(&self, state: &State, slot: usize) -> Vec<usize> {
        self.blocks.springs_at(&state.elements, slot)
    }

    /// What elements join, through pinned particles, too.
    pub fn nets(&mut self, state: &State) -> &Nets {
        self.nets.refresh(&state.elements, state.particles.len());
        &self.nets
    }

    /// The particles in a better order, if theirs is bad: the present slot of each place.
    pub fn better_order(&mut self, state: &State) -> Option<Vec<u32>> {
        let islands = self.planner.refresh_islands(&state.elements, &state.particles);
        better_order(&state.elements, &state.particles, &mut self.neighbours, islands)
    }

    /// Corrects the velocities at the end of the last substep, of `substep` seconds, see [`schemes::end_tick`].
    fn correct_velocities(
        &mut self,
        state: &mut State,
        inputs: &Inputs,
        outputs: &mut Outputs,
        settings: &StepSettings,
        substep: f32,
    ) {
        let pinned = PinnedMotions { motions: &inputs.pinned, elapsed: 1.0, time_step: settings.time_step };
        let Self { blocks, scratch, air, contacts, surfaces, .. } = self;
        let State { elements, particles, .. } = state;
        let field = (&*elements, Field::of(settings, air.load()));
        surfaces.begin_advance(particles);
        if schemes::end_tick(field, pinned, blocks, particles, scratch, substep) {
            surfaces.end_tick(particles);
            let records = if outputs.record_contacts { &mut outputs.contacts[..] } else { &mut [] };
            contacts.stop_approaching(particles, records);
        }
    }

    fn end_tick(&mut self, state: &mut State, plan: Plan) {
        self.contacts.end_tick(&mut state.contacts);
        if state.elements.any_ramps() && !plan.integrator.is_implicit() {
            self.blocks.ramp_to(&state.elements, 1.0);
        }
        state.elements.end_ramps();
        state.releases.retain(|release| release.time_left > 0.0);
    }

    /// Derives what the schemes of a tick need.
    fn prepare(&mut self, state: &mut State, plan: Plan) {
        let State { particles, elements, pulls, releases, .. } = state;
        self.scratch.begin_tick(particles.len());
        self.strain_limits.prepare(elements, particles);
        self.failures
            .prepare(elements, particles, releases, || self.planner.refresh_islands(elements, particles));
        let is_divided = plan.stiff_substeps > 0;
        if is_divided || plan.integrator == Integrator::TrBdf2 {
            pulls.begin_tick(particles.len());
        } else {
            pulls.clear();
        }
        if plan.is_implicit() {
            self.planner.refresh_islands(elements, particles);
            let (islands, stiff) = self.planner.stiff_islands();
            self.implicit_euler.prepare(elements, particles, islands, is_divided.then_some(stiff));
            self.contacts.set_implicit(particles.len(), self.implicit_euler.island_slots());
        } else {
            self.contacts.set_implicit(0, std::iter::empty());
        }
        if is_divided {
            self.interleaved.begin_tick(&self.implicit_euler);
        }
        if plan.integrator.is_implicit() {
            elements.reset_edits();
            return;
        }
        let (islands, stiff) = self.planner.stiff_islands();
        let excluded = if is_divided { IslandSet::version(stiff) } else { Version::default() };
        let is_excluded = |slot: usize| is_divided && stiff.contains(islands, particles, slot);
        self.blocks.refresh(elements, particles, (excluded, is_excluded));
        if plan.integrator == Integrator::Xpbd {
            self.colouring.refresh(elements, particles, &self.blocks);
        }
    }
}
