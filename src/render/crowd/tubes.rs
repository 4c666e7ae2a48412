//! The mesh that ropes of a crowd share. Its vertices say where on a rope they are, not where in the world.

use bevy::asset::RenderAssetUsages;
use bevy::mesh::{Mesh, PrimitiveTopology};

use super::entries::MARGIN;
use crate::render::strands::Strand;
use crate::render::tube::Tube;

impl Tube {
    /// Whether another tube can be drawn by the same mesh.
    pub fn shares_mesh_with(&self, other: &Self) -> bool {
        // The texture is off by a ten-thousandth at most.
        let is_near = |(one, other): (&f32, &f32), whole: f32| (one - other).abs() <= 1e-4 * whole;
        let is_alike = |(one, other): (&Strand, &Strand)| {
            let whole = one.lengths.last().copied().unwrap_or(0.0);
            (one.particles.len(), one.is_closed) == (other.particles.len(), other.is_closed)
                && one.lengths.iter().zip(&other.lengths).all(|pair| is_near(pair, whole))
        };
        self.profile == other.profile
            && self.strands.len() == other.strands.len()
            && self.strands.iter().zip(&other.strands).all(is_alike)
    }

    /// The mesh: x of a position is the number of an entry and the part of the way to the next one, y goes once around, and
    /// z over the rounded ends, from -1 or 1, the poles, to 0. Normals and tangents are there for the pipeline.
    pub fn shared_mesh(&self) -> Mesh {
        let mut positions = Vec::with_capacity(self.vertex_count());
        let mut first = 0;
        for strand in &self.strands {
            let rings = self.profile.rings as usize;
            let last = (strand.particles.len() - 1) * rings;
            let caps = self.cap_rings(strand);
            let along =
                |ring: usize| (first + MARGIN + ring / rings) as f32 + (ring % rings) as f32 / rings as f32;
            let cap = |ring: u32| ring as f32 / caps as f32;
            let begin = (1..=caps).rev().map(|ring| [along(0), -cap(ring)]);
            let middle = (0..=last).map(|ring| [along(ring), 0.0]);
            let end = (1..=caps).map(|ring| [along(last), cap(ring)]);
            let sides = self.corners.len() - 1;
            for [along, cap] in begin.chain(middle).chain(end) {
                positions.extend((0..=sides).map(|side| [along, side as f32 / sides as f32, cap]));
            }
            first += strand.particles.len() + 2 * MARGIN;
        }
        let count = positions.len();
        Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::RENDER_WORLD)
            .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, positions)
            .with_inserted_attribute(Mesh::ATTRIBUTE_NORMAL, vec![[0.0, 0.0, 1.0]; count])
            .with_inserted_attribute(Mesh::ATTRIBUTE_TANGENT, vec![[1.0, 0.0, 0.0, -1.0]; count])
            .with_inserted_attribute(Mesh::ATTRIBUTE_UV_0, self.uvs())
            .with_inserted_indices(self.indices())
    }
}

#[cfg(test)]
mod tests {
    use bevy::math::{Vec3, Vec3A, ops};
    use bevy::mesh::VertexAttributeValues;

    use super::*;
    use crate::nets::{Layout, Topology};
    use crate::render::crowd::Entry;
    use crate::render::frame::Frame;
    use crate::render::surface::{Scratch, Vertices};
    use crate::render::tube::{Profile, Section, orthonormal, transport};
    use crate::solver::Spring;

