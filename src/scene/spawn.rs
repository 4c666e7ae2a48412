//! From a scene to entities and resources.

use std::collections::BTreeMap;

use bevy::ecs::lifecycle::HookContext;
use bevy::ecs::world::DeferredWorld;
use bevy::math::{DQuat, DVec3};
use bevy::prelude::*;

use super::description::{MassSpringScene, SceneBend, SceneParticle, ScenePlane, SceneSpring};
use super::recipes::SceneLayout;
use crate::bend::Bend;
use crate::collider::ParticleCollider;
use crate::nets::{Part, PartOf};
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
    /// The colliders.
    #[serde(default)]
    pub colliders: Vec<Entity>,
    /// The nets.
    #[serde(default)]
    pub nets: Vec<Entity>,
}

impl SpawnedScene {
    /// All entities: particles, nets, springs, bends, planes, colliders.
    pub fn iter(&self) -> impl Iterator<Item = Entity> + '_ {
        let loose = self.particles.iter().chain(&self.nets);
        let elements = self.springs.iter().chain(&self.bends);
        loose.chain(elements).chain(&self.planes).chain(&self.colliders).copied()
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
    /// Spawns particles, nets, springs, bends, planes and colliders as ordinary entities in world space. The settings of the
    /// scene are left to [`apply_settings`](Self::apply_settings).
    ///
    /// A net has its recipe ([`Rope`](crate::Rope), [`Cloth`](crate::Cloth), [`Jelly`](crate::Jelly) or
    /// [`Balloon`](crate::Balloon)) and its [`ParticleNet`](crate::ParticleNet), complete; a particle of it at which a
    /// spring or bend of the list ends has a [`Part`].
    ///
    /// In a scene that was not [validated](Self::validate), a spring or bend to a particle that is not there
    /// gets [`Entity::PLACEHOLDER`] as that end, which the simulation leaves out with a warning; a net that cannot be
    /// laid out has a recipe only.
    pub fn spawn(&self, commands: &mut Commands) -> SpawnedScene {
        let particles: Vec<Entity> = self.particles.iter().map(|particle| particle.spawn(commands)).collect();
        let mut positions: Vec<Vec3> = self.particles.iter().map(|particle| particle.position).collect();
        let mut nets = Vec::with_capacity(self.nets.len());
        for net in &self.nets {
            let topology = net.topology().ok();
            match &topology {
                Some(topology) => positions.extend(&topology.positions),
                None => positions.resize(positions.len() + net.particle_count(), Vec3::ZERO),
            }
            nets.push(net.spawn(topology, commands));
        }
        let layout = SceneLayout { positions, ..SceneLayout::default() };
        let mut ends = Ends { scene: self, particles: &particles, nets: &nets, parts: BTreeMap::new() };
        let springs = self.springs.iter().map(|spring| {
            let particles = <[usize; 2]>::from(spring.particles).map(|end| ends.get(end, commands));
            let rest_length = layout.rest_length(spring).unwrap_or_default();
            commands.spawn(spring.component(particles, rest_length)).id()
        });
        let springs = springs.collect();
        let bends = self.bends.iter().map(|&SceneBend { particles, stiffness, damping }| {
            let particles = <[usize; 3]>::from(particles).map(|end| ends.get(end, commands));
            commands.spawn(Bend { particles, stiffness, damping }).id()
        });
        let bends = bends.collect();
        let planes = self.planes.iter().map(|plane| commands.spawn(plane.bundle()).id()).collect();
        let colliders = self.colliders.iter().map(|collider| collider.spawn(commands)).collect();
        SpawnedScene { particles, springs, bends, planes, colliders, nets }
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

/// The entities at which springs and bends end.
struct Ends<'a> {
    scene: &'a MassSpringScene,
    particles: &'a [Entity],
    nets: &'a [Entity],
    /// Those of particles of nets, by their index in the scene.
    parts: BTreeMap<usize, Entity>,
}

impl Ends<'_> {
    fn get(&mut self, index: usize, commands: &mut Commands) -> Entity {
        if let Some(particle) = self.particles.get(index) {
            return *particle;
        }
        let Some((net, number)) = self.scene.net_of(index) else { return Entity::PLACEHOLDER };
        let spawn = || commands.spawn((PartOf(self.nets[net]), Part::Particle(number))).id();
        *self.parts.entry(index).or_insert_with(spawn)
    }
}

impl SceneParticle {
    fn spawn(&self, commands: &mut Commands) -> Entity {
        let mut entity = commands.spawn((
            Particle::new(self.mass, self.radius),
            ParticleVelocity(self.velocity),
            Transform::from_translation(self.position),
        ));
        if self.pinned {
            entity.insert(Pinned);
        }
        entity.id()
    }
}

impl SceneSpring {
    fn component(&self, particles: [Entity; 2], rest_length: f32) -> Spring {
        Spring {
            particles,
            rest_length,
            stiffness: self.stiffness,
            damping: self.damping,
            tension_only: self.tension_only,
            max_stretch: self.max_stretch,
            breaking_force: self.breaking_force,
            plasticity: None,
        }
    }
}

impl ScenePlane {
    fn bundle(&self) -> impl Bundle {
        let normal = self.unit_normal().unwrap_or(DVec3::Y);
        // In f64: the f32 version takes slopes under 0.04° for none.
        let rotation = DQuat::from_rotation_arc(DVec3::Y, normal).as_quat();
        (
            ParticleCollider::half_space().with_restitution(self.restitution).with_friction(self.friction),
            Transform::from_translation(self.point).with_rotation(rotation),
        )
    }
}
