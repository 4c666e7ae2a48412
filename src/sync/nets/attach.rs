//! Attachments of parts: springs to what they are tied to.

use bevy::ecs::entity_disabling::Disabled;
use bevy::ecs::query::Allow;
use bevy::prelude::*;

use super::super::hierarchy::{to_local, world_transform};
use super::super::state::{MassSpringState, Warnings};
use crate::nets::{Attachment, Part, PartOf, PartState, ParticleNet, Parts, Tied};
use crate::particle::{Particle, Pinned};
use crate::solver;
use crate::spring::{Broken, Spring};

/// Whether there is any attachment that is not tied yet.
pub(in crate::sync) fn any_untied(untied: Query<(), (With<Attachment>, Without<Tied>)>) -> bool {
    !untied.is_empty()
}

/// After the particles of parts were found: ties those that were attached since the last tick, in the order of the nets and
/// their parts.
pub(in crate::sync) fn tie_attachments(
    mut commands: Commands,
    state: Res<MassSpringState>,
    nets: Query<(&ParticleNet, &Parts)>,
    attachments: Query<(&Attachment, &PartState), Without<Tied>>,
    simulated: Query<(), Or<(With<Particle>, With<Part>)>>,
    targets: Query<(&PartOf, &PartState)>,
    transforms: Query<&Transform, Allow<Disabled>>,
    parents: Query<&ChildOf, Allow<Disabled>>,
    mut warnings: ResMut<Warnings>,
) {
    for net_entity in state.nets.entities() {
        let Ok((net, parts)) = nets.get(net_entity) else { continue };
        for &part in parts.entities() {
            let Ok((attachment, part_state)) = attachments.get(part) else { continue };
            let target = attachment.entity;
            let [particle] = *part_state.particles() else {
                warnings.warn_once(part, format_args!("part {part} is not attached: it is not one particle"));
                continue;
            };
            if targets.get(target).is_ok_and(|(_, part)| part.particles().is_empty()) {
                // It is a part of a net that is not laid out yet.
                continue;
            }
            if !transforms.contains(target) {
                warnings
                    .warn_once(part, format_args!("part {part} is not attached: {target} has no Transform"));
                continue;
            }
            let parent_of = |entity| parents.get(entity).ok().map(ChildOf::parent);
            let (frame, _) = world_transform(target, parent_of, |entity| transforms.get(entity).ok());
            let place = net.positions()[particle as usize];
            let mut spring = tie(net, particle, attachment);
            let anchor = if simulated.contains(target) {
                spring.particles = [part, target];
                // The Transform of a part is not written before the end of its first tick.
                let of_part = targets.get(target).ok().and_then(|(net, part)| {
                    let particle = *part.particles().first()? as usize;
                    nets.get(net.0).ok()?.0.positions().get(particle).copied()
                });
                let other = of_part.unwrap_or_else(|| frame.translation.into());
                spring.rest_length = place.distance(other);
                None
            } else {
                let local = Transform::from_translation(to_local(&frame, place));
                let anchor = commands.spawn((Particle::new(1.0, 0.0), Pinned, local, ChildOf(target))).id();
                spring.particles = [part, anchor];
                Some(anchor)
            };
            commands.entity(part).try_insert((spring, Tied { anchor }));
        }
    }
}

/// A spring like the stiffest one at a particle.
fn tie(net: &ParticleNet, particle: u32, attachment: &Attachment) -> Spring {
    let at_particle = net.topology().springs.iter().filter(|(ends, _)| ends.contains(&particle));
    let stiffest =
        at_particle.map(|(_, spring)| *spring).max_by(|one, other| one.stiffness.total_cmp(&other.stiffness));
    let like =
        stiffest.unwrap_or(solver::Spring::elastic(0.0, Spring::DEFAULT_STIFFNESS, Spring::DEFAULT_DAMPING));
    let stiffness = attachment.stiffness.unwrap_or(like.stiffness);
    let damping = if like.stiffness > 0.0 { like.damping * (stiffness / like.stiffness) } else { 0.0 };
    Spring {
        breaking_force: attachment.breaking_force,
        ..Spring::new(Entity::PLACEHOLDER, Entity::PLACEHOLDER, 0.0)
            .with_stiffness(stiffness)
            .with_damping(damping)
    }
}

/// Undoes the tie of an attachment that is removed.
pub(in crate::sync) fn untie(removed: On<Remove, Attachment>, tied: Query<&Tied>, mut commands: Commands) {
    undo(removed.entity, &tied, &mut commands);
}

/// Undoes the tie of an attachment that was replaced by another one.
pub(in crate::sync) fn retie(inserted: On<Insert, Attachment>, tied: Query<&Tied>, mut commands: Commands) {
    undo(inserted.entity, &tied, &mut commands);
}

fn undo(part: Entity, tied: &Query<&Tied>, commands: &mut Commands) {
    let Ok(Tied { anchor }) = tied.get(part) else { return };
    if let Some(anchor) = anchor {
        commands.entity(*anchor).try_despawn();
    }
    commands.entity(part).try_remove::<(Spring, Tied, Broken)>();
}
