//! Putting nets, single particles or all there is to another place, without a motion from here to there.

use bevy::prelude::*;

use crate::sync::{Scope, relocate};

/// Moves particles, nets and colliders to another place at once: nothing has moved, it is elsewhere.
///
/// Strains, contacts and velocities relative to each other stay what they are; a rotation turns velocities, too. No
/// easing draws the way in between. Positions are moved as exactly as the solver stores them, which is finer than a
/// `Transform` far from the origin.
///
/// The next tick recognises by itself, without this command, a motion of the `Transform`s (or those of parents) of
/// - all free particles of a net by the same translation or rotation, together with at least one pinned particle of
///   it, if there are any; other pinned particles may move by themselves at the same time;
/// - all particles there are (a floating origin): then colliders that went along are teleported, too.
///
/// It is needed for all else: a pinned particle that is to jump though what hangs from it stays behind, a plane that
/// jumps, and what is moved between two ticks while easing shows it on the way (in `Update`, say, where positions
/// are not those of any tick).
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_mass_spring::prelude::*;
/// fn respawn(anchor: Single<Entity, With<Pinned>>, mut commands: Commands) {
///     // The anchor and all that springs join to it, 100 m to the right.
///     commands.queue(Teleport::net(*anchor, Vec3::X * 100.0));
/// }
///
/// fn shift_origin(mut commands: Commands) {
///     commands.queue(Teleport::everything(Vec3::NEG_X * 1000.0));
/// }
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Teleport {
    scope: Scope,
    isometry: Isometry3d,
}

impl Teleport {
    /// Moves one particle, net or collider. Contacts of a particle are removed; its springs stay.
    ///
    /// The `isometry` maps the places of the world to new ones: a `Vec3` is a translation in m, a `Quat` a rotation
    /// about the origin of the world.
    pub fn entity(entity: Entity, isometry: impl Into<Isometry3d>) -> Self {
        Self { scope: Scope::Entity(entity), isometry: isometry.into() }
    }

    /// Moves a particle, part or net and all particles that springs join to it, directly or through others; pinned ones, too.
    /// The `isometry` is as in [`entity`](Self::entity).
    pub fn net(particle: Entity, isometry: impl Into<Isometry3d>) -> Self {
        Self { scope: Scope::Net(particle), isometry: isometry.into() }
    }

    /// Moves all particles, nets and colliders. The `isometry` is as in [`entity`](Self::entity).
    pub fn everything(isometry: impl Into<Isometry3d>) -> Self {
        Self { scope: Scope::Everything, isometry: isometry.into() }
    }
}

impl Command for Teleport {
    type Out = ();

    fn apply(self, world: &mut World) {
        relocate(world, self.scope, self.isometry);
    }
}
