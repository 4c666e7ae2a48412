//! From the nets of a scene to recipes, and from these to particles.

use std::sync::Arc;

use bevy::prelude::*;

use super::description::{MassSpringScene, SceneSpring};
use super::error::{SceneError, SceneErrorReason};
use super::nets::SceneNet;
use crate::nets::{
    Air, Balloon, BalloonMaterial, Breaking, Cloth, ClothMaterial, Jelly, JellyMaterial, NetError,
    ParticleNet, Rope, RopeMaterial, Topology,
};

/// The recipe that a net of a scene describes.
enum Recipe {
    Rope(Rope),
    Cloth(Cloth),
    Jelly(Jelly),
    Balloon(Balloon),
}

impl SceneNet {
    fn recipe(&self) -> Recipe {
        match *self {
            Self::Rope { .. } => Recipe::Rope(self.rope()),
            Self::Cloth { .. } => Recipe::Cloth(self.cloth()),
            Self::Jelly { min, max, cells, radius, density, youngs_modulus, retardation_time, .. } => {
                let material = JellyMaterial { density, youngs_modulus, retardation_time };
                let jelly = Jelly::lattice(min, max, cells.into()).with_material(material);
                Recipe::Jelly(jelly.with_radius(radius))
            }
            Self::Balloon {
                centre,
                radius,
                subdivisions,
                thickness,
                area_density,
                stretch_stiffness,
                pressure,
                retardation_time,
            } => {
                let bending_stiffness = 0.0;
                let material = BalloonMaterial {
                    area_density,
                    stretch_stiffness,
                    bending_stiffness,
                    retardation_time,
                    pressure,
                };
                let sphere = Balloon::sphere(Sphere::new(radius)).with_centre(centre);
                let balloon = sphere.with_subdivisions(subdivisions).with_material(material);
                Recipe::Balloon(Balloon { radius: 0.5 * thickness, ..balloon })
            }
        }
    }

    fn rope(&self) -> Rope {
        let Self::Rope {
            from,
            to,
            segments,
            radius,
            linear_density,
            stretch_stiffness,
            bending_stiffness,
            retardation_time,
            tension_only,
            max_stretch,
            ..
        } = *self
        else {
            return Rope::default();
        };
        let material =
            RopeMaterial { linear_density, stretch_stiffness, bending_stiffness, retardation_time };
        let rope = Rope::between(from, to).with_segments(segments).with_radius(radius);
        Rope { material, tension_only, max_stretch, ..rope }
    }

    fn cloth(&self) -> Cloth {
        let Self::Cloth {
            corner,
            width,
            height,
            cells,
            radius,
            area_density,
            stretch_stiffness,
            shear_stiffness,
            bending_stiffness,
            retardation_time,
            max_stretch,
            drag_coefficient: drag,
            lift_coefficient: lift,
            self_collision,
            ..
        } = *self
        else {
            return Cloth::default();
        };
        let material = ClothMaterial {
            area_density,
            stretch_stiffness,
            shear_stiffness,
            bending_stiffness,
            retardation_time,
        };
        let sheet = Cloth::grid(corner, width, height, cells.into()).with_radius(radius);
        Cloth { material, max_stretch, air: Air { drag, lift }, self_collision, ..sheet }
    }

    /// Its strength; `None` if it does not break.
    pub fn breaking(&self) -> Option<Breaking> {
        let (strain, force) = match *self {
            Self::Rope { breaking_force, .. } => (None, breaking_force),
            Self::Cloth { breaking_strain, .. } => (breaking_strain, None),
            Self::Jelly { .. } | Self::Balloon { .. } => (None, None),
        };
        (strain.is_some() || force.is_some()).then_some(Breaking { strain, force })
    }

    /// Its particles, springs and bends, in world space.
    ///
    /// # Errors
    /// If sizes and material do not go together.
    pub fn topology(&self) -> Result<Topology, NetError> {
        match self.recipe() {
            Recipe::Rope(rope) => rope.topology(),
            Recipe::Cloth(cloth) => cloth.topology(),
            Recipe::Jelly(jelly) => jelly.topology(),
            Recipe::Balloon(balloon) => balloon.topology(),
        }
    }

