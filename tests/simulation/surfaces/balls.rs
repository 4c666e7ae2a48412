//! Cloths on balls: colliders and surfaces together.

use bevy::math::{Quat, UVec2, Vec3};
use bevy_mass_spring::nets::{Cloth, ClothMaterial};
use bevy_mass_spring::solver::{
    Collider, Integrator, Material, PairRules, Pose, Shape, Solver, StepSettings, SubstepMode,
};

use super::SOFT;
use crate::common::bodies::{add_net, positions};
use crate::common::crossings::Shapes;

const BALL: f32 = 0.3;

/// A cloth of `cells`² cells falls onto a ball, which then turns at 3 rad/s and takes it along. It is looked at every `looks` ticks of
/// 1/120 s for some seconds.
fn wrap(integrator: Integrator, cells: u32, seconds: f32, looks: u32) {
    let mut solver = Solver::default();
    let material = Material { friction: 0.6, ..Material::default() };
    let pose = Pose { point: Vec3::ZERO, rotation: Quat::IDENTITY };
    solver.add_collider(Collider { material, ..Collider::resting(Shape::ball(BALL), pose) });
    let is_explicit = integrator == Integrator::SemiImplicitEuler;
    let corner = Vec3::new(-0.6, 0.0, -0.6);
    let cloth = Cloth::grid(corner, Vec3::X * 1.2, Vec3::Z * 1.2, UVec2::splat(cells));
    let cloth = cloth.with_radius(0.2 / cells as f32);
    let cloth = cloth.with_material(if is_explicit { SOFT } else { ClothMaterial::COTTON });
    let topology = cloth.topology().unwrap();
    add_net(&mut solver, &topology, Vec3::new(0.02, BALL + 0.02, 0.01), &[]);
    let corners = |list: &[u32; 3]| list.map(|corner| corner as usize);
    let shapes = Shapes::of_triangles(topology.triangles.iter().map(corners).collect());
    let settings = StepSettings {
        integrator,
        substeps: SubstepMode::Fixed(if is_explicit { 16 } else { 8 }),
        time_step: 1.0 / 120.0,
        gravity: Vec3::NEG_Y * 9.81,
        viscosity: 1e-4,
        pair_rules: Some(PairRules { restitution: 0.0, friction: 0.4 }),
        ..StepSettings::default()
    };
    let turned = |tick: u32| Quat::from_rotation_y(3.0 * (tick as f32 / 120.0 - 0.75).max(0.0));
    let mut touching = 0;
    let ticks = (120.0 * seconds) as u32;
    for tick in 0..ticks {
        let ball = &mut solver.inputs_mut().colliders[0];
        (ball.start.rotation, ball.target.rotation) = (turned(tick), turned(tick + 1));
        solver.step(&settings);
        touching = touching.max(solver.outputs().contact_count);
        if tick % looks == 0 || tick + 1 == ticks {
            let places = positions(&solver);
            assert!(places.iter().all(|place| place.is_finite()), "{integrator}, tick {tick}");
            assert_eq!(shapes.crossings(&places), 0, "{integrator}, tick {tick}");
            let nearest = places.iter().map(|place| place.length()).fold(f32::INFINITY, f32::min);
            assert!(nearest > BALL, "{integrator}, tick {tick}: {nearest} m");
        }
    }
    assert!(touching > 50, "{integrator}: {touching}");
    // What lies on top of the ball turns with it.
    let places = positions(&solver);
    let highest = (0..places.len()).max_by(|one, other| places[*one].y.total_cmp(&places[*other].y));
    let highest = highest.unwrap();
    assert!(places[highest].y > BALL, "{integrator}: {}", places[highest]);
    let (mut spin, mut weight) = (0.0, 0.0);
    for slot in (0..places.len()).filter(|slot| places[*slot].y > 0.5 * BALL) {
        let (place, velocity) = (places[slot], solver.velocity(slot));
        spin += place.z * velocity.x - place.x * velocity.z;
        weight += place.x * place.x + place.z * place.z;
    }
    let rate = spin / weight;
    println!("{integrator}, {cells}² cells: {touching} contacts, {rate} rad/s");
    assert!((rate - 3.0).abs() < 0.6, "{integrator}: {rate} rad/s");
}

/// After Bridson, Fedkiw and Anderson, *Robust treatment of collisions, contact and friction for cloth animation* (2002): a
/// cloth falls onto a ball, which then turns and takes it along.
#[test]
fn a_cloth_wraps_round_a_ball_that_turns_without_a_crossing() {
    for integrator in [Integrator::SemiImplicitEuler, Integrator::Xpbd] {
        wrap(integrator, 20, 1.75, 1);
    }
}

#[test]
#[ignore = "takes minutes in release"]
fn a_cloth_of_ten_thousand_particles_wraps_round_a_ball_that_turns_without_a_crossing() {
    wrap(Integrator::Xpbd, 100, 10.0, 20);
}
