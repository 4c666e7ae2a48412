//! Particles of nets under the pointer and in its grip, in an app without a window: rays from a camera that is set by hand.

mod common;

use std::f32::consts::FRAC_PI_2;

use bevy::camera::{ComputedCameraValues, NormalizedRenderTarget, RenderTargetInfo};
use bevy::input::InputPlugin;
use bevy::math::Affine3A;
use bevy::picking::hover::HoverMap;
use bevy::picking::pointer::{Location, PointerAction, PointerButton, PointerId, PointerInput};
use bevy::picking::{InteractionPlugin, PickingPlugin};
use bevy::prelude::*;
use bevy::window::{ExitCondition, PrimaryWindow, WindowRef};
use bevy_mass_spring::drag::{DragAnchor, ParticleDrag};
use bevy_mass_spring::nets::{Cloth, NetHit, Part, PartOf, Rope, Side, Topology};
use bevy_mass_spring::prelude::*;

use common::{TICK, app_with};

/// Camera and pointer of an app: the camera is 5 m in front of the plane z = 0, of which it sees 10 m × 10 m in 200² pixels.
struct Desk {
    app: App,
    window: Entity,
    camera: Entity,
    cursor: Vec2,
}

impl Desk {
    fn new() -> Self {
        let window = WindowPlugin {
            primary_window: Some(Window::default()),
            exit_condition: ExitCondition::DontExit,
            ..default()
        };
        let input = (TransformPlugin, InputPlugin, window, PickingPlugin, InteractionPlugin);
        let mut app = app_with((input, MassSpringPlugin::default(), ParticleDragPlugin));
        app.world_mut().resource_mut::<Environment>().gravity_enabled = false;
        app.world_mut().spawn(PointerId::Mouse);
        let computed = ComputedCameraValues {
            clip_from_view: Mat4::perspective_infinite_reverse_rh(FRAC_PI_2, 1.0, 0.1),
            target_info: Some(RenderTargetInfo { physical_size: UVec2::splat(200), scale_factor: 1.0 }),
            ..default()
        };
        let camera = (Camera { computed, ..default() }, Transform::from_xyz(0.0, 0.0, 5.0));
        let camera = app.world_mut().spawn(camera).id();
        let window = app
            .world_mut()
            .query_filtered::<Entity, With<PrimaryWindow>>()
            .single(app.world())
            .expect("open");
        Self { app, window, camera, cursor: Vec2::ZERO }
    }

    fn net(&mut self, topology: Topology) -> Entity {
        let net = self.app.world_mut().spawn(ParticleNet::new(topology.into(), &Transform::IDENTITY)).id();
        self.run(2);
        net
    }

    fn part(&mut self, net: Entity, part: Part) -> Entity {
        let part = self.app.world_mut().spawn((PartOf(net), part, Pinned)).id();
        self.run(2);
        part
    }

    fn run(&mut self, frames: usize) {
        (0..frames).for_each(|_| self.app.update());
    }

    fn send(&mut self, action: PointerAction) {
        let window = WindowRef::Primary.normalize(Some(self.window)).expect("it is given");
        let location = Location { target: NormalizedRenderTarget::Window(window), position: self.cursor };
        self.app.world_mut().write_message(PointerInput::new(PointerId::Mouse, location, action));
        self.run(1);
    }

    /// Points at a place of the plane z = 0.
    fn point_at(&mut self, place: Vec3) {
        let camera = self.app.world().get::<Camera>(self.camera).expect("it exists");
        let frame = GlobalTransform::from(Affine3A::from_translation(Vec3::Z * 5.0));
        let cursor = camera.world_to_viewport(&frame, place).expect("in the picture");
        let delta = cursor - self.cursor;
        self.cursor = cursor;
        self.send(PointerAction::Move { delta });
    }

    fn press(&mut self) {
        self.send(PointerAction::Press(PointerButton::Primary));
    }

    fn release(&mut self) {
        self.send(PointerAction::Release(PointerButton::Primary));
    }

