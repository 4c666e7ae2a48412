//! Resting contact: balls and a column at rest, and Coulomb friction beside its closed forms.

use bevy::math::Vec3;
use bevy_mass_spring::solver::{self, Collider, Integrator, PairRules, Solver, StepSettings};

use crate::common::bodies::{Ball, GRAVITY, falling, position, velocity, with_ground, world};

/// The largest relative error of one f32 rounding.
const ROUNDING: f32 = f32::EPSILON / 2.0;

/// Placed at rest it stays, to the bit: the ground, y = 0, leaves no rounding. So for every restitution: a
/// rebound that ends within the substep is none.
#[test]
fn a_resting_ball_rests() {
    for scheme in Integrator::named() {
        for restitution in [0.0, 0.5, 1.0] {
            for substeps in [1, 4] {
                let resting = Vec3::new(0.3, 0.1, -0.2);
                let mut state = with_ground(world([Ball::at(resting)]), restitution, 0.3);
                for tick in 0..1000 {
                    state.step(&falling(scheme, substeps));
                    let found = [position(&state, 0), velocity(&state, 0)];
                    assert_eq!(found, [resting, Vec3::ZERO], "{scheme:?}, {restitution}, tick {tick}");
                }
            }
        }
    }
}

/// A dropped ball comes to rest in finite time, and then does not move at all.
#[test]
fn a_dropped_ball_comes_to_rest() {
    for scheme in Integrator::named() {
        for restitution in [0.0, 0.5, 0.8] {
            let mut state = with_ground(world([Ball::at(Vec3::Y * 0.5)]), restitution, 0.0);
            // The bounces last √(2 H/g) (1 + ε)/(1 − ε) = 0.286 s · 9 = 2.6 s for ε = 0.8 at most.
            for _ in 0..180 {
                state.step(&falling(scheme, 4));
            }
            for _ in 0..100 {
                state.step(&falling(scheme, 4));
                let found = [position(&state, 0), velocity(&state, 0)];
                assert_eq!(found, [Vec3::Y * 0.1, Vec3::ZERO], "{scheme:?}, {restitution}");
            }
        }
    }
}

/// A spring presses a ball of 1 kg onto the ground with 0.5 N more than its weight: it rests too.
#[test]
fn a_ball_that_a_spring_presses_down_rests() {
    for scheme in Integrator::named() {
        let pinned = Ball { mass: f32::INFINITY, ..Ball::at(Vec3::Y * 1.1) };
        let mut state = with_ground(world([pinned, Ball::at(Vec3::Y * 0.1)]), 1.0, 0.0);
        state
            .add_spring(
                [0, 1],
                solver::Spring {
                    rest_length: 1.5,
                    stiffness: 1.0,
                    damping: 0.1,
                    ..solver::Spring::default()
                },
            )
            .unwrap();
        for _ in 0..1000 {
            state.step(&falling(scheme, 4));
            let found = [position(&state, 1), velocity(&state, 1)];
            assert_eq!(found, [Vec3::Y * 0.1, Vec3::ZERO], "{scheme:?}");
        }
    }
}

const COLUMN: usize = 20;

/// Twenty balls of radius 0.1 m, each on top of the one before.
fn column(masses: impl Fn(usize) -> f32) -> Solver {
    let balls = (0..COLUMN)
        .map(|number| Ball { mass: masses(number), ..Ball::at(Vec3::Y * (0.1 + 0.2 * number as f32)) });
    with_ground(world(balls), 0.0, 0.0)
}

/// While the impulses converge, from zero at the start, a ball may have to bear the weight of all others
/// for a substep, which presses each contact by up to n g h² = 3.5 mm;
/// pairs at rest may overlap by a thousandth of their distance, 0.2 mm (`RESTING_OVERLAP`). After 15 s
/// all is still. Sideways nothing pushes: x and z stay zero to the bit.
#[test]
fn a_column_at_rest_stays() {
    let substep = 1.0 / 240.0;
    let displacement = COLUMN as f32 * GRAVITY * substep * substep;
    for scheme in Integrator::named() {
        for mass_ratio in [1.0_f32, 1.1] {
            let mut state = column(|number| mass_ratio.powi(number as i32));
            let settings = StepSettings { pair_rules: Some(PairRules::default()), ..falling(scheme, 4) };
            let mut before = state.clone();
            for tick in 0..1000 {
                state.step(&settings);
                for number in 0..COLUMN {
                    let (place, motion) = (position(&state, number), velocity(&state, number));
                    let sunk = (place.y - 0.1 - 0.2 * number as f32).abs();
                    let case = format!("{scheme:?}, masses × {mass_ratio}, tick {tick}, ball {number}");
                    assert!(sunk <= (displacement + 0.0002) * (number + 1) as f32, "{case}: off by {sunk} m");
                    assert_eq!([place.x, place.z, motion.x, motion.z], [0.0; 4], "{case}");
                    if tick >= 900 {
                        let moved = place.y - position(&before, number).y;
                        assert!(moved.abs() < 1e-5, "{case}: moved by {moved} m");
                        assert!(motion.length() < GRAVITY * substep, "{case}: {motion}");
                    }
                }
                before.clone_from(&state);
            }
        }
    }
}

