//! Slots and places for the nets that were added, and none for those that were removed.

use std::iter::repeat_n;
use std::sync::Arc;

use bevy::ecs::entity::EntityHashMap;
use bevy::ecs::entity_disabling::Disabled;
use bevy::prelude::*;

use super::super::slots::Assignment;
use super::registry::{NetPlace, RegisteredNet};
use crate::nets::{Air, Layout, PartOf, ParticleNet, Topology};
use crate::parameter;
use crate::particle::SimulationOrder;
use crate::solver::particles::Vectors;
use crate::solver::{self, Face, Filament, Gas, NetElements, enclosed_volume};

/// All that the assignment reads of a net.
pub(in crate::sync) type NetData = (Ref<'static, ParticleNet>, &'static Transform, Has<Disabled>);

/// What was known of the nets before all slots were taken away.
#[derive(Default)]
pub(in crate::sync) struct Past {
    pub positions: Vectors,
    pub springs: Vec<solver::Spring>,
    /// By the number of the net.
    places: Vec<Option<NetPlace>>,
}

/// The elements of a net, air and gas included.
pub(in crate::sync) fn elements(topology: &Topology) -> NetElements<'_> {
    let Topology { springs, rods, hinges, triangles, radius, .. } = topology;
    let Air { drag, lift } = topology.air;
    let is_rope = matches!(topology.layout, Layout::Rope { .. });
    NetElements {
        springs,
        rods,
        hinges,
        triangles,
        face: (drag > 0.0 || lift > 0.0).then_some(Face { drag, lift }).filter(|_| !triangles.is_empty()),
        filament: (is_rope && drag > 0.0).then_some(Filament { diameter: 2.0 * radius, drag }),
        gas: topology.pressure.map(|pressure| Gas { pressure, rest_volume: rest_volume(topology) }),
        ignores_itself: topology.ignores_itself,
        rest: &topology.positions,
    }
}

/// The volume that the surface encloses at rest, m³.
fn rest_volume(topology: &Topology) -> f32 {
    enclosed_volume(&topology.triangles, |particle| topology.positions[particle as usize]) as f32
}

/// What is wrong with a net that is to be placed.
fn check(net: &ParticleNet) -> Result<(), String> {
    net.topology().validate().map_err(|problem| problem.to_string())?;
    let count = net.topology().positions.len();
    if net.len() != count || net.velocities().len() != count {
        return Err(format!("it has {} particles, its topology {count}", net.len()));
    }
    for (index, (position, velocity)) in net.positions().iter().zip(net.velocities()).enumerate() {
        parameter::finite("position", *position)
            .and_then(|()| parameter::finite("velocity", *velocity))
            .map_err(|problem| format!("particle {index}: {problem}"))?;
    }
    Ok(())
}

