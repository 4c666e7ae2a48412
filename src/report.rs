//! What the last tick did and what it cost.

use std::time::Duration;

use bevy::prelude::*;

use crate::settings::Integrator;

/// What the last tick did and what each stage of it cost. Written by the plugin once a tick.
#[derive(Resource, Reflect, Debug, Clone, Default, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[reflect(Resource, Default, Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serialize", reflect(Serialize, Deserialize))]
#[non_exhaustive]
pub struct TickReport {
    /// Ticks that have run since the app started or the initial state was restored.
    pub tick: u64,
    /// The scheme that ran; never [`Integrator::Auto`] once a tick has run. Where `Auto` took some parts of
    /// the net by TR-BDF2, that of the others.
    pub integrator: Integrator,
    /// The number of substeps that ran.
    pub substeps: u32,
    /// The number of steps of TR-BDF2 beside those substeps, for the stiff parts of the net; 0 where
    /// one scheme advanced all.
    pub stiff_substeps: u32,
    /// The springs in those parts.
    pub stiff_springs: usize,
    /// Particles in the simulation, asleep or awake.
    pub particles: usize,
    /// Particles that sleep.
    pub asleep: usize,
    /// Springs in the simulation.
    pub springs: usize,
    /// Touching pairs at the end of the tick: of particles, edges and faces with colliders and with each other.
    pub contacts: usize,
    /// Particles [quarantined](crate::particle::Quarantined) since the app started or the initial
    /// state was restored.
    pub faults: usize,
    /// Springs that broke since the app started or the initial state was restored.
    pub broken: usize,
    /// Wall time of copying the components into the solver.
    pub gather_time: Duration,
    /// Wall time of the solver's step.
    pub step_time: Duration,
    /// Wall time of copying the solver's state back into the components.
    pub scatter_time: Duration,
}

impl TickReport {
    /// What ran, in words: `VelocityVerlet × 8`, or `VelocityVerlet × 8, TrBdf2 × 2 on 120 springs`.
    pub fn schemes(&self) -> String {
        let Self { integrator, substeps, stiff_substeps, stiff_springs, .. } = self;
        match stiff_substeps {
            0 => format!("{integrator} × {substeps}"),
            _ => {
                let (implicit, plural) = (Integrator::TrBdf2, if *stiff_springs == 1 { "" } else { "s" });
                format!(
                    "{integrator} × {substeps}, {implicit} × {stiff_substeps} on {stiff_springs} spring{plural}"
                )
            }
        }
    }
}

/// A particle's state became non-finite and it was [quarantined](crate::particle::Quarantined).
#[derive(Message, Reflect, Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[reflect(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serialize", reflect(Serialize, Deserialize))]
#[non_exhaustive]
pub struct ParticleFault {
    /// The particle, or the net of which it is one.
    pub particle: Entity,
    /// Its number in the net; `None` of a loose particle.
    pub index: Option<u32>,
    /// The tick in which it happened, counted as in [`TickReport::tick`].
    pub tick: u64,
}

/// A spring broke: its tension exceeded its breaking force.
///
/// It is triggered on the entity of the spring, which has the component [`Broken`](crate::spring::Broken) by then and
/// exerts no force any more; or on the net, once for each spring of it. The same is written as a message, for systems that
/// read all of a tick.
#[derive(EntityEvent, Message, Reflect, Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[reflect(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serialize", reflect(Serialize, Deserialize))]
#[non_exhaustive]
pub struct Broke {
    /// The entity of the spring, or the net.
    pub entity: Entity,
    /// The tick in which it happened, counted as in [`TickReport::tick`].
    pub tick: u64,
    /// Its tension when it broke, N.
    pub tension: f32,
    /// The middle between its ends then, in world space, m.
    pub point: Vec3,
    /// The number of the spring in its net.
    pub spring: Option<u32>,
    /// Into how many pieces the net is by now; one of them may be a single particle.
    pub pieces: Option<u32>,
}

/// The forces of all springs at the end of the last tick.
///
/// They are computed only while this resource exists: insert it to read them.
#[derive(Resource, Reflect, Debug, Clone, Default, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[reflect(Resource, Default, Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serialize", reflect(Serialize, Deserialize))]
#[non_exhaustive]
pub struct SpringForces {
    /// Each spring in the simulation and its tension in N, damper included; negative where it pushes. In the order of
    /// spawning. Those of a net are in its [`tension`](crate::ParticleNet::tension).
    pub tensions: Vec<(Entity, f32)>,
    /// With what force all that holds particles is pulled at: pinned particles, and what parts are attached to.
    pub reactions: Vec<Reaction>,
}

