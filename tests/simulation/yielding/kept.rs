//! What plastic nets keep, by closed forms.

use bevy::prelude::*;
use bevy_mass_spring::prelude::*;
use bevy_mass_spring::solver::Integrator;

use super::{EA, SCHEMES, lab, move_end, net, smooth, spawn_wire, strains, wire};
use crate::common::run;

/// p = s − ε in the mean of the rope, whichever springs yield most, as the tension is the same in all of them; and so long it
/// is without tension, where its end is brought.
fn assert_set(app: &mut App, [rope, end]: [Entity; 2], expected: f32, tolerance: f32, what: &str) {
    let found = strains(net(app, rope).topology());
    let mean = found.iter().sum::<f32>() / found.len() as f32;
    assert!((mean - expected).abs() < tolerance, "{what}: a plastic strain of {mean}, expected {expected}");
    move_end(app, end, 1.0 + expected);
    assert_eq!(strains(net(app, rope).topology()), found, "{what}: it yields no further");
    let tension = (0..found.len()).map(|spring| net(app, rope).tension(spring)).sum::<f32>();
    let tension = tension / found.len() as f32;
    assert!(tension.abs() < EA * tolerance, "{what}: {tension} N at {} m", 1.0 + expected);
}

/// The waves of a pull of 0.15 m in a second have strains of about 6 s (l / (c t))² = 1e-4.
#[test]
fn a_rope_keeps_what_it_was_stretched_beyond_its_yield_strain() {
    let cases = [5, 40, 80].map(|segments| (segments, SCHEMES[0])).into_iter();
    for (segments, scheme_of) in cases.chain(SCHEMES.map(|of| (20, of))) {
        let what = format!("{segments} segments, {scheme_of:?}");
        let mut app = lab(scheme_of);
        let yielding = Yielding { strain: Some(0.02), max_strain: None };
        let wire = spawn_wire(&mut app, (wire(segments), yielding));
        move_end(&mut app, wire[1], 1.015);
        assert_set(&mut app, wire, 0.0, 2e-4, &what);
        assert!(strains(net(&app, wire[0]).topology()).iter().all(|strain| *strain == 0.0), "{what}");
        move_end(&mut app, wire[1], 1.1);
        assert_set(&mut app, wire, 0.08, 4e-4, &what);
        // Again, from there; and the other way.
        move_end(&mut app, wire[1], 1.15);
        assert_set(&mut app, wire, 0.13, 4e-4, &what);
    }
}

/// Xpbd solves the springs one after the other, once a substep: its error is of first order in that.
#[test]
fn a_rope_keeps_the_same_under_xpbd_as_substeps_become_shorter() {
    let error = |substeps: u32| {
        let mut app = lab((Integrator::Xpbd, substeps));
        let yielding = Yielding { strain: Some(0.02), max_strain: None };
        let [rope, end] = spawn_wire(&mut app, (wire(20), yielding));
        move_end(&mut app, end, 1.1);
        let found = strains(net(&app, rope).topology());
        found.iter().sum::<f32>() / found.len() as f32 - 0.08
    };
    let [coarse, fine] = [64, 256].map(error);
    assert!(coarse < 0.008 && fine.abs() < 0.3 * coarse, "{coarse} and {fine}");
}

/// A load beyond EA ε has it flow to its limit, from where on it is elastic: F / EA + p.
#[test]
fn a_rope_yields_as_far_as_its_limit() {
    for scheme_of in SCHEMES {
        let mut app = lab(scheme_of);
        let yielding = Yielding { strain: Some(0.02), max_strain: Some(0.05) };
        let [rope, end] = spawn_wire(&mut app, (wire(20), yielding));
        app.world_mut().entity_mut(end).remove::<Pinned>();
        let mut last = 0.0;
        for (force, limit) in [(15.0, 0.0), (30.0, 0.05), (0.0, 0.05)] {
            for tick in 1..=64 {
                let now = last + (force - last) * smooth(tick, 64);
                app.world_mut().entity_mut(end).insert(AppliedForce(Vec3::X * now));
                run(&mut app, 1);
            }
            last = force;
            for _ in 0..16 {
                // What swings is not what the test is about.
                run(&mut app, 4);
                let mut net = app.world_mut().get_mut::<ParticleNet>(rope).unwrap();
                net.velocities_mut().iter_mut().for_each(|velocity| *velocity *= 0.5);
            }
            let found = strains(net(&app, rope).topology());
            assert!(found.iter().all(|strain| *strain == limit), "{scheme_of:?}, {force} N: {found:?}");
            let length = net(&app, rope).length().unwrap();
            let expected = 1.0 + limit + force / EA;
            assert!((length - expected).abs() < 1e-3, "{scheme_of:?}, {force} N: {length} m, {expected}");
        }
    }
}

