//! Where surfaces that touch stick to each other: what friction remembers from substep to substep, a part of the state.

use bevy::math::{Vec3, Vec3A};

use super::contact::Contact;
use super::pair::Kind;
use super::search::Candidate;

/// How far a pair has slipped from where it sticks.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
pub(in crate::solver::collision) struct Grip {
    kind: Kind,
    /// The corners of the pair.
    slots: [u32; 4],
    /// m.
    slip: Vec3,
}

impl Grip {
    pub(super) fn new(candidate: &Candidate, slip: Vec3A) -> Self {
        Self { kind: candidate.kind, slots: candidate.slots, slip: slip.into() }
    }

    /// Gives its particles other slots; whether all of them are there.
    pub fn renumber(&mut self, new_slot: impl Fn(u32) -> Option<u32>) -> bool {
        self.slots.iter_mut().all(|slot| new_slot(*slot).map(|new| *slot = new).is_some())
    }

    /// Whether a particle has a part in it.
    pub fn is_of(&self, slot: usize) -> bool {
        self.slots.iter().any(|own| *own as usize == slot)
    }
}

/// No further grip.
const NO_GRIP: u32 = u32::MAX;

/// The grips of the substep before, by the first corner of the pair: working memory.
#[derive(Debug, Clone, Default)]
pub(super) struct Grips {
    all: Vec<Grip>,
    /// By slot the last of them, and by grip the one before it.
    last: Vec<u32>,
    before: Vec<u32>,
}

impl Grips {
    /// Takes the grips out of what is `remembered`.
    pub fn take(&mut self, remembered: &mut Vec<Grip>, particles: usize) {
        let Self { all, last, before } = self;
        for slot in all.drain(..).map(|grip| grip.slots[0] as usize) {
            if let Some(last) = last.get_mut(slot) {
                *last = NO_GRIP;
            }
        }
        std::mem::swap(all, remembered);
        last.resize(particles, NO_GRIP);
        before.clear();
        before.extend((0..).zip(&*all).map(|(number, grip)| {
            last.get_mut(grip.slots[0] as usize).map_or(NO_GRIP, |last| std::mem::replace(last, number))
        }));
    }

    /// Has the contacts begin where they stick.
    pub fn recall(&self, contacts: &mut [Contact], candidates: &[Candidate]) {
        if self.all.is_empty() {
            return;
        }
        for contact in contacts.iter_mut().filter(|contact| contact.coefficient > 0.0) {
            let Candidate { kind, slots, .. } = candidates[contact.candidate as usize];
            let mut number = self.last[slots[0] as usize];
            while let Some(grip) = self.all.get(number as usize) {
                if (grip.kind, grip.slots) == (kind, slots) {
                    // The normal has turned a little since.
                    let slip = Vec3A::from(grip.slip);
                    contact.slip = slip - contact.normal * slip.dot(contact.normal);
                    break;
                }
                number = self.before[number as usize];
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn candidate(kind: Kind, slots: [u32; 4]) -> Candidate {
        Candidate { kind, slots, ..Candidate::default() }
    }

    /// How far the contacts of these candidates, with a normal along y, have slipped.
    fn recalled(grips: &Grips, candidates: &[Candidate]) -> Vec<Vec3A> {
        let contact =
            |candidate| Contact { candidate, normal: Vec3A::Y, coefficient: 0.1, ..Contact::default() };
        let mut contacts: Vec<Contact> = (0..candidates.len() as u32).map(contact).collect();
        grips.recall(&mut contacts, candidates);
        contacts.iter().map(|contact| contact.slip).collect()
    }

    #[test]
    fn each_pair_finds_what_is_tangential_of_its_own_slip_once() {
        let pairs = [
            candidate(Kind::EdgeEdge, [1, 2, 3, 4]),
            candidate(Kind::EdgeEdge, [1, 2, 4, 5]),
            candidate(Kind::VertexFace, [1, 2, 3, 4]),
            candidate(Kind::VertexEdge, [0, 2, 3, 3]),
        ];
        let slips = [Vec3A::ONE, Vec3A::X, Vec3A::Y, Vec3A::Z];
        let mut remembered: Vec<Grip> =
            pairs.iter().zip(slips).map(|(pair, slip)| Grip::new(pair, slip)).collect();
        let mut grips = Grips::default();
        grips.take(&mut remembered, 6);
        let expected = [Vec3A::new(1.0, 0.0, 1.0), Vec3A::X, Vec3A::ZERO, Vec3A::Z];
        assert_eq!(recalled(&grips, &pairs), expected);
        remembered.clear();
        grips.take(&mut remembered, 6);
        assert_eq!(recalled(&grips, &pairs), [Vec3A::ZERO; 4]);
        assert!(grips.last.iter().all(|last| *last == NO_GRIP));
    }

    #[test]
    fn a_grip_goes_with_its_particles() {
        let mut grip = Grip::new(&candidate(Kind::EdgeEdge, [1, 2, 3, 4]), Vec3A::X);
        assert!(grip.is_of(4) && !grip.is_of(0));
        assert!(grip.renumber(|old| Some(old + 5)));
        assert_eq!(grip.slots, [6, 7, 8, 9]);
        assert!(!grip.renumber(|old| (old != 8).then_some(old)));
    }
}
