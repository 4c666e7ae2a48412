//! What rests: bodies that stay where they are in a pile, and what sleep asks of contacts.

use bevy::math::Vec3A;

use super::memory::ContactMemory;
use super::{ContactCaches, bodies, plane};
use crate::solver::particles::Particles;
use crate::solver::settings::StepSettings;

/// The velocity that is left uncorrected in a resting contact, as a part of what gravity gives in a
/// substep: a settled pile is then checked once a substep and needs no iteration.
const SETTLED_ERROR: f32 = 0.02;

/// The same where things are to fall asleep: what is left of it moves a pile for as long as it lies there.
const STILL_ERROR: f32 = 0.002;

/// Where things are to fall asleep what touches other particles and is slower than this part of what gravity gives in a
/// substep stays where it is, though its contacts slip: else single grains of a pile creep along for minutes.
const CREEPING_SPEED: f32 = 0.1;

/// Number of contacts that, at least, hold a jammed particle: fewer leave it free to slide or roll.
const JAMMING_CONTACTS: u8 = 3;

/// The velocity that is left uncorrected in a resting contact, as a part of what gravity gives in a substep.
pub(super) fn tolerated_error(settings: &StepSettings) -> f32 {
    if settings.sleep.is_some() { STILL_ERROR } else { SETTLED_ERROR }
}

impl ContactCaches {
    /// All pairs of particles that touch or nearly do, and some that are further apart, after a tick with these settings;
    /// `None` where they are to be searched anew.
    pub fn near_pairs(
        &self,
        memory: &ContactMemory,
        particles: &Particles,
        settings: &StepSettings,
    ) -> Option<&[(u32, u32)]> {
        if settings.pair_rules.is_none() { Some(&[]) } else { self.candidates.found_pairs(memory, particles) }
    }

    /// Takes note that nothing was examined: all sleeps.
    pub fn rest(&mut self) {
        self.plane_contacts.clear();
        self.touches.clear();
        self.candidates.groups.clear();
    }

    /// Leaves a particle where it was that others hold from at least three sides, on the ground, and that
    /// is slower than what gravity gives in a substep: it is jammed. Without it the corrections of its
    /// overlaps would keep a pile moving at that speed for ever.
    ///
    /// Where things are to fall asleep so does a loose one that touches others and of which no contact slips, or that creeps,
    /// [`CREEPING_SPEED`]: as if there were static friction of that part of its weight. Overlaps of what is held are left alone
    /// while they are small. And what is wedged between steep contacts is held, too: it would be squeezed through.
    pub(super) fn hold_still(&mut self, resting_speed: f32, falls_asleep: bool) {
        if self.pair_count() == 0 {
            return;
        }
        let creeping_speed = CREEPING_SPEED * resting_speed;
        if falls_asleep {
            for contact in &self.plane_contacts {
                plane::note_slip(contact, &self.surfaces[contact.plane], &mut self.bodies, creeping_speed);
            }
            for touch in &self.touches.all {
                touch.note_slip(&mut self.bodies, creeping_speed);
            }
        }
        bodies::for_each(&mut self.bodies, &self.candidates.regions, |body| {
            let is_explicit = body.inverse_mass > 0.0 && !body.implicit;
            let speed_squared = body.velocity.length_squared();
            let is_borne = if falls_asleep { body.carried } else { body.supported };
            if !is_borne || !is_explicit || speed_squared >= resting_speed * resting_speed {
                return;
            }
            let is_still = !body.slips || speed_squared < creeping_speed * creeping_speed;
            let is_in_pile = body.holds > 0 && body.touching > 0 && !body.sprung;
            let rests = falls_asleep && is_still && is_in_pile;
            if body.holds >= JAMMING_CONTACTS || rests {
                body.velocity = Vec3A::ZERO;
                body.position = body.previous;
                body.held = falls_asleep;
            }
        });
    }
}
