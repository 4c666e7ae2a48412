//! Bodies that do not touch each other, whatever their layers.

use bevy::prelude::*;

/// The entities that a particle, net or collider does not touch, whatever its [`ContactLayers`](super::ContactLayers).
///
/// Where an entity is named, all particles, nets and colliders below it in the hierarchy are meant, too; and where the component is on a
/// parent, those below it are exempt. It is enough for one of the two to name the other. An entity that names itself does not touch
/// itself: a cape without self-collision. [`ParticleQueries`](crate::ParticleQueries) ignore exemptions.
///
/// At most seven named bodies count for one; more are left out with a warning that names the entity.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_mass_spring::prelude::*;
/// # fn spawn(mut commands: Commands) {
/// let character = commands.spawn(Transform::default()).id();
/// commands.spawn((ChildOf(character), ParticleCollider::from(Capsule3d::new(0.3, 1.2))));
/// // The strap collides with everything but this character.
/// commands.spawn((Rope::new(0.4), ContactExemptions::from([character])));
/// # }
/// ```
#[derive(Component, Reflect, Debug, Clone, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serialize", reflect(Serialize, Deserialize))]
pub struct ContactExemptions(#[entities] pub Vec<Entity>);

impl<T: IntoIterator<Item = Entity>> From<T> for ContactExemptions {
    fn from(entities: T) -> Self {
        Self(entities.into_iter().collect())
    }
}
