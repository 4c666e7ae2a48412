//! Colliders that are no half-spaces, in the course of a tick.

use super::collider::{Collider, Placed};
use super::feature_search::Surroundings;
use super::features::Feature;
use super::guard::GuardContext;
use super::material::ContactProperties;
use super::touch_search::Search;
use super::{ContactCaches, ContactMemory, Substep};
use crate::solver::elements::{CollisionMesh, Elements};
use crate::solver::particles::{Particles, Vectors};
use crate::solver::settings::StepSettings;
use crate::solver::state::Version;

impl ContactCaches {
    /// To be called when a tick begins.
    pub fn begin_tick(
        &mut self,
        memory: &mut ContactMemory,
        colliders: &[Collider],
        (mesh, elements): (&CollisionMesh, &Elements),
        (settings, particle_count): (&StepSettings, usize),
    ) {
        let colliders = if settings.collide_with_colliders { colliders } else { &[] };
        self.is_active = settings.pair_rules.is_some() || !colliders.is_empty();
        if !self.is_active {
            self.clear(memory, particle_count);
        }
        self.placed.begin_tick(colliders, settings.time_step);
        self.touches.last.clear();
        if !self.placed.is_empty() {
            self.features.refresh(mesh, elements, settings.collide_springs);
            self.feature_search.begin_tick();
            self.guard.begin_tick();
        }
    }

    /// Removes all contacts.
    fn clear(&mut self, memory: &mut ContactMemory, particle_count: usize) {
        self.candidates.disable(memory, particle_count);
        self.plane_contacts.clear();
        self.surfaces.clear();
        self.touches.clear();
        self.have_moved = false;
    }

    /// The edges and triangles of nets that collide, and their version.
    pub fn features(&self) -> (&[Feature], Version) {
        (self.features.all(), self.features.version())
    }

    /// Finds what touches them, and puts back what would have passed through one.
    pub(super) fn find_touches(&mut self, particles: &mut Particles, substep: Substep, senses: bool) {
        let Self { placed, touches, features, feature_search, previous, is_implicit, .. } = self;
        if placed.is_empty() {
            touches.clear();
            return;
        }
        let Substep { colliders, settings, duration, elapsed, .. } = substep;
        let before = elapsed - duration / settings.time_step;
        placed.begin_substep(colliders, [before, elapsed], settings.time_step);
        touches.find(search(substep, placed, particles, (previous, is_implicit), senses));
        touches.put_back(particles);
        let search = search(substep, placed, particles, (previous, is_implicit), senses);
        feature_search.find(features.all(), search, &mut touches.all);
        self.guard.begin_substep();
    }

    /// Stops what of nets would pass through one in this substep, whatever has moved it; whether there was any.
    pub fn stop_at_colliders(
        &mut self,
        particles: &mut Particles,
        (colliders, properties): (&[Collider], &[ContactProperties]),
        resting_speed: f32,
    ) -> bool {
        let Self { placed, features, feature_search, previous, guard, .. } = self;
        if placed.is_empty() {
            return false;
        }
        let surroundings = Surroundings { colliders, placed, properties, previous };
        let context = GuardContext { features: features.all(), surroundings, resting_speed };
        guard.stop(context, feature_search, particles)
    }

    /// Whether any collider moves.
    pub fn any_moving(&self) -> bool {
        self.placed.moving().next().is_some()
    }

    /// The particles that were stopped in the last substep, some more than once.
    pub fn stopped_at_colliders(&self) -> &[u32] {
        if self.placed.is_empty() { &[] } else { self.guard.stopped() }
    }
}

fn search<'a>(
    substep: Substep<'a>,
    placed: &'a Placed,
    particles: &'a Particles,
    (previous, is_implicit): (&'a Vectors, &'a [bool]),
    senses: bool,
) -> Search<'a> {
    let Substep { colliders, properties, acceleration, .. } = substep;
    let rebound = substep.rebound();
    Search { colliders, placed, particles, previous, acceleration, properties, is_implicit, rebound, senses }
}
