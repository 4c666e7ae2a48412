//! One peer in one scene: how long its ticks take, and its error after a second.

use std::time::{Duration, Instant};

use crate::peers::{Entry, Peer};
use crate::reference;
use crate::scene::{Scene, TICKS};

/// The measured second is repeated until this much time has been spent in ticks.
const TIME_TO_SPEND: Duration = Duration::from_secs(3);

/// Number of repetitions, at most.
const REPETITIONS: usize = 20;

/// A peer whose tick takes longer than this ends after [`SLOW_TICKS`] of them.
const SLOW: Duration = Duration::from_secs(1);

/// See [`SLOW`].
const SLOW_TICKS: usize = 5;

/// A peer with a greater error, m, has diverged, and its time is meaningless.
const DIVERGED: f64 = 100.0;

/// Measures, and returns the row of the table.
///
/// # Errors
/// Where the reference cannot be read or written.
pub fn row(scene: &Scene, entry: &Entry) -> std::io::Result<String> {
    let truth = reference::positions(scene)?;
    let mut durations = Vec::new();
    let mut repetitions = 0;
    loop {
        let mut peer = (entry.start)(scene);
        let ticks = simulate(peer.as_mut());
        repetitions += 1;
        // The first tick builds what the others use.
        durations.extend_from_slice(&ticks[1..]);
        let error = reference::root_mean_square_error(&peer.positions(), &truth);
        if error.is_nan() || error > DIVERGED {
            return Ok(format!("| {} | {} | – | – | – | exploded |", entry.name, peer.substeps()));
        }
        let slow = ticks.len() < TICKS;
        if slow || repetitions == REPETITIONS || durations.iter().sum::<Duration>() > TIME_TO_SPEND {
            let error = if slow { format!("stopped after {} ticks", ticks.len()) } else { digits(error) };
            return Ok(format!(
                "| {} | {} | {error} |",
                entry.name,
                times(scene, peer.substeps(), durations)
            ));
        }
    }
}

/// Runs the second, unless it is too slow, and returns what each tick took.
fn simulate(peer: &mut dyn Peer) -> Vec<Duration> {
    let mut ticks = Vec::with_capacity(TICKS);
    while ticks.len() < TICKS && ticks.iter().skip(1).filter(|tick| **tick > SLOW).count() < SLOW_TICKS {
        let start = Instant::now();
        peer.tick();
        ticks.push(start.elapsed());
    }
    ticks
}

/// Substeps, the minimum and the median in milliseconds, and the minimum in nanoseconds for each spring
/// and substep.
fn times(scene: &Scene, substeps: u32, mut durations: Vec<Duration>) -> String {
    durations.sort_unstable();
    let milliseconds = |duration: Duration| duration.as_secs_f64() * 1e3;
    let minimum = milliseconds(durations[0]);
    let median = milliseconds(durations[durations.len() / 2]);
    let nanoseconds = minimum * 1e6 / (scene.springs.len() as f64 * f64::from(substeps));
    format!("{substeps} | {} | {} | {}", digits(minimum), digits(median), digits(nanoseconds))
}

/// Three significant digits, more before the point.
fn digits(value: f64) -> String {
    let decimals = if value > 0.0 { (2 - value.log10().floor() as i32).clamp(0, 6) } else { 0 };
    format!("{value:.*}", decimals as usize)
}
