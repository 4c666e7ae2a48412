//! The peers: one file each, one trait for all.

mod avian;
mod bevy_rapier;
mod hand_written;
mod headless;
mod mass_spring;
mod naive;
mod rapier_soft_body;

use bevy::math::Vec3;
use bevy_mass_spring::{Integrator, SubstepMode};

use crate::scene::Scene;

/// A simulation of a [`Scene`].
pub trait Peer {
    /// Advances by [`TICK`](crate::scene::TICK), with all that a user of the peer pays for each tick.
    fn tick(&mut self);

    /// The positions of the particles in the order of the scene, m.
    fn positions(&self) -> Vec<Vec3>;

    /// Into how many steps the last tick was divided.
    fn substeps(&self) -> u32;
}

/// Builds a peer and its scene, ready for the first tick.
type Start = Box<dyn Fn(&Scene) -> Box<dyn Peer>>;

/// A peer with its settings: a row of each table.
pub struct Entry {
    pub name: String,
    pub start: Start,
}

/// All rows, in their order.
pub fn all() -> Vec<Entry> {
    let mut entries = Vec::new();
    for substeps in [16, 32] {
        entries.push(entry("naive loop", substeps, naive::NaiveLoop::new));
    }
    for substeps in [8, 16, 20, 32] {
        entries.push(entry("bevy_mass_spring", substeps, |scene, substeps| {
            mass_spring::MassSpring::new(scene, Integrator::SemiImplicitEuler, SubstepMode::Fixed(substeps))
        }));
    }
    entries.push(Entry {
        name: "bevy_mass_spring, Auto".to_owned(),
        start: Box::new(|scene| {
            Box::new(mass_spring::MassSpring::new(scene, Integrator::Auto, SubstepMode::Auto))
        }),
    });
    for substeps in [16, 32] {
        entries.push(entry("hand-written Bevy system", substeps, hand_written::HandWritten::new));
    }
    for substeps in [6, 24] {
        entries.push(entry("avian3d distance joints", substeps, avian::Avian::new));
    }
    for substeps in [4, 16] {
        entries.push(entry("bevy_rapier3d spring joints", substeps, bevy_rapier::BevyRapier::new));
    }
    for substeps in [4, 16] {
        entries.push(entry("rapier3d soft body", substeps, rapier_soft_body::RapierSoftBody::new));
    }
    entries
}

fn entry<P: Peer + 'static>(name: &str, substeps: u32, start: fn(&Scene, u32) -> P) -> Entry {
    Entry {
        name: format!("{name}, {substeps} substeps"),
        start: Box::new(move |scene| Box::new(start(scene, substeps))),
    }
}
