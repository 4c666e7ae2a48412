//! Arrays of nets into the solver.

use bevy::ecs::change_detection::Tick;
use bevy::ecs::entity::{EntityHashMap, EntityHashSet};
use bevy::prelude::*;

use super::super::Simulation;
use super::super::slots::NetQuery;
use super::super::state::{MassSpringState, Warnings};
use super::super::teleport::Moved;
use super::super::view::View;
use super::place::elements;
use super::registry::NetPlace;
use crate::nets::ParticleNet;
use crate::parameter;
use crate::solver::{PinnedMotion, State};

/// What is known of the nets since the last tick. All of it can be dropped.
#[derive(Resource, Default)]
pub(in crate::sync) struct GatheredNets {
    pub known: Vec<KnownNet>,
    /// The number of each net.
    pub index: EntityHashMap<usize>,
    /// Parts that have other particles, or none any more: springs that end in them are joined anew.
    pub relinked_parts: EntityHashSet,
    /// The particles that are pinned, in ascending order: working memory.
    pins: Vec<u32>,
    /// Where the entity of each net without a parent was, by number, and that as a frame without scale.
    pub frames: Vec<Option<(Transform, [f32; 12])>>,
}

/// The solver's copy of a net.
#[derive(Debug, Clone)]
pub(in crate::sync) struct KnownNet {
    entity: Entity,
    /// The version of its topology; `None` if that is to be found out.
    parameters: Option<u64>,
    /// The particles without a mass, in ascending order.
    pins: Vec<u32>,
    /// When the arrays were written: as long as they were not changed since, they are what the solver has.
    pub written: Option<Tick>,
}

impl GatheredNets {
    /// Whether an entity is a net of which is known where it is.
    pub fn contains(&self, entity: Entity) -> bool {
        !self.index.is_empty() && self.index.contains_key(&entity)
    }

    /// The particle of the net of an entity that is in a slot.
    pub fn particle_at(&self, state: &MassSpringState, entity: Entity, slot: usize) -> Option<u32> {
        let net = state.nets.entries.get(*self.index.get(&entity)?)?;
        net.place.as_ref()?.particle(slot)
    }

    /// Before slots are assigned: marks the nets that are to be placed anew, and copies parameters.
    pub fn check_nets(&mut self, state: &mut MassSpringState, was_replaced: bool, nets: &NetQuery) {
        if was_replaced {
            self.known.clear();
        }
        for (number, entry) in state.nets.entries.iter_mut().enumerate() {
            // Of a state that was put back nothing is known.
            let mut known = self.known.get_mut(number);
            let is_other = known.as_ref().map_or(!was_replaced, |known| known.entity != entry.entity);
            if is_other || entry.is_removed {
                continue;
            }
            let Ok((net, _, is_disabled)) = nets.get(entry.entity) else { continue };
            let is_untouched = known.as_ref().is_some_and(|known| known.written == Some(net.last_changed()));
            let Some(place) = &entry.place else {
                // What was left out may be corrected.
                state.nets.is_pending |= !is_disabled && net.is_changed();
                continue;
            };
            if is_untouched || entry.is_new || entry.is_relaid {
                continue;
            }
            state.is_outdated |= net.quarantined() != place.quarantined;
            let parameters = known.as_ref().and_then(|known| known.parameters);
            if parameters != Some(net.versions().parameters) {
                if let Some(known) = &mut known {
                    known.parameters = None;
                }
                let fits = net.topology().validate().is_ok()
                    && net.len() == place.len()
                    && set_parameters(&mut state.solver, place, &net);
                if !fits {
                    entry.is_relaid = true;
                    state.nets.is_pending = true;
                }
            }
        }
    }

    /// After slots were assigned: the numbers of the nets.
    pub fn refresh(&mut self, state: &MassSpringState) {
        let entries = &state.nets.entries;
        let is_same = self.known.len() == entries.len()
            && self.known.iter().zip(entries).all(|(known, entry)| known.entity == entry.entity);
        if is_same {
            return;
        }
        let mut old: EntityHashMap<KnownNet> =
            self.known.drain(..).map(|known| (known.entity, known)).collect();
        self.index.clear();
        for (index, entry) in entries.iter().enumerate() {
            self.index.insert(entry.entity, index);
            self.known.push(old.remove(&entry.entity).unwrap_or_else(|| KnownNet::unknown(entry.entity)));
        }
    }
}

