//! Ropes as links: an entity of the user's own for each.

use std::collections::BTreeMap;

use bevy::ecs::entity::{EntityCloner, MapEntities};
use bevy::math::{Mat3A, Quat, Vec3, Vec3A};
use bevy::prelude::*;

use super::easing::{self, NetEasing, NetVersion};
use super::frame::Frame;
use super::known::Known;
use super::strands::strands;
use super::tube::{orthonormal, transport};
use crate::nets::ParticleNet;

/// Draws each link of a rope as a copy of another entity: chain links, bamboo, planks of a bridge.
///
/// The copies are children of the net, with all components and descendants of the template. The y axis of each lies
/// along its link, its origin in the middle. The template is drawn as well, where it is; hide it by
/// `Visibility::Hidden`, which its copies do not inherit. A link that breaks is despawned.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_mass_spring::prelude::*;
/// use std::f32::consts::FRAC_PI_2;
///
/// fn spawn_chain(mut commands: Commands, mut meshes: ResMut<Assets<Mesh>>, steel: MeshMaterial3d<StandardMaterial>) {
///     // Bevy's torus lies flat: stood on its rim, its y axis is along the link.
///     let ring = Torus { minor_radius: 0.01, major_radius: 0.035 }.mesh().build();
///     let ring = Mesh3d(meshes.add(ring.rotated_by(Quat::from_rotation_x(FRAC_PI_2))));
///     let link = commands.spawn((ring, steel, Visibility::Hidden)).id();
///     commands.spawn((
///         Rope::new(1.5).with_spacing(0.05),
///         RopeLinks::new(link).with_twist(FRAC_PI_2),
///         related!(Parts[(Part::Start, Pinned)]),
///     ));
/// }
/// ```
#[derive(Component, FromTemplate, MapEntities, Debug, Clone, Copy, PartialEq, Reflect)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[reflect(Component, Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serialize", reflect(Serialize, Deserialize))]
pub struct RopeLinks {
    /// What is copied. A change acts on links that are new.
    #[entities]
    pub template: Entity,
    /// How much each link is turned about the rope against the one before, rad. A quarter turn, π/2, makes a chain.
    /// Default 0.
    pub twist: f32,
}

impl RopeLinks {
    /// Copies of an entity.
    pub fn new(template: Entity) -> Self {
        Self { template, twist: 0.0 }
    }

    /// Turns each link against the one before, rad.
    pub fn with_twist(mut self, twist: f32) -> Self {
        self.twist = twist;
        self
    }
}

/// A link that [`RopeLinks`] spawned.
#[derive(Component, Debug, Clone, Copy, PartialEq, Eq, Reflect)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[reflect(Component, Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serialize", reflect(Serialize, Deserialize))]
pub struct RopeLink {
    /// The particles of the net at its two ends.
    pub particles: [u32; 2],
}

/// The links of a net.
#[derive(Component, Debug)]
#[component(clone_behavior = Ignore)]
pub(super) struct Links {
    known: Known,
    chains: Vec<Chain>,
    drawn: Option<(NetVersion, GlobalTransform, f32)>,
}

/// The links of a strand, from its first particle on.
#[derive(Debug)]
struct Chain {
    links: Vec<(Entity, [u32; 2])>,
    /// The axis of the first at rest, and across.
    start: [Vec3; 2],
}

/// Spawns the links of new ropes, and despawns those that broke.
pub(super) fn prepare_links(
    nets: Query<(Entity, &ParticleNet, &RopeLinks, Option<&Links>)>,
    mut commands: Commands,
) {
    for (entity, net, settings, links) in &nets {
        if links.is_some_and(|links| links.known.is_same(net)) {
            continue;
        }
        let known = links.iter().flat_map(|links| &links.chains).flat_map(|chain| &chain.links);
        let mut known: BTreeMap<[u32; 2], Entity> =
            known.map(|(link, ends)| (sorted(*ends), *link)).collect();
        let mut chains = Vec::new();
        for strand in strands(net.topology(), net.broken()) {
            let mut links = Vec::new();
            for ends in strand.particles.windows(2) {
                let particles = [ends[0], ends[1]];
                let link = known
                    .remove(&sorted(particles))
                    .unwrap_or_else(|| spawn(entity, settings.template, particles, &mut commands));
                links.push((link, particles));
            }
            let [from, to] = [0, 1].map(|end| net.topology().positions[strand.particles[end] as usize]);
            let axis = (to - from).normalize_or(Vec3::NEG_Y);
            chains.push(Chain { links, start: [axis, axis.any_orthonormal_vector()] });
        }
        for link in known.into_values() {
            commands.entity(link).try_despawn();
        }
        let links = Links { known: Known::new(net), chains, drawn: None };
        commands.entity(entity).try_insert(links);
    }
}