    /// Spawns it: its recipe and, where that can be laid out, the net at rest.
    pub(super) fn spawn(&self, topology: Option<Topology>, commands: &mut Commands) -> Entity {
        let mut entity = match self.recipe() {
            Recipe::Rope(rope) => commands.spawn(rope),
            Recipe::Cloth(cloth) => commands.spawn(cloth),
            Recipe::Jelly(jelly) => commands.spawn(jelly),
            Recipe::Balloon(balloon) => commands.spawn(balloon),
        };
        entity.insert(Transform::IDENTITY);
        if let Some(breaking) = self.breaking() {
            entity.insert(breaking);
        }
        if let Some(topology) = topology {
            let net = ParticleNet::laid_out(Arc::new(topology), |place| place);
            entity.insert(net.with_pinned(self.pinned().iter().copied()));
        }
        entity.id()
    }
}

/// All particles of a scene, those of its nets included, as they are at the start.
#[derive(Debug, Clone, Default, PartialEq)]
#[non_exhaustive]
pub struct SceneLayout {
    /// The nets, in the order of the scene.
    pub topologies: Vec<Topology>,
    /// The places of all particles, m: of those in the list, then of those of the nets.
    pub positions: Vec<Vec3>,
}

impl SceneLayout {
    /// The rest length of `spring` in m: its own, or the initial distance of its two ends.
    ///
    /// `None` if it has none and an end does not exist.
    pub fn rest_length(&self, spring: &SceneSpring) -> Option<f32> {
        spring.rest_length.or_else(|| distance(&self.positions, spring.particles))
    }
}

fn distance(positions: &[Vec3], (first, second): (usize, usize)) -> Option<f32> {
    let [first, second] = [positions.get(first)?, positions.get(second)?].map(|place| place.as_dvec3());
    Some(first.distance(second) as f32)
}

impl MassSpringScene {
    /// The number of its particles: those in the list and those of the nets.
    pub fn particle_count(&self) -> usize {
        let of_nets = self.nets.iter().map(SceneNet::particle_count);
        of_nets.fold(self.particles.len(), usize::saturating_add)
    }

    /// Lays its nets out.
    ///
    /// # Errors
    /// Names the first net that cannot be.
    pub fn layout(&self) -> Result<SceneLayout, SceneError> {
        self.lay_out().map_err(|(index, source)| {
            SceneErrorReason::Net { field: format!("nets[{index}]"), source: Box::new(source) }.into()
        })
    }

    /// The same; or which net cannot be laid out, and why.
    pub(super) fn lay_out(&self) -> Result<SceneLayout, (usize, NetError)> {
        let mut layout = SceneLayout::default();
        layout.positions.extend(self.particles.iter().map(|particle| particle.position));
        for (index, net) in self.nets.iter().enumerate() {
            let topology = net.topology().map_err(|problem| (index, problem))?;
            layout.positions.extend(&topology.positions);
            layout.topologies.push(topology);
        }
        Ok(layout)
    }

    /// The rest length of `spring` in m: its own, or the initial distance of its two ends. Of many springs that end in
    /// nets ask [`SceneLayout`].
    ///
    /// `None` if it has none and an end does not exist.
    pub fn rest_length(&self, spring: &SceneSpring) -> Option<f32> {
        let (first, second) = spring.particles;
        if spring.rest_length.is_none() && first.max(second) >= self.particles.len() {
            return self.lay_out().ok()?.rest_length(spring);
        }
        let place = |index: usize| Some(self.particles.get(index)?.position);
        spring.rest_length.or_else(|| distance(&[place(first)?, place(second)?], (0, 1)))
    }

    /// The net and the number in it of a particle beyond those of the list.
    pub fn net_of(&self, particle: usize) -> Option<(usize, u32)> {
        let mut number = particle.checked_sub(self.particles.len())?;
        for (index, net) in self.nets.iter().enumerate() {
            let count = net.particle_count();
            if number < count {
                return Some((index, number as u32));
            }
            number -= count;
        }
        None
    }
}
