//! The list of exhibits, and which of them is shown.

use bevy::ecs::system::SystemId;
use bevy::prelude::*;
use bevy_egui::egui::{self, Ui};
use bevy_mass_spring::panel::AppPanelSection;
use bevy_mass_spring::prelude::*;

use crate::stage::{OfExhibit, View};

/// What is written about an exhibit, and from where it is seen.
#[derive(Debug, Clone, Copy)]
pub struct Exhibit {
    /// Its name.
    pub name: &'static str,
    /// What to look at.
    pub caption: &'static str,
    /// Where the camera is.
    pub view: View,
}

struct Entry {
    exhibit: Exhibit,
    spawn: SystemId,
    panel: SystemId<InMut<'static, Ui>>,
}

/// All exhibits, in order.
#[derive(Resource, Default)]
pub struct Gallery(Vec<Entry>);

/// The exhibit that is shown.
#[derive(Resource)]
pub struct Shown {
    index: usize,
    is_spawned: bool,
}

impl Shown {
    /// Begins with this one.
    pub fn first(index: usize) -> Self {
        Self { index, is_spawned: false }
    }

    fn show(&mut self, index: usize) {
        *self = Self::first(index);
    }
}

/// Adds exhibits to the gallery.
pub trait AppExhibit {
    /// Adds an exhibit: `spawn` sets it up, with the settings of the world at their defaults; `panel` draws its
    /// parameters.
    fn add_exhibit<M, N>(
        &mut self,
        exhibit: Exhibit,
        spawn: impl IntoSystem<(), (), M> + 'static,
        panel: impl IntoSystem<InMut<'static, Ui>, (), N> + 'static,
    ) -> &mut Self;
}

impl AppExhibit for App {
    fn add_exhibit<M, N>(
        &mut self,
        exhibit: Exhibit,
        spawn: impl IntoSystem<(), (), M> + 'static,
        panel: impl IntoSystem<InMut<'static, Ui>, (), N> + 'static,
    ) -> &mut Self {
        let (spawn, panel) = (self.register_system(spawn), self.register_system(panel));
        self.world_mut().get_resource_or_init::<Gallery>().0.push(Entry { exhibit, spawn, panel });
        self
    }
}

/// Adds the list and the keys.
pub fn plugin(app: &mut App) {
    app.init_resource::<Gallery>()
        .add_panel_section("Gallery", draw_list)
        .add_panel_section("This exhibit", draw_exhibit)
        .add_systems(First, show)
        .add_systems(Update, press_keys);
}

/// Sets up the exhibit that is to be shown.
fn show(world: &mut World) {
    let shown = world.resource::<Shown>();
    if shown.is_spawned {
        return;
    }
    let gallery = world.resource::<Gallery>();
    let Some(entry) = gallery.0.get(shown.index.min(gallery.0.len().saturating_sub(1))) else { return };
    let (spawn, view) = (entry.spawn, entry.exhibit.view);
    let old: Vec<Entity> = world.query_filtered::<Entity, With<OfExhibit>>().iter(world).collect();
    for entity in old {
        // It may be a child of one that is gone already.
        if let Ok(entity) = world.get_entity_mut(entity) {
            entity.despawn();
        }
    }
    world.insert_resource(Environment::default());
    world.insert_resource(SolverSettings::default());
    world.insert_resource(CollisionSettings::default());
    world.insert_resource(view);
    if let Err(error) = world.run_system(spawn) {
        error!("the exhibit cannot be set up: {error}");
    }
    world.resource_mut::<Shown>().is_spawned = true;
    RestoreInitialState.apply(world);
}

fn press_keys(
    keys: Res<ButtonInput<KeyCode>>,
    gallery: Res<Gallery>,
    mut shown: ResMut<Shown>,
    mut time: ResMut<Time<Virtual>>,
    mut exit: MessageWriter<AppExit>,
) {
    let (count, index) = (gallery.0.len(), shown.index);
    if keys.just_pressed(KeyCode::PageDown) {
        shown.show((index + 1) % count);
    }
    if keys.just_pressed(KeyCode::PageUp) {
        shown.show((index + count - 1) % count);
    }
    if keys.just_pressed(KeyCode::Home) {
        shown.show(index);
    }
    if keys.any_just_pressed([KeyCode::Enter, KeyCode::NumpadEnter]) {
        if time.is_paused() { time.unpause() } else { time.pause() }
    }
    if keys.just_pressed(KeyCode::Escape) {
        exit.write(AppExit::Success);
    }
}

fn draw_list(mut ui: InMut<Ui>, gallery: Res<Gallery>, mut shown: ResMut<Shown>) {
    let mut chosen = None;
    egui::Grid::new("exhibits").num_columns(2).show(&mut ui, |ui| {
        for (index, entry) in gallery.0.iter().enumerate() {
            let label = format!("{} {}", index + 1, entry.exhibit.name);
            if ui.selectable_label(index == shown.index, label).clicked() {
                chosen = Some(index);
            }
            if index % 2 == 1 {
                ui.end_row();
            }
        }
    });
    if let Some(index) = chosen {
        shown.show(index);
    }
    ui.label("Page up, Page down: change · Home: restart · Enter: pause · o: colliders and contacts");
}

fn draw_exhibit(mut ui: InMut<Ui>, world: &mut World) {
    let shown = world.resource::<Shown>().index;
    let Some(entry) = world.resource::<Gallery>().0.get(shown) else { return };
    let (exhibit, panel) = (entry.exhibit, entry.panel);
    ui.label(exhibit.caption);
    ui.add_space(4.0);
    let ui: &mut Ui = &mut ui;
    if let Err(error) = world.run_system_with(panel, ui) {
        ui.label(error.to_string());
    }
}
