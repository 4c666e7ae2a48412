//! A substep: forces and motion of all particles, contacts, strain limits, failures.

use super::stiff::surroundings;
use super::{Caches, Inputs, Outputs, Plan, State, StepSettings};
use crate::solver::failures::Failures;
use crate::solver::field::Field;
use crate::solver::graph::spring_ends;
use crate::solver::particles::PinnedMotions;
use crate::solver::schemes::{self, Net, SubstepIndex};

impl Caches {
    /// The substep of this `index`, of `duration` seconds.
    pub(super) fn run_substep(
        &mut self,
        state: &mut State,
        inputs: &Inputs,
        outputs: &mut Outputs,
        (settings, plan): (&StepSettings, Plan),
        (index, duration): (u32, f32),
    ) {
        let may_touch = self.contacts.is_active();
        if may_touch {
            let State { particles, contacts, .. } = &*state;
            self.contacts.begin_substep(contacts, &particles.position, &inputs.colliders, settings);
            self.surfaces.begin_substep(particles);
        }
        if plan.begins_implicit_step(index) {
            self.endpoints.begin(&state.particles);
        }
        let elapsed = plan.elapsed(index + 1);
        let pinned = PinnedMotions { motions: &inputs.pinned, elapsed, time_step: settings.time_step };
        self.advance(state, inputs, settings, pinned, plan, (index, duration));
        if plan.integrator.is_implicit() {
            self.endpoints.end(&state.particles);
        }
        if outputs.record_contacts && plan.begins_implicit_step(index) {
            outputs.contacts.extend_from_slice(self.implicit_euler.touching());
        }
        pinned.apply(&mut state.particles);
        if state.elements.any_ramps() {
            // Contacts see the elements as they will be at the end of the tick, as when they search anew.
            state.elements.ramp_to(1.0);
        }
        let have_touched =
            may_touch && self.resolve_contacts(state, inputs, outputs, (settings, plan), [duration, elapsed]);
        self.limit_strains(state, duration, elapsed);
        if may_touch {
            let step = plan.integrator.is_implicit().then_some([duration, elapsed]);
            self.stop_crossings(state, inputs, (settings, duration), (step, have_touched));
        }
        state.releases.iter_mut().for_each(|release| release.time_left -= duration);
        if self.failures.any() {
            let has_ramps = state.elements.any_ramps();
            if has_ramps {
                state.elements.ramp_to(elapsed); // What the forces of this substep are of.
            }
            self.fail(state, outputs, (settings, plan), index);
            if has_ramps {
                state.elements.ramp_to(1.0);
            }
        }
    }

    /// Advances all particles by the substep of this `index`, of `substep` seconds.
    fn advance(
        &mut self,
        state: &mut State,
        inputs: &Inputs,
        settings: &StepSettings,
        pinned: PinnedMotions,
        plan: Plan,
        (index, substep): (u32, f32),
    ) {
        let State { particles, elements, exposed, .. } = &*state;
        let steps = if plan.stiff_substeps > 0 { plan.stiff_substeps } else { plan.substeps };
        self.air.evaluate(exposed, particles, [substep, settings.time_step / steps as f32]);
        // One substep is no way to go: the new parameters act at once.
        let elapsed = if plan.substeps == 1 { 1.0 } else { plan.elapsed(index) };
        let has_ramps = elements.any_ramps();
        let in_step = (plan.stiff_substeps > 0).then(|| {
            let count = plan.substeps / plan.stiff_substeps;
            SubstepIndex { done: index % count, count, substep }
        });
        let step_end = match in_step {
            Some(SubstepIndex { done, count, .. }) => index - done + count,
            None => index + 1,
        };
        let step_end = step_end as f32 / plan.substeps as f32;
        if let Some(in_step) = in_step {
            self.advance_stiff(state, inputs, settings, (in_step, step_end));
        }
        let State { particles, elements, contacts, pulls, sleep, .. } = state;
        let field = Field::of(settings, self.air.load());
        let surroundings = surroundings((&self.contacts, contacts), inputs, settings, step_end);
        let Self { blocks, colouring, implicit_euler, interleaved, scratch, surfaces, .. } = self;
        if has_ramps {
            elements.ramp_to(pinned.elapsed);
            if !plan.integrator.is_implicit() {
                blocks.ramp_to(elements, elapsed);
            }
        }
        let net = Net { elements, colouring, field, pinned, surroundings, elapsed };
        schemes::advance(
            plan.integrator,
            net,
            blocks,
            particles,
            scratch,
            (implicit_euler, pulls, surfaces),
            substep,
        );
        if plan.integrator.is_implicit() {
            implicit_euler.remember_forces(contacts, |slot| sleep.is_asleep(slot));
        }
        if let Some(in_step) = in_step {
            interleaved.after_substep(particles, &mut scratch.acceleration, in_step);
        }
    }

