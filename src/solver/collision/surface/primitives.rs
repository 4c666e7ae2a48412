//! What may collide: the primitives of the mesh in clusters, and the loose balls. A cache of mesh, springs and radii.

use bevy::math::Vec3;

use super::near::Near;
use super::tree::{Forest, Item};
use crate::solver::buckets::sort_by_number;
use crate::solver::elements::{CollisionMesh, Elements};
use crate::solver::particles::Particles;
use crate::solver::state::Version;

/// Marks of a triangle: of which of its features it is the first one, so that what two share counts once.
pub(super) mod owns {
    /// Of the corner 0; those of the others are the next bits.
    pub const CORNER: u8 = 1;
    /// Of the edge from corner 0 to corner 1, then 1 to 2 and 2 to 0.
    pub const EDGE: u8 = 8;
    /// Mark of an edge: it belongs to a triangle.
    pub const FACE: u8 = 4;
}

/// An edge or a triangle; of an edge the last corner is the one before.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Primitive {
    pub corners: [u32; 3],
    /// See [`owns`]; of an edge the corners that it owns and whether it belongs to a triangle.
    pub marks: u8,
    /// The places of the corners among those of its cluster.
    pub places: [u8; 3],
}

/// All that may collide.
#[derive(Debug, Clone, Default)]
pub(super) struct Primitives {
    key: Option<[Version; 4]>,
    lengths_version: Version,
    springs: Vec<([u32; 2], f32)>,
    with_springs: bool,
    /// Whether a primitive with a thickness has a corner in each slot.
    pub on_mesh: Vec<bool>,
    /// Whether each particle is no sphere of its own any more.
    pub covered: Vec<bool>,
    /// The slots of the particles that are spheres still.
    pub balls: Vec<u32>,
    /// By slot: the number of its body, and behind these of its ball.
    pub body_of: Vec<u32>,
    pub forest: Forest,
    pub near: Near,
    /// Whether there is anything but spheres.
    pub any: bool,
    /// Whether that is edges only, each between neighbours in the order of slots.
    pub are_rows: bool,
    /// How large each body is, at most, at rest, m.
    pub sizes: Vec<f32>,
    /// The shortest link along a mesh, m: no two primitives of which the distance counts are nearer to each other along it.
    pub shortest_link: f32,
    /// Working memory.
    loose: Vec<([u32; 2], f32)>,
    links: Vec<([u32; 2], f32)>,
    longest: Vec<f32>,
}

impl Primitives {
    /// Makes them those of the present mesh; whether they are others than before.
    pub fn refresh(
        &mut self,
        mesh: &CollisionMesh,
        elements: &Elements,
        particles: &Particles,
        with_springs: bool,
    ) -> bool {
        if mesh.edges.is_empty() && mesh.triangles.is_empty() && !with_springs {
            let was_any = self.any || self.key.is_some();
            if was_any {
                *self = Self::default();
            }
            return was_any;
        }
        let versions =
            [mesh.version(), elements.ends_version(), particles.added_version(), particles.shape_version()];
        self.loose.clear();
        self.loose.extend(mesh.loose_springs(elements));
        let ends = |springs: &[([u32; 2], f32)], other: &[([u32; 2], f32)]| {
            springs.iter().map(|(ends, _)| ends).eq(other.iter().map(|(ends, _)| ends))
        };
        let has_same_ends = self.key == Some(versions)
            && self.with_springs == with_springs
            && ends(&self.springs, &self.loose);
        let has_same_lengths = self.lengths_version == mesh.lengths_version() && self.springs == self.loose;
        if has_same_ends && has_same_lengths {
            return false;
        }
        (self.key, self.with_springs) = (Some(versions), with_springs);
        self.lengths_version = mesh.lengths_version();
        std::mem::swap(&mut self.springs, &mut self.loose);
        if !has_same_ends {
            self.rebuild(mesh, elements, particles);
        }
        self.measure_ways(mesh, elements, particles.radius());
        true
    }

    fn rebuild(&mut self, mesh: &CollisionMesh, elements: &Elements, particles: &Particles) {
        let radius = particles.radius();
        let count = particles.len();
        let is_thick = |corners: &[u32]| is_thick(corners, radius);
        let edges = mesh.present_edges(elements, self.with_springs).map(|(ends, _)| ends);
        let edges: Vec<[u32; 2]> = edges.filter(|ends| is_thick(ends)).collect();
        let triangles: Vec<[u32; 3]> = mesh.present_triangles().filter(|corners| is_thick(corners)).collect();
        self.on_mesh.clear();
        self.on_mesh.resize(count, false);
        let corners = edges.as_flattened().iter().chain(triangles.as_flattened());
        corners.for_each(|corner| self.on_mesh[*corner as usize] = true);
        self.any = self.on_mesh.contains(&true);
        self.are_rows = triangles.is_empty() && edges.iter().all(|[one, other]| one.abs_diff(*other) == 1);
        self.covered.clear();
        self.covered.extend(
            self.on_mesh
                .iter()
                .enumerate()
                .map(|(slot, on_mesh)| *on_mesh || self.any && mesh.is_inner(slot)),
        );
        self.balls.clear();
        let is_ball = |slot: &u32| radius[*slot as usize] > 0.0 && !self.covered[*slot as usize];
        self.balls.extend((0..count as u32).filter(is_ball));
        let items = items(edges.iter().copied(), &triangles, count);
        self.forest.build(items, count);
        self.body_of.clear();
        self.body_of.resize(count, 0);
        for (number, body) in (0..).zip(&self.forest.bodies) {
            self.forest.vertices_of(body).iter().for_each(|slot| self.body_of[*slot as usize] = number);
        }
        let balls = (self.forest.bodies.len() as u32..).zip(&self.balls);
        balls.for_each(|(number, slot)| self.body_of[*slot as usize] = number);
    }

