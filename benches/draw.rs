//! The cost of drawing nets, without a renderer, beside Bevy's own functions on the same mesh.
//!
//! `cargo bench --features render --bench draw`, or in a hurry with `-- --quick`. `vertices` is the schedule [`Last`] of an
//! app with one net that moved, in which its vertices are written; `bounds` the box around it and Bevy's search for what
//! is seen, in [`PostUpdate`]; `at rest` is both when it did not move.

use std::hint::black_box;
use std::sync::Arc;

use bevy::asset::{AssetPlugin, RenderAssetUsages};
use bevy::camera::CameraPlugin;
use bevy::ecs::message::Messages;
use bevy::ecs::schedule::{ScheduleLabel, SingleThreadedExecutor};
use bevy::mesh::{Indices, MeshPlugin, PrimitiveTopology};
use bevy::prelude::*;
use bevy_mass_spring::nets::{Layout, Topology};
use bevy_mass_spring::prelude::*;
use bevy_mass_spring::solver;
use criterion::{Criterion, Throughput, criterion_group, criterion_main};

/// A sheet of `side`² particles.
fn sheet(side: u32) -> Topology {
    let mut triangles = Vec::new();
    for row in 0..side - 1 {
        for column in 0..side - 1 {
            let here = row * side + column;
            triangles.extend([[here, here + side, here + side + 1], [here, here + side + 1, here + 1]]);
        }
    }
    let place = |slot: u32| Vec3::new((slot % side) as f32, -((slot / side) as f32), 0.0) * 0.02;
    Topology {
        positions: (0..side * side).map(place).collect(),
        masses: vec![0.01; (side * side) as usize],
        triangles,
        layout: Layout::Grid { cells: [side - 1; 2] },
        ..default()
    }
}

/// A rope of so many links.
fn rope(links: u32) -> Topology {
    let spring = solver::Spring { rest_length: 0.02, ..default() };
    Topology {
        positions: (0..=links).map(|slot| Vec3::X * 0.02 * slot as f32).collect(),
        masses: vec![0.01; links as usize + 1],
        radius: 0.01,
        springs: (0..links).map(|slot| ([slot, slot + 1], spring)).collect(),
        layout: Layout::Rope { is_closed: false },
        ..default()
    }
}

/// An app in which a camera sees a net, and its entity.
fn app(topology: Topology, drawing: impl Bundle) -> (App, Entity) {
    let mut app = App::new();
    let plugins = (MinimalPlugins, TransformPlugin, AssetPlugin::default(), MeshPlugin, CameraPlugin);
    app.add_plugins(plugins).add_plugins(MassSpringRenderPlugin);
    for schedule in [PostUpdate.intern(), Last.intern()] {
        app.edit_schedule(schedule, |schedule| {
            schedule.set_executor(SingleThreadedExecutor::new());
        });
    }
    app.world_mut().spawn((Camera3d::default(), Transform::from_xyz(0.0, 0.0, 5.0)));
    let net = ParticleNet::new(Arc::new(topology), &Transform::IDENTITY);
    let net = app.world_mut().spawn((net, drawing)).id();
    app.finish();
    app.cleanup();
    for _ in 0..3 {
        app.update();
    }
    (app, net)
}

fn touch(app: &mut App, net: Entity) {
    let mut net = app.world_mut().get_mut::<ParticleNet>(net).expect("a net");
    for (slot, place) in net.positions_mut().iter_mut().enumerate() {
        place.z = if place.z == 0.0 { 0.001 * (slot % 7) as f32 } else { 0.0 };
    }
    app.world_mut().resource_mut::<Messages<AssetEvent<Mesh>>>().clear();
}