fn sorted([one, other]: [u32; 2]) -> [u32; 2] {
    [one.min(other), one.max(other)]
}

fn spawn(net: Entity, template: Entity, particles: [u32; 2], commands: &mut Commands) -> Entity {
    let link = commands.spawn_empty().id();
    commands.queue(move |world: &mut World| {
        if world.get_entity(template).is_ok() && world.get_entity(link).is_ok() {
            EntityCloner::build_opt_out(world).linked_cloning(true).clone_entity(template, link);
        }
        let scale = world.get::<Transform>(template).map_or(Vec3::ONE, |transform| transform.scale);
        // The net may have been despawned with the same commands.
        if world.get_entity(net).is_err() {
            world.despawn(link);
        } else if let Ok(mut link) = world.get_entity_mut(link) {
            link.insert((
                RopeLink { particles },
                Transform::from_scale(scale),
                Visibility::Inherited,
                ChildOf(net),
            ));
        }
    });
    link
}

/// Puts the links where the particles are.
pub(super) fn place_links(
    mut nets: Query<(Entity, Ref<ParticleNet>, Option<&NetEasing>, &RopeLinks, &mut Links)>,
    mut links: Query<&mut Transform, With<RopeLink>>,
    places: Query<&Transform, Without<RopeLink>>,
    parents: Query<&ChildOf>,
    time: Option<Res<Time<Fixed>>>,
    mut particles: Local<Vec<Vec3A>>,
) {
    let fraction = easing::fraction(time.as_deref());
    for (entity, net, easing, settings, mut drawn) in &mut nets {
        let (view, version) = easing::view(&net, easing, fraction);
        let mut place = places.get(entity).copied().map(GlobalTransform::from).unwrap_or_default();
        for parent in parents.iter_ancestors(entity) {
            if let Ok(parent) = places.get(parent) {
                place = *parent * place;
            }
        }
        let now = Some((version, place, settings.twist));
        let Links { known, chains, drawn } = drawn.bypass_change_detection();
        if *drawn == now || !known.is_same(&net) || view.end.len() < net.topology().positions.len() {
            continue;
        }
        *drawn = now;
        let Some(frame) = Frame::new(&place) else { continue };
        frame.place(&view, &mut particles);
        for chain in chains.iter() {
            chain.place(&particles, settings.twist, |link, middle, rotation| {
                if let Ok(mut transform) = links.get_mut(link) {
                    (transform.translation, transform.rotation) = (middle.into(), rotation);
                }
            });
        }
    }
}

impl Chain {
    fn place(&self, particles: &[Vec3A], twist: f32, mut put: impl FnMut(Entity, Vec3A, Quat)) {
        let [axis_at_rest, across_at_rest] = self.start;
        let mut before: Option<[Vec3A; 3]> = None;
        for (number, (link, ends)) in self.links.iter().enumerate() {
            let [from, to] = ends.map(|end| particles[end as usize]);
            let middle = 0.5 * (from + to);
            let axis = (to - from).try_normalize();
            let (axis, across) = match before {
                None => {
                    let axis = axis.unwrap_or(axis_at_rest.into());
                    let turn = Quat::from_rotation_arc(axis_at_rest, axis.into());
                    (axis, orthonormal((turn * across_at_rest).into(), axis))
                }
                Some([previous, axis_before, across]) => {
                    let axis = axis.unwrap_or(axis_before);
                    (axis, transport(across, axis_before, axis, middle - previous))
                }
            };
            before = Some([middle, axis, across]);
            let rotation = Quat::from_mat3a(&Mat3A::from_cols(across, axis, across.cross(axis)));
            put(*link, middle, rotation * Quat::from_rotation_y(twist * number as f32));
        }
    }
}

/// Despawns the links of a net that has them no more.
pub(super) fn stop_links(removed: On<Remove, RopeLinks>, nets: Query<&Links>, mut commands: Commands) {
    let Ok(links) = nets.get(removed.entity) else { return };
    for (link, _) in links.chains.iter().flat_map(|chain| &chain.links) {
        commands.entity(*link).try_despawn();
    }
    commands.entity(removed.entity).try_remove::<Links>();
}
