//! Small nets, and the same as entities.

use std::sync::Arc;

use bevy::prelude::*;
use bevy_mass_spring::nets::{Layout, Topology};
use bevy_mass_spring::prelude::*;
use bevy_mass_spring::solver;

/// A spring of these tests.
pub fn spring(rest_length: f32) -> solver::Spring {
    solver::Spring { rest_length, stiffness: 400.0, damping: 0.2, ..solver::Spring::default() }
}

/// A cloth of `count` × `count` particles, 0.1 m apart in x and z, with the springs of its rows, columns and diagonals.
pub fn cloth(count: u32) -> Topology {
    let number = |column: u32, row: u32| row * count + column;
    let mut topology = Topology {
        masses: vec![0.05; (count * count) as usize],
        layout: Layout::Grid { cells: [count - 1; 2] },
        ..Topology::default()
    };
    for row in 0..count {
        for column in 0..count {
            topology.positions.push(Vec3::new(column as f32 * 0.1, 0.0, row as f32 * 0.1));
            for (right, down, rest) in [(1, 0, 0.1), (0, 1, 0.1), (1, 1, 0.141_421_36)] {
                if column + right < count && row + down < count {
                    let ends = [number(column, row), number(column + right, row + down)];
                    topology.springs.push((ends, spring(rest)));
                }
            }
        }
    }
    topology
}

/// A rope of `count` particles, 0.1 m apart along x.
pub fn rope(count: u32) -> Topology {
    let mut topology = Topology {
        masses: vec![0.05; count as usize],
        layout: Layout::Rope { is_closed: false },
        ..Topology::default()
    };
    for particle in 0..count {
        topology.positions.push(Vec3::X * 0.1 * particle as f32);
        if particle > 0 {
            topology.springs.push(([particle - 1, particle], spring(0.1)));
        }
    }
    topology
}

/// The same with bends along it, or along the rows and columns of a cloth.
pub fn with_bends(mut topology: Topology) -> Topology {
    let bend =
        solver::Bend { stiffness: 3.0, damping: 0.01, weights: [1.0, -2.0, 1.0], ..Default::default() };
    let mut add = |ends: [u32; 3]| topology.rods.push((ends, bend));
    match topology.layout {
        Layout::Grid { cells: [x, y] } => {
            let number = |column: u32, row: u32| row * (x + 1) + column;
            for (row, column) in (0..=y).flat_map(|row| (0..=x).map(move |column| (row, column))) {
                if column + 2 <= x {
                    add([0, 1, 2].map(|step| number(column + step, row)));
                }
                if row + 2 <= y {
                    add([0, 1, 2].map(|step| number(column, row + step)));
                }
            }
        }
        _ => (2..topology.masses.len() as u32).for_each(|last| add([last - 2, last - 1, last])),
    }
    topology
}

/// Spawns a net.
pub fn spawn_net(app: &mut App, topology: &Topology, place: Vec3, pinned: &[u32]) -> Entity {
    let frame = Transform::from_translation(place);
    let net = ParticleNet::new(Arc::new(topology.clone()), &frame).with_pinned(pinned.iter().copied());
    app.world_mut().spawn((net, frame)).id()
}

/// Spawns the same as particles and springs.
pub fn spawn_entities(app: &mut App, topology: &Topology, place: Vec3, pinned: &[u32]) -> Vec<Entity> {
    let particles: Vec<Entity> = topology
        .positions
        .iter()
        .zip(&topology.masses)
        .zip(0..)
        .map(|((position, mass), number)| {
            let transform = Transform::from_translation(place + *position);
            let mut particle = app.world_mut().spawn((Particle::new(*mass, topology.radius), transform));
            if pinned.contains(&number) {
                particle.insert(Pinned);
            }
            particle.id()
        })
        .collect();
    for ([first, second], spring) in &topology.springs {
        let mut entity =
            Spring::new(particles[*first as usize], particles[*second as usize], spring.rest_length)
                .with_stiffness(spring.stiffness)
                .with_damping(spring.damping);
        entity.max_stretch = spring.max_stretch;
        app.world_mut().spawn(entity);
    }
    for (ends, bend) in &topology.rods {
        let [first, middle, last] = ends.map(|end| particles[end as usize]);
        let entity = Bend::new(first, middle, last).with_stiffness(bend.stiffness).with_damping(bend.damping);
        app.world_mut().spawn(entity);
    }
    particles
}

/// The net of an entity.
pub fn net(app: &App, entity: Entity) -> &ParticleNet {
    app.world().get::<ParticleNet>(entity).expect("it is a net")
}

/// The bits of all positions and velocities of a net.
pub fn net_bits(app: &App, entity: Entity) -> Vec<[u32; 6]> {
    let net = net(app, entity);
    let both = net.positions().iter().zip(net.velocities());
    both.map(|(at, speed)| [at.x, at.y, at.z, speed.x, speed.y, speed.z].map(f32::to_bits)).collect()
}
