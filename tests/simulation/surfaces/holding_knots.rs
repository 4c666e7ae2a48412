//! Knots that hold by friction, and slip without.

use std::f32::consts::TAU;

use bevy::math::{DVec3, Vec3};
use bevy_mass_spring::solver::{Bend, Integrator, PairRules, Solver, Spring, StepSettings, SubstepMode};

use super::knots::RADIUS;
use crate::common::bodies::{positions, solver_bits};
use crate::common::crossings::Shapes;
use crate::common::curves::overhand;

/// m
const DIAMETER: f32 = 2.0 * RADIUS;

/// N
const LOAD: f32 = 4.0;

/// Coefficient of friction of ropes that hold.
const ROUGH: f32 = 0.3;

/// By how much a knot may creep that holds, in diameters.
const CREEP: f32 = 0.1;

/// The schemes that do not solve for contacts, with their substeps; `Auto` takes velocity Verlet.
const EXPLICIT: [(Integrator, SubstepMode); 3] = [
    (Integrator::Auto, SubstepMode::Auto),
    (Integrator::SemiImplicitEuler, SubstepMode::Auto),
    (Integrator::Xpbd, SubstepMode::Fixed(25)),
];

/// What holds is looked at after ticks of 1/240 s, what is fast after ticks in which nothing moves by more than a tenth of a
/// diameter or so, as the places in between are not seen; s.
const TICK: f32 = 1.0 / 240.0;
const SHORT_TICK: f32 = 1.0 / 6000.0;

/// Elastic cords of 10 mm, in links of 8 mm, and what of them is not to pass through what.
///
/// They stretch as rubber does, by 3.4 % under the load. As braids they bend more easily, so that the load draws knots tight: along
/// an elastica it bends them to radii down to ½ √(EI/T), 3.5 mm. A chain that does not resist bending would lie in a knot with
/// sharp corners, which catch.
struct Cords {
    solver: Solver,
    shapes: Shapes,
    settings: StepSettings,
}

impl Cords {
    /// kg/m, N, N·m²
    const LINEAR_DENSITY: f32 = 0.073;
    const STRETCH_STIFFNESS: f32 = 118.0;
    const BENDING_STIFFNESS: f32 = 2e-4;
    /// Of the springs, s.
    const RETARDATION_TIME: f32 = 5e-5;

    fn new((integrator, substeps): (Integrator, SubstepMode)) -> Self {
        let pair_rules = Some(PairRules { restitution: 0.0, friction: ROUGH });
        // So that ends do not swing for long: at 8 /s.
        let viscosity = 0.005;
        let settings =
            StepSettings { integrator, substeps, pair_rules, viscosity, ..StepSettings::default() };
        Self { solver: Solver::default(), shapes: Shapes::default(), settings }
    }

    /// Adds a cord along a curve; its particles.
    fn add(&mut self, curve: &[Vec3]) -> Vec<usize> {
        let total: f32 = curve.windows(2).map(|pair| pair[0].distance(pair[1])).sum();
        let count = (total / (0.8 * DIAMETER)).round() as usize;
        let link = total / count as f32;
        let (mut places, mut walked) = (vec![curve[0]], 0.0);
        for pair in curve.windows(2) {
            walked += pair[0].distance(pair[1]);
            if walked >= link * places.len() as f32 && places.len() < count {
                places.push(pair[1]);
            }
        }
        places.push(curve[curve.len() - 1]);
        let Self { solver, shapes, .. } = self;
        let mass = Self::LINEAR_DENSITY * link;
        let add = |place: &Vec3| solver.add_particle(*place, Vec3::ZERO, mass, RADIUS).unwrap();
        let cord: Vec<usize> = places.iter().map(add).collect();
        for ends in cord.windows(2).map(|ends| [ends[0], ends[1]]) {
            let rest_length = solver.position(ends[0]).distance(solver.position(ends[1]));
            let stiffness = Self::STRETCH_STIFFNESS / rest_length;
            let damping = Self::RETARDATION_TIME * stiffness;
            let spring = Spring { rest_length, stiffness, damping, ..Spring::default() };
            solver.add_spring(ends, spring).unwrap();
            solver.add_collision_edge(ends).unwrap();
            shapes.edges.push(ends);
        }
        for ends in cord.windows(3) {
            let stiffness = Self::BENDING_STIFFNESS / link.powi(3);
            let rod = Bend { stiffness, weights: [1.0, -2.0, 1.0], ..Bend::default() };
            solver.add_rod([ends[0], ends[1], ends[2]], rod).unwrap();
        }
        cord
    }

