//! TR-BDF2: the trapezoidal rule to the time t + γh, then the second backward difference formula. Second order.
//!
//! Bank et al., *Transient simulation of silicon devices and circuits*, IEEE Trans. CAD 4, 436 (1985); Hosea and
//! Shampine, *Analysis and implementation of TR-BDF2*, Appl. Num. Math. 20, 21 (1996). With γ = 2 − √2 and
//! s = γh/2, and y = (x, v):
//!
//! ```text
//! yₘ = y + s ẏ + s ẏₘ
//! y' = (1 + w) yₘ − w y + s ẏ'        w = (1 − γ)² / (γ (2 − γ))
//! ```
//!
//! Each stage is a step of backward Euler of s seconds from another start, so that all of `newton.rs` and `system.rs`
//! serves it; dampers measure the rate of their length by the same formulas. It is L-stable: what the step does not
//! resolve decays. Of a mode of frequency ω a step takes (1 − 1/√2)⁴ (hω)⁴ of the energy, where backward Euler
//! takes (hω)².
//!
//! It was compared with others on a stiff pendulum that swings for 20 s, with as many solutions in a tick
//! (docs/conformance.md has the numbers). SDIRK2 (Alexander 1977) has the same stability function, but its first stage
//! is of first order: the velocity along a stiff spring that turns is then wrong by O(h), and a third of the energy is
//! lost. BDF2, and generalised-α (Chung and Hulbert 1993) that damps the highest modes as much, lose four times as
//! much as TR-BDF2, and must remember more, which contacts invalidate.
//!
//! The accelerations by elements at the start of a step are those of the end of the step before, [`Pulls`]. Where
//! there are none they are evaluated; where those would carry a particle by a large part of an element, the step
//! does not resolve how the net springs back, and what backward Euler makes of it is better. So it is while something
//! touches the island or would at the end of the step, as contacts are a part of that of backward Euler; and where
//! large turns of a crumpled sheet would give the step more energy than it began with: the stability is that of the
//! linear system.

use bevy::math::DVec3;

use super::block::Symmetric;
use super::contacts::PairFilter;
use super::gas;
use super::linearised::Linearised;
use super::system::{Compound, System, combine};
use super::write;
use crate::solver::collision::{Obstacle, Obstacles, Surroundings};
use crate::solver::elements::Elements;
use crate::solver::field::Field;
use crate::solver::graph::Elimination;
use crate::solver::particles::{Particles, Vectors};
use crate::solver::pulls::{Pulls, Validity};

/// s/h = 1 − 1/√2.
pub(super) const STAGE: f64 = 1.0 - std::f64::consts::FRAC_1_SQRT_2;

/// w = (√2 − 1)/2.
const WEIGHT: f64 = (std::f64::consts::SQRT_2 - 1.0) / 2.0;

/// (1 − γ)/γ: how much later the end of a step is than that of the trapezoidal rule, as a part of the time before.
const LATER: f64 = std::f64::consts::FRAC_1_SQRT_2;

/// The largest displacement s² a by the forces at the start, as a part of the shortest element.
const MAX_KICK: f64 = 0.25;

/// How much energy a step may gain, as a part of the kinetic energy. What it gains by its own error on a resolved
/// motion is far less.
const MAX_GAIN: f64 = 1e-3;

/// The start of a step, and of a stage; vectors by node, lengths and rates by element.
#[derive(Debug, Clone, Default)]
pub(super) struct Stages {
    start: Vec<Motion>,
    stage: Vec<Motion>,
    /// By free node.
    loads: Vec<Load>,
    pull: Vec<DVec3>,
    /// By free node: the accelerations at the end of a stage, as extrapolated from what is known, times s, m/s.
    guesses: Vec<DVec3>,
    elements: Vec<Length>,
    /// The tension of each element at the end of the trapezoidal rule, N; empty after a step of backward Euler.
    middle: Vec<f64>,
    /// Working space: the gradient of the volume of a gas, m².
    gradient: Vec<DVec3>,
}

/// m and m/s
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Motion {
    pub position: DVec3,
    pub velocity: DVec3,
}

/// What acts on a node apart from elements, and from what air does across filaments.
#[derive(Debug, Clone, Copy, Default)]
struct Load {
    /// kg
    mass: f64,
    /// The acceleration that does not depend on its motion, m/s².
    push: DVec3,
    /// How fast it is stopped, 1/s.
    rate: f64,
}

/// The length ‖s‖ of an element at the start, m, and its rate, m/s.
#[derive(Debug, Clone, Copy, Default)]
struct Length {
    length: f64,
    rate: f64,
}

