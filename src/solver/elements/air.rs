//! The forces of the air on faces and filaments. Each of their particles has the wind relative to its own velocity.
//!
//! With the velocity v of the air relative to the particle, of which a part s = |n·v| meets the face of area A and unit
//! normal n, a third of the face is pushed by
//!
//! ```text
//! drag   ½ ρ C_D A/3 s v               along the wind
//! lift   ½ ρ C_L A/3 s (‖v‖ n − s v/‖v‖)   across the wind, towards n, which points downwind
//! ```
//!
//! These are the laws of a flat plate at an angle of attack α, s = ‖v‖ sin α: a drag coefficient C_D sin α and a lift
//! coefficient C_L sin α cos α (Hoerner, *Fluid-Dynamic Drag*, 1965, 3-16, and *Fluid-Dynamic Lift*, 1985, for plates;
//! Wejchert and Haumann, *Animation aerodynamics*, SIGGRAPH 1991, for faces of nets). A half of a filament of length l
//! and diameter d is pushed by ½ ρ C_D d l/2 ‖v⊥‖ v⊥, with the part v⊥ of v across it: the cross-flow principle
//! (Hoerner 1965, 3-11).
//!
//! For a step of h seconds the force is b − D v' with the velocity v' at its end, and b and D from its start: so it is
//! exact where nothing changes any more, at terminal speed or in a flag that stands still, and D brakes for every wind,
//! mass and step. D is a number d for faces; their lift is in b, and bounded so that a step without other forces never
//! takes a particle further from the velocity of the air.
//!
//! For filaments along a it is the matrix Σ d (I − a aᵀ): nothing brakes along them. A number would, and what it takes off
//! along the filament had to be given back from the velocity at the start of the step. Then a particle has the mass
//! m + h d along its filaments, which comes and goes with the wind across them, and a rope that swings lengthwise on its
//! springs gains energy from that without bound.

use bevy::math::{DMat3, DVec3, Vec3};

use super::mesh::NO_SLOT;
use crate::solver::particles::Vectors;
use crate::solver::state::Version;

/// How the air acts on a triangle, on either side alike.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
pub struct Face {
    /// The drag coefficient C_D, >= 0. Of a square plate across the wind 1.17.
    pub drag: f32,
    /// The lift coefficient C_L, >= 0.
    pub lift: f32,
}

/// How the air acts on a thin round link between two particles.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
pub struct Filament {
    /// The diameter d, m, >= 0.
    pub diameter: f32,
    /// The drag coefficient C_D across it, >= 0. Of a cylinder 1.2 (below the speed at which its wake turns turbulent).
    pub drag: f32,
}

/// The faces and filaments of all particles; a part of the state. A removed one leaves an empty place.
#[derive(Debug, Clone, Default)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
pub(in crate::solver) struct Exposed {
    pub faces: Vec<([u32; 3], Face)>,
    pub filaments: Vec<([u32; 2], Filament)>,
    /// The number of those that end in each slot; shorter than the particles where none do.
    ends: Vec<u32>,
    version: Version,
}

impl Exposed {
    /// Whether the air acts on nothing.
    pub fn is_empty(&self) -> bool {
        self.faces.is_empty() && self.filaments.is_empty()
    }

    /// Changes with the ends.
    pub fn version(&self) -> Version {
        self.version
    }

    pub fn clear(&mut self) {
        *self = Self { version: Version::new(), ..Self::default() };
    }

    /// Appends faces; the number of the first.
    pub fn add_faces(&mut self, ends: impl IntoIterator<Item = [u32; 3]>, face: Face) -> usize {
        let first = self.faces.len();
        self.faces.extend(ends.into_iter().map(|ends| (ends, face)));
        (first..self.faces.len()).for_each(|number| count(&mut self.ends, &self.faces[number].0, true));
        self.version = Version::new();
        first
    }

    /// Appends filaments; the number of the first.
    pub fn add_filaments(&mut self, ends: impl IntoIterator<Item = [u32; 2]>, filament: Filament) -> usize {
        let first = self.filaments.len();
        self.filaments.extend(ends.into_iter().map(|ends| (ends, filament)));
        (first..self.filaments.len())
            .for_each(|number| count(&mut self.ends, &self.filaments[number].0, true));
        self.version = Version::new();
        first
    }

