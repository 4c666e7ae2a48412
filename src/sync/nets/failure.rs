//! Nets that break, and ropes on winches.

use bevy::prelude::*;

use super::super::state::{MassSpringState, Warnings};
use super::registry::NetPlace;
use crate::nets::{Breaking, Damage, Part, PartOf, ParticleNet, Rupture, Winch, Yielding};
use crate::particle::Pinned;
use crate::report::{Broke, TickReport};
use crate::solver;

/// Before the arrays are copied: gives the springs of nets what they bear.
pub(in crate::sync) fn give_breaking(mut nets: Query<(Entity, &mut ParticleNet, Ref<Breaking>)>) {
    for (entity, mut net, breaking) in &mut nets {
        if net.breaking() == *breaking {
            continue;
        }
        match breaking.validate() {
            Ok(()) => net.give_breaking(*breaking),
            Err(problem) if breaking.is_changed() => log::warn!("Breaking of net {entity}: {problem}"),
            Err(_) => {}
        }
    }
}

/// Before the arrays are copied: gives the springs of nets their yield strains.
pub(in crate::sync) fn give_yielding(mut nets: Query<(Entity, &mut ParticleNet, Ref<Yielding>)>) {
    for (entity, mut net, yielding) in &mut nets {
        if net.yielding() == *yielding {
            continue;
        }
        match yielding.validate() {
            Ok(()) => net.give_yielding(*yielding),
            Err(problem) if yielding.is_changed() => log::warn!("Yielding of net {entity}: {problem}"),
            Err(_) => {}
        }
    }
}

/// After the parts have moved: turns winches. In the first tick of a net, in which its initial state is recorded, it is still.
pub(in crate::sync) fn turn_winches(
    time: Res<Time>,
    state: Res<MassSpringState>,
    winches: Query<(Entity, &Winch, &Part, &PartOf), With<Pinned>>,
    mut nets: Query<&mut ParticleNet>,
    mut warnings: ResMut<Warnings>,
) {
    let time_step = f64::from(time.delta_secs());
    if time_step == 0.0 {
        return;
    }
    let is_placed = |entity: Entity| state.nets.get(entity).is_some_and(|net| net.place.is_some());
    for (entity, winch, part, PartOf(net_entity)) in &winches {
        let Ok(mut net) = nets.get_mut(*net_entity) else { continue };
        if !is_placed(*net_entity) {
            continue;
        }
        let is_at_start = matches!(part, Part::Start | Part::Particle(0));
        let problem = match winch.validate() {
            Err(problem) => problem.to_string(),
            Ok(()) if !is_at_start => "it is not at the start of its net".to_owned(),
            Ok(()) if net.turn_winch(winch, time_step) => continue,
            Ok(()) => format!("net {net_entity} is no open rope of links"),
        };
        warnings.warn_once(entity, format_args!("winch {entity} does not turn: {problem}"));
    }
}

/// Tears nets where springs broke in this tick, and publishes that. Returns whether any did.
pub(super) fn publish_breaks(
    (commands, messages): (&mut Commands, &mut MessageWriter<Broke>),
    (entity, net, place): (Entity, &mut Mut<ParticleNet>, &NetPlace),
    broken: &[solver::Broken],
    state: &solver::State,
    report: &mut TickReport,
) -> bool {
    let own = &place.ranges.springs;
    let is_own = |broken: &&solver::Broken| own.contains(&broken.spring);
    let number = |broken: &solver::Broken| (broken.spring - own.start) as u32;
    let ruptures: Vec<Rupture> = broken
        .iter()
        .filter(is_own)
        .map(|broken| Rupture { spring: number(broken), elongation: broken.elongation })
        .collect();
    if ruptures.is_empty() {
        return false;
    }
    let Damage { broken: parted, pieces } = net.come_apart(&ruptures);
    for broken in broken.iter().filter(is_own).filter(|broken| parted.contains(&number(broken))) {
        let broke = Broke {
            entity,
            tick: report.tick,
            tension: broken.tension,
            point: broken.point + state.origin,
            spring: Some(number(broken)),
            pieces: Some(pieces),
        };
        commands.trigger(broke);
        messages.write(broke);
        report.broken += 1;
    }
    true
}

/// Writes how far the springs of a net have yielded.
pub(super) fn note_yields(
    (net, place): (&mut Mut<ParticleNet>, &NetPlace),
    yielded: &[u32],
    state: &solver::State,
) {
    let own = &place.ranges.springs;
    for slot in yielded.iter().map(|slot| *slot as usize).filter(|slot| own.contains(slot)) {
        if let Some(plasticity) = state.spring(slot).and_then(|spring| spring.plasticity) {
            net.yield_spring((slot - own.start) as u32, plasticity.strain);
        }
    }
}
