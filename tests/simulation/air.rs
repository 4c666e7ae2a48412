//! Drag and lift: closed forms, and stability for every wind, density and step.

use bevy::math::Vec3;
use bevy_mass_spring::solver::{
    Face, Filament, Gas, Gusts, Integrator, Solver, Spring, StepSettings, SubstepMode,
};

use crate::common::bodies::solver_bits;

const GRAVITY: f32 = 9.81;
const AIR: f32 = 1.225;

/// Schemes that gain energy from undamped springs.
const GAIN_ENERGY: [Integrator; 2] = [Integrator::ExplicitEuler, Integrator::SecondOrderTaylor];

/// A square sheet of 1 m² in the plane y = 0, of `cells`² cells, with its mass where its area is.
fn sheet(cells: usize, area_density: f32, stiffness: f32, face: Face) -> Solver {
    let mut solver = Solver::default();
    let (side, step) = (cells + 1, 1.0 / cells as f32);
    let number = |i: usize, j: usize| j * side + i;
    let mut faces = Vec::new();
    for (i, j) in (0..cells * cells).map(|cell| (cell % cells, cell / cells)) {
        let [a, b, c, d] = [number(i, j), number(i + 1, j), number(i, j + 1), number(i + 1, j + 1)];
        faces.extend([[a, c, b], [b, c, d]]);
    }
    let mut mass = vec![0.0; side * side];
    faces.as_flattened().iter().for_each(|corner| mass[*corner] += area_density * 0.5 * step * step / 3.0);
    for (particle, mass) in mass.into_iter().enumerate() {
        let place = Vec3::new((particle % side) as f32, 0.0, (particle / side) as f32) * step;
        solver.add_particle(place, Vec3::ZERO, mass, 0.0).unwrap();
    }
    for &[a, b, c] in &faces {
        for ends in [[a, b], [b, c], [c, a]].into_iter().filter(|ends| ends[0] < ends[1] && stiffness > 0.0) {
            let rest_length = solver.position(ends[0]).distance(solver.position(ends[1]));
            let spring = Spring { rest_length, stiffness, damping: 0.0, ..Spring::default() };
            solver.add_spring(ends, spring).unwrap();
        }
        solver.add_face([a, b, c], face).unwrap();
    }
    solver
}

fn settings(integrator: Integrator, substeps: u32) -> StepSettings {
    let gravity = Vec3::NEG_Y * GRAVITY;
    let substeps = SubstepMode::Fixed(substeps);
    StepSettings { integrator, substeps, gravity, air_density: AIR, ..StepSettings::default() }
}

fn schemes() -> impl Iterator<Item = (Integrator, u32)> {
    Integrator::ALL.into_iter().map(|scheme| match scheme {
        Integrator::Auto => (scheme, 1),
        Integrator::ImplicitEuler | Integrator::TrBdf2 => (scheme, 1),
        _ => (scheme, 8),
    })
}

/// √(2 σ g / (ρ C)), reached after 10 times V/g. What is left of the fall from rest is 4 e⁻²⁰.
#[test]
fn a_sheet_that_falls_flat_reaches_its_terminal_speed_in_every_scheme() {
    let (area_density, drag) = (0.2, 1.17);
    let expected = (2.0 * area_density * GRAVITY / (AIR * drag)).sqrt();
    for (scheme, substeps) in schemes() {
        let mut solver = sheet(4, area_density, 20.0, Face { drag, lift: 0.0 });
        let settings = settings(scheme, substeps);
        (0..110).for_each(|_| _ = solver.step(&settings));
        let start = solver.position(12).y;
        (0..10).for_each(|_| _ = solver.step(&settings));
        for (what, speed) in
            [("velocity", -solver.velocity(12).y), ("distance", (start - solver.position(12).y) * 6.0)]
        {
            assert!((speed / expected - 1.0).abs() < 1e-3, "{scheme}, {what}: {speed} of {expected} m/s");
        }
    }
}

