//! Stiff nets that touch something: contacts are a part of the implicit step.

use bevy::math::Vec3;
use bevy_mass_spring::solver::{
    self, Collider, ContactPartner, Integrator, PairRules, Solver, StepSettings, SubstepMode,
};

const GRAVITY: f32 = 9.81;
const SPACING: f32 = 0.1;
const MASS: f32 = 0.02;
const RADIUS: f32 = 0.02;

fn settings(time_step: f32) -> StepSettings {
    StepSettings { time_step, gravity: Vec3::NEG_Y * GRAVITY, ..StepSettings::default() }
}

/// A lattice of points whose lowest ones are `height` above the ground, neighbours and diagonals joined.
fn lattice(size: [usize; 3], inside: impl Fn(Vec3) -> bool, stiffness: f32, height: f32) -> Solver {
    let mut state = Solver::default();
    let [nx, ny, nz] = size;
    let middle = Vec3::new(nx as f32 - 1.0, ny as f32 - 1.0, nz as f32 - 1.0) * 0.5;
    let mut points = Vec::new();
    for (i, j, k) in (0..nx).flat_map(|i| (0..ny).flat_map(move |j| (0..nz).map(move |k| (i, j, k)))) {
        let place = Vec3::new(i as f32, j as f32, k as f32);
        if inside(place - middle) {
            points.push(place);
        }
    }
    let lowest = points.iter().map(|place| place.y).fold(f32::INFINITY, f32::min);
    for place in &points {
        let position = (*place - Vec3::Y * lowest) * SPACING + Vec3::Y * (height + RADIUS);
        state.add_particle(position, Vec3::ZERO, MASS, RADIUS).unwrap();
    }
    for (one, place) in points.iter().enumerate() {
        for (other, next) in points.iter().enumerate().skip(one + 1) {
            if (*next - *place).abs().max_element() < 1.5 {
                let rest_length = state.position(one).distance(state.position(other));
                let spring =
                    solver::Spring { rest_length, stiffness, damping: 0.5, ..solver::Spring::default() };
                state.add_spring([one, other], spring).unwrap();
            }
        }
    }
    state.add_collider(Collider::half_space(Vec3::ZERO, Vec3::Y, 0.0, 0.0));
    state
}

/// What rounding positions to f32 may put into the springs, J: ½ k (2 ulp)² for each.
fn rounding(state: &Solver, stiffness: f32, height: f32) -> f64 {
    let ulps = 2.0 * f64::from((height + 1.0) * f32::EPSILON);
    0.5 * f64::from(stiffness) * ulps * ulps * state.spring_count() as f64
}

/// Drops a net and watches it for `seconds`: its energy never rises above what it had.
fn drop_net(state: &mut Solver, stiffness: f32, height: f32, time_step: f32, seconds: f32) -> f64 {
    let settings = settings(time_step);
    let before = state.measure(settings.gravity).total_energy();
    let allowed = 1.001 * before + rounding(state, stiffness, height);
    let mut stretch = 0.0_f64;
    for tick in 0..(seconds / time_step) as u32 {
        state.step(&settings);
        let now = state.measure(settings.gravity);
        let label =
            || format!("k {stiffness:e}, {height} m, {time_step} s, tick {tick}: {now:?}, before {before}");
        assert!(now.total_energy() <= allowed, "{}", label());
        assert!(now.elastic_energy + now.kinetic_energy <= allowed, "{}", label());
        stretch = stretch.max(now.max_stretch);
    }
    stretch
}

const SHAPES: [([usize; 3], f32); 4] =
    [([2, 2, 2], 9.0), ([8, 2, 2], 9.0), ([2, 6, 2], 9.0), ([5, 5, 5], 2.3)];

fn shape(number: usize, stiffness: f32, height: f32) -> Solver {
    let (size, radius) = SHAPES[number];
    lattice(size, |place| place.length() < radius, stiffness, height)
}

#[test]
fn a_dropped_net_gains_no_energy_at_any_stiffness_height_or_time_step() {
    for number in 0..SHAPES.len() {
        for stiffness in [1e4, 1e6, 1e7, 1e8, 1e9] {
            for (height, time_step) in [
                (0.1, 1.0 / 120.0),
                (1.5, 1.0 / 60.0),
                (10.0, 1.0 / 30.0),
                (10.0, 1.0 / 60.0),
                (10.0, 1.0 / 120.0),
            ] {
                let mut state = shape(number, stiffness, height);
                drop_net(&mut state, stiffness, height, time_step, (2.0 * height / GRAVITY).sqrt() + 0.7);
            }
        }
    }
}

