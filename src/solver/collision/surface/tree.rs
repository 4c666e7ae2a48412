//! Bounding volume hierarchies over clusters of neighbouring primitives, one for each body.
//!
//! A body is a connected mesh of edges and triangles. Its tree is built once, and its boxes are refitted in each search: neighbours on
//! a mesh stay neighbours (van den Bergen, *Efficient collision detection of complex deformable models using AABB trees*,
//! 1997). It follows from the mesh alone, so that pairs are always found in the same order: the coordinates by which items
//! are divided are their distances along the mesh, in steps, from three vertices that are far from each other. Each vertex
//! and each edge is in one cluster, in one in which also a triangle of it is (representative triangles: Curtis, Tamstorf and
//! Manocha, *Fast collision detection for deformable models*, 2008).

use std::ops::Range;

use bevy::math::Vec3A;

use super::primitives::Primitive;
use crate::solver::buckets::Buckets;

/// Number of triangles, or of edges without one, in a cluster at most.
pub(super) const CLUSTER: usize = 8;

/// Number of corners of a cluster at most.
pub(super) const MAX_CORNERS: usize = 3 * CLUSTER;

/// A box along the axes.
#[derive(Debug, Clone, Copy)]
pub(in crate::solver::collision) struct Box3 {
    pub least: Vec3A,
    pub most: Vec3A,
}

impl Box3 {
    pub const NOTHING: Self = Self { least: Vec3A::INFINITY, most: Vec3A::NEG_INFINITY };

    #[inline(always)]
    pub fn union(self, other: Self) -> Self {
        Self { least: self.least.min(other.least), most: self.most.max(other.most) }
    }

    #[inline(always)]
    pub fn intersection(self, other: Self) -> Self {
        Self { least: self.least.max(other.least), most: self.most.min(other.most) }
    }

    /// Whether there is any point in it.
    #[inline(always)]
    pub fn is_some(&self) -> bool {
        self.least.cmple(self.most).all()
    }

    /// It, larger on all sides.
    #[inline(always)]
    pub fn grown(self, margin: f32) -> Self {
        Self { least: self.least - margin, most: self.most + margin }
    }

    #[inline(always)]
    pub fn overlaps(&self, other: &Self) -> bool {
        (self.least.cmple(other.most) & other.least.cmple(self.most)).all()
    }

    #[inline(always)]
    pub fn contains(&self, point: Vec3A, radius: f32) -> bool {
        (self.least.cmple(point - radius) & (point + radius).cmple(self.most)).all()
    }
}

impl Default for Box3 {
    fn default() -> Self {
        Self::NOTHING
    }
}

/// A triangle with the edges that it brings into its cluster, or an edge without one.
#[derive(Debug, Clone, Copy)]
pub(super) struct Item {
    pub triangle: Option<Primitive>,
    pub edges: [Option<Primitive>; 3],
}

impl Item {
    fn corners(&self) -> impl Iterator<Item = u32> + '_ {
        let triangle = self.triangle.iter().flat_map(|triangle| triangle.corners);
        triangle.chain(self.edges.iter().flatten().flat_map(|edge| &edge.corners[..2]).copied())
    }
}

/// A few primitives.
#[derive(Debug, Clone, Default)]
pub(super) struct Cluster {
    /// The slots of the vertices that are in no cluster before.
    pub vertices: Range<u32>,
    pub edges: Range<u32>,
    pub triangles: Range<u32>,
    /// The slots of all corners, in ascending order.
    pub corners: Range<u32>,
}

/// A node of a tree: the first child follows it.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Node {
    /// Where the second child is; the number of the cluster of a leaf.
    pub second: u32,
    pub is_leaf: bool,
}

/// A connected piece of the mesh.
#[derive(Debug, Clone, Default)]
pub(super) struct MeshBody {
    pub nodes: Range<u32>,
    /// Its slots, among the corners in order of the first appearance.
    pub vertices: Range<u32>,
    /// Its slots again, in ranges.
    pub runs: Vec<Range<u32>>,
    /// How many edges it is long, at most.
    pub steps: f32,
}

/// All bodies.
#[derive(Debug, Clone, Default)]
pub(super) struct Forest {
    pub bodies: Vec<MeshBody>,
    pub nodes: Vec<Node>,
    pub clusters: Vec<Cluster>,
    pub vertices: Vec<u32>,
    pub edges: Vec<Primitive>,
    pub triangles: Vec<Primitive>,
    pub corners: Vec<u32>,
}