/// In the wind w it drifts along: the same, relative to the air; and a stiff sheet beside a soft one under `Auto`, so that
/// two schemes share the tick.
#[test]
fn two_schemes_in_one_tick_fall_alike_in_the_wind() {
    let mut solver = sheet(4, 0.2, 20.0, Face { drag: 1.0, lift: 0.0 });
    let rigid = solver.particle_count();
    for corner in [Vec3::ZERO, Vec3::Z, Vec3::X] {
        solver.add_particle(Vec3::Y * 3.0 + corner, Vec3::ZERO, 1.0, 0.0).unwrap();
    }
    for ends in [[0, 1], [1, 2], [2, 0]].map(|ends| ends.map(|end| rigid + end)) {
        let rest_length = solver.position(ends[0]).distance(solver.position(ends[1]));
        solver.add_spring(ends, Spring { rest_length, stiffness: 1e9, ..Spring::default() }).unwrap();
    }
    solver.add_face([rigid, rigid + 1, rigid + 2], Face { drag: 4.0, lift: 0.0 }).unwrap();
    let wind = Vec3::new(0.0, 5.0, 0.0);
    let settings = StepSettings { substeps: SubstepMode::Auto, wind, ..settings(Integrator::Auto, 1) };
    for _ in 0..900 {
        solver.step(&settings);
    }
    assert!(solver.outputs().plan.stiff_substeps > 0, "{:?}", solver.outputs().plan);
    let soft = (2.0 * 0.2 * GRAVITY / AIR).sqrt();
    let stiff = (2.0 * 3.0 * GRAVITY / (AIR * 4.0 * 0.5)).sqrt();
    for (slot, expected) in [(12, soft), (rigid, stiff)] {
        let speed = 5.0 - solver.velocity(slot).y;
        assert!((speed / expected - 1.0).abs() < 1e-3, "{speed} of {expected} m/s");
    }
}

/// Held against the wind by springs, it stands where these balance ½ ρ C A w², whatever the step: no scheme sees another
/// force in the steady state.
#[test]
fn a_plate_that_is_held_in_the_wind_feels_its_drag_at_any_step() {
    let (wind, drag, mass) = (Vec3::X * 12.0, 1.17, 0.02);
    let expected = 0.5 * AIR * drag * 0.5 * 144.0;
    for (scheme, substeps) in schemes() {
        let mut solver = Solver::default();
        for corner in [Vec3::ZERO, Vec3::Y, Vec3::Z] {
            let anchor = solver.add_particle(corner - Vec3::X, Vec3::ZERO, f32::INFINITY, 0.0).unwrap();
            let held = solver.add_particle(corner, Vec3::ZERO, mass, 0.0).unwrap();
            let spring = Spring { rest_length: 1.0, stiffness: 50.0, damping: 0.5, ..Spring::default() };
            solver.add_spring([anchor, held], spring).unwrap();
        }
        solver.add_face([1, 3, 5], Face { drag, lift: 0.5 }).unwrap();
        solver.outputs_mut().record_forces = true;
        let settings = StepSettings { gravity: Vec3::ZERO, wind, ..settings(scheme, substeps.max(2)) };
        (0..600).for_each(|_| _ = solver.step(&settings));
        let tension: f32 = solver.outputs().tensions.iter().sum();
        assert!((tension / expected - 1.0).abs() < 1e-3, "{scheme}: {tension} of {expected} N");
    }
}

