//! What implicit steps remember of their contacts, a part of the state: the next step begins with these forces, so that friction goes by
//! normal forces that have settled, and goes on sticking where it stuck.

use bevy::math::{DVec3, Vec3};

/// In place of a slot where there is none.
const NO_SLOT: u32 = u32::MAX;

/// The cosine of the angle between the normals of one contact in two steps, at least.
const MIN_COSINE: f32 = 0.7;

/// The particles that have a part in a contact.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
pub(in crate::solver) struct ContactEnds {
    /// The slots of those at the point that touches, ascending; [`NO_SLOT`] behind them.
    slots: [u32; 3],
    /// The slot of the other particle that is touched, a greater one; or [`NO_SLOT`].
    other: u32,
}

impl ContactEnds {
    /// A particle, or the corners of an edge or face, and something that is no part of the step.
    pub fn of(slots: impl Iterator<Item = u32>) -> Self {
        let mut own = [NO_SLOT; 3];
        own.iter_mut().zip(slots).for_each(|(own, slot)| *own = slot);
        own.sort_unstable();
        Self { slots: own, other: NO_SLOT }
    }

    /// Two particles, that with the smaller slot first.
    pub fn of_pair([slot, other]: [u32; 2]) -> Self {
        debug_assert!(slot < other, "the normal points to the first one");
        Self { slots: [slot, NO_SLOT, NO_SLOT], other }
    }

    fn all_mut(&mut self) -> impl Iterator<Item = &mut u32> {
        self.slots.iter_mut().chain([&mut self.other]).filter(|slot| **slot != NO_SLOT)
    }

    /// The slots of all of them.
    pub fn slots(&self) -> impl Iterator<Item = usize> {
        let all = self.slots.into_iter().chain([self.other]);
        all.filter(|slot| *slot != NO_SLOT).map(|slot| slot as usize)
    }
}

/// A contact at the end of an implicit step.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
pub(in crate::solver) struct ContactForce {
    pub ends: ContactEnds,
    /// A unit vector away from what is touched.
    pub normal: Vec3,
    /// Along the normal, N, > 0.
    pub force: f32,
    /// Whether friction stuck.
    pub sticks: bool,
}

/// The contacts of the last implicit step, ordered by their particles.
#[derive(Debug, Clone, Default, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
pub(in crate::solver) struct ContactForces(Vec<ContactForce>);

/// Which of the forces with the same ends have been assigned to contacts of the present step.
#[derive(Debug, Clone, Copy, Default)]
pub(in crate::solver) struct Assigned {
    ends: Option<ContactEnds>,
    /// A bit for each of the first 64.
    bits: u64,
}

impl ContactForces {
    /// Among the forces with these ends, the one with the normal closest to this one. Each is found once, if contacts with the same ends are
    /// looked up one after the other.
    pub fn find(&self, ends: ContactEnds, normal: DVec3, assigned: &mut Assigned) -> Option<&ContactForce> {
        if assigned.ends != Some(ends) {
            *assigned = Assigned { ends: Some(ends), bits: 0 };
        }
        let Self(all) = self;
        let first = all.partition_point(|known| known.ends < ends);
        let same = (0..64).zip(&all[first..]).take_while(|(_, known)| known.ends == ends);
        let left = same.filter(|(number, _)| assigned.bits & (1_u64 << number) == 0);
        let with_cosines = left.map(|(number, known)| (known.normal.dot(normal.as_vec3()), number, known));
        let (cosine, number, nearest) = with_cosines.max_by(|(one, ..), (other, ..)| one.total_cmp(other))?;
        if cosine < MIN_COSINE {
            return None;
        }
        assigned.bits |= 1 << number;
        Some(nearest)
    }

    /// Replaces what is known by what was `found` in a step, which is left empty. What sleeps is kept.
    pub fn replace(&mut self, found: &mut Vec<ContactForce>, is_asleep: impl Fn(usize) -> bool) {
        self.keep_asleep(is_asleep);
        self.0.append(found);
        self.sort();
    }

    /// Removes the contacts of a particle.
    pub fn clear_particle(&mut self, slot: usize) {
        self.0.retain(|known| known.ends.slots().all(|own| own != slot));
    }

