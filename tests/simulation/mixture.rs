//! `Auto` with soft and stiff nets in one scene: each component is integrated by its own scheme, as if it
//! were alone.

use bevy::prelude::*;
use bevy_mass_spring::prelude::*;

use crate::common::{self, TICK, app, bits, hash, join, position, report, run, spawn, spawn_pinned};

const GRAVITY: f64 = 9.81;

/// Where the soft pendulum hangs.
const ANCHOR: Vec3 = Vec3::new(5.0, 0.0, 0.0);

/// Its stiffness, N/m.
const SOFT: f32 = 50.0;

/// A soft undamped pendulum of 1 kg and 1 m, held at 60° from where it hangs; its bob.
fn spawn_pendulum(app: &mut App, stiffness: f32) -> Entity {
    let anchor = spawn_pinned(app, ANCHOR);
    let bob = spawn(app, 1.0, 0.0, ANCHOR + Vec3::new(0.75_f32.sqrt(), -0.5, 0.0));
    join(app, Spring::new(anchor, bob, 1.0).with_stiffness(stiffness).with_damping(0.0));
    bob
}

const LINKS: usize = 10;
const LINK: f32 = 0.01;
const STIFF: f32 = 1e9;
const LINK_MASS: f32 = 10.0;

/// A short heavy chain of 10⁹ N/m that hangs from the origin along `direction`.
fn spawn_chain(app: &mut App, direction: Vec3) -> Vec<Entity> {
    let mut chain = vec![spawn_pinned(app, Vec3::ZERO)];
    for number in 1..=LINKS {
        let next = spawn(app, LINK_MASS, 0.0, direction * LINK * number as f32);
        join(app, Spring::new(chain[number - 1], next, LINK).with_stiffness(STIFF));
        chain.push(next);
    }
    chain
}

fn mixture() -> (Integrator, u32, u32, usize) {
    (Integrator::VelocityVerlet, 4, 2, LINKS)
}

/// What ran in the last tick.
fn ran(app: &App) -> (Integrator, u32, u32, usize) {
    let report = report(app);
    (report.integrator, report.substeps, report.stiff_substeps, report.stiff_springs)
}

/// Energy of the pendulum, J.
fn pendulum_energy(app: &App, bob: Entity) -> f64 {
    let place = (position(app, bob) - ANCHOR).as_dvec3();
    let speed = common::velocity(app, bob).as_dvec3();
    0.5 * speed.length_squared() + GRAVITY * place.y + 0.5 * f64::from(SOFT) * (place.length() - 1.0).powi(2)
}

/// One scheme for both would be implicit Euler for the pendulum too, or thousands of substeps.
#[test]
fn a_soft_pendulum_beside_a_stiff_chain_keeps_its_energy() {
    let mut app = app();
    let bob = spawn_pendulum(&mut app, SOFT);
    let chain = spawn_chain(&mut app, Vec3::NEG_Y);
    // What it may lose: from the start down to hanging at rest, stretched by mg/k.
    let start = pendulum_energy(&app, bob);
    let rest = -GRAVITY - 0.5 * GRAVITY * GRAVITY / f64::from(SOFT);
    for tick in 1..=(20.0 / TICK) as u32 {
        run(&mut app, 1);
        let lost = (start - pendulum_energy(&app, bob)) / (start - rest);
        assert!(lost.abs() < 0.05, "tick {tick}: {lost}");
    }
    assert_eq!(ran(&app), mixture());
    assert_eq!(report(&app).schemes(), "VelocityVerlet × 4, TrBdf2 × 2 on 10 springs");
    // Each link carries what hangs below, apart from the rounding of its ends: below 0.125 m by 2⁻²⁸ m each,
    // once where they are and once where their weight would take them.
    let rounding = 4.0 * 2.0_f64.powi(-28) * f64::from(STIFF);
    for link in 0..LINKS {
        let [upper, lower] = [chain[link], chain[link + 1]].map(|end| position(&app, end).as_dvec3());
        let pull = f64::from(STIFF) * (upper.distance(lower) - f64::from(LINK));
        let below = (LINKS - link) as f64 * f64::from(LINK_MASS) * GRAVITY;
        assert!((pull - below).abs() < rounding, "link {link}: {pull} N instead of {below} N");
    }
}

