//! Surfaces: the air that acts on them, the gas that they enclose, and the edges and triangles that collide.
//!
//! Faces, filaments and gases are numbered as springs are: in the order of adding, a removed one leaves an empty place.

use std::ops::Range;

use crate::solver::api::{Solver, SolverError};
use crate::solver::elements::{CollisionEdge, Enclosure, Face, Filament, Gas, NO_SPRING, edges_of};
use crate::solver::gusts::AirClock;
use crate::solver::state::State;
use crate::solver::validation::non_negative;

impl State {
    /// Appends triangles between the slots `ends` that the air blows at, on both sides alike; their numbers.
    pub(crate) fn add_faces(&mut self, ends: impl IntoIterator<Item = [u32; 3]>, face: Face) -> Range<usize> {
        let first = self.exposed.add_faces(ends, face);
        first..self.exposed.faces.len()
    }

    /// Changes how the air acts on some faces; removed ones stay removed.
    pub(crate) fn set_faces(&mut self, faces: Range<usize>, face: Face) {
        for (ends, old) in self.exposed.faces[faces].iter_mut().filter(|(_, old)| *old != face) {
            *old = face;
            ends.iter().for_each(|end| self.sleep.disturb(*end as usize));
        }
    }

    /// Gives a face other ends, as where a cloth tears.
    pub(crate) fn move_face(&mut self, number: usize, ends: [u32; 3]) {
        ends.iter().for_each(|end| self.sleep.disturb(*end as usize));
        self.exposed.move_face(number, ends);
    }

    /// Removes some faces.
    pub(crate) fn remove_faces(&mut self, faces: Range<usize>) {
        for number in faces {
            self.exposed.faces[number].0.iter().for_each(|end| self.sleep.disturb(*end as usize));
            self.exposed.remove_face(number);
        }
    }

    /// Appends thin links between the slots `ends` that the air blows at; their numbers.
    pub(crate) fn add_filaments(
        &mut self,
        ends: impl IntoIterator<Item = [u32; 2]>,
        filament: Filament,
    ) -> Range<usize> {
        let first = self.exposed.add_filaments(ends, filament);
        first..self.exposed.filaments.len()
    }

    /// Changes how the air acts on some filaments; removed ones stay removed.
    pub(crate) fn set_filaments(&mut self, filaments: Range<usize>, filament: Filament) {
        for (ends, old) in self.exposed.filaments[filaments].iter_mut().filter(|(_, old)| *old != filament) {
            *old = filament;
            ends.iter().for_each(|end| self.sleep.disturb(*end as usize));
        }
    }

    /// Removes some filaments.
    pub(crate) fn remove_filaments(&mut self, filaments: Range<usize>) {
        filaments.for_each(|number| self.exposed.remove_filament(number));
    }

    /// Appends a gas that a closed surface of triangles encloses, counter-clockwise seen from outside; its number.
    pub(crate) fn add_gas(&mut self, triangles: &[[u32; 3]], gas: Gas) -> usize {
        let number = self.elements.push_gas(Enclosure::new(triangles, gas));
        self.invalidate_pulls_of_gas(number);
        number
    }

    /// Changes a gas; a removed one stays removed.
    pub(crate) fn set_gas(&mut self, number: usize, gas: Gas) {
        if self.elements.gases().all()[number].gas != gas {
            self.invalidate_pulls_of_gas(number);
            self.elements.set_gas(number, gas);
        }
    }

    /// Removes a gas.
    pub(crate) fn remove_gas(&mut self, number: usize) {
        self.invalidate_pulls_of_gas(number);
        self.elements.remove_gas(number);
    }

    /// The gas of this number.
    pub(crate) fn gas(&self, number: usize) -> Option<Gas> {
        self.elements.gases().all().get(number).map(|enclosure| enclosure.gas)
    }

    /// Removes the gases that a particle encloses.
    pub(super) fn remove_gases_at(&mut self, slot: usize) {
        let slot = slot as u32;
        for number in 0..self.elements.gases().all().len() {
            if self.elements.gases().all()[number].slots.contains(&slot) {
                self.remove_gas(number);
            }
        }
    }

    /// Gusts begin anew.
    pub(crate) fn reset_air_clock(&mut self) {
        self.air_clock = AirClock::default();
    }

