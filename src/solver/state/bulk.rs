//! Nets: consecutive particles and elements, added and removed as one.

use std::ops::Range;

use bevy::math::Vec3;

use super::State;
use crate::solver::elements::{Bend, CollisionEdge, Face, Filament, Gas, NO_SPRING, Spring, edges_of};

/// Where a net is: consecutive slots, unless particles were renumbered since, and consecutive places in each table.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct NetRanges {
    pub particles: Range<usize>,
    pub springs: Range<usize>,
    pub rods: Range<usize>,
    pub hinges: Range<usize>,
    pub faces: Range<usize>,
    pub filaments: Range<usize>,
    pub gas: Option<usize>,
    /// Among the edges that collide.
    #[cfg_attr(feature = "serialize", serde(default))]
    pub edges: Range<usize>,
    /// Among the triangles that collide.
    #[cfg_attr(feature = "serialize", serde(default))]
    pub triangles: Range<usize>,
    /// Among the seams of what collides.
    #[cfg_attr(feature = "serialize", serde(default))]
    pub seams: Range<usize>,
}

/// The elements of a net, with ends that are counted from its first particle.
#[derive(Debug, Clone, Copy)]
pub(crate) struct NetElements<'a> {
    pub springs: &'a [([u32; 2], Spring)],
    pub rods: &'a [([u32; 3], Bend<3>)],
    pub hinges: &'a [([u32; 4], Bend<4>)],
    /// The triangles of the surface.
    pub triangles: &'a [[u32; 3]],
    /// The places of the particles at rest, m.
    pub rest: &'a [Vec3],
    /// How air acts on these; `None` where it does not.
    pub face: Option<Face>,
    /// How air acts along the springs; `None` where it does not.
    pub filament: Option<Filament>,
    /// What the surface encloses.
    pub gas: Option<Gas>,
    /// Whether the particles do not collide with each other.
    pub ignores_itself: bool,
}

impl NetElements<'_> {
    /// What collides beside the particles: the edges of the surface; where there is none, what is along the springs.
    fn collision_edges(&self) -> impl Iterator<Item = CollisionEdge> {
        let along = |(number, (ends, spring)): (u32, &([u32; 2], Spring))| CollisionEdge {
            ends: *ends,
            rest_length: spring.length_at_rest(),
            spring: number,
        };
        let springs = if self.triangles.is_empty() { self.springs } else { &[] };
        (0..).zip(springs).map(along).chain(self.surface_edges())
    }

    /// The edges of the surface.
    fn surface_edges(&self) -> impl Iterator<Item = CollisionEdge> {
        let rest_length = move |[one, other]: [u32; 2]| {
            self.rest
                .get(one as usize)
                .zip(self.rest.get(other as usize))
                .map_or(0.0, |(a, b)| a.distance(*b))
        };
        let edges = edges_of(self.triangles).into_iter();
        edges.map(move |ends| CollisionEdge { ends, rest_length: rest_length(ends), spring: NO_SPRING })
    }

    /// The corners of the surface that are in one place at rest: each with the one before.
    fn seams(&self) -> Vec<[u32; 2]> {
        let place =
            |corner: u32| self.rest.get(corner as usize).map(|place| place.to_array().map(f32::to_bits));
        let mut corners = self.triangles.as_flattened().to_vec();
        corners.sort_unstable_by_key(|corner| (place(*corner), *corner));
        corners.dedup();
        let pairs = corners.windows(2).map(|pair| [pair[0], pair[1]]);
        pairs.filter(|pair| place(pair[0]).is_some() && place(pair[0]) == place(pair[1])).collect()
    }

    fn faces(&self) -> usize {
        if self.face.is_some() { self.triangles.len() } else { 0 }
    }

    fn filaments(&self) -> usize {
        if self.filament.is_some() { self.springs.len() } else { 0 }
    }
}

impl State {
    /// Appends a net: its particles as (position in m, velocity in m/s, 1 / mass in 1/kg; 0: pinned), all of one radius, m,
    /// and its elements.
    pub(crate) fn add_net(
        &mut self,
        particles: impl ExactSizeIterator<Item = (Vec3, Vec3, f32)>,
        radius: f32,
        elements: NetElements,
    ) -> NetRanges {
        let first = self.particles.len();
        self.particles.extend(particles, radius);
        if elements.ignores_itself {
            self.particles.set_family(first..self.particles.len(), true);
        }
        (first..self.particles.len()).for_each(|slot| self.sleep.disturb(slot));
        self.contacts.request_search();
        self.may_coincide |= !elements.springs.is_empty();
        let springs = self.elements.extend(first as u32, elements.springs);
        self.mesh.add_owned(&springs);
        NetRanges {
            particles: first..self.particles.len(),
            rods: self.elements.extend(first as u32, elements.rods),
            hinges: self.elements.extend(first as u32, elements.hinges),
            ..self.add_surface(first as u32, elements, springs)
        }
    }

