//! Tears: where springs of a surface broke, its particles are split so that it opens.
//!
//! A broken spring says where the material failed, and across which direction. As in O'Brien and Hodgins, *Graphical
//! modeling and animation of brittle fracture* (1999), an end of it is split by the plane through it that the spring is
//! normal to: the triangles on the two sides no longer share it. The edges of the mesh are where the surface opens, so
//! that no triangle is lost or divided: what remains of the spring joins the two particles on its side of the tear.
//! Then every particle nearby with triangles that are no longer joined edge to edge is split, too.

mod elements;
mod surface;

use bevy::math::Vec3;

use crate::nets::Topology;
use elements::{Copies, disable, emptied, reattach_bends, reattach_springs};
use surface::{Fan, Surface, places};

/// The part of the elongation at the break that what remains of a broken spring keeps at most, so that it adds no energy
/// and does not break again at once.
const KEPT_ELONGATION: f32 = 0.9;

/// A spring of a net that broke.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rupture {
    /// Its number in the topology.
    pub spring: u32,
    /// How much longer it was than without force when it broke, m.
    pub elongation: f32,
}

/// What a tear has done.
#[derive(Debug, Clone, Default, PartialEq)]
#[non_exhaustive]
pub struct Tear {
    /// The particles that were split, in this order.
    pub splits: Vec<Split>,
    /// The broken springs that go on as they are and cannot break again: nothing is left that could be split.
    pub held: Vec<u32>,
}

/// A particle that was split: some triangles have a new one in its place, which got the next number.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Split {
    /// The particle, which keeps its number and the other triangles.
    pub particle: u32,
    /// The new one.
    pub copy: u32,
    /// The triangles that have the new one for a corner instead.
    pub triangles: Vec<u32>,
}

/// Opens a net where springs broke. `positions` and `velocities` are those of its particles; they get those of new
/// ones at their ends.
///
/// Particles and springs keep their numbers. The mass of a split particle is shared by the area of its triangles, and
/// all copies begin where it was, with its velocity: mass, momentum and kinetic energy are as before. Springs and
/// bends go to the copies that have their triangles; a spring along an edge that opened is divided between both
/// sides; bends across it are removed (their stiffness is 0 then). What gas it enclosed escapes. No energy is added.
///
/// Springs that are not part of a surface, as in ropes, and all of a [solid](Topology::is_solid) are removed (their
/// stiffness is 0), with the bends over them. Numbers beyond the last spring count for nothing.
///
/// # Panics
/// If the topology names a particle without a position or velocity.
pub fn tear(
    topology: &mut Topology,
    positions: &mut Vec<Vec3>,
    velocities: &mut Vec<Vec3>,
    broken: &[Rupture],
) -> Tear {
    let mut tear = Tear::default();
    let before = topology.triangles.clone();
    let mut surface = Surface::new(topology);
    let mut remains = Vec::new();
    for rupture in broken {
        let Some(&(ends, _)) = topology.springs.get(rupture.spring as usize) else { continue };
        let link = surface.link(&before, ends).filter(|_| !topology.is_solid());
        let copies = link.map(|link| link.copies(&before, &topology.triangles, ends));
        let Some(ends) = copies else {
            remove(topology, rupture.spring as usize);
            continue;
        };
        // What another break has opened at one of its ends relieves it, too.
        let first_ends = topology.springs[rupture.spring as usize].0;
        let is_open = tear.splits.iter().any(|split| first_ends.contains(&split.particle));
        let is_split = is_open || split_an_end(&mut surface, topology, &mut tear, ends);
        remains.push((*rupture, is_split));
    }
    for Split { particle, .. } in &tear.splits {
        positions.push(positions[*particle as usize]);
        velocities.push(velocities[*particle as usize]);
    }
    reattach(topology, &surface, &before, &tear);
    for (rupture, is_split) in remains {
        relax(topology, positions, rupture, is_split);
        tear.held.extend((!is_split).then_some(rupture.spring));
    }
    if !tear.splits.is_empty() {
        topology.pressure = None;
    }
    tear
}

/// The piece that each particle belongs to, counted from 0 in the order of their first particles: what springs, bends
/// and the triangles of a surface join. The triangles of a [solid](Topology::is_solid) hold nothing together.
pub fn pieces(topology: &Topology) -> Vec<u32> {
    let mut parent: Vec<u32> = (0..topology.positions.len() as u32).collect();
    let springs =
        topology.springs.iter().filter(|(_, spring)| spring.stiffness > 0.0 || spring.damping > 0.0);
    let springs = springs.map(|(ends, _)| &ends[..]);
    let rods = topology.rods.iter().filter(|(_, bend)| bend.stiffness > 0.0).map(|(ends, _)| &ends[..]);
    let hinges = topology.hinges.iter().filter(|(_, bend)| bend.stiffness > 0.0).map(|(ends, _)| &ends[..]);
    let joining = if topology.is_solid() { &[][..] } else { &topology.triangles[..] };
    let triangles = joining.iter().map(|corners| &corners[..]);
    for ends in springs.chain(rods).chain(hinges).chain(triangles) {
        for pair in ends.windows(2) {
            let [one, other] = [pair[0], pair[1]].map(|end| root(&mut parent, end));
            // The first particle of a piece stands for it.
            parent[one.max(other) as usize] = one.min(other);
        }
    }
    let mut count = 0;
    let mut piece = vec![0; parent.len()];
    for particle in 0..parent.len() {
        let first = root(&mut parent, particle as u32) as usize;
        piece[particle] = if first == particle { count } else { piece[first] };
        count += u32::from(first == particle);
    }
    piece
}

