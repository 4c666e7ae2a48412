//! Gases in closed surfaces: balloons.

use std::collections::BTreeMap;

use bevy::math::{DVec3, Quat, Vec3};
use bevy_mass_spring::solver::{
    Collider, Gas, GasReading, Integrator, Pose, Solver, SolverError, Spring, StepSettings, SubstepMode,
    enclosed_volume,
};

/// An icosahedron, its faces divided into four as often as asked for, on the unit sphere.
fn icosphere(subdivisions: u32) -> (Vec<Vec3>, Vec<[usize; 3]>) {
    let golden = 0.5 * (1.0 + 5.0_f32.sqrt());
    let mut corners: Vec<Vec3> = Vec::new();
    for (one, other) in [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)] {
        let [x, y] = [one, golden * other];
        corners
            .extend([Vec3::new(0.0, x, y), Vec3::new(x, y, 0.0), Vec3::new(y, 0.0, x)].map(Vec3::normalize));
    }
    let edge = corners[0].distance(corners[2]).min(corners[0].distance(corners[1])).min(1.06);
    let mut faces = Vec::new();
    for a in 0..12 {
        for b in a + 1..12 {
            for c in b + 1..12 {
                let [x, y, z] = [a, b, c].map(|corner| corners[corner]);
                if [x.distance(y), y.distance(z), z.distance(x)].iter().all(|side| *side < 1.01 * edge) {
                    let outwards = (y - x).cross(z - x).dot(x) > 0.0;
                    faces.push(if outwards { [a, b, c] } else { [a, c, b] });
                }
            }
        }
    }
    for _ in 0..subdivisions {
        let mut middles = BTreeMap::new();
        let mut middle = |a: usize, b: usize| {
            *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                corners.push((corners[a] + corners[b]).normalize());
                corners.len() - 1
            })
        };
        faces = faces
            .iter()
            .flat_map(|&[a, b, c]| {
                let [ab, bc, ca] = [middle(a, b), middle(b, c), middle(c, a)];
                [[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]
            })
            .collect();
    }
    (corners, faces)
}

/// A balloon of springs of Van Gelder's constants (*J. Graphics Tools* 3(2), 1998): K Σ A / l² over the faces of an edge.
struct Balloon {
    solver: Solver,
    faces: Vec<[usize; 3]>,
}

const AREA_DENSITY: f32 = 0.2;

fn balloon(radius: f32, stretch_stiffness: f32, retardation_time: f32, pressure: f32) -> Balloon {
    let (corners, faces) = icosphere(2);
    let place = |corner: usize| corners[corner] * radius;
    let (mut mass, mut edges) = (vec![0.0; corners.len()], BTreeMap::<_, f32>::new());
    for &[a, b, c] in &faces {
        let area = 0.5 * (place(b) - place(a)).cross(place(c) - place(a)).length();
        for (a, b) in [(a, b), (b, c), (c, a)] {
            mass[a] += AREA_DENSITY * area / 3.0;
            *edges.entry((a.min(b), a.max(b))).or_default() +=
                stretch_stiffness * area / place(a).distance_squared(place(b));
        }
    }
    let mut solver = Solver::default();
    for (corner, mass) in mass.into_iter().enumerate() {
        solver.add_particle(place(corner), Vec3::ZERO, mass, 0.0).unwrap();
    }
    for ((a, b), stiffness) in edges {
        let rest_length = place(a).distance(place(b));
        let spring =
            Spring { rest_length, stiffness, damping: retardation_time * stiffness, ..Spring::default() };
        solver.add_spring([a, b], spring).unwrap();
    }
    let triangles: Vec<[u32; 3]> = faces.iter().map(|face| face.map(|corner| corner as u32)).collect();
    let rest_volume = enclosed_volume(&triangles, |corner| place(corner as usize)) as f32;
    solver.add_gas(&faces, Gas { pressure, rest_volume }).unwrap();
    Balloon { solver, faces }
}

impl Balloon {
    fn reading(&self) -> GasReading {
        self.solver.outputs().gases[0]
    }

