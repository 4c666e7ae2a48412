//! A drawn cloth that is torn at random while its app runs.

use std::collections::BTreeMap;

use bevy::prelude::*;
use bevy_mass_spring::nets::{Breaking, Part, PartOf, Side, Topology};
use bevy_mass_spring::prelude::*;

use crate::scene::{app_with, assert_enclosed, mesh, normals, positions, triangles};

const CELLS: u32 = 10;
const TICKS: u32 = 150;

/// A number in 0..1 from a seed: SplitMix64.
fn random(seed: &mut u64) -> f32 {
    *seed = seed.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mut bits = (*seed ^ (*seed >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((bits ^ (bits >> 31)) >> 40) as f32 / (1 << 24) as f32
}

/// An app with physics and drawing, each update of which runs a tick and shows its end.
fn running_app() -> App {
    app_with(|app| {
        app.add_plugins(MassSpringPlugin::default().physics_only());
        app.world_mut().resource_mut::<CollisionSettings>().particles = false;
    })
}

/// How often each edge is one of a triangle, from one end to the other and back.
fn edges(triangles: &[[usize; 3]]) -> BTreeMap<[usize; 2], [usize; 2]> {
    let mut edges: BTreeMap<[usize; 2], [usize; 2]> = BTreeMap::new();
    for [a, b, c] in triangles {
        for [from, to] in [[*a, *b], [*b, *c], [*c, *a]] {
            edges.entry([from.min(to), from.max(to)]).or_default()[usize::from(from > to)] += 1;
        }
    }
    edges
}

/// The particle of the whole cloth of which each is one, or a copy that a tear has split from it: they are in one place at
/// rest.
fn originals(whole: &Topology, now: &Topology) -> Vec<usize> {
    let bits = |place: &Vec3| place.to_array().map(f32::to_bits);
    let first: BTreeMap<[u32; 3], usize> = whole.positions.iter().map(bits).zip(0..).collect();
    now.positions.iter().map(|place| first[&bits(place)]).collect()
}

/// Each triangle of the whole cloth is drawn, at its own particles; inner edges stay closed, but for those with an end at
/// which the net has split.
fn assert_no_hole(app: &App, cloth: Entity, whole: &Topology) {
    let net = app.world().get::<ParticleNet>(cloth).expect("the cloth is laid out");
    let (topology, mesh) = (net.topology(), mesh(app, cloth));
    let (drawn, places) = (triangles(mesh), positions(mesh));
    let originals = originals(whole, topology);
    let mut copies = vec![0; whole.positions.len()];
    originals.iter().for_each(|original| copies[*original] += 1);
    // There is a vertex for each particle, where that is.
    assert_eq!((drawn.len(), places.len()), (whole.triangles.len(), net.len()));
    let mut particle_of = vec![None; places.len()];
    for ((drawn, now), before) in drawn.iter().zip(&topology.triangles).zip(&whole.triangles) {
        for ((vertex, particle), old) in drawn.iter().zip(now).zip(before) {
            assert_eq!(places[*vertex], net.positions()[*particle as usize]);
            assert_eq!(
                *particle_of[*vertex].get_or_insert(*particle),
                *particle,
                "a vertex of two particles"
            );
            assert_eq!(originals[*particle as usize], *old as usize, "a corner of another triangle");
        }
    }
    let before = edges(
        &whole.triangles.iter().map(|corners| corners.map(|corner| corner as usize)).collect::<Vec<_>>(),
    );
    let mut open = 0;
    for (ends, sides) in edges(&drawn) {
        assert!(sides[0] <= 1 && sides[1] <= 1, "two triangles on one side of {ends:?}");
        let particles = ends.map(|end| particle_of[end].expect("a vertex of a triangle"));
        let [one, other] = particles.map(|particle| originals[particle as usize]);
        let was_inner = before[&[one.min(other), one.max(other)]] == [1, 1];
        if was_inner && sides != [1, 1] {
            open += 1;
            assert!(copies[one] > 1 || copies[other] > 1, "{ends:?} is open where nothing split");
        }
    }
    assert_eq!(open % 2, 0, "an inner edge that opens has two sides");
    assert!(normals(mesh).iter().all(|normal| (normal.length() - 1.0).abs() < 1e-5));
    assert_enclosed(app, cloth);
}

fn mass(net: &ParticleNet) -> f64 {
    net.masses().iter().map(|mass| f64::from(*mass)).sum()
}

/// In each third tick another particle is pulled at, with more than the springs around it bear.
#[test]
fn a_cloth_that_is_torn_at_random_while_it_is_drawn_has_no_hole_and_keeps_its_mass() {
    let mut app = running_app();
    let cloth = Cloth::sheet(Rectangle::new(1.0, 1.0)).with_cells(UVec2::splat(CELLS));
    let breaking = Breaking { strain: Some(0.1), ..default() };
    let entity = app.world_mut().spawn((cloth, NetMesh, breaking)).id();
    app.world_mut().spawn((PartOf(entity), Part::Edge(Side::Top), Pinned));
    app.update();
    app.update();
    let net = |app: &App| app.world().get::<ParticleNet>(entity).expect("the cloth is laid out").clone();
    let whole = Topology::clone(net(&app).topology());
    let (start, handle) = (mass(&net(&app)), app.world().get::<Mesh3d>(entity).cloned());
    assert_no_hole(&app, entity, &whole);
    let (mut seed, mut tears) = (11, 0);
    for tick in 0..TICKS {
        let mut pulled = app.world_mut().get_mut::<ParticleNet>(entity).expect("it is still there");
        if tick % 3 == 0 {
            pulled.clear_applied_forces();
            let forces = pulled.applied_forces_mut();
            let particle = (random(&mut seed) * forces.len() as f32) as usize;
            let mut axis = || 2.0 * random(&mut seed) - 1.0;
            forces[particle] = 200.0 * Vec3::new(axis(), axis(), axis());
        }
        let before = pulled.len();
        app.update();
        let broke: Vec<Broke> = app.world_mut().resource_mut::<Messages<Broke>>().drain().collect();
        let now = net(&app);
        assert!(!broke.is_empty() || now.len() == before, "it split where nothing broke");
        tears += usize::from(now.len() > before);
        // A mass is halved exactly, again and again; sums in f64.
        assert!((mass(&now) / start - 1.0).abs() < 1e-6, "{} of {start} kg in tick {tick}", mass(&now));
        assert!(now.positions().iter().all(|place| place.is_finite()));
        assert_no_hole(&app, entity, &whole);
    }
    assert!(tears > 10, "it tore {tears} times");
    assert_eq!(app.world().get::<Mesh3d>(entity).cloned(), handle, "the mesh tears in place");
}