    /// Gives the particles other slots; contacts of those without one are removed.
    pub fn renumber(&mut self, new_slot: impl Fn(u32) -> Option<u32>) {
        let Self(all) = self;
        all.retain_mut(|ContactForce { ends, normal, .. }| {
            let is_complete = ends.all_mut().all(|slot| new_slot(*slot).map(|new| *slot = new).is_some());
            ends.slots.sort_unstable();
            if ends.other < ends.slots[0] {
                std::mem::swap(&mut ends.other, &mut ends.slots[0]);
                *normal = -*normal;
            }
            is_complete
        });
        self.sort();
    }

    /// Orders them by their ends, and the same ones by what else they are: in place, and whatever order they were found in.
    fn sort(&mut self) {
        let bits = |known: &ContactForce| (known.normal.to_array().map(f32::to_bits), known.force.to_bits());
        self.0.sort_unstable_by_key(|known| (known.ends, bits(known), known.sticks));
    }

    /// Removes those of particles that are awake.
    pub fn keep_asleep(&mut self, is_asleep: impl Fn(usize) -> bool) {
        self.0.retain(|known| is_asleep(known.ends.slots[0] as usize));
    }

    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn contact(ends: ContactEnds, normal: Vec3, force: f32) -> ContactForce {
        ContactForce { ends, normal, force, sticks: false }
    }

    fn known(contacts: &[ContactForce]) -> ContactForces {
        let mut forces = ContactForces::default();
        forces.replace(&mut contacts.to_vec(), |_| false);
        forces
    }

    fn force(
        forces: &ContactForces,
        ends: ContactEnds,
        normal: Vec3,
        assigned: &mut Assigned,
    ) -> Option<f32> {
        forces.find(ends, normal.as_dvec3(), assigned).map(|known| known.force)
    }

    #[test]
    fn each_contact_finds_the_force_with_the_nearest_normal_once() {
        let [one, edge] = [ContactEnds::of([3].into_iter()), ContactEnds::of([5, 3].into_iter())];
        let forces = known(&[
            contact(edge, Vec3::Y, 4.0),
            contact(one, Vec3::Y, 1.0),
            contact(one, Vec3::NEG_Y, 2.0),
            contact(one, Vec3::Y, 3.0),
        ]);
        let mut assigned = Assigned::default();
        assert_eq!(force(&forces, one, Vec3::NEG_Y, &mut assigned), Some(2.0));
        assert_eq!(force(&forces, one, Vec3::NEG_Y, &mut assigned), None);
        let tilted = Vec3::new(0.6, 0.8, 0.0);
        let mut rest = [(); 3].map(|()| force(&forces, one, tilted, &mut assigned));
        rest.sort_by(|one, other| one.partial_cmp(other).unwrap());
        assert_eq!(rest, [None, Some(1.0), Some(3.0)]);
        assert_eq!(force(&forces, ContactEnds::of([3, 5].into_iter()), Vec3::Y, &mut assigned), Some(4.0));
        assert_eq!(force(&forces, ContactEnds::of([4].into_iter()), Vec3::Y, &mut assigned), None);
    }

    #[test]
    fn a_pair_that_is_renumbered_the_other_way_round_turns_its_normal() {
        let mut forces = known(&[
            contact(ContactEnds::of_pair([0, 1]), Vec3::X, 1.0),
            contact(ContactEnds::of([0, 1].into_iter()), Vec3::Y, 2.0),
            contact(ContactEnds::of_pair([0, 2]), Vec3::X, 3.0),
        ]);
        forces.renumber(|old| [Some(7), Some(4), None][old as usize]);
        let expected = known(&[
            contact(ContactEnds::of_pair([4, 7]), Vec3::NEG_X, 1.0),
            contact(ContactEnds::of([4, 7].into_iter()), Vec3::Y, 2.0),
        ]);
        assert_eq!(forces, expected);
    }

    #[test]
    fn what_sleeps_is_kept_and_what_is_put_elsewhere_is_not() {
        let of = |slot, force| contact(ContactEnds::of([slot].into_iter()), Vec3::Y, force);
        let mut forces = known(&[of(1, 1.0), of(2, 2.0)]);
        forces.replace(&mut vec![of(0, 3.0)], |slot| slot == 2);
        assert_eq!(forces, known(&[of(0, 3.0), of(2, 2.0)]));
        forces.clear_particle(0);
        assert_eq!(forces, known(&[of(2, 2.0)]));
        forces.keep_asleep(|_| false);
        assert!(forces.is_empty());
    }
}