impl KnownNet {
    fn unknown(entity: Entity) -> Self {
        Self { entity, parameters: None, pins: Vec::new(), written: None }
    }
}

/// Gives the elements the parameters that they have in the net; `false` if they join other particles. Those of
/// quarantined particles stay empty.
fn set_parameters(solver: &mut State, place: &NetPlace, net: &ParticleNet) -> bool {
    let slot_of = |particle: u32| place.slot(particle as usize) as u32;
    let is_absent = |particle: u32| place.quarantined.binary_search(&particle).is_ok();
    let is_broken = |spring: usize| net.broken().binary_search(&(spring as u32)).is_ok();
    solver.set_net(&place.ranges, elements(net.topology()), slot_of, is_absent, is_broken)
}

/// Copies all nets.
pub(in crate::sync) fn gather_nets(
    state: &mut MassSpringState,
    simulation: &mut Simulation,
    gathered: &mut GatheredNets,
    warnings: &mut Warnings,
    nets: &NetQuery,
    view: View,
    moved: &mut Vec<Moved>,
) {
    let MassSpringState { nets: registry, solver, is_outdated, .. } = state;
    for (entry, known) in registry.entries.iter_mut().zip(&mut gathered.known) {
        let placed = entry.placed.take();
        let Some(place) = &entry.place else { continue };
        let Ok((net, ..)) = nets.get(entry.entity) else { continue };
        if let (Some((parameters, pins)), None) = (placed, known.parameters) {
            (known.parameters, known.pins) = (Some(parameters), pins);
        }
        let mut gathering = Gathering {
            entity: entry.entity,
            net: &net,
            place,
            solver,
            simulation,
            warnings,
            view,
            is_bad: false,
        };
        gathering.find_pins(&mut gathered.pins);
        let is_known = known.parameters == Some(net.versions().parameters);
        if !is_known {
            let fits = set_parameters(gathering.solver, place, &net);
            gathering.set_masses(&gathered.pins);
            // A state that was put back is of another net: the next tick lays it out anew.
            *is_outdated |= !fits;
            entry.is_relaid |= !fits;
            registry.is_pending |= !fits;
            known.parameters = Some(net.versions().parameters);
            known.pins.clone_from(&gathered.pins);
        } else if known.pins != gathered.pins {
            gathering.change_pins(&known.pins, &gathered.pins);
            known.pins.clone_from(&gathered.pins);
        }
        gathering.move_pins(&gathered.pins);
        if known.written != Some(net.last_changed()) || gathering.is_fresh() {
            gathering.copy_motion(&gathered.pins, moved);
        }
        gathering.push();
        if !gathering.is_bad {
            warnings.clear(entry.entity);
        }
    }
}

struct Gathering<'a> {
    entity: Entity,
    net: &'a ParticleNet,
    place: &'a NetPlace,
    solver: &'a mut State,
    simulation: &'a mut Simulation,
    warnings: &'a mut Warnings,
    view: View,
    /// Whether something was complained of.
    is_bad: bool,
}