    /// Adds a ring that does not move.
    fn add_ring(&mut self, centre: Vec3, axis: Vec3, radius: f32) {
        let (one, other) = axis.any_orthonormal_pair();
        let corners = 16;
        let first = self.solver.particle_count();
        for corner in 0..corners {
            let (sin, cos) = (TAU * corner as f32 / corners as f32).sin_cos();
            let place = centre + radius * (cos * one + sin * other);
            self.solver.add_particle(place, Vec3::ZERO, f32::INFINITY, RADIUS).unwrap();
        }
        for corner in 0..corners {
            let ends = [first + corner, first + (corner + 1) % corners];
            self.solver.add_collision_edge(ends).unwrap();
            self.shapes.edges.push(ends);
        }
    }

    /// Advances by some seconds, in which nothing may pass through anything.
    fn run(&mut self, seconds: f32, time_step: f32) {
        // Position-based dynamics is as stiff as its substeps are many.
        let is_short = time_step < TICK && self.settings.integrator == Integrator::Xpbd;
        let substeps = if is_short { SubstepMode::Fixed(1) } else { self.settings.substeps };
        let settings = StepSettings { time_step, substeps, ..self.settings };
        for tick in 0..(seconds / time_step).round() as usize {
            let before = positions(&self.solver);
            self.solver.step(&settings);
            let passings = self.shapes.passings(&before, &positions(&self.solver));
            assert_eq!(passings, 0, "{}, {:?}, tick {tick}", settings.integrator, settings.pair_rules);
        }
    }

    /// Has everything slide, and fly on freely.
    fn smooth(&mut self) {
        let pair_rules = Some(PairRules::default());
        self.settings = StepSettings { pair_rules, viscosity: 0.0, ..self.settings };
    }

    /// The mass of some particles, kg, and their momentum, N·s.
    fn momentum(&self, cord: &[usize]) -> (f64, DVec3) {
        let each = cord.iter().map(|particle| {
            let mass = 1.0 / f64::from(self.solver.inverse_mass(*particle));
            (mass, mass * self.solver.velocity(*particle).as_dvec3())
        });
        each.fold((0.0, DVec3::ZERO), |sum, one| (sum.0 + one.0, sum.1 + one.1))
    }

    /// The length of a cord that is not on the straight line between its ends, in diameters.
    fn taken(&self, cord: &[usize]) -> f32 {
        let place = |particle: usize| self.solver.position(particle);
        let length: f32 = cord.windows(2).map(|ends| place(ends[0]).distance(place(ends[1]))).sum();
        (length - place(cord[0]).distance(place(cord[cord.len() - 1]))) / DIAMETER
    }

    /// That a cord on which nothing but its `loads` acts, N, is faster by what they give it in a time: to 1 %.
    fn assert_free(&mut self, cord: &[usize], loads: Vec3) {
        let time = 0.02;
        let (mass, before) = self.momentum(cord);
        self.run(time, SHORT_TICK);
        let given = (self.momentum(cord).1 - before) / f64::from(time);
        let missing = (given - loads.as_dvec3()).length();
        assert!(missing < 0.01 * f64::from(loads.length()), "{missing} N of {loads} on {mass} kg");
    }
}

/// A stopper: an overhand knot in a cord that is pulled through a ring, which the knot does not pass.
struct Stopper {
    cords: Cords,
    cord: Vec<usize>,
    /// Along which it is pulled: from the tail to the load.
    way: Vec3,
    /// Where the ring is along that, m.
    ring: f32,
}

impl Stopper {
    /// A quarter of the load is on the tail. The cord is wound about itself by a turn and more, which at this friction holds a
    /// ratio of e^(0.3 · 2π) = 6.6 where it is pressed together by its own tension alone (Euler 1769).
    const TAIL: f32 = 0.25;

    /// Drawn tight by the load at both ends, before it is in front of the ring.
    fn new(scheme: (Integrator, SubstepMode)) -> Self {
        let mut cords = Cords::new(scheme);
        let curve = overhand(1.0, 4000);
        let cord = cords.add(&curve);
        let (tail, head) = (cord[0], cord[cord.len() - 1]);
        let way = (curve[curve.len() - 1] - curve[0]).normalize();
        cords.solver.set_applied_force(tail, -way * LOAD);
        cords.solver.set_applied_force(head, way * LOAD);
        cords.run(0.5, SHORT_TICK);
        cords.run(1.0, TICK);
        // At least 10.1 diameters (Pieranski et al. 2001) less what contacts yield; more where it resists bending.
        let tight = cords.taken(&cord);
        assert!((0.94 * 10.1..1.2 * 10.1).contains(&tight), "{scheme:?}: {tight} diameters");
        // In front of it the cord is straight.
        let end = cords.solver.position(head);
        let off = |place: Vec3| (place - end).reject_from_normalized(way).length();
        let knot = cord.iter().map(|particle| cords.solver.position(*particle));
        let front =
            knot.filter(|place| off(*place) > RADIUS).map(|place| place.dot(way)).fold(f32::MIN, f32::max);
        let ring = front + 2.5 * RADIUS;
        cords.add_ring(end + way * (ring - end.dot(way)), way, 1.2 * DIAMETER);
        cords.solver.set_applied_force(tail, -way * LOAD * Self::TAIL);
        Self { cords, cord, way, ring }
    }