    /// Gives a face other ends.
    pub fn move_face(&mut self, number: usize, ends: [u32; 3]) {
        let old = std::mem::replace(&mut self.faces[number].0, ends);
        count(&mut self.ends, &old, false);
        count(&mut self.ends, &ends, true);
        self.version = Version::new();
    }

    /// Empties the place of a face.
    pub fn remove_face(&mut self, number: usize) {
        let (ends, _) = std::mem::replace(&mut self.faces[number], ([NO_SLOT; 3], Face::default()));
        count(&mut self.ends, &ends, false);
        self.version = Version::new();
    }

    /// Empties the place of a filament.
    pub fn remove_filament(&mut self, number: usize) {
        let (ends, _) = std::mem::replace(&mut self.filaments[number], ([NO_SLOT; 2], Filament::default()));
        count(&mut self.ends, &ends, false);
        self.version = Version::new();
    }

    /// Calls `visit` with the slot of each end of a face or filament.
    pub fn for_each_end(&self, mut visit: impl FnMut(usize)) {
        let faces = self.faces.iter().flat_map(|(ends, _)| ends);
        let filaments = self.filaments.iter().flat_map(|(ends, _)| ends);
        faces.chain(filaments).for_each(|end| visit(*end as usize));
    }

    /// Removes all that ends in a slot.
    pub fn remove_particle(&mut self, slot: usize) {
        if self.ends.get(slot).is_none_or(|count| *count == 0) {
            return;
        }
        let slot = slot as u32;
        for number in 0..self.faces.len() {
            if self.faces[number].0.contains(&slot) {
                self.remove_face(number);
            }
        }
        for number in 0..self.filaments.len() {
            if self.filaments[number].0.contains(&slot) {
                self.remove_filament(number);
            }
        }
    }

    /// Renames the particles: `new_slots[old]` is the new slot of each.
    pub fn renumber(&mut self, new_slots: &[u32]) {
        let faces = self.faces.iter_mut().flat_map(|(ends, _)| ends);
        for end in faces.chain(self.filaments.iter_mut().flat_map(|(ends, _)| ends)) {
            *end = new_slots.get(*end as usize).copied().unwrap_or(NO_SLOT);
        }
        let old = std::mem::take(&mut self.ends);
        self.ends.resize(new_slots.len(), 0);
        for (count, new) in old.into_iter().zip(new_slots) {
            self.ends[*new as usize] = count;
        }
        self.version = Version::new();
    }
}

/// Adds 1 to the counts at the ends of what was added, or takes 1 away.
fn count(counts: &mut Vec<u32>, ends: &[u32], added: bool) {
    for end in ends.iter().map(|end| *end as usize).filter(|end| *end != NO_SLOT as usize) {
        if counts.len() <= end {
            counts.resize(end + 1, 0);
        }
        counts[end] = if added { counts[end] + 1 } else { counts[end] - 1 };
    }
}

/// A face where it is now, with the dynamic pressure of the air.
#[derive(Debug, Clone, Copy, Default)]
pub(in crate::solver) struct FacePush {
    /// ½ ρ A/3 n, kg/m.
    normal: Vec3,
    drag: f32,
    /// C_L / (½ ρ A/3).
    lift: f32,
}

/// A filament where it is now, with the dynamic pressure of the air.
#[derive(Debug, Clone, Copy, Default)]
pub(in crate::solver) struct FilamentPush {
    /// a, in f64: so nothing brakes along it, whatever the drag.
    along: DVec3,
    /// ½ ρ C_D d l/2, kg/m.
    drag: f64,
}

impl FacePush {
    pub fn of((ends, face): &([u32; 3], Face), position: &Vectors, density: f32) -> Self {
        if ends[0] == NO_SLOT {
            return Self::default();
        }
        let [a, b, c] = ends.map(|end| position.get(end as usize));
        let normal = (b - a).cross(c - a) * (density / 12.0);
        if face.lift == 0.0 {
            return Self { normal, drag: face.drag, lift: 0.0 };
        }
        let area = normal.length();
        Self { normal, drag: face.drag, lift: if area > 0.0 { face.lift / area } else { 0.0 } }
    }

