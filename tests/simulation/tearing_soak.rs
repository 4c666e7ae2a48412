//! Cloths that are torn at random in an app, cut after cut.

use std::sync::Arc;

use bevy::prelude::*;
use bevy_mass_spring::nets::{Breaking, Part, PartOf, RecipeMesh, Side, Topology, TriangleMesh};
use bevy_mass_spring::prelude::*;

use super::tears::{check_surface, elastic_energy, random};
use crate::common::{app, messages, plain, run, scheme};

const CUTS: usize = 10_000;
const TICKS_A_CLOTH: u32 = 250;
/// N.
const PULL: f32 = 60.0;

const MATERIAL: ClothMaterial = ClothMaterial {
    area_density: 0.2,
    stretch_stiffness: 1e3,
    shear_stiffness: 3e2,
    bending_stiffness: 1e-3,
    retardation_time: 1e-3,
};

/// What a net was before a tick.
struct Before {
    topology: Arc<Topology>,
    positions: Vec<Vec3>,
    forces: Vec<Vec3>,
    energy: f64,
}

/// A cloth in an app without gravity and contacts.
struct Soak {
    app: App,
    cloth: Entity,
    whole: Topology,
    mass: f64,
}

impl Soak {
    /// A sheet that hangs by a side, or a closed shell that floats.
    fn new(round: u32) -> Self {
        let mut app = app();
        plain(&mut app);
        app.insert_resource(match round % 5 {
            0 | 1 => SolverSettings::default(),
            2 => scheme(Integrator::SemiImplicitEuler, 30),
            3 => scheme(Integrator::ImplicitEuler, 1),
            _ => scheme(Integrator::Xpbd, 10),
        });
        let breaking = Breaking { strain: Some(0.1), ..default() };
        let cloth = if round.is_multiple_of(2) {
            let sheet = Cloth::sheet(Rectangle::new(1.0, 1.0)).with_cells(UVec2::splat(10));
            let cloth = app.world_mut().spawn((sheet.with_material(MATERIAL), breaking)).id();
            app.world_mut().spawn((PartOf(cloth), Part::Edge(Side::Top), Pinned));
            cloth
        } else {
            let sphere = Balloon::default().with_subdivisions(2).topology().expect("sound");
            let mesh = RecipeMesh(TriangleMesh::new(sphere.positions, sphere.triangles).into());
            app.world_mut().spawn((Cloth::from_mesh().with_material(MATERIAL), mesh, breaking)).id()
        };
        run(&mut app, 2);
        let net = app.world().get::<ParticleNet>(cloth).expect("it is laid out");
        let whole = Topology::clone(net.topology());
        let mass = total(&whole.masses);
        Self { app, cloth, whole, mass }
    }

    fn net(&self) -> &ParticleNet {
        self.app.world().get(self.cloth).expect("it is still there")
    }

    /// Pulls at three particles in each third tick, moves all of them in each 20th, and has the springs bear more or less in
    /// each 30th.
    fn act(&mut self, tick: u32, seed: &mut u64) {
        let mut direction = || Vec3::from_array([0; 3].map(|_| 2.0 * random(seed) - 1.0));
        let mut entity = self.app.world_mut().entity_mut(self.cloth);
        let mut net = entity.get_mut::<ParticleNet>().expect("it is still there");
        if tick.is_multiple_of(20) {
            let velocities = net.velocities_mut();
            velocities.iter_mut().for_each(|velocity| *velocity = 8.0 * direction());
        }
        if tick.is_multiple_of(3) {
            net.clear_applied_forces();
            for _ in 0..3 {
                let force = PULL * direction();
                let forces = net.applied_forces_mut();
                let particle = (0.5 * (direction().x + 1.0) * forces.len() as f32) as usize;
                forces[particle.min(forces.len() - 1)] = force;
            }
        }
        if tick.is_multiple_of(30) {
            let strain = 0.11 + 0.09 * direction().x;
            entity.insert(Breaking { strain: Some(strain), ..default() });
        }
    }

    fn before(&self) -> Before {
        let net = self.net();
        Before {
            topology: Arc::clone(net.topology()),
            positions: net.positions().to_vec(),
            forces: net.applied_forces().to_vec(),
            energy: energy(net.topology(), net),
        }
    }

    /// A tick; the number of springs that broke in it.
    fn tick(&mut self) -> usize {
        let before = self.before();
        run(&mut self.app, 1);
        let broken = messages::<Broke>(&mut self.app).len();
        let net = self.net();
        assert!(net.quarantined().is_empty() && net.positions().iter().all(|place| place.is_finite()));
        assert!((total(net.masses()) / self.mass - 1.0).abs() < 1e-6, "{} kg", total(net.masses()));
        if !Arc::ptr_eq(&before.topology, net.topology()) {
            self.check_break(&before);
        }
        self.check_energy(&before);
        broken
    }

    /// What a break does is done at the end of a tick, where nothing moves.
    fn check_break(&self, before: &Before) {
        let (net, old) = (self.net(), &before.topology);
        let new = net.topology();
        new.validate().expect("numbers in range");
        check_surface(&self.whole, new);
        assert_eq!((net.velocities().len(), new.positions.len()), (net.len(), net.len()));
        for (now, was) in new.triangles.as_flattened().iter().zip(old.triangles.as_flattened()) {
            let [now, was] = [*now as usize, *was as usize];
            assert!(now == was || now >= old.positions.len(), "{now} is no copy of {was}");
            assert_eq!(net.positions()[now], net.positions()[was]);
            assert_eq!(net.velocities()[now], net.velocities()[was]);
        }
        let [there, here] = [old, new].map(|topology| energy(topology, net));
        assert!(here <= there * (1.0 + 1e-6), "{here} J after the break, {there} J before");
    }

    /// Backward Euler never has more energy than what was there and what the forces have done.
    fn check_energy(&self, before: &Before) {
        if self.app.world().resource::<SolverSettings>().integrator != Integrator::ImplicitEuler {
            return;
        }
        let net = self.net();
        let ways = net.positions().iter().zip(&before.positions).map(|(now, was)| (*now - *was).as_dvec3());
        let work: f64 = before.forces.iter().zip(ways).map(|(force, way)| force.as_dvec3().dot(way)).sum();
        let (now, most) = (energy(net.topology(), net), before.energy + work);
        assert!(now <= most + 1e-4 * before.energy.max(now), "{now} J of at most {most} J");
    }
}

/// Kinetic and elastic energy of a net with this topology, J.
fn energy(topology: &Topology, net: &ParticleNet) -> f64 {
    let moving = topology.masses.iter().zip(net.velocities());
    let kinetic =
        moving.map(|(mass, velocity)| 0.5 * f64::from(*mass) * velocity.as_dvec3().length_squared());
    kinetic.sum::<f64>() + elastic_energy(topology, net.positions())
}

fn total(masses: &[f32]) -> f64 {
    masses.iter().map(|mass| f64::from(*mass)).sum()
}

/// The bar: in 10,000 cuts no panic, no hole, no mass lost, no energy gained at a break.
#[test]
fn cloths_that_are_torn_ten_thousand_times_stay_whole_where_they_are() {
    let (mut seed, mut cuts, mut copies) = (5, 0, 0);
    for round in 0.. {
        let mut soak = Soak::new(round);
        for tick in 0..TICKS_A_CLOTH {
            soak.act(tick, &mut seed);
            cuts += soak.tick();
        }
        copies += soak.net().len() - soak.whole.positions.len();
        if cuts >= CUTS {
            println!("{cuts} cuts of {} cloths, {copies} copies", round + 1);
            break;
        }
    }
}
