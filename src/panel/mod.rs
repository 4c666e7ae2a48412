//! An egui panel with every parameter of the simulation, live, and plots of what it does.
//!
//! Only this module uses egui. It reads and writes components, settings and resources: `parameters` holds the widgets, `history` what the plots
//! show, `plots` the plots. An app adds sections of its own with [`AppPanelSection`].

mod history;
mod parameters;
mod plots;
mod status;
mod widgets;

use bevy::app::Plugin;
use bevy::ecs::system::SystemId;
use bevy::prelude::*;
use bevy::window::WindowPlugin;
use bevy_egui::{
    EguiContext, EguiGlobalSettings, EguiPlugin, EguiPrimaryContextPass, PrimaryEguiContext, egui,
};

use crate::diagnostics::Measurements;
use crate::particle::Particle;
use crate::report::SpringForces;
use crate::schedule::{MassSpringSystems, simulation_schedule, time_advances};
use crate::snapshot::RestoreInitialState;
use crate::spring::Spring;

/// The panel at the right of the window.
///
/// It shows and changes the environment, the solver's settings, the collisions, the parameters of all particles and
/// springs together, and with the feature `gizmos` what these draw; it plots the energy over the last ten seconds and the tension
/// along the springs, and shows the cost of a tick. Pointer and keyboard input that is meant for it is
/// kept from the rest of the app (it switches on `enable_absorb_bevy_input_system` of bevy_egui).
///
/// Add it after `DefaultPlugins`; it adds bevy_egui unless it is there. In an app without Bevy's
/// `WindowPlugin`, such as a headless one, it does nothing. It is drawn on the camera that carries
/// bevy_egui's primary context. Apps add sections with [`AppPanelSection::add_panel_section`], and switch
/// it on and off through [`MassSpringPanel`].
#[derive(Debug, Clone, Copy, Default)]
pub struct MassSpringPanelPlugin;

impl Plugin for MassSpringPanelPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<MassSpringPanel>();
        if !app.is_plugin_added::<WindowPlugin>() {
            return;
        }
        if !app.is_plugin_added::<EguiPlugin>() {
            app.add_plugins(EguiPlugin::default());
        }
        app.init_resource::<Measurements>()
            .init_resource::<SpringForces>()
            .init_resource::<history::History>()
            .add_systems(PreUpdate, history::reset_after_restart)
            .add_systems(EguiPrimaryContextPass, draw_panel.in_set(MassSpringPanelSystems));
    }

    fn finish(&self, app: &mut App) {
        if let Some(schedule) = simulation_schedule(app)
            && app.world().contains_resource::<history::History>()
        {
            let record = history::record_history.after(MassSpringSystems::Scatter).run_if(time_advances);
            app.add_systems(schedule, record);
        }
        if let Some(mut settings) = app.world_mut().get_resource_mut::<EguiGlobalSettings>() {
            settings.enable_absorb_bevy_input_system = true;
        }
    }
}

/// Where the panel is drawn, in bevy_egui's `EguiPrimaryContextPass`.
#[derive(SystemSet, Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct MassSpringPanelSystems;

type SectionId = SystemId<InMut<'static, egui::Ui>>;

/// The panel's state.
#[derive(Resource, Debug, Clone)]
pub struct MassSpringPanel {
    /// Whether the panel is shown. Default true.
    pub open: bool,
    /// Width in logical pixels (egui's points), > 0. Default 340.
    pub width: f32,
    /// The part of the window, in logical pixels, that the panel leaves free. Written by the panel;
    /// `None` before it is first drawn.
    pub free_area: Option<Rect>,
    sections: Vec<(&'static str, SectionId)>,
}

impl Default for MassSpringPanel {
    fn default() -> Self {
        Self { open: true, width: 340.0, free_area: None, sections: Vec::new() }
    }
}

/// Adds sections of an app's own to the panel.
pub trait AppPanelSection {
    /// Adds a collapsible section, above those of the panel itself and after those added before.
    ///
    /// It is drawn by an ordinary system with egui's `Ui` as its first parameter:
    ///
    /// ```
    /// use bevy::prelude::*;
    /// use bevy_egui::egui;
    /// use bevy_mass_spring::panel::AppPanelSection;
    /// use bevy_mass_spring::prelude::*;
    ///
    /// fn draw_count(mut ui: InMut<egui::Ui>, particles: Query<&Particle>) {
    ///     ui.label(format!("{} particles", particles.iter().len()));
    /// }
    ///
    /// App::new().add_panel_section("Count", draw_count);
    /// ```
    fn add_panel_section<M>(
        &mut self,
        title: &'static str,
        section: impl IntoSystem<InMut<'static, egui::Ui>, (), M> + 'static,
    ) -> &mut Self;
}

impl AppPanelSection for App {
    fn add_panel_section<M>(
        &mut self,
        title: &'static str,
        section: impl IntoSystem<InMut<'static, egui::Ui>, (), M> + 'static,
    ) -> &mut Self {
        let id = self.register_system(section);
        let mut panel = self.world_mut().get_resource_or_init::<MassSpringPanel>();
        panel.sections.push((title, id));
        self
    }
}

/// Restarts as [`RestoreInitialState`] does, but keeps the present parameters of particles and springs.
///
/// They are then compared from the same start, as the settings are, which no restart touches.
#[derive(Debug, Clone, Copy, Default)]
pub struct RestartWithParameters;

impl Command for RestartWithParameters {
    type Out = ();

