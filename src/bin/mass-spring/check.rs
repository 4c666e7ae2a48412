//! `mass-spring check`: counts, stability bounds, and what `Auto` would choose.

use std::f64::consts::TAU;
use std::fmt::{self, Write};
use std::process::ExitCode;

use bevy_mass_spring::ParticleNet;
use bevy_mass_spring::scene::{MassSpringScene, SceneNet, SceneSolver};
use bevy_mass_spring::solver::Plan;
use bevy_mass_spring::{Integrator, SubstepMode};

use crate::Failure;
use crate::arguments::{CheckArguments, read_scene};
use crate::output;
use crate::plan::{Content, plan, warnings};

pub fn check(arguments: &CheckArguments) -> Result<ExitCode, Failure> {
    let scene = read_scene(&arguments.scene)?;
    let mut text = String::new();
    describe(&scene, &mut text).expect("writing to a string does not fail");
    output::print(&text)?;
    Ok(ExitCode::SUCCESS)
}

fn describe(scene: &MassSpringScene, text: &mut String) -> fmt::Result {
    let content = Content::new(scene);
    let mut solver = content.initial_solver();
    let bounds = solver.frequency_bounds(scene.environment.effective_viscosity());
    let pinned_of_nets: usize = content.nets().iter().map(|net| net.pinned().len()).sum();
    let pinned = scene.particles.iter().filter(|particle| particle.pinned).count() + pinned_of_nets;
    writeln!(text, "particles               {} ({pinned} pinned)", scene.particle_count())?;
    writeln!(text, "springs                 {}", solver.spring_count())?;
    let topologies = content.nets().iter().map(ParticleNet::topology);
    let bends_of_nets: usize = topologies.map(|net| net.rods.len() + net.hinges.len()).sum();
    if !scene.bends.is_empty() || bends_of_nets > 0 {
        writeln!(text, "bends                   {}", scene.bends.len() + bends_of_nets)?;
    }
    if !scene.nets.is_empty() {
        writeln!(text, "nets                    {}", in_kinds(&scene.nets))?;
    }
    writeln!(text, "planes                  {}", scene.planes.len())?;
    if !scene.colliders.is_empty() {
        writeln!(text, "colliders               {}", scene.colliders.len())?;
    }
    writeln!(text, "time step               {} s", significant(scene.solver.time_step))?;
    let omega = bounds.angular_frequency;
    let (frequency, in_hertz) = (significant(omega), significant(omega / TAU));
    writeln!(text, "highest frequency       at most {frequency} rad/s ({in_hertz} Hz)")?;
    writeln!(text, "highest damping rate    at most {} 1/s", significant(bounds.damping_rate))?;
    writeln!(text, "largest stable substep")?;
    for integrator in Integrator::named() {
        let step = f64::from(bounds.largest_stable_step(integrator));
        let printed = match step {
            0.0 => "none".to_owned(),
            f64::INFINITY => "any".to_owned(),
            step => format!("{} s", significant(step)),
        };
        writeln!(text, "  {:<22}{printed}", integrator.to_string())?;
    }
    let automatic = SceneSolver { integrator: Integrator::Auto, substeps: SubstepMode::Auto, ..scene.solver };
    let automatic = MassSpringScene { solver: automatic, ..scene.clone() };
    writeln!(text, "Auto would choose       {}", in_words(plan(&automatic, &mut solver)))?;
    writeln!(text, "this scene would run    {}", in_words(plan(scene, &mut solver)))?;
    for warning in warnings(scene, &mut solver) {
        writeln!(text, "warning: {warning}")?;
    }
    Ok(())
}

/// How many there are, and of which kinds: `3 (2 ropes, 1 balloon)`.
fn in_kinds(nets: &[SceneNet]) -> String {
    let mut counts = [("rope", 0), ("cloth", 0), ("jelly", 0), ("balloon", 0)];
    for net in nets {
        let entry = counts.iter_mut().find(|(kind, _)| *kind == net.kind());
        entry.expect("the list has every kind").1 += 1;
    }
    let words = counts.iter().filter(|(_, count)| *count > 0).map(|(kind, count)| match (*kind, *count) {
        (kind, 1) => format!("1 {kind}"),
        ("jelly", count) => format!("{count} jellies"),
        (kind, count) => format!("{count} {kind}s"),
    });
    format!("{} ({})", nets.len(), words.collect::<Vec<_>>().join(", "))
}

/// Four significant digits, without an exponent where the number is of ordinary size.
fn significant(number: f64) -> String {
    if number == 0.0 || !(1e-6..1e9).contains(&number.abs()) {
        return format!("{number:.3e}").replace("0.000e0", "0");
    }
    let digits_before_point = number.abs().log10().floor() as i32 + 1;
    format!("{number:.*}", (4 - digits_before_point).max(0) as usize)
}

/// Schemes and substeps: `VelocityVerlet, 8 substeps a tick; TrBdf2, 2 substeps a tick on 120 springs`.
fn in_words(plan: Plan) -> String {
    let Plan { integrator, substeps, stiff_substeps, stiff_springs, .. } = plan;
    let words = |integrator: Integrator, substeps: u32| {
        let plural = if substeps == 1 { "" } else { "s" };
        format!("{integrator}, {substeps} substep{plural} a tick")
    };
    let mut text = words(integrator, substeps);
    if stiff_substeps > 0 {
        let implicit = words(Integrator::TrBdf2, stiff_substeps);
        let plural = if stiff_springs == 1 { "" } else { "s" };
        text += &format!("; {implicit} on {stiff_springs} spring{plural}");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_four_significant_digits() {
        for (number, printed) in [
            (0.0, "0"),
            (1.0 / 60.0, "0.01667"),
            (1.0, "1.000"),
            (12.3456, "12.35"),
            (123_456.7, "123457"),
            (1e-9, "1.000e-9"),
            (1e12, "1.000e12"),
        ] {
            assert_eq!(significant(number), printed);
        }
    }
}