/// Of a plate so heavy that it hardly moves, the change of momentum in a tick is the force times that.
#[test]
fn lift_and_drag_of_a_plate_at_45_degrees() {
    let (density, mass, speed) = (1000.0, 1e6, 10.0);
    for (scheme, substeps) in schemes() {
        let mut solver = Solver::default();
        for corner in [Vec3::ZERO, Vec3::new(1.0, 1.0, 0.0), Vec3::Z] {
            solver.add_particle(corner, Vec3::ZERO, mass, 0.0).unwrap();
        }
        solver.add_face([0, 1, 2], Face { drag: 1.2, lift: 0.9 }).unwrap();
        let settings = StepSettings {
            gravity: Vec3::ZERO,
            air_density: density,
            wind: Vec3::X * speed,
            ..settings(scheme, substeps)
        };
        solver.step(&settings);
        let force = solver.measure(Vec3::ZERO).momentum.as_vec3() / settings.time_step;
        let pressure = 0.5 * density * speed * speed * 0.5_f32.sqrt();
        let expected = Vec3::new(1.2 * 0.5_f32.sqrt(), -0.9 * 0.5, 0.0) * pressure;
        assert!((force - expected).length() < 2e-3 * expected.length(), "{scheme}: {force} {expected}");
    }
}

/// A rope that falls across itself: √(2 λ g / (ρ C d)).
#[test]
fn a_rope_that_falls_crosswise_reaches_its_terminal_speed() {
    let filament = Filament { diameter: 0.02, drag: 1.2 };
    let (mass, length) = (0.01, 0.1);
    let expected = (2.0 * mass / length * GRAVITY / (AIR * filament.drag * filament.diameter)).sqrt();
    for (scheme, substeps) in schemes() {
        let mut solver = Solver::default();
        for link in 0..=10 {
            let own = if link % 10 == 0 { 0.5 * mass } else { mass };
            solver.add_particle(Vec3::X * length * link as f32, Vec3::ZERO, own, 0.0).unwrap();
            if link > 0 {
                let spring =
                    Spring { rest_length: length, stiffness: 50.0, damping: 0.2, ..Spring::default() };
                solver.add_spring([link - 1, link], spring).unwrap();
                solver.add_filament([link - 1, link], filament).unwrap();
            }
        }
        let settings = settings(scheme, substeps);
        (0..600).for_each(|_| _ = solver.step(&settings));
        let speed = -solver.velocity(5).y;
        assert!((speed / expected - 1.0).abs() < 1e-3, "{scheme}: {speed} of {expected} m/s");
    }
}

/// Faces with more lift than drag and filaments, thrown about: relative to the air no particle ever gets faster by the
/// air alone, but for the rounding of its velocity.
#[test]
fn air_never_adds_to_the_speed_through_it() {
    for (scheme, substeps) in schemes() {
        for density in [1e-6, 1.0, 1e3, 1e6] {
            for wind in [Vec3::ZERO, Vec3::new(3.0, -20.0, 5.0), Vec3::X * 1e4] {
                for time_step in [1.0 / 60.0, 1.0] {
                    let mut solver = sheet(2, 0.2, 0.0, Face { drag: 0.5, lift: 2.0 });
                    solver.add_filament([0, 4], Filament { diameter: 0.1, drag: 1.0 }).unwrap();
                    for particle in 0..9 {
                        let number = |factor: usize| (particle * factor % 11) as f32 - 5.0;
                        solver.set_velocity(particle, Vec3::new(number(3), number(7), number(5)));
                    }
                    let settings = StepSettings {
                        gravity: Vec3::ZERO,
                        air_density: density,
                        wind,
                        time_step,
                        ..settings(scheme, substeps)
                    };
                    let rounding = 1e-5 * (wind.length() + 10.0);
                    let mut last = [f32::INFINITY; 9];
                    for tick in 0..20 {
                        solver.step(&settings);
                        for (particle, last) in last.iter_mut().enumerate() {
                            let speed = (solver.velocity(particle) - wind).length();
                            assert!(
                                speed <= *last + rounding,
                                "{scheme}, {density} kg/m³, {wind}, {time_step} s, tick {tick}: {speed} after {last}"
                            );
                            *last = speed;
                        }
                    }
                }
            }
        }
    }
}

