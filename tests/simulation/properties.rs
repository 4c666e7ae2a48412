//! Properties that hold for random nets of any shape, masses and springs.

use bevy::math::Vec3;
use bevy::prelude::*;
use bevy_mass_spring::prelude::*;
use bevy_mass_spring::solver::{self, Integrator, Solver, StepSettings};
use proptest::prelude::*;

use crate::common::{self, app, hash, run};

/// The largest relative error of one f32 rounding.
const ROUNDING: f64 = f32::EPSILON as f64 / 2.0;

/// A random spring: its ends, the ratio of its rest length to its length, stiffness and damping.
type Link = (usize, usize, f32, f32, f32);

/// A random net, connected or not.
#[derive(Debug, Clone)]
struct Net {
    /// Position, velocity, mass.
    particles: Vec<(Vec3, Vec3, f32)>,
    links: Vec<Link>,
}

/// Particles stand about 1 m apart, on a jittered grid, so that no spring starts near length 0.
fn nets(masses: std::ops::Range<f32>, stiffnesses: std::ops::Range<f32>) -> impl Strategy<Value = Net> {
    let jitter = || prop::array::uniform3(-0.2_f32..0.2);
    (2_usize..12).prop_flat_map(move |count| {
        let particle = (jitter(), prop::array::uniform3(-0.5_f32..0.5), masses.clone());
        let link = (0..count, 0..count, 0.85_f32..1.15, stiffnesses.clone(), 0.0_f32..0.5);
        let particles = prop::collection::vec(particle, count);
        (particles, prop::collection::vec(link, 0..2 * count)).prop_map(|(particles, links)| Net {
            particles: particles
                .into_iter()
                .enumerate()
                .map(|(slot, (jitter, velocity, mass))| {
                    let corner = Vec3::new((slot % 3) as f32, (slot / 3 % 2) as f32, (slot / 6) as f32);
                    (corner + Vec3::from(jitter), Vec3::from(velocity), mass)
                })
                .collect(),
            links: links.into_iter().filter(|(first, second, ..)| first != second).collect(),
        })
    })
}

impl Net {
    fn rest_length(&self, &(first, second, ratio, ..): &Link) -> f32 {
        ratio * self.particles[first].0.distance(self.particles[second].0)
    }

    /// The net in the solver, its particle `slot` in the place `order[slot]`, moved by `shift`.
    fn state(&self, order: &[usize], shift: Vec3) -> Solver {
        let mut state = Solver::default();
        let mut by_place: Vec<_> = order.iter().zip(&self.particles).collect();
        by_place.sort_by_key(|(place, _)| **place);
        for (_, (position, velocity, mass)) in by_place {
            state.add_particle(*position + shift, *velocity, *mass, 0.0).unwrap();
        }
        for link in &self.links {
            let (first, second, _, stiffness, damping) = *link;
            state
                .add_spring(
                    [order[first], order[second]],
                    solver::Spring {
                        rest_length: self.rest_length(link),
                        stiffness,
                        damping,
                        ..solver::Spring::default()
                    },
                )
                .unwrap();
        }
        state
    }

    fn plain_state(&self) -> Solver {
        self.state(&(0..self.particles.len()).collect::<Vec<_>>(), Vec3::ZERO)
    }
}

/// Settings with the step h for which hω is `share`; at most 1/60 s.
fn resolved(state: &mut Solver, share: f64) -> StepSettings {
    let time_step = (share / state.frequency_bounds(0.0).angular_frequency).min(1.0 / 60.0) as f32;
    StepSettings {
        substeps: SubstepMode::Fixed(1),
        integrator: Integrator::SemiImplicitEuler,
        time_step,
        ..StepSettings::default()
    }
}

/// Σ of the pulls of all springs, N, in f64 and without a sign.
fn sum_of_pulls(state: &Solver) -> f64 {
    let pull = |index| {
        let ([first, second], spring) = state.spring(index);
        let separation = (state.position(first) - state.position(second)).as_dvec3();
        let velocity = (state.velocity(first) - state.velocity(second)).as_dvec3();
        let elongation = (separation.length() - f64::from(spring.rest_length)).abs();
        f64::from(spring.stiffness) * elongation + f64::from(spring.damping) * velocity.length()
    };
    (0..state.spring_count()).map(pull).sum()
}

