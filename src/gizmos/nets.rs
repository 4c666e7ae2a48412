//! Particles and springs of nets, where they are seen.

use bevy::ecs::system::SystemParam;
use bevy::prelude::*;

use super::MassSpringGizmos;
use crate::nets::{PartState, ParticleNet, Parts};
use crate::particle::Pinned;
use crate::report::SleepingParticles;
use crate::settings::Dimensions;

#[cfg(not(feature = "render"))]
type NetData = (Entity, Ref<'static, ParticleNet>, Option<&'static Parts>);
#[cfg(feature = "render")]
type NetData = (Entity, Ref<'static, ParticleNet>, Option<&'static Parts>, Option<&'static NetEasing>);
#[cfg(feature = "render")]
use crate::render::easing::NetEasing;

/// All nets.
#[derive(SystemParam)]
pub(super) struct SeenNets<'w, 's> {
    nets: Query<'w, 's, NetData>,
    parts: Query<'w, 's, &'static PartState, With<Pinned>>,
    #[cfg(feature = "render")]
    time: Option<Res<'w, Time<Fixed>>>,
}

/// A net in a frame.
pub(super) struct SeenNet<'a> {
    entity: Entity,
    pub net: Ref<'a, ParticleNet>,
    parts: Option<&'a Parts>,
    /// Where its particles come from, and the part of the way that lies behind.
    way: Option<(&'a [Vec3], f32)>,
}

impl SeenNet<'_> {
    /// Where a particle is seen.
    pub fn place(&self, particle: u32) -> Option<Vec3> {
        let end = *self.net.positions().get(particle as usize)?;
        let start = self.way.and_then(|(starts, fraction)| Some((*starts.get(particle as usize)?, fraction)));
        Some(start.map_or(end, |(start, fraction)| start.lerp(end, fraction)))
    }
}

impl SeenNets<'_, '_> {
    fn iter(&self) -> impl Iterator<Item = SeenNet<'_>> {
        self.nets.iter().map(|data| self.see(data))
    }

    /// The net of an entity.
    #[cfg(feature = "drag")]
    pub fn get(&self, net: Entity) -> Option<SeenNet<'_>> {
        self.nets.get(net).ok().map(|data| self.see(data))
    }

    #[cfg(not(feature = "render"))]
    fn see<'a>(
        &self,
        (entity, net, parts): (Entity, Ref<'a, ParticleNet>, Option<&'a Parts>),
    ) -> SeenNet<'a> {
        SeenNet { entity, net, parts, way: None }
    }

    #[cfg(feature = "render")]
    fn see<'a>(
        &self,
        (entity, net, parts, easing): (
            Entity,
            Ref<'a, ParticleNet>,
            Option<&'a Parts>,
            Option<&'a NetEasing>,
        ),
    ) -> SeenNet<'a> {
        let way = crate::render::easing::way(&net, easing, self.time.as_deref());
        SeenNet { entity, net, parts, way }
    }

    /// The particles that are pinned, by themselves or by a part, in ascending order; also before the next tick, and
    /// while time is paused.
    fn find_pinned(&self, net: &SeenNet, pinned: &mut Vec<u32>) {
        pinned.clear();
        pinned.extend(net.net.pinned());
        let parts = net.parts.map_or(&[][..], Parts::entities).iter();
        pinned.extend(
            parts.filter_map(|part| self.parts.get(*part).ok()).flat_map(PartState::particles).copied(),
        );
        pinned.sort_unstable();
    }
}

pub(super) fn draw_particles(
    mut gizmos: Gizmos<MassSpringGizmos>,
    nets: SeenNets,
    sleeping: Option<Res<SleepingParticles>>,
    mut pinned: Local<Vec<u32>>,
) {
    if !gizmos.config_ext.particles {
        return;
    }
    for net in nets.iter() {
        nets.find_pinned(&net, &mut pinned);
        for particle in 0..net.net.len() as u32 {
            let Some(place) = net.place(particle) else { continue };
            let is_pinned = pinned.binary_search(&particle).is_ok();
            let is_asleep =
                sleeping.as_ref().is_some_and(|sleeping| sleeping.contains(net.entity, Some(particle)));
            let color = gizmos.config_ext.color_of_particle(is_pinned, is_asleep);
            gizmos.sphere(place, net.net.radius(), color).resolution(16);
        }
    }
}

pub(super) fn draw_springs(
    mut gizmos: Gizmos<MassSpringGizmos>,
    nets: SeenNets,
    dimensions: Option<Res<Dimensions>>,
) {
    if !gizmos.config_ext.springs {
        return;
    }
    let is_flat = dimensions.is_some_and(|dimensions| *dimensions == Dimensions::Two);
    for net in nets.iter() {
        for (number, ([first, second], spring)) in (0..).zip(&net.net.topology().springs) {
            if net.net.broken().binary_search(&number).is_ok() {
                continue;
            }
            let (Some(first), Some(second)) = (net.place(*first), net.place(*second)) else { continue };
            let length = super::length([first, second], is_flat);
            let color =
                gizmos.config_ext.color_of_stretch(spring.length_at_rest(), spring.tension_only, length);
            gizmos.line(first, second, color);
        }
    }
}