    fn state(&self, net: Entity) -> &ParticleNet {
        self.app.world().get(net).expect("it exists")
    }

    fn place(&self, net: Entity, particle: u32) -> Vec3 {
        self.state(net).positions()[particle as usize]
    }

    fn drag(&self) -> ParticleDrag {
        *self.app.world().resource()
    }

    fn hovered(&self) -> (Option<Entity>, Option<u32>) {
        (self.drag().hovered, self.drag().hovered_index)
    }

    fn dragged(&self) -> (Option<Entity>, Option<u32>) {
        (self.drag().dragged, self.drag().dragged_index)
    }
}

/// A cloth of 2² cells of 1 m in the plane z = 0 about the origin; particle (i, j) is number 3 j + i.
fn cloth() -> Topology {
    let cloth = Cloth::grid(Vec3::new(-1.0, 1.0, 0.0), Vec3::X * 2.0, Vec3::NEG_Y * 2.0, UVec2::splat(2));
    cloth.topology().expect("it is sound")
}

/// A rope of 11 particles from (−1, 0, 0) to (1, 0, 0).
fn rope() -> Topology {
    let rope = Rope::between(Vec3::NEG_X, Vec3::X).with_segments(10);
    rope.topology().expect("it is sound")
}

#[test]
fn the_particle_of_a_cloth_that_is_nearest_to_the_pointer_is_hovered() {
    let mut desk = Desk::new();
    let net = desk.net(cloth());
    // Six pixels from the particle in the middle, and more than the ten of the pick radius from any.
    let places =
        [(Vec3::new(0.3, 0.02, 0.0), 4), (Vec3::new(0.45, 0.4, 0.0), 4), (Vec3::new(0.6, 0.55, 0.0), 2)];
    for (place, particle) in places {
        desk.point_at(place);
        assert_eq!(desk.hovered(), (Some(net), Some(particle)), "{place}");
        let hover = &desk.app.world().resource::<HoverMap>()[&PointerId::Mouse];
        let hit = hover[&net].extra_as::<NetHit>().expect("hits of nets have it");
        assert!(hit.particle == particle && hit.triangle.is_some(), "{hit:?}");
        assert!(
            hit.point.distance(place) < 1e-3 && (hit.distance - place.distance(Vec3::Z * 5.0)).abs() < 0.2
        );
    }
    // On a particle, whose sphere is in front of the surface.
    desk.point_at(Vec3::ZERO);
    assert_eq!(desk.hovered(), (Some(net), Some(4)));
    // Eight pixels from a corner, and far from all.
    desk.point_at(Vec3::new(1.3, 1.2, 0.0));
    assert_eq!(desk.hovered(), (Some(net), Some(2)));
    desk.point_at(Vec3::new(3.0, 0.0, 0.0));
    assert_eq!(desk.drag(), ParticleDrag::default());
}

#[test]
fn a_loose_particle_in_front_of_a_net_is_hovered_and_one_behind_is_not() {
    let mut desk = Desk::new();
    let net = desk.net(cloth());
    let ball = common::spawn(&mut desk.app, 1.0, 0.1, Vec3::new(0.4, 0.2, 0.5));
    desk.run(2);
    desk.point_at(Vec3::new(0.44, 0.22, 0.0));
    assert_eq!(desk.hovered(), (Some(ball), None));
    desk.app.world_mut().get_mut::<Transform>(ball).expect("it exists").translation =
        Vec3::new(0.4, 0.2, -0.5);
    desk.run(2);
    desk.point_at(Vec3::new(0.37, 0.19, 0.0));
    assert_eq!(desk.hovered(), (Some(net), Some(4)));
}

