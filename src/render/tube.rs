//! Tubes and ribbons along strands.
//!
//! The cross-sections are turned from one to the next by rotation-minimizing frames, by double reflection (Wang, Jüttler,
//! Zheng, Liu: *Computation of Rotation Minimizing Frames*, ACM Transactions on Graphics 27, 2008), so that a
//! texture does not twist. The first is the one at rest, turned the shortest way.

use bevy::math::{Quat, Vec3, Vec3A, ops};
use bevy::mesh::Indices;

use super::binding::indices;
use super::easing::NetView;
use super::frame::Frame;
use super::strands::{Strand, strands};
use super::surface::{Scratch, Vertices};
use crate::nets::Topology;

/// What is drawn around each strand.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Profile {
    pub section: Section,
    /// Cross-sections a link.
    pub rings: u32,
    /// The length of rope on which the texture is once, m.
    pub texture_length: f32,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Section {
    /// A polygon of `sides` corners; each end is closed by a cap of `cap_rings` rings, or open if that is 0.
    Round { radius: f32, sides: u32, cap_rings: u32 },
    /// Facing the normal of its frame, or, as far as it can, this direction of the world.
    Flat { half_width: f32, facing: Option<Vec3> },
}

/// The tubes around all strands of a net.
#[derive(Debug, Clone)]
pub(super) struct Tube {
    pub(super) profile: Profile,
    pub(super) strands: Vec<Strand>,
    /// The direction of the first link of each strand at rest, and the normal of its first frame then.
    pub(super) starts: Vec<[Vec3A; 2]>,
    /// Around a cross-section: cos and sin. The last is the first again.
    pub(super) corners: Vec<[f32; 2]>,
    particle_count: usize,
}

/// A cross-section.
#[derive(Debug, Clone, Copy)]
struct Ring {
    centre: Vec3A,
    /// Along the strand.
    axis: Vec3A,
    normal: Vec3A,
}

impl Tube {
    /// Around all springs but the broken ones.
    pub fn new(topology: &Topology, broken: &[u32], profile: Profile) -> Self {
        let strands = strands(topology, broken);
        let start = |strand: &Strand| {
            let [from, to] = [0, 1].map(|end| topology.positions[strand.particles[end] as usize]);
            let axis = (to - from).normalize_or(Vec3::NEG_Y);
            [axis.into(), axis.any_orthonormal_vector().into()]
        };
        let starts = strands.iter().map(start).collect();
        let corners = match profile.section {
            Section::Round { sides, .. } => (0..=sides)
                .map(|corner| {
                    let (sin, cos) =
                        ops::sin_cos(std::f32::consts::TAU * (corner % sides) as f32 / sides as f32);
                    [cos, sin]
                })
                .collect(),
            Section::Flat { .. } => vec![[0.0, -1.0], [0.0, 1.0]],
        };
        let last = strands.iter().flat_map(|strand| &strand.particles).max();
        Self { profile, starts, corners, particle_count: last.map_or(0, |last| *last as usize + 1), strands }
    }

    /// Whether this is a tube of the same shape around the same particles; rest lengths may differ.
    pub fn is_like(&self, other: &Self) -> bool {
        let strands =
            |tube: &Self| tube.strands.iter().map(|strand| strand.particles.clone()).collect::<Vec<_>>();
        self.profile == other.profile && strands(self) == strands(other)
    }

    pub fn particle_count(&self) -> usize {
        self.particle_count
    }

    /// The farthest that a vertex is from its centre, m.
    pub fn radius(&self) -> f32 {
        match self.profile.section {
            Section::Round { radius, .. } => radius,
            Section::Flat { half_width, .. } => half_width,
        }
    }

