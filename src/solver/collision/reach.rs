//! What islands may reach in a tick, as boxes.

use bevy::math::{Vec3, Vec3A};

use super::material::{Skin, skin_of};
use super::surface::{Box3, CONTACT_HYSTERESIS};
use crate::solver::graph::{Exclusions, Islands};
use crate::solver::particles::Particles;
use crate::solver::settings::StepSettings;

/// What the search for islands that touch reads.
#[derive(Clone, Copy)]
pub(in crate::solver) struct Scene<'a> {
    pub islands: &'a Islands,
    pub particles: &'a Particles,
    /// Whether the particle in each slot is no sphere of its own; empty if all are.
    pub covered: &'a [bool],
    /// The surfaces of particles by slot; of those beyond its end as of any.
    pub skins: &'a [Skin],
    pub settings: &'a StepSettings,
}

impl Scene<'_> {
    /// Whether a particle touches others as a sphere.
    pub fn is_sphere(&self, slot: usize) -> bool {
        self.particles.radius()[slot] > 0.0 && self.covered.get(slot) != Some(&true)
    }

    /// Where a particle is, and how far it goes in free flight in the tick, m.
    pub fn flight(&self, slot: usize) -> [Vec3; 2] {
        let StepSettings { time_step, gravity, .. } = *self.settings;
        let velocity = self.particles.velocity.get(slot) + time_step * gravity;
        [self.particles.position.get(slot), time_step * velocity]
    }

    /// Whether two particles collide where they meet.
    pub fn may_meet(&self, one: u32, other: u32) -> bool {
        let layers = |slot: u32| skin_of(self.skins, slot as usize).layers;
        (self.skins.is_empty() || layers(one).meet(layers(other)))
            && !Exclusions::are_of_one_family(self.particles.families(), one, other)
    }
}

/// What an island may reach in the tick.
#[derive(Debug, Clone, Copy)]
pub(super) struct Reach {
    /// That of the centres, m.
    pub bounds: Box3,
    /// m.
    pub thickest: f32,
    /// What its box has in common with those of others, margins included, m.
    pub shared: Box3,
    /// Whether its particles are looked at.
    pub is_wanted: bool,
}

impl Reach {
    pub const NOTHING: Self =
        Self { bounds: Box3::NOTHING, thickest: 0.0, shared: Box3::NOTHING, is_wanted: false };

    /// The box in which it may touch others, or what is between.
    pub fn grown(&self, margin: f32) -> Box3 {
        self.bounds.grown((1.0 + CONTACT_HYSTERESIS) * self.thickest + margin)
    }
}

/// Finds what the islands with spheres may reach, and loose spheres; and the longest way of a particle of both, at most, m.
pub(super) struct Measure<'a> {
    pub scene: Scene<'a>,
    pub reaches: &'a mut [Reach],
    pub loose: &'a mut Reach,
    pub longest: &'a mut [f32; 2],
}

impl pulp::WithSimd for Measure<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, simd: S) {
        let Self { scene, reaches, loose, longest } = self;
        let Scene { islands, particles, settings: StepSettings { time_step, gravity, .. }, .. } = scene;
        let falls = Vec3A::from(*time_step * *gravity);
        for (slots, island) in islands.runs() {
            let slots = slots.start as usize..slots.end as usize;
            if !slots.clone().any(|slot| scene.is_sphere(slot)) {
                continue;
            }
            let box_of = |axes: [&[f32]; 3]| {
                let extremes = axes.map(|axis| extremes(simd, &axis[slots.clone()]));
                let [least, most] = [0, 1].map(|side| Vec3A::from_array(extremes.map(|axis| axis[side])));
                Box3 { least, most }
            };
            let (start, velocity) = (box_of(particles.position.axes()), box_of(particles.velocity.axes()));
            let [least, most] = [velocity.least, velocity.most].map(|end| *time_step * (end + falls));
            let end = Box3 { least: start.least + least, most: start.most + most };
            let [_, radius] = extremes(simd, &particles.radius()[slots]);
            let (reach, longest) = match *island {
                Some(island) => (&mut reaches[island], &mut longest[0]),
                None => (&mut *loose, &mut longest[1]),
            };
            reach.bounds = reach.bounds.union(start).union(end);
            reach.thickest = reach.thickest.max(radius);
            let way = least.abs().max(most.abs()).length();
            *longest = if way.is_finite() { longest.max(way) } else { *longest };
        }
    }
}

/// The least and the greatest of some values; NaN is left out.
#[inline(always)]
fn extremes<S: pulp::Simd>(simd: S, values: &[f32]) -> [f32; 2] {
    let (vectors, rest) = S::as_simd_f32s(values);
    let (mut least, mut most) = (simd.splat_f32s(f32::INFINITY), simd.splat_f32s(f32::NEG_INFINITY));
    for vector in vectors {
        // The second operand where the first is NaN, on processors that tell them apart.
        (least, most) = (simd.min_f32s(*vector, least), simd.max_f32s(*vector, most));
    }
    let ends = [simd.reduce_min_f32s(least), simd.reduce_max_f32s(most)];
    rest.iter().fold(ends, |[least, most], value| [least.min(*value), most.max(*value)])
}
