//! Ropes and cloths in the pure solver that collide along edges and faces; and how deep they are in a collider.

use bevy::math::{DVec3, Vec3};
use bevy_mass_spring::solver::{Collider, Solver, Spring};

/// A spring between particles of `mass` kg, with a `damping` that is given as a part of √(k m).
fn spring(state: &Solver, ends: [usize; 2], stiffness: f32, (mass, damping): (f32, f32)) -> Spring {
    let [from, to] = ends.map(|end| state.position(end));
    let damping = damping * (stiffness * mass).sqrt();
    Spring { rest_length: from.distance(to), stiffness, damping, ..Spring::default() }
}

/// Adds a straight rope between two places, of particles of (mass, radius), kg and m; its slots.
pub fn rope(
    state: &mut Solver,
    [from, to]: [Vec3; 2],
    links: usize,
    (mass, radius): (f32, f32),
    stiffness: f32,
) -> Vec<usize> {
    let place = |link: usize| from.lerp(to, link as f32 / links as f32);
    let slots: Vec<usize> =
        (0..=links).map(|link| state.add_particle(place(link), Vec3::ZERO, mass, radius).unwrap()).collect();
    for ends in slots.windows(2) {
        let ends = [ends[0], ends[1]];
        state.add_spring(ends, spring(state, ends, stiffness, (mass, 0.02))).unwrap();
        state.add_collision_edge(ends).unwrap();
    }
    slots
}

/// A square cloth of `cells`² cells, whose neighbours are joined, and those along diagonals.
#[derive(Debug, Clone, Copy)]
pub struct Cloth {
    pub cells: usize,
    /// m.
    pub size: f32,
    /// Of its particles, m.
    pub radius: f32,
    /// Of a spring along a side of a cell, N/m; along diagonals it is 0.3 of that.
    pub stiffness: f32,
    /// kg/m².
    pub areal_density: f32,
    /// Of a spring, as a part of √(k m) of it and one particle.
    pub damping: f32,
}

impl Cloth {
    /// Adds it, from a corner on along two unit vectors; its triangles.
    pub fn add(self, state: &mut Solver, corner: Vec3, [along, across]: [Vec3; 2]) -> Vec<[usize; 3]> {
        let Self { cells, size, radius, stiffness, areal_density, damping } = self;
        let step = size / cells as f32;
        let mass = areal_density * step * step;
        let first = state.particle_count();
        let at = |i: usize, j: usize| first + j * (cells + 1) + i;
        for (j, i) in (0..=cells).flat_map(|j| (0..=cells).map(move |i| (j, i))) {
            let place = corner + (along * i as f32 + across * j as f32) * step;
            state.add_particle(place, Vec3::ZERO, mass, radius).unwrap();
        }
        let mut join = |ends: [usize; 2], stiffness: f32| {
            let spring = spring(state, ends, stiffness, (mass, damping));
            state.add_spring(ends, spring).unwrap();
        };
        for (j, i) in (0..=cells).flat_map(|j| (0..=cells).map(move |i| (j, i))) {
            if i < cells {
                join([at(i, j), at(i + 1, j)], stiffness);
            }
            if j < cells {
                join([at(i, j), at(i, j + 1)], stiffness);
            }
            if i < cells && j < cells {
                join([at(i, j), at(i + 1, j + 1)], 0.3 * stiffness);
                join([at(i + 1, j), at(i, j + 1)], 0.3 * stiffness);
            }
        }
        let cell =
            |(i, j)| [[at(i, j), at(i, j + 1), at(i + 1, j)], [at(i + 1, j), at(i, j + 1), at(i + 1, j + 1)]];
        let triangles: Vec<[usize; 3]> =
            (0..cells).flat_map(|j| (0..cells).map(move |i| (i, j))).flat_map(cell).collect();
        state.add_collision_triangles(&triangles, &[]).unwrap();
        triangles
    }
}

/// How deep a ball of `radius` m at a place is in a collider that rests, m; negative outside.
pub fn depth(collider: &Collider, place: DVec3, radius: f32) -> f64 {
    let turn = collider.target.rotation.as_dquat().inverse();
    collider.shape.depth(turn * (place - collider.target.point.as_dvec3()), radius)
}

/// The deepest of all points of edges, tried at every 20th of their length, m.
pub fn deepest_of_rope(state: &Solver, slots: &[usize], collider: &Collider, radius: f32) -> f64 {
    let of_edge = |ends: &[usize]| {
        let [from, to] = [ends[0], ends[1]].map(|end| state.position(end).as_dvec3());
        let parts = (0..=20_u8).map(|part| f64::from(part) / 20.0);
        parts.map(|part| depth(collider, from.lerp(to, part), radius)).fold(f64::NEG_INFINITY, f64::max)
    };
    slots.windows(2).map(of_edge).fold(f64::NEG_INFINITY, f64::max)
}

/// The deepest of all points of triangles, edges and corners included, tried at every `parts`-th of their sides, m.
pub fn deepest_of_faces(
    state: &Solver,
    triangles: &[[usize; 3]],
    collider: &Collider,
    radius: f32,
    parts: u8,
) -> f64 {
    let mut deepest = f64::NEG_INFINITY;
    for corners in triangles {
        let [a, b, c] = corners.map(|corner| state.position(corner).as_dvec3());
        // What is farther away than it is long has no point inside.
        let reach = a.distance(b).max(a.distance(c));
        if depth(collider, a, radius) < -reach {
            continue;
        }
        for (one, other) in (0..=parts).flat_map(|one| (0..=parts - one).map(move |other| (one, other))) {
            let [v, w] = [one, other].map(|part| f64::from(part) / f64::from(parts));
            deepest = deepest.max(depth(collider, a + (b - a) * v + (c - a) * w, radius));
        }
    }
    deepest
}