#[test]
fn cubes_of_a_thousand_points_gain_no_energy() {
    for (stiffness, height) in [(1e5, 1.0), (1e9, 0.1)] {
        let mut state = lattice([10, 10, 10], |_| true, stiffness, height);
        drop_net(&mut state, stiffness, height, 1.0 / 60.0, (2.0 * height / GRAVITY).sqrt() + 0.2);
    }
}

/// The peak of the stretch, against velocity Verlet in a hundredth of its stable step.
#[test]
fn an_impact_stretches_at_most_twice_what_it_should() {
    for (number, stiffness) in [(0, 1e6), (0, 1e7), (1, 1e6), (3, 1e6)] {
        let (height, time_step, seconds) = (1.0, 1.0 / 60.0, 0.6);
        let found = drop_net(&mut shape(number, stiffness, height), stiffness, height, time_step, seconds);
        let mut reference = shape(number, stiffness, height);
        let fine = StepSettings { integrator: Integrator::VelocityVerlet, ..settings(1.0 / 6000.0) };
        let bounds = reference.frequency_bounds(0.0);
        let substeps = (bounds.auto_substeps(Integrator::VelocityVerlet, 1.0 / 6000.0)).max(4);
        let fine = StepSettings { substeps: SubstepMode::Fixed(2 * substeps), ..fine };
        let mut right = 0.0_f64;
        for _ in 0..(seconds * 6000.0) as u32 {
            reference.step(&fine);
            right = right.max(reference.measure(fine.gravity).max_stretch);
        }
        assert!(found <= 2.0 * right, "shape {number}, k {stiffness:e}: {found}, expected about {right}");
    }
}

/// What lies on the ground weighs what it weighs, and is as little squashed as its weight demands: each of the lower
/// half of n layers of springs carries at most the weight of all.
#[test]
fn a_net_at_rest_weighs_what_it_weighs() {
    let shapes = (0..SHAPES.len()).flat_map(|number| [1e4, 1e5, 1e7, 1e9].map(|k| (number, k)));
    for ((number, stiffness), ticks) in shapes.flat_map(|shape| [30, 60, 120].map(|ticks| (shape, ticks))) {
        let mut state = shape(number, stiffness, 0.05);
        let settings = settings(1.0 / ticks as f32);
        for _ in 0..10 * ticks {
            state.step(&settings);
        }
        state.outputs_mut().record_contacts = true;
        state.step(&settings);
        let outputs = state.outputs();
        let substeps = outputs.plan.substeps.max(1);
        let impulse: f32 = outputs.contacts.iter().map(|contact| contact.impulse * contact.normal.y).sum();
        let weight = MASS * state.particle_count() as f32 * GRAVITY;
        let carried = impulse / settings.time_step;
        assert!(
            (carried / weight - 1.0).abs() < 0.02,
            "shape {number} k {stiffness:e}, 1/{ticks} s × {substeps}: {carried} {weight}"
        );
        let now = state.measure(settings.gravity);
        let least = f64::from(weight / stiffness / SPACING) + 4.0 * f64::from(f32::EPSILON / SPACING);
        assert!(now.max_stretch < 2.0 * least, "shape {number}, k {stiffness:e}: {now:?}, {least}");
        let fall = f64::from(weight * 0.05);
        assert!(now.kinetic_energy < 1e-4 * fall, "shape {number}, k {stiffness:e}: {now:?}");
    }
}

/// Points along an edge of the cloth.
const CLOTH: usize = 31;

/// A column of balls on springs on the ground: each spring is shorter by the weight above it over k, and has the energy of that.
/// Rounding of positions below 1 m may change a length by an ulp.
#[test]
fn a_column_rests_on_what_its_weight_presses_together() {
    let schemes = [
        Integrator::Auto,
        Integrator::SemiImplicitEuler,
        Integrator::VelocityVerlet,
        Integrator::ImplicitEuler,
        Integrator::TrBdf2,
    ];
    for integrator in schemes {
        for (mass, stiffness, count) in
            [(0.02, 1e4, 2), (1.0, 1e5, 2), (1.0, 1e4, 5), (100.0, 1e7, 2), (0.02, 1e5, 2)]
        {
            let mut state = Solver::default();
            for ball in 0..count {
                let place = Vec3::Y * (RADIUS + SPACING * ball as f32);
                state.add_particle(place, Vec3::ZERO, mass, RADIUS).unwrap();
                if ball > 0 {
                    let damping = 0.2 * (stiffness * mass).sqrt();
                    let spring =
                        solver::Spring { rest_length: SPACING, stiffness, damping, ..Default::default() };
                    state.add_spring([ball - 1, ball], spring).unwrap();
                }
            }
            state.add_collider(Collider::half_space(Vec3::ZERO, Vec3::Y, 0.0, 0.0));
            let settings = StepSettings { integrator, ..settings(1.0 / 60.0) };
            let is_implicit = matches!(integrator, Integrator::ImplicitEuler | Integrator::TrBdf2);
            let substeps = if is_implicit { SubstepMode::Fixed(2) } else { SubstepMode::Auto };
            let settings = StepSettings { substeps, ..settings };
            for _ in 0..1800 {
                state.step(&settings);
            }
            let label = format!("{integrator}, {count} balls of {mass} kg, {stiffness} N/m");
            for spring in 1..count {
                let expected = mass * GRAVITY * (count - spring) as f32 / stiffness;
                let found = SPACING - state.position(spring - 1).distance(state.position(spring));
                let rounding = f32::EPSILON * SPACING * count as f32;
                assert!(
                    (found - expected).abs() < 0.02 * expected + rounding,
                    "{label}: {found} of {expected} m"
                );
            }
            assert!(state.position(0).y > 0.999 * RADIUS, "{label}: {}", state.position(0));
            assert!(
                (0..count).all(|ball| state.velocity(ball).length() < 1e-3),
                "{label}: {}",
                state.velocity(0)
            );
        }
    }
}

