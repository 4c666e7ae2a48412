//! Attachments of parts: springs to what they are tied to.

use bevy::ecs::entity_disabling::Disabled;
use bevy::ecs::query::Allow;
use bevy::ecs::system::SystemParam;
use bevy::math::Affine3A;
use bevy::prelude::*;

use super::super::hierarchy::{to_local, world_transform};
use super::super::state::{MassSpringState, Warnings};
use super::gather::GatheredNets;
use crate::nets::{Anchor, Attachment, Part, PartOf, PartState, ParticleNet, Parts, Tie};
use crate::particle::{Particle, Pinned};
use crate::solver;
use crate::spring::{Broken, Spring};

/// After the particles of parts were found: ties those that were attached since the last tick, in the order of the nets and
/// their parts.
pub(in crate::sync) fn tie_attachments(
    mut commands: Commands,
    state: Res<MassSpringState>,
    nets: Query<(&ParticleNet, &Parts)>,
    attachments: Query<(&Attachment, &Part, &PartState)>,
    targets: Targets,
    mut gathered: ResMut<GatheredNets>,
    mut warnings: ResMut<Warnings>,
) {
    if attachments.iter().all(|(.., part)| part.tie.is_some()) {
        return;
    }
    for net_entity in state.nets.entities() {
        let Ok((net, parts)) = nets.get(net_entity) else { continue };
        for &part in parts.entities() {
            let Ok((attachment, kind, part_state)) = attachments.get(part) else { continue };
            if part_state.tie.is_some() {
                continue;
            }
            let target = match targets.find(attachment.entity, &nets) {
                Ok(Some(target)) => target,
                Ok(None) => continue,
                Err(problem) => {
                    warnings.warn_once(part, format_args!("part {part} is not attached: {problem}"));
                    continue;
                }
            };
            let mut tie = Tie { attachment: *attachment, helpers: Vec::new() };
            for &particle in part_state.particles() {
                let mut spring = spring_of(net, particle, kind, attachment);
                let place = net.positions()[particle as usize];
                let end = target.end_at(place, &mut spring, &mut commands, &mut tie);
                if let [_] = part_state.particles() {
                    spring.particles = [part, end];
                    commands.entity(part).try_insert(spring);
                    continue;
                }
                let of_one = (PartOf(net_entity), Part::Particle(particle), part_state.of_one(particle));
                let strand = commands.spawn((of_one, ChildOf(part))).id();
                spring.particles = [strand, end];
                commands.entity(strand).insert(spring);
                gathered.relinked_parts.insert(strand);
                tie.helpers.push(strand);
            }
            // A part without particles is of a net that is not laid out yet, or has none such.
            if !part_state.particles().is_empty() {
                commands.entity(part).queue_silenced(move |mut part: EntityWorldMut| {
                    if let Some(mut state) = part.get_mut::<PartState>() {
                        state.tie = Some(tie);
                    }
                });
            }
        }
    }
}

/// What parts may be tied to.
#[derive(SystemParam)]
pub(in crate::sync) struct Targets<'w, 's> {
    simulated: Query<'w, 's, (), Or<(With<Particle>, With<Part>)>>,
    parts: Query<'w, 's, (&'static PartOf, &'static PartState)>,
    transforms: Query<'w, 's, &'static Transform, Allow<Disabled>>,
    parents: Query<'w, 's, &'static ChildOf, Allow<Disabled>>,
}

/// What a part is tied to.
enum Target {
    /// A particle, or a part of one, and where it is.
    Particle(Entity, Vec3),
    /// Anything else, and its frame.
    Frame(Entity, Affine3A),
}