impl Assignment<'_, '_, '_, '_, '_> {
    /// The number of particles and springs of the nets that were added or removed since the last time.
    pub fn pending_nets(&self) -> (usize, usize) {
        let (mut particles, mut springs) = (0, 0);
        if self.state.nets.is_pending {
            for net in
                self.state.nets.entries.iter().filter(|net| net.is_new || net.is_relaid || net.is_removed)
            {
                if let Some(place) = &net.place {
                    particles += place.len();
                    springs += place.ranges.springs.len();
                }
                if let Ok((data, ..)) = self.candidates.nets.get(net.entity) {
                    particles += data.len();
                    springs += data.topology().springs.len();
                }
            }
        }
        (particles, springs)
    }

    /// Takes all nets out, in their order, before all slots are assigned anew.
    pub fn take_nets(&mut self) -> Past {
        let orders = &self.candidates.orders;
        let nets = &mut self.state.nets;
        nets.entries.retain(|net| !net.is_removed);
        if !orders.is_empty() {
            let order_of = |net: &RegisteredNet| {
                orders.get(net.entity).map_or(u64::MAX, |SimulationOrder(order)| *order)
            };
            nets.entries.sort_by_key(order_of);
        }
        let take = |net: &mut RegisteredNet| net.place.take().filter(|_| !net.is_new);
        let places: Vec<Option<NetPlace>> = nets.entries.iter_mut().map(take).collect();
        nets.quarantined = 0;
        nets.is_pending = true;
        let solver = &self.state.solver;
        // Of nets that are gone nothing need be known.
        let is_known = !self.state.springs.entries.is_empty() || places.iter().any(Option::is_some);
        let springs = if is_known { solver.past_springs() } else { Vec::new() };
        Past { positions: solver.particles.position.clone(), springs, places }
    }

    /// Empties the places of the nets that were removed or replaced, or have other elements now. Returns what is known
    /// of these.
    pub fn remove_nets(&mut self) -> Past {
        let mut past = Past::default();
        if !self.state.nets.is_pending {
            return past;
        }
        for index in 0..self.state.nets.entries.len() {
            let net = &mut self.state.nets.entries[index];
            let (is_new, is_removed) = (net.is_new, net.is_removed);
            let old = if is_new || is_removed || net.is_relaid { net.place.take() } else { None };
            if is_new {
                net.frame = None;
            }
            if let Some(place) = &old {
                self.remove_net(place);
            }
            if !is_removed {
                past.places.push(old.filter(|_| !is_new));
            }
        }
        self.state.nets.entries.retain(|net| !net.is_removed);
        if past.places.iter().any(Option::is_some) {
            past.positions.copy_from(&self.state.solver.particles.position);
        }
        past
    }

    fn remove_net(&mut self, place: &NetPlace) {
        let is_in = |slot: u32| place.particle(slot as usize).is_some();
        for spring in self.state.solver.springs_into(&place.ranges, is_in) {
            self.suspend(self.state.springs.slots[spring]);
        }
        let state = &mut *self.state;
        state.nets.quarantined -= place.quarantined.len();
        for slot in place.slots() {
            state.particles.vacate(slot);
        }
        for spring in place.ranges.springs.clone() {
            state.springs.vacate(spring);
        }
        state.solver.remove_net(&place.ranges, place.slots());
    }

    /// Gives places to the nets that have none, with what is known of their past; `new_slots[old]` gets the slots of
    /// their particles.
    pub fn add_nets(&mut self, mut past: Past, new_slots: &mut [Option<u32>]) {
        if !self.state.nets.is_pending {
            return;
        }
        self.state.nets.is_pending = false;
        for index in 0..self.state.nets.entries.len() {
            let old = past.places.get_mut(index).and_then(Option::take);
            if self.state.nets.entries[index].place.is_none() {
                self.add_net(index, old.as_ref().map(|old| (old, &past)), new_slots);
            }
        }
    }

    /// Tells the parts of one particle its slot.
    pub fn place_parts(&mut self) {
        if self.candidates.parts.is_empty() {
            return;
        }
        let entries = self.state.nets.entries.iter();
        let places: EntityHashMap<&NetPlace> =
            entries.filter_map(|net| Some((net.entity, net.place.as_ref()?))).collect();
        for (PartOf(net), mut part) in &mut self.candidates.parts {
            let slot = match part.particles[..] {
                [particle] => places.get(net).map(|place| place.slot(particle as usize) as u32),
                _ => None,
            };
            part.bypass_change_detection().slot = slot;
        }
    }

    fn add_net(&mut self, index: usize, past: Option<(&NetPlace, &Past)>, new_slots: &mut [Option<u32>]) {
        let state = &mut *self.state;
        let entry = &mut state.nets.entries[index];
        let Ok((net, transform, is_disabled)) = self.candidates.nets.get(entry.entity) else { return };
        if is_disabled {
            return;
        }
        entry.is_new = false;
        let is_relaid = std::mem::take(&mut entry.is_relaid);
        let warnings = &mut self.bookkeeping.warnings;
        if let Err(problem) = check(&net) {
            let message = format_args!("net {} is left out of the simulation: {problem}", entry.entity);
            warnings.warn_once(entry.entity, message);
            return;
        }
        warnings.clear(entry.entity);
        if !std::mem::replace(&mut entry.is_recorded, true) {
            self.bookkeeping.initial.record_net(entry.entity, &net, transform);
        }
        let topology = Arc::clone(net.topology());
        // Those beyond the old ones are new.
        let known = past.map_or(0, |(old, _)| old.len().min(net.len()));
        let (fresh, first) = (&mut self.simulation.fresh, state.particles.slots.len());
        let mut particles: Vec<(Vec3, Vec3, f32)> = Vec::with_capacity(net.len());
        let arrays = net.positions().iter().zip(net.velocities()).zip(&topology.masses);
        for (particle, ((position, velocity), mass)) in arrays.enumerate() {
            let last = past.filter(|_| particle < known);
            let last = last.map(|(old, past)| past.positions.get(old.slot(particle)));
            // Empty places are still computed, with a force of zero: what was taken out must be finite, too.
            let last = last.filter(|last| last.is_finite());
            let position = last.unwrap_or(*position - state.solver.origin);
            particles.push((position, *velocity, 1.0 / mass));
        }
        let mut pins = [net.pinned(), &net.part_actions().held].concat();
        pins.iter().for_each(|particle| particles[*particle as usize].2 = 0.0);
        let ranges = state.solver.add_net(particles.into_iter(), topology.radius, elements(&topology));
        debug_assert_eq!((first, fresh.len()), (ranges.particles.start, ranges.particles.start));
        fresh.extend((0..net.len()).map(|particle| particle >= known));
        state.particles.slots.extend(repeat_n(entry.entity, net.len()));
        state.springs.slots.extend(repeat_n(entry.entity, topology.springs.len()));
        if let Some((old, past)) = past {
            for (new, old) in ranges.particles.clone().zip(old.slots()) {
                if let Some(place) = new_slots.get_mut(old) {
                    *place = Some(new as u32);
                }
            }
            // Links keep their numbers where a winch adds more of them.
            let keeps_numbers = !is_relaid || net.wound_out().is_some();
            if let Some(springs) = past.springs.get(old.ranges.springs.clone()).filter(|_| keeps_numbers) {
                state.solver.set_past_net(&ranges, springs);
            }
        }
        let mut place = NetPlace::new(ranges);
        place.quarantined = net.quarantined().to_vec();
        let gone = place.quarantined.iter().map(|particle| place.slot(*particle as usize));
        if gone.len() > 0 {
            state.solver.remove_from_net(&place.ranges, gone);
        }
        for spring in net.broken() {
            state.solver.remove_spring(place.ranges.springs.start + *spring as usize);
        }
        state.nets.quarantined += place.quarantined.len();
        pins.sort_unstable();
        pins.dedup();
        pins.retain(|particle| place.quarantined.binary_search(particle).is_err());
        entry.placed = Some((net.versions().parameters, pins));
        entry.place = Some(place);
    }
}
