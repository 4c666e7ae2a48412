//! Scenes that move and change while they run, in the same way in each app.

mod nets;

use bevy::ecs::entity::MapEntities;
use bevy::prelude::*;
use bevy_mass_spring::prelude::*;

use crate::common::{self, app, join, run, scheme, spawn, spawn_pinned, spawn_rope};
use crate::nets_sync::shapes::net_bits;

/// What is spawned, and what happens to it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scene {
    /// A rope whose anchor is moved in each tick, and one between two anchors.
    Ropes,
    /// A pinned and a free particle under a parent that moves and turns.
    Parent,
    /// Balls on a plane that rises and tilts, and a wall.
    Pile,
    /// Balls, a net and a rope, all of which collide.
    PileWithSprings,
    /// The same; particles, springs and a plane are spawned in tick 20.
    Joiners,
    /// The same; particles, springs and a plane are despawned in ticks 15 and 25.
    Leavers,
    /// A soft and a stiff rope on one anchor, above balls: `Auto` runs two schemes.
    TwoSchemes,
    /// Nets with winch, tear, ties and bends on colliders.
    Nets,
}

impl Scene {
    pub const ALL: [Self; 8] = [
        Self::Ropes,
        Self::Parent,
        Self::Pile,
        Self::PileWithSprings,
        Self::Joiners,
        Self::Leavers,
        Self::TwoSchemes,
        Self::Nets,
    ];

    /// The tick from which on nothing is spawned or despawned any more.
    pub fn settled_at(self) -> u32 {
        match self {
            Self::Joiners | Self::Leavers => 27,
            _ => 0,
        }
    }
}

/// The entities of a scene, in the order of spawning.
#[derive(Debug, Clone, Default, MapEntities)]
pub struct Names {
    #[entities]
    pub particles: Vec<Entity>,
    #[entities]
    pub springs: Vec<Entity>,
    #[entities]
    planes: Vec<Entity>,
    #[entities]
    parent: Option<Entity>,
    #[entities]
    nets: Vec<Entity>,
}

/// A scene in an app.
pub struct Stage {
    pub app: App,
    scene: Scene,
    pub names: Names,
    /// Number of ticks that have run.
    pub tick: u32,
}

/// A bit pattern for each particle.
pub type Bits = Vec<[u32; 6]>;

impl Stage {
    pub fn new(scene: Scene, integrator: Integrator) -> Self {
        Self::in_app(app(), scene, integrator)
    }

    /// The scene in an app where entities have other numbers, and the plugin has seen others before.
    pub fn elsewhere(scene: Scene, integrator: Integrator) -> Self {
        let mut app = app();
        for _ in 0..7 {
            app.world_mut().spawn(Transform::default());
        }
        let rope = spawn_rope(&mut app, Vec3::Z * 50.0, 5, 1.0, |spring| spring);
        let ground = app.world_mut().spawn(ParticleCollider::default()).id();
        run(&mut app, 2);
        for entity in rope.into_iter().chain([ground]) {
            app.world_mut().despawn(entity);
        }
        run(&mut app, 2);
        Self::in_app(app, scene, integrator)
    }

    pub fn in_app(mut app: App, scene: Scene, integrator: Integrator) -> Self {
        let settings = match integrator {
            Integrator::Auto => SolverSettings::default(),
            named => scheme(named, 4),
        };
        app.insert_resource(settings);
        *app.world_mut().resource_mut::<CollisionSettings>() =
            CollisionSettings { restitution: 0.2, friction: 0.4, ..default() };
        let mut stage = Self { app, scene, names: Names::default(), tick: 0 };
        stage.spawn();
        stage
    }