    /// Finds the paths along the mesh that are short.
    fn measure_ways(&mut self, mesh: &CollisionMesh, elements: &Elements, radius: &[f32]) {
        self.links.clear();
        if self.any {
            let edges = mesh.present_edges(elements, self.with_springs);
            self.links.extend(edges.filter(|(ends, _)| is_thick(ends, radius)));
        }
        self.links.extend_from_slice(&self.springs);
        self.links.extend(mesh.present_seams().map(|ends| (ends, 0.0)));
        self.near.rebuild(&self.links, radius, &self.on_mesh);
        let Self { sizes, links, longest, forest, shortest_link, .. } = self;
        let lengths = links.iter().map(|(_, length)| *length).filter(|length| *length > 0.0);
        *shortest_link = lengths.fold(f32::INFINITY, f32::min);
        longest.clear();
        longest.extend_from_slice(radius);
        for (ends, length) in links {
            ends.iter().for_each(|end| longest[*end as usize] = longest[*end as usize].max(*length));
        }
        let longest = |body| {
            let vertices = forest.vertices_of(body).iter();
            vertices.map(|slot| longest[*slot as usize]).fold(0.0, f32::max)
        };
        sizes.clear();
        sizes.extend(forest.bodies.iter().map(|body| (body.steps + 1.0) * longest(body)));
    }

    /// Where a body is without what its particles have moved relative to each other, m: the mean over some of them.
    pub fn mean(slots: &[u32], place: impl Fn(usize) -> Vec3) -> Vec3 {
        let step = slots.len().div_ceil(64).max(1);
        let sample = slots.iter().step_by(step);
        let size = sample.len() as f32;
        let mean = sample.map(|slot| place(*slot as usize)).sum::<Vec3>() / size;
        if mean.is_finite() { mean } else { Vec3::ZERO }
    }
}

/// Whether all corners are there, and any has a radius.
fn is_thick(corners: &[u32], radius: &[f32]) -> bool {
    let all_there = corners.iter().all(|corner| (*corner as usize) < radius.len());
    all_there && corners.iter().any(|corner| radius[*corner as usize] > 0.0)
}

/// The triangles with their edges, and the edges that belong to none.
fn items(edges: impl Iterator<Item = [u32; 2]>, triangles: &[[u32; 3]], count: usize) -> Vec<Item> {
    let mut seen = vec![false; count];
    let mut first_at = |slot: u32| !std::mem::replace(&mut seen[slot as usize], true);
    let mut sides: Vec<([u32; 2], u32)> = Vec::with_capacity(3 * triangles.len());
    for (number, corners) in (0..).zip(triangles) {
        let [a, b, c] = *corners;
        sides.extend([[a, b], [b, c], [c, a]].map(|[a, b]| ([a.min(b), a.max(b)], number)));
    }
    // They are in the order of the triangles: the last key.
    let mut spare = Vec::new();
    sort_by_number(&mut sides, &mut spare, |([_, b], _)| *b);
    sort_by_number(&mut sides, &mut spare, |([a, _], _)| *a);
    let first_with = |side: [u32; 2]| sides.partition_point(|(other, _)| *other < side);
    let edges = marked_edges(edges, count, |side| {
        sides.get(first_with(side)).is_some_and(|(other, _)| *other == side)
    });
    let mut items = Vec::with_capacity(triangles.len() + edges.len());
    for (number, corners) in (0..).zip(triangles) {
        let mut marks = 0;
        let mut own = [None; 3];
        let [a, b, c] = *corners;
        for (place, [a, b]) in [[a, b], [b, c], [c, a]].into_iter().enumerate() {
            if first_at(a) {
                marks |= owns::CORNER << place;
            }
            let side = [a.min(b), a.max(b)];
            if sides[first_with(side)].1 == number {
                marks |= owns::EDGE << place;
                let known = edges.binary_search_by_key(&side, |edge| [edge.corners[0], edge.corners[1]]);
                own[place] = known.ok().map(|place| edges[place]);
            }
        }
        let triangle = Primitive { corners: *corners, marks, ..Primitive::default() };
        items.push(Item { triangle: Some(triangle), edges: own });
    }
    let bare = edges.iter().filter(|edge| edge.marks & owns::FACE == 0);
    items.extend(bare.map(|edge| Item { triangle: None, edges: [Some(*edge), None, None] }));
    items
}

/// The edges in the order of their ends, with their marks.
fn marked_edges(
    edges: impl Iterator<Item = [u32; 2]>,
    count: usize,
    is_of_face: impl Fn([u32; 2]) -> bool,
) -> Vec<Primitive> {
    let mut edges: Vec<[u32; 2]> = edges.map(|[a, b]| [a.min(b), a.max(b)]).collect();
    let mut spare = Vec::new();
    sort_by_number(&mut edges, &mut spare, |[_, b]| *b);
    sort_by_number(&mut edges, &mut spare, |[a, _]| *a);
    edges.dedup();
    let mut seen = vec![false; count];
    let mut first_at = |slot: u32| u8::from(!std::mem::replace(&mut seen[slot as usize], true));
    let mark = |side: [u32; 2]| {
        let [a, b] = side;
        let face = if is_of_face(side) { owns::FACE } else { 0 };
        let marks = (owns::CORNER * first_at(a)) | ((owns::CORNER << 1) * first_at(b)) | face;
        Primitive { corners: [a, b, b], marks, ..Primitive::default() }
    };
    edges.into_iter().map(mark).collect()
}