    /// Keeps the strain limits at the end of a substep, when `elapsed` of the tick is done.
    fn limit_strains(&mut self, state: &mut State, substep: f32, elapsed: f32) {
        if !self.strain_limits.any() {
            return;
        }
        let State { particles, elements, pulls, .. } = state;
        let has_ramps = elements.any_ramps();
        if has_ramps {
            elements.ramp_to(elapsed);
        }
        if self.strain_limits.apply(elements, particles, substep, |slot| pulls.set_touching(slot)) {
            self.scratch.disturb();
        }
        if has_ramps {
            elements.ramp_to(1.0);
        }
    }

    /// Removes the springs that broke in the substep of this `index`, and changes those that yielded.
    fn fail(
        &mut self,
        state: &mut State,
        outputs: &mut Outputs,
        (settings, plan): (&StepSettings, Plan),
        index: u32,
    ) {
        let ends_step = plan.begins_implicit_step(index + 1);
        self.read_solved_tensions(if ends_step { plan } else { Plan::default() }, state.elements.len());
        self.failures.measure_reach(&state.elements, &state.particles);
        let ends_tick = index + 1 == plan.substeps;
        if ends_tick && self.failures.any_uncertain(&state.elements, &state.particles, &self.tensions) {
            self.balance_tensions(state, settings, plan);
        }
        let (islands, stiff) = self.planner.stiff_islands();
        let is_between = plan.stiff_substeps > 0 && !ends_step;
        let State { particles, elements, pulls, contacts, releases, .. } = state;
        let in_step = |slot: usize| is_between && stiff.contains(islands, particles, slot);
        self.failures.find(elements, particles, (&self.tensions, ends_tick), in_step);
        let Failures { broken, yielded, .. } = &self.failures;
        if broken.is_empty() && yielded.is_empty() {
            return;
        }
        outputs.broken.extend_from_slice(broken);
        outputs.yielded.extend(yielded.iter().map(|(spring, _)| spring));
        let broken = broken.iter().map(|broken| broken.spring);
        let tears = |spring: usize| elements.springs().elements()[spring].tears;
        let removed: Vec<usize> = broken.filter(|spring| !tears(*spring)).collect();
        removed.iter().for_each(|spring| elements.break_spring(*spring as u32));
        yielded.iter().for_each(|(spring, strain)| elements.deform_spring(*spring, *strain));
        let changed = yielded.iter().map(|(spring, _)| *spring as usize);
        for spring in removed.iter().copied().chain(changed) {
            spring_ends(elements, spring).into_iter().for_each(|end| pulls.invalidate(end));
            if !plan.integrator.is_implicit() {
                self.blocks.set_parameters(spring, elements.springs().elements()[spring]);
            }
        }
        releases.extend(self.failures.released(elements));
        self.scratch.outdate();
        if !removed.is_empty() {
            contacts.request_search();
            self.strain_limits.prepare(elements, particles);
        }
    }
}
