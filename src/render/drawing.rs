//! What is drawn of a net on an entity, and the systems that keep it up to date.
//!
//! ```text
//!  PostUpdate   prepare   meshes of new nets, and of those that tore
//!               bound     Aabb of all that moved: one pass over the particles, in view or not
//!               (Bevy)    which of them does a view see?
//!  Last         draw      vertices of those that moved and are seen
//! ```
//! The vertices come last, so that what comes into view is never a frame late. Bevy announced the assets that changed
//! in this frame before that; `draw` announces its own. Vertices are computed into buffers, on all threads, and
//! exchanged with those of the mesh: nothing is copied, and nothing allocated.

use bevy::camera::primitives::Aabb;
use bevy::camera::visibility::NoAutoAabb;
use bevy::math::Vec3A;
use bevy::mesh::VertexAttributeValues;
use bevy::prelude::*;

use super::binding::Binding;
use super::crowd::CrowdShape;
use super::easing::{self, NetEasing, NetVersion, NetView};
use super::frame::Frame;
use super::known::{Known, Particles};
use super::surface::{Scratch, Surface, Vertices};
use super::tube::Tube;
use crate::nets::ParticleNet;

/// What is drawn on an entity.
#[derive(Component, Debug)]
#[component(clone_behavior = Ignore)]
#[require(Aabb, NoAutoAabb)]
pub(super) struct Drawing {
    /// The net that moves it.
    pub net: Entity,
    /// What it was made for.
    pub known: Known,
    pub particles: Particles,
    pub kind: Kind,
    /// `None`: what is wrong with it was said already.
    pub shape: Option<Shape>,
    /// The mesh that is written. No other entity has it.
    pub mesh: Handle<Mesh>,
    pub scratch: Scratch,
    pub vertices: Vertices,
    /// The box around the particles in the world, and when that was.
    bounds: Option<(NetVersion, [Vec3A; 2])>,
    bounded: Option<(NetVersion, GlobalTransform)>,
    drawn: Option<(NetVersion, GlobalTransform)>,
    /// Whether `vertices` is newer than the mesh.
    pub is_pending: bool,
}

/// The component by which an entity is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    NetMesh,
    RopeMesh,
    RopeRibbon,
    NetSkin,
}

#[derive(Debug)]
pub(super) enum Shape {
    Surface { surface: Surface, binding: Option<Binding> },
    Tube(Tube),
    Crowd(CrowdShape),
}

impl Shape {
    fn particle_count(&self) -> usize {
        match self {
            Self::Surface { surface, .. } => surface.particle_count(),
            Self::Tube(tube) | Self::Crowd(CrowdShape { tube, .. }) => tube.particle_count(),
        }
    }
}

impl Drawing {
    pub fn new(entity: Entity, net: &ParticleNet, kind: Kind, mesh: Handle<Mesh>) -> Self {
        Self {
            net: entity,
            known: Known::new(net),
            particles: Particles::new(net.topology()),
            kind,
            shape: None,
            mesh,
            scratch: Scratch::default(),
            vertices: Vertices::default(),
            bounds: None,
            bounded: None,
            drawn: None,
            is_pending: false,
        }
    }

    pub fn with_shape(mut self, shape: Shape) -> Self {
        self.shape = Some(shape);
        self
    }

    /// Draws it anew, whether it moved or not.
    pub fn reset(&mut self) {
        (self.bounds, self.bounded, self.drawn) = (None, None, None);
    }

    /// Goes on with a net that tore or got other parameters, where what is drawn hangs on the particles that it had
    /// before. `false`: it is another net.
    pub fn keep(&mut self, net: &ParticleNet) -> bool {
        let is_kept = self.particles.are_in(net.topology());
        if is_kept {
            self.known = Known::new(net);
        }
        is_kept
    }

    /// The box around all vertices in the space of the entity.
    fn enclose(&mut self, view: &NetView, version: NetVersion, place: &GlobalTransform) -> Option<Aabb> {
        let shape = self.shape.as_ref()?;
        let frame = Frame::new(place)?;
        let world = match self.bounds {
            Some((then, world)) if then.is_same_tick(&version) => world,
            _ => enclose_particles(view)?,
        };
        self.bounds = Some((version, world));
        let [low, high] = world;
        let (overhang, radius) = match shape {
            Shape::Surface { surface, .. } => (surface.overhang() * (high - low), surface.height()),
            Shape::Tube(tube) | Shape::Crowd(CrowdShape { tube, .. }) => {
                (Vec3A::splat(tube.overhang(view)), tube.radius())
            }
        };
        // Easing, the way into the space of the entity and the vertices themselves round some ten times.
        let size = low.abs().max(high.abs()).max(place.translation_vec3a().abs()).max_element();
        let rounding = 16.0 * f32::EPSILON * size;
        let [low, high] = frame.enclose([low - overhang - rounding, high + overhang + rounding]);
        let radius = radius * frame.scale() * (1.0 + 16.0 * f32::EPSILON);
        Some(Aabb { center: 0.5 * (low + high), half_extents: 0.5 * (high - low) + radius })
    }

