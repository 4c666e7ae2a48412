//! Nets as they are seen: between two ticks, their particles are on the way.

use std::borrow::Cow;

use bevy::camera::visibility::RenderLayers;
use bevy::ecs::system::SystemParam;
use bevy::prelude::*;

use crate::nets::ParticleNet;
#[cfg(feature = "render")]
use crate::render::easing::{self, NetEasing};

#[cfg(not(feature = "render"))]
type NetData = (Entity, Ref<'static, ParticleNet>, Option<&'static RenderLayers>);
#[cfg(feature = "render")]
type NetData = (Entity, Ref<'static, ParticleNet>, Option<&'static RenderLayers>, Option<&'static NetEasing>);

/// All nets.
#[derive(SystemParam)]
pub(super) struct SeenNets<'w, 's> {
    nets: Query<'w, 's, NetData>,
    #[cfg(feature = "render")]
    time: Option<Res<'w, Time<Fixed>>>,
}

/// A net in a frame.
pub(super) struct SeenNet<'a> {
    pub entity: Entity,
    pub net: &'a ParticleNet,
    pub layers: Option<&'a RenderLayers>,
    /// Where its particles are seen, m.
    pub places: Cow<'a, [Vec3]>,
}

impl SeenNets<'_, '_> {
    /// All nets in this frame.
    #[cfg(not(feature = "render"))]
    pub fn seen(&self) -> Vec<SeenNet<'_>> {
        let nets = self.nets.iter().map(|(entity, net, layers)| {
            let net = net.into_inner();
            SeenNet { entity, net, layers, places: Cow::Borrowed(net.positions()) }
        });
        nets.collect()
    }

    /// All nets in this frame.
    #[cfg(feature = "render")]
    pub fn seen(&self) -> Vec<SeenNet<'_>> {
        let nets = self.nets.iter().map(|(entity, net, layers, easing)| {
            let way = easing::way(&net, easing, self.time.as_deref());
            let net = net.into_inner();
            let places = match way {
                None => Cow::Borrowed(net.positions()),
                Some((starts, fraction)) => {
                    let (old, new) = net.positions().split_at(starts.len().min(net.len()));
                    let on_the_way = old.iter().zip(starts).map(|(end, start)| start.lerp(*end, fraction));
                    Cow::Owned(on_the_way.chain(new.iter().copied()).collect())
                }
            };
            SeenNet { entity, net, layers, places }
        });
        nets.collect()
    }
}