fn sum_of_momenta(state: &Solver) -> f64 {
    let of = |slot: usize| state.velocity(slot).as_dvec3().length() / f64::from(state.inverse_mass(slot));
    (0..state.particle_count()).map(of).sum()
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(48) })]

    /// A substep rounds each m v by u, and each of the sums of forces (fewer than 30 terms, twice each
    /// pull) by u times its terms; √3 for the three components.
    #[test]
    fn momentum_is_conserved(net in nets(0.1..10.0, 1.0..5000.0)) {
        let mut state = net.plain_state();
        let settings = resolved(&mut state, 0.5);
        let start = state.measure(Vec3::ZERO).momentum;
        let mut tolerance = 0.0;
        for _ in 0..300 {
            let pulls = sum_of_pulls(&state);
            state.step(&settings);
            let rounding = sum_of_momenta(&state) + f64::from(settings.time_step) * 60.0 * pulls;
            tolerance += 3.0_f64.sqrt() * ROUNDING * rounding;
            let drift = state.measure(Vec3::ZERO).momentum - start;
            prop_assert!(drift.length() <= tolerance, "{} exceeds {tolerance}", drift.length());
        }
    }

    /// Symplectic Euler keeps H − h/2 F·v + O(h²), and |F·v| <= ω H (Cauchy–Schwarz: Σ k |Δv|² <=
    /// ω² Σ m v²), so H stays below (1 + hω/2)/(1 − hω/2) of its start: 2 % for hω = 0.02. The terms of
    /// second order, (hω)² = 4e-4 times the few by which directions turn faster than lengths change, are
    /// allowed 1 % more. Dampers only dissipate.
    #[test]
    fn damped_nets_never_gain_energy(net in nets(0.1..10.0, 1.0..5000.0)) {
        let mut state = net.plain_state();
        let settings = resolved(&mut state, 0.02);
        let total = |state: &Solver| {
            let totals = state.measure(Vec3::ZERO);
            totals.kinetic_energy + totals.elastic_energy
        };
        let start = total(&state);
        for tick in 0..1000 {
            state.step(&settings);
            let now = total(&state);
            prop_assert!(now <= 1.03 * start, "tick {tick}: {now} J of {start} J");
        }
    }

    /// The slots of the particles, the order of the springs, and where the net is, change roundings only:
    /// of positions below X = 20 m by u X in each of n = 40 steps (and of velocities, which h makes positions, by less). A difference
    /// grows by 1 + 2 hω = 1.1 a step at most (lengths by hω, directions of taut springs by as much).
    #[test]
    fn translation_and_order_change_roundings_only(
        (net, order) in nets(0.1..10.0, 1.0..5000.0).prop_flat_map(|net| {
            let order: Vec<usize> = (0..net.particles.len()).collect();
            (Just(net), Just(order).prop_shuffle())
        })
    ) {
        let shift = Vec3::new(16.0, -8.0, 4.0);
        let mut reversed = net.clone();
        reversed.links.reverse();
        let (mut plain, mut moved) = (net.plain_state(), reversed.state(&order, shift));
        let settings = resolved(&mut plain, 0.05);
        for _ in 0..40 {
            plain.step(&settings);
            moved.step(&settings);
        }
        let tolerance = (40.0 * ROUNDING * 20.0 * 1.1_f64.powi(40)) as f32;
        for (slot, place) in order.iter().enumerate() {
            let difference = moved.position(*place) - shift - plain.position(slot);
            prop_assert!(difference.length() < tolerance, "{difference} exceeds {tolerance}");
        }
    }
}

/// Spawns the net, falling onto a ground, with the pins and markers whose bits are set.
fn spawn_net(app: &mut App, net: &Net, pins: u16, markers: u16) -> Vec<Entity> {
    app.world_mut().spawn((ParticleCollider::default(), Transform::from_xyz(0.0, -0.5, 0.0)));
    let mut all = Vec::new();
    for (slot, (position, velocity, mass)) in net.particles.iter().enumerate() {
        let particle =
            (Particle::new(*mass, 0.1), ParticleVelocity(*velocity), Transform::from_translation(*position));
        let mut entity = app.world_mut().spawn(particle);
        if pins >> slot & 1 == 1 {
            entity.insert(Pinned);
        }
        if markers >> slot & 1 == 1 {
            entity.insert(Name::new("marked"));
        }
        all.push(entity.id());
    }
    for link in &net.links {
        let (first, second, _, stiffness, damping) = *link;
        let spring = Spring::new(all[first], all[second], net.rest_length(link));
        app.world_mut().spawn(spring.with_stiffness(stiffness).with_damping(damping));
    }
    all
}

