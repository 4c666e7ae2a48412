//! What a rollback library does by itself: it saves the documented components and the resource [`MassSpringState`],
//! and puts them back later.

use bevy::ecs::entity::{EntityHashMap, MapEntities};
use bevy::prelude::*;
use bevy_mass_spring::nets::PartState;
use bevy_mass_spring::prelude::*;

use crate::common::{join, run, spawn};
use crate::stage::{Names, Scene, Stage};

macro_rules! define_saved {
    ($($name:ident: $component:ty,)*) => {
        /// The components of one entity: all that the documents name, and the parent.
        #[derive(Debug, Clone, Default)]
        struct Saved {
            $($name: Option<$component>,)*
            spring: Option<Spring>,
            bend: Option<Bend>,
            parent: Option<ChildOf>,
        }

        impl Saved {
            fn of(entity: EntityRef) -> Self {
                Self {
                    $($name: entity.get().cloned(),)*
                    spring: entity.get().cloned(),
                    bend: entity.get().cloned(),
                    parent: entity.get().cloned(),
                }
            }

            fn put_back(&self, entity: &mut EntityWorldMut, map: &mut EntityHashMap<Entity>) {
                let (mut spring, mut bend) = (self.spring, self.bend);
                spring.iter_mut().for_each(|spring| spring.map_entities(map));
                bend.iter_mut().for_each(|bend| bend.map_entities(map));
                let parent = self.parent.as_ref().map(|parent| ChildOf(map[&parent.parent()]));
                $(put(entity, self.$name.clone());)*
                put(entity, spring);
                put(entity, bend);
                put(entity, parent);
            }
        }
    };
}
define_saved!(
    transform: Transform,
    particle: Particle,
    velocity: ParticleVelocity,
    pinned: Pinned,
    force: AppliedForce,
    quarantined: Quarantined,
    order: SimulationOrder,
    broken: Broken,
    net: ParticleNet,
    part: PartState,
    breaking: Breaking,
    yielding: Yielding,
    winch: Winch,
    collider: ParticleCollider,
    motion: ColliderMotion,
    material: ContactMaterial,
    layers: ContactLayers,
    exemptions: ContactExemptions,
);

/// A moment of a stage.
struct Moment {
    entities: Vec<(Entity, Saved)>,
    state: MassSpringState,
    /// What the test itself knows.
    names: Names,
    tick: u32,
}

impl Moment {
    fn save(stage: &mut Stage) -> Self {
        let (names, tick) = (stage.names.clone(), stage.tick);
        let world = stage.app.world_mut();
        let mut entities = world.query::<EntityRef>();
        let entities = entities.iter(world).filter(|entity| {
            entity.contains::<Transform>() || entity.contains::<Spring>() || entity.contains::<Bend>()
        });
        let entities = entities.map(|entity| (entity.id(), Saved::of(entity))).collect();
        let state = world.resource::<MassSpringState>().clone();
        Self { entities, state, names, tick }
    }

    /// Despawns what was spawned since, respawns what was despawned, and writes everything back.
    fn put_back(&self, stage: &mut Stage) {
        let world = stage.app.world_mut();
        let mut present = world.query_filtered::<Entity, Or<(With<Transform>, With<Spring>, With<Bend>)>>();
        let later: Vec<Entity> = present.iter(world).filter(|entity| !self.knows(*entity)).collect();
        for entity in later {
            world.despawn(entity);
        }
        let mut map: EntityHashMap<Entity> = default();
        // In another order than they were spawned in.
        for (entity, _) in self.entities.iter().rev() {
            let now = if world.get_entity(*entity).is_ok() { *entity } else { world.spawn_empty().id() };
            map.insert(*entity, now);
        }
        for (entity, saved) in &self.entities {
            saved.put_back(&mut world.entity_mut(map[entity]), &mut map.clone());
        }
        let mut state = self.state.clone();
        state.map_entities(&mut map);
        world.insert_resource(state);
        (stage.names, stage.tick) = (self.names.clone(), self.tick);
        stage.names.map_entities(&mut map);
    }

    fn knows(&self, entity: Entity) -> bool {
        self.entities.iter().any(|(known, _)| *known == entity)
    }
}