/// A cloth above a pinned ball at the origin.
fn cloth_above_ball(stiffness: f32) -> Solver {
    let mut state = Solver::default();
    let (side, spacing) = (CLOTH, 0.05_f32);
    let middle = (side / 2) as f32;
    let at =
        |i: usize, j: usize| Vec3::new(i as f32 - middle, 0.0, j as f32 - middle) * spacing + Vec3::Y * 0.52;
    for (i, j) in (0..side).flat_map(|i| (0..side).map(move |j| (i, j))) {
        state.add_particle(at(i, j), Vec3::ZERO, 0.001, 0.005).unwrap();
    }
    for (i, j) in (0..side).flat_map(|i| (0..side).map(move |j| (i, j))) {
        for (di, dj) in [(0, 1), (1, 0), (1, 1), (1, -1)] {
            let (k, l) = (i + di, j as isize + dj);
            if k < side && (0..side as isize).contains(&l) {
                let l = l as usize;
                let spring = solver::Spring {
                    rest_length: at(i, j).distance(at(k, l)),
                    stiffness,
                    damping: 0.0,
                    ..solver::Spring::default()
                };
                state.add_spring([i * side + j, k * side + l], spring).unwrap();
            }
        }
    }
    state.add_particle(Vec3::ZERO, Vec3::ZERO, f32::INFINITY, 0.4).unwrap();
    state
}

/// Adds `added` to `state`, displaced, with a velocity.
fn put(state: &mut Solver, added: &Solver, displacement: Vec3, velocity: Vec3) {
    let first = state.particle_count();
    for particle in 0..added.particle_count() {
        let mass = 1.0 / added.inverse_mass(particle);
        let position = added.position(particle) + displacement;
        state.add_particle(position, velocity, mass, added.radius(particle)).unwrap();
    }
    for spring in 0..added.spring_count() {
        let (ends, spring) = added.spring(spring);
        state.add_spring(ends.map(|end| end + first), spring).unwrap();
    }
}

fn colliding(restitution: f32, friction: f32, time_step: f32) -> StepSettings {
    StepSettings { pair_rules: Some(PairRules { restitution, friction }), ..settings(time_step) }
}

fn momentum(state: &Solver) -> Vec3 {
    let particles = 0..state.particle_count();
    particles.map(|particle| state.velocity(particle) / state.inverse_mass(particle)).sum()
}

/// Two stiff cubes meet face to face: of equal mass, so that they stop at a restitution of 0 and exchange their
/// velocities at 1.
#[test]
fn stiff_cubes_collide_as_bodies() {
    for (restitution, stiffness) in [(0.0, 1e7), (1.0, 1e7), (0.0, 1e9)] {
        let cube = lattice([3, 3, 3], |_| true, stiffness, 1.0);
        let mut state = Solver::default();
        put(&mut state, &cube, Vec3::ZERO, Vec3::X * 5.0);
        put(&mut state, &cube, Vec3::X * 0.5, Vec3::X * -5.0);
        let settings = StepSettings { gravity: Vec3::ZERO, ..colliding(restitution, 0.0, 1.0 / 60.0) };
        let before = state.measure(Vec3::ZERO).total_energy();
        for tick in 0..30 {
            state.step(&settings);
            let now = state.measure(Vec3::ZERO);
            assert!(now.total_energy() < 1.001 * before, "tick {tick}: {now:?}, before {before}");
            // Of 27 particles of 5 m/s and 0.02 kg on each side, rounded in each.
            assert!(momentum(&state).length() < 2e-5, "tick {tick}: {}", momentum(&state));
        }
        let (one, other) = (state.velocity(13), state.velocity(27 + 13));
        let expected = Vec3::X * 5.0 * restitution;
        assert!((one + expected).length() < 0.05 && (other - expected).length() < 0.05, "{one} {other}");
        let gap = (27..54).map(|particle| state.position(particle).x).fold(f32::INFINITY, f32::min)
            - (0..27).map(|particle| state.position(particle).x).fold(f32::NEG_INFINITY, f32::max);
        assert!(gap > 2.0 * RADIUS - 1e-3, "they overlap: {gap}");
    }
}

