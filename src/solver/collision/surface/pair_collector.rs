//! Lists the pairs of primitives of two clusters that may touch.

use bevy::math::Vec3A;

use super::closest::closest;
use super::lanes::{ClusterPair, Lanes, Point};
use super::pair::{Kind, apart_along, between_centres, rounding_of};
use super::primitives::{Primitive, Primitives, owns};
use super::search::{Candidate, Moving};
use super::tree::{Box3, MAX_CORNERS};
use crate::solver::graph::Exclusions;

use super::super::material::{ContactProperties, properties_of};

/// Which pairs are searched for.
#[derive(Clone, Copy)]
pub(super) struct PairQuery<'a> {
    pub primitives: &'a Primitives,
    pub moving: Moving<'a>,
    /// See [`super::super::material::properties_of`].
    pub properties: &'a [ContactProperties],
    /// How far vertices may get, see [`Displacements`](super::displacements::Displacements), m.
    pub limits: &'a [Vec<f32>; 2],
    /// Within a body and of bodies, m.
    pub margins: [f32; 2],
    /// Filled for these limits.
    pub lanes: &'a Lanes,
    /// Whether the limits are how far vertices may get from their paths in the substep, and not from where they are at its start.
    pub is_swept: bool,
}

/// Lists the pairs of primitives that may touch before a vertex passes its limit.
pub(super) struct PairCollector<'a> {
    pub query: PairQuery<'a>,
    pub candidates: &'a mut Vec<Candidate>,
}

/// The places of the bits that are set, in ascending order.
fn bits(mut mask: u32) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let place = mask.trailing_zeros();
        mask &= mask.wrapping_sub(1);
        (place < u32::BITS).then_some(place as usize)
    })
}