impl Forest {
    /// The number of edges and triangles.
    pub fn primitives(&self) -> usize {
        self.edges.len() + self.triangles.len()
    }

    /// Builds the trees of the bodies that `items` make up.
    pub fn build(&mut self, items: Vec<Item>, slots: usize) {
        *self = Self::default();
        if items.is_empty() {
            return;
        }
        let body_of = connect(&items, slots);
        let place = embed(&items, &body_of);
        let mut keyed: Vec<(u32, Vec3A, Item)> = items
            .into_iter()
            .map(|item| {
                let corners = item.corners().count() as f32;
                let centre = item.corners().map(|corner| place[corner as usize]).sum::<Vec3A>() / corners;
                let first = item.corners().next().expect("an item has corners");
                (body_of[first as usize], centre, item)
            })
            .collect();
        keyed.sort_by_key(|(body, ..)| *body);
        let mut taken = vec![false; slots];
        for body in keyed.chunk_by_mut(|(one, ..), (other, ..)| one == other) {
            let [nodes, vertices] = [self.nodes.len(), self.vertices.len()].map(|start| start as u32);
            self.split(body, &mut taken);
            let own = &self.vertices[vertices as usize..];
            let steps = own.iter().map(|slot| place[*slot as usize].x).fold(0.0, f32::max);
            self.bodies.push(MeshBody {
                nodes: nodes..self.nodes.len() as u32,
                vertices: vertices..self.vertices.len() as u32,
                runs: runs_of(own),
                steps,
            });
        }
    }

    /// Adds the node of some items, and those below it.
    fn split(&mut self, items: &mut [(u32, Vec3A, Item)], taken: &mut [bool]) {
        let node = self.nodes.len();
        self.nodes.push(Node::default());
        if items.len() <= CLUSTER {
            self.nodes[node] = Node { second: self.clusters.len() as u32, is_leaf: true };
            self.add_cluster(items, taken);
            return;
        }
        let (mut least, mut most) = (Vec3A::INFINITY, Vec3A::NEG_INFINITY);
        for (_, centre, _) in &*items {
            (least, most) = (least.min(*centre), most.max(*centre));
        }
        let extent = (most - least).to_array();
        let axis = (0..3).fold(0, |best, axis| if extent[axis] > extent[best] { axis } else { best });
        // In whole clusters, so that few are half empty.
        let clusters = items.len().div_ceil(CLUSTER);
        let half = (clusters / 2) * CLUSTER;
        items.select_nth_unstable_by(half, |(_, one, _), (_, other, _)| one[axis].total_cmp(&other[axis]));
        let (first, second) = items.split_at_mut(half);
        self.split(first, taken);
        self.nodes[node].second = self.nodes.len() as u32;
        self.split(second, taken);
    }

    fn add_cluster(&mut self, items: &[(u32, Vec3A, Item)], taken: &mut [bool]) {
        let starts = [self.vertices.len(), self.edges.len(), self.triangles.len(), self.corners.len()];
        for (_, _, item) in items {
            for corner in item.corners() {
                if !std::mem::replace(&mut taken[corner as usize], true) {
                    self.vertices.push(corner);
                }
                if !self.corners[starts[3]..].contains(&corner) {
                    self.corners.push(corner);
                }
            }
            self.triangles.extend(item.triangle);
            self.edges.extend(item.edges.into_iter().flatten());
        }
        self.corners[starts[3]..].sort_unstable();
        let corners = &self.corners[starts[3]..];
        let place = |slot: u32| corners.partition_point(|corner| *corner < slot) as u8;
        for primitive in self.edges[starts[1]..].iter_mut().chain(&mut self.triangles[starts[2]..]) {
            primitive.places = primitive.corners.map(place);
        }
        let ends = [self.vertices.len(), self.edges.len(), self.triangles.len(), self.corners.len()];
        let range = |kind: usize| starts[kind] as u32..ends[kind] as u32;
        self.clusters.push(Cluster {
            vertices: range(0),
            edges: range(1),
            triangles: range(2),
            corners: range(3),
        });
    }

    /// The slots of the corners of a cluster, in ascending order.
    pub fn corners_of(&self, cluster: &Cluster) -> &[u32] {
        &self.corners[cluster.corners.start as usize..cluster.corners.end as usize]
    }