/// Writes a component as it was saved, if it was.
fn put<T: Component>(entity: &mut EntityWorldMut, saved: Option<T>) {
    match saved {
        Some(value) => entity.insert(value),
        None => entity.remove::<T>(),
    };
}

/// What a mispredicted player did: spawns, despawns, edits.
fn mispredict(stage: &mut Stage, tick: u32) {
    let app = &mut stage.app;
    match tick {
        2 => {
            let [first, second] = [Vec3::new(0.1, 1.5, 0.1), Vec3::new(0.2, 1.5, 0.1)]
                .map(|place| spawn(app, 0.2, 0.05, place));
            join(app, Spring::new(first, second, 0.1));
            join(app, Spring::new(first, stage.names.particles[2], 0.4));
            app.world_mut().spawn((ParticleCollider::default(), Transform::from_xyz(0.0, -0.1, 0.0)));
        }
        4 => {
            for number in [1, 4] {
                app.world_mut().despawn(stage.names.particles[number]);
            }
            app.world_mut().despawn(stage.names.springs.first().copied().unwrap_or(stage.names.particles[5]));
        }
        5 => {
            let mut entity = app.world_mut().entity_mut(stage.names.particles[3]);
            entity.insert(AppliedForce(Vec3::Y * 3.0));
            entity.get_mut::<Particle>().expect("it is one").mass *= 2.0;
        }
        7 => {
            app.world_mut().entity_mut(stage.names.particles[0]).insert(Quarantined);
            for spring in stage.names.springs.iter().skip(2).take(3) {
                if let Some(mut spring) = app.world_mut().get_mut::<Spring>(*spring) {
                    spring.stiffness *= 0.5;
                    spring.particles.swap(0, 1);
                }
            }
        }
        8 => mispredict_nets(stage),
        _ => {}
    }
}

/// Edits nets, and lets go of what holds them.
fn mispredict_nets(stage: &mut Stage) {
    let world = stage.app.world_mut();
    for mut net in world.query::<&mut ParticleNet>().iter_mut(world) {
        net.positions_mut()[3] += Vec3::Y * 0.05;
        net.set_pinned(4, true);
    }
    for mut winch in world.query::<&mut Winch>().iter_mut(world) {
        winch.speed = -0.4;
    }
    let held: Vec<Entity> =
        world.query_filtered::<Entity, (With<Pinned>, With<PartState>)>().iter(world).collect();
    for part in held {
        world.entity_mut(part).remove::<Pinned>();
    }
}

fn for_each_case(check: impl Fn(Scene, Integrator, &str)) {
    for scene in Scene::ALL {
        for integrator in Integrator::ALL {
            check(scene, integrator, &format!("{scene:?}, {integrator}"));
        }
    }
}

#[test]
fn components_and_the_resource_are_enough() {
    for_each_case(|scene, integrator, what| {
        let mut stage = Stage::new(scene, integrator);
        stage.run_to(40);
        let moment = Moment::save(&mut stage);
        let expected = stage.follow(60);
        moment.put_back(&mut stage);
        stage.assert_follows(&expected, what);
    });
}

#[test]
fn what_was_spawned_or_despawned_since_does_not_matter() {
    for_each_case(|scene, integrator, what| {
        let mut stage = Stage::new(scene, integrator);
        stage.run_to(40);
        let moment = Moment::save(&mut stage);
        let expected = stage.follow(60);
        // In the second round all that was despawned in the first one has another name already.
        for round in 0..2 {
            moment.put_back(&mut stage);
            for tick in 0..60 {
                mispredict(&mut stage, tick);
                run(&mut stage.app, 1);
            }
            moment.put_back(&mut stage);
            stage.assert_follows(&expected, &format!("{what}, round {round}"));
        }
    });
}

/// As over a network: many moments, each put back a few ticks after it was saved.
#[test]
fn rollbacks_in_a_row_change_nothing() {
    for_each_case(|scene, integrator, what| {
        let expected = Stage::new(scene, integrator).follow(60);
        let mut stage = Stage::new(scene, integrator);
        for tick in 0..60 {
            let moment = Moment::save(&mut stage);
            let ahead = expected.len().min(tick + 1 + tick % 4);
            stage.assert_follows(&expected[tick..ahead], what);
            moment.put_back(&mut stage);
            stage.assert_follows(&expected[tick..=tick], &format!("{what}, again"));
        }
    });
}