/// The greatest speed of a particle of the net in 30 ticks, as a part of twice what all the energy would give to it
/// if it were the lightest one: twice for the energy that the coarsest automatic step, hω = 1, may seem to have,
/// (1 + 1/2)/(1 − 1/2) = 3, and √3 < 2.
fn fastest(net: &Net, pins: u16) -> f64 {
    let mut app = app();
    let all = spawn_net(&mut app, net, pins, 0);
    let masses = || net.particles.iter().map(|(.., mass)| f64::from(*mass));
    let (mass, lightest): (f64, f64) = (masses().sum(), masses().fold(f64::MAX, f64::min));
    let start = net.plain_state().measure(Vec3::ZERO);
    // Nothing can fall by more than the 3 m from the top of the net to the ground, and what hangs
    // from a pin by as much again.
    let fall = mass * 9.81 * 6.0;
    let limit = 2.0 * (2.0 * (start.kinetic_energy + start.elastic_energy + fall) / lightest).sqrt();
    let mut fastest = 0.0_f64;
    for _ in 0..30 {
        run(&mut app, 1);
        for particle in &all {
            let speed = common::velocity(&app, *particle).as_dvec3().length();
            fastest = if speed.is_finite() { fastest.max(speed / limit) } else { f64::INFINITY };
        }
    }
    assert_eq!(app.world().resource::<TickReport>().faults, 0);
    fastest
}

/// A particle of 1.1 kg, which springs of up to 0.9 MN/m press at 100 m/s against one of 1 g: the two slide along each other. Put back
/// to where they touch in each substep, they gained 10⁹ J.
#[test]
fn what_stiff_springs_press_against_a_light_particle_does_not_explode() {
    let particles = [
        ([0.0, -0.058587156, -0.16017205], [0.0, 0.22532652, 0.4415097], 1.1243587),
        ([1.139154, 0.0, 0.042416606], [0.0; 3], 7.7414474),
        ([2.0, 0.0, 0.0], [0.0; 3], 5.927284),
        ([0.0, 1.0, 0.0], [0.0; 3], 3.2468958),
        ([1.0411047, 1.0, -0.1387422], [0.0; 3], 0.001),
        ([2.0, 0.841926, 0.054721843], [0.0; 3], 0.001),
        ([0.0, 0.0, 1.0], [0.0; 3], 0.001),
        ([0.82804227, -0.18461786, 1.1877453], [0.0; 3], 0.001),
    ];
    let particles =
        particles.map(|(position, velocity, mass)| (position.into(), velocity.into(), mass)).to_vec();
    let mut net = Net { particles, links: Vec::new() };
    let springs = [
        (1, 0, 1.0360033, 561_729.7, 0.0),
        (5, 0, 1.8733011, 381_601.38, 0.0),
        (4, 0, 1.6766382, 930_397.3, 0.467_080_44),
    ];
    net.links = springs
        .into_iter()
        .map(|(first, second, rest_length, stiffness, damping)| {
            let length = net.particles[first].0.distance(net.particles[second].0);
            (first, second, rest_length / length, stiffness, damping)
        })
        .collect();
    // The heavy one has three times the energy at most, and strikes the light one to at most twice its speed.
    let struck = (3.0_f64 * 0.001 / 1.1243587).sqrt();
    let fastest = fastest(&net, 0b11_0010);
    assert!(fastest < struck, "{fastest}");
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(24) })]

    /// The default settings never explode: masses from a gram, stiffnesses up to 10⁶ N/m.
    #[test]
    fn auto_never_explodes(net in nets(0.001..10.0, 1.0..1e6), pins: u16) {
        let fastest = fastest(&net, pins);
        prop_assert!(fastest < 1.0, "{fastest} of what all the energy gives");
    }

    /// Nor where the particles fly at each other at up to 300 m/s.
    #[test]
    fn fast_nets_never_explode(net in nets(0.001..10.0, 1.0..1e6), pins: u16) {
        let mut net = net;
        net.particles.iter_mut().for_each(|(_, velocity, _)| *velocity *= 350.0);
        let fastest = fastest(&net, pins);
        prop_assert!(fastest < 1.0, "{fastest} of what all the energy gives");
    }

    #[test]
    fn archetypes_do_not_matter(net in nets(0.1..10.0, 1.0..5000.0), pins: u16, markers: u16) {
        let (mut plain, mut marked) = (app(), app());
        let all = spawn_net(&mut plain, &net, pins, 0);
        let twins = spawn_net(&mut marked, &net, pins, markers);
        for tick in 0..30 {
            run(&mut plain, 1);
            run(&mut marked, 1);
            prop_assert_eq!(hash(&plain, &all), hash(&marked, &twins), "tick {}", tick);
        }
    }
}
