//! Nets that collide, tear, yield, are paid out, and are tied to what breaks off.

use bevy::prelude::*;
use bevy_mass_spring::nets::{Attachment, Breaking, Part, PartOf, Winch, Yielding};
use bevy_mass_spring::prelude::*;

use super::Stage;
use crate::nets_sync::shapes::{cloth, rope, spawn_net, with_bends};

impl Stage {
    /// A sheet that lies on a ball and is torn by a weight, a rope with a winch, one with its end tied to a weight that
    /// breaks off, and a rod of particles that are entities, above a floor that moves.
    pub(super) fn nets(&mut self) {
        self.pile(6);
        let mut sheet = with_bends(cloth(6));
        sheet.radius = 0.02;
        sheet.triangles = (0..25_u32)
            .map(|cell| 6 * (cell / 5) + cell % 5)
            .flat_map(|a| [[a, a + 6, a + 1], [a + 1, a + 6, a + 7]])
            .collect();
        sheet.masses[35] = 6.0;
        let sheet = spawn_net(&mut self.app, &sheet, Vec3::new(-0.2, 1.5, -0.2), &[0, 5]);
        let material = ContactMaterial { friction: 0.6, ..default() };
        self.app
            .world_mut()
            .entity_mut(sheet)
            .insert((Breaking { strain: Some(0.6), ..default() }, material));
        let world = self.app.world_mut();
        let ball = ParticleCollider::from(Sphere::new(0.2));
        world.spawn((ball, ColliderMotion::default(), material, Transform::from_xyz(0.1, 1.2, 0.1)));

        let winched = spawn_net(&mut self.app, &with_bends(rope(8)), Vec3::new(0.0, 2.0, 2.0), &[]);
        let winch = Winch { speed: 0.2, ..default() };
        self.app.world_mut().spawn((PartOf(winched), Part::Start, Pinned, winch));
        let yielding = Yielding { strain: Some(0.02), ..default() };
        self.app.world_mut().entity_mut(winched).insert(yielding);

        let tied = spawn_net(&mut self.app, &rope(8), Vec3::new(0.0, 2.0, -2.0), &[0]);
        let weight = self.particle(0.5, 0.05, Vec3::new(0.8, 2.0, -2.0));
        let attachment = Attachment::to(weight).breaking_at(4.0);
        self.app.world_mut().spawn((PartOf(tied), Part::End, attachment));

        self.rope(Vec3::new(-2.0, 1.0, 0.0), 6, 300.0);
        let rod = self.names.particles.len() - 6;
        for first in rod..rod + 4 {
            let [first, middle, last] = [0, 1, 2].map(|next| self.names.particles[first + next]);
            self.app.world_mut().spawn(Bend::new(first, middle, last).with_stiffness(2.0).with_damping(0.01));
        }
        self.names.nets = vec![sheet, winched, tied];
    }
}
