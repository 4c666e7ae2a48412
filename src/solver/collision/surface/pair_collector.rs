//! Lists the pairs of primitives of two clusters that may touch.

use super::displacements::Displacements;
use super::lanes::{ClusterPair, EDGES, Lanes, Point};
use super::pair::{Kind, distance_on_paths};
use super::primitives::{Primitive, Primitives, owns};
use super::search::Candidate;
use super::tree::{Box3, Cluster, MAX_CORNERS};
use crate::solver::graph::Exclusions;
use crate::solver::particles::Particles;

use super::super::material::{ContactProperties, properties_of};

/// Which pairs are searched for.
#[derive(Clone, Copy)]
pub(super) struct PairQuery<'a> {
    pub primitives: &'a Primitives,
    pub particles: &'a Particles,
    /// See [`super::super::material::properties_of`].
    pub properties: &'a [ContactProperties],
    /// Where vertices are expected, and how far from there they may get.
    pub displacements: &'a Displacements,
    /// Within a body and of bodies, m.
    pub margins: [f32; 2],
}

/// Lists the pairs of primitives that may touch before a vertex passes its limit.
pub(super) struct PairCollector<'a> {
    pub query: PairQuery<'a>,
    /// Filled for its displacements.
    pub lanes: &'a Lanes,
    /// That to the clusters: see [`path_to`](super::order::path_to).
    pub path: u64,
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
    /// Looks for pairs of a ball with what is in a cluster, and has begun anew in the last renewal. By slot, `boxes` are those of vertices in the world.
    pub fn test_ball(&mut self, slot: u32, number: u32, boxes: &[Box3]) {
        let PairQuery { primitives: Primitives { forest, near, .. }, displacements, .. } = self.query;
        let cluster = &forest.clusters[number as usize];
        let own = boxes[slot as usize];
        let is_near = |primitive: &Primitive| {
            let [a, b, c] = primitive.corners.map(|corner| boxes[corner as usize]);
            displacements.any_renewed(&primitive.corners) && a.union(b).union(c).overlaps(&own)
        };
        let triangles = &forest.triangles[cluster.triangles.start as usize..cluster.triangles.end as usize];
        for (place, triangle) in (0..).zip(triangles).filter(|(_, triangle)| is_near(triangle)) {
            self.add_vertex_face(slot, triangle, (false, place, || near.way(&[slot], &triangle.corners)));
        }
        let edges = &forest.edges[cluster.edges.start as usize..cluster.edges.end as usize];
        let bare = (EDGES as u32..).zip(edges).filter(|(_, edge)| edge.marks & owns::FACE == 0);
        for (place, edge) in bare.filter(|(_, edge)| is_near(edge)) {
            let [a, b, _] = edge.corners;
            let way = || near.way(&[slot], &[a, b]);
            self.add([slot, a, b, b], Kind::VertexEdge, [0, edge.marks], (false, place, way));
        }
    }

    /// Looks for pairs between two clusters with boxes that overlap, or within one; in a later renewal for those of what has begun anew in it.
    /// By slot, `vertices` are the boxes of vertices.
    pub fn test_clusters(
        &mut self,
        numbers: [u32; 2],
        is_within: bool,
        around: [Box3; 2],
        vertices: &[Box3],
    ) {
        let Self { query: PairQuery { primitives, displacements, .. }, lanes, .. } = *self;
        let forest = &primitives.forest;
        let clusters = numbers.map(|number| &forest.clusters[number as usize]);
        let fresh = numbers.map(|number| lanes.fresh(number));
        let is_same = numbers[0] == numbers[1];
        let frame = usize::from(!is_within);
        // Of which triangles pairs with a vertex are wanted, of which edges those with an edge.
        let of = |corners: &[u32], other: Box3, fresh: u32| {
            let own = corners.iter().fold(Box3::NOTHING, |sum, corner| sum.union(vertices[*corner as usize]));
            match () {
                () if !(is_same || own.overlaps(&other)) => 0,
                () if displacements.any_renewed(corners) => u32::MAX,
                () => fresh,
            }
        };
        let mut wanted = [0; EDGES];
        let edges = &forest.edges[clusters[0].edges.start as usize..clusters[0].edges.end as usize];
        for (wanted, edge) in wanted.iter_mut().zip(edges) {
            *wanted = of(&edge.corners[..2], around[1], fresh[1].edges);
        }
        let margin = self.query.margins[frame];
        let near_edges = lanes.near_edges(ClusterPair { clusters, numbers, frame, margin, wanted });
        let sides = if is_same { 1 } else { 2 };
        // By side, the vertices of which pairs with a triangle are wanted.
        let mut rows = [[0; MAX_CORNERS]; 2];
        let vertices_of = |cluster: &Cluster| {
            &forest.vertices[cluster.vertices.start as usize..cluster.vertices.end as usize]
        };
        let mut near_triangles = [[0; EDGES]; 2];
        for side in 0..sides {
            let [own, other] = [clusters[side], clusters[1 - side]];
            if other.triangles.is_empty() {
                continue;
            }
            let (mut points, mut count) = ([Point::default(); MAX_CORNERS], 0);
            for (row, slot) in vertices_of(own).iter().enumerate() {
                let wanted = of(&[*slot], around[1 - side], fresh[1 - side].triangles);
                if wanted != 0 {
                    points[count] = self.point((*slot, wanted), frame);
                    rows[side][count] = row;
                    count += 1;
                }
            }
            let of_other = (numbers[1 - side], other.triangles.len());
            near_triangles[side] = lanes.near_triangles(&points[..count], of_other, frame);
        }
        let is_none = |masks: &[u32; EDGES]| masks.iter().all(|mask| *mask == 0);
        if is_none(&near_edges) && near_triangles.iter().all(is_none) {
            return;
        }
        let corners = clusters.map(|cluster| forest.corners_of(cluster));
        let ways = primitives.near.between(corners[0], corners[1]);
        for (side, masks) in near_triangles.into_iter().enumerate() {
            for (row, mask) in rows[side].into_iter().zip(masks).filter(|(_, mask)| *mask != 0) {
                let slot = &vertices_of(clusters[side])[row];
                let place = corners[side].partition_point(|corner| corner < slot) as u8;
                for number in bits(mask) {
                    let triangle = &forest.triangles[clusters[1 - side].triangles.start as usize + number];
                    if !triangle.corners.contains(slot) {
                        let way = || match side {
                            0 => ways.least(&[place], &triangle.places),
                            _ => ways.least(&triangle.places, &[place]),
                        };
                        self.add_vertex_face(
                            *slot,
                            triangle,
                            (is_within, place_of([side, row, number]), way),
                        );
                    }
                }
            }
        }
        let starts = clusters.map(|cluster| cluster.edges.start as usize);
        for (number, mask) in near_edges.into_iter().enumerate().filter(|(_, mask)| *mask != 0) {
            let edge = &forest.edges[starts[0] + number];
            let others = if is_same { mask & (!1 << number) } else { mask };
            for second in bits(others) {
                let other = &forest.edges[starts[1] + second];
                if !edge.corners[..2].iter().any(|corner| other.corners.contains(corner)) {
                    let way = || ways.least(&edge.places[..2], &other.places[..2]);
                    self.add_edges(edge, other, (is_within, place_of([2, number, second]), way));
                }
            }
        }
    }

    /// The vertex in a slot, of which pairs with some triangles are wanted.
    fn point(&self, (slot, wanted): (u32, u32), frame: usize) -> Point {
        let PairQuery { particles, displacements, margins, .. } = self.query;
        let place = slot as usize;
        let reach = particles.radius()[place] + displacements.limits[frame][place] + margins[frame];
        let [start, end] = displacements.path(place).map(|place| place.to_array());
        Point { start, end, reach, wanted }
    }

    fn add_vertex_face(
        &mut self,
        slot: u32,
        triangle: &Primitive,
        (is_within, place, way): (bool, u32, impl FnOnce() -> f32),
    ) {
        let [a, b, c] = triangle.corners;
        self.add([slot, a, b, c], Kind::VertexFace, [0, triangle.marks], (is_within, place, way));
    }

    /// The edge with the smaller ends comes first, whatever cluster it is in.
    fn add_edges(
        &mut self,
        edge: &Primitive,
        other: &Primitive,
        (is_within, place, way): (bool, u32, impl FnOnce() -> f32),
    ) {
        let (one, other) = if edge.corners < other.corners { (edge, other) } else { (other, edge) };
        let slots = [one.corners[0], one.corners[1], other.corners[0], other.corners[1]];
        self.add(slots, Kind::EdgeEdge, [one.marks, other.marks], (is_within, place, way));
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
        (is_within, place, way): (bool, u32, impl FnOnce() -> f32),
    ) {
        let PairQuery { particles, displacements, margins, .. } = self.query;
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
        let paths = slots.map(|slot| displacements.path(slot as usize));
        let [start, end] = [paths.map(|[start, _]| start), paths.map(|[_, end]| end)];
        let end = displacements.any_paths().then_some(&end);
        let frame = usize::from(!is_within);
        let margin = margins[frame] + of_both(&displacements.limits[frame]);
        // No way is between those that share a corner which a tear has split.
        let most = 0.5 * way();
        let is_far = |distance: f32| distance > reach + margin || distance > most + margin;
        if most == 0.0 {
            return;
        }
        if let Some((distance, direction)) = distance_on_paths(kind, (&start, end), is_far) {
            let renewal = displacements.renewal;
            self.candidates.push(Candidate {
                slots,
                kind,
                marks,
                is_within,
                place,
                path: self.path,
                renewal,
                distance,
                direction,
                reach,
                most,
            });
        }
    }
}

/// Where a pair is among those of two clusters: of vertices of the first and triangles of the second, the other way round, of edges; by number.
fn place_of([kind, one, other]: [usize; 3]) -> u32 {
    ((kind * EDGES + one) * EDGES + other) as u32
}

/// Whether no pair of a body collides: all its particles are of one family.
pub(super) fn is_one_family(vertices: &[u32], families: &[u32]) -> bool {
    !families.is_empty()
        && vertices.iter().all(|slot| Exclusions::are_of_one_family(families, vertices[0], *slot))
}