/// The force on what holds a particle, among the [`SpringForces`].
///
/// An [`Attachment`](crate::Attachment) to an entity that is no particle moves with this, and does not push it: a game that
/// moves its body by its own physics, or by those of a rigid-body engine, applies the reaction to it.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_mass_spring::prelude::*;
/// # let mut app = App::new();
/// app.init_resource::<SpringForces>();
///
/// /// A body of the game's own.
/// #[derive(Component)]
/// struct Body {
///     mass: f32,
///     inverse_inertia: f32,
///     velocity: Vec3,
///     spin: Vec3,
/// }
///
/// // In FixedUpdate: the forces are those of the last tick.
/// fn pull(forces: Res<SpringForces>, time: Res<Time>, mut bodies: Query<(&mut Body, &Transform)>) {
///     for reaction in &forces.reactions {
///         let Ok((mut body, place)) = bodies.get_mut(reaction.entity) else { continue };
///         let impulse = reaction.force * time.delta_secs();
///         let arm = reaction.point - place.translation;
///         let change = impulse / body.mass;
///         body.velocity += change;
///         let turn = arm.cross(impulse) * body.inverse_inertia;
///         body.spin += turn;
///     }
/// }
/// ```
#[derive(Reflect, Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[reflect(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serialize", reflect(Serialize, Deserialize))]
#[non_exhaustive]
pub struct Reaction {
    /// What holds: a pinned [`Particle`](crate::Particle); the net of a pinned one; or the entity that an
    /// [`Attachment`](crate::Attachment) names, one reaction for each particle that is tied to it.
    pub entity: Entity,
    /// The number of the pinned particle, if `entity` is its net.
    pub index: Option<u32>,
    /// The force with which springs, bends and gas pull at it, in world space, N.
    pub force: Vec3,
    /// Where it acts, in world space, m.
    pub point: Vec3,
}

/// The colliders that the last tick left out of the simulation: of an invalid shape, scale, place or surface. The log has
/// a warning for each, which says why.
///
/// It is kept only while this resource exists: insert it to read it.
#[derive(Resource, Reflect, Debug, Clone, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[reflect(Resource, Default, Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serialize", reflect(Serialize, Deserialize))]
#[non_exhaustive]
pub struct InvalidColliders {
    /// Each of them, in ascending order.
    pub all: Vec<Entity>,
}

impl InvalidColliders {
    /// Whether a collider is left out.
    pub fn contains(&self, collider: Entity) -> bool {
        self.all.binary_search(&collider).is_ok()
    }
}

/// The particles that sleep after the last tick: see [`SleepSettings`](crate::settings::SleepSettings).
///
/// It is kept only while this resource exists: insert it to read it. It changes only when something falls asleep or wakes.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_mass_spring::prelude::*;
/// # let mut app = App::new();
/// app.init_resource::<SleepingParticles>();
///
/// #[derive(Component, PartialEq)]
/// struct IsLit(bool);
///
/// fn dim(sleeping: Res<SleepingParticles>, mut lamps: Query<(Entity, &mut IsLit), With<Particle>>) {
///     for (lamp, mut is_lit) in &mut lamps {
///         is_lit.set_if_neq(IsLit(!sleeping.contains(lamp, None)));
///     }
/// }
/// ```
#[derive(Resource, Reflect, Debug, Clone, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[reflect(Resource, Default, Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serialize", reflect(Serialize, Deserialize))]
#[non_exhaustive]
pub struct SleepingParticles {
    /// Each of them, in ascending order: a loose particle and `None`, or a net and the number of its particle.
    pub all: Vec<(Entity, Option<u32>)>,
}

impl SleepingParticles {
    /// Whether a loose particle (`index` is `None`) or the particle of this number in a net sleeps.
    pub fn contains(&self, entity: Entity, index: Option<u32>) -> bool {
        self.all.binary_search(&(entity, index)).is_ok()
    }

    /// The number of particles of a net that sleep; of a loose particle 1 or 0. All of a net sleep where it is the number
    /// of those that are not pinned.
    pub fn count_of(&self, entity: Entity) -> usize {
        let first = self.all.partition_point(|(other, _)| *other < entity);
        self.all[first..].partition_point(|(other, _)| *other == entity)
    }
}
