//! Where a net is drawn between two ticks.
//!
//! As for particles, a frame shows the way from the last tick but one to the last: half a tick late on average, and
//! smooth at any frame rate. It costs one copy of the positions a tick, and only of nets that moved.
//!
//! Free particles that were moved from outside are drawn where they were put. Pinned ones are moved so in every tick, and
//! the solver takes them there in the course of it: they are drawn on that way, like what hangs from them.

use bevy::ecs::change_detection::Tick;
use bevy::prelude::*;

use crate::nets::ParticleNet;

/// Where the particles of a net were before the last tick.
#[derive(Component, Debug, Default)]
#[component(clone_behavior = Ignore)]
pub(crate) struct NetEasing {
    start: Vec<Vec3>,
    /// When the net had last been changed as `start` was copied, and as the last tick ended.
    copied: Option<Tick>,
    ended: Option<Tick>,
    /// Whether a pinned particle moved in the last tick.
    do_pins_move: bool,
}

impl NetEasing {
    /// Whether there is a way to show to a net that was last changed then: not of ticks that it was not changed in, and what
    /// was changed after the last tick was put there.
    fn shows(&self, changed: Tick) -> bool {
        (self.do_pins_move || self.copied != Some(changed)) && self.ended == Some(changed)
    }
}

/// The positions of a net in a frame: from `start` to `end`.
#[derive(Debug, Clone, Copy)]
pub(super) struct NetView<'a> {
    /// `None`: all particles are where they are drawn. Particles that are newer than the last tick have none.
    pub start: Option<&'a [Vec3]>,
    pub end: &'a [Vec3],
    /// The part of the way that lies behind, 0 to 1.
    pub fraction: f32,
}

/// What distinguishes the pictures of a net: equal versions are drawn alike.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct NetVersion {
    changed: Tick,
    /// 1 where nothing is eased.
    fraction: f32,
}

impl NetVersion {
    /// Whether the particles may have moved between `self` and `other`, other than along the way of one tick.
    pub fn is_same_tick(&self, other: &Self) -> bool {
        self.changed == other.changed && (self.fraction == 1.0) == (other.fraction == 1.0)
    }
}

/// The positions to draw.
pub(super) fn view<'a>(
    net: &'a Ref<ParticleNet>,
    easing: Option<&'a NetEasing>,
    fraction: f32,
) -> (NetView<'a>, NetVersion) {
    let changed = net.last_changed();
    let start = easing.filter(|easing| easing.shows(changed)).map(|easing| easing.start.as_slice());
    let fraction = if start.is_some() { fraction.clamp(0.0, 1.0) } else { 1.0 };
    (NetView { start, end: net.positions(), fraction }, NetVersion { changed, fraction })
}

/// Where the particles of a net come from in a frame, and the part of the way that lies behind; `None`: all are seen where
/// they are. For what else is drawn at a net.
#[cfg(any(feature = "drag", feature = "gizmos"))]
pub(crate) fn way<'a>(
    net: &Ref<ParticleNet>,
    easing: Option<&'a NetEasing>,
    time: Option<&Time<Fixed>>,
) -> Option<(&'a [Vec3], f32)> {
    let changed = net.last_changed();
    let easing = easing.filter(|easing| easing.shows(changed))?;
    Some((&easing.start, fraction(time).clamp(0.0, 1.0)))
}

/// The part of the way between the last two ticks at which frames are drawn.
pub(super) fn fraction(time: Option<&Time<Fixed>>) -> f32 {
    time.map_or(1.0, Time::overstep_fraction)
}

#[cfg(feature = "interpolation")]
pub(crate) use ticks::ease_nets;

#[cfg(feature = "interpolation")]
mod ticks {
    use super::*;
    use crate::schedule::{MassSpringSystems, SimulationSchedule};

    /// Eases the nets of an app. To be called when its plugins are finished.
    pub(crate) fn ease_nets(app: &mut App) {
        let Some(&SimulationSchedule(schedule)) = app.world().get_resource() else { return };
        if app.try_register_required_components::<ParticleNet, NetEasing>().is_err() {
            let world = app.world_mut();
            let existing: Vec<Entity> =
                world.query_filtered::<Entity, With<ParticleNet>>().iter(world).collect();
            for net in existing {
                world.entity_mut(net).insert(NetEasing::default());
            }
            app.add_observer(|added: On<Add, ParticleNet>, mut commands: Commands| {
                commands.entity(added.entity).try_insert(NetEasing::default());
            });
        }
        // What was moved before this tick, or by its gather, starts from where it was put.
        app.add_systems(
            schedule,
            copy_starts.after(MassSpringSystems::Gather).before(MassSpringSystems::Step),
        )
        .add_systems(FixedLast, note_ends);
    }

    fn copy_starts(mut nets: Query<(Ref<ParticleNet>, &mut NetEasing)>) {
        for (net, mut easing) in &mut nets {
            let changed = Some(net.last_changed());
            if easing.copied != changed {
                easing.start.clear();
                easing.start.extend_from_slice(net.positions());
                easing.copied = changed;
            }
        }
    }

    fn note_ends(mut nets: Query<(Ref<ParticleNet>, &mut NetEasing)>, time: Res<Time>) {
        for (net, mut easing) in &mut nets {
            let NetEasing { start, ended, do_pins_move, .. } = &mut *easing;
            *ended = Some(net.last_changed());
            *do_pins_move = false;
            for &pinned in net.pinned().iter().chain(&net.part_actions().held) {
                let (position, velocity) =
                    (net.positions()[pinned as usize], net.velocities()[pinned as usize]);
                // As the starts were copied it was at its end already. Its velocity is that of its way.
                if let Some(start) = start.get_mut(pinned as usize) {
                    *start = position - velocity * time.delta_secs();
                    *do_pins_move |= velocity != Vec3::ZERO;
                }
            }
        }
    }
}