fn draw(criterion: &mut Criterion) {
    let scenes: [(&str, Topology, fn(&mut EntityWorldMut)); 2] = [
        ("cloth of 100²", sheet(100), |net| {
            net.insert(NetMesh);
        }),
        ("rope of 625 links, 1251 rings of 8", rope(625), |net| {
            net.insert(RopeMesh { sides: 7, ..default() });
        }),
    ];
    for (name, topology, insert) in scenes {
        let mut group = criterion.benchmark_group(format!("draw {name}"));
        group.throughput(Throughput::Elements(10_000));
        let (mut app, net) = app(topology, ());
        insert(&mut app.world_mut().entity_mut(net));
        app.update();
        app.update();
        group.bench_function("vertices", |bencher| {
            bencher.iter_custom(|iterations| {
                let mut total = std::time::Duration::ZERO;
                for _ in 0..iterations {
                    touch(&mut app, net);
                    app.world_mut().run_schedule(PostUpdate);
                    let start = std::time::Instant::now();
                    app.world_mut().run_schedule(Last);
                    total += start.elapsed();
                }
                total
            });
        });
        group.bench_function("bounds", |bencher| {
            bencher.iter_custom(|iterations| {
                let mut total = std::time::Duration::ZERO;
                for _ in 0..iterations {
                    touch(&mut app, net);
                    let start = std::time::Instant::now();
                    app.world_mut().run_schedule(PostUpdate);
                    total += start.elapsed();
                    app.world_mut().run_schedule(Last);
                }
                total
            });
        });
        app.world_mut().resource_mut::<Messages<AssetEvent<Mesh>>>().clear();
        group.bench_function("at rest", |bencher| {
            bencher.iter(|| {
                app.world_mut().run_schedule(PostUpdate);
                app.world_mut().run_schedule(Last);
            });
        });
    }
}

/// What Bevy offers for the same.
fn bevy_normals(criterion: &mut Criterion) {
    let topology = sheet(100);
    let mut mesh = Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::default())
        .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, topology.positions)
        .with_inserted_indices(Indices::U32(topology.triangles.into_flattened()));
    let mut group = criterion.benchmark_group("normals of Bevy of a cloth of 100²");
    group.bench_function("compute_area_weighted_normals", |bencher| {
        bencher.iter(|| black_box(&mut mesh).compute_area_weighted_normals());
    });
    group.bench_function("compute_smooth_normals", |bencher| {
        bencher.iter(|| black_box(&mut mesh).compute_smooth_normals());
    });
}

/// 500 ropes of 50 links that all moved: the box around each and its vertices, by meshes of their own and as a crowd.
/// `at rest` is what the same takes when none moved.
#[cfg(feature = "crowd")]
fn crowd(criterion: &mut Criterion) {
    use bevy_mass_spring::render::MassSpringCrowdPlugin;

    let mut group = criterion.benchmark_group("draw 500 ropes of 50 links");
    for (name, is_crowd) in [("meshes", false), ("crowd", true)] {
        let mut app = App::new();
        let plugins = (MinimalPlugins, TransformPlugin, AssetPlugin::default(), MeshPlugin, CameraPlugin);
        app.add_plugins(plugins).add_plugins(MassSpringRenderPlugin);
        if is_crowd {
            app.init_asset::<Shader>().add_plugins(MassSpringCrowdPlugin { headless: true });
        }
        app.world_mut().spawn((Camera3d::default(), Transform::from_xyz(0.0, 0.0, 5.0)));
        app.finish();
        app.cleanup();
        let topology = Arc::new(rope(50));
        let nets: Vec<Entity> = (0..500)
            .map(|number| {
                let place = Transform::from_xyz(-0.5, 0.01 * (number - 250) as f32, 0.0);
                let net = ParticleNet::new(Arc::clone(&topology), &place);
                let mut net = app.world_mut().spawn((net, RopeMesh::default()));
                if is_crowd {
                    net.insert(RopeCrowd);
                }
                net.id()
            })
            .collect();
        for _ in 0..4 {
            app.update();
        }
        for (what, moves) in [("moved", true), ("at rest", false)] {
            group.bench_function(format!("{name}, {what}"), |bencher| {
                bencher.iter_custom(|iterations| {
                    let mut total = std::time::Duration::ZERO;
                    for _ in 0..iterations {
                        if moves {
                            nets.iter().for_each(|net| touch(&mut app, *net));
                        }
                        let start = std::time::Instant::now();
                        app.world_mut().run_schedule(PostUpdate);
                        app.world_mut().run_schedule(Last);
                        total += start.elapsed();
                        app.world_mut().resource_mut::<Messages<AssetEvent<Mesh>>>().clear();
                    }
                    total
                });
            });
        }
    }
}

#[cfg(feature = "crowd")]
criterion_group!(benches, draw, bevy_normals, crowd);
#[cfg(not(feature = "crowd"))]
criterion_group!(benches, draw, bevy_normals);
criterion_main!(benches);