/// A sheet on springs that falls in air as light and as heavy as there may be, in any wind: its energy relative to the air
/// is never more than what it began with, and what its weight can add.
#[test]
fn a_sheet_in_any_air_stays_together() {
    for (scheme, substeps) in schemes().filter(|(scheme, _)| !GAIN_ENERGY.contains(scheme)) {
        for density in [1e-6, 1.225, 1e6] {
            for speed in [0.0, 30.0, 1e4] {
                let mut solver = sheet(3, 0.2, 200.0, Face { drag: 1.0, lift: 0.5 });
                let wind = Vec3::new(0.6, -0.64, 0.48) * speed;
                let settings = StepSettings { wind, air_density: density, ..settings(scheme, substeps) };
                for tick in 0..60 {
                    solver.step(&settings);
                    for particle in 0..16 {
                        let relative = (solver.velocity(particle) - wind).length();
                        // A particle may swing on its springs faster than the sheet as a whole.
                        let most = 3.0 * (speed + GRAVITY * tick as f32 / 60.0 + 1.0);
                        assert!(
                            relative <= most,
                            "{scheme}, {density} kg/m³, {speed} m/s: {relative} in {tick}"
                        );
                    }
                }
            }
        }
    }
}

/// A rope of 1 m and 0.1 kg/m in ten links, EA = 1 kN and 4 cm thick, pinned at one end.
fn held_rope() -> Solver {
    let mut solver = Solver::default();
    for link in 0..=10 {
        let mass = match link {
            0 => f32::INFINITY,
            10 => 0.005,
            _ => 0.01,
        };
        solver.add_particle(Vec3::NEG_Y * 0.1 * link as f32, Vec3::ZERO, mass, 0.0).unwrap();
        if link > 0 {
            let spring = Spring { rest_length: 0.1, stiffness: 1e4, damping: 0.0, ..Spring::default() };
            solver.add_spring([link - 1, link], spring).unwrap();
            solver.add_filament([link - 1, link], Filament { diameter: 0.04, drag: 1.2 }).unwrap();
        }
    }
    solver
}

/// Seen from the air only what holds it does work on a rope: its pin, which moves at the speed w of the wind and bears the
/// tension T = k e of its spring, and gravity. With the energy E >= T²/2k, and E >= m v²/2 of all of it, dE/dt is at most
/// w √(2kE) + g √(2mE), and drag only takes away: √E grows by (w √(k/2) + g √(m/2)) a second at most. Nothing that makes
/// energy from its own motion stays below that for long.
#[test]
fn a_rope_in_any_wind_has_no_more_energy_than_its_pin_can_give() {
    for (scheme, substeps) in schemes().filter(|(scheme, _)| !GAIN_ENERGY.contains(scheme)) {
        // Stable in vacuum: ω = 2000 rad/s.
        let substeps = if substeps == 8 { 48 } else { substeps };
        for (density, speed) in
            [(1.225, 30.0), (1.225, 1e4), (1000.0, 100.0), (1000.0, 300.0), (1e6, 300.0), (1e-6, 1e4)]
        {
            let mut solver = held_rope();
            let wind = Vec3::new(0.6, -0.64, 0.48) * speed;
            let mut settings = StepSettings { wind, air_density: density, ..settings(scheme, substeps) };
            if scheme == Integrator::Auto {
                settings.substeps = SubstepMode::Auto;
            }
            let mass = 0.095_f64;
            let begin = (0.5 * mass).sqrt() * f64::from(speed);
            let rate = f64::from(speed) * 5e3_f64.sqrt() + f64::from(GRAVITY) * (0.5 * mass).sqrt();
            for tick in 1..=600 {
                solver.step(&settings);
                let mut energy = 0.0;
                for link in 1..=10 {
                    let relative = (solver.velocity(link) - wind).as_dvec3();
                    let mass = if link == 10 { 0.005 } else { 0.01 };
                    energy += 0.5 * mass * relative.length_squared();
                    let length =
                        solver.position(link).as_dvec3().distance(solver.position(link - 1).as_dvec3());
                    energy += 0.5 * 1e4 * (length - 0.1).powi(2);
                }
                let most = begin + rate * f64::from(tick) / 60.0;
                assert!(
                    energy.sqrt() <= most,
                    "{scheme}, {density} kg/m³, {speed} m/s: {energy} J of {} J in tick {tick}",
                    most * most
                );
            }
        }
    }
}

