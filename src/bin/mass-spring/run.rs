//! `mass-spring run`: a number of ticks, as fast as possible.

use std::io::{self, IsTerminal};
use std::path::Path;
use std::process::ExitCode;
use std::time::Duration;

use bevy_mass_spring::scene::MassSpringScene;
use indicatif::{ProgressBar, ProgressStyle};

use crate::arguments::RunArguments;
use crate::output::{Sink, Sinks, Summary};
use crate::plan::{Content, plan, warnings};
use crate::simulation::{ParticleState, Simulation, state_hash};
use crate::{Failure, say};

pub fn run(arguments: &RunArguments) -> Result<ExitCode, Failure> {
    let scene = arguments.read_scene()?;
    let ticks = arguments.tick_count(scene.solver.time_step)?;
    // The last thing that can be refused: from here on, there is something to write.
    let Sinks { csv, json } = Sinks::open(arguments)?;
    let content = Content::new(&scene);
    for warning in warnings(&scene, &mut content.initial_solver()) {
        say(&format!("warning: {warning}"));
    }
    let mut simulation = Simulation::new(&scene, arguments.threads.map(usize::from));
    let mut recorder = Recorder { csv, every: arguments.every, ticks, time_step: scene.solver.time_step };
    recorder.start(&simulation)?;
    let bar = progress_bar(arguments, ticks);
    let mut costs = Costs::default();
    for tick in 1..=ticks {
        let cost = simulation.tick();
        costs.updates.push(milliseconds(cost.update));
        costs.steps.push(milliseconds(cost.step));
        recorder.record(tick, &simulation)?;
        bar.set_position(tick);
        if json.is_none() && recorder.has_no_reader() {
            break;
        }
    }
    bar.finish_and_clear();
    recorder.finish()?;
    let summary = summarize(&content, ticks, &simulation, costs);
    if let Some(mut json) = json {
        json.write_summary(&summary)?;
        json.finish()?;
    }
    Ok(verdict(&simulation, summary.finite))
}

fn verdict(simulation: &Simulation, finite: bool) -> ExitCode {
    if let Some(fault) = simulation.fault() {
        let of_net = fault
            .net
            .map_or_else(String::new, |(net, number)| format!(" (nets[{net}], its particle {number})"));
        say(&format!("particle {}{of_net} became non-finite in tick {}", fault.particle, fault.tick));
    }
    if finite { ExitCode::SUCCESS } else { ExitCode::from(1) }
}

/// Writes the ticks that belong into the CSV.
struct Recorder {
    csv: Option<Sink>,
    every: u64,
    ticks: u64,
    time_step: f64,
}

impl Recorder {
    fn start(&mut self, simulation: &Simulation) -> Result<(), Failure> {
        if let Some(csv) = &mut self.csv {
            csv.write_header()?;
        }
        self.write(0, simulation)
    }

    fn record(&mut self, tick: u64, simulation: &Simulation) -> Result<(), Failure> {
        if tick.is_multiple_of(self.every) || tick == self.ticks {
            self.write(tick, simulation)?;
        }
        Ok(())
    }

    fn write(&mut self, tick: u64, simulation: &Simulation) -> Result<(), Failure> {
        match &mut self.csv {
            Some(csv) => csv.write_rows(tick, tick as f64 * self.time_step, &simulation.states()),
            None => Ok(()),
        }
    }

    fn has_no_reader(&self) -> bool {
        self.csv.as_ref().is_some_and(Sink::is_closed)
    }

    fn finish(self) -> Result<(), Failure> {
        self.csv.map_or(Ok(()), Sink::finish)
    }
}

/// The cost of every tick, ms.
#[derive(Default)]
struct Costs {
    updates: Vec<f32>,
    steps: Vec<f32>,
}

fn summarize(content: &Content, ticks: u64, simulation: &Simulation, costs: Costs) -> Summary {
    let scene = content.scene;
    let states = simulation.states();
    let state = |index: usize| [states[index].position, states[index].velocity];
    let mut last = content.solver(state, &simulation.nets());
    simulation.broken_springs().for_each(|spring| last.remove_spring(spring));
    let totals = last.measure(scene.environment.effective_gravity());
    let report = simulation.report();
    let (integrator, substeps) = if report.tick == 0 {
        let plan = plan(scene, &mut content.initial_solver());
        (plan.integrator, plan.substeps)
    } else {
        (report.integrator, report.substeps)
    };
    let all_finite = states.iter().all(|state| state.position.is_finite() && state.velocity.is_finite());
    Summary {
        particles: states.len(),
        springs: last.spring_count(),
        ticks,
        time: ticks as f64 * scene.solver.time_step,
        integrator: integrator.to_string(),
        substeps,
        threads: simulation.threads(),
        finite: all_finite && simulation.fault().is_none() && report.faults == 0,
        max_stretch: totals.max_stretch,
        mean_stretch: totals.mean_stretch,
        kinetic_energy: totals.kinetic_energy,
        elastic_energy: totals.elastic_energy,
        gravitational_energy: totals.gravitational_energy,
        momentum: totals.momentum.to_array(),
        contacts: report.contacts,
        milliseconds_per_tick: median(costs.updates),
        milliseconds_per_step: median(costs.steps),
        state_hash: state_hash(&states),
        nets: scene.nets.len(),
        broken: report.broken,
        max_depth: max_depth(scene, simulation, &states, |index| last.radius(index)),
    }
}

/// How deep the surface of a particle is inside a plane or collider, m; 0 if none is.
fn max_depth(
    scene: &MassSpringScene,
    simulation: &Simulation,
    states: &[ParticleState],
    radius: impl Fn(usize) -> f32,
) -> f64 {
    let mut deepest = 0.0_f64;
    for plane in &scene.planes {
        let Some(normal) = plane.unit_normal() else { continue };
        for (index, state) in states.iter().enumerate() {
            let height = (state.position.as_dvec3() - plane.point.as_dvec3()).dot(normal);
            deepest = deepest.max(f64::from(radius(index)) - height);
        }
    }
    for (collider, place) in scene.colliders.iter().zip(simulation.collider_places()) {
        let Some(depth) = collider.shape.depth_meter() else { continue };
        for (index, state) in states.iter().enumerate().filter(|(_, state)| state.position.is_finite()) {
            let apart = state.position.as_dvec3() - place.translation.as_dvec3();
            let local = place.rotation.as_dquat().normalize().inverse() * apart;
            deepest = deepest.max(depth(local, radius(index)));
        }
    }
    deepest
}

fn milliseconds(duration: Duration) -> f32 {
    (duration.as_secs_f64() * 1e3) as f32
}

/// The median; of an even number of values the upper one of the two in the middle; of none 0.
fn median(mut values: Vec<f32>) -> f32 {
    if values.is_empty() {
        return 0.0;
    }
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f32::total_cmp).1
}

/// A bar on stderr, where that is a terminal that does not show the CSV as well.
fn progress_bar(arguments: &RunArguments, ticks: u64) -> ProgressBar {
    let csv_on_screen = arguments.csv.as_deref() == Some(Path::new("-")) && io::stdout().is_terminal();
    if csv_on_screen || !io::stderr().is_terminal() {
        return ProgressBar::hidden();
    }
    let style = ProgressStyle::with_template("{wide_bar} {pos}/{len} ticks, {per_sec}, {eta} left")
        .expect("the template is well-formed");
    ProgressBar::new(ticks).with_style(style)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn medians() {
        assert_eq!(median(vec![]), 0.0);
        assert_eq!(median(vec![3.0]), 3.0);
        assert_eq!(median(vec![9.0, 1.0, 5.0]), 5.0);
    }
}
