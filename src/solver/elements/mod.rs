//! Elements exert forces between particles: one file a kind, the only file with its formula, behind the trait [`Element`].
//!
//! An element acts through one vector, its *separation* s = Σ cᵢ xᵢ over its N ends. The weights cᵢ add up to
//! zero, so that it adds no momentum; its force is along s and depends on ‖s‖ and on the rate of s alone, so
//! that it adds no angular momentum. A spring has two ends and c = (1, −1). With more ends the same contract
//! carries rods that resist bending (1, −2, 1) and the hinges of a cloth.
//!
//! A new kind is one file, and one line in [`for_each_kind`]: `sling.rs` shows it.

mod air;
mod balance;
mod bend;
mod bulk;
mod edits;
mod element;
mod failure;
mod gas;
mod mesh;
#[cfg(test)]
pub(super) mod sling;
mod spring;
mod table;
mod versions;

use bevy::math::DVec3;

use crate::solver::particles::{Particles, Vectors};
use crate::solver::state::Version;
pub(super) use air::{CrossFlow, Exposed, FacePush, FilamentPush, Push};
pub use air::{Face, Filament};
pub(super) use balance::{Balance, MAX_ULPS};
pub use bend::Bend;
pub(super) use element::{Element, Potential, Rates};
pub use failure::Plasticity;
pub(super) use failure::Release;
pub(super) use gas::{Enclosure, Gases};
pub use gas::{Gas, GasReading, enclosed_volume};
pub(super) use mesh::{CollisionEdge, CollisionMesh, NO_SPRING, edges_of};
pub use spring::Spring;
pub(super) use table::{Ramp, Table};
use versions::Versions;

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
            springs: crate::solver::elements::Spring, 2;
            rods: crate::solver::elements::Bend<3>, 3;
            hinges: crate::solver::elements::Bend<4>, 4;
            #[cfg(test)] slings: crate::solver::elements::sling::Sling, 3;
        }
    };
}
pub(super) use for_each_kind;

/// The kinds of them that are bends, which the kernel takes in runs: `callback! { name: N; … }`.
macro_rules! for_each_bend {
    ($callback:ident) => {
        $callback! {
            rods: 3;
            hinges: 4;
        }
    };
}
pub(super) use for_each_bend;

/// The largest number of ends of any kind.
pub(super) const MAX_ENDS: usize = 4;

