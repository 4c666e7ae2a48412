//! The strength of nets: where they break and tear.

use std::sync::Arc;

use bevy::prelude::*;

use super::tear::{Rupture, Tear, tear};
use super::{ParticleNet, Topology};
use crate::parameter::{self, InvalidParameter};
use crate::solver::Spring;

/// Beside a net: where its springs break. Default: nowhere.
///
/// A rope comes apart, a cloth or a balloon opens along its edges: its particles are split, old ones keep their numbers and
/// new ones get the next (see [`tear`](crate::nets::tear)). The net publishes [`Broke`](crate::Broke). Of
/// connected springs the one that is most overloaded breaks in a substep, and all that carry twice their breaking force.
///
/// Of a jelly the springs go, one by one, and nothing is split: it crumbles into pieces of whole particles, down to single
/// ones. Its surface, which is drawn and in the air, keeps its triangles: it does not tear, and is drawn out between pieces.
///
/// Changed values act from the next tick on. Bad ones are named in the log once, and nothing is changed then.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_mass_spring::nets::{Breaking, ParticleNet};
/// fn curtain(mut commands: Commands, net: ParticleNet) {
///     commands.spawn((net, Breaking { strain: Some(0.5), ..default() }));
/// }
/// ```
#[derive(Component, Reflect, Debug, Clone, Copy, Default, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serialize", reflect(Serialize, Deserialize))]
pub struct Breaking {
    /// The strain at which a spring breaks: its breaking force is its stiffness times this part of its rest length.
    /// Finite and >= 0. Default `None`.
    pub strain: Option<f32>,
    /// The tension at which a spring breaks, N; for a rope, its breaking strength. Finite and >= 0. Default `None`.
    pub force: Option<f32>,
}

#[cfg(feature = "serialize")]
use bevy::reflect::{ReflectDeserialize, ReflectSerialize};

impl Breaking {
    /// Checks that both are in their ranges.
    ///
    /// # Errors
    /// Names the field at fault.
    pub fn validate(&self) -> Result<(), InvalidParameter> {
        self.strain.map_or(Ok(()), |strain| parameter::non_negative("strain", strain))?;
        self.force.map_or(Ok(()), |force| parameter::non_negative("force", force))
    }

    /// Gives the springs of a net their breaking forces: of the two the lower one.
    pub fn give_to(&self, topology: &mut Topology) {
        let tears = !topology.triangles.is_empty() && !topology.is_solid();
        for (_, spring) in &mut topology.springs {
            spring.breaking_force = self.limit(spring);
            spring.tears = tears && spring.breaking_force.is_some();
        }
    }

    /// The tension that a spring bears, N.
    pub(super) fn limit(&self, spring: &Spring) -> Option<f32> {
        let of_strain = self.strain.map(|strain| spring.stiffness * spring.rest_length * strain);
        // Beyond the numbers of single precision nothing breaks.
        let of_strain = of_strain.filter(|force| force.is_finite());
        [of_strain, self.force].into_iter().flatten().reduce(f32::min)
    }
}

/// Into how many pieces a net is, and what happened to it.
pub(crate) struct Damage {
    /// The springs that broke, but for those that hold, as they are all that is left of a triangle.
    pub broken: Vec<u32>,
    pub pieces: u32,
}

impl ParticleNet {
    /// Gives the springs what they bear, where they have not got it.
    pub(crate) fn give_breaking(&mut self, breaking: Breaking) {
        breaking.give_to(Arc::make_mut(&mut self.topology));
        if let Some(spool) = &mut self.spool {
            spool.give_breaking(&breaking);
        }
        self.breaking = breaking;
        self.versions.touch_parameters();
    }

    /// What its springs bear.
    pub(crate) fn breaking(&self) -> Breaking {
        self.breaking
    }

    /// Comes apart where springs broke.
    pub(crate) fn come_apart(&mut self, ruptures: &[Rupture]) -> Damage {
        let topology = Arc::make_mut(&mut self.topology);
        self.versions.touch_structure();
        let Tear { splits, held, .. } = tear(topology, &mut self.positions, &mut self.velocities, ruptures);
        if !self.applied_forces.is_empty() {
            self.applied_forces.resize(self.positions.len(), Vec3::ZERO);
        }
        if !splits.is_empty() {
            self.tensions.clear();
        }
        let pieces = super::tear::pieces(&self.topology).into_iter().max().map_or(0, |last| last + 1);
        for rupture in ruptures {
            let spring = self.topology.springs.get(rupture.spring as usize);
            if spring.is_some_and(|(_, spring)| spring.stiffness == 0.0 && spring.damping == 0.0) {
                self.break_spring(rupture.spring);
                if let Some(spool) = &mut self.spool {
                    spool.break_link(rupture.spring);
                }
            }
        }
        let broken = ruptures.iter().map(|rupture| rupture.spring).filter(|spring| !held.contains(spring));
        Damage { broken: broken.collect(), pieces }
    }
}