impl Gathering<'_> {
    fn is_fresh(&self) -> bool {
        self.simulation.fresh[self.place.slot(0)]
    }

    /// The particles that are pinned, by themselves or by a part, in ascending order.
    fn find_pins(&self, pins: &mut Vec<u32>) {
        pins.clear();
        pins.extend(self.net.pinned());
        let held = &self.net.part_actions().held;
        if !held.is_empty() {
            pins.extend(held);
            pins.sort_unstable();
            pins.dedup();
        }
        if !self.place.quarantined.is_empty() {
            pins.retain(|particle| self.place.quarantined.binary_search(particle).is_err());
        }
    }

    fn set_mass(&mut self, particle: usize, is_pinned: bool) {
        let inverse_mass = if is_pinned { 0.0 } else { 1.0 / self.net.masses()[particle] };
        self.solver.set_particle(self.place.slot(particle), inverse_mass, self.net.radius());
    }

    fn set_masses(&mut self, pins: &[u32]) {
        for particle in 0..self.net.len() {
            if self.place.quarantined.binary_search(&(particle as u32)).is_err() {
                self.set_mass(particle, pins.binary_search(&(particle as u32)).is_ok());
            }
        }
    }

    fn change_pins(&mut self, old: &[u32], new: &[u32]) {
        for particle in old.iter().filter(|particle| new.binary_search(particle).is_err()) {
            if self.place.quarantined.binary_search(particle).is_err() {
                self.set_mass(*particle as usize, false);
            }
        }
        new.iter().for_each(|particle| self.set_mass(*particle as usize, true));
    }

    /// Sends the pinned particles from where they were to where they are held.
    fn move_pins(&mut self, pins: &[u32]) {
        for &particle in pins {
            let slot = self.place.slot(particle as usize);
            let last = self.solver.particles.position.get(slot);
            let held = self.net.positions()[particle as usize];
            let is_good = self.check(particle as usize, "position", held);
            let target = if is_good { self.view.to_solver(held) } else { last };
            let start = if self.simulation.fresh[slot] { target } else { last };
            self.solver.particles.position.set(slot, start);
            self.simulation.inputs.pinned.push(PinnedMotion { slot, start, target });
        }
    }

    /// Copies positions and velocities of the free particles where others were written since the last tick.
    fn copy_motion(&mut self, pins: &[u32], moved: &mut Vec<Moved>) {
        let mut pins = pins.iter().chain(std::iter::once(&u32::MAX)).copied().peekable();
        let (positions, velocities) = (self.net.positions(), self.net.velocities());
        for (particle, (position, velocity)) in positions.iter().zip(velocities).enumerate() {
            if pins.next_if_eq(&(particle as u32)).is_some()
                || self.place.quarantined.binary_search(&(particle as u32)).is_ok()
            {
                continue;
            }
            let slot = self.place.slot(particle);
            let last = self.solver.particles.position.get(slot);
            let is_unmoved = self.view.to_world(last, *position) == *position;
            let last_velocity = self.solver.particles.velocity.get(slot);
            let (mut position, mut velocity) = (self.view.to_solver(*position), self.view.flatten(*velocity));
            if !(position + velocity).is_finite() {
                let is_good = self.check(particle, "position", position);
                position = if is_good { position } else { last };
                velocity = if self.check(particle, "velocity", velocity) { velocity } else { last_velocity };
            }
            if self.simulation.fresh[slot] {
                self.solver.particles.position.set(slot, position);
            } else if !is_unmoved && position != last {
                moved.push(Moved { slot, position, keeps_velocity: last_velocity != velocity });
            }
            self.solver.particles.velocity.set(slot, velocity);
        }
    }

    /// Copies the forces that the game and parts apply.
    fn push(&mut self) {
        for (particle, force) in self.net.applied_forces().iter().enumerate() {
            self.add_force(particle, *force);
        }
        for &(particle, force) in &self.net.part_actions().forces {
            self.add_force(particle as usize, force);
        }
    }

    fn add_force(&mut self, particle: usize, force: Vec3) {
        if force != Vec3::ZERO && self.check(particle, "applied force", force) {
            let slot = self.place.slot(particle);
            let forces = &mut self.solver.particles.applied_force;
            let sum = forces.get(slot) + self.view.flatten(force);
            forces.set(slot, sum);
        }
    }

    /// Whether a value is finite; if not, it is complained of.
    fn check(&mut self, particle: usize, field: &'static str, value: Vec3) -> bool {
        let Err(problem) = parameter::finite(field, value) else { return true };
        let entity = self.entity;
        let message = format_args!("particle {particle} of net {entity}: {problem}; it is ignored");
        // One at a time: the first is named.
        if !std::mem::replace(&mut self.is_bad, true) {
            self.warnings.warn_once(entity, message);
        }
        false
    }
}
