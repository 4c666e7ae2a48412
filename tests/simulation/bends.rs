//! Bends in the solver: beams, columns and arcs against closed forms; conserved quantities; bounds; ropes that touch.

use bevy::math::{DVec3, Vec3};
use bevy_mass_spring::solver::{Bend, Integrator, PairRules, Solver, Spring, StepSettings, SubstepMode};

const GRAVITY: f32 = 9.81;

const STRAIGHT: [f32; 3] = [1.0, -2.0, 1.0];

fn rod(stiffness: f32, rest_length: f32, damping: f32) -> Bend<3> {
    Bend { rest_length, stiffness, damping, weights: STRAIGHT }
}

fn fixed(integrator: Integrator, substeps: u32, time_step: f32) -> StepSettings {
    StepSettings { integrator, substeps: SubstepMode::Fixed(substeps), time_step, ..StepSettings::default() }
}

fn place(solver: &Solver, number: usize) -> DVec3 {
    solver.position(number).as_dvec3()
}

/// Particles at `places`, of these masses, joined by springs of stretch stiffness `tension` (N) at their distances and by
/// rods of bending stiffness `bending` (N·m²), which are straight at rest.
///
/// With the curvature κ = ‖x − 2 y + z‖ / h² a rod holds the energy ½ EI κ² of a length h: k = EI / h³.
fn rope(places: &[Vec3], masses: impl Fn(usize) -> f32, tension: f32, bending: f32) -> Solver {
    let mut solver = Solver::default();
    for (number, position) in places.iter().enumerate() {
        solver.add_particle(*position, Vec3::ZERO, masses(number), 0.0).expect("good values");
    }
    for (number, pair) in places.windows(2).enumerate() {
        let h = pair[0].distance(pair[1]);
        solver.add_spring([number, number + 1], Spring::elastic(h, tension / h, 0.0)).expect("good values");
    }
    for (number, three) in places.windows(3).enumerate() {
        let h = 0.5 * (three[0].distance(three[1]) + three[1].distance(three[2]));
        let ends = [number, number + 1, number + 2];
        solver.add_rod(ends, rod(bending / h.powi(3), 0.0, 0.0)).expect("good values");
    }
    solver
}

/// A rod of 1 m, clamped at the middle of its first link, which is pinned, under its own weight: where its tip sinks to,
/// as a part of w l⁴ / (8 EI), which is 1 cm.
///
/// Summed by hand, the discrete rod sinks by a part of h²/(2 l²) less: the midpoint rule. That the rod is shortened by
/// its slope is of the order of 10⁻⁴.
fn sunk(links: usize, settings: &StepSettings, ticks: usize) -> f64 {
    let h = 1.0 / (links as f32 - 0.5);
    let places: Vec<Vec3> = (0..=links).map(|number| Vec3::X * ((number as f32 - 0.5) * h)).collect();
    let density = 0.1;
    let bending = density * GRAVITY / (8.0 * 0.01);
    let masses = |number: usize| match number {
        0 | 1 => f32::INFINITY,
        number if number == links => 0.5 * density * h,
        _ => density * h,
    };
    let mut solver = rope(&places, masses, 1e5, bending);
    for _ in 0..ticks {
        solver.step(settings);
    }
    -place(&solver, links).y / 0.01
}

#[test]
fn a_clamped_rod_sinks_as_eulers_beam_does_at_every_resolution() {
    // The lowest frequency is 39 rad/s: backward Euler leaves 1 / 39² of a deviation after each second.
    let settings =
        StepSettings { gravity: Vec3::NEG_Y * GRAVITY, ..fixed(Integrator::ImplicitEuler, 1, 1.0) };
    for links in [20, 40, 80, 160] {
        let found = sunk(links, &settings, 8);
        let expected = 1.0 - 0.5 / (links as f64 - 0.5).powi(2);
        assert!((found - 1.0).abs() < 0.005, "{links} links: {found}");
        assert!((found - expected).abs() < 3e-4, "{links} links: {found}, summed by hand {expected}");
    }
}