#[test]
fn a_free_particle_of_a_rope_is_pulled_to_the_pointer() {
    let mut desk = Desk::new();
    let net = desk.net(rope());
    desk.part(net, Part::Start);
    desk.app.world_mut().resource_mut::<Environment>().viscosity = 0.02; // soon at rest
    desk.point_at(Vec3::X);
    desk.press();
    assert_eq!(desk.dragged(), (Some(net), Some(10)));
    let target = Vec3::new(0.5, 0.8, 0.0);
    desk.point_at(target);
    for _ in 0..(4.0 / TICK) as usize {
        desk.run(1);
        assert!(desk.state(net).applied_forces().is_empty(), "the pull is there during the tick only");
    }
    let off = desk.place(net, 10).distance(target);
    assert!(off < 0.02, "it comes to the pointer within {off} m");
    assert!(desk.place(net, 0).distance(Vec3::NEG_X) == 0.0);
    assert_eq!(desk.drag().target.map(|found| found.distance(target) < 1e-3), Some(true));
    desk.release();
    assert_eq!(desk.dragged(), (None, None));
}

#[test]
fn forces_of_the_game_are_what_they_were_after_a_pull() {
    let mut desk = Desk::new();
    let net = desk.net(rope());
    let force = Vec3::new(1e-3, 3e-4, 0.0);
    desk.app.world_mut().get_mut::<ParticleNet>(net).expect("it exists").applied_forces_mut()[10] = force;
    desk.point_at(Vec3::X);
    desk.press();
    desk.point_at(Vec3::new(1.0, 0.7, 0.0));
    desk.run(20);
    assert!(desk.place(net, 10).y > 0.3);
    assert_eq!(desk.state(net).applied_forces()[10], force);
}

#[test]
fn a_particle_of_a_pinned_part_takes_the_part_along() {
    let mut desk = Desk::new();
    let net = desk.net(cloth());
    let edge = desk.part(net, Part::Edge(Side::Bottom));
    let start = desk.app.world().get::<Transform>(edge).expect("it exists").translation;
    let before: Vec<Vec3> = (0..3).map(|particle| desk.place(net, particle)).collect();
    desk.point_at(before[2]);
    desk.press();
    assert_eq!(desk.dragged(), (Some(net), Some(2)));
    let way = Vec3::new(0.25, 0.5, 0.0);
    desk.point_at(before[2] + way);
    desk.run(2);
    let moved = desk.app.world().get::<Transform>(edge).expect("it exists").translation - start;
    assert!(moved.distance(way) < 1e-3, "{moved}");
    for particle in 0..3 {
        let moved = desk.place(net, particle) - before[particle as usize];
        assert!(moved.distance(way) < 1e-3, "particle {particle}: {moved}");
    }
    // Paused, the particles are seen to follow as well, and a tick changes nothing about it.
    desk.app.world_mut().resource_mut::<Time<Virtual>>().pause();
    let back = Vec3::new(-0.25, 0.25, 0.0);
    desk.point_at(before[2] + back);
    let seen: Vec<Vec3> = (0..3).map(|particle| desk.place(net, particle)).collect();
    for (seen, before) in seen.iter().zip(&before) {
        assert!((*seen - *before).distance(back) < 1e-3, "{seen}");
    }
    desk.app.world_mut().resource_mut::<Time<Virtual>>().unpause();
    desk.run(2);
    for (particle, seen) in (0..3).zip(&seen) {
        assert!(desk.place(net, particle).distance(*seen) < 1e-5);
    }
}

#[test]
fn particles_that_the_net_pins_follow_and_free_ones_do_while_time_is_paused() {
    let mut desk = Desk::new();
    let net = desk.net(rope());
    desk.app.world_mut().get_mut::<ParticleNet>(net).expect("it exists").set_pinned(0, true);
    let grab = |desk: &mut Desk, particle: u32, target: Vec3| {
        let from = desk.place(net, particle);
        desk.point_at(from);
        desk.press();
        assert_eq!(desk.dragged(), (Some(net), Some(particle)));
        desk.point_at(target);
        desk.run(1);
        let off = desk.place(net, particle).distance(target);
        assert!(off < 1e-3, "particle {particle} is off by {off} m");
        desk.release();
    };
    grab(&mut desk, 0, Vec3::new(-0.8, 0.4, 0.0));
    desk.app.world_mut().resource_mut::<Time<Virtual>>().pause();
    let before = desk.place(net, 5);
    grab(&mut desk, 10, Vec3::new(0.5, -0.6, 0.0));
    assert_eq!(desk.place(net, 5), before, "no tick has run");
}

