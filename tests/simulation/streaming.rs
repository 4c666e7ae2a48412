//! Ropes that stream in a steady wind: closed form.
//!
//! A rope of mass λ per length hangs by its start in a wind U across gravity g. Where it leans by θ to the vertical the wind
//! across it is U cos θ, and pushes ½ ρ C d U² cos² θ per length across the rope; of its weight λ g sin θ is across it:
//!
//! ```text
//! κ cos² θ = sin θ,   κ = ½ ρ C d U² / (λ g)   so   sin θ = (√(1 + 4 κ²) − 1) / (2 κ)
//! ```
//!
//! This is the same in all places: the rope is straight, whatever its length and resolution, and bears λ g cos θ for each
//! length below (the critical angle of a towed cable: Glauert, *The form of a heavy flexible cable used for towing a heavy
//! body below an aeroplane*, 1934).
//!
//! Along the rope the wind has U sin θ, and brakes what moves across in its own frame: waves that run down the rope more slowly
//! are pulled along and grow. So a rope is at rest in the wind only where they are faster, √(g cos θ s) at s from its end, in
//! most of it; in faster winds it flutters, in any steps. Hence water: slow, and heavy against the rope.

use bevy::prelude::*;
use bevy_mass_spring::nets::{Air, Part, PartOf};
use bevy_mass_spring::prelude::*;
use bevy_mass_spring::solver::{self, Filament, Solver, StepSettings};

use crate::common;

const GRAVITY: f32 = 9.81;
const WATER: f32 = 1000.0;

/// sin θ in a wind that pushes κ times as much across the rope as it weighs.
fn lean(ratio: f32) -> f32 {
    ((1.0 + 4.0 * ratio * ratio).sqrt() - 1.0) / (2.0 * ratio)
}

/// By how much θ is more than it would be where links are longer by a part `strain` than at rest: the wind finds that much
/// more of them. From the derivative of κ (1 − s²) = s: ds (1 + 2 κ s) = dκ (1 − s²), and ds = cos θ dθ.
fn lean_by_strain(ratio: f32, strain: f32) -> f32 {
    let sine = lean(ratio);
    strain * ratio * (1.0 - sine * sine).sqrt() / (1.0 + 2.0 * ratio * sine)
}

/// Checks the angle of a rope in the wind along x, and that it is straight.
fn assert_streams(places: &[Vec3], link: f32, ratio: f32, what: &str) {
    let angle_of = |way: Vec3| way.x.atan2(-way.y);
    let links = || places.windows(2).map(|ends| ends[1] - ends[0]);
    let strain = links().map(|link_now| link_now.length() / link - 1.0).fold(0.0, f32::max);
    let expected = lean(ratio).asin();
    // What is stretched leans further; and 1e-4 rad for what it still swings.
    let tolerance = lean_by_strain(ratio, strain) + 1e-4;
    let angle = angle_of(places[places.len() - 1] - places[0]);
    assert!((angle - expected).abs() < tolerance, "{what}: {angle}, expected {expected} ± {tolerance}");
    // A link is rounded by 2.4e-7 m in 0.05 m, 5e-6 rad; so are its neighbours, and their tensions. With mass or drag in
    // other places than halves at the ends of links the last one would lean by a tenth otherwise.
    for (number, link_now) in links().enumerate() {
        let angle = angle_of(link_now);
        assert!(
            (angle - expected).abs() < tolerance + 1e-3 && link_now.z.abs() < 1e-3 * link,
            "{what}: link {number} leans by {angle}, expected {expected}"
        );
    }
}

/// A rope of 1 m in 20 links of 40 g, damped, the last particle of half a link; it falls from the horizontal. The water brakes
/// motion across it at the rate γ = ρ C d U cos θ / λ > 8/s, much faster than it swings, ω² >= 3 g / (2 L) and in proportion to κ
/// from there on: so it creeps to rest as exp(−ω² t / γ), ω²/γ > 1.4/s, in 20 s to a part in e²⁸.
#[test]
fn a_rope_in_the_wind_is_straight_at_its_critical_angle_in_every_scheme() {
    let (links, link, mass) = (20, 0.05, 0.04);
    let filament = Filament { diameter: 0.02, drag: 1.2 };
    let schemes = Integrator::ALL.into_iter();
    // Those two gain energy from springs.
    let schemes =
        schemes.filter(|scheme| ![Integrator::ExplicitEuler, Integrator::SecondOrderTaylor].contains(scheme));
    for scheme in schemes {
        for wind in [0.3_f32, 0.6, 1.0] {
            let mut solver = Solver::default();
            for number in 0..=links {
                let own = if number == links { 0.5 * mass } else { mass };
                let own = if number == 0 { f32::INFINITY } else { own };
                solver.add_particle(Vec3::X * link * number as f32, Vec3::ZERO, own, 0.0).unwrap();
                if number > 0 {
                    let ends = [number - 1, number];
                    let spring = solver::Spring {
                        rest_length: link,
                        stiffness: 2e4,
                        damping: 1.0,
                        ..solver::Spring::default()
                    };
                    solver.add_spring(ends, spring).unwrap();
                    solver.add_filament(ends, filament).unwrap();
                }
            }
            let substeps = match scheme {
                Integrator::Auto => SubstepMode::Auto,
                Integrator::ImplicitEuler | Integrator::TrBdf2 => SubstepMode::Fixed(2),
                _ => SubstepMode::Fixed(64),
            };
            let settings = StepSettings {
                integrator: scheme,
                substeps,
                gravity: Vec3::NEG_Y * GRAVITY,
                air_density: WATER,
                wind: Vec3::X * wind,
                ..StepSettings::default()
            };
            (0..1200).for_each(|_| _ = solver.step(&settings));
            let places: Vec<Vec3> = (0..=links).map(|slot| solver.position(slot)).collect();
            let push = 0.5 * WATER * filament.drag * filament.diameter * wind * wind;
            assert_streams(&places, link, push / (mass / link * GRAVITY), &format!("{scheme}, {wind} m/s"));
        }
    }
}

/// The same by a recipe, in an app: a rope of hemp held by its start, for 30 s.
#[test]
fn a_rope_of_hemp_that_is_held_by_its_start_streams_at_its_critical_angle() {
    let mut app = common::app();
    app.world_mut().resource_mut::<CollisionSettings>().ground = false;
    let wind = 0.4;
    *app.world_mut().resource_mut::<Environment>() =
        Environment { wind: Vec3::X * wind, air_density: WATER, ..default() };
    let rope = Rope { air: Air { drag: 1.2, ..default() }, ..Rope::new(1.0) }
        .with_segments(20)
        .with_radius(0.005)
        .with_material(RopeMaterial { bending_stiffness: 0.0, ..RopeMaterial::HEMP });
    let density = rope.material.linear_density;
    let net = app.world_mut().spawn((rope, Transform::IDENTITY)).id();
    app.world_mut().spawn((PartOf(net), Part::Start, Pinned));
    common::run(&mut app, 2000);
    let gravity = app.world().resource::<Environment>().gravity.length();
    let ratio = 0.5 * WATER * 1.2 * 0.01 * wind * wind / (density * gravity);
    let net = app.world().get::<ParticleNet>(net).expect("the recipe is laid out");
    assert_streams(net.positions(), 0.05, ratio, "hemp");
}