/// One round over the elements in each substep leaves a stiff beam too soft; ten links at 200 substeps are near.
#[test]
fn position_based_dynamics_bends_a_short_rod_as_the_others_do() {
    let gravity = Vec3::NEG_Y * GRAVITY;
    let mut settings = StepSettings { gravity, ..fixed(Integrator::Xpbd, 400, 1.0 / 60.0) };
    settings.viscosity = 0.1;
    let found = sunk(10, &settings, 60);
    assert!((found - 1.0).abs() < 0.05, "{found}");
}

/// A column of 1 m between two hinges is pressed together by the part `load` of π² EI / L² and nudged sideways by
/// 10 µm in its middle; how far it has come after 600 steps of h ω = 0.5, as a part of the nudge.
fn buckled(load: f32) -> f64 {
    let links = 40;
    let h = 1.0 / links as f32;
    let (tension, density) = (1e4, 0.1);
    // The strain at Euler's load is 10⁻³.
    let bending = 1e-3 * tension / std::f32::consts::PI.powi(2);
    let strain = 1e-3 * load;
    let nudge = 1e-5;
    let mut solver = Solver::default();
    for number in 0..=links {
        let along = number as f32 * h;
        let sideways = nudge * (std::f32::consts::PI * along).sin();
        let mass = if number == 0 || number == links { f32::INFINITY } else { density * h };
        let position = Vec3::new(sideways, along * (1.0 - strain), 0.0);
        solver.add_particle(position, Vec3::ZERO, mass, 0.0).expect("good values");
    }
    for number in 0..links {
        solver.add_spring([number, number + 1], Spring::elastic(h, tension / h, 0.0)).expect("good values");
    }
    for number in 1..links {
        solver
            .add_rod([number - 1, number, number + 1], rod(bending / h.powi(3), 0.0, 0.0))
            .expect("good values");
    }
    let omega = std::f32::consts::PI.powi(2) * (bending / density).sqrt();
    let settings = fixed(Integrator::ImplicitEuler, 1, 0.5 / omega);
    for _ in 0..600 {
        solver.step(&settings);
    }
    place(&solver, links / 2).x.abs() / f64::from(nudge)
}

/// Below the load ω² is 5 % of that without it, and backward Euler takes (1 + 0.05 · 0.5²)^½ off a deviation in each
/// step: e^-3.7 in all. 5 % above it grows by e^0.11 a step until the rod has given way, by
/// 2/π √(0.05 · 10⁻³) m = 4.5 mm.
#[test]
fn a_column_stands_below_eulers_load_and_buckles_above_it() {
    let (below, above) = (buckled(0.95), buckled(1.05));
    assert!(below < 0.03, "{below}");
    assert!((300.0..500.0).contains(&above), "{above}");
}

/// A bent, moving rope with straight, curved and damped rods, and hinges.
fn tangle(damping: f32) -> Solver {
    let wobble = |number: usize, factor: usize| (number * factor % 17) as f32 * 0.004;
    let places: Vec<Vec3> =
        (0..24).map(|number| Vec3::new(0.1 * number as f32, wobble(number, 7), wobble(number, 11))).collect();
    let mut solver = rope(&places, |number| 0.1 + 0.01 * (number % 3) as f32, 20.0, 0.002);
    for number in 0..24 {
        let velocity = Vec3::new(wobble(number, 3), wobble(number, 5), -wobble(number, 13)) * 10.0;
        solver.set_velocity(number, velocity);
    }
    for number in 0..22 {
        let curved = rod(2.0, 0.01 * (number % 4) as f32, damping);
        solver.add_rod([number + 2, number + 1, number], curved).expect("good values");
    }
    for number in 0..21 {
        let weights = [0.25, -0.75, 1.0, -0.5];
        let hinge = Bend { rest_length: 0.02, stiffness: 1.0, damping, weights };
        solver.add_hinge([number, number + 3, number + 1, number + 2], hinge).expect("good values");
    }
    solver
}

/// Σ m v and Σ m x × v.
fn momenta(solver: &Solver) -> [DVec3; 2] {
    let mut sums = [DVec3::ZERO; 2];
    for number in 0..solver.particle_count() {
        let momentum = solver.velocity(number).as_dvec3() / f64::from(solver.inverse_mass(number));
        sums[0] += momentum;
        sums[1] += place(solver, number).cross(momentum);
    }
    sums
}

