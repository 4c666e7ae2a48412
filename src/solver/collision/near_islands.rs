//! Which islands have particles that touch when a tick begins, or may in it: schemes are chosen by that.
//!
//! Most islands are far from all others. So their boxes come first: islands whose boxes overlap are a *crowd*, and particles are
//! looked at only in crowds of stiff and soft islands, and of these only those in what a box has in common with others. A loose
//! particle between two islands, as a ball between two cushions, has them touch, too: else what one pushes it by would drive it
//! into the other. All of it is found anew in each tick, and a function of the state.

use bevy::math::{Vec3, Vec3A};

use super::grid::Grid;
use super::reach::{Measure, Reach, Scene};
use super::shapes::triangle::nearest_parameters;
use super::surface::{Box3, CONTACT_HYSTERESIS, MAX_ELEMENT_SHARE};
use crate::solver::graph::{Forest, IslandSet};

/// The search; its arrays are kept.
#[derive(Debug, Clone, Default)]
pub(in crate::solver) struct NearIslands {
    /// By island.
    reaches: Vec<Reach>,
    /// What two particles may add to their ways in the tick, m.
    margin: f32,
    /// By how much more than they reach boxes are larger on each side, m.
    box_margin: f32,
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
    /// Loose particles and the islands that they touch.
    between: Vec<(usize, usize)>,
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
        let (mut longest, mut loose) = ([0.0; 2], Reach::NOTHING);
        pulp::Arch::new().dispatch(Measure {
            scene,
            reaches: &mut self.reaches,
            loose: &mut loose,
            longest: &mut longest,
        });
        let thickest = self.reaches.iter().map(|reach| reach.thickest).fold(0.0, f32::max);
        self.margin = (MAX_ELEMENT_SHARE * longest[0]).min(2.0 * thickest);
        // A loose particle may touch one at the start of its way, and another one at its end.
        let between = match loose.thickest > 0.0 {
            true => (1.0 + CONTACT_HYSTERESIS) * loose.thickest + 0.5 * (self.margin + longest[1]),
            false => 0.0,
        };
        self.box_margin = 0.5 * self.margin + between;
        self.find_crowds();
    }

    fn find_crowds(&mut self) {
        let Self { reaches, box_margin: margin, order, crowds, .. } = self;
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
        if !self.choose(stiff) {
            return;
        }
        self.find_spheres(scene);
        let Self { margin, touching: sets, near, between, .. } = self;
        let mut join = |one: usize, other: usize| {
            if sets.join(one, other) {
                touching.push([one, other]);
            }
        };
        between.clear();
        let Scene { islands, particles, .. } = scene;
        for slots in near.iter().map(|(one, other)| [*one, *other].map(|slot| slot as usize)) {
            let reach = particles.radius()[slots[0]] + particles.radius()[slots[1]];
            if nearest(slots.map(|slot| scene.flight(slot))) > (1.0 + CONTACT_HYSTERESIS) * reach + *margin {
                continue;
            }
            match slots.map(|slot| islands.of(slot)) {
                [Some(one), Some(other)] => join(one, other),
                [Some(island), None] => between.push((slots[1], island)),
                [None, Some(island)] => between.push((slots[0], island)),
                [None, None] => {}
            }
        }
        between.sort_unstable();
        for pair in between.windows(2).filter(|pair| pair[0].0 == pair[1].0) {
            join(pair[0].1, pair[1].1);
        }
    }

    /// Chooses the islands of which particles are looked at; whether there are any.
    fn choose(&mut self, stiff: &IslandSet) -> bool {
        let Self { reaches, crowds, kinds, is_searched, .. } = self;
        kinds.clear();
        kinds.resize(reaches.len(), [false; 2]);
        for island in 0..reaches.len() {
            kinds[crowds.root(island)][usize::from(stiff.contains_island(island))] = true;
        }
        for (island, reach) in reaches.iter_mut().enumerate() {
            let root = crowds.root(island);
            reach.is_wanted = kinds[root] == [true; 2] && !is_searched[root];
        }
        for (done, kinds) in is_searched.iter_mut().zip(kinds) {
            *done |= *kinds == [true; 2];
        }
        reaches.iter().any(|reach| reach.is_wanted)
    }

    /// Lists pairs of particles of different islands, or of an island and none, that may touch.
    fn find_spheres(&mut self, scene: Scene) {
        let Self { reaches, margin, box_margin, grid, near, .. } = self;
        let Scene { islands, particles, .. } = scene;
        let wanted = reaches.iter().filter(|reach| reach.is_wanted);
        let of_all = wanted.fold(Box3::NOTHING, |all, reach| all.union(reach.shared));
        let runs = islands.runs().iter().filter_map(|(slots, island)| match island {
            Some(island) => reaches[*island].is_wanted.then_some((slots, reaches[*island].shared)),
            None => Some((slots, of_all)),
        });
        let slots = runs.flat_map(|(slots, shared)| slots.clone().map(move |slot| (slot, shared)));
        let spheres = slots.filter_map(|(slot, shared)| {
            let number = slot as usize;
            let ([start, way], reach) =
                (scene.flight(number), (1.0 + CONTACT_HYSTERESIS) * particles.radius()[number]);
            let ends = [start, start + way].map(Vec3A::from);
            let swept = Box3 { least: ends[0].min(ends[1]), most: ends[0].max(ends[1]) };
            let sphere = (slot, start + 0.5 * way, reach + 0.5 * (*margin + way.length()));
            let is_finite = sphere.1.is_finite() && sphere.2.is_finite();
            let is_near = scene.is_sphere(number) && swept.grown(reach + *box_margin).overlaps(&shared);
            (is_finite && is_near).then_some(sphere)
        });
        let may_touch = |one: u32, other: u32| {
            islands.of(one as usize) != islands.of(other as usize) && scene.may_meet(one, other)
        };
        grid.find_pairs(spheres, (may_touch, |_| false), near);
    }
}