    fn apply(self, world: &mut World) {
        let particles: Vec<(Entity, Particle)> = world
            .query::<(Entity, &Particle)>()
            .iter(world)
            .map(|(entity, particle)| (entity, *particle))
            .collect();
        let springs: Vec<(Entity, Spring)> = world
            .query::<(Entity, &Spring)>()
            .iter(world)
            .map(|(entity, spring)| (entity, *spring))
            .collect();
        RestoreInitialState.apply(world);
        for (entity, particle) in particles {
            if let Some(mut restored) = world.get_mut::<Particle>(entity) {
                restored.set_if_neq(particle);
            }
        }
        for (entity, spring) in springs {
            if let Some(mut restored) = world.get_mut::<Spring>(entity) {
                restored.set_if_neq(spring);
            }
        }
    }
}

fn draw_panel(world: &mut World) {
    let mut contexts = world.query_filtered::<&mut EguiContext, With<PrimaryEguiContext>>();
    let Ok(mut context) = contexts.single_mut(world) else { return };
    let context = context.get_mut().clone();
    let window = context.viewport_rect();
    let panel = world.resource::<MassSpringPanel>().clone();
    let mut free = window;
    if panel.open {
        let width = panel.width.min(window.width());
        free.max.x -= width;
        let area = egui::Rect::from_min_max(egui::pos2(free.max.x, window.min.y), window.max);
        // An area, unlike egui's own side panel, counts as egui's wherever the pointer is over it.
        egui::Area::new(egui::Id::new("mass_spring_panel"))
            .fixed_pos(area.min)
            .default_size(area.size())
            .movable(false)
            .constrain(false)
            .fade_in(false)
            .show(&context, |ui| draw_contents(ui, world, area.size(), &panel.sections));
    }
    let corner = |corner: egui::Pos2| Vec2::new(corner.x, corner.y);
    let free_area = Some(Rect::from_corners(corner(free.min), corner(free.max)));
    world.resource_mut::<MassSpringPanel>().free_area = free_area;
}

fn draw_contents(
    ui: &mut egui::Ui,
    world: &mut World,
    size: egui::Vec2,
    sections: &[(&'static str, SectionId)],
) {
    let frame = egui::Frame::side_top_panel(ui.style()).inner_margin(8);
    let inner_size = size - frame.total_margin().sum();
    frame.show(ui, |ui| {
        ui.set_min_size(inner_size);
        ui.set_max_size(inner_size);
        draw_part(ui, world, status::draw_transport);
        ui.separator();
        egui::Panel::bottom("mass_spring_plots").resizable(false).frame(egui::Frame::NONE).show(ui, |ui| {
            draw_part(ui, world, plots::draw_energy);
            draw_part(ui, world, plots::draw_tension);
            draw_part(ui, world, status::draw_cost);
        });
        egui::ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
            for &(title, section) in sections {
                widgets::section(ui, title, |ui| drop(world.run_system_with(section, ui)));
            }
            widgets::section(ui, "Environment", |ui| draw_part(ui, world, parameters::draw_environment));
            widgets::section(ui, "Particles and springs", |ui| draw_part(ui, world, parameters::draw_matter));
            widgets::section(ui, "Integration", |ui| draw_part(ui, world, parameters::draw_integration));
            widgets::section(ui, "Collisions", |ui| draw_part(ui, world, parameters::draw_collisions));
            #[cfg(feature = "gizmos")]
            widgets::section(ui, "Gizmos", |ui| draw_part(ui, world, parameters::draw_gizmos));
        });
    });
}

/// Runs a system that draws; nothing is drawn where one of its resources is missing.
fn draw_part<M>(
    ui: &mut egui::Ui,
    world: &mut World,
    part: impl IntoSystem<InMut<'static, egui::Ui>, (), M> + 'static,
) {
    drop(world.run_system_cached_with(part, ui));
}