    fn area(&self) -> f64 {
        let at = |corner: usize| self.solver.position(corner).as_dvec3();
        self.faces.iter().map(|&[a, b, c]| 0.5 * (at(b) - at(a)).cross(at(c) - at(a)).length()).sum()
    }

    fn is_finite(&self) -> bool {
        (0..self.solver.particle_count()).all(|slot| self.solver.position(slot).is_finite())
    }
}

fn settings(integrator: Integrator) -> StepSettings {
    let substeps = match integrator {
        Integrator::ImplicitEuler => SubstepMode::Fixed(8),
        Integrator::Xpbd => SubstepMode::Fixed(60),
        _ => SubstepMode::Auto,
    };
    StepSettings { integrator, substeps, ..StepSettings::default() }
}

/// Without those that explode, as they must, where nothing is damped.
fn schemes() -> impl Iterator<Item = Integrator> {
    let gains_energy = [Integrator::ExplicitEuler, Integrator::SecondOrderTaylor];
    Integrator::ALL.into_iter().filter(move |scheme| !gains_energy.contains(scheme))
}

/// The tension of the membrane, N/m, is what the springs carry across a line of it: Σ T l over all springs is 2 A times
/// that (the virial). It is to be p r/2 with r of a sphere as large, in a balloon that is blown up by a fifth.
#[test]
fn the_tension_of_a_balloon_is_half_its_pressure_times_its_radius() {
    for scheme in schemes() {
        let mut balloon = balloon(0.5, 1e3, 0.0, 900.0);
        balloon.solver.outputs_mut().record_forces = true;
        // It settles with 2 m/ν = 0.2 s.
        let settings = StepSettings { viscosity: 0.04, ..settings(scheme) };
        (0..180).for_each(|_| _ = balloon.solver.step(&settings));
        let GasReading { volume, pressure, .. } = balloon.reading();
        let carried: f64 = (0..balloon.solver.spring_count())
            .map(|number| {
                let ([a, b], _) = balloon.solver.spring(number);
                let length =
                    balloon.solver.position(a).as_dvec3().distance(balloon.solver.position(b).as_dvec3());
                f64::from(balloon.solver.outputs().tensions[number]) * length
            })
            .sum();
        let tension = carried / (2.0 * balloon.area());
        let radius = (balloon.area() / (4.0 * std::f64::consts::PI)).sqrt();
        let expected = 0.5 * pressure * radius;
        assert!((tension / expected - 1.0).abs() < 0.03, "{scheme}: {tension} of {expected} N/m");
        let rest = f64::from(balloon.solver.gas(0).rest_volume);
        assert!((1.2..2.5).contains(&(volume / rest)), "{scheme}: {volume} of {rest} m³");
        // At rest but for rounding. One at a time, the springs of position-based dynamics turn the whole a little.
        let is_still = |slot: usize| {
            let outwards = balloon.solver.position(slot).normalize();
            balloon.solver.velocity(slot).dot(outwards).abs() < 2e-3
        };
        assert!((0..balloon.solver.particle_count()).all(is_still), "{scheme}");
    }
}

/// Left to itself, it breathes: momentum and angular momentum stay what they are.
#[test]
fn a_free_balloon_keeps_its_momentum() {
    for scheme in schemes() {
        let mut balloon = balloon(0.5, 1e3, 0.0, 2000.0);
        let spin = Vec3::new(0.5, -1.0, 0.3);
        for slot in 0..balloon.solver.particle_count() {
            let velocity = Vec3::new(1.0, 2.0, -0.5) + spin.cross(balloon.solver.position(slot));
            balloon.solver.set_velocity(slot, velocity);
        }
        let angular = |solver: &Solver| -> DVec3 {
            (0..solver.particle_count())
                .map(|slot| {
                    let mass = 1.0 / f64::from(solver.inverse_mass(slot));
                    mass * solver.position(slot).as_dvec3().cross(solver.velocity(slot).as_dvec3())
                })
                .sum()
        };
        let (momentum, turning) = (balloon.solver.measure(Vec3::ZERO).momentum, angular(&balloon.solver));
        let settings = settings(scheme);
        (0..60).for_each(|_| _ = balloon.solver.step(&settings));
        let lost = balloon.solver.measure(Vec3::ZERO).momentum - momentum;
        assert!(lost.length() < 1e-4 * momentum.length(), "{scheme}: {lost}");
        let slowed = angular(&balloon.solver) - turning;
        // The others take O(h) of it, whatever the forces are.
        if matches!(
            scheme,
            Integrator::SemiImplicitEuler | Integrator::VelocityVerlet | Integrator::RungeKutta4
        ) {
            assert!(slowed.length() < 5e-3 * turning.length(), "{scheme}: {slowed} of {turning}");
        }
    }
}