/// The least distance of two straight ways, each from a place. Not at the same time: what one touches may stop it before the other
/// comes.
fn nearest(ways: [[Vec3; 2]; 2]) -> f32 {
    let ends = ways.map(|[start, way]| [start, start + way].map(|end| end.as_dvec3()));
    let [one, other] = nearest_parameters(ends[0], ends[1]);
    let [first, second] = ends.map(|[start, end]| move |part: f64| start.lerp(end, part));
    first(one).distance(second(other)) as f32
}

#[cfg(test)]
mod tests {
    use super::super::material::{Layers, Skin};
    use super::*;
    use crate::solver::elements::{Elements, Spring};
    use crate::solver::graph::Islands;
    use crate::solver::particles::Particles;
    use crate::solver::settings::StepSettings;

    /// Islands of two particles each, of a radius of 0.1 m, 0.3 m apart along z.
    fn pairs(places: &[(Vec3, Vec3)]) -> (Particles, Islands) {
        let (mut particles, mut elements) = (Particles::default(), Elements::default());
        for (number, (place, velocity)) in (0..).zip(places) {
            for z in [0.0, 0.3] {
                particles.push(*place + z * Vec3::Z, *velocity, 1.0, 0.1);
            }
            let spring = Spring { rest_length: 0.3, stiffness: 1.0, ..Spring::default() };
            elements.push([2 * number, 2 * number + 1], spring);
        }
        let mut islands = Islands::default();
        islands.refresh(&elements, &particles);
        (particles, islands)
    }

    fn find(scene: Scene, stiff: &[bool]) -> Vec<[usize; 2]> {
        let (mut search, mut set, mut touching) = (NearIslands::default(), IslandSet::default(), Vec::new());
        set.set(scene.islands, stiff.iter().copied(), false);
        search.begin_tick(scene, &touching);
        search.find(scene, &set, &mut touching);
        let known = touching.len();
        search.find(scene, &set, &mut touching);
        assert_eq!(touching.len(), known, "each crowd is searched once");
        touching
    }

    #[test]
    fn a_soft_and_a_stiff_island_touch_that_meet_within_the_tick() {
        let settings = &StepSettings { time_step: 0.1, ..StepSettings::default() };
        for (place, velocity, expected) in [
            (0.29, 0.0, true),
            (0.31, 0.0, false),
            // It flies 1 m, and may fly 0.2 m more, the greatest thickness.
            (1.4, -10.0, true),
            (1.6, -10.0, false),
            (0.6, 10.0, false),
            (0.4, f32::NAN, false),
        ] {
            let (particles, islands) =
                pairs(&[(Vec3::ZERO, Vec3::ZERO), (Vec3::X * place, Vec3::X * velocity)]);
            let scene =
                Scene { islands: &islands, particles: &particles, covered: &[], skins: &[], settings };
            for stiff in [[true, false], [false, true]] {
                assert_eq!(find(scene, &stiff).len(), usize::from(expected), "{place} m, {velocity} m/s");
            }
            assert!(find(scene, &[true; 2]).is_empty() && find(scene, &[false; 2]).is_empty());
            let covered = &[true; 2][..];
            assert!(find(Scene { covered, ..scene }, &[true, false]).is_empty(), "no spheres");
            let skin = Skin { layers: Layers { memberships: 1, filters: 1 }, ..Skin::default() };
            let other = Skin { layers: Layers { memberships: 2, filters: 2 }, ..skin };
            let skins = &[skin, skin, other, other][..];
            assert!(find(Scene { skins, ..scene }, &[true, false]).is_empty(), "layers that do not meet");
        }
    }