/// Pulls a free net along x by a stress, slowly, and lets it go; the strain along x under it and after it. `ends` has the
/// particles of the two faces with the part of the stress, in m or m², that each has.
fn load(app: &mut App, entity: Entity, ends: &[Vec<(usize, f32)>; 2], stress: f32) -> [f32; 2] {
    let place = |app: &App, end: usize| {
        let weight: f32 = ends[end].iter().map(|(_, part)| part).sum();
        let at = |(particle, part): &(usize, f32)| net(app, entity).positions()[*particle].x * part / weight;
        ends[end].iter().map(at).sum::<f32>()
    };
    let extent = |app: &App| place(app, 1) - place(app, 0);
    let start = net(app, entity).topology().positions.iter().map(|at| at.x).fold(0.0, f32::max) * 2.0;
    let mut strains = [0.0; 2];
    for (phase, [from, to]) in [[0.0, stress], [stress, 0.0]].into_iter().enumerate() {
        for tick in 1..=96 {
            let now = from + (to - from) * smooth(tick, 64);
            let mut net = app.world_mut().get_mut::<ParticleNet>(entity).unwrap();
            let forces = net.applied_forces_mut();
            for (end, sign) in ends.iter().zip([-1.0, 1.0]) {
                end.iter().for_each(|(particle, part)| forces[*particle] = Vec3::X * (sign * now * part));
            }
            run(app, 1);
        }
        strains[phase] = extent(app) / start - 1.0;
    }
    strains
}

/// With s = (σ − (C − G) ε) / (G − G² / C) under the stress σ it keeps (s − ε)(C − G) / K: see `Yielding`. To the first
/// order of strains of 1 %.
#[test]
fn a_strip_of_cloth_keeps_a_part_of_what_its_threads_yielded() {
    const STRAIN: f32 = 2e-3;
    let [k, g] = [1e3, 375.0_f32];
    let c = 0.5 * (k + (k * k + 4.0 * g * g).sqrt());
    let stress = 1.25 * k * STRAIN;
    let stretched = (stress - (c - g) * STRAIN) / (g - g * g / c);
    let kept = (stretched - STRAIN) * (c - g) / k;
    let material = ClothMaterial {
        area_density: 0.2,
        stretch_stiffness: k,
        shear_stiffness: g,
        bending_stiffness: 0.0,
        retardation_time: 1e-3,
    };
    let cases = [2, 8, 16].map(|count| (count, SCHEMES[0])).into_iter();
    for (count, scheme_of) in cases.chain([1, 3, 5, 6].map(|of| (4, SCHEMES[of]))) {
        let mut app = lab(scheme_of);
        let cells = UVec2::new(2 * count, count);
        let strip = Cloth::grid(Vec3::new(-0.2, -0.1, 0.0), Vec3::X * 0.4, Vec3::Y * 0.2, cells);
        let yielding = Yielding { strain: Some(STRAIN), max_strain: None };
        let strip = app.world_mut().spawn((strip.with_material(material), yielding)).id();
        run(&mut app, 1);
        let ends = [0, cells.x].map(|i| {
            let part = |j| if j == 0 || j == count { 0.5 } else { 1.0 };
            let at = |j| ((j * (cells.x + 1) + i) as usize, part(j) * 0.2 / count as f32);
            (0..=count).map(at).collect::<Vec<_>>()
        });
        let [under, after] = load(&mut app, strip, &ends, stress);
        let what = format!("{count} cells, {scheme_of:?}");
        assert!((under / stretched - 1.0).abs() < 0.02, "{what}: {under}, expected {stretched}");
        assert!((after / kept - 1.0).abs() < 0.02, "{what}: {after}, expected {kept}");
    }
}

/// Beyond ε the tangent modulus is 3/5 E: s = ε + (σ − E ε) / (3/5 E), and it keeps 2/5 (s − ε); crushed as pulled. The bars of
/// Young's modulus are at 3 %.
#[test]
fn a_bar_of_jelly_keeps_a_part_of_what_it_was_crushed_by() {
    const STRAIN: f32 = 5e-4;
    const E: f32 = 1e5;
    let stretched = STRAIN + 0.5 * STRAIN / 0.6;
    let kept = 0.4 * (stretched - STRAIN);
    let material = JellyMaterial { density: 1e3, youngs_modulus: E, retardation_time: 5e-3 };
    let cases = [2, 8].map(|count| (count, SCHEMES[0])).into_iter();
    for (count, scheme_of) in cases.chain([0, 1, 5, 6].map(|of| (4, SCHEMES[of]))) {
        for sign in [-1.0, 1.0] {
            let mut app = lab(scheme_of);
            let size = Vec3::new(0.2, 0.1, 0.1);
            let bar = Jelly::lattice(-size, size, UVec3::new(2 * count, count, count));
            let yielding = Yielding { strain: Some(STRAIN), max_strain: None };
            let bar = app.world_mut().spawn((bar.with_material(material), yielding)).id();
            run(&mut app, 1);
            let side = 0.2 / count as f32;
            let part = |j| if j == 0 || j == count { 0.5 } else { 1.0 };
            let ends = [0, 2 * count].map(|i| {
                let number = |j, k| ((k * (count + 1) + j) * (2 * count + 1) + i) as usize;
                let at = |j, k| (number(j, k), part(j) * part(k) * side * side);
                (0..=count).flat_map(|k| (0..=count).map(move |j| at(j, k))).collect::<Vec<_>>()
            });
            let [under, after] = load(&mut app, bar, &ends, sign * 1.5 * E * STRAIN);
            let what = format!("{count} cells, {scheme_of:?}");
            assert!((under / (sign * stretched) - 1.0).abs() < 0.03, "{what}: {under}, expected {stretched}");
            assert!((after / (sign * kept) - 1.0).abs() < 0.03, "{what}: {after}, expected {kept}");
        }
    }
}
