//! A logger that records the lines of the crate, for the tests of warnings.

use std::sync::{Mutex, MutexGuard, PoisonError};

use log::{Level, LevelFilter, Log, Metadata, Record};

static LINES: Mutex<Vec<(Level, String)>> = Mutex::new(Vec::new());
static HOLDER: Mutex<()> = Mutex::new(());
static RECORDER: Recorder = Recorder;

struct Recorder;

impl Log for Recorder {
    fn enabled(&self, metadata: &Metadata) -> bool {
        metadata.target().starts_with("bevy_mass_spring")
    }

    fn log(&self, record: &Record) {
        if self.enabled(record.metadata()) {
            lock(&LINES).push((record.level(), record.args().to_string()));
        }
    }

    fn flush(&self) {}
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The lines logged while this exists.
///
/// The log belongs to the whole process, so only one test at a time holds it: in a test binary that
/// uses it, every test that may make the crate log must hold it.
pub struct Logged(#[expect(dead_code, reason = "held for its drop")] MutexGuard<'static, ()>);

impl Logged {
    pub fn start() -> Self {
        let holder = lock(&HOLDER);
        // Another test of this process may have installed it already.
        let _ = log::set_logger(&RECORDER);
        log::set_max_level(LevelFilter::Trace);
        lock(&LINES).clear();
        Self(holder)
    }

    /// The lines logged since the last call.
    pub fn take(&self) -> Vec<String> {
        std::mem::take(&mut *lock(&LINES)).into_iter().map(|(_, line)| line).collect()
    }

    /// The single line that was logged since the last call.
    #[track_caller]
    pub fn take_one(&self) -> String {
        let mut lines = self.take();
        assert_eq!(lines.len(), 1, "expected exactly one log line, got {lines:#?}");
        lines.remove(0)
    }

    #[track_caller]
    pub fn assert_silent(&self) {
        let lines = self.take();
        assert!(lines.is_empty(), "expected no log lines, got {lines:#?}");
    }
}
