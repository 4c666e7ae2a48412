//! From a scene to entities and resources.

use bevy::ecs::lifecycle::HookContext;
use bevy::ecs::world::DeferredWorld;
use bevy::math::{DQuat, DVec3};
use bevy::prelude::*;

use super::description::{MassSpringScene, ScenePlane};
use crate::bend::Bend;
use crate::collider::PlaneCollider;
use crate::particle::{Particle, ParticleVelocity, Pinned};
use crate::settings::SolverSettings;
use crate::spring::Spring;

/// The entities of a scene, in the order of the file.
///
/// As a component (a [`MassSpringSceneRoot`](super::MassSpringSceneRoot) gets it once its scene is
/// spawned) it owns them: they are despawned when it is removed, or its entity despawned.
#[derive(Component, Reflect, Debug, Clone, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[reflect(Component, Default, Debug, Clone, PartialEq, Serialize, Deserialize)]
#[component(on_remove = despawn_owned, clone_behavior = Ignore)]
#[non_exhaustive]
pub struct SpawnedScene {
    /// The particles.
    pub particles: Vec<Entity>,
    /// The springs.
    pub springs: Vec<Entity>,
    /// The bends.
    pub bends: Vec<Entity>,
    /// The planes.
    pub planes: Vec<Entity>,
}

impl SpawnedScene {
    /// All entities: particles, springs, bends, planes.
    pub fn iter(&self) -> impl Iterator<Item = Entity> + '_ {
        self.particles.iter().chain(&self.springs).chain(&self.bends).chain(&self.planes).copied()
    }
}

fn despawn_owned(mut world: DeferredWorld, context: HookContext) {
    let Some(spawned) =
        world.get_mut::<SpawnedScene>(context.entity).map(|mut owned| std::mem::take(&mut *owned))
    else {
        return;
    };
    let mut commands = world.commands();
    for entity in spawned.iter() {
        // The game may have despawned some of them itself.
        if let Ok(mut entity) = commands.get_entity(entity) {
            entity.try_despawn();
        }
    }
}

impl MassSpringScene {
    /// Spawns particles, springs, bends and planes as ordinary entities in world space. The settings of the
    /// scene are left to [`apply_settings`](Self::apply_settings).
    ///
    /// In a scene that was not [validated](Self::validate), a spring or bend to a particle that is not there
    /// gets [`Entity::PLACEHOLDER`] as that end, which the simulation leaves out with a warning.
    pub fn spawn(&self, commands: &mut Commands) -> SpawnedScene {
        let particles: Vec<Entity> = self
            .particles
            .iter()
            .map(|particle| {
                let mut entity = commands.spawn((
                    Particle::new(particle.mass, particle.radius),
                    ParticleVelocity(particle.velocity),
                    Transform::from_translation(particle.position),
                ));
                if particle.pinned {
                    entity.insert(Pinned);
                }
                entity.id()
            })
            .collect();
        let end = |index: usize| particles.get(index).copied().unwrap_or(Entity::PLACEHOLDER);
        let springs = self
            .springs
            .iter()
            .map(|spring| {
                let component = Spring {
                    particles: [end(spring.particles.0), end(spring.particles.1)],
                    rest_length: self.rest_length(spring).unwrap_or_default(),
                    stiffness: spring.stiffness,
                    damping: spring.damping,
                    tension_only: spring.tension_only,
                    max_stretch: spring.max_stretch,
                    breaking_force: spring.breaking_force,
                    plasticity: None,
                };
                commands.spawn(component).id()
            })
            .collect();
        let bends = self
            .bends
            .iter()
            .map(|&super::SceneBend { particles: (first, middle, last), stiffness, damping }| {
                commands.spawn(Bend { particles: [first, middle, last].map(end), stiffness, damping }).id()
            })
            .collect();
        let planes = self.planes.iter().map(|plane| commands.spawn(plane.bundle()).id()).collect();
        SpawnedScene { particles, springs, bends, planes }
    }

    /// Sets [`Environment`](crate::Environment), [`SolverSettings`] and
    /// [`CollisionSettings`](crate::CollisionSettings) to those of the scene, and
    /// the time step of `Time<Fixed>`.
    ///
    /// `Time<Virtual>` cuts long frames: where its limit is shorter than the time step, no frame would
    /// hold a whole tick, so the limit is raised to the time step. A time step that is
    /// [not valid](super::SceneSolver::tick) leaves the clocks as they are.
    pub fn apply_settings(&self, world: &mut World) {
        world.insert_resource(self.environment);
        world.insert_resource(SolverSettings::from(self.solver));
        world.insert_resource(self.collisions);
        let Ok(tick) = self.solver.tick() else {
            return;
        };
        world.get_resource_or_init::<Time<Fixed>>().set_timestep(tick);
        let mut virtual_time = world.get_resource_or_init::<Time<Virtual>>();
        if virtual_time.max_delta() < tick {
            virtual_time.set_max_delta(tick);
        }
    }
}

impl ScenePlane {
    fn bundle(&self) -> impl Bundle {
        let normal = self.unit_normal().unwrap_or(DVec3::Y);
        // In f64: the f32 version takes slopes under 0.04° for none.
        let rotation = DQuat::from_rotation_arc(DVec3::Y, normal).as_quat();
        (
            PlaneCollider { restitution: self.restitution, friction: self.friction },
            Transform::from_translation(self.point).with_rotation(rotation),
        )
    }
}