/// Both swing. Each moves in a mixture as it would by itself, in as many substeps.
#[test]
fn each_component_moves_as_if_it_were_alone() {
    // 80,000 N/m take 3.2 substeps of velocity Verlet at 1.4 hω, hence the 4 at least; 4,000,000 N/m 22.3,
    // hence 24, a multiple of the 2 of the implicit scheme.
    for (stiffness, substeps) in [(80_000.0, 4), (4e6, 24)] {
        let mut both = app();
        let bob = spawn_pendulum(&mut both, stiffness);
        let chain = spawn_chain(&mut both, Vec3::X);
        let mut pendulum = app();
        pendulum.insert_resource(common::scheme(Integrator::VelocityVerlet, substeps));
        let lone_bob = spawn_pendulum(&mut pendulum, stiffness);
        let mut stiff = app();
        let lone_chain = spawn_chain(&mut stiff, Vec3::X);
        for tick in 1..=200 {
            run(&mut both, 1);
            run(&mut pendulum, 1);
            run(&mut stiff, 1);
            assert_eq!(bits(&both, bob), bits(&pendulum, lone_bob), "{stiffness} N/m, tick {tick}");
            assert_eq!(hash(&both, &chain), hash(&stiff, &lone_chain), "{stiffness} N/m, tick {tick}");
        }
        assert_eq!(ran(&both), (Integrator::VelocityVerlet, substeps, 2, LINKS));
        assert_eq!(ran(&stiff), (Integrator::TrBdf2, 2, 0, 0));
    }
}

/// A free flight without springs is that of the explicit part: exact for velocity Verlet.
#[test]
fn particles_without_springs_belong_to_the_soft_part() {
    let mut app = app();
    spawn_pendulum(&mut app, SOFT);
    spawn_chain(&mut app, Vec3::X);
    let ball = spawn(&mut app, 1.0, 0.0, Vec3::new(-5.0, 0.0, 0.0));
    run(&mut app, 64);
    assert_eq!(ran(&app), mixture());
    // 4 · 64 sums of up to 5 m, each rounded by 2⁻²² m; implicit Euler would be off by g · 1 s · h/2 = 19 mm.
    let fallen = f64::from(position(&app, ball).y) + 0.5 * GRAVITY;
    assert!(fallen.abs() < 256.0 * 2.0_f64.powi(-22), "{fallen}");
}

#[test]
fn a_spring_that_joins_two_components_makes_them_one() {
    let mut app = app();
    let bob = spawn_pendulum(&mut app, SOFT);
    let chain = spawn_chain(&mut app, Vec3::X);
    run(&mut app, 2);
    assert_eq!(ran(&app), mixture());
    let link = join(&mut app, Spring::new(bob, chain[LINKS], 5.0).with_stiffness(10.0));
    run(&mut app, 2);
    assert_eq!(ran(&app), (Integrator::TrBdf2, 2, 0, 0));
    app.world_mut().despawn(link);
    run(&mut app, 2);
    assert_eq!(ran(&app), mixture());
    // Stiffness and mass decide, as they are now.
    app.world_mut().get_mut::<Particle>(bob).unwrap().mass = 1e-9;
    run(&mut app, 2);
    assert_eq!(ran(&app), (Integrator::TrBdf2, 2, 0, 0));
    app.world_mut().get_mut::<Particle>(bob).unwrap().mass = 1.0;
    // A named scheme is what runs.
    app.insert_resource(common::scheme(Integrator::SemiImplicitEuler, 2));
    run(&mut app, 2);
    assert_eq!(ran(&app), (Integrator::SemiImplicitEuler, 2, 0, 0));
    // `Fixed` with `Auto` is a minimum number of substeps for both.
    app.insert_resource(common::scheme(Integrator::Auto, 6));
    run(&mut app, 2);
    assert_eq!(ran(&app), (Integrator::VelocityVerlet, 6, 6, LINKS));
}

