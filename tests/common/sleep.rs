//! What falls asleep in the pure solver.

use bevy::math::{Quat, Vec3};
use bevy_mass_spring::solver::{
    Collider, Integrator, PairRules, Pose, Shape, Sleep, Solver, StepSettings, SubstepMode,
};

use super::bodies::{Ball, GRAVITY, solver_bits, with_ground, world};

const RULES: PairRules = PairRules { restitution: 0.0, friction: 0.3 };

/// Ticks of 1/60 s in four substeps under gravity; balls collide, and fall asleep.
pub fn settings(integrator: Integrator) -> StepSettings {
    StepSettings {
        integrator,
        substeps: SubstepMode::Fixed(4),
        gravity: Vec3::NEG_Y * GRAVITY,
        pair_rules: Some(RULES),
        sleep: Some(Sleep::default()),
        ..StepSettings::default()
    }
}

/// Steps until all is asleep; the time that it took, s.
pub fn until_asleep(solver: &mut Solver, settings: &StepSettings, seconds: f32) -> f32 {
    let movable = (0..solver.particle_count()).filter(|slot| solver.inverse_mass(*slot) > 0.0).count();
    let ticks = (seconds / settings.time_step) as u32;
    for tick in 0..ticks {
        if solver.asleep_count() == movable {
            return tick as f32 * settings.time_step;
        }
        solver.step(settings);
    }
    panic!("after {seconds} s {} of {movable} sleep ({})", solver.asleep_count(), settings.integrator);
}

/// What sleeps does not move, by a single bit.
pub fn assert_stays(solver: &mut Solver, settings: &StepSettings) {
    let expected = solver_bits(solver);
    for _ in 0..100 {
        solver.step(settings);
        assert!(solver_bits(solver) == expected, "{}", settings.integrator);
    }
    let at_rest = |slot: usize| solver.inverse_mass(slot) == 0.0 || solver.velocity(slot) == Vec3::ZERO;
    assert!((0..solver.particle_count()).all(at_rest));
}

/// `side`³ balls of 0.1 m above an open box, that are apart by `jitter` m from a lattice in which they do not touch.
fn balls(side: u16, jitter: f32) -> Solver {
    world((0..side.pow(3)).map(|ball| {
        let [x, y, z] = [ball % side, ball / side % side, ball / side / side].map(f32::from);
        // The upper bits of a multiplicative hash (Knuth), 0 to 12.
        let number = |factor: u32| (u32::from(ball) + 1).wrapping_mul(factor) >> 16;
        let off = [0x9E37_79B9, 0x85EB_CA6B, 0xC2B2_AE35].map(|factor| (number(factor) % 13) as f32);
        let off = Vec3::from(off);
        Ball::at(Vec3::new(x + 0.5, z + 0.6, y + 0.5) * (0.2 + 13.0 * jitter) + off * jitter)
    }))
}

/// The balls above an open box of half-spaces.
pub fn pile(side: u16) -> Solver {
    let (jitter, friction) = (0.0015, 0.3);
    let width = f32::from(side) * (0.2 + 13.0 * jitter);
    let mut solver = with_ground(balls(side, jitter), 0.0, friction);
    for (point, normal) in [
        (Vec3::ZERO, Vec3::X),
        (Vec3::ZERO, Vec3::Z),
        (Vec3::X * width, Vec3::NEG_X),
        (Vec3::Z * width, Vec3::NEG_Z),
    ] {
        solver.add_collider(Collider::half_space(point, normal, 0.0, friction));
    }
    solver
}

/// The balls above an open box of cuboids, so wide that they collapse.
pub fn pile_in_cuboids(side: u16) -> Solver {
    let (jitter, friction) = (0.008, 0.3);
    let (width, height) = (f32::from(side) * (0.2 + 13.0 * jitter), 2.0 * f32::from(side));
    let mut solver = balls(side, jitter);
    let middle = 0.5 * width;
    for (place, half_size) in [
        (Vec3::new(middle, -0.5, middle), Vec3::new(width, 0.5, width)),
        (Vec3::new(-0.5, middle, middle), Vec3::new(0.5, height, width)),
        (Vec3::new(width + 0.5, middle, middle), Vec3::new(0.5, height, width)),
        (Vec3::new(middle, middle, -0.5), Vec3::new(width, height, 0.5)),
        (Vec3::new(middle, middle, width + 0.5), Vec3::new(width, height, 0.5)),
    ] {
        let mut wall = resting(Shape::cuboid(half_size), place);
        wall.material.friction = friction;
        solver.add_collider(wall);
    }
    solver
}

/// A collider at rest, without friction.
pub fn resting(shape: Shape, point: Vec3) -> Collider {
    Collider::resting(shape, Pose { point, rotation: Quat::IDENTITY })
}