    /// d in N·s/m, and the lift in N, at a relative velocity v of the air.
    #[inline]
    pub fn at(&self, velocity: Vec3) -> (f32, Vec3) {
        let met = self.normal.dot(velocity);
        let drag = self.drag * met.abs();
        if self.lift == 0.0 || met == 0.0 {
            return (drag, Vec3::ZERO);
        }
        let speed = velocity.length();
        (drag, (self.lift * met) * (speed * self.normal - (met / speed) * velocity))
    }
}

impl FilamentPush {
    pub fn of((ends, filament): &([u32; 2], Filament), position: &Vectors, density: f32) -> Self {
        if ends[0] == NO_SLOT {
            return Self::default();
        }
        let [a, b] = ends.map(|end| position.get(end as usize));
        let side = (b - a).as_dvec3();
        let length = side.length();
        let along = if length > 0.0 { side / length } else { DVec3::ZERO };
        let drag = 0.25 * density * filament.drag * filament.diameter;
        Self { along, drag: f64::from(drag) * length }
    }

    /// d in N·s/m.
    #[inline]
    fn drag_at(&self, velocity: DVec3) -> f64 {
        self.drag * (velocity - self.along.dot(velocity) * self.along).length()
    }
}

/// What the air does to a particle by the faces at it: see the top of the file.
#[derive(Debug, Clone, Copy)]
pub(in crate::solver) struct Push {
    velocity: Vec3,
    drag: f32,
    lift: Vec3,
}

/// The largest z: more stops a particle no faster.
const MAX_STEP_DECAY: f32 = 1e8;

impl Push {
    /// At the velocity of the air relative to the particle.
    pub fn new(velocity: Vec3) -> Self {
        Self { velocity, drag: 0.0, lift: Vec3::ZERO }
    }

    /// Adds that of a face.
    #[inline]
    pub fn add(&mut self, face: &FacePush) {
        let (drag, lift) = face.at(self.velocity);
        self.drag += drag;
        self.lift += lift;
    }

    /// d/m in 1/s and the lift by the mass in m/s², for a step of `step` seconds.
    ///
    /// With z = h d/m, a lift of more than √(2z) ‖v‖ m/h is cut down to that: then no step without other forces adds to ‖v‖,
    /// with the formulas of any scheme. Up to z = 2 (C_D/C_L)² none is.
    #[inline]
    pub fn by_mass(&self, inverse_mass: f32, step: f32) -> (f32, Vec3) {
        let per_step = step * inverse_mass;
        let z = per_step * self.drag;
        let (lift, most) = (per_step * self.lift.length(), (2.0 * z).sqrt() * self.velocity.length());
        let share = if lift > most { most / lift } else { 1.0 };
        let cut = cut(z);
        let across = (share * self.lift) * (inverse_mass * cut);
        ((z * cut) / step, if across.is_finite() { across } else { Vec3::ZERO })
    }
}

/// What the air does to a particle by the filaments at it.
#[derive(Debug, Clone, Copy)]
pub(in crate::solver) struct CrossFlow {
    velocity: DVec3,
    /// Σ d, N·s/m.
    drag: f32,
    /// Σ d (I − a aᵀ), N·s/m.
    across: DMat3,
}

impl CrossFlow {
    /// At the velocity of the air relative to the particle.
    pub fn new(velocity: Vec3) -> Self {
        Self { velocity: velocity.as_dvec3(), drag: 0.0, across: DMat3::ZERO }
    }

    /// Adds that of a filament.
    #[inline]
    pub fn add(&mut self, filament: &FilamentPush) {
        let (drag, along) = (filament.drag_at(self.velocity), filament.along);
        self.drag += drag as f32;
        let outer = DMat3::from_cols(along * along.x, along * along.y, along * along.z);
        self.across += (DMat3::IDENTITY - outer) * drag;
    }