/// What does not change within a tick.
#[derive(Clone, Copy)]
pub(super) struct Context<'a> {
    pub elimination: &'a Elimination,
    pub elements: &'a Elements,
    pub field: Field<'a>,
    /// The substep, s.
    pub h: f64,
}

impl Stages {
    /// Reads the start of a step. False: the step is one for backward Euler.
    pub fn begin(&mut self, context: Context, particles: &Particles, pulls: &Pulls) -> bool {
        let Context { elimination, field, h, .. } = context;
        let free = &elimination.slots[..elimination.free];
        let mut is_known = true;
        for &slot in free {
            match pulls.validity(slot as usize) {
                Validity::Touching => return false,
                Validity::Unknown => is_known = false,
                Validity::PreviousTick | Validity::CurrentTick => {}
            }
        }
        let motion_of = |slot: &u32| {
            let slot = *slot as usize;
            let (position, velocity) = (particles.position.get(slot), particles.velocity.get(slot));
            Motion { position: position.as_dvec3(), velocity: velocity.as_dvec3() }
        };
        self.start.clear();
        self.start.extend(elimination.slots.iter().map(motion_of));
        self.loads.clear();
        self.loads.extend(free.iter().map(|slot| {
            let slot = *slot as usize;
            let inverse_mass = f64::from(particles.inverse_mass()[slot]);
            let force = inverse_mass * particles.applied_force.get(slot).as_dvec3();
            let push = field.acceleration_without_filaments(slot) + force;
            Load { mass: 1.0 / inverse_mass, push, rate: field.decay_rate(slot, inverse_mass) }
        }));
        self.pull.clear();
        if is_known {
            self.pull.extend(free.iter().map(|slot| pulls.get(*slot as usize).as_dvec3()));
        }
        let shortest = self.measure_elements(context, particles, !is_known);
        let stage = STAGE * h;
        let largest = self.pull.iter().map(|pull| pull.length_squared()).fold(0.0, f64::max).sqrt();
        stage * stage * largest <= MAX_KICK * shortest
    }

    /// Measures the lengths of the elements and, if they are `wanted`, the accelerations by them; returns the shortest
    /// length, m.
    fn measure_elements(&mut self, context: Context, particles: &Particles, wanted: bool) -> f64 {
        let Context { elimination, elements, .. } = context;
        let Self { start, pull, elements: lengths, gradient, .. } = self;
        if wanted {
            pull.resize(elimination.free, DVec3::ZERO);
        }
        lengths.clear();
        let mut shortest = f64::INFINITY;
        let mut measure = |number: u32, nodes: &[u32], weights: &[f64]| {
            let ends = || nodes.iter().map(|node| *node as usize).zip(weights);
            let (mut separation, mut speed) = (DVec3::ZERO, DVec3::ZERO);
            for (node, weight) in ends() {
                separation += start[node].position * *weight;
                speed += start[node].velocity * *weight;
            }
            let length = separation.length();
            let direction = if length > 0.0 { separation / length } else { DVec3::ZERO };
            let rate = direction.dot(speed);
            lengths.push(Length { length, rate });
            let (rates, rest_length, tension_only) = elements.coefficients(number);
            shortest = shortest.min(length.max(rest_length));
            if wanted {
                let tension =
                    f64::from(rates.stiffness) * (length - rest_length) + f64::from(rates.damping) * rate;
                let is_slack = tension_only && (length <= rest_length || tension < 0.0);
                let tension = if is_slack { 0.0 } else { tension };
                for (node, weight) in ends().filter(|(node, _)| *node < elimination.free) {
                    let inverse_mass = f64::from(particles.inverse_mass()[elimination.slots[node] as usize]);
                    pull[node] -= direction * (tension * weight * inverse_mass);
                }
            }
        };
        for (number, ends) in elimination.elements.iter().zip(&elimination.ends) {
            measure(*number, ends, &[1.0, -1.0]);
        }
        for compound in &elimination.compounds {
            measure(compound.element, compound.ends(), &elements.weights(compound.element));
        }
        if wanted {
            gas::for_each_force(
                elimination,
                elements,
                |node| start[node].position,
                gradient,
                |node, push| {
                    pull[node] +=
                        push * f64::from(particles.inverse_mass()[elimination.slots[node] as usize]);
                },
            );
        }
        shortest
    }

    /// To be called when the step is one of backward Euler.
    pub fn clear(&mut self) {
        self.middle.clear();
    }