impl Targets<'_, '_> {
    /// `None`: it is a part of a net that is not laid out yet.
    fn find(&self, target: Entity, nets: &Query<(&ParticleNet, &Parts)>) -> Result<Option<Target>, String> {
        if !self.transforms.contains(target) {
            return Err(format!("{target} has no Transform"));
        }
        let parent_of = |entity| self.parents.get(entity).ok().map(ChildOf::parent);
        let (frame, _) = world_transform(target, parent_of, |entity| self.transforms.get(entity).ok());
        if !self.simulated.contains(target) {
            return Ok(Some(Target::Frame(target, frame)));
        }
        let Ok((net, part)) = self.parts.get(target) else {
            return Ok(Some(Target::Particle(target, frame.translation.into())));
        };
        match *part.particles() {
            [] => Ok(None),
            [particle] => {
                // The Transform of a part is not written before the end of its first tick.
                let net = nets.get(net.0).ok();
                let place = net.and_then(|(net, _)| net.positions().get(particle as usize).copied());
                Ok(Some(Target::Particle(target, place.unwrap_or_else(|| frame.translation.into()))))
            }
            [..] => Err(format!("{target} is a part of {} particles, expected one", part.particles().len())),
        }
    }
}

impl Target {
    /// The other end of a `spring` from a particle at `place`, which is given its rest length.
    fn end_at(&self, place: Vec3, spring: &mut Spring, commands: &mut Commands, tie: &mut Tie) -> Entity {
        match *self {
            Self::Particle(entity, other) => {
                spring.rest_length = place.distance(other);
                entity
            }
            Self::Frame(entity, frame) => {
                let local = Transform::from_translation(to_local(&frame, place));
                let anchor =
                    commands.spawn((Particle::new(1.0, 0.0), Pinned, Anchor, local, ChildOf(entity))).id();
                tie.helpers.push(anchor);
                anchor
            }
        }
    }
}

/// A spring like the stiffest one at a particle, or as stiff as the attachment says, by the weight of the particle in the part.
fn spring_of(net: &ParticleNet, particle: u32, part: &Part, attachment: &Attachment) -> Spring {
    let at_particle = net.topology().springs.iter().filter(|(ends, _)| ends.contains(&particle));
    let stiffest =
        at_particle.map(|(_, spring)| *spring).max_by(|one, other| one.stiffness.total_cmp(&other.stiffness));
    let like =
        stiffest.unwrap_or(solver::Spring::elastic(0.0, Spring::DEFAULT_STIFFNESS, Spring::DEFAULT_DAMPING));
    let weight = if let Part::Painted(name) = part { net.topology().weight(name, particle) } else { 1.0 };
    let stiffness = weight * attachment.stiffness.unwrap_or(like.stiffness);
    let damping = if like.stiffness > 0.0 { like.damping * (stiffness / like.stiffness) } else { 0.0 };
    Spring {
        breaking_force: attachment.breaking_force,
        ..Spring::new(Entity::PLACEHOLDER, Entity::PLACEHOLDER, 0.0)
            .with_stiffness(stiffness)
            .with_damping(damping)
    }
}

/// Undoes the tie of an attachment that is removed.
pub(in crate::sync) fn untie(
    removed: On<Remove, Attachment>,
    mut parts: Query<&mut PartState>,
    mut commands: Commands,
) {
    if let Ok(mut part) = parts.get_mut(removed.entity) {
        undo(removed.entity, &mut part, &mut commands);
    }
}

/// Undoes the tie of an attachment that was replaced by another one.
pub(in crate::sync) fn retie(
    inserted: On<Insert, Attachment>,
    mut parts: Query<(&Attachment, &mut PartState)>,
    mut commands: Commands,
) {
    let Ok((attachment, mut part)) = parts.get_mut(inserted.entity) else { return };
    if part.tie.as_ref().is_some_and(|tie| tie.attachment != *attachment) {
        undo(inserted.entity, &mut part, &mut commands);
    }
}

fn undo(entity: Entity, part: &mut PartState, commands: &mut Commands) {
    let Some(Tie { helpers, .. }) = part.tie.take() else { return };
    helpers.iter().for_each(|helper| commands.entity(*helper).try_despawn());
    commands.entity(entity).try_remove::<(Spring, Broken)>();
}