    /// How far centres can be outside of the box around the particles, m.
    ///
    /// A Catmull–Rom spline is (w₀ + w₁) x₁ + (w₂ + w₃) x₂, a point between the two, + w₀ (x₀ − x₁) + w₃ (x₃ − x₂),
    /// with |w₀| + |w₃| = t (1 − t) / 2 <= 1/8: the length of a link, at most, an eighth of it.
    pub fn overhang(&self, view: &NetView) -> f32 {
        if self.profile.rings < 2 || view.end.len() < self.particle_count {
            return 0.0;
        }
        let longest = |places: &[Vec3]| {
            let links = self.strands.iter().flat_map(|strand| strand.particles.windows(2));
            let length = |link: &[u32]| {
                let [from, to] =
                    [link[0], link[1]].map(|end| places.get(end as usize).copied().unwrap_or_default());
                from.distance_squared(to)
            };
            links.map(length).fold(0.0, f32::max)
        };
        // On the way between two ticks a link is no longer than at one of its ends.
        let mut square = longest(view.end);
        if let Some(start) = view.start {
            square = square.max(longest(if start.len() < self.particle_count { view.end } else { start }));
        }
        0.125 * square.sqrt()
    }

    pub(super) fn cap_rings(&self, strand: &Strand) -> u32 {
        match self.profile.section {
            Section::Round { cap_rings, .. } if !strand.is_closed => cap_rings,
            _ => 0,
        }
    }

    fn ring_count(&self, strand: &Strand) -> usize {
        let links = strand.particles.len() - 1;
        links * self.profile.rings as usize + 1 + 2 * self.cap_rings(strand) as usize
    }

    pub fn vertex_count(&self) -> usize {
        self.strands.iter().map(|strand| self.ring_count(strand) * self.corners.len()).sum()
    }

    /// The texture coordinates: u around, v along the rest length.
    pub fn uvs(&self) -> Vec<[f32; 2]> {
        let mut uvs = Vec::with_capacity(self.vertex_count());
        let sides = self.corners.len() - 1;
        for strand in &self.strands {
            let caps = self.cap_rings(strand) as usize;
            let cap = |ring: usize| self.radius() * std::f32::consts::FRAC_PI_2 * ring as f32 / caps as f32;
            let rings = self.profile.rings as usize;
            let middle = (0..(strand.particles.len() - 1) * rings + 1).map(|ring| {
                let (link, part) = (ring / rings, (ring % rings) as f32 / rings as f32);
                let [from, to] =
                    [link, link + 1].map(|end| strand.lengths[end.min(strand.lengths.len() - 1)]);
                from + (to - from) * part
            });
            let end = strand.lengths[strand.lengths.len() - 1];
            let lengths = (1..=caps)
                .rev()
                .map(|ring| -cap(ring))
                .chain(middle)
                .chain((1..=caps).map(|ring| end + cap(ring)));
            for length in lengths {
                let v = length / self.profile.texture_length;
                uvs.extend((0..=sides).map(|corner| [corner as f32 / sides as f32, v]));
            }
        }
        uvs
    }

    /// The triangles, counter-clockwise seen from outside.
    pub fn indices(&self) -> Indices {
        let mut triangles = Vec::new();
        let around = self.corners.len() as u32;
        let mut first = 0;
        for strand in &self.strands {
            let rings = self.ring_count(strand) as u32;
            let has_caps = self.cap_rings(strand) > 0;
            for ring in 0..rings - 1 {
                for corner in 0..around - 1 {
                    let here = first + ring * around + corner;
                    let there = here + around;
                    // At a pole the cross-section is a point: one of the two triangles has no area.
                    if !(has_caps && ring == 0) {
                        triangles.push([here, here + 1, there + 1]);
                    }
                    if !(has_caps && ring == rings - 2) {
                        triangles.push([here, there + 1, there]);
                    }
                }
            }
            first += rings * around;
        }
        indices(&triangles, first as usize)
    }

