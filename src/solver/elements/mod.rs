//! What pulls: one file a kind, the only file that knows its formula, behind the contract [`Element`].
//!
//! An element acts through one vector, its *separation* s = Σ cᵢ xᵢ over its N ends. The weights cᵢ add up to
//! zero, so that it adds no momentum; its force is along s and depends on ‖s‖ and on the rate of s alone, so
//! that it adds no angular momentum. A spring has two ends and c = (1, −1). With more ends the same contract
//! carries rods that resist bending (1, −2, 1) and the hinges of a cloth.
//!
//! A new kind is one file, and one line in [`for_each_kind`].

#[cfg(test)]
mod bend;
mod spring;
mod table;

use std::fmt::Debug;

use bevy::math::{DVec3, Vec3};

use crate::solver::particles::{Particles, Vectors};
use crate::solver::state::Version;
#[cfg(test)]
pub(super) use bend::Bend;
pub use spring::Spring;
pub(super) use table::Table;

/// What the solver asks of a kind of element with `N` ends.
///
/// All forces are along the separation s = Σ cᵢ xᵢ; end i feels cᵢ times the *pull*.
pub(super) trait Element<const N: usize>: Copy + Default + Debug + Send + Sync + 'static {
    /// The weights c, which add up to 0. Those of an element of two ends are (1, −1).
    fn weights(&self) -> [f32; N];

    /// The pull in N, from s in m and its rate in m/s. Compiled into the vectorised kernel.
    fn pull(&self, separation: Vec3, rate: Vec3) -> Vec3;

    /// The potential energy in J.
    fn energy(&self, separation: DVec3) -> f64;

    /// The same with its damper, as one [`Potential`] of a step of backward Euler of `step` seconds that begins
    /// with the separation `start`.
    fn potential(&self, start: DVec3, step: f64) -> Potential;

    /// Coefficients for the bounds on frequencies, and for position-based dynamics.
    fn rates(&self) -> Rates;

    /// The ‖s‖ without force, m.
    fn rest_length(&self) -> f64;

    /// Whether it exerts any force: an empty place does not.
    fn acts(&self) -> bool {
        let Rates { stiffness, damping } = self.rates();
        stiffness > 0.0 || damping > 0.0
    }

    /// The force along s in N with which it draws its ends together, damper included; negative where it pushes.
    fn tension(&self, separation: DVec3, rate: DVec3) -> f64 {
        let length = separation.length();
        let Rates { stiffness, damping } = self.rates();
        let speed = if length > 0.0 { rate.dot(separation) / length } else { 0.0 };
        f64::from(stiffness) * (length - self.rest_length()) + f64::from(damping) * speed
    }
}

/// The energy ½ k (‖s‖ − r)² of an element and its damper during one step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Potential {
    /// k, N/m.
    pub stiffness: f64,
    /// r, m.
    pub rest_length: f64,
}

/// How strongly an element reacts.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Rates {
    /// The largest second derivative of the energy by s, N/m.
    pub stiffness: f32,
    /// The damping along s, N·s/m.
    pub damping: f32,
}

/// An element that exerts forces, as the graph sees it.
#[derive(Clone, Copy)]
pub(super) struct Acting<'a> {
    /// Its number among the elements of all kinds.
    pub number: u32,
    /// The slots of its ends.
    pub ends: &'a [u32],
    pub weights: &'a [f32],
    pub rates: Rates,
}

/// The kinds of elements, each with the number of its ends: `callback! { name: Kind, N; … }`.
macro_rules! for_each_kind {
    ($callback:ident) => {
        $callback! {
            springs: Spring, 2;
            #[cfg(test)] ties: Bend<2>, 2;
            #[cfg(test)] rods: Bend<3>, 3;
            #[cfg(test)] hinges: Bend<4>, 4;
        }
    };
}
pub(super) use for_each_kind;

/// The largest number of ends of any kind.
pub(super) const MAX_ENDS: usize = if cfg!(test) { 4 } else { 2 };

