//! Pinned particles and colliders: their motions and changes wake what they touch.

use crate::solver::collision::{Collider, ContactProperties, Layers, Presence, properties_of};
use crate::solver::particles::PinnedMotion;
use crate::solver::settings::StepSettings;

use super::memory::SleepMemory;
use super::{SleepCaches, Sleepers, touching_gap};

/// By how much of its longest side a point of an edge or a triangle is away from the nearest corner, at most: 1/2 along an
/// edge, 1/√3 in a triangle.
const REACH_OF_SIDE: f32 = 0.578;

/// What a tick has of them.
#[derive(Clone, Copy)]
pub(in crate::solver) struct Surroundings<'a> {
    pub motions: &'a [PinnedMotion],
    pub colliders: &'a [Collider],
    pub properties: &'a [ContactProperties],
}

impl Surroundings<'_> {
    /// The motions of pinned particles that do not stay where they are.
    pub fn moving(&self) -> impl Iterator<Item = &PinnedMotion> {
        self.motions.iter().filter(|motion| motion.start != motion.target)
    }

    /// The layers of a particle.
    pub fn layers(&self, slot: usize) -> Layers {
        properties_of(self.properties, slot).layers
    }
}

impl SleepMemory {
    /// Marks the particles with other contact properties than in the last tick as disturbed.
    pub(super) fn disturb_changed_properties(&mut self, properties: &[ContactProperties]) {
        if self.properties == properties {
            return;
        }
        let changes =
            |slot: &usize| properties_of(&self.properties, *slot) != properties_of(properties, *slot);
        let changed = (0..self.properties.len().max(properties.len())).filter(changes);
        self.disturbed.extend(changed.map(|slot| slot as u32));
        self.properties.clear();
        self.properties.extend_from_slice(properties);
    }

    /// Keeps what there is to compare colliders with in the next tick.
    pub(super) fn keep_colliders(&mut self, colliders: &[Collider]) {
        self.colliders.truncate(colliders.len());
        for (known, collider) in self.colliders.iter_mut().zip(colliders) {
            if collider.moves() || !known.goes_on_as(collider) {
                *known = Presence::of(collider);
            }
        }
        let known = self.colliders.len();
        self.colliders.extend(colliders[known..].iter().map(Presence::of));
    }
}

impl SleepCaches {
    /// Finds sleepers that touch colliders which move, are others than in the last tick, or are gone.
    pub(super) fn find_on_colliders(
        &mut self,
        sleepers: &Sleepers,
        around: Surroundings,
        settings: &StepSettings,
    ) {
        let known = &sleepers.memory.colliders;
        if !settings.collide_with_colliders {
            return;
        }
        let stays = |(past, present): (&Presence, &Collider)| !present.moves() && past.goes_on_as(present);
        // Where one was added or removed, the others are compared from both ends.
        let (past, present) = (&known[..], around.colliders);
        let first = past.iter().zip(present).take_while(|pair| stays(*pair)).count();
        let (past, present) = (&past[first..], &present[first..]);
        let last = match past.len() == present.len() {
            true => 0,
            false => past.iter().rev().zip(present.iter().rev()).take_while(|pair| stays(*pair)).count(),
        };
        let (past, present) = (&past[..past.len() - last], &present[..present.len() - last]);
        if past.is_empty() && present.is_empty() {
            return;
        }
        self.refresh_reaches(sleepers, settings);
        for number in 0..past.len().max(present.len()) {
            let (past, present) = (past.get(number), present.get(number));
            if let (Some(past), Some(present)) = (past, present)
                && stays((past, present))
            {
                continue;
            }
            let goes_on = past.zip(present).is_some_and(|(past, present)| past.goes_on_as(present));
            if let Some(past) = past.filter(|_| !goes_on) {
                self.wake_near(sleepers, around, |place, reach, layers| past.was_near(place, reach, layers));
            }
            if let Some(present) = present {
                self.wake_near(sleepers, around, present.nearness());
            }
        }
    }

    /// Has the sleepers woken that are near a collider.
    fn wake_near(
        &mut self,
        Sleepers { memory, particles, .. }: &Sleepers,
        around: Surroundings,
        is_near: impl Fn(bevy::math::Vec3, f32, Layers) -> bool,
    ) {
        let Self { waking, reaches, .. } = self;
        for slot in (0..particles.len()).filter(|slot| memory.group[*slot] != 0) {
            if is_near(particles.position.get(slot), reaches[slot], around.layers(slot)) {
                waking.push((memory.group[slot], 0.0));
            }
        }
    }

    /// Keeps the parts awake that touch colliders which move, or move them along.
    pub(super) fn keep_carried_awake(
        &mut self,
        sleepers: &Sleepers,
        around: Surroundings,
        settings: &StepSettings,
    ) {
        let any = around.colliders.iter().any(Collider::carries);
        if !any || !settings.collide_with_colliders {
            return;
        }
        self.refresh_reaches(sleepers, settings);
        let Self { parts, stays, reaches, .. } = self;
        for collider in around.colliders.iter().filter(|collider| collider.carries()) {
            let is_near = collider.nearness();
            for (slot, reach) in reaches.iter().enumerate() {
                let Some(part) = parts.of(slot).filter(|part| !stays[*part]) else { continue };
                let place = sleepers.particles.position.get(slot);
                stays[part] = is_near(place, *reach, around.layers(slot));
            }
        }
    }

    /// Finds how far from each particle something of it may touch a collider, m: its surface, or an edge or triangle of which
    /// it is the nearest corner.
    fn refresh_reaches(&mut self, sleepers: &Sleepers, settings: &StepSettings) {
        let Sleepers { particles, elements, mesh, .. } = sleepers;
        let Self { reaches, .. } = self;
        reaches.clear();
        reaches.resize(particles.len(), 0.0_f32);
        let mut widen = |ends: &[u32]| {
            for (place, one) in ends.iter().enumerate() {
                for other in &ends[..place] {
                    let [one, other] = [*one, *other].map(|slot| slot as usize);
                    let side = particles.position.get(one).distance(particles.position.get(other));
                    ends.iter().for_each(|end| {
                        let reach = &mut reaches[*end as usize];
                        *reach = reach.max(REACH_OF_SIDE * side);
                    });
                }
            }
        };
        mesh.present_edges(elements, settings.collide_springs).for_each(|(ends, _)| widen(&ends));
        mesh.present_triangles().for_each(|corners| widen(&corners));
        let gap = touching_gap(settings);
        reaches.iter_mut().zip(particles.radius()).for_each(|(reach, radius)| *reach += radius + gap);
    }
}