/// Stiff cubes on top of each other: the ground carries all, and each joint what is above it.
#[test]
fn a_tower_of_stiff_cubes_stands() {
    let cube = lattice([3, 3, 3], |_| true, 1e7, 0.0);
    let mut state = Solver::default();
    for number in 0..3_u8 {
        put(&mut state, &cube, Vec3::Y * 0.2405 * f32::from(number), Vec3::ZERO);
    }
    state.add_collider(Collider::half_space(Vec3::ZERO, Vec3::Y, 0.0, 0.5));
    let settings = colliding(0.0, 0.5, 1.0 / 60.0);
    let before = state.measure(settings.gravity).total_energy();
    let weight = 27.0 * MASS * GRAVITY;
    for tick in 0..300 {
        state.step(&settings);
        let now = state.measure(settings.gravity);
        assert!(now.total_energy() < before, "tick {tick}: {now:?}, before {before}");
    }
    state.outputs_mut().record_contacts = true;
    state.step(&settings);
    let now = state.measure(settings.gravity);
    assert!(now.kinetic_energy < 1e-6 && now.max_stretch < 1e-4, "{now:?}");
    let mut carried = [0.0; 3];
    for contact in &state.outputs().contacts {
        let level = match contact.other {
            ContactPartner::Collider(_) => 0,
            ContactPartner::Particle(other) => contact.slot.max(other) / 27,
            other => panic!("{other:?} is not in the scene"),
        };
        carried[level] += (contact.impulse * contact.normal.y).abs() / settings.time_step;
    }
    for (level, carried) in carried.into_iter().enumerate() {
        let expected = weight * (3 - level) as f32;
        assert!((carried / expected - 1.0).abs() < 0.02, "joint {level}: {carried} N, expected {expected}");
    }
}

/// A stiff rope falls across another one that hangs between two pinned ends, and is held.
#[test]
fn stiff_ropes_hold_each_other() {
    let mut state = Solver::default();
    let links = 20_usize;
    let mut rope = |direction: Vec3, height: f32, pinned: bool| {
        for knot in 0..=links {
            let place = direction * (knot as f32 - links as f32 / 2.0) * 0.04 + Vec3::Y * height;
            let mass = if pinned && knot % links == 0 { f32::INFINITY } else { 0.01 };
            let number = state.add_particle(place, Vec3::ZERO, mass, 0.02).unwrap();
            if knot > 0 {
                let spring = solver::Spring {
                    rest_length: 0.0401,
                    stiffness: 1e6,
                    damping: 0.0,
                    ..solver::Spring::default()
                };
                state.add_spring([number - 1, number], spring).unwrap();
            }
        }
    };
    rope(Vec3::X, 1.0, true);
    rope(Vec3::Z, 1.1, false);
    let settings = colliding(0.0, 0.3, 1.0 / 60.0);
    let before = state.measure(settings.gravity).total_energy();
    for tick in 0..60 {
        state.step(&settings);
        let now = state.measure(settings.gravity);
        assert!(now.total_energy() < before + 1e-3, "tick {tick}: {now:?}, before {before}");
        assert!(now.max_stretch < 0.02, "tick {tick}: {now:?}");
    }
    let (held, holding) = (state.position(21 + 10), state.position(10));
    assert!(held.y > holding.y, "it has passed through: {held} {holding}");
}

/// It comes to rest on the ball, hardly stretched, and has lost what the fall brought.
#[test]
#[cfg_attr(debug_assertions, ignore = "takes minutes unoptimised")]
fn a_stiff_cloth_rests_on_a_ball() {
    let mut state = cloth_above_ball(1e6);
    let settings = colliding(0.0, 0.5, 1.0 / 60.0);
    let fall = (CLOTH * CLOTH) as f64 * 0.001 * f64::from(GRAVITY) * 0.115;
    let before = state.measure(settings.gravity).total_energy();
    for tick in 0..600 {
        state.step(&settings);
        let now = state.measure(settings.gravity);
        assert!(now.total_energy() < 1.001 * before, "tick {tick}: {now:?}, before {before}");
    }
    let now = state.measure(settings.gravity);
    assert!(now.max_stretch < 0.01 && now.kinetic_energy < 1e-4 * fall, "{now:?}, the fall {fall} J");
}
