//! The window: the chain example's own plugins, a simulated mouse and keyboard, and a picture.
//!
//! Bevy's window is there but winit is not: what winit would report is written as messages, and the
//! picture is drawn into an image. So this needs no display; the picture needs a Vulkan adapter. It has
//! a main function of its own because rendering needs the main thread.

mod app;
mod picture;
#[path = "../../examples/chain/viewer/mod.rs"]
mod viewer;

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::process::ExitCode;

use bevy::input::ButtonState;
use bevy::prelude::*;
use bevy_egui::input::EguiWantsInput;
use bevy_mass_spring::drag::ParticleDrag;
use bevy_mass_spring::prelude::*;

use app::{HEIGHT, Viewer, WIDTH};

/// What a test needs beyond the app.
enum Outcome {
    Passed,
    Skipped(&'static str),
}

fn main() -> ExitCode {
    let tests: [(&str, fn() -> Outcome); 8] = [
        ("left_drag_moves_the_anchor_and_the_chain_follows", left_drag_moves_the_anchor),
        ("ctrl_drag_moves_the_anchor_from_anywhere", ctrl_drag_moves_the_anchor),
        ("a_free_ball_is_pulled_and_let_go", a_free_ball_is_pulled),
        ("the_panel_keeps_clicks_to_itself", the_panel_keeps_clicks),
        ("keys_start_toggle_and_restart", keys_control),
        ("what_is_typed_into_the_panel_stays_there", typing_stays_in_the_panel),
        ("the_picture_shows_the_chain", picture::shows_the_chain),
        ("the_picture_of_a_crowd_is_that_of_ropes", picture::shows_a_crowd_as_ropes),
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
    assert_eq!(viewer.resource::<ParticleDrag>().dragged, None, "released");
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
    assert!(off < 0.03, "the ball comes to the pointer within {off} m");
    assert!(
        viewer.app.world().get::<AppliedForce>(ball).is_none_or(|force| force.0 == Vec3::ZERO),
        "no trace"
    );
    viewer.button(MouseButton::Left, ButtonState::Released);
    assert!(viewer.app.world().get::<AppliedForce>(ball).is_none(), "the force is taken away");
    viewer.run(600);
    assert!(viewer.place(ball).distance(start) < 0.3, "the ball swings back");

    // A despawned particle is released.
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
        (KeyCode::KeyO, |viewer| {
            viewer.resource::<GizmoConfigStore>().config::<MassSpringGizmos>().1.colliders
        }),
        (KeyCode::KeyO, |viewer| viewer.app.world().contains_resource::<Messages<Contact>>()),
    ] {
        let before = state(&viewer);
        viewer.tap(key);
        viewer.run(2);
        assert_ne!(state(&viewer), before, "{key:?}");
        viewer.tap(key);
        viewer.run(2);
        assert_eq!(state(&viewer), before, "{key:?}");
    }
    viewer.tap(KeyCode::Escape);
    assert!(viewer.app.should_exit().is_some(), "Esc quits");
    Outcome::Passed
}

/// The field with the mass in the panel, in pixels.
const MASS_FIELD: Vec2 = Vec2::new(1180.0, 366.0);

fn typing_stays_in_the_panel() -> Outcome {
    let mut viewer = Viewer::open(None);
    let mass = |viewer: &mut Viewer| {
        let mut masses = viewer.masses();
        masses.dedup();
        assert_eq!(masses.len(), 1, "all have the same mass");
        masses[0]
    };
    let assert_untouched = |viewer: &Viewer| {
        let Environment { gravity_enabled, viscosity_enabled, .. } = *viewer.resource::<Environment>();
        let collisions = *viewer.resource::<CollisionSettings>();
        let switches = [gravity_enabled, viscosity_enabled, collisions.ground, collisions.particles];
        assert_eq!(switches, [true; 4], "g, v and c are text");
        assert_eq!(viewer.resource::<TickReport>().tick, 0, "Space is text");
        assert!(viewer.resource::<Time<Virtual>>().is_paused(), "Enter ends the text");
        assert!(viewer.app.should_exit().is_none(), "Escape leaves the field");
    };
    let start = mass(&mut viewer);
    let letters = [KeyCode::KeyG, KeyCode::KeyV, KeyCode::KeyC, KeyCode::Space, KeyCode::Home];
    viewer.click(MASS_FIELD);
    assert!(viewer.resource::<EguiWantsInput>().wants_keyboard_input(), "the click went to a field of text");
    letters.into_iter().chain([KeyCode::Enter]).for_each(|key| viewer.tap(key));
    assert_eq!(mass(&mut viewer), start, "that was no number");
    assert_untouched(&viewer);

    viewer.click(MASS_FIELD);
    [KeyCode::Digit7, KeyCode::Period, KeyCode::Digit5].into_iter().for_each(|key| viewer.tap(key));
    assert_eq!(mass(&mut viewer), start, "not before it is all typed");
    viewer.tap(KeyCode::Enter);
    assert_eq!(mass(&mut viewer), 7.5);
    viewer.click(MASS_FIELD);
    [KeyCode::Digit7, KeyCode::Escape].into_iter().for_each(|key| viewer.tap(key));
    assert_untouched(&viewer);

    viewer.tap(KeyCode::Space);
    assert_eq!(viewer.resource::<TickReport>().tick, 1, "the keys are the scene's again");
    Outcome::Passed
}