    /// The slots of the vertices of a body.
    pub fn vertices_of(&self, body: &MeshBody) -> &[u32] {
        &self.vertices[body.vertices.start as usize..body.vertices.end as usize]
    }

    /// Fits the boxes of the nodes that are `wanted`, `boxes` by node, to those of their vertices, by slot.
    pub fn fit(&self, wanted: impl Fn(usize) -> bool, vertex: &[Box3], boxes: &mut [Box3]) {
        for node in (0..self.nodes.len()).rev().filter(|node| wanted(*node)) {
            let Node { second, is_leaf } = self.nodes[node];
            boxes[node] = match is_leaf {
                true => {
                    let corners = self.corners_of(&self.clusters[second as usize]).iter();
                    corners.fold(Box3::NOTHING, |sum, corner| sum.union(vertex[*corner as usize]))
                }
                false => boxes[node + 1].union(boxes[second as usize]),
            };
        }
    }
}

/// Slots in ranges, in ascending order.
fn runs_of(slots: &[u32]) -> Vec<Range<u32>> {
    let mut slots = slots.to_vec();
    slots.sort_unstable();
    let runs = slots.chunk_by(|one, other| one + 1 == *other);
    runs.map(|run| run[0]..run[0] + run.len() as u32).collect()
}

/// The least slot of what hangs together with each slot.
fn connect(items: &[Item], slots: usize) -> Vec<u32> {
    let mut parent: Vec<u32> = (0..slots as u32).collect();
    fn root(parent: &mut [u32], mut slot: u32) -> u32 {
        while parent[slot as usize] != slot {
            parent[slot as usize] = parent[parent[slot as usize] as usize];
            slot = parent[slot as usize];
        }
        slot
    }
    for item in items {
        let mut corners = item.corners();
        let first = corners.next().expect("an item has corners");
        for other in corners {
            let (one, other) = (root(&mut parent, first), root(&mut parent, other));
            parent[one.max(other) as usize] = one.min(other);
        }
    }
    (0..slots as u32).map(|slot| root(&mut parent, slot)).collect()
}

/// Coordinates of the slots: how many steps along the mesh each is from three vertices of its body. The first of these is
/// farthest from the one in the least slot, each next one from those before.
fn embed(items: &[Item], body_of: &[u32]) -> Vec<Vec3A> {
    let count = body_of.len();
    let mut next = Buckets::default();
    next.fill(count, |add| {
        for item in items {
            for one in item.corners() {
                item.corners().filter(|other| *other != one).for_each(|other| add(one as usize, other));
            }
        }
    });
    next.sort_and_dedup();
    let mut steps = vec![u32::MAX; count];
    let mut queue: Vec<u32> = Vec::new();
    let mut measure = |from: &[u32]| -> Vec<u32> {
        steps.fill(u32::MAX);
        queue.clear();
        queue.extend_from_slice(from);
        from.iter().for_each(|slot| steps[*slot as usize] = 0);
        let mut done = 0;
        while let Some(at) = queue.get(done).copied() {
            done += 1;
            for other in next.of(at as usize) {
                if steps[*other as usize] == u32::MAX {
                    steps[*other as usize] = steps[at as usize] + 1;
                    queue.push(*other);
                }
            }
        }
        steps.clone()
    };
    // One a body.
    let farthest = |least: &[u32]| -> Vec<u32> {
        let mut best: Vec<u32> = (0..count as u32).collect();
        for slot in 0..count {
            let body = body_of[slot] as usize;
            if least[slot] != u32::MAX && least[slot] > least[best[body] as usize] {
                best[body] = slot as u32;
            }
        }
        (0..count).filter(|slot| body_of[*slot] as usize == *slot).map(|body| best[body]).collect()
    };
    let roots: Vec<u32> = (0..count as u32).filter(|slot| body_of[*slot as usize] == *slot).collect();
    let mut least = measure(&roots);
    let mut places = vec![Vec3A::ZERO; count];
    for axis in [0, 1, 2] {
        let steps = measure(&farthest(&least));
        if axis == 0 {
            least.clone_from(&steps);
        }
        for slot in 0..count {
            places[slot][axis] = steps[slot] as f32;
            least[slot] = least[slot].min(steps[slot]);
        }
    }
    places
}
