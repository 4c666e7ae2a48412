//! Tears of surfaces: what they keep, and that they come apart.

use bevy::math::{DVec3, Vec3};
use bevy_mass_spring::nets::{Layout, Rupture, Tear, Topology, pieces, tear};
use bevy_mass_spring::solver::{Bend, Spring};

/// A number in 0..1 from a seed: SplitMix64.
pub fn random(seed: &mut u64) -> f32 {
    *seed = seed.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mut bits = (*seed ^ (*seed >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((bits ^ (bits >> 31)) >> 40) as f32 / (1 << 24) as f32
}

const EDGE: Spring = Spring { breaking_force: Some(1.0), ..Spring::elastic(0.1, 100.0, 0.1) };

/// A sheet of `n` × `n` cells of 0.1 m in the plane z = 0: a spring along each edge and each other diagonal, rods along the
/// grid and a twist in each cell.
fn sheet(n: u32) -> Topology {
    let of = |i: u32, j: u32| j * (n + 1) + i;
    let mut sheet = Topology { layout: Layout::Grid { cells: [n, n] }, ..Topology::default() };
    let straight = Bend { stiffness: 1.0, weights: [1.0, -2.0, 1.0], ..Bend::default() };
    let twist = Bend { stiffness: 1.0, weights: [1.0, -1.0, -1.0, 1.0], ..Bend::default() };
    let diagonal = Spring { rest_length: 0.1 * std::f32::consts::SQRT_2, ..EDGE };
    for j in 0..=n {
        for i in 0..=n {
            sheet.positions.push(Vec3::new(i as f32 * 0.1, j as f32 * 0.1, 0.0));
            sheet.masses.push(0.01);
            if i < n {
                sheet.springs.push(([of(i, j), of(i + 1, j)], EDGE));
            }
            if j < n {
                sheet.springs.push(([of(i, j), of(i, j + 1)], EDGE));
            }
            if i + 1 < n {
                sheet.rods.push(([of(i, j), of(i + 1, j), of(i + 2, j)], straight));
            }
            if j + 1 < n {
                sheet.rods.push(([of(i, j), of(i, j + 1), of(i, j + 2)], straight));
            }
            if i < n && j < n {
                let [a, b, c, d] = [of(i, j), of(i + 1, j), of(i, j + 1), of(i + 1, j + 1)];
                sheet.springs.extend([([a, d], diagonal), ([b, c], diagonal)]);
                sheet.hinges.push(([a, b, c, d], twist));
                sheet.triangles.extend([[a, b, d], [a, d, c]]);
            }
        }
    }
    sheet
}

/// An octahedron whose faces are divided `times` into four each, of radius 1 m: a closed mesh with a spring along each edge and
/// a hinge about it.
fn ball(times: u32) -> Topology {
    let mut ball = Topology {
        positions: [Vec3::X, Vec3::Y, Vec3::Z, -Vec3::X, -Vec3::Y, -Vec3::Z].into(),
        ..Topology::default()
    };
    ball.triangles =
        vec![[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2], [1, 0, 5], [3, 1, 5], [4, 3, 5], [0, 4, 5]];
    for _ in 0..times {
        let mut middles = std::collections::BTreeMap::new();
        let positions = &mut ball.positions;
        let mut middle = |one: u32, other: u32| {
            *middles.entry([one.min(other), one.max(other)]).or_insert_with(|| {
                positions.push(positions[one as usize].midpoint(positions[other as usize]).normalize());
                positions.len() as u32 - 1
            })
        };
        ball.triangles = ball
            .triangles
            .iter()
            .flat_map(|&[a, b, c]| {
                let [ab, bc, ca] = [middle(a, b), middle(b, c), middle(c, a)];
                [[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]
            })
            .collect();
    }
    ball.masses = vec![0.02; ball.positions.len()];
    let hinge = Bend { stiffness: 1.0, weights: [1.0, 1.0, -1.0, -1.0], ..Bend::default() };
    let mut sides = std::collections::BTreeMap::new();
    for corners in &ball.triangles {
        for place in 0..3 {
            let [one, other, apex] = [0, 1, 2].map(|step| corners[(place + step) % 3]);
            sides.entry([one.min(other), one.max(other)]).or_insert_with(Vec::new).push(apex);
        }
    }
    for (ends, apices) in sides {
        let rest_length = ball.positions[ends[0] as usize].distance(ball.positions[ends[1] as usize]);
        ball.springs.push((ends, Spring { rest_length, ..EDGE }));
        ball.hinges.push(([ends[0], ends[1], apices[0], apices[1]], hinge));
    }
    ball
}

/// ½ k (‖Σ c x‖ − r)² of all elements, J.
pub fn elastic_energy(net: &Topology, positions: &[Vec3]) -> f64 {
    let place = |end: u32| positions[end as usize].as_dvec3();
    let springs = net.springs.iter().map(|([one, other], spring)| {
        let elongation = place(*one).distance(place(*other)) - f64::from(spring.rest_length);
        0.5 * f64::from(spring.stiffness) * elongation * elongation
    });
    fn bend<const N: usize>(ends: &[u32; N], bend: &Bend<N>, place: &impl Fn(u32) -> DVec3) -> f64 {
        let weighted = ends.iter().zip(bend.weights).map(|(end, weight)| place(*end) * f64::from(weight));
        let beyond = weighted.sum::<DVec3>().length() - f64::from(bend.rest_length);
        0.5 * f64::from(bend.stiffness) * beyond * beyond
    }
    let rods = net.rods.iter().map(|(ends, rod)| bend(ends, rod, &place));
    let hinges = net.hinges.iter().map(|(ends, hinge)| bend(ends, hinge, &place));
    springs.sum::<f64>() + rods.sum::<f64>() + hinges.sum::<f64>()
}

fn momentum(net: &Topology, velocities: &[Vec3]) -> DVec3 {
    net.masses.iter().zip(velocities).map(|(mass, velocity)| velocity.as_dvec3() * f64::from(*mass)).sum()
}

/// No hole: each triangle has the corners that it had, or copies of them, and its corners differ. Particles keep their
/// numbers and places. No particle joins triangles that have no edge in common.
pub fn check_surface(first: &Topology, net: &Topology) {
    assert_eq!(net.triangles.len(), first.triangles.len());
    assert_eq!(net.positions[..first.positions.len()], first.positions);
    for (now, before) in net.triangles.iter().zip(&first.triangles) {
        for (corner, old) in now.iter().zip(before) {
            assert_eq!(net.positions[*corner as usize], first.positions[*old as usize]);
        }
        assert!(now[0] != now[1] && now[1] != now[2] && now[2] != now[0], "{now:?}");
    }
    let mut at = vec![Vec::new(); net.positions.len()];
    net.triangles
        .iter()
        .for_each(|corners| corners.iter().for_each(|corner| at[*corner as usize].push(corners)));
    for (particle, triangles) in (0..).zip(&at) {
        let mut reached = vec![false; triangles.len()];
        let mut pending = vec![0];
        while let Some(from) = pending.pop() {
            if !std::mem::replace(&mut reached[from], true) {
                let touches = |other: &&[u32; 3]| {
                    other.iter().any(|corner| *corner != particle && triangles[from].contains(corner))
                };
                pending.extend((0..triangles.len()).filter(|other| touches(&triangles[*other])));
            }
        }
        assert!(!triangles.is_empty() && reached.iter().all(|reached| *reached), "particle {particle}");
    }
}

/// The bar: 10,000 random cuts of springs that are there, of which each keeps mass and momentum, adds no energy and leaves every
/// triangle. In one round they come one by one, in the next one several at once.
#[test]
fn random_tears_lose_nothing() {
    let mut seed = 7;
    let mut cuts = 0;
    for round in 0_u32.. {
        if cuts >= 10_000 {
            break;
        }
        for first in [sheet(6), ball(2)] {
            let mut net = first.clone();
            let mut positions: Vec<Vec3> = net
                .positions
                .iter()
                .map(|place| *place * 1.2 + Vec3::Z * (0.05 * random(&mut seed)))
                .collect();
            let mut velocities: Vec<Vec3> =
                positions.iter().map(|place| Vec3::new(place.z, place.x, place.y) * 3.0).collect();
            let mass: f64 = net.masses.iter().map(|mass| f64::from(*mass)).sum();
            for _ in 0..40 {
                let count = if round % 2 == 0 { 1 } else { 1 + (random(&mut seed) * 4.0) as usize };
                // What is emptied, or is all that is left of a triangle, does not break.
                let mut whole: Vec<u32> = (0..net.springs.len() as u32)
                    .filter(|spring| {
                        let (_, spring) = &net.springs[*spring as usize];
                        spring.stiffness > 0.0 && spring.breaking_force.is_some()
                    })
                    .collect();
                let count = count.min(whole.len());
                let broken: Vec<Rupture> = (0..count)
                    .map(|_| {
                        let spring = whole.swap_remove((random(&mut seed) * whole.len() as f32) as usize);
                        let (ends, parameters) = net.springs[spring as usize];
                        let length = positions[ends[0] as usize].distance(positions[ends[1] as usize]);
                        Rupture { spring, elongation: (length - parameters.rest_length).max(0.0) }
                    })
                    .collect();
                let (energy, start) = (elastic_energy(&net, &positions), momentum(&net, &velocities));
                let Tear { held, .. } = tear(&mut net, &mut positions, &mut velocities, &broken);
                cuts += count - held.len();
                let left: f64 = net.masses.iter().map(|mass| f64::from(*mass)).sum();
                assert!((left - mass).abs() < 1e-6 * mass, "{left} kg of {mass}");
                assert!(net.masses.iter().all(|mass| *mass > 0.0));
                assert!((momentum(&net, &velocities) - start).length() < 1e-6 * mass);
                assert!(elastic_energy(&net, &positions) <= energy * (1.0 + 1e-6), "{energy} J");
                assert_eq!((positions.len(), velocities.len()), (net.positions.len(), net.positions.len()));
            }
            check_surface(&first, &net);
        }
    }
}

/// A row of broken springs across a sheet takes it apart in two, each of which holds together; the border that it hangs by keeps
/// its numbers.
#[test]
fn a_sheet_torn_across_is_two() {
    let mut net = sheet(8);
    assert_eq!(pieces(&net).iter().max(), Some(&0));
    let (mut positions, mut velocities) = (net.positions.clone(), vec![Vec3::ZERO; net.positions.len()]);
    // The springs from row 3 to row 4.
    let crosses =
        |ends: &[u32; 2]| ends.iter().any(|end| end / 9 == 3) && ends.iter().any(|end| end / 9 == 4);
    let numbers = 0..net.springs.len();
    let vertical = |number: &usize| {
        crosses(&net.springs[*number].0) && net.springs[*number].0[1] - net.springs[*number].0[0] == 9
    };
    let broken: Vec<Rupture> =
        numbers.filter(vertical).map(|number| Rupture { spring: number as u32, elongation: 0.0 }).collect();
    assert_eq!(broken.len(), 9);
    let tear = tear(&mut net, &mut positions, &mut velocities, &broken);
    assert_eq!(tear.splits.len(), 9, "one in each column");
    let pieces = pieces(&net);
    assert_eq!(pieces.iter().max(), Some(&1), "two pieces");
    assert_eq!((pieces[0], pieces[80]), (0, 1));
    check_surface(&sheet(8), &net);
}

/// A rope has no surface: the spring goes, and the bends over it.
#[test]
fn a_broken_rope_is_two_ropes() {
    let mut rope = Topology {
        positions: (0..6).map(|i| Vec3::X * i as f32).collect(),
        masses: vec![1.0; 6],
        ..Topology::default()
    };
    rope.springs = (0..5).map(|i| ([i, i + 1], EDGE)).collect();
    let straight = Bend { stiffness: 1.0, weights: [1.0, -2.0, 1.0], ..Bend::default() };
    rope.rods = (0..4).map(|i| ([i, i + 1, i + 2], straight)).collect();
    let (mut positions, mut velocities) = (rope.positions.clone(), vec![Vec3::ZERO; 6]);
    let tear = tear(&mut rope, &mut positions, &mut velocities, &[Rupture { spring: 2, elongation: 0.01 }]);
    assert!(tear.splits.is_empty());
    assert_eq!(pieces(&rope), [0, 0, 0, 1, 1, 1]);
    assert_eq!(rope.rods.iter().map(|(_, rod)| rod.stiffness).collect::<Vec<_>>(), [1.0, 0.0, 0.0, 1.0]);
    assert_eq!(rope.springs.iter().filter(|(_, spring)| spring.stiffness == 0.0).count(), 1);
}
