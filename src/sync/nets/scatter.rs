//! The solver's state back into the arrays of nets.

use bevy::platform::time::Instant;
use bevy::prelude::*;

use super::super::Simulation;
use super::super::state::MassSpringState;
use super::super::view::View;
use super::failure::{note_yields, publish_breaks};
use super::gather::GatheredNets;
use super::registry::NetPlace;
use crate::nets::{Arrays, ParticleNet};
use crate::report::{Broke, ParticleFault, TickReport};
use crate::settings::Dimensions;
use crate::solver::particles::Particles;

/// Whether there is any net.
pub(in crate::sync) fn any_nets(state: Res<MassSpringState>) -> bool {
    !state.nets.entries.is_empty()
}

/// Copies positions and velocities back, and takes out which are not finite.
pub(in crate::sync) fn scatter_nets(
    mut commands: Commands,
    simulation: Res<Simulation>,
    mut state: ResMut<MassSpringState>,
    mut gathered: ResMut<GatheredNets>,
    mut nets: Query<&mut ParticleNet>,
    dimensions: Res<Dimensions>,
    mut report: ResMut<TickReport>,
    (mut faults, mut broke): (MessageWriter<ParticleFault>, MessageWriter<Broke>),
) {
    let start = Instant::now();
    let MassSpringState { nets: registry, solver, is_outdated, .. } = &mut *state;
    let view = View::new(solver.origin, *dimensions);
    let is_finite = simulation.outputs.is_finite;
    for (entry, known) in registry.entries.iter().zip(&mut gathered.known) {
        let Some(place) = &entry.place else { continue };
        let Ok(mut net) = nets.get_mut(entry.entity) else { continue };
        if net.len() != place.len() {
            continue;
        }
        let (has_changed, are_finite) =
            copy_motion(&solver.particles, place, (view, is_finite), net.bypass_change_detection());
        if has_changed {
            net.set_changed();
        }
        if !are_finite {
            for particle in faulty(&solver.particles, place) {
                log::error!(
                    "particle {particle} of net {} became non-finite in tick {} and was taken out of the simulation",
                    entry.entity,
                    report.tick
                );
                faults.write(ParticleFault {
                    particle: entry.entity,
                    index: Some(particle),
                    tick: report.tick,
                });
                net.quarantine(particle);
                report.faults += 1;
                *is_outdated = true;
            }
        }
        if simulation.outputs.record_forces {
            let tensions = simulation.outputs.tensions.get(place.ranges.springs.clone()).unwrap_or_default();
            net.bypass_change_detection().arrays_mut().tensions.clear();
            net.bypass_change_detection().arrays_mut().tensions.extend_from_slice(tensions);
        }
        net.bypass_change_detection().note_load();
        known.written = Some(net.last_changed());
        note_yields((&mut net, place), &simulation.outputs.yielded, solver);
        let broken = &simulation.outputs.broken;
        if !broken.is_empty()
            && publish_breaks(
                (&mut commands, &mut broke),
                (entry.entity, &mut net, place),
                broken,
                solver,
                &mut report,
            )
        {
            // Its topology is another one.
            known.written = None;
        }
    }
    report.scatter_time += start.elapsed();
}

/// The particles that are in the simulation and not finite.
fn faulty(particles: &Particles, place: &NetPlace) -> Vec<u32> {
    let is_faulty = |particle: &u32| {
        let slot = place.slot(*particle as usize);
        !(particles.position.get(slot).is_finite() && particles.velocity.get(slot).is_finite())
    };
    (0..place.len() as u32).filter(is_faulty).collect()
}

/// The motion of consecutive particles in the solver; all slices are of these.
struct Source<'a> {
    position: [&'a [f32]; 3],
    velocity: [&'a [f32]; 3],
    inverse_masses: &'a [f32],
    origin: Vec3,
}

impl Source<'_> {
    /// Where a particle is that was at `present`. What is pinned is where it was put, to the bit.
    #[inline(always)]
    fn position(&self, at: usize, present: Vec3) -> Vec3 {
        if self.inverse_masses[at] == 0.0 && present.is_finite() {
            return present;
        }
        let [x, y, z] = self.position;
        Vec3::new(x[at], y[at], z[at]) + self.origin
    }

    #[inline(always)]
    fn velocity(&self, at: usize) -> Vec3 {
        let [u, v, w] = self.velocity;
        Vec3::new(u[at], v[at], w[at])
    }
}

/// Copies the motion of a net; returns whether anything is other than it was, and whether all is finite, which may be known. What
/// is not finite keeps its place, at rest.
fn copy_motion(
    particles: &Particles,
    place: &NetPlace,
    (view, is_finite): (View, bool),
    net: &mut ParticleNet,
) -> (bool, bool) {
    let Arrays { positions, velocities, .. } = net.arrays_mut();
    let inverse_masses = particles.own_inverse_mass();
    let (position_axes, velocity_axes) = (particles.position.axes(), particles.velocity.axes());
    if let Some(first) = place.first().filter(|_| is_finite && !view.is_flat) {
        // What nearly always is the case. Slices of one length: an index is checked for all of them at once.
        let count = positions.len().min(velocities.len());
        let slots = first..first + count;
        let [x, y, z] = position_axes.map(|axis| &axis[slots.clone()]);
        let [u, v, w] = velocity_axes.map(|axis| &axis[slots.clone()]);
        let inverse_masses = &inverse_masses[slots];
        let (positions, velocities) = (&mut positions[..count], &mut velocities[..count]);
        let source = Source { position: [x, y, z], velocity: [u, v, w], inverse_masses, origin: view.origin };
        // Where a net moves, the comparison ends at the first particle that does.
        let is_other = |at: usize| {
            source.position(at, positions[at]) != positions[at] || source.velocity(at) != velocities[at]
        };
        let has_changed = (0..count).any(is_other);
        if has_changed {
            for at in 0..count {
                positions[at] = source.position(at, positions[at]);
                velocities[at] = source.velocity(at);
            }
        }
        return (has_changed, true);
    }
    let ([x, y, z], [u, v, w]) = (position_axes, velocity_axes);
    let (mut has_changed, mut is_finite) = (false, true);
    for (slot, (position, velocity)) in place.slots().zip(positions.iter_mut().zip(velocities)) {
        let (at, speed) = (Vec3::new(x[slot], y[slot], z[slot]), Vec3::new(u[slot], v[slot], w[slot]));
        let is_good = at.is_finite() && speed.is_finite();
        is_finite &= is_good;
        // So is what was taken out.
        let is_moved = is_good && (inverse_masses[slot] != 0.0 || !position.is_finite());
        let place = if is_moved { view.to_world(at, *position) } else { *position };
        let speed = if is_good { speed } else { Vec3::ZERO };
        has_changed = has_changed || place != *position || speed != *velocity;
        *position = place;
        *velocity = speed;
    }
    (has_changed, is_finite)
}
