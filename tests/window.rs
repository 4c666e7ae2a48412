//! The window, for real: the chain example's own plugins, a simulated mouse and keyboard, and a picture.
//!
//! Bevy's window is there but winit is not: what winit would report is written as messages, and the
//! picture is drawn into an image. So this needs no display; the picture needs a Vulkan adapter. It has
//! a main function of its own because rendering wants the main thread.

#[path = "../examples/chain/viewer/mod.rs"]
mod viewer;

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::process::ExitCode;

use bevy::camera::RenderTarget;
use bevy::image::Image;
use bevy::input::ButtonState;
use bevy::input::keyboard::{Key, KeyboardInput};
use bevy::input::mouse::MouseButtonInput;
use bevy::log::LogPlugin;
use bevy::prelude::*;
use bevy::render::RenderPlugin;
use bevy::render::pipelined_rendering::PipelinedRenderingPlugin;
use bevy::render::render_resource::{TextureFormat, TextureUsages};
use bevy::render::renderer::initialize_renderer;
use bevy::render::settings::{Backends, RenderCreation, RenderResources, WgpuSettings};
use bevy::render::view::screenshot::{Screenshot, ScreenshotCaptured};
use bevy::time::TimeUpdateStrategy;
use bevy::window::{CursorMoved, PrimaryWindow, WindowEvent};
use bevy::winit::WinitPlugin;
use bevy_mass_spring::drag::ParticleDrag;
use bevy_mass_spring::prelude::*;
use bevy_panorbit_camera::PanOrbitCamera;

use viewer::{FirstScene, presets};

const WIDTH: u32 = 1280;
const HEIGHT: u32 = 800;