    /// Two islands 1 m apart, and a ball of 0.3 m between them.
    #[test]
    fn a_loose_ball_between_two_has_them_touch() {
        let settings = &StepSettings { time_step: 0.1, ..StepSettings::default() };
        for (place, velocity, expected) in [
            (Vec3::X * 0.5, Vec3::ZERO, true),
            (Vec3::new(0.5, 0.8, 0.0), Vec3::ZERO, false),
            (Vec3::new(0.5, 0.8, 0.0), Vec3::Y * -5.0, true),
            (Vec3::X * -0.3, Vec3::ZERO, false),
            // From the one to the other.
            (Vec3::X * -0.3, Vec3::X * 10.0, true),
        ] {
            let (mut particles, mut islands) = pairs(&[(Vec3::ZERO, Vec3::ZERO), (Vec3::X, Vec3::ZERO)]);
            particles.push(place, velocity, 1.0, 0.3);
            let mut elements = Elements::default();
            for ends in [[0, 1], [2, 3]] {
                elements.push(ends, Spring { rest_length: 0.3, stiffness: 1.0, ..Spring::default() });
            }
            islands.refresh(&elements, &particles);
            let scene =
                Scene { islands: &islands, particles: &particles, covered: &[], skins: &[], settings };
            assert_eq!(find(scene, &[true, false]).len(), usize::from(expected), "{place}, {velocity}");
            particles.set_inverse_mass(4, 0.0);
            islands.refresh(&elements, &particles);
            let scene = Scene { islands: &islands, particles: &particles, ..scene };
            assert!(find(scene, &[true, false]).is_empty(), "a pinned one has not");
        }
    }

    /// All that hangs together by touching pairs, some stiff and some soft, is joined, and by nothing but such pairs.
    #[test]
    fn it_finds_what_a_look_at_all_pairs_finds() {
        let mut seed = 7_u32;
        let mut random = || {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (seed >> 8) as f32 / (1 << 24) as f32
        };
        let settings = &StepSettings { time_step: 0.1, gravity: Vec3::NEG_Y, ..StepSettings::default() };
        let (mut joined, mut apart) = (0, 0);
        for size in [1.5, 3.0, 6.0, 6.0, 9.0] {
            let mut vector = |size: f32| Vec3::new(random(), random(), random()) * size;
            let places: Vec<_> = (0..60).map(|_| (vector(size), vector(2.0))).collect();
            let (particles, islands) = pairs(&places);
            let scene =
                Scene { islands: &islands, particles: &particles, covered: &[], skins: &[], settings };
            let stiff: Vec<bool> = (0..60).map(|number| number % 3 == 0).collect();
            let found = find(scene, &stiff);
            let mut search = NearIslands::default();
            search.begin_tick(scene, &[]);
            let touch = |one: usize, other: usize| {
                let slots = |island: usize| [2 * island, 2 * island + 1];
                let pairs = slots(one).into_iter().flat_map(|a| slots(other).map(|b| [a, b]));
                let most = (1.0 + CONTACT_HYSTERESIS) * 0.2 + search.margin;
                pairs.map(|pair| pair.map(|slot| scene.flight(slot))).any(|ways| nearest(ways) <= most)
            };
            let [mut expected, mut actual] = [Forest::new(60), Forest::new(60)];
            for one in 0..60 {
                (one + 1..60)
                    .filter(|other| touch(one, *other))
                    .for_each(|other| _ = expected.join(one, other));
            }
            for [one, other] in found {
                assert!(touch(one, other));
                actual.join(one, other);
            }
            for (one, other) in (0..60).flat_map(|one| (0..one).map(move |other| (one, other))) {
                if expected.root(one) == expected.root(other) && stiff[one] != stiff[other] {
                    assert_eq!(actual.root(one), actual.root(other), "{one} and {other}");
                    joined += 1;
                }
                apart += usize::from(actual.root(one) != actual.root(other));
            }
        }
        assert!(joined > 100 && apart > 100, "{joined} {apart}");
    }

    #[test]
    fn the_least_distance_of_two_ways() {
        let way = |way: Vec3| [[Vec3::new(3.0, 2.0, 0.0), way], [Vec3::ZERO, Vec3::X]];
        assert_eq!(nearest(way(Vec3::X * -6.0)), 2.0, "past");
        assert_eq!(nearest(way(Vec3::NEG_Y * 2.0)), 2.0, "not there yet");
        assert_eq!(nearest([[Vec3::X * 3.0, Vec3::NEG_X], [Vec3::ZERO, Vec3::NEG_X]]), 2.0, "behind it");
        assert_eq!(nearest([[Vec3::X * 3.0, Vec3::ZERO], [Vec3::ZERO, Vec3::ZERO]]), 3.0, "at rest");
    }
}
