//! Strain limits: springs that are never longer than (1 + `max_stretch`) rest lengths at the end of a substep.
//!
//! They come last in a substep, after the contacts: a limit is a promise about what is seen, a contact may be deep by
//! a slop and is solved again in the next substep. Every correction is an impulse along a spring between its two
//! ends, so that momentum is kept:
//!
//! 1. **Motion.** A spring that has been stretched beyond its limit L in this substep was drawn out by the velocity
//!    of its ends. An impulse J takes back J/m of the velocities and h J/m of the positions, along the direction e in
//!    which the ends were at its start, s − h ṡ: then the angular momentum is the same as before, to the bit of the
//!    arithmetic, since Σ (x − h v) × J = 0. (SHAKE: Ryckaert, Ciccotti and Berendsen, *J. Comput. Phys.* 23, 327,
//!    1977.) A pendulum on a limit so keeps its energy. Where that would add energy, as it may in fast and tangled
//!    motions, the impulses act along the present directions instead: then each is a step towards a convex set in
//!    which everything was when the substep began, and adds none.
//! 2. **Velocity.** What still parts the ends of a spring at its limit is removed, inelastically. (RATTLE: Andersen,
//!    *J. Comput. Phys.* 52, 24, 1983; with inequalities.) It never adds energy.
//! 3. **Excess.** What was too long before the substep already (a limit was lowered, an end was moved) is drawn
//!    together without a velocity. Should the iterations end before that, in groups without loops each particle is
//!    put to the limit from the one before it, outwards: then the limit holds whatever happens.
//!
//! Each is a complementarity problem, an impulse >= 0 for each spring. Groups without loops (ropes, nets of branches)
//! with one anchor at most are solved directly (`tree.rs`), however heavy what hangs on them; others by successive
//! over-relaxation in the order outwards from what is pinned, and back.

mod problem;
mod tree;

use bevy::math::DVec3;

use crate::solver::elements::Elements;
use crate::solver::graph::{LimitGroup, Limits};
use crate::solver::particles::Particles;
use problem::{Link, Problem};

/// Lengths are limited to this part of the limit in groups without loops, if their particles can be brought there.
const TREE_TOLERANCE: f64 = 1e-6;

/// The same in groups with loops.
const LOOP_TOLERANCE: f64 = 2e-4;

/// The part of an excess that may be left; if it is more, the limits contradict each other.
const MAX_EXCESS_LEFT: f64 = 0.25;

/// Maximal number of rounds in which the excess is removed.
const MAX_ROUNDS: usize = 4;

/// The gain of kinetic energy in a substep that is an error of higher order, as a part of it.
const ENERGY_ERROR: f64 = 1e-6;

/// The springs with a strain limit, and working memory.
#[derive(Debug, Clone, Default)]
pub(super) struct StrainLimits {
    limits: Limits,
    problem: Problem,
    position: Vec<DVec3>,
    velocity: Vec<DVec3>,
    /// Positions before the excess is removed.
    before: Vec<DVec3>,
}

impl StrainLimits {
    /// Derives what follows from the elements.
    pub fn prepare(&mut self, elements: &Elements, particles: &Particles) {
        self.limits.refresh(elements, particles);
    }

    /// Whether there is any limit.
    pub fn any(&self) -> bool {
        !self.limits.groups.is_empty()
    }

    /// Draws what has become too long in a substep of `substep` seconds together, and calls `on_moved` for each particle
    /// that it moves; returns whether there is any.
    pub fn apply(
        &mut self,
        elements: &Elements,
        particles: &mut Particles,
        substep: f32,
        mut on_moved: impl FnMut(usize),
    ) -> bool {
        let mut any = false;
        let h = f64::from(substep);
        let Self { limits, problem, position, velocity, before } = self;
        for group in &limits.groups {
            if !is_exceeded(group, elements, particles) {
                continue;
            }
            problem.begin(group, particles);
            for keeps_direction in [true, false] {
                load(group, particles, [position, velocity]);
                let energy = problem.kinetic_energy(velocity);
                take_back_motion(problem, group, elements, [position, velocity], (h, keeps_direction));
                remove_parting_velocity(problem, [position, velocity], h);
                if problem.kinetic_energy(velocity) <= energy * (1.0 + ENERGY_ERROR) {
                    break;
                }
            }
            remove_excess(problem, position, before);
            if position.iter().chain(&*velocity).all(|vector| vector.is_finite()) {
                any = true;
                for (node, slot) in group.slots[..group.free].iter().enumerate() {
                    particles.position.set(*slot as usize, position[node].as_vec3());
                    particles.velocity.set(*slot as usize, velocity[node].as_vec3());
                    on_moved(*slot as usize);
                }
            }
        }
        any
    }
}