/// Total energy, that of the gas with it, of a balloon that breathes: the error falls with the order of the scheme when
/// substeps are halved.
#[test]
fn breathing_keeps_the_energy() {
    for (scheme, ratios) in [(Integrator::VelocityVerlet, 3.0..5.0), (Integrator::RungeKutta4, 30.0..100.0)] {
        let error = |substeps: u32| {
            let mut balloon = balloon(0.5, 1e3, 0.0, 500.0);
            let start = balloon.solver.measure(Vec3::ZERO).total_energy();
            let settings = StepSettings { substeps: SubstepMode::Fixed(substeps), ..settings(scheme) };
            let (mut error, mut kinetic) = (0.0_f64, 0.0_f64);
            for _ in 0..6 {
                balloon.solver.step(&settings);
                let found = balloon.solver.measure(Vec3::ZERO);
                error = error.max((found.total_energy() - start).abs());
                kinetic = kinetic.max(found.kinetic_energy);
            }
            assert!(kinetic > 10.0 && error < 0.05 * kinetic, "{scheme}: {error} of {kinetic} J");
            error
        };
        let (coarse, fine) = (error(24), error(48));
        assert!(ratios.contains(&(coarse / fine)), "{scheme}: {coarse} J, {fine} J");
    }
}

/// Between two planes that close in on it, to less than half of its height.
#[test]
fn pressure_times_volume_stays_while_it_is_squeezed() {
    for scheme in [Integrator::Auto, Integrator::ImplicitEuler, Integrator::VelocityVerlet] {
        let mut balloon = balloon(0.5, 200.0, 1e-3, 500.0);
        let content = 500.0 * f64::from(balloon.solver.gas(0).rest_volume);
        let floor = Collider::half_space(Vec3::NEG_Y * 0.5, Vec3::Y, 0.0, 0.3);
        let ceiling = Collider::half_space(Vec3::Y * 0.7, Vec3::NEG_Y, 0.0, 0.3);
        balloon.solver.add_collider(floor);
        balloon.solver.add_collider(ceiling);
        let settings = StepSettings { gravity: Vec3::NEG_Y * 9.81, ..settings(scheme) };
        let mut volumes = (f64::INFINITY, 0.0_f64);
        for tick in 0..150 {
            let planes = &mut balloon.solver.inputs_mut().colliders;
            planes[1].start = planes[1].target;
            let height = 0.7 - 0.005 * tick as f32;
            planes[1].target =
                Pose { point: Vec3::Y * height, rotation: Quat::from_rotation_x(std::f32::consts::PI) };
            balloon.solver.step(&settings);
            let GasReading { volume, pressure, .. } = balloon.reading();
            assert!((pressure * volume / content - 1.0).abs() < 1e-4, "{scheme}: {pressure} Pa, {volume} m³");
            volumes = (volumes.0.min(volume), volumes.1.max(volume));
        }
        assert!(volumes.1 > 1.1 * volumes.0, "{scheme}: {volumes:?}");
        assert!(balloon.is_finite());
    }
}

