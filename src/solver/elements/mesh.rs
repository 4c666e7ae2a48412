//! What of nets collides beside particles: edges, as capsules, and triangles, with a thickness.
//!
//! A primitive is as thick as its particles: it is the union of spheres with radii interpolated between those of its
//! corners. Edges and triangles are numbered as springs are: in the order of adding, a removed one leaves an empty place.

use std::ops::Range;

use super::Elements;
use crate::solver::state::Version;

/// The end of an element, an edge or a triangle that was removed.
pub(in crate::solver) const NO_SLOT: u32 = u32::MAX;

/// The spring of an edge that lies along none.
pub(in crate::solver) const NO_SPRING: u32 = u32::MAX;

/// A line between two particles.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
pub(in crate::solver) struct CollisionEdge {
    pub ends: [u32; 2],
    /// m.
    pub rest_length: f32,
    /// The spring along which it lies, and with which it is removed; [`NO_SPRING`] for an edge of triangles.
    pub spring: u32,
}

/// The primitives of all nets; a part of the state.
#[derive(Debug, Clone, Default)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
pub(in crate::solver) struct CollisionMesh {
    pub edges: Vec<CollisionEdge>,
    pub triangles: Vec<[u32; 3]>,
    /// Particles of a net that are in one place at rest: the copies of one that a tear has split, which stay neighbours.
    #[cfg_attr(feature = "serialize", serde(default))]
    pub seams: Vec<[u32; 2]>,
    /// Whether the particle in each slot is inside a net, behind its surface; shorter than the particles where none is.
    pub inner: Vec<bool>,
    /// The springs that belong to nets: of others each may be asked to collide along its length.
    owned: Vec<Range<u32>>,
    version: Version,
    #[cfg_attr(feature = "serialize", serde(default))]
    lengths_version: Version,
}

impl CollisionMesh {
    /// Changes with the primitives.
    pub fn version(&self) -> Version {
        self.version
    }

    /// Changes with the lengths at rest of edges that stay.
    pub fn lengths_version(&self) -> Version {
        self.lengths_version
    }

    pub fn clear(&mut self) {
        *self = Self { version: Version::new(), ..Self::default() };
    }

    /// Appends edges; the number of the first.
    pub fn add_edges(&mut self, edges: impl IntoIterator<Item = CollisionEdge>) -> usize {
        let first = self.edges.len();
        self.edges.extend(edges);
        self.version = Version::new();
        first
    }

    /// Appends triangles; the number of the first.
    pub fn add_triangles(&mut self, triangles: impl IntoIterator<Item = [u32; 3]>) -> usize {
        let first = self.triangles.len();
        self.triangles.extend(triangles);
        self.version = Version::new();
        first
    }

    /// Appends seams; the number of the first.
    pub fn add_seams(&mut self, seams: impl IntoIterator<Item = [u32; 2]>) -> usize {
        let first = self.seams.len();
        self.seams.extend(seams);
        self.version = Version::new();
        first
    }

    /// Marks the particles in some slots as inside a net.
    pub fn add_inner(&mut self, slots: impl Iterator<Item = u32>) {
        for slot in slots.map(|slot| slot as usize) {
            if self.inner.len() <= slot {
                self.inner.resize(slot + 1, false);
            }
            self.inner[slot] = true;
        }
        self.version = Version::new();
    }

    /// Takes note that springs belong to a net.
    pub fn add_owned(&mut self, springs: &Range<usize>) {
        if !springs.is_empty() {
            self.owned.push(springs.start as u32..springs.end as u32);
        }
    }

    /// Empties the place of an edge.
    pub fn remove_edge(&mut self, number: usize) {
        self.edges[number].ends = [NO_SLOT; 2];
        self.version = Version::new();
    }

    /// Empties the place of a triangle.
    pub fn remove_triangle(&mut self, number: usize) {
        self.triangles[number] = [NO_SLOT; 3];
        self.version = Version::new();
    }

    /// Empties the place of a seam.
    pub fn remove_seam(&mut self, number: usize) {
        self.seams[number] = [NO_SLOT; 2];
        self.version = Version::new();
    }

    /// Changes the lengths at rest of edges, where they are others.
    pub fn set_rest_lengths(&mut self, numbers: Range<usize>, wanted: impl Iterator<Item = f32>) {
        for (edge, wanted) in self.edges[numbers].iter_mut().zip(wanted) {
            if edge.rest_length != wanted {
                edge.rest_length = wanted;
                self.lengths_version = Version::new();
            }
        }
    }

    /// The particle in a slot is inside a net no longer.
    pub fn clear_inner(&mut self, slot: usize) {
        if let Some(inner) = self.inner.get_mut(slot) {
            *inner = false;
        }
    }

    /// Removes all that ends in a slot.
    pub fn remove_particle(&mut self, slot: usize) {
        if let Some(inner) = self.inner.get_mut(slot) {
            *inner = false;
        }
        let slot = slot as u32;
        for number in 0..self.edges.len() {
            if self.edges[number].ends.contains(&slot) {
                self.remove_edge(number);
            }
        }
        for number in 0..self.triangles.len() {
            if self.triangles[number].contains(&slot) {
                self.remove_triangle(number);
            }
        }
        for number in 0..self.seams.len() {
            if self.seams[number].contains(&slot) {
                self.remove_seam(number);
            }
        }
    }

