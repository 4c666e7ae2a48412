//! Which islands have particles that touch when a tick begins, or may in it: schemes are chosen by that.
//!
//! Most islands are far from all others. So their boxes come first: islands whose boxes overlap are a *crowd*, and particles are
//! looked at only in crowds of stiff and soft islands, and of these only those in what a box has in common with others. All of
//! it is found anew in each tick, and a function of the state.

use bevy::math::{Vec3, Vec3A};

use super::grid::Grid;
use super::material::{Skin, skin_of};
use super::surface::{Box3, KEPT_PART, UNKNOWN_PART};
use crate::solver::graph::{Exclusions, Forest, IslandSet, Islands};
use crate::solver::particles::Particles;
use crate::solver::settings::StepSettings;

/// What the search reads.
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
    fn is_sphere(&self, slot: usize) -> bool {
        self.particles.radius()[slot] > 0.0 && self.covered.get(slot) != Some(&true)
    }

    /// Where a particle is, and how far it goes in free flight in the tick, m.
    fn flight(&self, slot: usize) -> [Vec3; 2] {
        let StepSettings { time_step, gravity, .. } = *self.settings;
        let velocity = self.particles.velocity.get(slot) + time_step * gravity;
        [self.particles.position.get(slot), time_step * velocity]
    }

    fn may_meet(&self, one: u32, other: u32) -> bool {
        let layers = |slot: u32| skin_of(self.skins, slot as usize).layers;
        (self.skins.is_empty() || layers(one).meet(layers(other)))
            && !Exclusions::are_of_one_family(self.particles.families(), one, other)
    }
}

/// What an island may reach in the tick.
#[derive(Debug, Clone, Copy)]
struct Reach {
    /// That of the centres, m.
    bounds: Box3,
    /// m.
    thickest: f32,
    /// What its box has in common with those of others, margins included, m.
    shared: Box3,
}

impl Reach {
    const NOTHING: Self = Self { bounds: Box3::NOTHING, thickest: 0.0, shared: Box3::NOTHING };

    fn grown(&self, margin: f32) -> Box3 {
        self.bounds.grown((1.0 + KEPT_PART) * self.thickest + 0.5 * margin)
    }
}

/// The search; its arrays are kept.
#[derive(Debug, Clone, Default)]
pub(in crate::solver) struct NearIslands {
    /// By island.
    reaches: Vec<Reach>,
    /// What a particle may add to its way in the tick, m.
    margin: f32,
    /// The islands of spheres, sorted along an axis.
    order: Vec<(f32, u32)>,
    crowds: Forest,
    /// By the root of a crowd: whether it has soft and stiff islands.
    kinds: Vec<[bool; 2]>,
    is_searched: Vec<bool>,
    /// The islands that touch, through others, too.
    touching: Forest,
    grid: Grid,
    near: Vec<(u32, u32)>,
}

impl NearIslands {
    /// To be called when a tick begins. Islands that are `touching` already are of one crowd.
    pub fn begin_tick(&mut self, scene: Scene, touching: &[[usize; 2]]) {
        let count = scene.islands.all().len();
        self.reaches.clear();
        self.reaches.resize(count, Reach::NOTHING);
        self.is_searched.clear();
        self.is_searched.resize(count, false);
        for forest in [&mut self.crowds, &mut self.touching] {
            forest.reset(count);
            touching.iter().for_each(|[one, other]| _ = forest.join(*one, *other));
        }
        let mut longest = 0.0;
        pulp::Arch::new().dispatch(Measure { scene, reaches: &mut self.reaches, longest: &mut longest });
        let thickest = self.reaches.iter().map(|reach| reach.thickest).fold(0.0, f32::max);
        self.margin = (UNKNOWN_PART * longest).min(2.0 * thickest);
        self.find_crowds();
    }

