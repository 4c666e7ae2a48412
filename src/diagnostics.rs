//! Energy, momentum, extremes and costs, for plots and for Bevy's [`DiagnosticsStore`].
//!
//! [`DiagnosticsStore`]: bevy::diagnostic::DiagnosticsStore

use bevy::diagnostic::{Diagnostic, DiagnosticPath, Diagnostics, RegisterDiagnostic};
use bevy::prelude::*;

use crate::report::TickReport;
use crate::schedule::{MassSpringSystems, simulation_schedule, time_advances};
pub use crate::solver::Measurements;

/// Computes [`Measurements`] each tick and records them, with the cost of each stage, into Bevy's
/// [`DiagnosticsStore`](bevy::diagnostic::DiagnosticsStore), where `LogDiagnosticsPlugin` and
/// overlays find them.
///
/// It runs after [`MassSpringSystems::Scatter`] in the schedule of
/// [`MassSpringPlugin`](crate::MassSpringPlugin), added before or after it.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_mass_spring::prelude::*;
/// # let mut app = App::new();
/// # app.add_plugins(MinimalPlugins);
/// app.add_plugins((MassSpringPlugin::new(FixedUpdate), MassSpringDiagnosticsPlugin));
/// # app.finish();
/// # app.update();
/// ```
#[derive(Debug, Clone, Copy, Default)]
pub struct MassSpringDiagnosticsPlugin;

impl MassSpringDiagnosticsPlugin {
    /// Kinetic energy, J.
    pub const KINETIC_ENERGY: DiagnosticPath = DiagnosticPath::const_new("mass_spring/kinetic_energy");
    /// Elastic energy, J.
    pub const ELASTIC_ENERGY: DiagnosticPath = DiagnosticPath::const_new("mass_spring/elastic_energy");
    /// Gravitational energy, J.
    pub const GRAVITATIONAL_ENERGY: DiagnosticPath =
        DiagnosticPath::const_new("mass_spring/gravitational_energy");
    /// Total energy, J.
    pub const TOTAL_ENERGY: DiagnosticPath = DiagnosticPath::const_new("mass_spring/total_energy");
    /// Magnitude of the total momentum, N·s.
    pub const MOMENTUM: DiagnosticPath = DiagnosticPath::const_new("mass_spring/momentum");
    /// Largest speed, m/s.
    pub const MAX_SPEED: DiagnosticPath = DiagnosticPath::const_new("mass_spring/max_speed");
    /// Largest relative stretch of a spring.
    pub const MAX_STRETCH: DiagnosticPath = DiagnosticPath::const_new("mass_spring/max_stretch");
    /// Substeps of the tick.
    pub const SUBSTEPS: DiagnosticPath = DiagnosticPath::const_new("mass_spring/substeps");
    /// Steps of TR-BDF2 for the stiff parts of the net, where `Auto` integrates them separately.
    pub const STIFF_SUBSTEPS: DiagnosticPath = DiagnosticPath::const_new("mass_spring/stiff_substeps");
    /// Springs in those parts.
    pub const STIFF_SPRINGS: DiagnosticPath = DiagnosticPath::const_new("mass_spring/stiff_springs");
    /// Touching pairs.
    pub const CONTACTS: DiagnosticPath = DiagnosticPath::const_new("mass_spring/contacts");
    /// Wall time of the gather stage, ms.
    pub const GATHER_TIME: DiagnosticPath = DiagnosticPath::const_new("mass_spring/gather_time");
    /// Wall time of the solver's step, ms.
    pub const STEP_TIME: DiagnosticPath = DiagnosticPath::const_new("mass_spring/step_time");
    /// Wall time of the scatter stage, ms.
    pub const SCATTER_TIME: DiagnosticPath = DiagnosticPath::const_new("mass_spring/scatter_time");

    const UNITS: [(DiagnosticPath, &'static str); 14] = [
        (Self::KINETIC_ENERGY, "J"),
        (Self::ELASTIC_ENERGY, "J"),
        (Self::GRAVITATIONAL_ENERGY, "J"),
        (Self::TOTAL_ENERGY, "J"),
        (Self::MOMENTUM, "N·s"),
        (Self::MAX_SPEED, "m/s"),
        (Self::MAX_STRETCH, ""),
        (Self::SUBSTEPS, ""),
        (Self::STIFF_SUBSTEPS, ""),
        (Self::STIFF_SPRINGS, ""),
        (Self::CONTACTS, ""),
        (Self::GATHER_TIME, "ms"),
        (Self::STEP_TIME, "ms"),
        (Self::SCATTER_TIME, "ms"),
    ];
}

impl Plugin for MassSpringDiagnosticsPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<Measurements>();
        for (path, unit) in Self::UNITS {
            app.register_diagnostic(Diagnostic::new(path).with_suffix(unit));
        }
    }

    fn finish(&self, app: &mut App) {
        if let Some(schedule) = simulation_schedule(app) {
            app.add_systems(
                schedule,
                record_diagnostics.after(MassSpringSystems::Scatter).run_if(time_advances),
            );
        }
    }
}

fn record_diagnostics(measurements: Res<Measurements>, report: Res<TickReport>, mut store: Diagnostics) {
    type Paths = MassSpringDiagnosticsPlugin;
    let milliseconds = |time: std::time::Duration| time.as_secs_f64() * 1e3;
    store.add_measurement(&Paths::KINETIC_ENERGY, || measurements.kinetic_energy);
    store.add_measurement(&Paths::ELASTIC_ENERGY, || measurements.elastic_energy);
    store.add_measurement(&Paths::GRAVITATIONAL_ENERGY, || measurements.gravitational_energy);
    store.add_measurement(&Paths::TOTAL_ENERGY, || measurements.total_energy());
    store.add_measurement(&Paths::MOMENTUM, || measurements.momentum.length());
    store.add_measurement(&Paths::MAX_SPEED, || measurements.max_speed);
    store.add_measurement(&Paths::MAX_STRETCH, || measurements.max_stretch);
    store.add_measurement(&Paths::SUBSTEPS, || f64::from(report.substeps));
    store.add_measurement(&Paths::STIFF_SUBSTEPS, || f64::from(report.stiff_substeps));
    store.add_measurement(&Paths::STIFF_SPRINGS, || report.stiff_springs as f64);
    store.add_measurement(&Paths::CONTACTS, || report.contacts as f64);
    store.add_measurement(&Paths::GATHER_TIME, || milliseconds(report.gather_time));
    store.add_measurement(&Paths::STEP_TIME, || milliseconds(report.step_time));
    store.add_measurement(&Paths::SCATTER_TIME, || milliseconds(report.scatter_time));
}
