//! Springs that break and yield, in every scheme.

use bevy::math::{DVec3, Vec3};
use bevy_mass_spring::solver::{Integrator, Plasticity, Solver, Spring, StepSettings, SubstepMode};

const GRAVITY: Vec3 = Vec3::new(0.0, -9.81, 0.0);
const LINKS: usize = 10;

fn settings(integrator: Integrator, substeps: u32, gravity: Vec3) -> StepSettings {
    let substeps =
        if integrator == Integrator::Auto { SubstepMode::Auto } else { SubstepMode::Fixed(substeps) };
    StepSettings { integrator, substeps, gravity, ..StepSettings::default() }
}

fn all() -> impl Iterator<Item = Integrator> {
    Integrator::named().chain([Integrator::Auto])
}

/// A hanging rope of `LINKS` links of 0.1 m and particles of 0.05 kg, stretched as the statics say; the first is pinned.
fn rope(link: Spring) -> Solver {
    let mut solver = Solver::default();
    let mut height = 0.0;
    for number in 0..=LINKS {
        if number > 0 {
            let below = (LINKS + 1 - number) as f32 * 0.05;
            height -= 0.1 + below * 9.81 / link.stiffness;
        }
        let mass = if number == 0 { f32::INFINITY } else { 0.05 };
        solver.add_particle(Vec3::Y * height, Vec3::ZERO, mass, 0.0).unwrap();
    }
    for number in 0..LINKS {
        solver.add_spring([number, number + 1], link).unwrap();
    }
    solver
}

/// Under its own weight and a load that grows by 0.5 N/s, the link at the anchor breaks, and it alone, when
/// weight and load are its breaking force. The bar is 1 %. Vibrations are damped: with c = 2 N·s/m the lowest mode of
/// the rope, ω ≈ (π/2) √(k/m) / 10, fades within a second, and the load lags by some 10 ms.
#[test]
fn a_rope_breaks_where_and_when_the_statics_say() {
    let link = Spring { breaking_force: Some(6.0), ..Spring::elastic(0.1, 500.0, 2.0) };
    let weight = LINKS as f32 * 0.05 * 9.81;
    for integrator in all() {
        let mut solver = rope(link);
        // Xpbd is as stiff as its springs only in the limit of short substeps.
        let substeps = if integrator == Integrator::Xpbd { 256 } else { 32 };
        let settings = settings(integrator, substeps, GRAVITY);
        let mut load = 0.0;
        let broken = loop {
            assert!(load < 3.0, "{integrator}: it never breaks");
            load += 0.5 * settings.time_step;
            solver.set_applied_force(LINKS, Vec3::NEG_Y * load);
            let broken = &solver.step(&settings).broken;
            if !broken.is_empty() {
                break broken.clone();
            }
        };
        assert_eq!(broken.len(), 1, "{integrator}");
        assert_eq!(broken[0].spring, 0, "{integrator}: the one at the anchor");
        let force = weight + load;
        assert!((force / 6.0 - 1.0).abs() < 0.01, "{integrator}: broke at {force} N");
        assert!((broken[0].tension / 6.0 - 1.0).abs() < 0.01, "{integrator}: {} N", broken[0].tension);
        assert_eq!(solver.spring(0).1, Spring::default(), "{integrator}: it is removed");
        // All else falls, and nothing else breaks.
        for _ in 0..60 {
            assert!(solver.step(&settings).broken.is_empty(), "{integrator}");
        }
        assert!(solver.position(1).y < -2.0, "{integrator}");
    }
}