    /// D/m in 1/s, for a step of `step` seconds.
    pub fn by_mass(&self, inverse_mass: f32, step: f32) -> DMat3 {
        let rate = self.across * f64::from(inverse_mass * cut(step * inverse_mass * self.drag));
        if rate.x_axis.is_finite() && rate.y_axis.is_finite() && rate.z_axis.is_finite() {
            rate
        } else {
            DMat3::ZERO
        }
    }
}

/// How much of h d/m counts.
#[inline]
fn cut(decay: f32) -> f32 {
    if decay > MAX_STEP_DECAY { MAX_STEP_DECAY / decay } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DENSITY: f32 = 1.2;

    /// A face in the plane z = 0, of 0.5 m².
    fn face(face: Face) -> FacePush {
        let mut position = Vectors::default();
        [Vec3::ZERO, Vec3::X, Vec3::Y].into_iter().for_each(|corner| position.push(corner));
        FacePush::of(&([0, 1, 2], face), &position, DENSITY)
    }

    #[test]
    fn a_face_across_the_wind_feels_the_drag_of_a_plate() {
        let (drag, lift) = face(Face { drag: 1.17, lift: 0.8 }).at(Vec3::Z * -3.0);
        assert!((3.0 * drag * 3.0 - 0.5 * DENSITY * 1.17 * 0.5 * 9.0).abs() < 1e-5);
        assert!(lift.length() < 1e-6);
    }

    #[test]
    fn at_45_degrees_lift_is_half_of_its_coefficient_across_the_wind() {
        let wind = Vec3::new(2.0, 0.0, 2.0);
        let (drag, lift) = face(Face { drag: 1.0, lift: 0.8 }).at(wind);
        let pressure = 0.5 * DENSITY * 8.0 * 0.5 / 3.0;
        assert!((drag * wind.length() - pressure * 0.5_f32.sqrt()).abs() < 1e-5);
        // C_L sin α cos α, across the wind and towards the normal that points downwind.
        let expected = pressure * 0.8 * 0.5 * Vec3::new(-1.0, 0.0, 1.0).normalize();
        assert!((lift - expected).length() < 1e-5, "{lift} {expected}");
        let (drag, lift) = face(Face { drag: 1.0, lift: 0.8 }).at(Vec3::X);
        assert_eq!((drag, lift), (0.0, Vec3::ZERO), "edge on");
    }

    #[test]
    fn a_filament_feels_only_what_blows_across_it() {
        let mut position = Vectors::default();
        [Vec3::ZERO, Vec3::X * 0.5].into_iter().for_each(|end| position.push(end));
        let push = FilamentPush::of(&([0, 1], Filament { diameter: 0.02, drag: 1.2 }), &position, DENSITY);
        let wind = Vec3::new(5.0, 3.0, 0.0);
        let mut sum = CrossFlow::new(wind);
        sum.add(&push);
        let force = (2.0 * sum.by_mass(1.0, 1.0) * wind.as_dvec3()).as_vec3();
        assert!((force - Vec3::Y * 0.5 * DENSITY * 1.2 * 0.02 * 0.5 * 9.0).length() < 1e-6, "{force}");
    }

    #[test]
    fn what_ends_in_a_particle_leaves_with_it() {
        let mut exposed = Exposed::default();
        exposed.add_faces([[0, 1, 2], [1, 2, 3]], Face { drag: 1.0, lift: 0.0 });
        exposed.add_filaments([[3, 4]], Filament { diameter: 0.1, drag: 1.0 });
        exposed.remove_particle(0);
        assert_eq!((exposed.faces[0].0, exposed.faces[1].0), ([NO_SLOT; 3], [1, 2, 3]));
        exposed.renumber(&[4, 3, 2, 1, 0]);
        assert_eq!((exposed.faces[1].0, exposed.filaments[0].0), ([3, 2, 1], [1, 0]));
        exposed.remove_particle(1);
        assert_eq!((exposed.faces[1].0, exposed.filaments[0].0), ([NO_SLOT; 3], [NO_SLOT; 2]));
    }
}