    /// Has the surface of a net collide, or where it has none what is along its `springs`.
    fn add_collision_mesh(&mut self, first: u32, elements: NetElements, springs: &Range<usize>) -> NetRanges {
        let triangles = elements.triangles.iter().map(|ends| ends.map(|end| end + first));
        let edges = elements.collision_edges().map(|edge| CollisionEdge {
            ends: edge.ends.map(|end| end + first),
            spring: if edge.spring == NO_SPRING { NO_SPRING } else { edge.spring + springs.start as u32 },
            ..edge
        });
        let [edges, triangles] = [self.mesh.add_edges(edges), self.mesh.add_triangles(triangles)];
        let seams = self.mesh.add_seams(elements.seams().into_iter().map(|ends| ends.map(|end| end + first)));
        if !elements.triangles.is_empty() {
            let mut is_inner = vec![true; self.particles.len() - first as usize];
            elements.triangles.as_flattened().iter().for_each(|corner| is_inner[*corner as usize] = false);
            let inner = (first..).zip(is_inner).filter(|(_, is_inner)| *is_inner);
            self.mesh.add_inner(inner.map(|(slot, _)| slot));
        }
        NetRanges {
            edges: edges..self.mesh.edges.len(),
            triangles: triangles..self.mesh.triangles.len(),
            seams: seams..self.mesh.seams.len(),
            ..NetRanges::default()
        }
    }

    fn add_surface(&mut self, first: u32, elements: NetElements, springs: Range<usize>) -> NetRanges {
        let mesh = self.add_collision_mesh(first, elements, &springs);
        let triangles = elements.triangles.iter().map(|ends| ends.map(|end| end + first));
        let links = elements.springs.iter().map(|(ends, _)| ends.map(|end| end + first));
        NetRanges {
            faces: elements.face.map_or(0..0, |face| self.add_faces(triangles.clone(), face)),
            filaments: elements.filament.map_or(0..0, |filament| self.add_filaments(links, filament)),
            gas: elements.gas.map(|gas| self.add_gas(&triangles.collect::<Vec<_>>(), gas)),
            springs,
            ..mesh
        }
    }

    /// Empties the slots and the places of the elements of a net that end in these slots.
    pub(crate) fn remove_from_net(&mut self, ranges: &NetRanges, slots: impl Iterator<Item = usize>) {
        let mut is_gone = vec![false; self.particles.len()];
        for slot in slots {
            is_gone[slot] = true;
            self.remove_particle(slot);
        }
        self.remove_elements(ranges, |end| is_gone[end as usize]);
    }

    /// Empties all slots and places of a net.
    pub(crate) fn remove_net(&mut self, ranges: &NetRanges, slots: impl Iterator<Item = usize>) {
        self.remove_faces(ranges.faces.clone());
        self.remove_filaments(ranges.filaments.clone());
        ranges.gas.into_iter().for_each(|gas| self.remove_gas(gas));
        ranges.edges.clone().for_each(|number| self.mesh.remove_edge(number));
        ranges.triangles.clone().for_each(|number| self.mesh.remove_triangle(number));
        ranges.seams.clone().for_each(|number| self.mesh.remove_seam(number));
        for slot in slots {
            self.sleep.vanish(slot, &self.particles);
            self.particles.vacate(slot);
            self.mesh.clear_inner(slot);
            self.pulls.invalidate(slot);
            self.contacts.clear_particle(slot);
        }
        self.contacts.request_search();
        self.remove_elements(ranges, |_| true);
    }

    fn remove_elements(&mut self, ranges: &NetRanges, is_gone: impl Fn(u32) -> bool) {
        let elements = &mut self.elements;
        elements
            .remove_where::<Spring, 2>(ranges.springs.clone(), |ends| ends.iter().any(|end| is_gone(*end)));
        elements.remove_where::<Bend<3>, 3>(ranges.rods.clone(), |ends| ends.iter().any(|end| is_gone(*end)));
        elements
            .remove_where::<Bend<4>, 4>(ranges.hinges.clone(), |ends| ends.iter().any(|end| is_gone(*end)));
    }

