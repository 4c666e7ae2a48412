//! What islands may reach in a tick, as boxes.

use std::ops::Range;

use bevy::math::{Vec3, Vec3A};

use super::material::{ContactProperties, properties_of};
use super::surface::Box3;
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
    pub properties: &'a [ContactProperties],
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
        let layers = |slot: u32| properties_of(self.properties, slot as usize).layers;
        (self.properties.is_empty() || layers(one).meet(layers(other)))
            && !Exclusions::are_of_one_family(self.particles.families(), one, other)
    }
}

/// The fastest and the thickest of some particles.
#[derive(Debug, Clone, Copy)]
pub(super) struct Motion {
    /// That of their velocities, m/s.
    velocity: Box3,
    /// m; 0 without particles.
    pub thickest: f32,
}

impl Default for Motion {
    fn default() -> Self {
        Self { velocity: Box3::NOTHING, thickest: 0.0 }
    }
}

impl Motion {
    /// How far any of them goes in free flight in the tick, at most, m.
    pub fn longest(&self, settings: &StepSettings) -> f32 {
        if self.thickest == 0.0 {
            return 0.0;
        }
        let falls = Vec3A::from(settings.time_step * settings.gravity);
        let fastest = (self.velocity.least + falls).abs().max((self.velocity.most + falls).abs()).length();
        if fastest.is_finite() { settings.time_step * fastest } else { 0.0 }
    }
}

/// Finds where the spheres of islands are, and how they and loose spheres move.
pub(super) struct Measure<'a> {
    pub scene: Scene<'a>,
    /// By island.
    pub boxes: &'a mut [Box3],
    pub islands: &'a mut Motion,
    pub loose: &'a mut Motion,
}

impl pulp::WithSimd for Measure<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, simd: S) {
        let Self { scene, boxes, islands, loose } = self;
        let particles = scene.particles;
        for (slots, island) in scene.islands.runs() {
            let slots = slots.start as usize..slots.end as usize;
            if !slots.clone().any(|slot| scene.is_sphere(slot)) {
                continue;
            }
            let motion = match *island {
                Some(island) => {
                    boxes[island] = boxes[island].union(box_of(simd, particles.position.axes(), &slots));
                    &mut *islands
                }
                None => &mut *loose,
            };
            motion.velocity = motion.velocity.union(box_of(simd, particles.velocity.axes(), &slots));
            let [_, thickest] = extremes(simd, &particles.radius()[slots]);
            motion.thickest = motion.thickest.max(thickest);
        }
    }
}

/// The box around some points. In no closure: that would not be compiled for vectors.
#[inline(always)]
fn box_of<S: pulp::Simd>(simd: S, [x, y, z]: [&[f32]; 3], slots: &Range<usize>) -> Box3 {
    let x = extremes(simd, &x[slots.clone()]);
    let y = extremes(simd, &y[slots.clone()]);
    let z = extremes(simd, &z[slots.clone()]);
    Box3 { least: Vec3A::new(x[0], y[0], z[0]), most: Vec3A::new(x[1], y[1], z[1]) }
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
    let (mut least, mut most) = (simd.reduce_min_f32s(least), simd.reduce_max_f32s(most));
    for value in rest {
        (least, most) = (least.min(*value), most.max(*value));
    }
    [least, most]
}