/// Velocities of at most 1 m/s of 24 particles of 0.12 kg are rounded by 2⁻²⁴ at each of 40 · 4 substeps, at most 2.3 m
/// from the origin; so are the forces, of at most 30 N with all elements of a particle, times the substep of 1/256 s.
#[test]
fn free_ropes_keep_momentum_in_every_scheme_and_angular_momentum_where_the_scheme_does() {
    let rounding = 24.0 * 160.0 * 6e-8 * (0.12 + 30.0 / 256.0);
    for integrator in Integrator::named() {
        let mut solver = tangle(0.01);
        let before = momenta(&solver);
        for _ in 0..40 {
            solver.step(&fixed(integrator, 4, 1.0 / 64.0));
        }
        let after = momenta(&solver);
        assert!((after[0] - before[0]).length() < rounding, "{integrator}: {before:?} {after:?}");
        assert!((solver.position(12) - tangle(0.01).position(12)).length() > 0.01, "{integrator}: it moves");
    }
    for integrator in [Integrator::SemiImplicitEuler, Integrator::VelocityVerlet] {
        let mut solver = tangle(0.0);
        let before = momenta(&solver);
        for _ in 0..40 {
            solver.step(&fixed(integrator, 4, 1.0 / 64.0));
        }
        let change = momenta(&solver)[1] - before[1];
        assert!(change.length() < 2.3 * rounding, "{integrator}: {change}");
    }
}

/// An arc of 24 links whose rods have their rest length, and nothing but: every scheme leaves it as it is, its energy is
/// zero; bent to another radius it springs back: its slowest motion, of 1.2 rad/s, is damped by e^-t in 9 s.
#[test]
fn an_arc_keeps_the_shape_that_it_has_at_rest_in_every_scheme() {
    let arc = |angle: f32| -> Vec<Vec3> {
        // Of links of 0.1 m.
        let radius = 0.05 / (0.5 * angle).sin();
        (0..25)
            .map(|number| {
                Vec3::new((number as f32 * angle).sin(), (number as f32 * angle).cos(), 0.0) * radius
            })
            .collect()
    };
    let build = |angle: f32| {
        let mut solver = rope(&arc(angle), |_| 0.1, 1e3, 0.0);
        for number in 0..23 {
            // ‖x − 2 y + z‖ = 2 h sin(α/2)
            let bend = rod(100.0, 0.2 * 0.05_f32.sin(), 0.1);
            solver.add_rod([number, number + 1, number + 2], bend).expect("good values");
        }
        solver
    };
    for integrator in Integrator::named() {
        let mut solver = build(0.1);
        if solver.frequency_bounds(0.0).largest_stable_step(integrator) < 1.0 / (16.0 * 64.0) {
            assert!([Integrator::ExplicitEuler, Integrator::SecondOrderTaylor].contains(&integrator));
            continue;
        }
        for _ in 0..20 {
            solver.step(&fixed(integrator, 16, 1.0 / 64.0));
        }
        // Positions of 1 m are rounded by 6e-8 m, separations of four of them by 2.4e-7 m: ½ k s² of 47 elements of at
        // most 10⁴ N/m.
        let energy = solver.measure(Vec3::ZERO).total_energy();
        assert!(energy < 47.0 * 0.5 * 1e4 * 2.4e-7_f64.powi(2) * 4.0, "{integrator}: {energy} J");
        let mut straightened = build(0.05);
        let bent =
            |solver: &Solver| (place(solver, 0) - 2.0 * place(solver, 12) + place(solver, 24)).length();
        let (start, rest) = (bent(&straightened), bent(&build(0.1)));
        for _ in 0..600 {
            straightened.step(&StepSettings { viscosity: 0.2, ..fixed(integrator, 16, 1.0 / 64.0) });
        }
        let found = bent(&straightened);
        assert!((found - rest).abs() < 0.05 * (rest - start).abs(), "{integrator}: {start} {found} {rest}");
    }
}