    fn find_crowds(&mut self) {
        let Self { reaches, margin, order, crowds, .. } = self;
        let all = reaches.iter().fold(Box3::NOTHING, |all, reach| all.union(reach.bounds));
        let axis = (all.most - all.least).max_position();
        order.clear();
        let present = (0..).zip(&*reaches).filter(|(_, reach)| reach.thickest > 0.0);
        order.extend(present.map(|(island, reach)| (reach.grown(*margin).least[axis], island)));
        order.sort_unstable_by(|(one, a), (other, b)| one.total_cmp(other).then(a.cmp(b)));
        for (place, (_, one)) in order.iter().enumerate() {
            let one = *one as usize;
            let own = reaches[one].grown(*margin);
            for (_, other) in order[place + 1..].iter().take_while(|(least, _)| *least <= own.most[axis]) {
                let other = *other as usize;
                let common = own.intersection(reaches[other].grown(*margin));
                if common.least.cmple(common.most).all() {
                    crowds.join(one, other);
                    for island in [one, other] {
                        reaches[island].shared = reaches[island].shared.union(common);
                    }
                }
            }
        }
    }

    /// Appends to `touching` pairs of islands that join all that touch in crowds in which some are `stiff` and some are not; in
    /// crowds that have been looked at none.
    pub fn find(&mut self, scene: Scene, stiff: &IslandSet, touching: &mut Vec<[usize; 2]>) {
        let Self { reaches, margin, crowds, kinds, is_searched, touching: sets, grid, near, .. } = self;
        kinds.clear();
        kinds.resize(reaches.len(), [false; 2]);
        (0..reaches.len())
            .for_each(|island| kinds[crowds.root(island)][usize::from(stiff.contains_island(island))] = true);
        let is_mixed = |root: usize| kinds[root] == [true; 2] && !is_searched[root];
        if !(0..reaches.len()).any(is_mixed) {
            return;
        }
        let Scene { islands, particles, .. } = scene;
        let runs = islands.runs().iter().filter(|(_, island)| is_mixed(crowds.root(*island)));
        let slots = runs.flat_map(|(slots, island)| slots.clone().map(|slot| (slot as usize, *island)));
        let spheres = slots.filter(|(slot, _)| scene.is_sphere(*slot)).filter_map(|(slot, island)| {
            let [start, way] = scene.flight(slot);
            let reach = (1.0 + KEPT_PART) * particles.radius()[slot] + 0.5 * *margin;
            let ends = [start, start + way].map(Vec3A::from);
            let swept = Box3 { least: ends[0].min(ends[1]), most: ends[0].max(ends[1]) }.grown(reach);
            let sphere = (slot as u32, start + 0.5 * way, reach + 0.5 * way.length());
            let is_finite = sphere.1.is_finite() && sphere.2.is_finite();
            (is_finite && swept.overlaps(&reaches[island].shared)).then_some(sphere)
        });
        let may_touch = |one: u32, other: u32| {
            islands.of(one as usize) != islands.of(other as usize) && scene.may_meet(one, other)
        };
        grid.find_pairs(spheres, (may_touch, |_| false), near);
        for slots in near.iter().map(|(one, other)| [*one, *other].map(|slot| slot as usize)) {
            let [Some(one), Some(other)] = slots.map(|slot| islands.of(slot)) else { continue };
            if sets.root(one) == sets.root(other) {
                continue;
            }
            let [[start, way], [other_start, other_way]] = slots.map(|slot| scene.flight(slot));
            let reach = particles.radius()[slots[0]] + particles.radius()[slots[1]];
            let most = (1.0 + KEPT_PART) * reach + *margin;
            if nearest(start - other_start, way - other_way) <= most {
                sets.join(one, other);
                touching.push([one, other]);
            }
        }
        let searched = kinds.iter().map(|kinds| *kinds == [true; 2]);
        is_searched.iter_mut().zip(searched).for_each(|(done, searched)| *done |= searched);
    }
}

/// The least length of a separation on its straight way from `start`.
fn nearest(start: Vec3, way: Vec3) -> f32 {
    let square = way.length_squared();
    let time = if square > 0.0 { (-start.dot(way) / square).clamp(0.0, 1.0) } else { 0.0 };
    (start + time * way).length()
}

/// Finds what the islands with spheres may reach, and the longest way of a particle of theirs, at most, m.
struct Measure<'a> {
    scene: Scene<'a>,
    reaches: &'a mut [Reach],
    longest: &'a mut f32,
}

impl pulp::WithSimd for Measure<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, simd: S) {
        let Self { scene, reaches, longest } = self;
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
            let reach = &mut reaches[*island];
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
