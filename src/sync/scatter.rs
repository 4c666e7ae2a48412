//! Arrays back into components, and what the tick has to tell.

use std::sync::{Mutex, PoisonError};

use bevy::ecs::change_detection::ContiguousMut;
use bevy::ecs::entity_disabling::Disabled;
use bevy::ecs::query::Allow;
use bevy::ecs::system::SystemParam;
use bevy::platform::time::Instant;
use bevy::prelude::*;

use crate::collider::Contact;
use crate::nets::Anchor;
use crate::particle::{Particle, ParticleVelocity, Pinned, Quarantined};
use crate::report::{
    Broke, InvalidColliders, ParticleFault, Reaction, SleepingParticles, SpringForces, TickReport,
};
use crate::settings::Dimensions;
use crate::solver::particles::Particles;
use crate::solver::{self, ContactPartner, ContactRecord, Outputs, Version, parallel};
use crate::spring::{Broken, Spring};

use super::Simulation;
use super::colliders::GatheredColliders;
use super::gather::{Gathered, MIN_SHARED, ROWS};
use super::hierarchy::world_transform;
use super::nets::GatheredNets;
use super::registry::Slot;
use super::state::MassSpringState;
use super::view::View;

/// All that a tick writes of a particle.
type ParticleData =
    (&'static Slot<Particle>, &'static mut Transform, &'static mut ParticleVelocity, Has<Pinned>);

/// The particles without a parent, then the velocities and the transforms of those with one.
type ParticleQueries<'w, 's> = ParamSet<
    'w,
    's,
    (
        Query<'static, 'static, ParticleData, Without<ChildOf>>,
        Query<'static, 'static, (&'static mut ParticleVelocity, Has<Pinned>)>,
        Query<'static, 'static, &'static mut Transform, Allow<Disabled>>,
    ),
>;

/// The whole stage, one system.
pub(super) fn scatter(
    simulation: Res<Simulation>,
    state: Res<MassSpringState>,
    mut gathered: ResMut<Gathered>,
    (colliders, nets): (Res<GatheredColliders>, Res<GatheredNets>),
    mut queries: ParticleQueries,
    parents: Query<&ChildOf, Allow<Disabled>>,
    dimensions: Res<Dimensions>,
    mut report: ResMut<TickReport>,
    mut publications: Publications,
) {
    let start = Instant::now();
    let view = View::new(state.solver.origin, *dimensions);
    let particles = (&state.solver.particles, simulation.outputs.is_finite);
    scatter_particles(particles, view, &mut gathered, &mut queries, &parents);
    publications.report_faults(&state, &mut gathered.faults, &mut report);
    publications.report_failures(&state, &nets, &simulation.outputs, &mut report);
    if let Some(messages) = &mut publications.contacts {
        messages.write_batch(merged_contacts(&simulation.outputs, &state, &nets, &colliders.entities));
    }
    if let Some(forces) = &mut publications.forces {
        publish_forces(&simulation.outputs, &state, &nets, &publications.anchors, forces);
    }
    if let Some(sleeping) = &mut publications.sleeping {
        publish_sleeping(&state, &nets, sleeping, &mut publications.published_sleep);
    }
    if let Some(invalid) = &mut publications.invalid_colliders {
        let mut all = colliders.left_out.clone();
        all.sort_unstable();
        invalid.set_if_neq(InvalidColliders { all });
    }
    report.scatter_time = start.elapsed();
}

/// Copies positions and velocities back, and notes which are not finite.
fn scatter_particles(
    (particles, is_finite): (&Particles, bool),
    view: View,
    gathered: &mut Gathered,
    queries: &mut ParticleQueries,
    parents: &Query<&ChildOf, Allow<Disabled>>,
) {
    let Gathered { parented, faults, .. } = gathered;
    let mut free_standing = queries.p0();
    for table in free_standing.contiguous_iter_mut().expect("these components are all stored in tables") {
        let (slots, transforms, velocities, pinned) = table;
        let (transforms, mut transform_ticks) = ContiguousMut::bypass_change_detection_split(transforms);
        let (velocities, mut velocity_ticks) = ContiguousMut::bypass_change_detection_split(velocities);
        let now = transform_ticks.this_run();
        let changed =
            transform_ticks.changed_mut().chunks_mut(ROWS).zip(velocity_ticks.changed_mut().chunks_mut(ROWS));
        let parts =
            slots.chunks(ROWS).zip(transforms.chunks_mut(ROWS)).zip(velocities.chunks_mut(ROWS)).zip(changed);
        let found = Mutex::new(&mut *faults);
        parallel::for_each(
            parts,
            slots.len() >= MIN_SHARED,
            |(((slots, transforms), velocities), (moved, accelerated))| {
                for row in 0..slots.len() {
                    let Some(slot) = slots[row].get() else { continue };
                    let new_velocity = finite_velocity(particles, slot, is_finite);
                    if new_velocity.is_none() {
                        found.lock().unwrap_or_else(PoisonError::into_inner).push(slot);
                    }
                    let velocity = ParticleVelocity(new_velocity.unwrap_or_default());
                    if velocities[row] != velocity {
                        velocities[row] = velocity;
                        accelerated[row] = now;
                    }
                    let present = transforms[row].translation;
                    let position = view.to_world(particles.position.get(slot), present);
                    if new_velocity.is_some() && !pinned && present != position {
                        transforms[row].translation = position;
                        moved[row] = now;
                    }
                }
            },
        );
    }
    for &(_, slot, entity) in &*parented {
        let new_velocity = finite_velocity(particles, slot, is_finite);
        if new_velocity.is_none() {
            faults.push(slot);
        }
        let mut velocities = queries.p1();
        let Ok((mut velocity, pinned)) = velocities.get_mut(entity) else { continue };
        velocity.set_if_neq(ParticleVelocity(new_velocity.unwrap_or_default()));
        if new_velocity.is_some() && !pinned {
            move_child(entity, particles.position.get(slot), view, parents, &mut queries.p2());
        }
    }
}

/// The velocity in a slot, if the state there is finite, which may be known.
#[inline]
fn finite_velocity(particles: &Particles, slot: usize, is_finite: bool) -> Option<Vec3> {
    let velocity = particles.velocity.get(slot);
    let is_finite = is_finite || (velocity.is_finite() && particles.position.get(slot).is_finite());
    is_finite.then_some(velocity)
}

/// Moves a particle with a parent to the solver's `position`.
fn move_child(
    entity: Entity,
    position: Vec3,
    view: View,
    parents: &Query<&ChildOf, Allow<Disabled>>,
    transforms: &mut Query<&mut Transform, Allow<Disabled>>,
) {
    let Ok(&ChildOf(parent)) = parents.get(entity) else { return };
    let parent_of = |entity| parents.get(entity).ok().map(ChildOf::parent);
    let (frame, _) = world_transform(parent, parent_of, |entity| transforms.get(entity).ok());
    let Ok(mut transform) = transforms.get_mut(entity) else { return };
    let local = view.solver_to_child(&view.frame_to_solver(frame), position, transform.translation);
    if transform.translation != local && local.is_finite() {
        transform.translation = local;
    }
}

/// What the tick publishes.
#[derive(SystemParam)]
pub(super) struct Publications<'w, 's> {
    commands: Commands<'w, 's>,
    faults: MessageWriter<'w, ParticleFault>,
    broke: MessageWriter<'w, Broke>,
    contacts: Option<ResMut<'w, Messages<Contact>>>,
    forces: Option<ResMut<'w, SpringForces>>,
    /// The pinned particles of attachments, which are children of what the parts are attached to.
    anchors: Query<'w, 's, &'static ChildOf, With<Anchor>>,
    sleeping: Option<ResMut<'w, SleepingParticles>>,
    invalid_colliders: Option<ResMut<'w, InvalidColliders>>,
    /// Of the sleep that was published last.
    published_sleep: Local<'s, Version>,
    springs: Query<'w, 's, &'static mut Spring>,
}

impl Publications<'_, '_> {
    fn report_faults(&mut self, state: &MassSpringState, faults: &mut Vec<usize>, report: &mut TickReport) {
        faults.sort_unstable();
        faults.dedup();
        for slot in faults.drain(..) {
            let particle = state.particles.slots[slot];
            log::error!(
                "particle {particle} became non-finite in tick {} and was taken out of the simulation",
                report.tick
            );
            self.faults.write(ParticleFault { particle, index: None, tick: report.tick });
            self.commands.entity(particle).try_insert(Quarantined);
            report.faults += 1;
        }
    }
}

impl Publications<'_, '_> {
    /// Publishes which springs broke, and writes how far others have yielded.
    fn report_failures(
        &mut self,
        state: &MassSpringState,
        nets: &GatheredNets,
        outputs: &Outputs,
        report: &mut TickReport,
    ) {
        for broken in &outputs.broken {
            let entity = state.springs.slots[broken.spring];
            // Nets come apart after their arrays were written.
            if nets.contains(entity) {
                continue;
            }
            let (tick, tension, point) = (report.tick, broken.tension, broken.point + state.solver.origin);
            self.commands.entity(entity).try_insert(Broken);
            let broke = Broke { entity, tick, tension, point, spring: None, pieces: None };
            self.commands.trigger(broke);
            self.broke.write(broke);
            report.broken += 1;
        }
        for &slot in &outputs.yielded {
            let strain = state.solver.spring(slot as usize).and_then(|spring| spring.plasticity);
            let spring = self.springs.get_mut(state.springs.slots[slot as usize]);
            if let (Some(solver::Plasticity { strain, .. }), Ok(mut spring)) = (strain, spring)
                && let Some(plasticity) = &mut spring.plasticity
            {
                plasticity.strain = strain;
            }
        }
    }
}

/// One contact for each touching pair: the last record of the tick with the impulses of all substeps.
fn merged_contacts(
    outputs: &Outputs,
    state: &MassSpringState,
    nets: &GatheredNets,
    colliders: &[Entity],
) -> Vec<Contact> {
    let mut records: Vec<&ContactRecord> = outputs.contacts.iter().collect();
    records.sort_by_key(|record| (record.slot, record.other));
    let pairs = records.chunk_by(|one, next| (one.slot, one.other) == (next.slot, next.other));
    pairs
        .filter_map(|substeps| {
            let last = substeps.last()?;
            let particle_in = |slot: usize| {
                let entity = *state.particles.slots.get(slot)?;
                Some((entity, nets.particle_at(state, entity, slot)))
            };
            let (other, other_index) = match last.other {
                ContactPartner::Collider(collider) => (*colliders.get(collider)?, None),
                ContactPartner::Particle(slot) => particle_in(slot)?,
            };
            let impulse = substeps.iter().map(|record| record.impulse).sum();
            let (particle, index) = particle_in(last.slot)?;
            let point = last.point + state.solver.origin;
            Some(Contact { particle, index, other, other_index, point, normal: last.normal, impulse })
        })
        .collect()
}

/// Which particles sleep, if others do than in the last tick.
fn publish_sleeping(
    state: &MassSpringState,
    nets: &GatheredNets,
    sleeping: &mut ResMut<SleepingParticles>,
    published: &mut Version,
) {
    let version = state.solver.sleep_version();
    if std::mem::replace(published, version) == version && !sleeping.is_added() {
        return;
    }
    let particles = state.particles.slots.iter().copied().enumerate();
    let asleep = particles.filter(|(slot, _)| state.solver.is_asleep(*slot));
    let mut all: Vec<_> =
        asleep.map(|(slot, entity)| (entity, nets.particle_at(state, entity, slot))).collect();
    all.sort_unstable();
    sleeping.set_if_neq(SleepingParticles { all });
}

/// Tensions and reactions, by entity.
fn publish_forces(
    outputs: &Outputs,
    state: &MassSpringState,
    nets: &GatheredNets,
    anchors: &Query<&ChildOf, With<Anchor>>,
    forces: &mut SpringForces,
) {
    let springs = state.springs.slots.iter().copied().zip(outputs.tensions.iter().copied());
    forces.tensions.clear();
    forces
        .tensions
        .extend(springs.filter(|(spring, _)| *spring != Entity::PLACEHOLDER && !nets.contains(*spring)));
    let reactions = outputs.reactions.iter().filter_map(|&(slot, force)| {
        let particle = state.particles.slots[slot];
        let index = nets.particle_at(state, particle, slot);
        let entity = anchors.get(particle).map_or(particle, ChildOf::parent);
        let point = state.solver.particles.position.get(slot) + state.solver.origin;
        (particle != Entity::PLACEHOLDER).then_some(Reaction { entity, index, force, point })
    });
    forces.reactions.clear();
    forces.reactions.extend(reactions);
}
