//! Which soft and stiff islands have particles that touch when a tick begins, or may in it: schemes are chosen by that.
//!
//! Most islands are far from all others. So their boxes come first, and particles are looked at only in what the box of a soft one has
//! in common with those of stiff ones. A loose particle between two islands, as a ball between two cushions, has them touch, too:
//! else what one pushes it by would drive it into the other. All of it is found anew in each tick, and a function of the state.

use bevy::math::{Vec3, Vec3A};

use super::grid::Grid;
use super::reach::{Measure, Motion, Scene};
use super::shapes::triangle::nearest_parameters;
use super::surface::{Box3, CONTACT_HYSTERESIS, MAX_ELEMENT_SHARE};
use crate::solver::graph::IslandSet;

/// The search; its arrays are kept.
#[derive(Debug, Clone, Default)]
pub(in crate::solver) struct NearIslands {
    /// By island: where the centres of its spheres are, m; nothing without spheres.
    boxes: Vec<Box3>,
    /// By island: what its box has in common with those of the other kind, all that they reach included, m.
    shared: Vec<Box3>,
    /// What two particles may add to their displacements in the tick, m.
    margin: f32,
    /// What may be between two particles that have a loose one between them touch, from each of them, m.
    between: f32,
    /// How far from its box an island reaches, m.
    reach: f32,
    /// The islands with spheres, sorted along an axis.
    order: Vec<(f32, u32)>,
    grid: Grid,
    near: Vec<(u32, u32)>,
    /// Loose particles and the islands that they touch.
    held: Vec<(usize, usize)>,
}

impl NearIslands {
    /// To be called when a tick begins.
    pub fn begin_tick(&mut self, scene: Scene) {
        self.boxes.clear();
        self.boxes.resize(scene.islands.all().len(), Box3::NOTHING);
        let (mut islands, mut loose) = (Motion::default(), Motion::default());
        pulp::Arch::new().dispatch(Measure {
            scene,
            boxes: &mut self.boxes,
            islands: &mut islands,
            loose: &mut loose,
        });
        let [longest, longest_loose] = [islands, loose].map(|motion| motion.longest(scene.settings));
        self.margin = (MAX_ELEMENT_SHARE * longest).min(2.0 * islands.thickest);
        // A loose particle may touch one at the start of its way, and another one at its end.
        self.between = match loose.thickest > 0.0 {
            true => (1.0 + CONTACT_HYSTERESIS) * loose.thickest + 0.5 * (self.margin + longest_loose),
            false => 0.0,
        };
        self.reach =
            (1.0 + CONTACT_HYSTERESIS) * islands.thickest + 0.5 * self.margin + self.between + longest;
    }

    /// Appends to `touching` the pairs of a `stiff` island and another one that touch.
    pub fn find(&mut self, scene: Scene, stiff: &IslandSet, touching: &mut Vec<[usize; 2]>) {
        if !self.find_shared(stiff) {
            return;
        }
        self.find_spheres(scene, stiff);
        let Self { margin, near, held, .. } = self;
        let Scene { islands, particles, .. } = scene;
        let known = touching.len();
        held.clear();
        for slots in near.iter().map(|(one, other)| [*one, *other].map(|slot| slot as usize)) {
            let reach = particles.radius()[slots[0]] + particles.radius()[slots[1]];
            if nearest(slots.map(|slot| scene.flight(slot))) > (1.0 + CONTACT_HYSTERESIS) * reach + *margin {
                continue;
            }
            match slots.map(|slot| islands.of(slot)) {
                [Some(one), Some(other)] => touching.push([one.min(other), one.max(other)]),
                [Some(island), None] => held.push((slots[1], island)),
                [None, Some(island)] => held.push((slots[0], island)),
                [None, None] => {}
            }
        }
        held.sort_unstable();
        let of_one = held.windows(2).filter(|pair| pair[0].0 == pair[1].0);
        let islands = of_one.map(|pair| [pair[0].1, pair[1].1]);
        touching.extend(
            islands.filter(|[one, other]| stiff.contains_island(*one) != stiff.contains_island(*other)),
        );
        touching[known..].sort_unstable();
        touching.dedup();
    }