impl PairCollector<'_> {
    /// Looks for pairs of a ball with what is in a cluster. By slot, `boxes` are those of vertices in the world.
    pub fn test_ball(&mut self, slot: u32, number: u32, boxes: &[Box3]) {
        let Primitives { forest, near, .. } = self.query.primitives;
        let cluster = &forest.clusters[number as usize];
        let own = boxes[slot as usize];
        let is_near = |primitive: &&Primitive| {
            let [a, b, c] = primitive.corners.map(|corner| boxes[corner as usize]);
            a.union(b).union(c).overlaps(&own)
        };
        let triangles = &forest.triangles[cluster.triangles.start as usize..cluster.triangles.end as usize];
        for triangle in triangles.iter().filter(is_near) {
            self.add_vertex_face(slot, triangle, (false, || near.way(&[slot], &triangle.corners)));
        }
        let edges = &forest.edges[cluster.edges.start as usize..cluster.edges.end as usize];
        for edge in edges.iter().filter(|edge| edge.marks & owns::FACE == 0).filter(is_near) {
            let [a, b, _] = edge.corners;
            let way = || near.way(&[slot], &[a, b]);
            self.add([slot, a, b, b], Kind::VertexEdge, [0, edge.marks], (false, way));
        }
    }

    /// Looks for pairs between two clusters, or within one.
    pub fn test_clusters(&mut self, numbers: [u32; 2], is_within: bool) {
        let PairQuery { primitives, moving, limits, margins, lanes, is_swept, .. } = self.query;
        let forest = &primitives.forest;
        let clusters = numbers.map(|number| &forest.clusters[number as usize]);
        let is_same = numbers[0] == numbers[1];
        let frame = usize::from(!is_within);
        let corners = clusters.map(|cluster| forest.corners_of(cluster));
        let ways = primitives.near.between(corners[0], corners[1]);
        for side in 0..if is_same { 1 } else { 2 } {
            let [own, other] = [clusters[side], clusters[1 - side]];
            if other.triangles.is_empty() {
                continue;
            }
            let vertices = &forest.vertices[own.vertices.start as usize..own.vertices.end as usize];
            let mut points = [Point::default(); MAX_CORNERS];
            for (point, slot) in points.iter_mut().zip(vertices) {
                let slot = *slot as usize;
                let reach = moving.particles.radius()[slot] + limits[frame][slot] + margins[frame];
                let [start, end] = moving.ends(slot).map(|place| place.to_array());
                *point = Point { start, end, reach };
            }
            let of_other = (numbers[1 - side], other.triangles.len());
            let masks = lanes.near_triangles(&points[..vertices.len()], of_other, (frame, is_swept));
            for (slot, mask) in vertices.iter().zip(masks).filter(|(_, mask)| *mask != 0) {
                let place = corners[side].partition_point(|corner| corner < slot) as u8;
                for number in bits(mask) {
                    let triangle = &forest.triangles[other.triangles.start as usize + number];
                    if !triangle.corners.contains(slot) {
                        let way = || match side {
                            0 => ways.least(&[place], &triangle.places),
                            _ => ways.least(&triangle.places, &[place]),
                        };
                        self.add_vertex_face(*slot, triangle, (is_within, way));
                    }
                }
            }
        }
        let margin = margins[frame];
        let masks = lanes.near_edges(ClusterPair { clusters, numbers, frame, margin, is_swept });
        let starts = clusters.map(|cluster| cluster.edges.start as usize);
        for (number, mask) in masks.into_iter().enumerate().filter(|(_, mask)| *mask != 0) {
            let edge = &forest.edges[starts[0] + number];
            let others = if is_same { mask & (!1 << number) } else { mask };
            for second in bits(others) {
                let other = &forest.edges[starts[1] + second];
                if !edge.corners[..2].iter().any(|corner| other.corners.contains(corner)) {
                    let way = || ways.least(&edge.places[..2], &other.places[..2]);
                    self.add_edges(edge, other, (is_within, way));
                }
            }
        }
    }

    fn add_vertex_face(
        &mut self,
        slot: u32,
        triangle: &Primitive,
        (is_within, way): (bool, impl FnOnce() -> f32),
    ) {
        let [a, b, c] = triangle.corners;
        self.add([slot, a, b, c], Kind::VertexFace, [0, triangle.marks], (is_within, way));
    }

    /// The edge with the smaller ends comes first, whatever cluster it is in.
    fn add_edges(
        &mut self,
        edge: &Primitive,
        other: &Primitive,
        (is_within, way): (bool, impl FnOnce() -> f32),
    ) {
        let (one, other) = if edge.corners < other.corners { (edge, other) } else { (other, edge) };
        let slots = [one.corners[0], one.corners[1], other.corners[0], other.corners[1]];
        self.add(slots, Kind::EdgeEdge, [one.marks, other.marks], (is_within, way));
    }

    /// Whether the layers of two particles meet.
    fn may_meet(&self, one: u32, other: u32) -> bool {
        let layers = |slot: u32| properties_of(self.query.properties, slot as usize).layers;
        self.query.properties.is_empty() || layers(one).meet(layers(other))
    }

    /// `way` is the least one from a corner of one side to one of the other, m.
    fn add(
        &mut self,
        slots: [u32; 4],
        kind: Kind,
        marks: [u8; 2],
        (is_within, way): (bool, impl FnOnce() -> f32),
    ) {
        let PairQuery { moving, limits, margins, is_swept, .. } = self.query;
        let particles = moving.particles;
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
        let corners = slots.map(|slot| Vec3A::from(moving.start.get(slot as usize)));
        let later = match is_swept {
            true => slots.map(|slot| Vec3A::from(moving.end.get(slot as usize))),
            false => corners,
        };
        let frame = usize::from(!is_within);
        let margin = margins[frame] + of_both(&limits[frame]);
        // Less than the true one: what is told from it must not depend on rounding.
        let mut rounding = rounding_of(&corners);
        if is_swept {
            rounding = rounding.max(rounding_of(&later));
        }
        // What is apart along one direction at both ends of straight paths is so all the way.
        let along = |direction: Vec3A| {
            let start = apart_along(kind, &corners, direction);
            let least = if is_swept { start.min(apart_along(kind, &later, direction)) } else { start };
            least - rounding
        };
        let least = along(between_centres(kind, &corners));
        if least > reach + margin {
            return;
        }
        let way = way();
        // No way is between those that share a corner which a tear has split.
        let is_far = |distance: f32| distance > reach + margin || distance > 0.5 * way + margin;
        if way == 0.0 || is_far(least) {
            return;
        }
        let apart = closest(kind, &corners).apart;
        let mut direction = apart.normalize_or_zero();
        let mut distance = apart.length() - rounding;
        if is_swept {
            distance = distance.min(along(direction));
            if is_far(distance) {
                return;
            }
            let at_the_end = closest(kind, &later).apart.normalize_or_zero();
            let other = along(at_the_end);
            if other > distance {
                (distance, direction) = (other, at_the_end);
            }
        }
        if is_far(distance) {
            return;
        }
        let most = 0.5 * way;
        self.candidates.push(Candidate { slots, kind, marks, is_within, distance, direction, reach, most });
    }
}

/// Whether no pair of a body collides: all its particles are of one family.
pub(super) fn is_one_family(vertices: &[u32], families: &[u32]) -> bool {
    !families.is_empty()
        && vertices.iter().all(|slot| Exclusions::are_of_one_family(families, vertices[0], *slot))
}
