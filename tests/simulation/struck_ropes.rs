//! Heavy balls that strike light, stiff ropes.

use bevy::prelude::*;
use bevy_mass_spring::nets::RopeMaterial;
use bevy_mass_spring::prelude::*;

use crate::common::*;

/// A ball of 2 kg strikes a rope of 84 g, EA = 1 MN, that floats: in the most elastic impact it keeps (M − m) / (M + m) of its speed, and by the
/// momentum of both it is never slower than that, in which part of a link it may strike.
#[test]
fn a_ball_keeps_its_momentum_where_it_strikes_a_rope() {
    for integrator in [Integrator::Auto, Integrator::TrBdf2, Integrator::ImplicitEuler, Integrator::Xpbd] {
        for speed in [10.0, 30.0, 60.0_f32] {
            for place in [0.0, 0.1, 0.33_f32] {
                let mut app = app();
                app.insert_resource(SolverSettings { integrator, ..default() });
                app.world_mut().resource_mut::<Environment>().gravity = Vec3::ZERO;
                app.world_mut().resource_mut::<CollisionSettings>().particles = true;
                let material = RopeMaterial {
                    linear_density: 0.07,
                    stretch_stiffness: 1e6,
                    bending_stiffness: 0.0,
                    retardation_time: 0.0,
                };
                let rope = Rope::between(Vec3::X * -0.6, Vec3::X * 0.6).with_segments(20).with_radius(0.01);
                app.world_mut().spawn(rope.with_material(material));
                let ball = spawn(&mut app, 2.0, 0.09, Vec3::new(place, -0.4, 0.0));
                app.world_mut().get_mut::<ParticleVelocity>(ball).unwrap().0 = Vec3::Y * speed;
                run(&mut app, (2.0 / (speed * TICK)) as u32);
                let least = (2.0 - 0.084) / (2.0 + 0.084) * speed;
                let found = velocity(&app, ball);
                let case = format!("{integrator}, {speed} m/s, at {place} m");
                assert!(found.y > 0.98 * least && found.length() < 1.01 * speed, "{case}: {found}");
            }
        }
    }
}