/// A moving anchor moves under both schemes: the two nets hang from one.
#[test]
fn a_moving_anchor_carries_both() {
    let mut app = app();
    app.world_mut().resource_mut::<Environment>().gravity_enabled = false;
    let chain = spawn_chain(&mut app, Vec3::NEG_Y);
    let soft = spawn(&mut app, 1.0, 0.0, Vec3::Y);
    join(&mut app, Spring::new(chain[0], soft, 1.0).with_stiffness(SOFT).with_damping(5.0));
    for tick in 1..=640 {
        common::place(&mut app, chain[0], Vec3::Z * 0.5 * TICK * tick as f32);
        run(&mut app, 1);
    }
    assert_eq!(ran(&app), mixture());
    // After 10 s both are near the anchor, which has gone 5 m. The damped one is towed, stretched by nothing; the other
    // whirls about the anchor, as nothing damps it, and is not quite straight.
    let anchor = position(&app, chain[0]);
    for (end, length, flex) in [(chain[LINKS], LINKS as f32 * LINK, 0.1), (soft, 1.0, 1e-2)] {
        let distance = position(&app, end).distance(anchor);
        assert!(distance < (1.0 + 1e-2) * length, "{distance} m instead of {length} m");
        assert!(distance > (1.0 - flex) * length, "{distance} m instead of {length} m");
    }
}

/// A soft undamped sheet of 10² that falls on a stiff rope, held at both ends.
fn spawn_sheet_above_rope(app: &mut App) {
    let mut last = spawn_pinned(app, Vec3::NEG_X);
    for number in 1..=20 {
        let place = Vec3::X * (0.1 * number as f32 - 1.0);
        let next = match number {
            20 => spawn_pinned(app, place),
            _ => spawn(app, 0.05, 0.04, place),
        };
        join(app, Spring::new(last, next, 0.1).with_stiffness(1e8).with_damping(0.0));
        last = next;
    }
    let mut sheet: Vec<Entity> = Vec::new();
    for number in 0..100 {
        let (column, row) = (number % 10, number / 10);
        let place = Vec3::new(0.1 * column as f32 - 0.45, 0.3, 0.1 * row as f32 - 0.42);
        let next = spawn(app, 0.01, 0.04, place);
        for (exists, back) in [(column > 0, 1), (row > 0, 10)] {
            if exists {
                let spring = Spring::new(sheet[number - back], next, 0.1);
                join(app, spring.with_stiffness(100.0).with_damping(0.0));
            }
        }
        sheet.push(next);
    }
}

/// The sheet hangs over the rope and slides off. There is never more energy than at the start, springs of both included:
/// where they touch they take one scheme.
#[test]
fn a_soft_sheet_that_falls_on_a_stiff_rope_gains_no_energy() {
    for restitution in [0.0, 0.5] {
        let mut app = app();
        app.insert_resource(Measurements::default());
        *app.world_mut().resource_mut::<CollisionSettings>() =
            CollisionSettings { restitution, friction: 0.3, ..default() };
        spawn_sheet_above_rope(&mut app);
        let start = 100.0 * 0.01 * GRAVITY * 0.3;
        let mut touched = 0;
        for tick in 1..=256 {
            run(&mut app, 1);
            touched += report(&app).contacts;
            if tick == 1 {
                assert_eq!(report(&app).stiff_springs, 20, "two schemes, as nothing touches yet");
            }
            let energy = *app.world().resource::<Measurements>();
            let total = energy.kinetic_energy + energy.gravitational_energy + energy.elastic_energy;
            assert!(total < start, "restitution {restitution}, tick {tick}: {total} J, {energy:?}");
        }
        assert!(touched > 500, "{touched}");
    }
}
