//! Teleports: what was moved as a whole between two ticks did not move, it is elsewhere.
//!
//! A pinned particle that is moved drags along what hangs from it. But where all that hangs from it was
//! moved, too, and alike, this is no motion: each by itself, a root above them all, or everything there is (a
//! floating origin). Then nothing changes but the place. The solver's own positions and velocities are moved, which
//! are finer than what the `Transform`s say, so that strains stay what they were to the last bits.

use bevy::math::DVec3;
use bevy::prelude::*;

use crate::solver::{self, PinnedMotion, Pose};

use super::Simulation;
use super::easing::Easing;
use super::rigid::RigidMotion;
use super::state::MassSpringState;
use super::view::View;

/// How exactly a motion is one of all, as a part of the coordinates: its computation rounds a few times.
const TOLERANCE: f64 = 16.0 * f32::EPSILON as f64;

/// A free particle that was moved since the last tick.
#[derive(Debug, Clone, Copy)]
pub(super) struct Moved {
    pub slot: usize,
    /// Where it is now, as the solver sees it.
    pub position: Vec3,
    /// Whether its velocity was set as well, and is not to be turned.
    pub keeps_velocity: bool,
}

/// Moves the particles that were moved since the last tick; as a whole, where they were. Returns the motion of all
/// particles there are, if they were moved alike.
pub(super) fn settle(
    state: &mut MassSpringState,
    simulation: &mut Simulation,
    moved: &[Moved],
    view: View,
    easing: &mut Easing,
) -> Option<RigidMotion> {
    if moved.is_empty() {
        simulation.fresh.fill(false);
        return None;
    }
    let mut teleports = Teleports::new(state, simulation, moved, view);
    simulation.fresh.fill(false);
    let Simulation { inputs, caches, .. } = simulation;
    let all: Vec<u32> = (0..teleports.slots.len() as u32).collect();
    let motion_of_all = teleports.motion_of(&all);
    let nets = caches.nets(&state.solver);
    for net in nets.all() {
        if let Some(motion) = teleports.motion_of(net) {
            teleports.carry_out(&motion, net, &mut state.solver, &mut inputs.pinned);
        }
    }
    if let Some(motion) = &motion_of_all {
        teleports.carry_out(motion, &all, &mut state.solver, &mut inputs.pinned);
    }
    for (slot, entity) in state.particles.slots.iter().enumerate() {
        if teleports.slots[slot].is_done {
            easing.restart(*entity);
        }
    }
    for &Moved { slot, position, .. } in moved.iter().filter(|moved| !teleports.slots[moved.slot].is_done) {
        let distance = position.distance(state.solver.particles.position.get(slot));
        if distance > state.solver.particles.radius()[slot] {
            state.solver.teleport(slot, position);
        }
        state.solver.particles.position.set(slot, position);
        state.solver.strain(slot);
    }
    motion_of_all
}

/// Where a collider starts that has come to `target`, if all particles were moved by `motion`: where it was, or where
/// that motion took it.
pub(super) fn start_of_collider(motion: &RigidMotion, start: Pose, target: Pose, view: View) -> Pose {
    let origin = view.origin.as_dvec3();
    let carried = motion.apply(start.point.as_dvec3() - origin) + origin;
    let rotation = motion.turn_rotation(start.rotation);
    let gap = |point: DVec3, rotation: Quat| {
        let normals = (rotation * Vec3::Y).distance(target.rotation * Vec3::Y);
        point.distance(target.point.as_dvec3()) + f64::from(normals)
    };
    let rest = gap(carried, rotation);
    let size = 1.0 + carried.abs().max_element().max(start.point.abs().max_element().into());
    match rest < gap(start.point.as_dvec3(), start.rotation) {
        true if rest <= TOLERANCE * size => target,
        true => Pose { point: carried.as_vec3(), rotation },
        false => start,
    }
}

/// What was moved, by slot.
struct Teleports {
    slots: Vec<Place>,
    origin: DVec3,
    /// Of the particles at hand, those that are pinned first: where they were, and where they are.
    pairs: Vec<[DVec3; 2]>,
}

/// What is known of a slot.
#[derive(Debug, Clone, Copy)]
struct Place {
    kind: Kind,
    /// The solver's position in the last tick and now, from its present origin, m.
    before: DVec3,
    now: DVec3,
    keeps_velocity: bool,
    /// Whether a motion has been found for it.
    is_done: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    /// Nothing is there, or what had no place before.
    Absent,
    Free,
    /// Its number among the motions of pinned particles.
    Pinned(usize),
}