/// A rope of springs k and rods k' on masses m has waves of ω² = (4 k sin²(θ/2) + 16 k' sin⁴(θ/2)) / m, at most at θ = π.
#[test]
fn the_frequency_bound_of_a_rope_with_rods_is_that_of_its_shortest_wave() {
    for (tension, bending) in [(10.0_f32, 0.02_f32), (10.0, 1e-9), (1e-3, 0.02)] {
        let places: Vec<Vec3> = (0..64).map(|number| Vec3::X * 0.1 * number as f32).collect();
        let mut solver = rope(&places, |_| 0.5, tension, bending);
        let bounds = solver.frequency_bounds(0.0);
        let exact = f64::from(4.0 * tension / 0.1 + 16.0 * bending / 0.001) / 0.5;
        assert!((bounds.angular_frequency.powi(2) / exact - 1.0).abs() < 1e-5, "{bounds:?} {exact}");
        assert!(!bounds.has_loops, "ropes with rods are solved directly");
    }
}

/// Rods of a rest length are no springs: the stretches are those of springs alone. The energy of an arc is ½ EI κ² of its
/// length, to the order of the square of the angle between links.
#[test]
fn energies_include_bends_and_stretches_do_not() {
    let angle = 0.02_f32;
    let radius = 0.05 / (0.5 * angle).sin();
    let at = |number: usize| Vec3::new((number as f32 * angle).sin(), (number as f32 * angle).cos(), 0.0);
    let places: Vec<Vec3> = (0..50).map(|number| at(number) * radius).collect();
    let mut solver = rope(&places, |_| 0.1, 1e3, 0.5);
    let energy = 0.5 * 0.5 / f64::from(radius).powi(2) * 4.8;
    let found = solver.measure(Vec3::ZERO);
    assert!((found.elastic_energy / energy - 1.0).abs() < 1e-3, "{} {energy}", found.elastic_energy);
    solver.add_rod([0, 1, 2], rod(1.0, 5.0, 0.0)).expect("good values");
    assert!(solver.measure(Vec3::ZERO).max_stretch < 1e-5);
}

/// Two ropes with rods fly into each other crosswise under implicit Euler: what is between two contacts is no longer
/// eliminated directly. Momentum is kept as well as velocities are rounded, energy is not gained, and neither passes.
#[test]
fn stiff_ropes_that_cross_push_each_other() {
    let mut solver = Solver::default();
    for (height, direction, across) in [(0.0, Vec3::X, Vec3::Z), (0.25, Vec3::Z, Vec3::X)] {
        for number in 0..41 {
            // Two arches that meet in two places.
            let along = 0.05 * (number as f32 - 20.0);
            let arch = if height == 0.0 { 0.0 } else { 0.1 * (1.0 - along * along) };
            let position = along * direction + Vec3::Y * (height - arch) + across * 0.01;
            let velocity = Vec3::Y * if height == 0.0 { 0.5 } else { -0.5 };
            solver.add_particle(position, velocity, 0.01, 0.03).expect("good values");
        }
    }
    for first in [0, 41] {
        for number in first..first + 40 {
            let rest = (place(&solver, number) - place(&solver, number + 1)).length() as f32;
            solver.add_spring([number, number + 1], Spring::elastic(rest, 1e4, 0.0)).expect("good values");
        }
        for number in first..first + 39 {
            let ends = [number, number + 1, number + 2];
            solver.add_rod(ends, rod(1e3, 0.0, 0.0)).expect("good values");
        }
    }
    let settings = StepSettings {
        pair_rules: Some(PairRules { restitution: 0.0, friction: 0.3 }),
        ..fixed(Integrator::ImplicitEuler, 2, 1.0 / 64.0)
    };
    let (start, mut last) = (momenta(&solver)[0], solver.measure(Vec3::ZERO).total_energy());
    let mut touched = 0;
    for tick in 0..60 {
        touched += solver.step(&settings).contact_count;
        let energy = solver.measure(Vec3::ZERO).total_energy();
        assert!(energy < last * (1.0 + 1e-3) + 1e-6, "tick {tick}: {last} J became {energy} J");
        last = energy;
    }
    assert!(touched > 0, "they meet");
    let moved = (momenta(&solver)[0] - start).length();
    assert!(moved < 82.0 * 120.0 * 6e-8 * 0.01 * 4.0, "{moved}");
    assert!(solver.position(20).y < solver.position(61).y, "neither passes");
}
