//! Balloons: the tension of the skin, and how far it stretches.

use bevy::math::DVec3;
use bevy::prelude::Sphere;
use bevy_mass_spring::nets::{Balloon, BalloonMaterial, Topology};

use super::statics::Statics;

fn balloon(radius: f32, subdivisions: u32) -> Topology {
    let material = BalloonMaterial { stretch_stiffness: 1e3, pressure: 10.0, ..BalloonMaterial::default() };
    let recipe = Balloon::sphere(Sphere::new(radius)).with_subdivisions(subdivisions).with_material(material);
    recipe.topology().expect("sound")
}

/// Under a small pressure p the radius grows by p r / (2 K) (1 − ν) of itself, ν = 1/3, and the mean tension is p r
/// / 2 (the virial of springs: Σ T l = 2 A · tension).
#[test]
fn pressure_stretches_a_sphere_by_its_closed_form() {
    let (radius, pressure, stiffness) = (0.5, 10.0, 1e3);
    for subdivisions in [2, 3] {
        let net = balloon(radius as f32, subdivisions);
        let mut skin = Statics::new(&net);
        let mut area = 0.0;
        for corners in &net.triangles {
            let [a, b, c] = corners.map(|corner| skin.positions[corner as usize]);
            let vector = 0.5 * (b - a).cross(c - a);
            area += vector.length();
            corners.iter().for_each(|corner| skin.forces[*corner as usize] += vector * (pressure / 3.0));
        }
        let displacements = skin.solve();
        let outward = |(place, moved): (&DVec3, &DVec3)| moved.dot(place.normalize());
        let sum: f64 = skin.positions.iter().zip(&displacements).map(outward).sum();
        let growth = sum / displacements.len() as f64 / radius;
        let expected = pressure * radius / (3.0 * stiffness);
        assert!((growth / expected - 1.0).abs() < 0.05, "{subdivisions}: {growth} {expected}");
        let virial = |(ends, spring): &([u32; 2], bevy_mass_spring::solver::Spring)| {
            let [a, b] = ends.map(|end| end as usize);
            let span = skin.positions[a] - skin.positions[b];
            f64::from(spring.stiffness) * (displacements[a] - displacements[b]).dot(span)
        };
        let tension = net.springs.iter().map(virial).sum::<f64>() / (2.0 * area);
        let expected = 0.5 * pressure * radius;
        assert!((tension / expected - 1.0).abs() < 0.03, "{subdivisions}: {tension} {expected}");
    }
}
