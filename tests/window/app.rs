//! The example's app, with a window of messages in place of winit's.

use bevy::input::ButtonState;
use bevy::input::keyboard::{Key, KeyboardInput};
use bevy::input::mouse::MouseButtonInput;
use bevy::log::LogPlugin;
use bevy::prelude::*;
use bevy::render::RenderPlugin;
use bevy::render::pipelined_rendering::PipelinedRenderingPlugin;
use bevy::render::settings::{RenderCreation, RenderResources, WgpuSettings};
use bevy::time::TimeUpdateStrategy;
use bevy::window::{CursorMoved, PrimaryWindow, WindowEvent};
use bevy::winit::WinitPlugin;
use bevy_mass_spring::prelude::*;
use bevy_panorbit_camera::PanOrbitCamera;

use crate::viewer::{self, FirstScene, presets};

pub const WIDTH: u32 = 1280;
pub const HEIGHT: u32 = 800;

/// The example's app with a window of messages and, if given, a renderer.
pub struct Viewer {
    pub app: App,
    window: Entity,
    cursor: Vec2,
}

impl Viewer {
    pub fn open(renderer: Option<RenderResources>) -> Self {
        let render_creation = match renderer {
            Some(resources) => RenderCreation::Manual(resources),
            None => RenderCreation::Automatic(Box::new(WgpuSettings { backends: None, ..default() })),
        };
        let window = Window { resolution: (WIDTH, HEIGHT).into(), ..default() };
        let default_plugins = DefaultPlugins
            .build()
            .disable::<WinitPlugin>()
            .disable::<LogPlugin>()
            .disable::<PipelinedRenderingPlugin>()
            .set(WindowPlugin { primary_window: Some(window), ..default() })
            .set(RenderPlugin { render_creation, synchronous_pipeline_compilation: true, ..default() });
        let mut app = App::new();
        app.add_plugins(default_plugins)
            .insert_resource(TimeUpdateStrategy::FixedTimesteps(1))
            .insert_resource(FirstScene {
                scene: presets::chain_file(),
                title: "Chain".to_owned(),
                preset: Some(presets::CHAIN),
            })
            .add_plugins(viewer::plugin);
        app.finish();
        app.cleanup();
        let window = app.world_mut().query_filtered::<Entity, With<PrimaryWindow>>().single(app.world());
        let window = window.expect("the window plugin opens one");
        let mut viewer = Self { app, window, cursor: Vec2::ZERO };
        viewer.run(4);
        viewer
    }

    pub fn run(&mut self, frames: usize) {
        for _ in 0..frames {
            self.app.update();
        }
    }

    /// Sends what winit sends: each event by itself, and in the common stream that picking reads.
    fn send<E: Message + Clone + Into<WindowEvent>>(&mut self, event: E) {
        self.app.world_mut().write_message(event.clone());
        self.app.world_mut().write_message::<WindowEvent>(event.into());
    }

    pub fn move_cursor(&mut self, position: Vec2) {
        let (window, delta) = (self.window, Some(position - self.cursor));
        self.cursor = position;
        let mut target = self.app.world_mut().get_mut::<Window>(window).expect("open");
        target.set_cursor_position(Some(position));
        self.send(CursorMoved { window, position, delta });
        self.run(2);
    }

    pub fn button(&mut self, button: MouseButton, state: ButtonState) {
        let window = self.window;
        self.send(MouseButtonInput { button, state, window });
        self.run(2);
    }

    pub fn key(&mut self, key_code: KeyCode, state: ButtonState) {
        let window = self.window;
        let logical_key = logical_key(key_code);
        self.send(KeyboardInput { key_code, logical_key, state, text: None, repeat: false, window });
        self.run(1);
    }

    pub fn tap(&mut self, key_code: KeyCode) {
        self.key(key_code, ButtonState::Pressed);
        self.key(key_code, ButtonState::Released);
    }

    pub fn click(&mut self, position: Vec2) {
        self.move_cursor(position);
        self.button(MouseButton::Left, ButtonState::Pressed);
        self.button(MouseButton::Left, ButtonState::Released);
    }

    /// Drags from one place to another in a few steps, and releases.
    pub fn drag(&mut self, button: MouseButton, from: Vec2, to: Vec2) {
        self.move_cursor(from);
        self.button(button, ButtonState::Pressed);
        for step in 1..=10 {
            self.move_cursor(from.lerp(to, step as f32 / 10.0));
        }
        self.button(button, ButtonState::Released);
    }

    /// Where the scene's camera shows a place.
    pub fn on_screen(&mut self, place: Vec3) -> Vec2 {
        let world = self.app.world_mut();
        let mut cameras = world.query_filtered::<(&Camera, &GlobalTransform), With<PanOrbitCamera>>();
        let (camera, transform) = cameras.single(world).expect("one camera");
        camera.world_to_viewport(transform, place).expect("in the picture")
    }

    /// Where the scene's camera is.
    pub fn view(&mut self) -> Transform {
        let world = self.app.world_mut();
        *world.query_filtered::<&Transform, With<PanOrbitCamera>>().single(world).expect("one camera")
    }

    /// The particles of the scene, in order, the anchor first.
    pub fn balls(&mut self) -> Vec<(Entity, Vec3)> {
        let world = self.app.world_mut();
        let mut query = world.query::<(Entity, &Transform, &Particle, Has<Pinned>)>();
        let mut balls: Vec<_> = query.iter(world).collect();
        balls.sort_by_key(|(entity, .., pinned)| (!pinned, entity.index_u32()));
        balls.into_iter().map(|(entity, transform, ..)| (entity, transform.translation)).collect()
    }

    pub fn masses(&mut self) -> Vec<f32> {
        let world = self.app.world_mut();
        world.query::<&Particle>().iter(world).map(|particle| particle.mass).collect()
    }

    /// Position and velocity of each ball, for the picture between two ticks shows the former only in part.
    pub fn seen(&mut self) -> Vec<(Vec3, Vec3)> {
        let balls = self.balls();
        let velocity = |ball| self.app.world().get::<ParticleVelocity>(ball).expect("a particle").0;
        balls.into_iter().map(|(ball, place)| (place, velocity(ball))).collect()
    }

    pub fn place(&self, ball: Entity) -> Vec3 {
        self.app.world().get::<Transform>(ball).expect("a particle").translation
    }

    pub fn resource<R: Resource>(&self) -> &R {
        self.app.world().resource::<R>()
    }
}

/// What a key means on an American keyboard.
fn logical_key(key_code: KeyCode) -> Key {
    let character = |text: &str| Key::Character(text.into());
    match key_code {
        KeyCode::ControlLeft => Key::Control,
        KeyCode::Digit5 => character("5"),
        KeyCode::Digit7 => character("7"),
        KeyCode::Enter => Key::Enter,
        KeyCode::Escape => Key::Escape,
        KeyCode::Home => Key::Home,
        KeyCode::KeyC => character("c"),
        KeyCode::KeyG => character("g"),
        KeyCode::KeyO => character("o"),
        KeyCode::KeyV => character("v"),
        KeyCode::Period => character("."),
        KeyCode::Space => Key::Space,
        other => panic!("{other:?} is not on this keyboard"),
    }
}
