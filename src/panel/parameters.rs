//! Every parameter of the simulation, live.

use std::time::Duration;

use bevy::prelude::*;
use bevy_egui::egui::{self, Ui};

use super::widgets::{Scale, TEXT_SIZE, field, parameter, row, slider};
use crate::collider::{CollisionSettings, ParticleCollider};
use crate::environment::{Environment, Gusts};
use crate::particle::{Particle, Pinned};
use crate::settings::{Integrator, SleepSettings, SolverSettings, SubstepMode};
use crate::spring::Spring;

/// Gravity, viscosity, and the air; `calmed` are the gusts that were switched off last.
pub(super) fn draw_environment(
    mut ui: InMut<Ui>,
    mut environment: ResMut<Environment>,
    mut calmed: Local<Gusts>,
) {
    let mut edited = *environment;
    row(&mut ui, "gravity", |ui| {
        ui.checkbox(&mut edited.gravity_enabled, "").on_hover_text("key g");
        ui.add_enabled_ui(edited.gravity_enabled, |ui| {
            for value in [&mut edited.gravity.x, &mut edited.gravity.y, &mut edited.gravity.z] {
                field(ui, value, -100.0..=100.0);
            }
            ui.label("m/s²");
        });
    });
    row(&mut ui, "viscosity", |ui| {
        ui.checkbox(&mut edited.viscosity_enabled, "").on_hover_text("key v");
        ui.add_enabled_ui(edited.viscosity_enabled, |ui| {
            slider(ui, "N·s/m", &mut edited.viscosity, 0.0..=10.0, Scale::Logarithmic(1e-3));
        });
    });
    row(&mut ui, "wind", |ui| {
        ui.checkbox(&mut edited.air_enabled, "").on_hover_text("whether the air acts");
        ui.add_enabled_ui(edited.air_enabled, |ui| {
            for value in [&mut edited.wind.x, &mut edited.wind.y, &mut edited.wind.z] {
                field(ui, value, -100.0..=100.0);
            }
            ui.label("m/s");
        });
    });
    ui.add_enabled_ui(edited.air_enabled, |ui| {
        let density = &mut edited.air_density;
        parameter(ui, "air density", "kg/m³", density, 0.0..=1000.0, Scale::Logarithmic(0.1));
        row(ui, "gusts", |ui| {
            let mut gusts = edited.gusts.unwrap_or(*calmed);
            let mut is_gusty = edited.gusts.is_some();
            ui.checkbox(&mut is_gusty, "");
            ui.add_enabled_ui(is_gusty, |ui| {
                slider(ui, "m/s", &mut gusts.strength, 0.0..=20.0, Scale::Linear);
            });
            *calmed = gusts;
            edited.gusts = is_gusty.then_some(gusts);
        });
    });
    environment.set_if_neq(edited);
}

/// Mass and radius of all particles; stiffness, damping and rest length of all springs.
pub(super) fn draw_matter(
    mut ui: InMut<Ui>,
    mut particles: Query<(&mut Particle, Has<Pinned>)>,
    mut springs: Query<&mut Spring>,
) {
    let free = || particles.iter().filter(|(_, pinned)| !pinned).map(|(particle, _)| *particle);
    if let Some(first) = free().next().or_else(|| particles.iter().next().map(|(particle, _)| *particle)) {
        let uniform = free().all(|particle| particle == first);
        let mut edited = first;
        parameter(&mut ui, "mass", "kg", &mut edited.mass, 0.001..=100.0, Scale::Logarithmic(1e-3));
        parameter(&mut ui, "radius", "m", &mut edited.radius, 0.0..=0.5, Scale::Logarithmic(1e-2));
        note_mixture(&mut ui, uniform, "particles differ: the first is shown");
        for (mut particle, _) in &mut particles {
            copy_if_edited(&mut particle, |particle| &mut particle.mass, first.mass, edited.mass);
            copy_if_edited(&mut particle, |particle| &mut particle.radius, first.radius, edited.radius);
        }
    }
    if let Some(first) = springs.iter().next().copied() {
        let parameters = |spring: &Spring| (spring.rest_length, spring.stiffness, spring.damping);
        let uniform = springs.iter().all(|spring| parameters(spring) == parameters(&first));
        let mut edited = first;
        parameter(&mut ui, "stiffness", "N/m", &mut edited.stiffness, 0.0..=1e6, Scale::Logarithmic(1.0));
        parameter(&mut ui, "damping", "N·s/m", &mut edited.damping, 0.0..=1e3, Scale::Logarithmic(1e-2));
        parameter(&mut ui, "rest length", "m", &mut edited.rest_length, 0.0..=2.0, Scale::Logarithmic(1e-2));
        note_mixture(&mut ui, uniform, "springs differ: the first is shown");
        for mut spring in &mut springs {
            copy_if_edited(&mut spring, |spring| &mut spring.stiffness, first.stiffness, edited.stiffness);
            copy_if_edited(&mut spring, |spring| &mut spring.damping, first.damping, edited.damping);
            copy_if_edited(
                &mut spring,
                |spring| &mut spring.rest_length,
                first.rest_length,
                edited.rest_length,
            );
        }
    }
}

fn note_mixture(ui: &mut Ui, uniform: bool, note: &str) {
    if !uniform {
        ui.label(egui::RichText::new(note).size(TEXT_SIZE).weak())
            .on_hover_text("a change here applies to all");
    }
}