    /// Computes the vertices from `scratch.places`, which are in this frame.
    pub fn write(&self, frame: &Frame, scratch: &mut Scratch, vertices: &mut Vertices) {
        vertices.clear();
        let scale = frame.scale();
        let facing = match self.profile.section {
            Section::Flat { facing, .. } => facing.map(|facing| frame.turn(facing.into())),
            Section::Round { .. } => None,
        };
        let Scratch { places, points, axes, normals } = scratch;
        for (strand, start) in self.strands.iter().zip(&self.starts) {
            centres(strand, places, self.profile.rings, points);
            let last = points.len() - 1;
            directions(points, strand.is_closed, axes);
            match facing {
                Some(facing) => face(facing, axes, normals),
                None => roll(strand, start, points, axes, normals),
            }
            let ring = |ring: usize| Ring { centre: points[ring], axis: axes[ring], normal: normals[ring] };
            let caps = self.cap_rings(strand);
            for cap in (1..=caps).rev() {
                self.write_ring(ring(0), -(cap as f32) / caps as f32, scale, vertices);
            }
            for number in 0..=last {
                self.write_ring(ring(number), 0.0, scale, vertices);
            }
            for cap in 1..=caps {
                self.write_ring(ring(last), cap as f32 / caps as f32, scale, vertices);
            }
        }
    }

    /// A cross-section, or one of a rounded end: from 0, its rim, to -1 or 1, its pole.
    fn write_ring(&self, ring: Ring, cap: f32, scale: f32, vertices: &mut Vertices) {
        let Ring { centre, axis, normal } = ring;
        let binormal = axis.cross(normal);
        match self.profile.section {
            Section::Round { radius, .. } => {
                let radius = radius * scale;
                let (sin, cos) = match cap.abs() {
                    0.0 => (0.0, 1.0),
                    // A pole is a point, to the bit.
                    1.0 => (cap, 0.0),
                    _ => ops::sin_cos(std::f32::consts::FRAC_PI_2 * cap),
                };
                for [c, s] in &self.corners {
                    let outward = (normal * *c + binormal * *s) * cos + axis * sin;
                    vertices.positions.push((centre + outward * radius).to_array());
                    vertices.normals.push(outward.to_array());
                    // Outward × tangent is along the strand, towards larger v: w = -1 in Bevy.
                    vertices.tangents.push((binormal * *c - normal * *s).extend(-1.0).to_array());
                }
            }
            Section::Flat { half_width, .. } => {
                for [_, side] in &self.corners {
                    vertices.positions.push((centre + binormal * (half_width * scale * *side)).to_array());
                    vertices.normals.push(normal.to_array());
                    vertices.tangents.push(binormal.extend(-1.0).to_array());
                }
            }
        }
    }
}

/// Normals that face a direction as far as they can.
fn face(facing: Vec3A, axes: &[Vec3A], normals: &mut Vec<Vec3A>) {
    normals.clear();
    normals.extend(axes.iter().map(|axis| orthonormal(facing, *axis)));
}

/// Normals that turn about the strand as little as possible.
pub(super) fn roll(
    strand: &Strand,
    start: &[Vec3A; 2],
    centres: &[Vec3A],
    axes: &[Vec3A],
    normals: &mut Vec<Vec3A>,
) {
    let [axis_at_rest, normal_at_rest] = *start;
    let turn = Quat::from_rotation_arc(axis_at_rest.into(), axes[0].into());
    let mut normal = orthonormal(turn * normal_at_rest, axes[0]);
    normals.clear();
    normals.push(normal);
    for ring in 1..centres.len() {
        normal = reflect_twice(normal, axes[ring - 1], axes[ring], centres[ring] - centres[ring - 1]);
        let exact = orthonormal(normal, axes[ring]);
        normals.push(exact);
        // Reflections keep lengths and angles but for roundings, so that the next one need not wait for this.
        if ring % RINGS_UNTIL_EXACT == 0 {
            normal = exact;
        }
    }
    if strand.is_closed {
        close(normals, axes);
    }
}