    /// How far a particle is behind the ring, on the side of the load; diameters.
    fn behind(&self, particle: usize) -> f32 {
        (self.cords.solver.position(particle).dot(self.way) - self.ring) / DIAMETER
    }
}

fn a_stopper_holds(scheme: (Integrator, SubstepMode), seconds: f32) {
    let mut stopper = Stopper::new(scheme);
    stopper.cords.run(2.0, TICK);
    let (tail, knot) = (stopper.cord[0], stopper.cords.taken(&stopper.cord));
    let start = stopper.behind(tail);
    stopper.cords.run(seconds, TICK);
    let crept = stopper.behind(tail) - start;
    let plan = stopper.cords.solver.outputs().plan;
    println!("{scheme:?}: a knot of {knot} diameters crept by {crept} in {seconds} s; {plan:?}");
    assert!(crept.abs() < CREEP, "{scheme:?}: {crept} diameters in {seconds} s");
    let is_auto = scheme.0 == Integrator::Auto;
    assert!(
        !is_auto || plan.integrator == Integrator::VelocityVerlet && plan.stiff_substeps == 0,
        "{plan:?}"
    );
}

#[test]
fn a_stopper_knot_holds_a_quarter_of_the_load_on_its_tail() {
    EXPLICIT.into_iter().for_each(|scheme| a_stopper_holds(scheme, 2.0));
}

#[test]
#[cfg_attr(
    debug_assertions,
    ignore = "the same as the one above for longer: a minute of run time in release"
)]
fn a_stopper_knot_holds_for_a_minute() {
    EXPLICIT.into_iter().for_each(|scheme| a_stopper_holds(scheme, 60.0));
}

/// Without friction the tail is pulled through the knot, and the cord through the ring: there is no knot, which would take 10.1 diameters,
/// and the cord flies off freely.
#[test]
fn a_stopper_knot_without_friction_slips_right_through() {
    for scheme in EXPLICIT {
        let mut stopper = Stopper::new(scheme);
        stopper.cords.smooth();
        stopper.cords.run(0.4, SHORT_TICK);
        let behind = stopper.behind(stopper.cord[0]);
        assert!(behind > 1.0, "{scheme:?}: {behind}");
        let Stopper { mut cords, cord, way, .. } = stopper;
        let taken = cords.taken(&cord);
        assert!(taken < 0.5 * 10.1, "{scheme:?}: {taken} diameters");
        cords.assert_free(&cord, way * LOAD * (1.0 - Stopper::TAIL));
    }
}

/// Two cords that are joined by a reef knot (square knot). The standing ends are pulled by the load, the tails, on the other side of
/// y = 0, by a quarter of it.
struct Reef {
    cords: Cords,
    both: [Vec<usize>; 2],
}

impl Reef {
    const TAILS: f32 = 0.25;

    /// Drawn tight by the load at all four ends.
    fn new(scheme: (Integrator, SubstepMode)) -> Self {
        // One of the two bights, in units of 1.25 diameters; the other one is the same on the other side of the origin. Each has
        // its end about both legs of the other one, on one side of them.
        let bight = [
            [-16.0, 0.7, 0.0],
            [-4.0, 0.7, 0.0],
            [-2.0, 0.7, 0.6],
            [0.0, 1.15, -0.6],
            [1.3, 1.6, 0.0],
            [2.0, 0.7, 0.6],
            [2.0, -0.7, 0.6],
            [1.3, -1.6, 0.0],
            [0.0, -1.15, -0.6],
            [-2.0, -0.7, 0.6],
            [-4.0, -0.7, 0.0],
            [-16.0, -0.7, 0.0],
        ];
        let curve = smooth_curve(&bight.map(|point| Vec3::from(point) * 1.25 * DIAMETER));
        let other: Vec<Vec3> = curve.iter().map(|point| -*point).collect();
        let mut cords = Cords::new(scheme);
        let both = [cords.add(&curve), cords.add(&other)];
        for (cord, side) in both.iter().zip([-1.0, 1.0]) {
            for end in [cord[0], cord[cord.len() - 1]] {
                cords.solver.set_applied_force(end, Vec3::X * side * LOAD);
            }
        }
        cords.run(0.5, SHORT_TICK);
        cords.run(1.0, TICK);
        let tails = [both[0][both[0].len() - 1], both[1][0]];
        for (tail, side) in tails.into_iter().zip([-1.0, 1.0]) {
            cords.solver.set_applied_force(tail, Vec3::X * side * LOAD * Self::TAILS);
        }
        Self { cords, both }
    }