    /// Computes the vertices if they are not what they were.
    fn compute(&mut self, view: &NetView, version: NetVersion, place: &GlobalTransform) {
        if self.drawn == Some((version, *place)) {
            return;
        }
        self.drawn = Some((version, *place));
        let (Some(shape), Some(frame)) = (&mut self.shape, Frame::new(place)) else { return };
        // The shader of crowds works in the world.
        let frame = if matches!(shape, Shape::Crowd(_)) { Frame::World } else { frame };
        frame.place(view, &mut self.scratch.places);
        match shape {
            Shape::Surface { surface, .. } => {
                surface.write(frame.scale(), &mut self.scratch, &mut self.vertices)
            }
            Shape::Tube(tube) => tube.write(&frame, &mut self.scratch, &mut self.vertices),
            #[cfg(any(feature = "crowd", test))]
            Shape::Crowd(CrowdShape { tube, entries, .. }) => tube.write_entries(&mut self.scratch, entries),
            #[cfg(not(any(feature = "crowd", test)))]
            Shape::Crowd(_) => {}
        }
        self.is_pending = true;
    }

    /// Exchanges the vertices with those of the mesh. Whether the mesh changed.
    fn publish(&mut self, mesh: &mut Mesh) -> bool {
        let Vertices { positions, normals, tangents } = &mut self.vertices;
        let Ok(VertexAttributeValues::Float32x3(old)) = mesh.try_attribute_mut(Mesh::ATTRIBUTE_POSITION)
        else {
            return false;
        };
        if old.len() != positions.len() {
            return false;
        }
        std::mem::swap(old, positions);
        if let Ok(VertexAttributeValues::Float32x3(old)) = mesh.try_attribute_mut(Mesh::ATTRIBUTE_NORMAL)
            && old.len() == normals.len()
        {
            std::mem::swap(old, normals);
        }
        if let Ok(VertexAttributeValues::Float32x4(old)) = mesh.try_attribute_mut(Mesh::ATTRIBUTE_TANGENT)
            && old.len() == tangents.len()
        {
            std::mem::swap(old, tangents);
        }
        true
    }
}

/// The box around the particles on all of their way between two ticks.
fn enclose_particles(view: &NetView) -> Option<[Vec3A; 2]> {
    let places = view.end.iter().chain(view.start.unwrap_or_default());
    let (mut low, mut high) = (Vec3A::INFINITY, Vec3A::NEG_INFINITY);
    for place in places {
        let place = Vec3A::from(*place);
        low = low.min(place);
        high = high.max(place);
    }
    (low.is_finite() && high.is_finite()).then_some([low, high])
}

/// Keeps the boxes around what is drawn.
pub(super) fn bound_nets(
    mut drawings: Query<(&mut Drawing, &GlobalTransform, &mut Aabb)>,
    nets: Query<(Ref<ParticleNet>, Option<&NetEasing>)>,
    time: Option<Res<Time<Fixed>>>,
) {
    let fraction = easing::fraction(time.as_deref());
    for (mut drawing, place, mut aabb) in &mut drawings {
        let Ok((net, easing)) = nets.get(drawing.net) else { continue };
        let (view, version) = easing::view(&net, easing, fraction);
        if let Some((then, there)) = drawing.bounded
            && then.is_same_tick(&version)
            && there == *place
        {
            continue;
        }
        if let Some(new) = drawing.enclose(&view, version, place) {
            aabb.set_if_neq(new);
            drawing.bounded = Some((version, *place));
        }
    }
}

/// Few enough drawings are computed on one thread.
const MIN_PARALLEL: usize = 4;

/// Writes the vertices of what moved and is seen.
pub(super) fn draw_nets(
    mut drawings: Query<(
        &mut Drawing,
        &ViewVisibility,
        &GlobalTransform,
        Option<&mut Mesh3d>,
        Option<&mut Mesh2d>,
    )>,
    nets: Query<(Ref<ParticleNet>, Option<&NetEasing>)>,
    time: Option<Res<Time<Fixed>>>,
    mut meshes: ResMut<Assets<Mesh>>,
    mut changes: MessageWriter<AssetEvent<Mesh>>,
) {
    let fraction = easing::fraction(time.as_deref());
    let compute = |drawing: &mut Drawing, seen: &ViewVisibility, place: &GlobalTransform| {
        let Ok((net, easing)) = nets.get(drawing.net) else { return };
        if !seen.get() || !drawing.known.is_same(&net) {
            return;
        }
        let needed = drawing.shape.as_ref().map_or(usize::MAX, Shape::particle_count);
        let (view, version) = easing::view(&net, easing, fraction);
        if needed <= view.end.len() {
            drawing.compute(&view, version, place);
        }
    };
    if drawings.iter().len() > MIN_PARALLEL {
        drawings.par_iter_mut().for_each(|(mut drawing, seen, place, ..)| {
            compute(drawing.bypass_change_detection(), seen, place)
        });
    } else {
        drawings.iter_mut().for_each(|(mut drawing, seen, place, ..)| {
            compute(drawing.bypass_change_detection(), seen, place)
        });
    }
    for (mut drawing, _, _, mesh_3d, mesh_2d) in &mut drawings {
        let drawing = drawing.bypass_change_detection();
        if matches!(drawing.shape, Some(Shape::Crowd(_))) || !std::mem::take(&mut drawing.is_pending) {
            continue;
        }
        let id = drawing.mesh.id();
        // Not the tracked way: what it queues would be announced in the next frame.
        if let Some(mesh) = meshes.get_mut_untracked(id)
            && drawing.publish(mesh)
        {
            changes.write(AssetEvent::Modified { id });
            // The renderer may have moved the mesh to other buffers.
            if let Some(mut mesh) = mesh_3d {
                mesh.set_changed();
            }
            if let Some(mut mesh) = mesh_2d {
                mesh.set_changed();
            }
        }
    }
}