/// Gives a field its edited value, and marks the component as changed only if there was an edit.
fn copy_if_edited<C: Component<Mutability = bevy::ecs::component::Mutable>>(
    component: &mut Mut<C>,
    field: impl Fn(&mut C) -> &mut f32,
    shown: f32,
    edited: f32,
) {
    if shown != edited {
        *field(component) = edited;
    }
}

/// Scheme, substeps, time step, and whether what rests sleeps.
pub(super) fn draw_integration(
    mut ui: InMut<Ui>,
    mut settings: ResMut<SolverSettings>,
    mut sleep: ResMut<SleepSettings>,
    mut time: ResMut<Time<Fixed>>,
) {
    let mut edited = *settings;
    row(&mut ui, "scheme", |ui| draw_scheme(ui, &mut edited.integrator));
    row(&mut ui, "substeps", |ui| {
        let mut automatic = edited.substeps == SubstepMode::Auto;
        let mut count = if let SubstepMode::Fixed(count) = edited.substeps { count } else { 4 };
        ui.checkbox(&mut automatic, "Auto");
        let slider = egui::Slider::new(&mut count, 1..=200).logarithmic(true).update_while_editing(false);
        ui.add_enabled(!automatic, slider);
        edited.substeps = if automatic { SubstepMode::Auto } else { SubstepMode::Fixed(count.max(1)) };
    });
    settings.set_if_neq(edited);

    let shown = time.timestep().as_secs_f32() * 1e3;
    let mut milliseconds = shown;
    parameter(&mut ui, "time step", "ms", &mut milliseconds, 0.5..=50.0, Scale::Logarithmic(0.5));
    if milliseconds != shown {
        time.set_timestep(Duration::from_secs_f32((milliseconds * 1e-3).min(1.0)));
    }

    let mut edited = *sleep;
    row(&mut ui, "sleep", |ui| {
        ui.checkbox(&mut edited.enabled, "of what rests");
    });
    sleep.set_if_neq(edited);
}

fn draw_scheme(ui: &mut Ui, integrator: &mut Integrator) {
    egui::ComboBox::from_id_salt("scheme").selected_text(integrator.to_string()).width(170.0).show_ui(
        ui,
        |ui| {
            for choice in Integrator::ALL {
                ui.selectable_value(integrator, choice, choice.to_string());
            }
        },
    );
}

/// What collides with what, and how it rebounds.
pub(super) fn draw_collisions(
    mut ui: InMut<Ui>,
    mut settings: ResMut<CollisionSettings>,
    mut planes: Query<&mut ParticleCollider>,
) {
    let mut edited = *settings;
    ui.checkbox(&mut edited.ground, "with colliders (key c)");
    if let Some(first) = planes.iter().next().cloned() {
        let mut plane = first.clone();
        ui.add_enabled_ui(edited.ground, |ui| {
            parameter(ui, "restitution", "", &mut plane.restitution, 0.0..=1.0, Scale::Linear);
            parameter(ui, "friction", "", &mut plane.friction, 0.0..=2.0, Scale::Linear);
        });
        for mut other in &mut planes {
            copy_if_edited(&mut other, |plane| &mut plane.restitution, first.restitution, plane.restitution);
            copy_if_edited(&mut other, |plane| &mut plane.friction, first.friction, plane.friction);
        }
    }
    ui.checkbox(&mut edited.particles, "between particles (key c)");
    ui.add_enabled_ui(edited.particles, |ui| {
        ui.push_id("particles", |ui| {
            parameter(ui, "restitution", "", &mut edited.restitution, 0.0..=1.0, Scale::Linear);
            parameter(ui, "friction", "", &mut edited.friction, 0.0..=2.0, Scale::Linear);
        });
        ui.checkbox(&mut edited.springs, "springs along their length")
            .on_hover_text("those that belong to no net");
    });
    settings.set_if_neq(edited);
}

/// What the gizmos draw; nothing in apps without them.
#[cfg(feature = "gizmos")]
pub(super) fn draw_gizmos(mut ui: InMut<Ui>, mut store: ResMut<GizmoConfigStore>) {
    use crate::gizmos::MassSpringGizmos;

    let Some((_, gizmos)) = store.get_config::<MassSpringGizmos>() else { return };
    let MassSpringGizmos { particles, springs, colliders, contacts, contact_scale, .. } = *gizmos;
    let mut edited = (particles, springs, colliders, contacts, contact_scale);
    ui.horizontal(|ui| {
        ui.checkbox(&mut edited.0, "particles");
        ui.checkbox(&mut edited.1, "springs");
        ui.checkbox(&mut edited.2, "colliders");
        ui.checkbox(&mut edited.3, "contacts").on_hover_text("points, normals and impulses");
    });
    ui.add_enabled_ui(edited.3, |ui| {
        parameter(ui, "impulses", "m/(N·s)", &mut edited.4, 0.0..=1e3, Scale::Logarithmic(0.01));
    });
    if edited != (particles, springs, colliders, contacts, contact_scale) {
        let (_, gizmos) = store.config_mut::<MassSpringGizmos>();
        (gizmos.particles, gizmos.springs, gizmos.colliders, gizmos.contacts, gizmos.contact_scale) = edited;
    }
}