    /// How far apart the standing ends are, in diameters.
    fn standing(&self) -> f32 {
        let [one, other] = &self.both;
        let [first, second] = [one[0], other[other.len() - 1]].map(|end| self.cords.solver.position(end));
        (second.x - first.x) / DIAMETER
    }
}

/// A smooth curve through some points: Catmull and Rom's spline.
fn smooth_curve(points: &[Vec3]) -> Vec<Vec3> {
    let last = points.len() as isize - 1;
    let point = |number: isize| points[number.clamp(0, last) as usize];
    let mut curve = Vec::new();
    for number in 0..last {
        let [a, b, c, d] = [-1, 0, 1, 2].map(|offset| point(number + offset));
        curve.extend((0..400).map(|part| {
            let t = part as f32 / 400.0;
            let cubic = (3.0 * b - 3.0 * c + d - a) * t * t * t;
            0.5 * (2.0 * b + (c - a) * t + (2.0 * a - 5.0 * b + 4.0 * c - d) * t * t + cubic)
        }));
    }
    curve.push(points[points.len() - 1]);
    curve
}

fn a_reef_knot_holds(scheme: (Integrator, SubstepMode), seconds: f32) {
    let mut reef = Reef::new(scheme);
    reef.cords.run(2.0, TICK);
    let start = reef.standing();
    reef.cords.run(seconds, TICK);
    let crept = reef.standing() - start;
    println!("{scheme:?}: a reef knot crept by {crept} diameters in {seconds} s");
    assert!(crept.abs() < CREEP, "{scheme:?}: {crept} diameters in {seconds} s");
}

#[test]
fn a_reef_knot_holds_a_quarter_of_the_load_on_its_tails() {
    EXPLICIT.into_iter().for_each(|scheme| a_reef_knot_holds(scheme, 2.0));
}

#[test]
#[cfg_attr(
    debug_assertions,
    ignore = "the same as the one above for longer: two minutes of run time in release"
)]
fn a_reef_knot_holds_for_a_minute() {
    EXPLICIT.into_iter().for_each(|scheme| a_reef_knot_holds(scheme, 60.0));
}

/// Without friction the cords part, and each flies off as its loads pull it.
#[test]
fn a_reef_knot_without_friction_parts() {
    for scheme in EXPLICIT {
        let mut reef = Reef::new(scheme);
        let start = reef.standing();
        reef.cords.smooth();
        reef.cords.run(0.2, SHORT_TICK);
        let parted = reef.standing() - start;
        assert!(parted > 50.0, "{scheme:?}: {parted} diameters");
        let loads = Vec3::NEG_X * LOAD * (1.0 + Reef::TAILS);
        reef.cords.assert_free(&reef.both[0], loads);
    }
}

/// Where surfaces stick is a part of the state, and holds in ticks of one substep, too: with all caches dropped before each tick the
/// bits are the same, and so they are after a return to an earlier state.
#[test]
fn what_a_knot_sticks_to_is_a_part_of_the_state() {
    let mut stopper = Stopper::new((Integrator::SemiImplicitEuler, SubstepMode::Auto));
    stopper.cords.run(0.5, TICK);
    let Cords { solver, settings, .. } = stopper.cords;
    let settings = StepSettings { substeps: SubstepMode::Fixed(1), time_step: TICK / 60.0, ..settings };
    let mut kept = solver;
    let mut dropped = kept.clone();
    let mut middle = None;
    for tick in 0..400 {
        if tick == 200 {
            middle = Some(kept.state().clone());
        }
        kept.step(&settings);
        dropped.drop_caches();
        dropped.step(&settings);
        assert_eq!(solver_bits(&kept), solver_bits(&dropped), "tick {tick}");
    }
    let end = solver_bits(&kept);
    kept.restore(middle.unwrap());
    (200..400).for_each(|_| _ = kept.step(&settings));
    assert_eq!(solver_bits(&kept), end, "put back");
}
