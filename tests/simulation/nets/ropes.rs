//! Ropes: their own weight, bending, the catenary.

use bevy::math::{DVec3, Vec3};
use bevy::prelude::{CubicBezier, CubicGenerator};
use bevy_mass_spring::nets::{Layout, Rope, RopeMaterial, Topology};
use bevy_mass_spring::solver::{Integrator, Solver, StepSettings, SubstepMode};

use super::statics::Statics;

const GRAVITY: f64 = 9.81;

fn solver(net: &Topology, pinned: &[usize]) -> Solver {
    let mut solver = Solver::default();
    for (number, (place, mass)) in net.positions.iter().zip(&net.masses).enumerate() {
        let mass = if pinned.contains(&number) { f32::INFINITY } else { *mass };
        solver.add_particle(*place, Vec3::ZERO, mass, net.radius).expect("a good particle");
    }
    for (ends, spring) in &net.springs {
        solver.add_spring(ends.map(|end| end as usize), *spring).expect("a good spring");
    }
    for (ends, rod) in &net.rods {
        solver.add_rod(ends.map(|end| end as usize), *rod).expect("a good rod");
    }
    solver
}

/// Ticks of backward Euler under gravity, whose steps are so long that motions are gone after a few.
fn settle(solver: &mut Solver, time_step: f32, ticks: u32) {
    let settings = StepSettings {
        integrator: Integrator::ImplicitEuler,
        substeps: SubstepMode::Fixed(1),
        gravity: Vec3::new(0.0, -GRAVITY as f32, 0.0),
        time_step,
        ..StepSettings::default()
    };
    for _ in 0..ticks {
        solver.step(&settings);
    }
}

/// ρ g L² / (2 EA): 1.2 % of 2 m, of which the rounding of positions near 2 m (1.2e-7 m) is 5e-6.
#[test]
fn a_rope_lengthens_by_its_own_weight_alike_at_every_resolution() {
    let (density, stiffness, length) = (0.1, 80.0, 2.0);
    let material = RopeMaterial {
        linear_density: density as f32,
        stretch_stiffness: stiffness as f32,
        bending_stiffness: 0.0,
        retardation_time: 0.0,
    };
    for segments in [10, 40, 160, 320] {
        let rope = Rope::new(length as f32).with_segments(segments).with_material(material);
        let net = rope.topology().expect("sound");
        let mass: f64 = net.masses.iter().map(|mass| f64::from(*mass)).sum();
        assert!((mass / (density * length) - 1.0).abs() < 1e-6);
        let mut solver = solver(&net, &[0]);
        settle(&mut solver, 1.0, 60);
        let found = -f64::from(solver.position(segments as usize).y) - length;
        let expected = density * GRAVITY * length * length / (2.0 * stiffness);
        assert!((found / expected - 1.0).abs() < 1e-3, "{segments} segments: {found} {expected}");
    }
}

/// w l⁴ / (8 EI), l from the middle of the clamped link. With n segments of h the discrete rod has n² (n − 1)² h⁴
/// instead of (n − ½)⁴ h⁴: less by 1/(2 n²).
#[test]
fn the_tip_of_a_clamped_rod_sinks_by_its_closed_form() {
    let (bending, load) = (3.0, 0.2);
    let material = RopeMaterial { bending_stiffness: bending as f32, ..RopeMaterial::HEMP };
    for segments in [20, 80, 160_u32] {
        let rope = Rope::between(Vec3::ZERO, Vec3::X).with_segments(segments).with_material(material);
        let mut rod = Statics::new(&rope.topology().expect("sound"));
        let step = 1.0 / f64::from(segments);
        for (number, force) in rod.forces.iter_mut().enumerate() {
            *force = DVec3::NEG_Y * load * step * if number == segments as usize { 0.5 } else { 1.0 };
        }
        rod.free[0] = DVec3::ZERO;
        rod.free[1] = DVec3::ZERO;
        let found = -rod.solve()[segments as usize].y;
        let expected = load * (1.0 - 0.5 * step).powi(4) / (8.0 * bending);
        assert!((found / expected - 1.0).abs() < 0.005, "{segments} segments: {found} {expected}");
    }
}

/// A heavy rope of length s over a span d hangs in y = a cosh(x / a) with s = 2 a sinh(d / 2a).
#[test]
fn a_heavy_rope_hangs_in_a_catenary() {
    let parameter = 0.5_f64;
    let curve = |x: f64| parameter * ((x / parameter).cosh() - (0.5 / parameter).cosh());
    let slack = 2.0 * parameter * (0.5 / parameter).sinh() - 1.0;
    // It starts as a parabola of the same length, turned to one side.
    let mut rope = Rope::hanging(Vec3::X * -0.5, Vec3::X * 0.5, slack as f32).with_segments(80);
    for place in &mut rope.path {
        *place = Vec3::new(place.x, 0.6 * place.y, 0.8 * place.y);
    }
    let material = RopeMaterial { linear_density: 0.5, stretch_stiffness: 1e5, ..RopeMaterial::HEMP };
    let material = RopeMaterial { bending_stiffness: 0.0, ..material };
    let net = rope.with_material(material).topology().expect("sound");
    let mut solver = solver(&net, &[0, 80]);
    settle(&mut solver, 0.05, 800);
    for number in 0..=80 {
        let place = solver.position(number).as_dvec3();
        let error = (place.y - curve(place.x)).hypot(place.z);
        assert!(error < 0.002, "particle {number}: {place}, {error}");
    }
}

/// The particles of a rope along a curve are at equal distances, and its mass is that of its length. The control
/// polygon is that of a straight line, run through unevenly.
#[test]
fn a_rope_along_a_curve_has_equal_segments() {
    let bezier = CubicBezier::new([[Vec3::ZERO, Vec3::X * 0.1, Vec3::X * 0.2, Vec3::X * 3.0]]);
    let rope = Rope::along(bezier.to_curve().expect("a curve")).with_segments(30);
    let net = rope.topology().expect("sound");
    assert_eq!(net.layout, Layout::Rope { is_closed: false });
    for (number, place) in net.positions.iter().enumerate() {
        assert!(place.distance(Vec3::X * 0.1 * number as f32) < 1e-5, "{number}: {place}");
    }
    let mass: f64 = net.masses.iter().map(|mass| f64::from(*mass)).sum();
    assert!((mass / (3.0 * f64::from(rope.material.linear_density)) - 1.0).abs() < 1e-5);
}

#[test]
fn recipes_that_cannot_be_are_refused_by_name() {
    let message = |rope: Rope| rope.topology().expect_err("refused").to_string();
    assert_eq!(message(Rope::new(0.0)), "path has no length");
    assert_eq!(message(Rope::new(1.0).with_segments(0)), "segments is 0, expected 1 to 16777216");
    assert_eq!(message(Rope::new(1.0).with_radius(-1.0)), "radius is -1.0, expected a finite number >= 0");
    assert_eq!(message(Rope::new(1.0).with_spacing(0.0)), "spacing is 0.0, expected a finite number > 0");
    let material = RopeMaterial { linear_density: f32::NAN, ..RopeMaterial::HEMP };
    let refused = message(Rope::new(1.0).with_material(material));
    assert_eq!(refused, "linear_density is NaN, expected a finite number > 0");
    let material = RopeMaterial { stretch_stiffness: f32::MAX, ..RopeMaterial::HEMP };
    let refused = message(Rope::new(1.0).with_material(material));
    let expected =
        "sizes and material do not go together: springs[0]: stiffness is inf, expected a finite number >= 0";
    assert_eq!(refused, expected);
}