    /// The mean tension of an element over the step, from that at its end, N: the rule weighs start, middle and end by
    /// √2/4, √2/4 and s/h, and the start is near the end. At rest the mean is exact, while that at the end
    /// wavers with the rounding of positions.
    pub fn mean_tension(&self, element: usize, end: f64) -> f64 {
        const MIDDLE: f64 = 0.5 * std::f64::consts::FRAC_1_SQRT_2;
        self.middle.get(element).map_or(end, |middle| end + MIDDLE * (middle - end))
    }

    /// Sets `system` up for the trapezoidal rule.
    pub fn begin_trapezoid(&mut self, system: &mut System, context: Context) {
        let Context { elimination, field, h, .. } = context;
        let s = STAGE * h;
        self.stage.clear();
        self.stage.extend(self.start.iter().enumerate().map(|(node, &Motion { position, velocity })| {
            let mut kicked = velocity;
            if node < elimination.free {
                let Load { push, rate, .. } = self.loads[node];
                let filaments = field.filament(elimination.slots[node] as usize).map(|load| load.across());
                let across = filaments.map_or(DVec3::ZERO, |(across, air)| across * (air - velocity));
                kicked += s * (self.pull[node] + push + across - rate * velocity);
            }
            Motion { position: position + s * velocity, velocity: kicked }
        }));
        self.guesses.clear();
        let motions = self.start.iter().zip(&self.stage).take(elimination.free);
        self.guesses.extend(motions.map(|(start, stage)| stage.velocity - start.velocity));
        for (inertia, Load { mass, rate, .. }) in system.inertia.iter_mut().zip(&self.loads) {
            *inertia = mass * (1.0 / s + rate) / s;
        }
        let length = |Length { length, rate }: &Length, _: DVec3| length + s * rate;
        self.begin_stage(system, context, length);
    }

    /// Sets `system`, which holds the solution of the trapezoidal rule, up for the backward difference formula.
    pub fn begin_difference(&mut self, system: &mut System, context: Context) {
        self.middle.clear();
        self.middle.extend(system.tensions(context.elimination));
        let s = STAGE * context.h;
        let extrapolated = |middle: DVec3, start: DVec3| middle + WEIGHT * (middle - start);
        for (node, (stage, start)) in self.stage.iter_mut().zip(&self.start).enumerate() {
            let middle = system.position[node];
            let velocity = (middle - stage.position) / s;
            if let Some(guess) = self.guesses.get_mut(node) {
                let at_middle = velocity - stage.velocity;
                *guess = at_middle + LATER * (at_middle - *guess);
            }
            *stage = Motion {
                position: extrapolated(middle, start.position),
                velocity: extrapolated(velocity, start.velocity),
            };
        }
        let length = |start: &Length, middle: DVec3| {
            let middle = middle.length();
            middle + WEIGHT * (middle - start.length)
        };
        self.begin_stage(system, context, length);
    }

    /// Sets `system` up for a step of backward Euler from `stage`. The elements have their `length` there, which
    /// follows from that at the start of the step and from their separation as `system` has it.
    fn begin_stage(&mut self, system: &mut System, context: Context, length: impl Fn(&Length, DVec3) -> f64) {
        let Context { elimination, elements, field, h } = context;
        let s = STAGE * h;
        system.contacts.clear();
        system.load = 1.0;
        system.tethers.clear();
        system.gases.begin(elimination, elements);
        // The dampers' lengths are taken before the positions are others.
        system.elements.clear();
        let two_ends = elimination.elements.iter().zip(&elimination.ends).zip(&self.elements);
        for ((&number, &[first, second]), start) in two_ends {
            let separation = system.position[first as usize] - system.position[second as usize];
            let staged = self.stage[first as usize].position - self.stage[second as usize].position;
            system.elements.push(staged_element(elements, number, staged, length(start, separation), s));
        }
        system.compounds.clear();
        let compounds = elimination.compounds.iter().zip(&self.elements[elimination.elements.len()..]);
        for (&nodes, start) in compounds {
            let weights = elements.weights(nodes.element);
            let separation = combine(&nodes, weights, &system.position);
            let ends = nodes.ends().iter().zip(weights);
            let staged = ends.map(|(node, weight)| self.stage[*node as usize].position * weight).sum();
            let element = staged_element(elements, nodes.element, staged, length(start, separation), s);
            system.elements.push(element);
            system.compounds.push(Compound { nodes, weights, block: Symmetric::default() });
        }
        for (node, &Motion { position, velocity }) in self.stage.iter().enumerate() {
            system.start[node] = position;
            system.position[node] = position + s * velocity;
            if node < elimination.free {
                system.position[node] += s * self.guesses[node];
                let Load { mass, push, rate } = self.loads[node];
                system.flight[node] = position + s * (velocity + s * push) / (1.0 + s * rate);
                let slot = elimination.slots[node] as usize;
                system.tethers.add((node, position), (slot, mass), field, s);
            }
        }
    }