/// A block slides v² / (2 μ g) far. The velocity at the ends of substeps is the exact v − μ g t; its
/// sum over n = v/(μ g h) substeps is off by v h / 2 at most, and the static friction of positions
/// holds back up to μ g h² in each substep, v h in all: 1.5 v h.
#[test]
fn a_sliding_block_stops_where_friction_says() {
    let (speed, friction) = (2.0_f32, 0.4_f32);
    let expected = speed * speed / (2.0 * friction * GRAVITY);
    for scheme in Integrator::named() {
        for substeps in [1, 4, 16] {
            let ball = Ball { velocity: Vec3::X * speed, ..Ball::at(Vec3::Y * 0.1) };
            let mut state = with_ground(world([ball]), 0.0, friction);
            let mut longest_stop = 0;
            for _ in 0..120 {
                state.step(&falling(scheme, substeps));
                longest_stop = if velocity(&state, 0) == Vec3::ZERO { longest_stop + 1 } else { 0 };
            }
            let way = position(&state, 0).x;
            let tolerance = 1.5 * speed / (60.0 * substeps as f32);
            let case = format!("{scheme:?}, {substeps} substeps");
            assert!((way - expected).abs() < tolerance, "{case}: {way} m instead of {expected} m");
            // 2 / (0.4 · 9.81) = 0.51 s are 31 ticks: it lies still for the other 89.
            assert!(longest_stop >= 120 - 32, "{case}: still for {longest_stop} ticks only");
            assert_eq!([position(&state, 0).y, position(&state, 0).z], [0.1, 0.0], "{case}");
        }
    }
}

/// A ball on a plane that falls towards +X by `slope` = tan θ, with `friction`.
fn on_incline(slope: f32, friction: f32) -> Solver {
    let normal = Vec3::new(slope, 1.0, 0.0).normalize();
    let mut state = world([Ball::at(normal * 0.1)]);
    state.add_collider(Collider::half_space(Vec3::ZERO, normal, 0.0, friction));
    state
}

/// Static friction holds the ball in its place. Each substep rounds a position of size 0.1 m, and the
/// correction along the normal, a few times; even if all roundings went downhill, they would add up to
/// 4 u · 0.1 m a substep.
#[test]
fn a_ball_on_a_rough_incline_does_not_creep() {
    for scheme in Integrator::named() {
        for slope in [0.1_f32, 0.36, 1.0] {
            let mut state = on_incline(slope, 1.05 * slope);
            let start = position(&state, 0);
            for _ in 0..1000 {
                state.step(&falling(scheme, 4));
            }
            let crept = (position(&state, 0) - start).length();
            let tolerance = 4000.0 * 4.0 * ROUNDING * 0.1;
            assert!(crept < tolerance, "{scheme:?}, slope {slope}: {crept} m");
            // The change of velocity in a substep, g h = 0.04 m/s, is undone but for roundings.
            assert!(velocity(&state, 0).length() < 1e-7, "{scheme:?}, slope {slope}");
        }
    }
}

/// A ball rests on a plane of any height and slope, not just where the numbers are round: velocity and
/// place stay within roundings of numbers of size 10 m (a rounding of 10 m in a substep of 4 ms is
/// 1.4e-4 m/s, but it must not become a velocity).
#[test]
fn a_ball_rests_on_any_plane() {
    for scheme in Integrator::named() {
        for slope in [0.0_f32, 0.1, 0.36, 1.0, 1.7] {
            for height in [0.0_f32, 0.3, -7.7] {
                let normal = Vec3::new(slope, 1.0, 0.0).normalize();
                let point = Vec3::new(0.3, height, 0.2);
                let mut state = world([Ball::at(point + normal * 0.1)]);
                state.add_collider(Collider::half_space(point, normal, 0.0, 1.05 * slope));
                let start = position(&state, 0);
                for tick in 0..300 {
                    state.step(&falling(scheme, 4));
                    let case = format!("{scheme:?}, slope {slope}, height {height}, tick {tick}");
                    assert!(velocity(&state, 0).length() < 1e-6, "{case}: {}", velocity(&state, 0));
                    assert!(position(&state, 0).distance(start) < 4.0 * ROUNDING * 10.0, "{case}");
                }
            }
        }
    }
}

/// Below μ = tan θ it slides with a = g (sin θ − μ cos θ), rubbed in every substep.
#[test]
fn a_ball_on_a_smooth_incline_slides() {
    for scheme in Integrator::named() {
        for slope in [0.1_f32, 0.36, 1.0] {
            for friction in [0.0, 0.5 * slope, 0.95 * slope] {
                let mut state = on_incline(slope, friction);
                for _ in 0..240 {
                    state.step(&falling(scheme, 4));
                }
                let cosine = 1.0 / (1.0 + slope * slope).sqrt();
                let expected = 4.0 * GRAVITY * cosine * (slope - friction);
                let downhill = Vec3::new(1.0, -slope, 0.0) * cosine;
                let found = velocity(&state, 0).dot(downhill);
                let case = format!("{scheme:?}, slope {slope}, friction {friction}");
                // Roundings of u v in each of 960 substeps, all in one direction at worst.
                let tolerance = 960.0 * ROUNDING * 2.0 * expected;
                assert!((found - expected).abs() < tolerance, "{case}: {found}, not {expected}");
            }
        }
    }
}