macro_rules! define_elements {
    ($($(#[$meta:meta])* $kind:ident: $element:ty, $ends:literal;)*) => {
        /// All elements, a table for each kind.
        #[derive(Debug, Clone, Default)]
        #[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
        pub(super) struct Elements {
            $($(#[$meta])* $kind: Table<$element, $ends>,)*
            versions: Versions,
            sorted_particles: usize,
        }

        $($(#[$meta])*
        impl Holds<$element, $ends> for Elements {
            fn table(&self) -> &Table<$element, $ends> {
                &self.$kind
            }

            fn table_mut(&mut self) -> &mut Table<$element, $ends> {
                &mut self.$kind
            }
        })*

        impl Elements {
            /// Calls `visit` for each element that acts, kind by kind: its number, its ends, their weights, and
            /// its coefficients.
            #[inline(always)]
            pub(super) fn for_each_acting(&self, mut visit: impl FnMut(Acting)) {
                let mut first = 0;
                $($(#[$meta])* {
                    self.$kind.for_each_acting(|index, ends, element| {
                        let (weights, rates) = (&Element::weights(element), Element::rates(element));
                        visit(Acting { number: first + index, ends, weights, rates });
                    });
                    first += self.$kind.len() as u32;
                })*
                let _ = first;
            }

            /// Calls `visit` for each element that acts: its energy in J, ‖s‖ and its rest length in m.
            pub(super) fn for_each_energy(&self, position: &Vectors, mut visit: impl FnMut(f64, f64, f64)) {
                $($(#[$meta])* self.$kind.for_each_acting(|_, ends, element| {
                    let separation = combine(ends, element, position);
                    let rest_length = Element::rest_length(element);
                    visit(Element::energy(element, separation), separation.length(), rest_length);
                });)*
            }

            /// Calls `on_element` for each element that acts, with its number and tension in N, and `on_end` for
            /// each of its ends, with the slot and the force there in N.
            pub(super) fn for_each_force(
                &self,
                particles: &Particles,
                mut on_element: impl FnMut(u32, f64),
                mut on_end: impl FnMut(usize, DVec3),
            ) {
                let mut first = 0;
                $($(#[$meta])* {
                    self.$kind.for_each_acting(|index, ends, element| {
                        let separation = combine(ends, element, &particles.position);
                        let rate = combine(ends, element, &particles.velocity);
                        let tension = Element::tension(element, separation, rate);
                        let pull = separation.normalize_or_zero() * -tension;
                        on_element(first + index, tension);
                        for (end, weight) in ends.iter().zip(Element::weights(element)) {
                            on_end(*end as usize, pull * f64::from(weight));
                        }
                    });
                    first += self.$kind.len() as u32;
                })*
                let _ = first;
            }

            /// See [`Element::potential`].
            #[inline]
            pub(super) fn potential(&self, number: u32, start: DVec3, step: f64) -> Potential {
                let mut number = number as usize;
                $($(#[$meta])* {
                    if let Some(element) = self.$kind.element(number) {
                        return Element::potential(element, start, step);
                    }
                    number -= self.$kind.len();
                })*
                unreachable!("element {number} beyond the last one")
            }

            /// See [`Element::rates`], [`Element::rest_length`].
            #[inline]
            pub(super) fn coefficients(&self, number: u32) -> (Rates, f64) {
                let mut number = number as usize;
                $($(#[$meta])* {
                    if let Some(element) = self.$kind.element(number) {
                        return (Element::rates(element), Element::rest_length(element));
                    }
                    number -= self.$kind.len();
                })*
                unreachable!("element {number} beyond the last one")
            }

            /// The weights of an element, as many as it has ends.
            #[inline]
            pub(super) fn weights(&self, number: u32) -> [f64; MAX_ENDS] {
                let mut number = number as usize;
                let mut weights = [0.0; MAX_ENDS];
                $($(#[$meta])* {
                    if let Some(element) = self.$kind.element(number) {
                        let own = Element::weights(element).map(f64::from);
                        weights[..own.len()].copy_from_slice(&own);
                        return weights;
                    }
                    number -= self.$kind.len();
                })*
                unreachable!("element {number} beyond the last one")
            }

            /// The number of elements of all kinds, empty places included.
            pub(super) fn len(&self) -> usize {
                let mut sum = 0;
                $($(#[$meta])* { sum += self.$kind.len(); })*
                sum
            }

            /// Renames the particles: `new_slots[old]` is the new slot of each.
            pub fn renumber(&mut self, new_slots: &[u32]) {
                $($(#[$meta])* self.$kind.renumber(new_slots);)*
                self.versions.reset();
            }

            /// Has the elements sorted anew, if too many of them or of the particles came since they were last.
            ///
            /// Which ones are sorted is part of the state, since forces are summed in that order.
            pub(super) fn settle(&mut self, inverse_mass: &[f32]) {
                let particles = inverse_mass.len();
                let added = particles.abs_diff(self.sorted_particles);
                let mut is_settled = added * MAX_UNSORTED <= self.sorted_particles;
                $($(#[$meta])* { is_settled &= self.$kind.is_settled(); })*
                if !is_settled {
                    self.sorted_particles = particles;
                    $($(#[$meta])* self.$kind.settle(inverse_mass);)*
                    self.versions.reset();
                }
            }

            /// Starts a new list of what has changed: the caches know all that is in the old one.
            pub(super) fn reset_edits(&mut self) {
                $($(#[$meta])* self.$kind.reset_edits();)*
                self.versions.edited_since = self.versions.all;
            }
        }
    };
}
for_each_kind!(define_elements);

/// One in this number of elements, or particles, may be unsorted; see [`Table::sorted`].
const MAX_UNSORTED: usize = 8;

/// Elements of the same version are the same, in some respect.
#[derive(Debug, Clone, Copy, Default)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
struct Versions {
    /// In all.
    all: Version,
    /// In their ends and coefficients.
    rates: Version,
    /// In their ends, and whether they act.
    ends: Version,
    /// What has changed since this version is listed.
    edited_since: Version,
}

impl Versions {
    /// Everything may be other than before.
    fn reset(&mut self) {
        let new = Version::new();
        *self = Self { all: new, rates: new, ends: new, edited_since: new };
    }
}

/// A collection that has a table of this kind.
pub(super) trait Holds<E, const N: usize> {
    fn table(&self) -> &Table<E, N>;
    fn table_mut(&mut self) -> &mut Table<E, N>;
}

impl Elements {
    /// Appends an element between different slots; its index in its table.
    pub fn push<E: Element<N>, const N: usize>(&mut self, ends: [u32; N], element: E) -> usize
    where
        Self: Holds<E, N>,
    {
        let new = Version::new();
        self.versions = Versions { all: new, rates: new, ends: new, ..self.versions };
        self.table_mut().push(ends, element)
    }

    /// Replaces the parameters of an element.
    pub fn set<E: Element<N>, const N: usize>(&mut self, index: usize, element: E)
    where
        Self: Holds<E, N>,
    {
        let old = self.table_mut().set(index, element);
        self.versions.all = Version::new();
        if old.rates() != element.rates() {
            self.versions.rates = self.versions.all;
        }
        if old.acts() != element.acts() {
            self.versions.ends = self.versions.all;
        }
    }

    /// Empties the place of an element. It leaves all that is derived from the elements at once.
    pub fn remove<E: Element<N>, const N: usize>(&mut self, index: usize)
    where
        Self: Holds<E, N>,
    {
        self.set(index, E::default());
    }

    /// Removes all elements.
    pub fn clear(&mut self) {
        *self = Self::default();
        self.versions.reset();
    }

    /// Number of particles when the tables were sorted last.
    pub(super) fn sorted_particles(&self) -> usize {
        self.sorted_particles
    }

    /// The springs.
    pub(super) fn springs(&self) -> &Table<Spring, 2> {
        &self.springs
    }

    /// Changes whenever an element does.
    pub(super) fn version(&self) -> Version {
        self.versions.all
    }

    /// Changes whenever ends or coefficients do.
    pub(super) fn rates_version(&self) -> Version {
        self.versions.rates
    }

    /// Changes when elements get other ends, begin or cease to act.
    pub(super) fn ends_version(&self) -> Version {
        self.versions.ends
    }

    /// Whether the tables list what has changed since `version`, apart from added elements.
    pub(super) fn lists_edits_since(&self, version: Version) -> bool {
        self.versions.edited_since == version
    }
}

/// Σ cᵢ vᵢ over the ends of an element.
fn combine<E: Element<N>, const N: usize>(ends: &[u32; N], element: &E, vectors: &Vectors) -> DVec3 {
    let weighted = |(end, weight): (&u32, f32)| vectors.get(*end as usize).as_dvec3() * f64::from(weight);
    ends.iter().zip(element.weights()).map(weighted).sum()
}