fn root(parent: &mut [u32], mut particle: u32) -> u32 {
    while parent[particle as usize] != particle {
        let next = parent[parent[particle as usize] as usize];
        parent[particle as usize] = next;
        particle = next;
    }
    particle
}

/// Splits an end of a broken spring: one at a border if there is one, where a tear goes on. Returns whether an end could
/// be split.
fn split_an_end(surface: &mut Surface, topology: &mut Topology, tear: &mut Tear, ends: [u32; 2]) -> bool {
    let mut ways = [ends, [ends[1], ends[0]]];
    let at_border = ways.map(|[end, _]| surface.is_at_border(topology, end));
    if at_border == [false, true] {
        ways.reverse();
    }
    ways.into_iter().any(|[end, other]| split_by_plane(surface, topology, tear, end, other))
}

/// Splits a particle by the plane that is normal to the way to `other` at rest. False if all is on one side of it.
fn split_by_plane(
    surface: &mut Surface,
    topology: &mut Topology,
    tear: &mut Tear,
    end: u32,
    other: u32,
) -> bool {
    let place = topology.positions[end as usize];
    let normal = topology.positions[other as usize] - place;
    let height = |triangle: u32| {
        let [a, b, c] = places(topology, triangle);
        ((a - place) + (b - place) + (c - place)).dot(normal)
    };
    let mut fans = surface.fans(topology, end, |triangle| height(triangle) > 0.0);
    let lowest =
        (0..fans.len()).min_by(|one, other| height(fans[*one][0]).total_cmp(&height(fans[*other][0])));
    let is_divided =
        fans.iter().any(|fan| height(fan[0]) > 0.0) && fans.iter().any(|fan| height(fan[0]) <= 0.0);
    let Some(lowest) = lowest.filter(|_| is_divided) else { return false };
    // What is away from the spring keeps the number, and with it the pin of a border.
    fans.remove(lowest);
    let mut ring = ring(topology, &surface.at(topology, end), end);
    split_into(surface, topology, tear, end, fans);
    // Their triangles may hang together at them alone by now; those of their copies do not.
    ring.retain(|corner| *corner != end);
    for corner in ring {
        let mut fans = surface.fans(topology, corner, |_| true);
        if fans.len() > 1 {
            fans.remove(0);
            split_into(surface, topology, tear, corner, fans);
        }
    }
    true
}

/// The corners of some triangles but for one, in ascending order.
fn ring(topology: &Topology, triangles: &[u32], centre: u32) -> Vec<u32> {
    let corners = triangles.iter().flat_map(|triangle| topology.triangles[*triangle as usize]);
    let mut ring: Vec<u32> = corners.filter(|corner| *corner != centre).collect();
    ring.sort_unstable();
    ring.dedup();
    ring
}

fn split_into(
    surface: &mut Surface,
    topology: &mut Topology,
    tear: &mut Tear,
    particle: u32,
    fans: Vec<Fan>,
) {
    for triangles in fans {
        let copy = surface.split_off(topology, particle, &triangles);
        tear.splits.push(Split { particle, copy, triangles });
    }
}

/// Joins the elements of split particles to their copies.
fn reattach(topology: &mut Topology, surface: &Surface, before: &[[u32; 3]], tear: &Tear) {
    if tear.splits.is_empty() {
        return;
    }
    let mut is_split = vec![false; topology.positions.len()];
    tear.splits.iter().for_each(|split| is_split[split.particle as usize] = true);
    let (now, places) = (topology.triangles.clone(), topology.positions.clone());
    let copies = Copies { surface, before, now: &now, places: &places, is_split };
    reattach_springs(topology, &copies);
    reattach_bends(&mut topology.rods, &copies);
    reattach_bends(&mut topology.hinges, &copies);
}

/// Removes a broken spring that is part of no surface, and the bends over it.
fn remove(topology: &mut Topology, number: usize) {
    let (ends, spring) = topology.springs[number];
    topology.springs[number].1 = emptied(spring);
    let is_over = |others: &[u32]| ends.iter().all(|end| others.contains(end));
    topology.rods.iter_mut().filter(|(others, _)| is_over(others)).for_each(|(_, bend)| disable(bend));
    topology.hinges.iter_mut().filter(|(others, _)| is_over(others)).for_each(|(_, bend)| disable(bend));
}

/// Has what remains of a broken spring begin with less energy than it had at the break. One that nothing could be split
/// for cannot break again.
fn relax(topology: &mut Topology, positions: &[Vec3], rupture: Rupture, is_split: bool) {
    let (ends, spring) = &mut topology.springs[rupture.spring as usize];
    if spring.stiffness == 0.0 && spring.damping == 0.0 {
        return;
    }
    let length = positions[ends[0] as usize].distance(positions[ends[1] as usize]);
    let deformation =
        if spring.rest_length > 0.0 { spring.length_at_rest() / spring.rest_length } else { 1.0 };
    let relaxed = (length - KEPT_ELONGATION * rupture.elongation.max(0.0)) / deformation;
    if relaxed > spring.rest_length {
        spring.rest_length = relaxed;
    }
    if !is_split {
        spring.breaking_force = None;
    }
}