    /// Finds what boxes of soft and of stiff islands have in common; whether they have.
    fn find_shared(&mut self, stiff: &IslandSet) -> bool {
        let Self { boxes, shared, reach, order, .. } = self;
        let mut kinds = [Box3::NOTHING; 2];
        for (island, own) in boxes.iter().enumerate() {
            let kind = &mut kinds[usize::from(stiff.contains_island(island))];
            *kind = kind.union(*own);
        }
        let common = kinds[0].grown(*reach).intersection(kinds[1].grown(*reach));
        if !common.is_some() {
            return false;
        }
        shared.clear();
        shared.resize(boxes.len(), Box3::NOTHING);
        let axis = (common.most - common.least).max_position();
        order.clear();
        let near = (0..).zip(&*boxes).filter(|(_, own)| own.grown(*reach).overlaps(&common));
        order.extend(near.map(|(island, own)| (own.least[axis], island)));
        order.sort_unstable_by(|(one, a), (other, b)| one.total_cmp(other).then(a.cmp(b)));
        let mut any = false;
        for (place, (_, one)) in order.iter().enumerate() {
            let one = *one as usize;
            let (own, is_stiff) = (boxes[one].grown(*reach), stiff.contains_island(one));
            let most = own.most[axis] + *reach;
            for (_, other) in order[place + 1..].iter().take_while(|(least, _)| *least <= most) {
                let other = *other as usize;
                if stiff.contains_island(other) == is_stiff {
                    continue;
                }
                let common = own.intersection(boxes[other].grown(*reach));
                if common.is_some() {
                    any = true;
                    [one, other].iter().for_each(|island| shared[*island] = shared[*island].union(common));
                }
            }
        }
        any
    }

    /// Lists pairs of particles of a soft and a stiff island, or of an island and none, that may touch.
    fn find_spheres(&mut self, scene: Scene, stiff: &IslandSet) {
        let Self { shared, margin, between, grid, near, .. } = self;
        let Scene { islands, particles, .. } = scene;
        let of_all = shared.iter().fold(Box3::NOTHING, |all, shared| all.union(*shared));
        let shared_of = |island: Option<usize>| island.map_or(of_all, |island| shared[island]);
        let runs = islands.runs().iter().map(|(slots, island)| (slots, shared_of(*island)));
        let runs = runs.filter(|(_, shared)| shared.is_some());
        let slots = runs.flat_map(|(slots, shared)| slots.clone().map(move |slot| (slot, shared)));
        let spheres = slots.filter_map(|(slot, shared)| {
            let number = slot as usize;
            let [start, displacement] = scene.flight(number);
            let reach = (1.0 + CONTACT_HYSTERESIS) * particles.radius()[number] + 0.5 * *margin;
            let ends = [start, start + displacement].map(Vec3A::from);
            let swept = Box3 { least: ends[0].min(ends[1]), most: ends[0].max(ends[1]) };
            let sphere = (slot, start + 0.5 * displacement, reach + 0.5 * displacement.length());
            let is_finite = sphere.1.is_finite() && sphere.2.is_finite();
            let is_near = scene.is_sphere(number) && swept.grown(reach + *between).overlaps(&shared);
            (is_finite && is_near).then_some(sphere)
        });
        let kind_of = |slot: u32| islands.of(slot as usize).map(|island| stiff.contains_island(island));
        let may_touch = |one: u32, other: u32| kind_of(one) != kind_of(other) && scene.may_meet(one, other);
        grid.find_pairs(spheres, (may_touch, |_, _| false), near);
    }
}

/// The least distance of two straight paths, each from a place. Not at the same time: what one touches may stop it before the other
/// comes.
fn nearest(flights: [[Vec3; 2]; 2]) -> f32 {
    let ends = flights.map(|[start, displacement]| [start, start + displacement].map(|end| end.as_dvec3()));
    let [one, other] = nearest_parameters(ends[0], ends[1]);
    let [first, second] = ends.map(|[start, end]| move |part: f64| start.lerp(end, part));
    first(one).distance(second(other)) as f32
}