macro_rules! define_elements {
    ($($(#[$meta:meta])* $kind:ident: $element:ty, $ends:literal;)*) => {
        /// All elements, a table for each kind.
        #[derive(Debug, Clone, Default)]
        #[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
        pub(super) struct Elements {
            $($(#[$meta])* $kind: Table<$element, $ends>,)*
            /// What they enclose: not of the kinds, as each acts on many particles.
            gases: Gases,
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
                    let mut ramps = self.$kind.ramps().iter().peekable();
                    self.$kind.for_each_acting(|index, ends, element| {
                        let (weights, mut rates) = (&Element::weights(element), Element::rates(element));
                        if let Some(ramp) = ramps.next_if(|ramp| ramp.index == index) {
                            rates = ramp.largest_rates();
                        }
                        visit(Acting { number: first + index, ends, weights, rates });
                    });
                    first += self.$kind.len() as u32;
                })*
                let _ = first;
            }

            /// Calls `visit` with the ends of each element that acts, kind by kind.
            #[inline(always)]
            pub(super) fn for_each_acting_ends(&self, mut visit: impl FnMut(&[u32])) {
                $($(#[$meta])* self.$kind.for_each_acting(|_, ends, _| visit(ends));)*
            }

            /// Calls `visit` with the ends of each element that is sorted and not anchored, see
            /// [`Table::sorted`].
            pub(super) fn for_each_sorted(&self, mut visit: impl FnMut(&[u32])) {
                $($(#[$meta])* {
                    let ends = self.$kind.all_ends()[..self.$kind.sorted()].iter().enumerate();
                    let loose = ends.filter(|(index, _)| !self.$kind.is_anchored(*index));
                    loose.for_each(|(_, ends)| visit(ends));
                })*
            }

            /// Calls `visit` for each element that acts: its energy in J.
            pub(super) fn for_each_energy(&self, position: &Vectors, mut visit: impl FnMut(f64)) {
                $($(#[$meta])* self.$kind.for_each_acting(|_, ends, element| {
                    visit(Element::energy(element, combine(ends, element, position)));
                });)*
            }

            /// Calls `on_element` for each element that acts, with its number and tension in N, and `on_end` for
            /// each of its ends, with the slot and the force there in N. The tension that `on_element` returns is
            /// taken: the rounded positions may be too coarse to tell it.
            pub(super) fn for_each_force(
                &self,
                particles: &Particles,
                mut on_element: impl FnMut(u32, f64) -> f64,
                mut on_end: impl FnMut(usize, DVec3),
            ) {
                let mut first = 0;
                $($(#[$meta])* {
                    self.$kind.for_each_acting(|index, ends, element| {
                        let separation = combine(ends, element, &particles.position);
                        let rate = combine(ends, element, &particles.velocity);
                        let tension = Element::tension(element, separation, rate);
                        let tension = on_element(first + index, tension);
                        let pull = separation.normalize_or_zero() * -tension;
                        for (end, weight) in ends.iter().zip(Element::weights(element)) {
                            on_end(*end as usize, pull * f64::from(weight));
                        }
                    });
                    first += self.$kind.len() as u32;
                })*
                let _ = first;
            }

            /// Calls `on_end` with the slot of each end of the dampers between particles, some of which are `wanted`, that
            /// move at `velocity` in m/s, and the force there in N. Of what only pulls as if it were taut.
            pub(super) fn for_each_damping(
                &self,
                position: &Vectors,
                wanted: impl Fn(usize) -> bool,
                velocity: impl Fn(usize) -> DVec3,
                mut on_end: impl FnMut(usize, DVec3),
            ) {
                $($(#[$meta])* self.$kind.for_each_acting(|_, ends, element| {
                    let damping = f64::from(Element::rates(element).damping);
                    if damping == 0.0 || !ends.iter().any(|end| wanted(*end as usize)) {
                        return;
                    }
                    let weights = Element::weights(element).map(f64::from);
                    let along = combine(ends, element, position).normalize_or_zero();
                    let rate: DVec3 = ends.iter().zip(weights).map(|(end, weight)| velocity(*end as usize) * weight).sum();
                    let pull = along * (-damping * rate.dot(along));
                    ends.iter().zip(weights).for_each(|(end, weight)| on_end(*end as usize, pull * weight));
                });)*
            }

            /// See [`Element::potential`].
            #[inline]
            pub(super) fn potential(&self, number: u32, start: f64, step: f64) -> Potential {
                let mut number = number as usize;
                $($(#[$meta])* {
                    if let Some(element) = self.$kind.element(number) {
                        return Element::potential(element, start, step);
                    }
                    number -= self.$kind.len();
                })*
                unreachable!("element {number} beyond the last one")
            }

            /// See [`Element::rates`], [`Element::rest_length`], [`Element::tension_only`].
            #[inline]
            pub(super) fn coefficients(&self, number: u32) -> (Rates, f64, bool) {
                let mut number = number as usize;
                $($(#[$meta])* {
                    if let Some(element) = self.$kind.element(number) {
                        let (rates, rest_length) = (Element::rates(element), Element::rest_length(element));
                        return (rates, rest_length, Element::tension_only(element));
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
                self.gases.renumber(new_slots);
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

            /// Makes a ramp over the tick of what was changed since the last one. To be called before the plan of a
            /// tick is made; again changes nothing.
            pub(super) fn begin_ramps(&mut self) {
                $($(#[$meta])* self.$kind.begin_ramps();)*
            }

            /// Whether anything goes from one value to another in this tick.
            pub(super) fn any_ramps(&self) -> bool {
                let mut any = false;
                $($(#[$meta])* { any |= !self.$kind.ramps().is_empty(); })*
                any
            }

            /// Whether the parameters of an element change in this tick. To be called between `begin_ramps` and
            /// `end_ramps`.
            pub(super) fn is_on_ramp(&self, number: u32) -> bool {
                let mut number = number as usize;
                $($(#[$meta])* {
                    if number < self.$kind.len() {
                        let ramps = self.$kind.ramps();
                        return ramps.binary_search_by_key(&(number as u32), |ramp| ramp.index).is_ok();
                    }
                    number -= self.$kind.len();
                })*
                let _ = number;
                false
            }

            /// Gives the elements on ramps the parameters that they have when `share` of the tick is done. No
            /// version changes: caches handle ramps by themselves.
            pub(super) fn ramp_to(&mut self, share: f32) {
                $($(#[$meta])* self.$kind.ramp_to(share);)*
            }

            /// Removes the ramps, after a tick.
            pub(super) fn end_ramps(&mut self) {
                let mut any = false;
                $($(#[$meta])* { any |= self.$kind.end_ramps(); })*
                if any {
                    self.versions.rates = Version::new();
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

/// A collection that has a table of this kind.
pub(super) trait Holds<E, const N: usize> {
    fn table(&self) -> &Table<E, N>;
    fn table_mut(&mut self) -> &mut Table<E, N>;
}

impl Elements {
    /// Calls `visit` for each spring that acts: its length and its rest length in m.
    pub(super) fn for_each_spring(&self, position: &Vectors, mut visit: impl FnMut(f64, f64)) {
        self.springs.for_each_acting(|_, ends, spring| {
            visit(combine(ends, spring, position).length(), Element::rest_length(spring));
        });
    }

    /// Number of particles when the tables were sorted last.
    pub(super) fn sorted_particles(&self) -> usize {
        self.sorted_particles
    }

    /// The springs.
    pub(super) fn springs(&self) -> &Table<Spring, 2> {
        &self.springs
    }
}

/// Σ cᵢ vᵢ over the ends of an element.
fn combine<E: Element<N>, const N: usize>(ends: &[u32; N], element: &E, vectors: &Vectors) -> DVec3 {
    let weighted = |(end, weight): (&u32, f32)| vectors.get(*end as usize).as_dvec3() * f64::from(weight);
    ends.iter().zip(element.weights()).map(weighted).sum()
}
