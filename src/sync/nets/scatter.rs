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
    for (entry, known) in registry.entries.iter().zip(&mut gathered.known) {
        let Some(place) = &entry.place else { continue };
        let Ok(mut net) = nets.get_mut(entry.entity) else { continue };
        if net.len() != place.len() {
            continue;
        }
        let (has_changed, is_finite) =
            copy_motion(&solver.particles, place, view, net.bypass_change_detection());
        if has_changed {
            net.set_changed();
        }
        if !is_finite {
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

/// Copies the motion of a net; returns whether anything is other than it was, and whether all is finite. What is not
/// finite keeps its place, at rest.
fn copy_motion(particles: &Particles, place: &NetPlace, view: View, net: &mut ParticleNet) -> (bool, bool) {
    let (mut has_changed, mut has_moved, mut is_finite) = (false, false, true);
    let Arrays { positions, velocities, .. } = net.arrays_mut();
    let [x, y, z] = particles.position.axes();
    let [u, v, w] = particles.velocity.axes();
    let inverse_masses = particles.own_inverse_mass();
    let mut copy =
        |(at, speed): (Vec3, Vec3), inverse_mass: f32, position: &mut Vec3, velocity: &mut Vec3| {
            // Zero times a finite number is zero.
            let is_good = (at + speed).element_sum() * 0.0 == 0.0 || (at.is_finite() && speed.is_finite());
            is_finite &= is_good;
            // What is pinned is where it was put, and what was taken out where it was, to the bit.
            let is_moved = is_good && (inverse_mass != 0.0 || !position.is_finite());
            let place = if is_moved { view.to_world(at, *position) } else { *position };
            let speed = if is_good { speed } else { Vec3::ZERO };
            has_changed = has_changed || place != *position || speed != *velocity;
            *position = place;
            *velocity = speed;
        };
    match place.first() {
        Some(first) => {
            // Slices of one length: an index is checked for all of them at once.
            let count = positions.len().min(velocities.len());
            let (x, y, z) = (&x[first..][..count], &y[first..][..count], &z[first..][..count]);
            let (u, v, w) = (&u[first..][..count], &v[first..][..count], &w[first..][..count]);
            let inverse_masses = &inverse_masses[first..][..count];
            let (positions, velocities) = (&mut positions[..count], &mut velocities[..count]);
            for at in 0..count {
                let (place, speed) = (Vec3::new(x[at], y[at], z[at]), Vec3::new(u[at], v[at], w[at]));
                let checksum = (place + speed).element_sum() * 0.0;
                if checksum == 0.0 && inverse_masses[at] != 0.0 && !view.is_flat {
                    // Nearly all: what `copy` does without what need not be asked of each.
                    let place = place + view.origin;
                    has_moved |= place != positions[at] || speed != velocities[at];
                    (positions[at], velocities[at]) = (place, speed);
                } else {
                    copy((place, speed), inverse_masses[at], &mut positions[at], &mut velocities[at]);
                }
            }
        }
        None => {
            for (slot, (position, velocity)) in place.slots().zip(positions.iter_mut().zip(velocities)) {
                let motion = (Vec3::new(x[slot], y[slot], z[slot]), Vec3::new(u[slot], v[slot], w[slot]));
                copy(motion, inverse_masses[slot], position, velocity);
            }
        }
    }
    (has_changed || has_moved, is_finite)
}