/// Turns the frames of a loop evenly, so that the last is the first.
fn close(normals: &mut [Vec3A], axes: &[Vec3A]) {
    let last = axes.len() - 1;
    let (from, to) = (normals[last], normals[0]);
    let angle = ops::atan2(axes[0].dot(from.cross(to)), from.dot(to));
    for (ring, normal) in normals.iter_mut().enumerate() {
        let (sin, cos) = ops::sin_cos(angle * ring as f32 / last as f32);
        *normal = *normal * cos + axes[ring].cross(*normal) * sin;
    }
    normals[last] = normals[0];
}

/// The number of frames after which roundings are removed: each adds a part in 10⁶, as much as is taken for no change.
const RINGS_UNTIL_EXACT: usize = 16;

/// The next normal by double reflection: at the plane between the two centres, then at the one that takes the axis on.
pub(super) fn transport(normal: Vec3A, before: Vec3A, here: Vec3A, step: Vec3A) -> Vec3A {
    orthonormal(reflect_twice(normal, before, here, step), here)
}

/// The same, not made orthonormal anew. What does not depend on the normal is computed first.
#[inline]
fn reflect_twice(normal: Vec3A, before: Vec3A, here: Vec3A, step: Vec3A) -> Vec3A {
    let square = step.length_squared();
    let scaled = if square > f32::MIN_POSITIVE { step * (2.0 / square) } else { Vec3A::ZERO };
    let reflect = |vector: Vec3A| vector - scaled * step.dot(vector);
    let change = here - reflect(before);
    let square = change.length_squared();
    let scaled_change = if square > 1e-12 { change * (2.0 / square) } else { Vec3A::ZERO };
    let reflected = reflect(normal);
    reflected - scaled_change * change.dot(reflected)
}

pub(super) fn orthonormal(normal: Vec3A, axis: Vec3A) -> Vec3A {
    (normal - axis * axis.dot(normal)).try_normalize().unwrap_or_else(|| axis.any_orthonormal_vector())
}

/// The direction of the strand at each centre: half-way between the two links there.
pub(super) fn directions(centres: &[Vec3A], is_closed: bool, axes: &mut Vec<Vec3A>) {
    let last = centres.len() - 1;
    let link = |from: usize| (centres[from + 1] - centres[from]).normalize_or_zero();
    let first = link(0);
    let mut before = if is_closed { link(last - 1) } else { Vec3A::ZERO };
    axes.clear();
    for ring in 0..=last {
        let after = match ring == last {
            true if is_closed => first,
            true => Vec3A::ZERO,
            false => link(ring),
        };
        let direction = (before + after)
            .try_normalize()
            .or_else(|| after.try_normalize())
            .or_else(|| before.try_normalize());
        axes.push(direction.unwrap_or(Vec3A::NEG_Y));
        before = after;
    }
}

/// The centres of the cross-sections: the particles, and between them those of a Catmull–Rom spline.
pub(super) fn centres(strand: &Strand, places: &[Vec3A], rings: u32, centres: &mut Vec<Vec3A>) {
    centres.clear();
    let particles = &strand.particles;
    let place = |number: usize| places[particles[number] as usize];
    let last = particles.len() - 1;
    for link in 0..last {
        let [from, to] = [place(link), place(link + 1)];
        centres.push(from);
        if rings < 2 {
            continue;
        }
        let before = match link {
            0 if strand.is_closed => place(last - 1),
            0 => 2.0 * from - to,
            _ => place(link - 1),
        };
        let after = match link + 1 == last {
            true if strand.is_closed => place(1),
            true => 2.0 * to - from,
            false => place(link + 2),
        };
        for ring in 1..rings {
            let t = ring as f32 / rings as f32;
            let (outer, inner) = (-0.5 * t * (1.0 - t), 1.0 - t);
            let ends = from * (inner + 0.5 * t * inner * (1.0 - 2.0 * t))
                + to * (t - 0.5 * t * inner * (1.0 - 2.0 * t));
            let [before, after] = [(before - from) * (outer * inner), (after - to) * (outer * t)];
            centres.push(ends + before + after);
        }
    }
    centres.push(place(last));
}