/// What a test needs beyond the app.
enum Outcome {
    Passed,
    Skipped(&'static str),
}

fn main() -> ExitCode {
    let tests: [(&str, fn() -> Outcome); 6] = [
        ("left_drag_moves_the_anchor_and_the_chain_follows", left_drag_moves_the_anchor),
        ("ctrl_drag_moves_the_anchor_from_anywhere", ctrl_drag_moves_the_anchor),
        ("a_free_ball_is_pulled_and_let_go", a_free_ball_is_pulled),
        ("the_panel_keeps_clicks_to_itself", the_panel_keeps_clicks),
        ("keys_start_toggle_and_restart", keys_control),
        ("the_picture_shows_the_chain", the_picture_shows_the_chain),
    ];
    let filter: Vec<String> =
        std::env::args().skip(1).filter(|argument| !argument.starts_with('-')).collect();
    let chosen =
        tests.iter().filter(|(name, _)| filter.is_empty() || filter.iter().any(|part| name.contains(part)));
    let (mut passed, mut failed, mut skipped) = (0, 0, 0);
    for (name, test) in chosen {
        let result = match catch_unwind(AssertUnwindSafe(test)) {
            Ok(Outcome::Passed) => {
                passed += 1;
                "ok".to_owned()
            }
            Ok(Outcome::Skipped(reason)) => {
                skipped += 1;
                format!("ignored, {reason}")
            }
            Err(_) => {
                failed += 1;
                "FAILED".to_owned()
            }
        };
        println!("test {name} ... {result}");
    }
    let verdict = if failed == 0 { "ok" } else { "FAILED" };
    println!("\ntest result: {verdict}. {passed} passed; {failed} failed; {skipped} ignored\n");
    if failed == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

/// The example's app with a window of messages and, if given, a renderer.
struct Viewer {
    app: App,
    window: Entity,
    cursor: Vec2,
}

impl Viewer {
    fn open(renderer: Option<RenderResources>) -> Self {
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

    fn run(&mut self, frames: usize) {
        for _ in 0..frames {
            self.app.update();
        }
    }

    /// Sends what winit sends: each event by itself, and in the common stream that picking reads.
    fn send<E: Message + Clone + Into<WindowEvent>>(&mut self, event: E) {
        self.app.world_mut().write_message(event.clone());
        self.app.world_mut().write_message::<WindowEvent>(event.into());
    }

    fn move_cursor(&mut self, position: Vec2) {
        let (window, delta) = (self.window, Some(position - self.cursor));
        self.cursor = position;
        let mut target = self.app.world_mut().get_mut::<Window>(window).expect("open");
        target.set_cursor_position(Some(position));
        self.send(CursorMoved { window, position, delta });
        self.run(2);
    }

    fn button(&mut self, button: MouseButton, state: ButtonState) {
        let window = self.window;
        self.send(MouseButtonInput { button, state, window });
        self.run(2);
    }

    fn key(&mut self, key_code: KeyCode, state: ButtonState) {
        let window = self.window;
        let logical_key = Key::Unidentified(bevy::input::keyboard::NativeKey::Unidentified);
        self.send(KeyboardInput { key_code, logical_key, state, text: None, repeat: false, window });
        self.run(1);
    }

    fn tap(&mut self, key_code: KeyCode) {
        self.key(key_code, ButtonState::Pressed);
        self.key(key_code, ButtonState::Released);
    }

    /// Drags from one place to another in a few steps, and lets go.
    fn drag(&mut self, button: MouseButton, from: Vec2, to: Vec2) {
        self.move_cursor(from);
        self.button(button, ButtonState::Pressed);
        for step in 1..=10 {
            self.move_cursor(from.lerp(to, step as f32 / 10.0));
        }
        self.button(button, ButtonState::Released);
    }

    /// Where the scene's camera shows a place.
    fn on_screen(&mut self, place: Vec3) -> Vec2 {
        let world = self.app.world_mut();
        let mut cameras = world.query_filtered::<(&Camera, &GlobalTransform), With<PanOrbitCamera>>();
        let (camera, transform) = cameras.single(world).expect("one camera");
        camera.world_to_viewport(transform, place).expect("in the picture")
    }

    /// Where the scene's camera is.
    fn view(&mut self) -> Transform {
        let world = self.app.world_mut();
        *world.query_filtered::<&Transform, With<PanOrbitCamera>>().single(world).expect("one camera")
    }

    /// The particles of the scene, in order, the anchor first.
    fn balls(&mut self) -> Vec<(Entity, Vec3)> {
        let world = self.app.world_mut();
        let mut query = world.query::<(Entity, &Transform, &Particle, Has<Pinned>)>();
        let mut balls: Vec<_> = query.iter(world).collect();
        balls.sort_by_key(|(entity, .., pinned)| (!pinned, entity.index_u32()));
        balls.into_iter().map(|(entity, transform, ..)| (entity, transform.translation)).collect()
    }

    /// Position and velocity of each ball, for the picture between two ticks shows the former only in part.
    fn seen(&mut self) -> Vec<(Vec3, Vec3)> {
        let balls = self.balls();
        let velocity = |ball| self.app.world().get::<ParticleVelocity>(ball).expect("a particle").0;
        balls.into_iter().map(|(ball, place)| (place, velocity(ball))).collect()
    }

    fn place(&self, ball: Entity) -> Vec3 {
        self.app.world().get::<Transform>(ball).expect("a particle").translation
    }

    fn resource<R: Resource>(&self) -> &R {
        self.app.world().resource::<R>()
    }
}

fn left_drag_moves_the_anchor() -> Outcome {
    let mut viewer = Viewer::open(None);
    viewer.tap(KeyCode::Enter);
    viewer.run(240);
    let balls = viewer.balls();
    let ((anchor, start), (_, end_start)) = (balls[0], balls[balls.len() - 1]);
    let from = viewer.on_screen(start);
    viewer.move_cursor(from);
    assert_eq!(viewer.resource::<ParticleDrag>().hovered, Some(anchor), "the anchor is under the pointer");

    let to = from + Vec2::new(150.0, -40.0);
    viewer.drag(MouseButton::Left, from, to);
    assert_eq!(viewer.resource::<ParticleDrag>().dragged, None, "let go");
    let seen = viewer.place(anchor);
    assert!(viewer.on_screen(seen).distance(to) < 3.0, "the anchor is where the pointer left it");
    viewer.run(240);
    let moved = viewer.place(anchor) - start;
    assert!(moved.length() > 0.3 && viewer.place(anchor) == seen, "{moved}");
    let follows = viewer.balls().last().expect("balls").1 - end_start;
    assert!(follows.x * moved.x > 0.0 && follows.length() > 0.5 * moved.length(), "{follows} after {moved}");
    Outcome::Passed
}

fn ctrl_drag_moves_the_anchor() -> Outcome {
    let mut viewer = Viewer::open(None);
    for button in [MouseButton::Right, MouseButton::Middle] {
        let (anchor, start) = viewer.balls()[0];
        let before = viewer.view();
        viewer.key(KeyCode::ControlLeft, ButtonState::Pressed);
        viewer.drag(button, Vec2::new(200.0, 600.0), Vec2::new(260.0, 570.0));
        viewer.key(KeyCode::ControlLeft, ButtonState::Released);
        let moved = viewer.place(anchor) - start;
        assert!(moved.x > 0.1 && moved.y > 0.05, "{button:?}: {moved}");
        viewer.drag(button, Vec2::new(200.0, 600.0), Vec2::new(210.0, 600.0));
        assert_eq!(viewer.place(anchor) - start, moved, "{button:?}: without Ctrl, the anchor stays");
        if button == MouseButton::Middle {
            assert_eq!(before, viewer.view(), "{button:?}: the camera keeps still");
        }
    }
    Outcome::Passed
}

fn a_free_ball_is_pulled() -> Outcome {
    let mut viewer = Viewer::open(None);
    viewer.app.world_mut().resource_mut::<Environment>().viscosity = 0.2; // soon at rest
    viewer.tap(KeyCode::Enter);
    viewer.run(600);
    let (ball, start) = *viewer.balls().last().expect("balls");
    let from = viewer.on_screen(start);
    let to = from + Vec2::new(80.0, -60.0);
    viewer.move_cursor(from);
    viewer.button(MouseButton::Left, ButtonState::Pressed);
    assert_eq!(viewer.resource::<ParticleDrag>().dragged, Some(ball));
    viewer.move_cursor(to);
    viewer.run(120);
    let target = viewer.resource::<ParticleDrag>().target.expect("in the grip");
    assert!(viewer.on_screen(target).distance(to) < 12.0, "the target is under the pointer");
    let off = viewer.place(ball).distance(target);
    assert!(off < 0.03, "the ball comes to the pointer, but for {off} m");
    assert!(
        viewer.app.world().get::<AppliedForce>(ball).is_none_or(|force| force.0 == Vec3::ZERO),
        "no trace"
    );
    viewer.button(MouseButton::Left, ButtonState::Released);
    assert!(viewer.app.world().get::<AppliedForce>(ball).is_none(), "the force is taken away");
    viewer.run(600);
    assert!(viewer.place(ball).distance(start) < 0.3, "the ball swings back");

    // What is despawned in the grip is let go.
    let seen = viewer.place(ball);
    let from = viewer.on_screen(seen);
    viewer.move_cursor(from);
    viewer.button(MouseButton::Left, ButtonState::Pressed);
    viewer.app.world_mut().despawn(ball);
    viewer.run(3);
    assert_eq!(*viewer.resource::<ParticleDrag>(), ParticleDrag::default());
    Outcome::Passed
}

fn the_panel_keeps_clicks() -> Outcome {
    let mut viewer = Viewer::open(None);
    let (anchor, start) = viewer.balls()[0];
    let panel = Vec2::new(WIDTH as f32 - 100.0, HEIGHT as f32 * 0.5);
    viewer.key(KeyCode::ControlLeft, ButtonState::Pressed);
    viewer.drag(MouseButton::Right, panel, panel - Vec2::new(300.0, 0.0));
    viewer.key(KeyCode::ControlLeft, ButtonState::Released);
    assert_eq!(viewer.place(anchor), start);
    let before = viewer.view();
    viewer.drag(MouseButton::Left, panel, panel + Vec2::new(30.0, 10.0));
    viewer.run(10);
    assert_eq!(before, viewer.view());
    Outcome::Passed
}

fn keys_control() -> Outcome {
    let mut viewer = Viewer::open(None);
    let start = viewer.balls();
    assert!(viewer.resource::<Time<Virtual>>().is_paused(), "starts paused");
    viewer.run(5);
    assert_eq!(viewer.balls(), start, "nothing moves while paused");
    viewer.tap(KeyCode::Space);
    assert_eq!(viewer.resource::<TickReport>().tick, 1, "one step");
    let after_a_tick = viewer.seen();
    viewer.tap(KeyCode::Home);
    assert_eq!(viewer.balls(), start, "restarted after one step");
    viewer.tap(KeyCode::Space);
    assert_eq!(viewer.seen(), after_a_tick, "the same step again");
    viewer.tap(KeyCode::Enter);
    viewer.run(60);
    assert_ne!(viewer.balls(), start);
    viewer.tap(KeyCode::Enter);
    viewer.tap(KeyCode::Home);
    assert_eq!(viewer.balls(), start, "restarted");

    for (key, state) in [
        (
            KeyCode::KeyG,
            (|viewer: &Viewer| viewer.resource::<Environment>().gravity_enabled) as fn(&Viewer) -> bool,
        ),
        (KeyCode::KeyV, |viewer| viewer.resource::<Environment>().viscosity_enabled),
        (KeyCode::KeyC, |viewer| viewer.resource::<CollisionSettings>().ground),
    ] {
        let before = state(&viewer);
        viewer.tap(key);
        assert_ne!(state(&viewer), before, "{key:?}");
        viewer.tap(key);
        assert_eq!(state(&viewer), before, "{key:?}");
    }
    viewer.tap(KeyCode::Escape);
    assert!(viewer.app.should_exit().is_some(), "Esc quits");
    Outcome::Passed
}

/// A renderer on a Vulkan adapter, if the machine has one.
fn vulkan() -> Option<RenderResources> {
    let hook = std::panic::take_hook();
    std::panic::set_hook(Box::new(|_| {})); // Bevy panics where there is no adapter
    let settings = WgpuSettings { backends: Some(Backends::VULKAN), ..default() };
    let resources =
        catch_unwind(|| bevy::tasks::block_on(initialize_renderer(Backends::VULKAN, None, &settings)));
    std::panic::set_hook(hook);
    resources.ok()
}

fn the_picture_shows_the_chain() -> Outcome {
    let Some(renderer) = vulkan() else { return Outcome::Skipped("no Vulkan adapter") };
    let mut viewer = Viewer::open(Some(renderer));
    let mut picture = Image::new_target_texture(WIDTH, HEIGHT, TextureFormat::Rgba8UnormSrgb, None);
    picture.texture_descriptor.usage |= TextureUsages::COPY_SRC;
    let world = viewer.app.world_mut();
    let picture = world.resource_mut::<Assets<Image>>().add(picture);
    let cameras: Vec<Entity> = world.query_filtered::<Entity, With<Camera>>().iter(world).collect();
    for camera in cameras {
        world.entity_mut(camera).insert(RenderTarget::Image(picture.clone().into()));
    }
    viewer.run(8);
    let places: Vec<Vec3> = viewer.balls().into_iter().map(|(_, place)| place).collect();
    let on_screen: Vec<UVec2> = places.into_iter().map(|place| viewer.on_screen(place).as_uvec2()).collect();

    viewer.app.init_resource::<Taken>();
    let screenshot = Screenshot::image(picture);
    viewer.app.world_mut().spawn(screenshot).observe(
        |captured: On<ScreenshotCaptured>, mut taken: ResMut<Taken>| {
            taken.0 = Some(captured.image.clone());
        },
    );
    for _ in 0..60 {
        viewer.run(1);
        if viewer.resource::<Taken>().0.is_some() {
            break;
        }
    }
    let taken = viewer.app.world_mut().resource_mut::<Taken>().0.take().expect("a picture was taken");
    check_picture(&taken, &on_screen);
    Outcome::Passed
}

#[derive(Resource, Default)]
struct Taken(Option<Image>);

fn check_picture(picture: &Image, balls: &[UVec2]) {
    let color =
        |x: u32, y: u32| picture.get_color_at(x, y).expect("a colour").to_srgba().to_u8_array_no_alpha();
    let mut colors = std::collections::HashSet::new();
    for y in (0..HEIGHT).step_by(2) {
        for x in (0..WIDTH).step_by(2) {
            colors.insert(color(x, y));
        }
    }
    assert!(colors.len() > 500, "only {} colours", colors.len());
    let [red, green, blue] = color(balls[0].x, balls[0].y).map(i32::from);
    assert!(red > green + 40 && red > blue + 40, "the anchor is not red: {red} {green} {blue}");
    let teal = balls[1..].iter().filter(|at| {
        let [red, green, blue] = color(at.x, at.y).map(i32::from);
        green > red + 20 && blue > red + 20
    });
    let (teal, free) = (teal.count(), balls.len() - 1);
    assert!(teal * 4 >= free * 3, "only {teal} of {free} balls are seen");
}
