//! In which order the contacts of a substep are solved: velocities, then positions.

use super::{ContactCaches, pairs, plane, touch};
use crate::solver::settings::PairRules;

/// Number of iterations over the velocities of all contacts in each substep, at most.
const VELOCITY_ITERATIONS: usize = 3;

/// Number of iterations over their positions.
pub(super) const POSITION_ITERATIONS: usize = 2;

/// What contacts of edges and faces may leave uncorrected, as a part of what gravity gives in a substep: they begin with what was
/// enough in the one before, so that what rests needs one iteration.
pub(super) const COUPLED_ERROR: f32 = 0.05;

/// Crowds that no motion has brought about, as where many are spawned in one place, come apart without any velocity:
/// in one, all overlaps of a particle together displace it by about this part of the sum of two radii in a second
/// (1/s). Approaches in the same substep, and overlaps with few others, are undone at once.
const RECOVERY_RATE: f32 = 10.0;

impl ContactCaches {
    /// Solves the velocities, until what is left to correct is less than the `tolerance` of pairs, and that of points of nets, m/s.
    pub(super) fn solve_velocities(
        &mut self,
        (rules, falls_asleep): (PairRules, bool),
        [tolerance, coupled_tolerance]: [f32; 2],
        reach: f32,
    ) {
        let pairs = self.pair_count() > 0;
        if pairs {
            let Self { pair_contacts, candidates, bodies, .. } = self;
            pairs::warm_start(pair_contacts, &mut candidates.groups, bodies);
            for _ in 0..VELOCITY_ITERATIONS {
                // The planes come first: else a ball that its load presses into a plane seems to part from it.
                self.solve_plane_velocities(false);
                let Self { pair_contacts, candidates, bodies, .. } = self;
                let groups = &mut candidates.groups;
                if !pairs::solve_velocities(pair_contacts, groups, rules, bodies, tolerance) {
                    break;
                }
            }
        }
        // Contacts of one particle each are solved by the first.
        let are_coupled = touch::are_coupled(&self.touches.all);
        let iterations = if are_coupled { VELOCITY_ITERATIONS } else { 1 };
        let takes_back = self.takes_back();
        if takes_back {
            self.touches.all.iter_mut().for_each(|touch| touch.start_velocity(&mut self.bodies));
        }
        for _ in 0..iterations {
            if self.solve_plane_velocities(takes_back) <= coupled_tolerance {
                break;
            }
        }
        if pairs {
            let Self { pair_contacts, candidates, bodies, .. } = self;
            let friction = falls_asleep.then_some(rules);
            pairs::finish_velocities(pair_contacts, &mut candidates.groups, bodies, (friction, reach));
        }
    }

    /// Gives the contacts with colliders what they did in the substep before, if they take it back.
    pub(super) fn recall_touches(&mut self) {
        if self.takes_back() {
            touch::recall(&mut self.touches.all, &self.touches.last);
        }
    }

    /// Whether contacts with colliders take back what they have given too much: not where loose balls touch, as what is at the
    /// bottom of a pile must not give way.
    pub(super) fn takes_back(&self) -> bool {
        self.pair_count() == 0 && touch::are_coupled(&self.touches.all)
    }

    /// Those of the contacts with colliders; the largest change of that of a point of a net, m/s.
    fn solve_plane_velocities(&mut self, takes_back: bool) -> f32 {
        for contact in &mut self.plane_contacts {
            plane::solve_velocity(contact, &self.surfaces[contact.plane], &mut self.bodies);
        }
        let each = self.touches.all.iter_mut();
        each.map(|touch| touch.solve_velocity(&mut self.bodies, takes_back)).fold(0.0, f32::max)
    }

    /// Solves the positions at the end of a substep of `substep` seconds; those of contacts with colliders may have begun in a round.
    pub(super) fn solve_positions(&mut self, rules: PairRules, substep: f32, has_begun: bool) {
        let takes_back = self.takes_back();
        let Self { pair_contacts, plane_contacts, touches, candidates, surfaces, bodies, .. } = self;
        let recovery = RECOVERY_RATE * substep / POSITION_ITERATIONS as f32;
        if takes_back && !has_begun {
            touches.all.iter_mut().for_each(|touch| touch.start_position(bodies));
        }
        for _ in 0..POSITION_ITERATIONS {
            pairs::solve_positions(pair_contacts, &mut candidates.groups, rules, bodies, recovery);
            for contact in &*plane_contacts {
                plane::solve_position(contact, &surfaces[contact.plane], bodies, substep);
            }
            touches
                .all
                .iter_mut()
                .for_each(|touch| touch.solve_position(bodies, substep, [takes_back, false]));
        }
        touches.last.clear();
        if takes_back {
            touches.last.extend(touches.all.iter().map(|touch| (touch.key, touch.accumulated)));
        }
    }
}
