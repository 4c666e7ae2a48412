//! Walks down the trees of two bodies, and lists the primitives whose boxes overlap.

use bevy::math::Vec3A;

use super::closest::closest;
use super::pair::Kind;
use super::primitives::{Primitive, Primitives, owns};
use super::search::{Candidate, Moving};
use super::tree::{Box3, Cluster, Forest};
use crate::solver::graph::Exclusions;

use super::super::material::{Skin, skin_of};

/// Rounding of distances and ways, as a part of a coordinate.
const DISTANCE_ROUNDING: f32 = 2e-6;

/// Lists the pairs whose boxes overlap.
pub(super) struct Finder<'a> {
    pub primitives: &'a Primitives,
    pub moving: Moving<'a>,
    /// See [`super::super::material::skin_of`].
    pub skins: &'a [Skin],
    pub candidates: &'a mut Vec<Candidate>,
    pub rooms: &'a [Vec<f32>; 2],
    /// m.
    pub margin: f32,
    /// The number of pairs, at most.
    pub most: usize,
}

/// The boxes of nodes and of vertices, and whether pairs are within a body.
pub(super) type Boxes<'b> = (&'b [Box3], &'b [Box3], bool);

impl Finder<'_> {
    /// Looks for pairs below two nodes.
    pub fn walk(&mut self, pair: [u32; 2], (nodes, vertices, is_within): Boxes, stack: &mut Vec<[u32; 2]>) {
        let forest = &self.primitives.forest;
        stack.clear();
        stack.push(pair);
        while let Some([one, other]) = stack.pop() {
            if self.candidates.len() >= self.most {
                return;
            }
            let [first, second] = [one, other].map(|node| forest.nodes[node as usize]);
            if one == other {
                match first.is_leaf {
                    true => self.test_clusters([first.second; 2], (nodes, vertices, is_within), [one; 2]),
                    false => stack.extend([
                        [one + 1, one + 1],
                        [first.second, first.second],
                        [one + 1, first.second],
                    ]),
                }
                continue;
            }
            if !nodes[one as usize].overlaps(&nodes[other as usize]) {
                continue;
            }
            match (first.is_leaf, second.is_leaf) {
                (true, true) => {
                    let clusters = [first.second, second.second];
                    self.test_clusters(clusters, (nodes, vertices, is_within), [one, other]);
                }
                (false, true) => stack.extend([[one + 1, other], [first.second, other]]),
                (true, false) => stack.extend([[one, other + 1], [one, second.second]]),
                (false, false) => stack.extend([
                    [one + 1, other + 1],
                    [one + 1, second.second],
                    [first.second, other + 1],
                    [first.second, second.second],
                ]),
            }
        }
    }

    /// Looks for pairs of a ball with what is below a node.
    pub fn walk_ball(
        &mut self,
        root: u32,
        slot: u32,
        (nodes, vertices): (&[Box3], &[Box3]),
        stack: &mut Vec<[u32; 2]>,
    ) {
        let forest = &self.primitives.forest;
        let own = vertices[slot as usize];
        stack.clear();
        stack.push([root; 2]);
        while let Some([node, _]) = stack.pop() {
            if !nodes[node as usize].overlaps(&own) {
                continue;
            }
            let second = forest.nodes[node as usize].second;
            if !forest.nodes[node as usize].is_leaf {
                stack.extend([[node + 1; 2], [second; 2]]);
                continue;
            }
            let cluster = &forest.clusters[second as usize];
            for triangle in triangles_of(forest, cluster) {
                if box_of(vertices, &triangle.corners).overlaps(&own) {
                    self.add_vertex_face(slot, triangle, false);
                }
            }
            for edge in edges_of(forest, cluster).iter().filter(|edge| edge.marks & owns::FACE == 0) {
                if box_of(vertices, &edge.corners).overlaps(&own) {
                    let [a, b, _] = edge.corners;
                    self.add([slot, a, b, b], Kind::VertexEdge, [0, edge.marks], false);
                }
            }
        }
    }

    /// Looks for pairs between two clusters, or within one.
    fn test_clusters(&mut self, numbers: [u32; 2], (nodes, vertices, is_within): Boxes, at: [u32; 2]) {
        let forest = &self.primitives.forest;
        let clusters = numbers.map(|number| &forest.clusters[number as usize]);
        let limits = [nodes[at[1] as usize], nodes[at[0] as usize]];
        let is_same = numbers[0] == numbers[1];
        for side in 0..if is_same { 1 } else { 2 } {
            let (own, other) = (clusters[side], clusters[1 - side]);
            for slot in &forest.vertices[own.vertices.start as usize..own.vertices.end as usize] {
                let vertex = &vertices[*slot as usize];
                if !vertex.overlaps(&limits[side]) {
                    continue;
                }
                for triangle in triangles_of(forest, other) {
                    let is_near = box_of(vertices, &triangle.corners).overlaps(vertex);
                    if is_near && !triangle.corners.contains(slot) {
                        self.add_vertex_face(*slot, triangle, is_within);
                    }
                }
            }
        }
        for (place, edge) in edges_of(forest, clusters[0]).iter().enumerate() {
            let own = box_of(vertices, &edge.corners);
            if !own.overlaps(&limits[0]) {
                continue;
            }
            let others = edges_of(forest, clusters[1]);
            for other in if is_same { &others[place + 1..] } else { others } {
                let is_near = box_of(vertices, &other.corners).overlaps(&own);
                if is_near && !edge.corners[..2].iter().any(|corner| other.corners.contains(corner)) {
                    self.add_edges(edge, other, is_within);
                }
            }
        }
    }

    fn add_vertex_face(&mut self, slot: u32, triangle: &Primitive, is_within: bool) {
        let [a, b, c] = triangle.corners;
        self.add([slot, a, b, c], Kind::VertexFace, [0, triangle.marks], is_within);
    }

    /// The edge with the smaller ends comes first, whatever cluster it is in.
    fn add_edges(&mut self, edge: &Primitive, other: &Primitive, is_within: bool) {
        let (one, other) = if edge.corners < other.corners { (edge, other) } else { (other, edge) };
        let slots = [one.corners[0], one.corners[1], other.corners[0], other.corners[1]];
        self.add(slots, Kind::EdgeEdge, [one.marks, other.marks], is_within);
    }

    /// Whether the layers of two particles meet.
    fn may_meet(&self, one: u32, other: u32) -> bool {
        let layers = |slot: u32| skin_of(self.skins, slot as usize).layers;
        self.skins.is_empty() || layers(one).meet(layers(other))
    }

    fn add(&mut self, slots: [u32; 4], kind: Kind, marks: [u8; 2], is_within: bool) {
        let particles = self.moving.particles;
        let is_free = |slot: &u32| !particles.is_pinned(*slot as usize);
        let is_exempt = Exclusions::are_of_one_family(particles.families(), slots[0], slots[3]);
        if is_exempt || !slots.iter().any(is_free) || !self.may_meet(slots[0], slots[3]) {
            return;
        }
        let sides = kind.first_side();
        let largest =
            |of: &[f32], slots: &[u32]| slots.iter().map(|slot| of[*slot as usize]).fold(0.0, f32::max);
        let of_both = |of: &[f32]| largest(of, &slots[..sides]) + largest(of, &slots[sides..]);
        let reach = of_both(particles.radius());
        let corners = slots.map(|slot| Vec3A::from(self.moving.start.get(slot as usize)));
        let farthest = corners.iter().fold(Vec3A::ZERO, |most, corner| most.max(corner.abs()));
        // Less than the true one: what is told from it must not depend on rounding.
        let distance = closest(kind, &corners).apart.length() - DISTANCE_ROUNDING * farthest.max_element();
        let room = self.margin + of_both(&self.rooms[usize::from(!is_within)]);
        if distance > reach + room {
            return;
        }
        let way = self.primitives.near.way(&slots[..sides], &slots[sides..]);
        // No way is between those that share a corner which a tear has split.
        if way == 0.0 || distance > 0.5 * way + room {
            return;
        }
        let most = 0.5 * way;
        self.candidates.push(Candidate { slots, kind, marks, is_within, distance, reach, most });
    }
}

fn triangles_of<'f>(forest: &'f Forest, cluster: &Cluster) -> &'f [Primitive] {
    &forest.triangles[cluster.triangles.start as usize..cluster.triangles.end as usize]
}

fn edges_of<'f>(forest: &'f Forest, cluster: &Cluster) -> &'f [Primitive] {
    &forest.edges[cluster.edges.start as usize..cluster.edges.end as usize]
}

/// The box of a primitive.
#[inline(always)]
fn box_of(vertices: &[Box3], corners: &[u32; 3]) -> Box3 {
    let [a, b, c] = corners.map(|corner| vertices[corner as usize]);
    a.union(b).union(c)
}