    /// What `crowd.wgsl` computes of a vertex, line by line: its place and the direction from the middle of the rope.
    fn shade(entries: &[Entry], [along, around, cap]: [f32; 3]) -> [Vec3A; 2] {
        let place = |entry: f32| Vec3A::from_slice(&entries[entry as usize][..3]);
        let centre = |along: f32| {
            let (entry, t) = (along.floor(), along - along.floor());
            let [before, from, to, after] =
                [-1.0, 0.0, 1.0, 2.0].map(|offset| place((entry + offset).min(entries.len() as f32 - 1.0)));
            let (outer, inner) = (-0.5 * t * (1.0 - t), 1.0 - t);
            let bent = 0.5 * t * inner * (1.0 - 2.0 * t);
            from * (inner + bent)
                + to * (t - bent)
                + (before - from) * (outer * inner)
                + (after - to) * (outer * t)
        };
        let [_, _, _, rings, u, v, w, radius] = entries[along.floor() as usize];
        let axis = |along: f32| {
            let [before, here, after] = [along - 1.0 / rings, along, along + 1.0 / rings].map(centre);
            let sum = (here - before).normalize_or_zero() + (after - here).normalize_or_zero();
            sum.normalize_or(Vec3A::NEG_Y)
        };
        let (start, here) = (along.floor(), axis(along));
        let known = orthonormal(Vec3A::new(u, v, w), axis(start));
        let normal = transport(known, axis(start), here, centre(along) - centre(start));
        let angle = std::f32::consts::TAU * around.fract();
        let (sin, cos) = ops::sin_cos(std::f32::consts::FRAC_PI_2 * cap);
        let out = normal * ops::cos(angle) + here.cross(normal) * ops::sin(angle);
        let outward = out * cos + here * sin;
        [centre(along) + outward * radius, outward]
    }

    fn rope(positions: Vec<Vec3>, is_closed: bool) -> Topology {
        let count = positions.len() as u32;
        let segments = if is_closed { count } else { count - 1 };
        let spring = |first: u32| {
            let ends = [first, (first + 1) % count];
            let rest_length = positions[ends[0] as usize].distance(positions[ends[1] as usize]);
            (ends, Spring { rest_length, ..Spring::default() })
        };
        let layout = Layout::Rope { is_closed };
        Topology { springs: (0..segments).map(spring).collect(), positions, layout, ..Topology::default() }
    }

    /// The vertices of the shared tube and those of a tube of its own are the same, for a helix and a loop.
    #[test]
    fn a_crowd_is_drawn_as_each_by_itself() {
        let helix = |step: u32| {
            let angle = step as f32 * 0.25;
            Vec3::new(ops::cos(angle), 0.05 * step as f32, ops::sin(angle))
        };
        let ring = |step: u32| {
            let angle = step as f32 * std::f32::consts::TAU / 24.0;
            Vec3::new(ops::cos(angle), 0.2 * ops::sin(2.0 * angle), ops::sin(angle))
        };
        for (topology, broken) in [
            (rope((0..40).map(helix).collect(), false), vec![]),
            (rope((0..40).map(helix).collect(), false), vec![17]),
            (rope((0..24).map(ring).collect(), true), vec![]),
            (rope(vec![Vec3::ZERO, Vec3::X], false), vec![]),
        ] {
            for rings in [1, 2, 5] {
                let section = Section::Round { radius: 0.03, sides: 8, cap_rings: 3 };
                let tube = Tube::new(&topology, &broken, Profile { section, rings, texture_length: 0.1 });
                let places: Vec<Vec3A> = topology.positions.iter().map(|place| Vec3A::from(*place)).collect();
                let mut scratch = Scratch { places, ..Scratch::default() };
                let (mut own, mut entries) = (Vertices::default(), Vec::new());
                tube.write(&Frame::World, &mut scratch, &mut own);
                tube.write_entries(&mut scratch, &mut entries);
                assert_eq!(entries.len(), tube.entry_count());
                let mesh = tube.shared_mesh();
                let Some(VertexAttributeValues::Float32x3(vertices)) =
                    mesh.attribute(Mesh::ATTRIBUTE_POSITION)
                else {
                    panic!()
                };
                assert_eq!(vertices.len(), own.positions.len());
                for (number, vertex) in vertices.iter().enumerate() {
                    let [place, outward] = shade(&entries, *vertex);
                    let off = place.distance(Vec3A::from_array(own.positions[number]));
                    // Double reflection is of fourth order: 0.25 rad a link leaves some 1e-3 rad over all of them.
                    assert!(off < 0.01 * 0.03, "{rings} {number}: {off}");
                    let off = outward.distance(Vec3A::from_array(own.normals[number]));
                    assert!(off < 0.01, "{rings} {number}: {off}");
                }
            }
        }
    }
}