#[test]
fn ctrl_drags_a_pinned_or_marked_particle_of_a_net_from_anywhere() {
    let mut desk = Desk::new();
    let net = desk.net(rope());
    let start = desk.part(net, Part::Start);
    let grab = |desk: &mut Desk| {
        desk.point_at(Vec3::new(3.0, -3.0, 0.0));
        desk.app.world_mut().resource_mut::<ButtonInput<KeyCode>>().press(KeyCode::ControlLeft);
        desk.send(PointerAction::Press(PointerButton::Middle));
        let dragged = desk.dragged();
        desk.send(PointerAction::Release(PointerButton::Middle));
        dragged
    };
    assert_eq!(grab(&mut desk), (Some(net), Some(0)));
    desk.app.world_mut().spawn((PartOf(net), Part::End, DragAnchor));
    desk.run(2);
    assert_eq!(grab(&mut desk), (Some(net), Some(10)), "the mark counts first");
    desk.app.world_mut().despawn(start);
}

#[test]
fn a_net_that_is_despawned_is_released() {
    let mut desk = Desk::new();
    let net = desk.net(cloth());
    desk.point_at(Vec3::ZERO);
    desk.press();
    assert_eq!(desk.dragged(), (Some(net), Some(4)));
    desk.app.world_mut().despawn(net);
    desk.run(2);
    assert_eq!(desk.drag(), ParticleDrag::default());
}

/// On its layer, in front of what is behind it, and within that layer it stays.
#[test]
fn in_two_dimensions_what_is_pulled_stays_on_its_layer() {
    let mut desk = Desk::new();
    desk.app.insert_resource(Dimensions::Two);
    // On whatever layers they are, things collide in the plane.
    desk.app.world_mut().resource_mut::<CollisionSettings>().particles = false;
    desk.app.world_mut().resource_mut::<Environment>().viscosity = 0.02;
    let layers = [0.75, -0.5];
    let nets = layers.map(|layer| {
        let frame = Transform::from_xyz(0.0, 0.0, layer);
        desk.app.world_mut().spawn(ParticleNet::new(rope().into(), &frame)).id()
    });
    desk.run(2);
    let balls = layers.map(|layer| common::spawn(&mut desk.app, 1.0, 0.1, Vec3::new(0.0, -1.0, layer)));
    desk.run(2);
    // Both ropes and both balls lie on a ray through the middle of the picture, or nearly so.
    desk.point_at(Vec3::new(0.0, 0.0, 0.0));
    assert_eq!(desk.hovered(), (Some(nets[0]), Some(5)), "the one in front");
    desk.press();
    desk.point_at(Vec3::new(0.0, 0.8, 0.0));
    desk.run((4.0 / TICK) as usize);
    let pulled = desk.place(nets[0], 5);
    // The ray through (0, 0.8, 0) meets its layer at 0.8 (5 − 0.75) / 5.
    assert!((pulled.y - 0.68).abs() < 0.02, "{pulled}");
    for (net, layer) in nets.into_iter().zip(layers) {
        for particle in 0..11 {
            assert_eq!(desk.place(net, particle).z, layer);
        }
    }
    desk.release();
    let hit = Vec3::new(0.0, -1.0, 0.75);
    desk.point_at(hit);
    assert_eq!(desk.hovered(), (Some(balls[0]), None));
    desk.press();
    desk.point_at(hit + Vec3::X * 0.5);
    desk.run((4.0 / TICK) as usize);
    let ball = desk.app.world().get::<Transform>(balls[0]).expect("it exists").translation;
    assert!((ball.x - 0.5).abs() < 0.02 && ball.z == layers[0], "{ball}");
}