/// Takes over the motion of a group.
fn load(group: &LimitGroup, particles: &Particles, [position, velocity]: [&mut Vec<DVec3>; 2]) {
    position.clear();
    velocity.clear();
    for slot in group.slots.iter().map(|slot| *slot as usize) {
        position.push(particles.position.get(slot).as_dvec3());
        velocity.push(particles.velocity.get(slot).as_dvec3());
    }
}

/// The limit of the length of a spring, m.
fn limit(elements: &Elements, spring: u32) -> f64 {
    let spring = elements.springs().elements()[spring as usize];
    (1.0 + f64::from(spring.max_stretch.unwrap_or(f32::MAX))) * f64::from(spring.length_at_rest())
}

fn is_exceeded(group: &LimitGroup, elements: &Elements, particles: &Particles) -> bool {
    group.links.iter().any(|link| {
        let [outer, inner] =
            link.nodes.map(|node| particles.position.get(group.slots[node as usize] as usize).as_dvec3());
        outer.distance_squared(inner) > limit(elements, link.spring).powi(2)
    })
}

/// Step 1: impulses that change velocities and positions alike, along the directions at the start of the substep or
/// along the present ones.
fn take_back_motion(
    problem: &mut Problem,
    group: &LimitGroup,
    elements: &Elements,
    [position, velocity]: [&mut Vec<DVec3>; 2],
    (h, keeps_direction): (f64, bool),
) {
    problem.links.clear();
    problem.links.extend(group.links.iter().map(|link| {
        let [outer, inner] = link.nodes.map(|node| node as usize);
        let separation = position[outer] - position[inner];
        let start = separation - h * (velocity[outer] - velocity[inner]);
        let limit = limit(elements, link.spring);
        let direction = if keeps_direction { start } else { separation };
        Link {
            nodes: [outer, inner],
            limit,
            bound: limit.max(start.length()),
            along: direction.normalize_or_zero(),
            keeps_direction,
            impulse: 0.0,
        }
    }));
    problem.solve_positions(position);
    for (node, velocity) in velocity.iter_mut().enumerate() {
        *velocity += problem.change(node) / h;
    }
}

/// Step 2: impulses that stop the parting of ends at their limit.
fn remove_parting_velocity(problem: &mut Problem, [position, velocity]: [&mut Vec<DVec3>; 2], h: f64) {
    let slack = 2.0 * problem.tolerance;
    for link in &mut problem.links {
        let separation = position[link.nodes[0]] - position[link.nodes[1]];
        let is_taut = separation.length() >= link.limit * (1.0 - slack);
        link.along = if is_taut { separation.normalize_or_zero() } else { DVec3::ZERO };
        (link.keeps_direction, link.impulse) = (false, 0.0);
    }
    problem.solve_velocities(velocity, h);
}

/// Step 3: positions alone. What cannot be brought together (both ends pinned too far apart) is left as it is.
fn remove_excess(problem: &mut Problem, position: &mut Vec<DVec3>, before: &mut Vec<DVec3>) {
    before.clone_from(position);
    let mut excess = f64::INFINITY;
    for round in 0..MAX_ROUNDS {
        for link in &mut problem.links {
            let separation = position[link.nodes[0]] - position[link.nodes[1]];
            (link.along, link.bound, link.impulse) = (separation.normalize_or_zero(), link.limit, 0.0);
        }
        if round == 0 {
            excess = problem.worst_length(position);
        }
        if problem.solve_positions(position) {
            return;
        }
    }
    if !problem.has_loops() {
        for link in &problem.links {
            let [outer, inner] = link.nodes.map(|node| position[node]);
            position[link.nodes[0]] = inner + (outer - inner).clamp_length_max(link.limit);
        }
        return;
    }
    if problem.worst_length(position) > MAX_EXCESS_LEFT * excess {
        position.clone_from(before);
    }
}