    /// Renames the particles: `new_slots[old]` is the new slot of each.
    pub fn renumber(&mut self, new_slots: &[u32]) {
        let ends = self.edges.iter_mut().flat_map(|edge| &mut edge.ends);
        let ends = ends.chain(self.seams.as_flattened_mut());
        for end in ends.chain(self.triangles.as_flattened_mut()) {
            *end = new_slots.get(*end as usize).copied().unwrap_or(NO_SLOT);
        }
        let old = std::mem::take(&mut self.inner);
        let inner = old.iter().zip(new_slots).filter(|(is_inner, _)| **is_inner).map(|(_, new)| *new);
        self.add_inner(inner);
    }

    /// The edges that are there, with their lengths at rest, m; those along springs only as long as these act.
    /// `with_springs`: those of springs that belong to no net, too.
    pub fn present_edges<'a>(
        &'a self,
        elements: &'a Elements,
        with_springs: bool,
    ) -> impl Iterator<Item = ([u32; 2], f32)> + 'a {
        let acts = |spring: u32| {
            spring == NO_SPRING
                || elements.springs().element(spring as usize).is_some_and(super::Element::acts)
        };
        let own = self.edges.iter().filter(move |edge| edge.ends[0] != NO_SLOT && acts(edge.spring));
        let loose = self.loose_springs(elements).filter(move |_| with_springs);
        own.map(|edge| (edge.ends, edge.rest_length)).chain(loose)
    }

    /// The ends and lengths at rest, m, of the springs that belong to no net and act.
    pub fn loose_springs<'a>(&'a self, elements: &'a Elements) -> impl Iterator<Item = ([u32; 2], f32)> + 'a {
        let springs = elements.springs();
        // Between the ranges of the nets, which are in ascending order.
        let starts = std::iter::once(0).chain(self.owned.iter().map(|range| range.end as usize));
        let ends = self.owned.iter().map(|range| range.start as usize).chain([springs.len()]);
        let gaps = starts.zip(ends).filter(|(start, end)| start < end);
        gaps.flat_map(move |(start, end)| {
            let all = springs.all_ends()[start..end].iter().zip(&springs.elements()[start..end]);
            all.filter(|(_, spring)| super::Element::acts(*spring))
                .map(|(ends, spring)| (*ends, spring.length_at_rest()))
        })
    }

    /// The triangles that are there.
    pub fn present_triangles(&self) -> impl Iterator<Item = [u32; 3]> + '_ {
        self.triangles.iter().filter(|corners| corners[0] != NO_SLOT).copied()
    }

    /// The seams that are there.
    pub fn present_seams(&self) -> impl Iterator<Item = [u32; 2]> + '_ {
        self.seams.iter().filter(|ends| ends[0] != NO_SLOT).copied()
    }

    /// Whether the particle in a slot is inside a net.
    pub fn is_inner(&self, slot: usize) -> bool {
        self.inner.get(slot) == Some(&true)
    }
}

/// The edges of triangles, each once, by their smaller ends.
pub(in crate::solver) fn edges_of(triangles: &[[u32; 3]]) -> Vec<[u32; 2]> {
    let sides = triangles.iter().flat_map(|[a, b, c]| [[*a, *b], [*b, *c], [*c, *a]]);
    let mut edges: Vec<[u32; 2]> = sides.map(|[a, b]| [a.min(b), a.max(b)]).collect();
    edges.sort_unstable();
    edges.dedup();
    edges
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solver::elements::Spring;

    const SPRING: Spring = Spring::elastic(0.5, 1.0, 0.0);

    fn edge(ends: [u32; 2], spring: u32) -> CollisionEdge {
        CollisionEdge { ends, rest_length: 1.0, spring }
    }

    #[test]
    fn edges_along_springs_last_as_long_as_these() {
        let (mut mesh, mut elements) = (CollisionMesh::default(), Elements::default());
        let springs = [[0, 1], [1, 2], [3, 4]].map(|ends| elements.push(ends, SPRING));
        mesh.add_owned(&(springs[0]..springs[1] + 1));
        mesh.add_edges([edge([0, 1], 0), edge([1, 2], 1), edge([0, 2], NO_SPRING)]);
        let present = |mesh: &CollisionMesh, elements: &Elements, all| -> Vec<[u32; 2]> {
            mesh.present_edges(elements, all).map(|(ends, _)| ends).collect()
        };
        assert_eq!(present(&mesh, &elements, false), [[0, 1], [1, 2], [0, 2]]);
        assert_eq!(present(&mesh, &elements, true), [[0, 1], [1, 2], [0, 2], [3, 4]]);
        elements.break_spring(1);
        assert_eq!(present(&mesh, &elements, true), [[0, 1], [0, 2], [3, 4]]);
    }

    #[test]
    fn what_ends_in_a_particle_leaves_with_it() {
        let mut mesh = CollisionMesh::default();
        mesh.add_triangles([[0, 1, 2], [1, 2, 3]]);
        mesh.add_edges(edges_of(&mesh.triangles).into_iter().map(|ends| edge(ends, NO_SPRING)));
        assert_eq!(mesh.edges.len(), 5);
        mesh.add_inner([4].into_iter());
        mesh.remove_particle(0);
        mesh.renumber(&[4, 3, 2, 1, 0]);
        assert_eq!(mesh.present_triangles().collect::<Vec<_>>(), [[3, 2, 1]]);
        let edges: Vec<_> = mesh.present_edges(&Elements::default(), true).map(|(ends, _)| ends).collect();
        assert_eq!(edges, [[3, 2], [3, 1], [2, 1]]);
        assert!(mesh.is_inner(0) && !mesh.is_inner(4));
    }
}
