//! The bar of keys, the banner of a diverged simulation, and the example's section of the panel.

use bevy::ecs::system::SystemParam;
use bevy::prelude::*;
use bevy_egui::egui::{self, Color32, RichText};
use bevy_egui::{EguiContexts, EguiPrimaryContextPass};
use bevy_mass_spring::panel::{AppPanelSection, MassSpringPanel, MassSpringPanelSystems};
use bevy_mass_spring::prelude::*;

use super::presets::{self, ChainPlan};
use super::{LayOut, OpenScene};

/// Height of the bar of keys, in logical pixels.
pub const BAR_HEIGHT: f32 = 50.0;
/// Maximum plausible speed in these scenes, m/s.
const MAX_SPEED: f64 = 1e4;

const ON: Color32 = Color32::from_rgb(140, 220, 150);
const OFF: Color32 = Color32::from_rgb(240, 150, 120);

/// Adds the overlay.
pub fn plugin(app: &mut App) {
    app.init_resource::<ChainPlan>()
        .add_panel_section("Scene", draw_scene_section)
        .add_systems(EguiPrimaryContextPass, (draw_bar, draw_banner).after(MassSpringPanelSystems));
}

fn draw_bar(
    mut contexts: EguiContexts,
    panel: Res<MassSpringPanel>,
    time: Res<Time<Virtual>>,
    environment: Res<Environment>,
    collisions: Res<CollisionSettings>,
    gizmos: Res<GizmoConfigStore>,
) -> Result {
    let Some(free) = panel.free_area else { return Ok(()) };
    let context = contexts.ctx_mut()?;
    let corner = egui::pos2(free.min.x, free.max.y - BAR_HEIGHT);
    egui::Area::new(egui::Id::new("keys"))
        .fixed_pos(corner)
        .movable(false)
        .constrain(false)
        .fade_in(false)
        .show(context, |ui| {
            let frame = egui::Frame::side_top_panel(ui.style()).inner_margin(6);
            let size = egui::vec2(free.width(), BAR_HEIGHT) - frame.total_margin().sum();
            frame.show(ui, |ui| {
                ui.set_min_size(size);
                ui.set_max_size(size);
                ui.spacing_mut().item_spacing.x = 5.0;
                let (paused, both) = (time.is_paused(), collisions.ground && collisions.particles);
                let neither = !collisions.ground && !collisions.particles;
                let drawn = gizmos.config::<MassSpringGizmos>().1.contacts;
                ui.horizontal(|ui| {
                    key(ui, "Enter", if paused { "start" } else { "pause" });
                    state(ui, !paused, "running", "paused");
                    key(ui, "Space", "one step");
                    key(ui, "Home", "restart");
                    key(ui, "g", "gravity");
                    state(ui, environment.gravity_enabled, "on", "off");
                    key(ui, "v", "viscosity");
                    state(ui, environment.viscosity_enabled, "on", "off");
                    key(ui, "c", "collisions");
                    state(ui, !neither, if both { "on" } else { "in part" }, "off");
                    key(ui, "o", "contacts");
                    state(ui, drawn, "drawn", "not drawn");
                    key(ui, "Esc", "quit");
                });
                ui.horizontal(|ui| {
                    key(ui, "Left drag", "a ball, or the view");
                    ui.add_space(6.0);
                    key(ui, "Ctrl + middle or right drag", "the fixed ball, from anywhere");
                    ui.add_space(6.0);
                    key(ui, "Right drag", "pan");
                    ui.add_space(6.0);
                    key(ui, "Wheel", "zoom");
                });
            });
        });
    Ok(())
}

fn key(ui: &mut egui::Ui, name: &str, meaning: &str) {
    ui.label(RichText::new(name).strong().monospace().background_color(Color32::from_gray(60)));
    ui.label(meaning);
}

fn state(ui: &mut egui::Ui, holds: bool, yes: &str, no: &str) {
    let (text, color) = if holds { (yes, ON) } else { (no, OFF) };
    ui.label(RichText::new(text).strong().color(color));
    ui.add_space(6.0);
}

/// Whether the simulation has diverged.
pub fn has_diverged(report: &TickReport, measurements: &Measurements) -> bool {
    report.faults > 0 || !measurements.max_speed.is_finite() || measurements.max_speed > MAX_SPEED
}

