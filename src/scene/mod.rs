//! Scene files: particles, springs, bends, nets, planes, colliders and settings as RON text, `*.scene.ron`.
//!
//! [`MassSpringScene`] is the file's content. It is read with [`MassSpringScene::read`] or
//! [`MassSpringScene::from_ron`], which refuse bad values with a [`SceneError`] that says where they
//! stand; or it is loaded as a Bevy asset and spawned by a [`MassSpringSceneRoot`]. Either way it
//! becomes ordinary entities with [`Particle`](crate::Particle), [`Spring`](crate::Spring),
//! [`ParticleCollider`](crate::ParticleCollider) and [`ParticleNet`](crate::ParticleNet): this module is independent of the
//! solver.
//!
//! ```
//! use bevy::prelude::*;
//! use bevy_mass_spring::prelude::*;
//!
//! let scene = MassSpringScene::from_ron(
//!     "(
//!         particles: [
//!             (position: (0.0, 2.0, 0.0), mass: 1.0, pinned: true),
//!             (position: (0.5, 2.0, 0.0), mass: 1.0),
//!         ],
//!         springs: [(particles: (0, 1), stiffness: 1000.0)],
//!     )",
//! )?;
//! # let mut app = App::new();
//! # app.add_plugins((MinimalPlugins, MassSpringPlugin::default()));
//! let world = app.world_mut();
//! scene.apply_settings(world);
//! let spawned = scene.spawn(&mut world.commands());
//! world.flush();
//! assert_eq!(world.get::<Spring>(spawned.springs[0]).unwrap().rest_length, 0.5);
//! # Ok::<(), bevy_mass_spring::scene::SceneError>(())
//! ```

mod asset;
mod colliders;
mod description;
mod error;
mod nets;
mod reader;
mod recipes;
mod spawn;
mod validate;

pub use asset::{MassSpringSceneLoader, MassSpringScenePlugin, MassSpringSceneRoot};
pub use colliders::SceneCollider;
pub use description::{MassSpringScene, SceneBend, SceneParticle, ScenePlane, SceneSolver, SceneSpring};
pub use error::{Position, SceneError, SceneErrorReason};
pub use nets::SceneNet;
pub use recipes::SceneLayout;
pub use spawn::SpawnedScene;