    /// What pulls at the particles of a surface is other by now.
    fn invalidate_pulls_of_gas(&mut self, number: usize) {
        for slot in &self.elements.gases().all()[number].slots {
            self.sleep.disturb(*slot as usize);
            self.pulls.invalidate(*slot as usize);
        }
    }
}

impl Solver {
    /// Adds a triangle that the air blows at, on both sides alike. Returns its number among the faces.
    ///
    /// # Errors
    /// If a corner does not exist, two are the same, or a coefficient is not finite and >= 0.
    pub fn add_face(&mut self, corners: [usize; 3], face: Face) -> Result<usize, SolverError> {
        check_face(face)?;
        self.check_ends(&corners)?;
        Ok(self.state.add_faces([corners.map(|end| end as u32)], face).start)
    }

    /// Changes how the air acts on a face.
    ///
    /// # Errors
    /// If a coefficient is not finite and >= 0.
    ///
    /// # Panics
    /// If there is no such face.
    pub fn set_face(&mut self, number: usize, face: Face) -> Result<(), SolverError> {
        check_face(face)?;
        self.state.set_faces(number..number + 1, face);
        Ok(())
    }

    /// Gives a face other corners.
    ///
    /// # Errors
    /// If a corner does not exist, or two are the same.
    ///
    /// # Panics
    /// If there is no such face.
    pub fn move_face(&mut self, number: usize, corners: [usize; 3]) -> Result<(), SolverError> {
        self.check_ends(&corners)?;
        self.state.move_face(number, corners.map(|end| end as u32));
        Ok(())
    }

    /// Removes a face; its place stays empty.
    ///
    /// # Panics
    /// If there is no such face.
    pub fn remove_face(&mut self, number: usize) {
        self.state.remove_faces(number..number + 1);
    }

    /// Adds a thin round link that the air blows at, as along a rope; it does not hold its ends together. Returns its
    /// number among the filaments.
    ///
    /// # Errors
    /// If an end does not exist, both are the same, or a parameter is not finite and >= 0.
    pub fn add_filament(&mut self, ends: [usize; 2], filament: Filament) -> Result<usize, SolverError> {
        check_filament(filament)?;
        self.check_ends(&ends)?;
        Ok(self.state.add_filaments([ends.map(|end| end as u32)], filament).start)
    }

    /// Changes how the air acts on a filament.
    ///
    /// # Errors
    /// If a parameter is not finite and >= 0.
    ///
    /// # Panics
    /// If there is no such filament.
    pub fn set_filament(&mut self, number: usize, filament: Filament) -> Result<(), SolverError> {
        check_filament(filament)?;
        self.state.set_filaments(number..number + 1, filament);
        Ok(())
    }

    /// Removes a filament; its place stays empty.
    ///
    /// # Panics
    /// If there is no such filament.
    pub fn remove_filament(&mut self, number: usize) {
        self.state.remove_filaments(number..number + 1);
    }

    /// Encloses a gas in triangles, counter-clockwise seen from outside. Returns its number among the gases.
    ///
    /// # Errors
    /// If a corner does not exist, two of a triangle are the same, the triangles are no closed surface, the pressure is
    /// not finite and >= 0, or the rest volume not finite and > 0.
    pub fn add_gas(&mut self, triangles: &[[usize; 3]], gas: Gas) -> Result<usize, SolverError> {
        check_gas(gas)?;
        for corners in triangles {
            self.check_ends(corners)?;
        }
        let triangles: Vec<[u32; 3]> =
            triangles.iter().map(|corners| corners.map(|corner| corner as u32)).collect();
        check_closed(&triangles)?;
        Ok(self.state.add_gas(&triangles, gas))
    }

    /// Changes a gas.
    ///
    /// # Errors
    /// If the pressure is not finite and >= 0, or the rest volume not finite and > 0.
    ///
    /// # Panics
    /// If there is no such gas.
    pub fn set_gas(&mut self, number: usize, gas: Gas) -> Result<(), SolverError> {
        check_gas(gas)?;
        self.state.set_gas(number, gas);
        Ok(())
    }

    /// Lets a gas escape; its place stays empty.
    ///
    /// # Panics
    /// If there is no such gas.
    pub fn remove_gas(&mut self, number: usize) {
        self.state.remove_gas(number);
    }

    /// A gas, as it was set; that of an empty place is zero.
    ///
    /// # Panics
    /// If there is no such gas.
    pub fn gas(&self, number: usize) -> Gas {
        self.state.gas(number).expect("the gas exists")
    }