    /// Gives the elements of a net these parameters. `slot_of` has the slot of each particle, `is_absent` says which
    /// particles are out of the simulation and `is_broken` which springs are. `false`, and nothing is changed, if they
    /// join other particles.
    pub(crate) fn set_net(
        &mut self,
        ranges: &NetRanges,
        wanted: NetElements,
        slot_of: impl Fn(u32) -> u32 + Copy,
        is_absent: impl Fn(u32) -> bool + Copy,
        is_broken: impl Fn(usize) -> bool,
    ) -> bool {
        let Self { elements, pulls, contacts, sleep, .. } = self;
        let mut any_changed = false;
        let mut on_change = |ends: &[u32], begins_or_ends: bool| {
            any_changed = true;
            ends.iter().for_each(|end| sleep.disturb(*end as usize));
            if begins_or_ends {
                ends.iter().for_each(|end| pulls.invalidate(*end as usize));
            }
        };
        let merge_springs = |number: usize, old: &Spring, new: &Spring| {
            if is_broken(number) || wanted.springs[number].0.iter().any(|end| is_absent(*end)) {
                return *old;
            }
            *new
        };
        let merge_rods = |number: usize, old: &Bend<3>, new: &Bend<3>| {
            if wanted.rods[number].0.iter().any(|end| is_absent(*end)) { *old } else { *new }
        };
        let merge_hinges = |number: usize, old: &Bend<4>, new: &Bend<4>| {
            if wanted.hinges[number].0.iter().any(|end| is_absent(*end)) { *old } else { *new }
        };
        let NetRanges { springs, rods, hinges, .. } = ranges.clone();
        let has_same_surface = ranges.faces.len() == wanted.faces()
            && ranges.filaments.len() == wanted.filaments()
            && ranges.gas.is_some() == wanted.gas.is_some();
        let is_same = has_same_surface
            && elements.set_all(springs, wanted.springs, slot_of, merge_springs, |e, b| on_change(e, b))
            && elements.set_all(rods, wanted.rods, slot_of, merge_rods, |e, b| on_change(e, b))
            && elements.set_all(hinges, wanted.hinges, slot_of, merge_hinges, |e, b| on_change(e, b));
        if any_changed {
            contacts.request_search();
            self.may_coincide = true;
        }
        if is_same {
            wanted.face.into_iter().for_each(|face| self.set_faces(ranges.faces.clone(), face));
            wanted.filament.into_iter().for_each(|link| self.set_filaments(ranges.filaments.clone(), link));
            ranges.gas.zip(wanted.gas).into_iter().for_each(|(number, gas)| self.set_gas(number, gas));
            let slots = (0..ranges.particles.len()).map(|particle| slot_of(particle as u32) as usize);
            self.set_family(slots, wanted.ignores_itself);
            let edges = ranges.edges.clone();
            if wanted.triangles.is_empty() {
                let lengths = wanted.springs.iter().map(|(_, spring)| spring.length_at_rest());
                self.mesh.set_rest_lengths(edges, lengths);
            } else {
                self.mesh.set_rest_lengths(edges, wanted.collision_edges().map(|edge| edge.rest_length));
            }
        }
        is_same
    }

    /// Has the particles in some slots collide with each other, or not.
    fn set_family(&mut self, mut slots: impl Iterator<Item = usize> + Clone, is_one: bool) {
        let was_one = slots.clone().next().is_some_and(|slot| self.particles.has_family(slot));
        if was_one != is_one {
            slots.clone().for_each(|slot| self.sleep.disturb(slot));
            self.particles.set_family(&mut slots, is_one);
            self.contacts.request_search();
        }
    }

    /// Springs of a net that was added anew go on from what they were when the last tick ended.
    pub(crate) fn set_past_net(&mut self, ranges: &NetRanges, past: &[Spring]) {
        for (index, past) in ranges.springs.clone().zip(past) {
            if self.spring(index).is_none_or(|present| present == past) {
                continue;
            }
            self.set_past_spring(index, *past);
        }
    }

    /// The springs that do not belong to a net but end in one of its slots.
    pub(crate) fn springs_into(&self, ranges: &NetRanges, is_in: impl Fn(u32) -> bool) -> Vec<usize> {
        self.elements.springs_into(is_in, &ranges.springs)
    }
}