    fn spawn(&mut self) {
        match self.scene {
            Scene::Ropes => {
                self.rope(Vec3::Y * 2.0, 12, 300.0);
                self.rope(Vec3::new(0.0, 1.0, 1.0), 9, 500.0);
                let last = *self.names.particles.last().expect("there is one");
                self.app.world_mut().entity_mut(last).insert(Pinned);
            }
            Scene::Parent => self.family(),
            Scene::Nets => self.nets(),
            Scene::Pile => self.pile(30),
            Scene::PileWithSprings | Scene::Joiners | Scene::Leavers => {
                self.pile(16);
                self.rope(Vec3::new(-0.2, 0.9, 0.1), 9, 300.0);
                self.net(Vec3::new(-0.1, 1.1, -0.1), 5);
            }
            Scene::TwoSchemes => {
                self.pile(8);
                self.rope(Vec3::new(0.2, 0.8, 0.2), 10, 300.0);
                let anchor = self.names.particles[8];
                self.hang(anchor, Vec3::new(-0.1, 0.8, 0.2), Vec3::NEG_X, 10, 1e8);
            }
        }
    }

    fn particle(&mut self, mass: f32, radius: f32, position: Vec3) -> Entity {
        let particle = spawn(&mut self.app, mass, radius, position);
        self.names.particles.push(particle);
        particle
    }

    fn spring(&mut self, first: Entity, second: Entity, length: f32, stiffness: f32) {
        let spring = Spring::new(first, second, length).with_stiffness(stiffness).with_damping(0.2);
        self.names.springs.push(join(&mut self.app, spring));
    }

    fn hang(&mut self, anchor: Entity, start: Vec3, direction: Vec3, count: usize, stiffness: f32) {
        let mut last = anchor;
        for number in 0..count {
            let next = self.particle(0.1, 0.04, start + direction * 0.1 * number as f32);
            self.spring(last, next, 0.1, stiffness);
            last = next;
        }
    }

    fn rope(&mut self, start: Vec3, count: usize, stiffness: f32) {
        let anchor = spawn_pinned(&mut self.app, start);
        self.names.particles.push(anchor);
        self.hang(anchor, start + Vec3::X * 0.1, Vec3::X, count, stiffness);
    }

    fn family(&mut self) {
        let parent = self.app.world_mut().spawn(Transform::default()).id();
        self.names.parent = Some(parent);
        let child = self.particle(1.0, 0.05, Vec3::X);
        self.app.world_mut().entity_mut(child).insert((Pinned, ChildOf(parent)));
        let free = self.particle(1.0, 0.05, Vec3::X * 1.5);
        self.app.world_mut().entity_mut(free).insert(ChildOf(parent));
        self.spring(child, free, 0.5, 200.0);
        self.hang(free, Vec3::new(1.6, 0.0, 0.0), Vec3::X, 5, 200.0);
    }

    fn pile(&mut self, count: u8) {
        for transform in [
            Transform::default(),
            Transform::from_xyz(-0.15, 0.0, 0.0).with_rotation(Quat::from_rotation_z(-1.5)),
        ] {
            let plane = ParticleCollider { restitution: 0.2, friction: 0.4, ..default() };
            self.names.planes.push(self.app.world_mut().spawn((plane, transform)).id());
        }
        for ball in 0..count {
            let [column, row, layer] = [ball % 3, ball / 3 % 3, ball / 9].map(f32::from);
            let jitter = Vec3::new(f32::from(ball * 7 % 11), 0.0, f32::from(ball * 5 % 13)) * 0.002;
            let place = Vec3::new(column, layer + 0.6, row) * 0.2 + jitter;
            self.particle(0.3 + 0.1 * f32::from(ball % 4), [0.1, 0.08, 0.05][usize::from(ball % 3)], place);
        }
    }

    fn net(&mut self, corner: Vec3, side: usize) {
        let first = self.names.particles.len();
        for number in 0..side * side {
            let (column, row) = (number % side, number / side);
            let place = corner + Vec3::new(column as f32, 0.0, row as f32) * 0.1;
            let next = self.particle(0.05, 0.04, place);
            for (exists, back) in [(column > 0, 1), (row > 0, side)] {
                if exists {
                    self.spring(self.names.particles[first + number - back], next, 0.1, 100.0);
                }
            }
        }
    }