/// In the first 0.05 s the wind carries the rope along sideways, to 20 m/s less 1 / (½ ρ C d t / λ), while it falls along itself
/// as in vacuum. (Later, without tension, it would fold.)
#[test]
fn nothing_brakes_a_rope_along_itself() {
    for (scheme, substeps) in schemes().filter(|(scheme, _)| !GAIN_ENERGY.contains(scheme)) {
        let mut solver = held_rope();
        solver.set_mass(0, 0.005).unwrap();
        let wind = Vec3::new(20.0, 20.0, 0.0);
        let settings = StepSettings { air_density: 1e3, wind, ..settings(scheme, substeps.max(48)) };
        (0..3).for_each(|_| _ = solver.step(&settings));
        for particle in 0..=10 {
            let velocity = solver.velocity(particle);
            assert!((velocity.y + 0.05 * GRAVITY).abs() < 1e-3, "{scheme}: {velocity} m/s of {particle}");
            assert!((velocity.x - 20.0).abs() < 0.1, "{scheme}: {velocity} m/s of {particle}");
        }
    }
}

fn in_gusts(scheme: Integrator) -> (Solver, StepSettings) {
    let mut solver = sheet(6, 0.2, 100.0, Face { drag: 1.0, lift: 0.5 });
    let filament = Filament { diameter: 0.02, drag: 1.0 };
    solver.add_filament([0, 8], filament).unwrap();
    solver.set_mass(0, f32::INFINITY).unwrap();
    let tip = solver.add_particle(Vec3::Y * 0.3, Vec3::ZERO, 0.1, 0.0).unwrap();
    let bag = [[0, 1, 7], [0, 7, tip], [7, 1, tip], [1, 0, tip]];
    solver.add_gas(&bag, Gas { pressure: 20.0, rest_volume: 0.002 }).unwrap();
    let gusts = Gusts { strength: Vec3::new(4.0, 2.0, 4.0), length: 0.7, time: 0.3, seed: 5 };
    let settings = StepSettings {
        wind: Vec3::new(4.0, 0.0, 1.0),
        gusts: Some(gusts),
        substeps: if scheme == Integrator::Auto { SubstepMode::Auto } else { SubstepMode::Fixed(8) },
        ..settings(scheme, 8)
    };
    (solver, settings)
}

/// Gusts are those of the state: without caches, and from a copy of the state in another solver, the bits are the same.
#[test]
fn gusts_go_on_as_they_were_after_a_restart() {
    for scheme in Integrator::ALL.into_iter().filter(|scheme| *scheme != Integrator::ExplicitEuler) {
        let (mut whole, settings) = in_gusts(scheme);
        let mut parts = whole.clone();
        for tick in 0..40 {
            whole.step(&settings);
            parts.drop_caches();
            if tick % 10 == 5 {
                let mut other = Solver::default();
                other.restore(parts.state().clone());
                parts = other;
            }
            parts.step(&settings);
            assert_eq!(solver_bits(&whole), solver_bits(&parts), "{scheme}, tick {tick}");
        }
        assert!(whole.position(20).is_finite() && whole.velocity(20).length() > 0.1);
    }
}

#[test]
fn without_air_there_is_none() {
    let (mut vacuum, mut settings) =
        (sheet(3, 0.2, 50.0, Face { drag: 1.0, lift: 1.0 }), settings(Integrator::Auto, 1));
    settings.air_density = 0.0;
    settings.wind = Vec3::X * 50.0;
    let mut plain = sheet(3, 0.2, 50.0, Face::default());
    for number in 0..18 {
        plain.remove_face(number);
    }
    for _ in 0..30 {
        vacuum.step(&settings);
        plain.step(&settings);
        assert_eq!(solver_bits(&vacuum), solver_bits(&plain));
    }
}