/// A free rope of masses that are drawn apart: what breaks changes neither momentum nor angular momentum, and
/// the energy only falls.
#[test]
fn a_break_keeps_momentum_and_adds_no_energy() {
    for integrator in all() {
        let link = Spring { breaking_force: Some(20.0), ..Spring::elastic(0.1, 400.0, 0.2) };
        let mut solver = Solver::default();
        for number in 0..=LINKS {
            let place = Vec3::new(number as f32 * 0.1, (number % 3) as f32 * 0.01, 0.0);
            let velocity = Vec3::new(number as f32 * 1.5, 1.0, number as f32 * 0.2);
            solver.add_particle(place, velocity, 0.05, 0.0).unwrap();
        }
        for number in 0..LINKS {
            solver.add_spring([number, number + 1], link).unwrap();
        }
        let settings = settings(integrator, 64, Vec3::ZERO);
        let measured = |solver: &Solver| {
            let momentum = |number: usize| solver.velocity(number).as_dvec3() * 0.05;
            let turning = |number: usize| solver.position(number).as_dvec3().cross(momentum(number));
            let numbers = 0..=LINKS;
            let sums: [DVec3; 2] = [numbers.clone().map(momentum).sum(), numbers.map(turning).sum()];
            (sums, solver.measure(Vec3::ZERO))
        };
        let ([momentum, turning], start) = measured(&solver);
        let (mut count, mut energy) = (0, start.kinetic_energy + start.elastic_energy);
        for _ in 0..60 {
            count += solver.step(&settings).broken.len();
            let ([now, turning_now], measures) = measured(&solver);
            assert!((now - momentum).length() < 1e-5 * momentum.length(), "{integrator}: {now}, {momentum}");
            // Explicit Euler and Taylor's scheme gain energy and angular momentum by themselves, with or without breaks.
            if !matches!(integrator, Integrator::ExplicitEuler | Integrator::SecondOrderTaylor) {
                let sum = measures.kinetic_energy + measures.elastic_energy;
                // Symplectic schemes let the energy waver by a part of (ω h)² of it.
                let slack = 2e-3 * start.kinetic_energy;
                assert!(sum < energy + slack, "{integrator}: {energy} J to {sum} J");
                energy = energy.min(sum);
                let change = (turning_now - turning).length();
                // 3840 substeps, each of which rounds positions of up to 15 m by a part in 2^24, of momenta up to 0.8 N·s.
                assert!(change < 3840.0 * 15.0 * 6e-8 * 0.8, "{integrator}: angular momentum {change}");
            }
        }
        assert!((1..=LINKS).contains(&count), "{integrator}: {count} broke");
        if !matches!(integrator, Integrator::ExplicitEuler | Integrator::SecondOrderTaylor) {
            assert!(energy < 0.999 * start.kinetic_energy, "{integrator}: {energy} J");
        }
    }
}

/// Of links that all carry the same, beyond what they can, one breaks, and its release unloads the others. What carries
/// twice its breaking force breaks in any case.
#[test]
fn of_a_uniform_tension_one_link_breaks_and_of_twice_that_all() {
    for integrator in Integrator::named() {
        for (load, expected) in [(1.05, 1), (2.05, LINKS)] {
            let link = Spring { breaking_force: Some(5.0), ..Spring::elastic(0.1, 400.0, 0.5) };
            let mut solver = Solver::default();
            for number in 0..=LINKS {
                let mass = if number == 0 || number == LINKS { f32::INFINITY } else { 0.05 };
                let place = Vec3::X * (number as f32 * (0.1 + load * 5.0 / 400.0));
                solver.add_particle(place, Vec3::ZERO, mass, 0.0).unwrap();
            }
            for number in 0..LINKS {
                solver.add_spring([number, number + 1], link).unwrap();
            }
            let mut settings = settings(integrator, 1, Vec3::ZERO);
            settings.time_step = 1e-3;
            assert_eq!(solver.step(&settings).plan.substeps, 1);
            assert_eq!(solver.outputs().broken.len(), expected, "{integrator}");
        }
    }
}

/// A weight on a wire: beyond the yield strain the wire flows until it is stopped, and is longer for good. With an
/// elastic strain e at most, the force is at most k l0 e plus the damper's.
#[test]
fn a_wire_that_yields_stays_longer_and_bears_no_more_than_its_yield_force() {
    let plasticity = Plasticity { yield_strain: 0.01, max_strain: 0.2, strain: 0.0 };
    let wire = Spring { plasticity: Some(plasticity), ..Spring::elastic(1.0, 1000.0, 0.0) };
    for integrator in all() {
        let mut solver = Solver::default();
        let anchor = solver.add_particle(Vec3::ZERO, Vec3::ZERO, f32::INFINITY, 0.0).unwrap();
        let bob = solver.add_particle(Vec3::NEG_Y, Vec3::NEG_Y, 1.0, 0.0).unwrap();
        solver.add_spring([anchor, bob], wire).unwrap();
        let settings = settings(integrator, 64, Vec3::ZERO);
        solver.outputs_mut().record_forces = true;
        for _ in 0..60 {
            let tension = solver.step(&settings).tensions[0];
            // What implicit schemes publish is the tension before the wire has yielded: k v h more.
            assert!(tension.abs() < 10.0 + 1000.0 / 60.0 / 64.0 + 0.01, "{integrator}: {tension} N");
        }
        // ½ m v² = ½ k e² + k e p: 0.5 J = 0.05 J + 10 N · p, p = 45 mm. In each substep the force grows by up to k v h
        // before the wire yields, by half of that in the mean.
        let strain = solver.spring(0).1.plasticity.unwrap().strain;
        let beyond = 0.5 * settings.time_step / solver.outputs().plan.substeps as f32 / 0.01;
        assert!((strain - 0.045).abs() < 0.045 * beyond + 5e-4, "{integrator}: {strain}");
        assert_eq!(solver.spring(0).1.rest_length, 1.0);
    }
}