impl Teleports {
    fn new(state: &MassSpringState, simulation: &Simulation, moved: &[Moved], view: View) -> Self {
        let Simulation { inputs, fresh, unshifted, shift, .. } = simulation;
        let positions = &state.solver.particles.position;
        let place = |(slot, entity): (usize, &Entity)| {
            let is_absent = *entity == Entity::PLACEHOLDER || fresh[slot];
            let before = match unshifted.len() {
                0 => positions.get(slot).as_dvec3(),
                _ => unshifted.get(slot).as_dvec3() - shift.as_dvec3(),
            };
            let kind = if is_absent { Kind::Absent } else { Kind::Free };
            Place { kind, before, now: before, keeps_velocity: false, is_done: false }
        };
        let mut slots: Vec<Place> = state.particles.slots.iter().enumerate().map(place).collect();
        for moved in moved {
            slots[moved.slot].now = moved.position.as_dvec3();
            slots[moved.slot].keeps_velocity = moved.keeps_velocity;
        }
        for (number, motion) in inputs.pinned.iter().enumerate() {
            let place = &mut slots[motion.slot];
            place.now = motion.target.as_dvec3();
            if place.kind == Kind::Free {
                place.kind = Kind::Pinned(number);
            }
        }
        Self { slots, origin: view.origin.as_dvec3(), pairs: Vec::new() }
    }

    /// The motion by which the particles in these slots were moved as a whole: all of them, or the free ones and some
    /// of the pinned, while the others move by themselves.
    fn motion_of(&mut self, slots: &[u32]) -> Option<RigidMotion> {
        let places = || slots.iter().map(|slot| &self.slots[*slot as usize]);
        let free = || places().filter(|place| place.kind == Kind::Free);
        let moved = free().filter(|place| place.now != place.before).count();
        // At most half of them lie on the axis of a rotation, or all do.
        if moved == 0 || 2 * moved < free().count() {
            return None;
        }
        let pinned = places().filter(|place| matches!(place.kind, Kind::Pinned(_)));
        self.pairs.clear();
        self.pairs.extend(pinned.map(|place| [place.before, place.now]));
        let pinned = self.pairs.len();
        self.pairs.extend(free().map(|place| [place.before, place.now]));
        let tolerance = |pairs: &[[DVec3; 2]]| {
            let coordinates = pairs.iter().flatten().map(|place| (*place + self.origin).abs().max_element());
            TOLERANCE * coordinates.fold(0.0, f64::max)
        };
        if let Some(motion) = RigidMotion::fit(&self.pairs, tolerance(&self.pairs)) {
            return Some(motion);
        }
        let (pinned, free) = self.pairs.split_at(pinned);
        let motion = RigidMotion::fit(free, tolerance(free))?;
        pinned.iter().any(|[before, now]| follows(&motion, *before, *now)).then_some(motion)
    }

    /// Moves those of the particles in these slots for which no motion has been found yet.
    fn carry_out(
        &mut self,
        motion: &RigidMotion,
        slots: &[u32],
        solver: &mut solver::State,
        pinned: &mut [PinnedMotion],
    ) {
        for slot in slots.iter().map(|slot| *slot as usize) {
            let Place { kind, before, now, keeps_velocity, is_done } = self.slots[slot];
            let carried = motion.apply(before);
            match kind {
                Kind::Free if !is_done => {
                    solver.carry(slot, carried.as_vec3(), |vector| motion.turn(vector));
                    if !keeps_velocity {
                        let velocity = &mut solver.particles.velocity;
                        velocity.set(slot, motion.turn(velocity.get(slot)));
                    }
                    self.slots[slot].is_done = true;
                }
                Kind::Pinned(number) if !is_done && follows(motion, before, now) => {
                    let size = (now + self.origin)
                        .abs()
                        .max_element()
                        .max((before + self.origin).abs().max_element());
                    let is_there = carried.distance(now) <= 4.0 * TOLERANCE * size;
                    let PinnedMotion { start, target, .. } = &mut pinned[number];
                    *start = if is_there { *target } else { carried.as_vec3() };
                    self.slots[slot].is_done = true;
                }
                _ => {}
            }
        }
    }
}

/// Whether a pinned particle went along: the motion brings it nearer to where it is now.
fn follows(motion: &RigidMotion, before: DVec3, now: DVec3) -> bool {
    motion.apply(before).distance(now) < before.distance(now)
}