fn draw_banner(
    mut contexts: EguiContexts,
    panel: Res<MassSpringPanel>,
    report: Res<TickReport>,
    measurements: Res<Measurements>,
) -> Result {
    let Some(free) = panel.free_area.filter(|_| has_diverged(&report, &measurements)) else { return Ok(()) };
    let top = egui::pos2(free.center().x, free.min.y + 24.0);
    egui::Area::new(egui::Id::new("diverged"))
        .fixed_pos(top)
        .pivot(egui::Align2::CENTER_TOP)
        .interactable(false)
        .fade_in(false)
        .show(contexts.ctx_mut()?, |ui| {
            egui::Frame::popup(ui.style()).fill(Color32::from_rgb(170, 30, 20)).inner_margin(12).show(
                ui,
                |ui| {
                    let text = RichText::new("the simulation diverged: press Home").size(20.0).strong();
                    ui.add(egui::Label::new(text.color(Color32::WHITE)).extend());
                },
            );
        });
    Ok(())
}

/// The parts that a change of the chain is made from.
#[derive(SystemParam)]
struct Model<'w, 's> {
    particles: Query<'w, 's, (&'static Particle, Has<Pinned>)>,
    springs: Query<'w, 's, &'static Spring>,
}

impl Model<'_, '_> {
    /// A chain of `plan` from particles and springs like those that are there.
    fn chain(&self, plan: &ChainPlan) -> Option<MassSpringScene> {
        let mut particles = self.particles.iter();
        let (particle, _) = particles.find(|(_, pinned)| !pinned)?;
        Some(plan.build(*particle, *self.springs.iter().next()?))
    }
}

/// Presets, and what belongs to the chain as a whole.
fn draw_scene_section(
    mut ui: InMut<egui::Ui>,
    scene: Res<OpenScene>,
    mut plan: ResMut<ChainPlan>,
    model: Model,
    mut velocities: Query<(&mut ParticleVelocity, &Transform), (With<Particle>, Without<Pinned>)>,
    anchors: Query<&Transform, (With<Particle>, With<Pinned>)>,
    mut time: ResMut<Time<Virtual>>,
    mut commands: Commands,
) {
    let chosen = draw_presets(&mut ui, &scene);
    if let Some(chosen) = chosen {
        let preset = &presets::ALL[chosen];
        time.pause();
        *plan = ChainPlan::default();
        let (scene, title) = ((preset.build)(), preset.name.to_owned());
        commands.insert_resource(LayOut { scene, title, preset: Some(chosen), with_settings: true });
        return;
    }
    let mut edited = *plan;
    let mut push = false;
    egui::Grid::new("chain").num_columns(2).min_col_width(92.0).show(&mut ui, |ui| {
        let rebuilds = scene.preset == Some(presets::CHAIN);
        let initial =
            |quantity: &str| if rebuilds { format!("initial {quantity}") } else { quantity.to_owned() };
        if rebuilds {
            ui.label("particles");
            let slider = egui::Slider::new(&mut edited.particles, 2..=200).logarithmic(true);
            ui.add(slider.update_while_editing(false));
            ui.end_row();
        }
        ui.label(initial("velocity"));
        ui.horizontal(|ui| {
            for value in edited.velocity.as_mut() {
                let field = egui::DragValue::new(value).speed(0.05).range(-50.0..=50.0).max_decimals(2);
                ui.add(field.update_while_editing(false));
            }
            ui.label("m/s");
        });
        ui.end_row();
        ui.label(initial("spin"));
        ui.horizontal(|ui| {
            ui.spacing_mut().slider_width = 64.0;
            let slider = egui::Slider::new(&mut edited.spin, -15.0..=15.0).suffix(" rad/s");
            ui.add(slider.update_while_editing(false));
            let button = ui.button("Push");
            push |= button.on_hover_text("adds velocity and spin to all free particles now").clicked();
        });
        ui.end_row();
    });
    if push {
        let pivot = anchors.iter().next().map_or(scene.bounds.middle, |anchor| anchor.translation);
        for (mut velocity, transform) in &mut velocities {
            velocity.0 += edited.velocity_at(transform.translation - pivot);
        }
    }
    if plan.set_if_neq(edited)
        && scene.preset == Some(presets::CHAIN)
        && let Some(chain) = model.chain(&edited)
    {
        let title = scene.title.clone();
        commands.insert_resource(LayOut { scene: chain, title, preset: scene.preset, with_settings: false });
    }
}

/// Draws the choice of presets; returns the one that was chosen just now.
fn draw_presets(ui: &mut egui::Ui, scene: &OpenScene) -> Option<usize> {
    let mut chosen = None;
    ui.horizontal_wrapped(|ui| {
        for (index, preset) in presets::ALL.iter().enumerate() {
            let button = egui::Button::selectable(scene.preset == Some(index), preset.name);
            if ui.add(button).on_hover_text(preset.question).clicked() {
                chosen = Some(index);
            }
        }
    });
    let about = scene.preset.map_or(scene.title.as_str(), |index| presets::ALL[index].question);
    ui.label(RichText::new(about).size(12.0).color(Color32::from_gray(190)));
    chosen
}