/// The state holds all: with the caches dropped before each tick the same breaks, to the bit.
#[test]
fn breaks_depend_on_the_state_alone() {
    for integrator in all() {
        let run = |drops: bool| {
            let plasticity = Plasticity { yield_strain: 0.005, max_strain: 0.02, strain: 0.0 };
            let link = Spring {
                breaking_force: Some(12.0),
                plasticity: Some(plasticity),
                ..Spring::elastic(0.1, 500.0, 1.0)
            };
            let mut solver = rope(link);
            solver.add_particle(Vec3::new(0.05, -1.3, 0.0), Vec3::Y * -6.0, 0.3, 0.0).unwrap();
            solver.add_spring([LINKS, LINKS + 1], Spring { rest_length: 0.2, ..link }).unwrap();
            let settings = settings(integrator, 4, GRAVITY);
            let mut count = 0;
            for _ in 0..40 {
                if drops {
                    solver.drop_caches();
                }
                count += solver.step(&settings).broken.len();
            }
            let bits = |number| {
                [solver.position(number), solver.velocity(number)].map(|v| v.to_array().map(f32::to_bits))
            };
            (count, (0..solver.particle_count()).map(bits).collect::<Vec<_>>())
        };
        let (count, kept) = run(false);
        assert!(count > 0, "{integrator}");
        assert_eq!((count, kept), run(true), "{integrator}");
    }
}

/// However stiff the links: the ulp of a coordinate of 1 m is 120 N at 10⁹ N/m. The rope of above, its dampers as stiff as its
/// springs: a tenth of √(k m). Within a tick the load grows by 8 mN, 0.14 % of the breaking force.
#[test]
fn a_stiff_rope_breaks_where_and_when_the_statics_say() {
    let explicit = [Integrator::SemiImplicitEuler, Integrator::VelocityVerlet, Integrator::RungeKutta4];
    let implicit = [Integrator::Auto, Integrator::ImplicitEuler, Integrator::TrBdf2];
    for stiffness in [1e5_f32, 1e7, 1e9] {
        // The explicit schemes take thousands of substeps a tick for the stiffest.
        for integrator in implicit.into_iter().chain(explicit.into_iter().filter(|_| stiffness < 1e9)) {
            let damping = 0.1 * (stiffness * 0.05).sqrt();
            let link = Spring { breaking_force: Some(6.0), ..Spring::elastic(0.1, stiffness, damping) };
            let mut solver = rope(link);
            let is_named = matches!(integrator, Integrator::ImplicitEuler | Integrator::TrBdf2);
            let substeps = if is_named { SubstepMode::Fixed(2) } else { SubstepMode::Auto };
            let settings = StepSettings { substeps, ..settings(integrator, 2, GRAVITY) };
            let label = format!("{integrator}, {stiffness:e} N/m");
            let mut load = 0.0;
            let broken = loop {
                assert!(load < 3.0, "{label}: it never breaks");
                load += 0.5 * settings.time_step;
                solver.set_applied_force(LINKS, Vec3::NEG_Y * load);
                let broken = &solver.step(&settings).broken;
                if !broken.is_empty() {
                    break broken.clone();
                }
            };
            assert_eq!(broken.len(), 1, "{label}: {broken:?}");
            assert_eq!(broken[0].spring, 0, "{label}: the one at the anchor");
            let force = LINKS as f32 * 0.05 * 9.81 + load;
            assert!((force / 6.0 - 1.0).abs() < 0.01, "{label}: broke at {force} N");
            assert!((broken[0].tension / 6.0 - 1.0).abs() < 0.01, "{label}: {} N", broken[0].tension);
            for _ in 0..60 {
                assert!(solver.step(&settings).broken.is_empty(), "{label}");
            }
            assert!(solver.position(1).y < -2.0, "{label}");
        }
    }
}
