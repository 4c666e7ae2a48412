//! The triangles of a net round its particles, and how particles are split.

use bevy::math::Vec3;

use crate::nets::Topology;

/// The triangles at each particle, kept while particles are split.
pub(super) struct Surface {
    /// Those of the particles that were there at first, particle after particle: `listed[start[p]..start[p + 1]]`.
    start: Vec<u32>,
    listed: Vec<u32>,
    /// Those of each added particle.
    added: Vec<Vec<u32>>,
}

/// Triangles round a particle that are joined edge to edge.
pub(super) type Fan = Vec<u32>;

impl Surface {
    pub fn new(topology: &Topology) -> Self {
        let mut start = vec![0; topology.positions.len() + 1];
        for corner in topology.triangles.as_flattened() {
            start[*corner as usize + 1] += 1;
        }
        for particle in 1..start.len() {
            start[particle] += start[particle - 1];
        }
        let mut next = start.clone();
        let mut listed = vec![0; topology.triangles.len() * 3];
        for (number, corners) in (0..).zip(&topology.triangles) {
            for corner in corners {
                listed[next[*corner as usize] as usize] = number;
                next[*corner as usize] += 1;
            }
        }
        Self { start, listed, added: Vec::new() }
    }

    /// The triangles that have a corner at a particle, in ascending order.
    pub fn at(&self, topology: &Topology, particle: u32) -> Fan {
        let (number, first_added) = (particle as usize, self.start.len() - 1);
        let listed = match number.checked_sub(first_added) {
            Some(added) => &self.added[added][..],
            None => &self.listed[self.start[number] as usize..self.start[number + 1] as usize],
        };
        let has_corner = |triangle: &u32| topology.triangles[*triangle as usize].contains(&particle);
        listed.iter().copied().filter(has_corner).collect()
    }

    /// The triangles that had a corner at one of the first particles before anything was split.
    pub fn first_at(&self, particle: u32) -> &[u32] {
        let ends = self.start.get(particle as usize).zip(self.start.get(particle as usize + 1));
        ends.map_or(&[], |(start, end)| &self.listed[*start as usize..*end as usize])
    }

    /// How the surface held two of the first particles together.
    pub fn link(&self, before: &[[u32; 3]], [one, other]: [u32; 2]) -> Option<Link> {
        let (at_one, at_other) = (self.first_at(one), self.first_at(other));
        if let Some(both) = at_one.iter().find(|triangle| at_other.contains(triangle)) {
            return Some(Link { triangles: [*both; 2] });
        }
        let across = |first: u32, second: u32| common_corners(before, [first, second]) == 2;
        let pairs = at_one.iter().flat_map(|first| at_other.iter().map(move |second| [*first, *second]));
        pairs.into_iter().find(|[first, second]| across(*first, *second)).map(|triangles| Link { triangles })
    }

    /// The triangles at a particle, divided into fans: what is joined by edges between triangles on the same `side`.
    /// Each is in ascending order, and they are in the order of their first triangles.
    pub fn fans(&self, topology: &Topology, particle: u32, side: impl Fn(u32) -> bool) -> Vec<Fan> {
        let mut rest = self.at(topology, particle);
        let mut fans = Vec::new();
        while !rest.is_empty() {
            let mut fan = vec![rest.remove(0)];
            let mut reached = 0;
            while reached < fan.len() {
                let from = fan[reached];
                rest.retain(|other| {
                    let is_next =
                        side(from) == side(*other) && share_edge(topology, [from, *other], particle);
                    fan.extend(is_next.then_some(*other));
                    !is_next
                });
                reached += 1;
            }
            fan.sort_unstable();
            fans.push(fan);
        }
        fans
    }

    /// Whether an edge at a particle has one triangle only.
    pub fn is_at_border(&self, topology: &Topology, particle: u32) -> bool {
        let at = self.at(topology, particle);
        let corners = || at.iter().flat_map(|triangle| topology.triangles[*triangle as usize]);
        corners().any(|corner| corners().filter(|other| *other == corner).count() == 1)
    }

    /// Gives the triangles of `fan` a particle of their own in the place of `particle`, with the part of its mass that
    /// their area at rest is of all at the particle; its number.
    pub fn split_off(&mut self, topology: &mut Topology, particle: u32, fan: &Fan) -> u32 {
        let areas =
            |triangles: &[u32]| triangles.iter().map(|triangle| area(topology, *triangle)).sum::<f64>();
        let (own, all) = (areas(fan), areas(&self.at(topology, particle)));
        let copy = topology.positions.len() as u32;
        let mass = f64::from(topology.masses[particle as usize]);
        let share = if all > 0.0 { own / all } else { 0.5 };
        let own_mass = (mass * share) as f32;
        topology.positions.push(topology.positions[particle as usize]);
        topology.masses.push(own_mass);
        topology.masses[particle as usize] = (mass - f64::from(own_mass)) as f32;
        for triangle in fan {
            for corner in &mut topology.triangles[*triangle as usize] {
                *corner = if *corner == particle { copy } else { *corner };
            }
        }
        self.added.push(fan.clone());
        copy
    }
}

/// Two particles of a surface: corners of one triangle, or on the two sides of a common edge of two.
#[derive(Debug, Clone, Copy)]
pub(super) struct Link {
    /// The triangle of the first and that of the second.
    pub triangles: [u32; 2],
}

impl Link {
    /// Whether they are corners of one triangle.
    pub fn is_edge(&self) -> bool {
        self.triangles[0] == self.triangles[1]
    }

    /// What these triangles have in the place of the two `ends`.
    pub fn copies(&self, before: &[[u32; 3]], now: &[[u32; 3]], ends: [u32; 2]) -> [u32; 2] {
        [0, 1].map(|end| copy_in(before, now, self.triangles[end], ends[end]))
    }
}

/// What a triangle has by now in the place of a particle that was a corner of it.
pub(super) fn copy_in(before: &[[u32; 3]], now: &[[u32; 3]], triangle: u32, particle: u32) -> u32 {
    let place = before[triangle as usize].iter().position(|corner| *corner == particle);
    place.map_or(particle, |place| now[triangle as usize][place])
}

/// The number of common corners of two triangles.
pub(super) fn common_corners(triangles: &[[u32; 3]], [one, other]: [u32; 2]) -> usize {
    let [one, other] = [one, other].map(|triangle| triangles[triangle as usize]);
    one.iter().filter(|corner| other.contains(corner)).count()
}

/// Whether two triangles have a corner in common beside `particle`.
fn share_edge(topology: &Topology, [one, other]: [u32; 2], particle: u32) -> bool {
    let [one, other] = [one, other].map(|triangle| topology.triangles[triangle as usize]);
    one.iter().any(|corner| *corner != particle && other.contains(corner))
}

/// The area of a triangle at rest, m².
fn area(topology: &Topology, triangle: u32) -> f64 {
    let [a, b, c] = places(topology, triangle).map(|place| place.as_dvec3());
    0.5 * (b - a).cross(c - a).length()
}

/// The places of the corners of a triangle at rest.
pub(super) fn places(topology: &Topology, triangle: u32) -> [Vec3; 3] {
    topology.triangles[triangle as usize].map(|corner| topology.positions[corner as usize])
}