#[cfg(test)]
mod tests {
    use super::super::material::{ContactProperties, Layers};
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
        search.begin_tick(scene);
        search.find(scene, &set, &mut touching);
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
                Scene { islands: &islands, particles: &particles, covered: &[], properties: &[], settings };
            for stiff in [[true, false], [false, true]] {
                assert_eq!(find(scene, &stiff).len(), usize::from(expected), "{place} m, {velocity} m/s");
            }
            assert!(find(scene, &[true; 2]).is_empty() && find(scene, &[false; 2]).is_empty());
            let covered = &[true; 2][..];
            assert!(find(Scene { covered, ..scene }, &[true, false]).is_empty(), "no spheres");
            let own = ContactProperties { layers: Layers::new(1, 1), ..ContactProperties::default() };
            let other = ContactProperties { layers: Layers::new(2, 2), ..own };
            let properties = &[own, own, other, other][..];
            assert!(
                find(Scene { properties, ..scene }, &[true, false]).is_empty(),
                "layers that do not meet"
            );
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
                Scene { islands: &islands, particles: &particles, covered: &[], properties: &[], settings };
            assert_eq!(find(scene, &[true, false]).len(), usize::from(expected), "{place}, {velocity}");
            particles.set_inverse_mass(4, 0.0);
            islands.refresh(&elements, &particles);
            let scene =
                Scene { islands: &islands, particles: &particles, covered: &[], properties: &[], settings };
            assert!(find(scene, &[true, false]).is_empty(), "a pinned one has not");
        }
    }

    #[test]
    fn it_finds_what_a_look_at_all_pairs_finds() {
        let mut seed = 7_u32;
        let mut random = || {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (seed >> 8) as f32 / (1 << 24) as f32
        };
        let settings = &StepSettings { time_step: 0.1, gravity: Vec3::NEG_Y, ..StepSettings::default() };
        let mut counts = Vec::new();
        for size in [1.5, 3.0, 6.0, 9.0, 20.0] {
            let mut vector = |size: f32| Vec3::new(random(), random(), random()) * size;
            let places: Vec<_> = (0..60).map(|_| (vector(size), vector(2.0))).collect();
            let (particles, islands) = pairs(&places);
            let scene =
                Scene { islands: &islands, particles: &particles, covered: &[], properties: &[], settings };
            let stiff: Vec<bool> = (0..60).map(|number| number % 3 == 0).collect();
            let mut search = NearIslands::default();
            search.begin_tick(scene);
            let touch = |one: usize, other: usize| {
                let slots = |island: usize| [2 * island, 2 * island + 1];
                let pairs = slots(one).into_iter().flat_map(|a| slots(other).map(|b| [a, b]));
                let most = (1.0 + CONTACT_HYSTERESIS) * 0.2 + search.margin;
                pairs.map(|pair| pair.map(|slot| scene.flight(slot))).any(|flights| nearest(flights) <= most)
            };
            let all = (0..60).flat_map(|one| (one + 1..60).map(move |other| [one, other]));
            let expected: Vec<_> =
                all.filter(|[one, other]| stiff[*one] != stiff[*other] && touch(*one, *other)).collect();
            assert_eq!(find(scene, &stiff), expected, "in {size} m");
            counts.push(expected.len());
        }
        assert!(counts[0] > 100 && counts[3] < 50, "{counts:?}");
    }

    #[test]
    fn the_least_distance_of_two_paths() {
        let flights = |displacement: Vec3| [[Vec3::new(3.0, 2.0, 0.0), displacement], [Vec3::ZERO, Vec3::X]];
        assert_eq!(nearest(flights(Vec3::X * -6.0)), 2.0, "past");
        assert_eq!(nearest(flights(Vec3::NEG_Y * 2.0)), 2.0, "not there yet");
        assert_eq!(nearest([[Vec3::X * 3.0, Vec3::NEG_X], [Vec3::ZERO, Vec3::NEG_X]]), 2.0, "behind it");
        assert_eq!(nearest([[Vec3::X * 3.0, Vec3::ZERO], [Vec3::ZERO, Vec3::ZERO]]), 3.0, "at rest");
    }
}