    /// Whether a particle has entered something that nothing in the step can move: contacts are a part of backward
    /// Euler.
    pub fn enters_obstacle(
        &self,
        system: &System,
        context: Context,
        particles: &Particles,
        (obstacles, surroundings, filter): (&Obstacles, Surroundings, &PairFilter),
    ) -> bool {
        let Context { elimination, h, .. } = context;
        let enters = |(node, &slot): (usize, &u32)| {
            let radius = f64::from(particles.radius()[slot as usize]);
            let mut any = false;
            let near = (slot as usize, surroundings);
            let (start, end) = (self.start[node].position, system.position[node]);
            let may_collide = |obstacle: &Obstacle| {
                let overlaps = || obstacle.gap(start + h * obstacle.motion_at(start), radius).0 < 0.0;
                obstacle.pinned_slot().is_none_or(|pinned| {
                    radius > 0.0 && filter.may_collide(node, slot, pinned as u32, overlaps())
                })
            };
            obstacles.near(near, end, radius, [0.0; 2], |obstacle, _| any |= may_collide(obstacle));
            if !any && obstacles.any_swept() {
                obstacles.near(near, start, radius, [start.distance(end), h], |obstacle, _| {
                    any |= obstacle.met([start, end], radius).is_some() && may_collide(obstacle);
                });
            }
            any
        };
        !obstacles.is_empty() && elimination.slots[..elimination.free].iter().enumerate().any(enters)
    }

    /// Whether the solution of the last stage has more energy than the start, while no pinned particle moves.
    pub fn gains_energy(&self, system: &System, context: Context) -> bool {
        let Context { elimination, elements, field, h } = context;
        if self.start[elimination.free..].iter().any(|pinned| pinned.velocity != DVec3::ZERO) {
            return false;
        }
        let s = STAGE * h;
        let (mut kinetic, mut new_kinetic, mut gained) = (0.0, 0.0, 0.0);
        for (node, &Load { mass, push, .. }) in self.loads.iter().enumerate() {
            let (start, position) = (self.start[node], system.position[node]);
            let velocity = (position - self.stage[node].position) / s;
            kinetic += 0.5 * mass * start.velocity.length_squared();
            new_kinetic += 0.5 * mass * velocity.length_squared();
            let filaments = field.filament(elimination.slots[node] as usize).map(|load| load.across());
            let push = filaments.map_or(push, |(across, air)| push + across * air);
            gained -= mass * push.dot(position - start.position);
        }
        let mut stretch = |number: u32, start: Length, length: f64| {
            let (rates, rest_length, tension_only) = elements.coefficients(number);
            let least = if tension_only { rest_length } else { 0.0 };
            let [start, end] = [start.length, length].map(|length| length.max(least) - rest_length);
            gained += 0.5 * f64::from(rates.stiffness) * (end - start) * (end + start);
        };
        let mut starts = self.elements.iter().copied();
        let position = &system.position;
        for ((&number, &[first, second]), start) in
            elimination.elements.iter().zip(&elimination.ends).zip(&mut starts)
        {
            stretch(number, start, position[first as usize].distance(position[second as usize]));
        }
        for (nodes, start) in elimination.compounds.iter().zip(starts) {
            stretch(nodes.element, start, combine(nodes, elements.weights(nodes.element), position).length());
        }
        let of_gases = |position: &dyn Fn(usize) -> DVec3| system.gases.energy(elimination, position);
        gained += of_gases(&|node| position[node]) - of_gases(&|node| self.start[node].position);
        new_kinetic + gained > kinetic + MAX_GAIN * kinetic.max(new_kinetic)
    }

    /// Writes the solution of the last stage back.
    pub fn finish(
        &self,
        system: &System,
        context: Context,
        particles: &mut Particles,
        acceleration: &mut Vectors,
    ) {
        let Context { elimination, h, .. } = context;
        let free = elimination.slots[..elimination.free].iter();
        for ((slot, &position), stage) in free.zip(&system.position).zip(&self.stage) {
            let velocity = (position - stage.position) / (STAGE * h);
            write(particles, acceleration, *slot as usize, [position, velocity], h);
        }
    }
}

/// The element for a stage of `s` seconds that begins with the separation `start`, but with another `length`.
fn staged_element(elements: &Elements, number: u32, start: DVec3, length: f64, s: f64) -> Linearised {
    Linearised::new(elements.potential(number, length.max(0.0), s), start, start.length())
}