    /// What a game does before a tick.
    fn drive(&mut self) {
        let tick = self.tick;
        let around = (tick % 40) as f32 / 40.0;
        let (sin, cos) = bevy::math::ops::sin_cos(around * std::f32::consts::TAU);
        if let (Scene::Ropes, Some(&anchor)) = (self.scene, self.names.particles.first()) {
            common::place(&mut self.app, anchor, Vec3::new(0.2 * sin, 2.0 + 0.1 * cos, 0.0));
        }
        if let Some(parent) = self.names.parent {
            let mut transform = self.app.world_mut().get_mut::<Transform>(parent).expect("it is there");
            *transform = Transform::from_xyz(0.1 * sin, 1.0, 0.1 * cos)
                .with_rotation(Quat::from_rotation_y(0.3 * sin));
        }
        if let Some(&floor) = self.names.planes.first() {
            let mut transform = self.app.world_mut().get_mut::<Transform>(floor).expect("it is there");
            transform.translation.y = 0.02 * sin;
            transform.rotation = Quat::from_rotation_z(0.1 * sin);
        }
        match (self.scene, tick) {
            (Scene::Joiners, 20) => self.join_late(),
            (Scene::Leavers, 15) => self.leave(&[3, 20, 30]),
            (Scene::Leavers, 25) => {
                self.leave(&[0]);
                let (spring, plane) = (self.names.springs.pop(), self.names.planes.pop());
                for entity in spring.into_iter().chain(plane) {
                    self.app.world_mut().despawn(entity);
                }
            }
            _ => {}
        }
    }

    fn join_late(&mut self) {
        let last = *self.names.particles.last().expect("there are some");
        let start = common::position(&self.app, last);
        self.hang(last, start + Vec3::Y * 0.1, Vec3::Y, 4, 300.0);
        self.particle(0.5, 0.1, Vec3::new(0.2, 2.0, 0.2));
        let wall = Transform::from_xyz(0.8, 0.0, 0.0).with_rotation(Quat::from_rotation_z(1.5));
        self.names.planes.push(self.app.world_mut().spawn((ParticleCollider::default(), wall)).id());
    }

    /// Despawns some particles, by their numbers.
    fn leave(&mut self, numbers: &[usize]) {
        for number in numbers.iter().rev() {
            let particle = self.names.particles.remove(*number);
            self.app.world_mut().despawn(particle);
        }
        let Self { app, names: Names { particles, springs, .. }, .. } = self;
        let ends = |spring: &Entity| app.world().get::<Spring>(*spring).map(|spring| spring.particles);
        springs
            .retain(|spring| ends(spring).is_some_and(|ends| ends.iter().all(|end| particles.contains(end))));
    }

    /// Runs one tick.
    pub fn step(&mut self) {
        self.drive();
        run(&mut self.app, 1);
        self.tick += 1;
    }

    pub fn run_to(&mut self, tick: u32) {
        while self.tick < tick {
            self.step();
        }
    }

    pub fn bits(&self) -> Bits {
        let loose = self.names.particles.iter().map(|particle| common::bits(&self.app, *particle));
        loose.chain(self.names.nets.iter().flat_map(|net| net_bits(&self.app, *net))).collect()
    }

    /// What the next `ticks` bring.
    pub fn follow(&mut self, ticks: u32) -> Vec<Bits> {
        (0..ticks)
            .map(|_| {
                self.step();
                self.bits()
            })
            .collect()
    }

    /// Compares what the next ticks bring.
    #[track_caller]
    pub fn assert_follows(&mut self, expected: &[Bits], what: &str) {
        for expected in expected {
            self.step();
            let found = self.bits();
            let differing = (0..found.len().max(expected.len())).find(|i| found.get(*i) != expected.get(*i));
            assert_eq!(differing, None, "{what}: the first particle that differs after tick {}", self.tick);
        }
    }
}