/// At a hundred times the pressure of a tyre, in long steps, blown up from a tenth of its size and turned inside out.
#[test]
fn a_stiff_gas_is_stable_in_one_step_a_tick() {
    for (scheme, substeps) in [
        (Integrator::Auto, SubstepMode::Auto),
        (Integrator::ImplicitEuler, SubstepMode::Fixed(1)),
        (Integrator::TrBdf2, SubstepMode::Fixed(1)),
        (Integrator::Xpbd, SubstepMode::Fixed(1)),
    ] {
        for scale in [1.0, 0.1, 0.0, -0.5] {
            let mut balloon = balloon(0.5, 1e5, 0.001, 2e4);
            for slot in 0..balloon.solver.particle_count() {
                let place = balloon.solver.position(slot) * scale;
                balloon.solver.set_position(slot, place);
            }
            let start = balloon.solver.measure(Vec3::ZERO).total_energy();
            let settings = StepSettings { integrator: scheme, substeps, ..StepSettings::default() };
            for tick in 0..60 {
                balloon.solver.step(&settings);
                let energy = balloon.solver.measure(Vec3::ZERO).total_energy();
                assert!(balloon.is_finite(), "{scheme}, {scale}, tick {tick}");
                // A single iteration of position-based dynamics knows nothing of energy.
                let is_bounded = scheme == Integrator::Xpbd || energy < start.abs() * 1.05 + 100.0;
                assert!(is_bounded, "{scheme}, {scale}, tick {tick}: {energy} J of {start}");
            }
        }
    }
}

/// Where a gas has more pressure than a scheme is stable with, automatic substeps know it: a balloon of springs that are
/// soft against it.
#[test]
fn automatic_substeps_take_the_gas_into_account() {
    let mut soft = balloon(0.5, 1.0, 0.0, 0.0);
    let mut blown = balloon(0.5, 1.0, 0.0, 1e4);
    let bounds = |balloon: &mut Balloon| balloon.solver.frequency_bounds(0.0).angular_frequency;
    // p/V Σ g²/m = p 4πr²/(σ V), and more for the rest.
    let breathing = (1e4 * 3.0 / 0.5 / f64::from(AREA_DENSITY)).sqrt();
    let (without, with) = (bounds(&mut soft), bounds(&mut blown));
    assert!(
        with > breathing && with < 3.0 * breathing && without < 0.2 * with,
        "{without} {with} {breathing}"
    );
}

#[test]
fn a_gas_without_springs_spreads_and_a_removed_particle_lets_it_out() {
    for scheme in schemes() {
        let mut solver = Solver::default();
        for corner in [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z] {
            solver.add_particle(corner, Vec3::ZERO, 1.0, 0.0).unwrap();
        }
        let faces = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
        let number = solver.add_gas(&faces, Gas { pressure: 10.0, rest_volume: 1.0 / 6.0 }).unwrap();
        let settings = settings(scheme);
        (0..30).for_each(|_| _ = solver.step(&settings));
        let reading = solver.outputs().gases[number];
        assert!(reading.volume > 0.2 && reading.pressure < 8.4, "{scheme}: {reading:?}");
        solver.remove_gas(number);
        let velocity = solver.velocity(1);
        solver.step(&settings);
        assert!((solver.velocity(1) - velocity).length() < 1e-5, "{scheme}");
        assert_eq!(solver.outputs().gases[number].pressure, 0.0);
    }
}

#[test]
fn surfaces_that_are_not_closed_are_refused() {
    let mut solver = Solver::default();
    for corner in [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z] {
        solver.add_particle(corner, Vec3::ZERO, 1.0, 0.0).unwrap();
    }
    let gas = Gas { pressure: 10.0, rest_volume: 1.0 };
    let open = [[0, 2, 1], [0, 1, 3], [0, 3, 2]];
    assert!(matches!(solver.add_gas(&open, gas), Err(SolverError::NotClosed { .. })));
    let flipped = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 3, 2]];
    assert!(matches!(solver.add_gas(&flipped, gas), Err(SolverError::NotClosed { .. })));
    let faces = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
    for gas in [Gas { pressure: -1.0, ..gas }, Gas { rest_volume: 0.0, ..gas }] {
        assert!(matches!(solver.add_gas(&faces, gas), Err(SolverError::OutOfRange { .. })));
    }
    assert_eq!(solver.add_gas(&faces, gas), Ok(0));
}