    /// Has triangles, and their edges, collide with what they meet: each is swept by spheres of the radii of its corners.
    /// They collide with each other, too, but for neighbours along the mesh. As they are now they count
    /// as at rest. Particles that are behind the triangles, as those of a lattice, may be named as `inner`: they collide
    /// with planes only.
    ///
    /// # Errors
    /// If a corner does not exist, or two are the same.
    pub fn add_collision_triangles(
        &mut self,
        triangles: &[[usize; 3]],
        inner: &[usize],
    ) -> Result<Range<usize>, SolverError> {
        for corners in triangles {
            self.check_ends(corners)?;
        }
        self.check_ends(inner)?;
        let triangles: Vec<[u32; 3]> =
            triangles.iter().map(|corners| corners.map(|end| end as u32)).collect();
        let edges = edges_of(&triangles);
        let edges = edges.into_iter().map(|ends| self.edge_between(ends)).collect::<Vec<_>>();
        let mesh = &mut self.state.mesh;
        mesh.add_edges(edges);
        mesh.add_inner(inner.iter().map(|slot| *slot as u32));
        let first = mesh.add_triangles(triangles);
        self.state.contacts.request_search();
        Ok(first..self.state.mesh.triangles.len())
    }

    /// Has an edge collide with what it meets, as a capsule that tapers from the radius of one end to that of the other.
    /// Returns its number among the edges.
    ///
    /// # Errors
    /// If an end does not exist, or both are the same.
    pub fn add_collision_edge(&mut self, ends: [usize; 2]) -> Result<usize, SolverError> {
        self.check_ends(&ends)?;
        let edge = self.edge_between(ends.map(|end| end as u32));
        self.state.contacts.request_search();
        Ok(self.state.mesh.add_edges([edge]))
    }

    /// Removes a triangle from what collides; its edges stay.
    ///
    /// # Panics
    /// If there is no such triangle.
    pub fn remove_collision_triangle(&mut self, number: usize) {
        self.state.mesh.remove_triangle(number);
        self.state.contacts.request_search();
    }

    /// Removes an edge from what collides.
    ///
    /// # Panics
    /// If there is no such edge.
    pub fn remove_collision_edge(&mut self, number: usize) {
        self.state.mesh.remove_edge(number);
        self.state.contacts.request_search();
    }

    fn edge_between(&self, ends: [u32; 2]) -> CollisionEdge {
        let [one, other] = ends.map(|end| self.position(end as usize));
        CollisionEdge { ends, rest_length: one.distance(other), spring: NO_SPRING }
    }

    fn check_ends(&self, ends: &[usize]) -> Result<(), SolverError> {
        let count = self.particle_count();
        if let Some(&particle) = ends.iter().find(|end| **end >= count) {
            return Err(SolverError::MissingParticle { particle, count });
        }
        let double = ends.iter().enumerate().find(|(place, end)| ends[..*place].contains(end));
        double.map_or(Ok(()), |(_, &particle)| Err(SolverError::Loop { particle }))
    }
}

fn check_face(face: Face) -> Result<(), SolverError> {
    non_negative("drag", face.drag)?;
    non_negative("lift", face.lift)
}

fn check_filament(filament: Filament) -> Result<(), SolverError> {
    non_negative("diameter", filament.diameter)?;
    non_negative("drag", filament.drag)
}

fn check_gas(gas: Gas) -> Result<(), SolverError> {
    non_negative("pressure", gas.pressure)?;
    match gas.rest_volume.is_finite() && gas.rest_volume > 0.0 {
        true => Ok(()),
        false => {
            let expected = "a finite number > 0";
            Err(SolverError::OutOfRange { field: "rest_volume", value: gas.rest_volume, expected })
        }
    }
}

/// Each edge belongs to two triangles, which go along it in opposite directions.
fn check_closed(triangles: &[[u32; 3]]) -> Result<(), SolverError> {
    let edges = triangles.iter().flat_map(|[a, b, c]| [[*a, *b], [*b, *c], [*c, *a]]);
    let mut edges: Vec<[u32; 2]> = edges.collect();
    edges.sort_unstable();
    let open = edges.iter().enumerate().find(|(place, edge)| {
        edges.get(place + 1) == Some(edge) || edges.binary_search(&[edge[1], edge[0]]).is_err()
    });
    open.map_or(Ok(()), |(_, edge)| Err(SolverError::NotClosed { edge: edge.map(|end| end as usize) }))
}
