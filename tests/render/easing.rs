//! Between two ticks nets are drawn on the way.
#![cfg(feature = "interpolation")]

use std::time::Duration;

use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use bevy_mass_spring::prelude::*;

use crate::scene::{app_with, assert_enclosed, mesh, net, positions, sheet};

/// An app whose frames are a quarter of a tick, in which every tick moves the net by 1 m along x.
fn eased_app() -> (App, Entity) {
    let mut app = app_with(|app| {
        app.add_plugins((
            MassSpringPlugin::default().physics_only(),
            MassSpringInterpolationPlugin { headless: true },
        ));
    });
    let tick = Duration::from_millis(16);
    app.insert_resource(Time::<Fixed>::from_duration(tick))
        .insert_resource(TimeUpdateStrategy::ManualDuration(tick / 4))
        .add_systems(
            FixedPostUpdate,
            (|mut nets: Query<&mut ParticleNet>| {
                for mut net in &mut nets {
                    net.positions_mut().iter_mut().for_each(|place| place.x += 1.0);
                }
            })
            .after(MassSpringSystems::Scatter),
        );
    let cloth = app.world_mut().spawn((net(sheet([2, 2])), NetMesh)).id();
    app.world_mut().entity_mut(cloth).insert(bevy::camera::visibility::NoFrustumCulling);
    app.update();
    (app, cloth)
}

fn drawn(app: &App, cloth: Entity) -> Vec3 {
    let place = app.world().get::<GlobalTransform>(cloth).unwrap();
    place.transform_point(positions(mesh(app, cloth))[0])
}

#[test]
fn a_net_is_drawn_on_the_way() {
    let (mut app, cloth) = eased_app();
    let mut last: Option<f32> = None;
    let mut frames = 0;
    for _ in 0..20 {
        app.update();
        let here = drawn(&app, cloth).x;
        let fraction = app.world().resource::<Time<Fixed>>().overstep_fraction();
        let end = app.world().get::<ParticleNet>(cloth).unwrap().positions()[0].x;
        if end > 1.0 {
            assert!((here - (end - 1.0 + fraction)).abs() < 1e-5, "{here} {end} {fraction}");
            if let Some(last) = last {
                assert!((here - last - 0.25).abs() < 1e-5, "frames are evenly apart");
            }
            last = Some(here);
            frames += 1;
        }
        assert_enclosed(&app, cloth);
    }
    assert!(frames > 10);
}

#[test]
fn what_is_put_somewhere_is_not_drawn_on_the_way_there() {
    let (mut app, cloth) = eased_app();
    for _ in 0..6 {
        app.update();
    }
    let mut net = app.world_mut().get_mut::<ParticleNet>(cloth).unwrap();
    net.positions_mut().iter_mut().for_each(|place| *place += Vec3::X * 100.0);
    for _ in 0..8 {
        app.update();
        assert!(drawn(&app, cloth).x > 100.0, "{}", drawn(&app, cloth));
        assert_enclosed(&app, cloth);
    }
}

#[derive(Component)]
struct Led;

/// Cloths of which all particles are pinned, or the first: these are moved by 1 m a tick before the step.
#[test]
fn pinned_particles_are_drawn_on_the_way_too() {
    let (mut app, _) = eased_app();
    app.add_systems(FixedUpdate, |mut nets: Query<&mut ParticleNet, With<Led>>| {
        for mut net in &mut nets {
            for pinned in net.pinned().to_vec() {
                net.positions_mut()[pinned as usize].y += 1.0;
            }
        }
    });
    let nets = [9, 1].map(|pinned| {
        let net = net(sheet([2, 2])).with_pinned(0..pinned);
        app.world_mut().spawn((net, Led, NetMesh, bevy::camera::visibility::NoFrustumCulling)).id()
    });
    let mut frames = 0;
    for _ in 0..20 {
        app.update();
        let fraction = app.world().resource::<Time<Fixed>>().overstep_fraction();
        for cloth in nets {
            let (here, end) =
                (drawn(&app, cloth).y, app.world().get::<ParticleNet>(cloth).unwrap().positions()[0].y);
            // In the first tick it starts where it is put.
            if end > 1.5 {
                assert!((here - (end - 1.0 + fraction)).abs() < 1e-4, "{here} {end} {fraction}");
                frames += 1;
            }
            assert_enclosed(&app, cloth);
        }
    }
    assert!(frames > 20);
}
