//! What the plots show: a window of the last seconds, recorded tick by tick.

use std::collections::VecDeque;

use bevy::prelude::*;

use crate::diagnostics::Measurements;
use crate::nets::{Layout, ParticleNet};
use crate::report::{SpringForces, TickReport};

/// The length of the plotted window, s.
pub(super) const SECONDS: f64 = 10.0;
/// Maximum number of energy samples that are kept.
const MAX_ENERGY_SAMPLES: usize = 800;
/// Maximum number of points that are plotted along the springs.
const MAX_TENSION_POINTS: usize = 400;
/// Number of ticks over which the cost is averaged.
const COST_SAMPLES: usize = 60;

/// Energies at one moment, in J.
#[derive(Debug, Clone, Copy)]
pub(super) struct EnergySample {
    pub(super) time: f64,
    pub(super) kinetic: f64,
    pub(super) elastic: f64,
    pub(super) gravitational: f64,
}

/// The recorded samples, in ring buffers of fixed length.
#[derive(Resource, Default)]
pub(super) struct History {
    pub(super) energy: VecDeque<EnergySample>,
    /// (number of the spring, tension in N), of the last tick.
    pub(super) tension: Vec<[f64; 2]>,
    /// Milliseconds of gather, step and scatter.
    pub(super) cost: VecDeque<[f64; 3]>,
    last_tick: u64,
}

impl History {
    /// The mean cost of a tick in ms: gather, step, scatter.
    pub(super) fn mean_cost(&self) -> [f64; 3] {
        let count = self.cost.len().max(1) as f64;
        std::array::from_fn(|stage| self.cost.iter().fold(0.0, |sum, cost| sum + cost[stage]) / count)
    }

    fn record_energy(&mut self, time: f64, measurements: &Measurements) {
        let interval = SECONDS / MAX_ENERGY_SAMPLES as f64;
        // Half a microsecond of tolerance: the time is a sum of rounded steps.
        if self.energy.back().is_some_and(|last| time - last.time < interval - 5e-7) {
            return;
        }
        while self.energy.len() >= MAX_ENERGY_SAMPLES
            || self.energy.front().is_some_and(|first| time - first.time > SECONDS)
        {
            self.energy.pop_front();
        }
        self.energy.push_back(EnergySample {
            time,
            kinetic: measurements.kinetic_energy,
            elastic: measurements.elastic_energy,
            gravitational: measurements.gravitational_energy,
        });
    }

    /// Long nets are plotted as the largest tension of each group of neighbours.
    fn record_tension(&mut self, count: usize, tension: impl Fn(usize) -> f32) {
        let group = count.div_ceil(MAX_TENSION_POINTS).max(1);
        self.tension.clear();
        self.tension.extend((0..count).step_by(group).map(|first| {
            let springs = first..count.min(first + group);
            let largest = springs.map(&tension).fold(f32::NEG_INFINITY, f32::max);
            [first as f64 + 1.0, f64::from(largest)]
        }));
    }

    fn record_cost(&mut self, report: &TickReport) {
        if self.cost.len() >= COST_SAMPLES {
            self.cost.pop_front();
        }
        let stages = [report.gather_time, report.step_time, report.scatter_time];
        self.cost.push_back(stages.map(|stage| stage.as_secs_f64() * 1e3));
    }
}

/// A tick counter that runs backwards means a restart: the history is cleared.
pub(super) fn reset_after_restart(mut history: ResMut<History>, report: Res<TickReport>) {
    if report.tick < history.last_tick {
        *history = History { last_tick: report.tick, ..default() };
    }
}

/// Records one tick.
pub(super) fn record_history(
    mut history: ResMut<History>,
    time: Res<Time>,
    (report, measurements): (Res<TickReport>, Res<Measurements>),
    forces: Res<SpringForces>,
    nets: Query<&ParticleNet>,
) {
    history.last_tick = report.tick;
    history.record_energy(time.elapsed_secs_f64(), &measurements);
    history.record_cost(&report);

    if forces.tensions.is_empty() {
        let is_rope = |net: &&ParticleNet| matches!(net.topology().layout, Layout::Rope { .. });
        let rope = nets.iter().find(is_rope);
        let count = rope.map_or(0, |rope| rope.topology().springs.len());
        history.record_tension(count, |spring| rope.map_or(0.0, |rope| rope.tension(spring)));
    } else {
        history.record_tension(forces.tensions.len(), |spring| forces.tensions[spring].1);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_nets_are_plotted_as_the_largest_of_each_group() {
        let mut history = History::default();
        history.record_tension(3, |spring| spring as f32 - 1.0);
        assert_eq!(history.tension, [[1.0, -1.0], [2.0, 0.0], [3.0, 1.0]]);
        history.record_tension(MAX_TENSION_POINTS + 1, |spring| -(spring as f32));
        let last = MAX_TENSION_POINTS as f64;
        assert_eq!(history.tension[..2], [[1.0, 0.0], [3.0, -2.0]]);
        assert_eq!(history.tension.last(), Some(&[last + 1.0, -last]));
        history.record_tension(0, |_| 0.0);
        assert!(history.tension.is_empty());
    }

    #[test]
    fn the_window_is_bounded_in_time_and_in_number() {
        let mut history = History::default();
        for tick in 0..20_000 {
            history.record_energy(f64::from(tick) * 1e-3, &Measurements::default());
        }
        let (first, last) = (history.energy.front().unwrap().time, history.energy.back().unwrap().time);
        assert!(history.energy.len() <= MAX_ENERGY_SAMPLES);
        assert!((last - first) > 0.9 * SECONDS && (last - first) <= SECONDS + 1e-9, "{first} to {last}");
    }
}
