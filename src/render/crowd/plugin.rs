//! Which ropes are of a crowd, where each is in the buffer, and what they are drawn with.

use bevy::asset::{AssetEventSystems, AssetId, RenderAssetUsages, embedded_asset};
use bevy::mesh::MeshTag;
use bevy::pbr::{MaterialPlugin, PbrPlugin};
use bevy::platform::collections::HashMap;
use bevy::prelude::*;
use bevy::render::RenderApp;
use bevy::render::renderer::RenderDevice;
use bevy::render::storage::ShaderBuffer;

use super::material::{RopeCrowdExtension, RopeCrowdMaterial};
use super::places::Places;
use super::{CrowdShape, CrowdSupport, Entry, RopeCrowd};
use crate::render::NetRenderSystems;
use crate::render::drawing::{Drawing, Shape, draw_nets};
use crate::render::tube::Tube;

/// Draws the ropes of crowds ([`RopeCrowd`]), in apps with Bevy's `PbrPlugin`, which is part of `DefaultPlugins`.
///
/// [`MassSpringPlugins`](crate::MassSpringPlugins) holds it, and [`MassSpringPlugin`](crate::MassSpringPlugin) adds it.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct MassSpringCrowdPlugin {
    /// Whether it also acts in apps without a renderer. Default false.
    pub headless: bool,
}

impl Plugin for MassSpringCrowdPlugin {
    fn build(&self, app: &mut App) {
        app.register_type::<RopeCrowd>();
        if self.headless || app.is_plugin_added::<PbrPlugin>() {
            embedded_asset!(app, "crowd.wgsl");
            app.add_plugins(MaterialPlugin::<RopeCrowdMaterial>::default());
        }
    }

    fn finish(&self, app: &mut App) {
        let has_renderer = app
            .get_sub_app(RenderApp)
            .and_then(|renderer| renderer.world().get_resource::<RenderDevice>())
            // WebGL has none.
            .is_some_and(|device| device.limits().max_storage_buffers_per_shader_stage >= 4);
        let has_material = app.world().contains_resource::<Assets<RopeCrowdMaterial>>();
        if !(self.headless || has_renderer) || !has_material {
            return;
        }
        // A collection that is there already would be replaced by an empty one.
        if !app.world().contains_resource::<Assets<ShaderBuffer>>() {
            app.init_asset::<ShaderBuffer>();
        }
        if !app.world().contains_resource::<Assets<StandardMaterial>>() {
            app.init_asset::<StandardMaterial>();
        }
        app.init_resource::<Crowds>()
            .insert_resource(CrowdSupport)
            .add_systems(
                PostUpdate,
                (follow_materials, join, dress)
                    .chain()
                    .in_set(NetRenderSystems::Prepare)
                    .after(crate::render::rope_mesh::prepare_ropes)
                    .before(AssetEventSystems),
            )
            .add_systems(Last, publish.in_set(NetRenderSystems::Draw).after(draw_nets))
            .add_observer(give_back)
            .add_observer(leave);
    }
}

/// The buffer, the tubes and the materials of all crowds.
#[derive(Resource)]
struct Crowds {
    places: Places,
    /// What the buffer is to contain.
    bytes: Vec<u8>,
    buffer: Handle<ShaderBuffer>,
    tubes: Vec<SharedTube>,
    materials: HashMap<AssetId<StandardMaterial>, Handle<RopeCrowdMaterial>>,
    /// Number of frames for which materials are still marked as changed, since the buffer is another one.
    stale_frames: u32,
}

/// A mesh and what it is that of.
struct SharedTube {
    tube: Tube,
    mesh: Handle<Mesh>,
    users: usize,
}

/// The entries of a rope of a crowd.
#[derive(Component, Debug)]
#[component(clone_behavior = Ignore)]
pub(super) struct CrowdPlace {
    pub start: u32,
    pub count: u32,
    mesh: Handle<Mesh>,
}

/// The material that the rope had before.
#[derive(Component)]
#[component(clone_behavior = Ignore)]
struct OwnMaterial(Handle<StandardMaterial>);

const ENTRY_BYTES: usize = size_of::<Entry>();

/// The number of entries that the buffer has at first.
const FIRST_CAPACITY: u32 = 1024;

impl FromWorld for Crowds {
    fn from_world(world: &mut World) -> Self {
        let bytes = vec![0; FIRST_CAPACITY as usize * ENTRY_BYTES];
        let buffer = ShaderBuffer::new(&bytes, RenderAssetUsages::RENDER_WORLD);
        Self {
            places: Places::default(),
            buffer: world.resource_mut::<Assets<ShaderBuffer>>().add(buffer),
            bytes,
            tubes: Vec::new(),
            materials: HashMap::default(),
            stale_frames: 0,
        }
    }
}

impl Crowds {
    /// The mesh that a tube shares with those that are like it.
    fn mesh_of(&mut self, tube: &Tube, meshes: &mut Assets<Mesh>) -> Handle<Mesh> {
        let known = self.tubes.iter_mut().find(|shared| shared.tube.shares_mesh_with(tube));
        if let Some(shared) = known {
            shared.users += 1;
            return shared.mesh.clone();
        }
        let mesh = meshes.add(tube.shared_mesh());
        self.tubes.push(SharedTube { tube: tube.clone(), mesh: mesh.clone(), users: 1 });
        mesh
    }

    fn release(&mut self, place: &CrowdPlace) {
        self.places.give_back(place.start, place.count);
        if let Some(number) = self.tubes.iter().position(|shared| shared.mesh == place.mesh) {
            self.tubes[number].users -= 1;
            if self.tubes[number].users == 0 {
                self.tubes.swap_remove(number);
            }
        }
    }
}

/// Gives new ropes of crowds, and those that tore, a place and a mesh.
fn join(
    mut drawings: Query<(Entity, &mut Drawing, Has<CrowdPlace>), Changed<Drawing>>,
    mut crowds: ResMut<Crowds>,
    mut meshes: ResMut<Assets<Mesh>>,
    mut commands: Commands,
) {
    for (entity, mut drawing, is_in_crowd) in &mut drawings {
        if let Some(Shape::Crowd(CrowdShape { tube, has_place, .. })) =
            &mut drawing.bypass_change_detection().shape
        {
            // What bounds it changes with it, too.
            if std::mem::replace(has_place, true) {
                continue;
            }
            let count = tube.entry_count() as u32;
            let start = crowds.places.take(count);
            let mesh = crowds.mesh_of(tube, &mut meshes);
            let place = CrowdPlace { start, count, mesh: mesh.clone() };
            commands.entity(entity).try_insert((Mesh3d(mesh), MeshTag(start), place));
        } else if is_in_crowd {
            commands.entity(entity).try_remove::<(CrowdPlace, MeshTag)>();
        }
    }
}

fn give_back(gone: On<Discard, CrowdPlace>, places: Query<&CrowdPlace>, mut crowds: ResMut<Crowds>) {
    if let Ok(place) = places.get(gone.entity) {
        crowds.release(place);
    }
}

/// What is of no crowd any more gets back what it had.
fn leave(removed: On<Remove, CrowdPlace>, materials: Query<&OwnMaterial>, mut commands: Commands) {
    let mut entity = commands.entity(removed.entity);
    entity.try_remove::<(MeshTag, OwnMaterial, MeshMaterial3d<RopeCrowdMaterial>)>();
    if let Ok(OwnMaterial(material)) = materials.get(removed.entity) {
        entity.try_insert(MeshMaterial3d(material.clone()));
    }
}

/// Takes the materials of ropes for those of crowds.
fn dress(
    ropes: Query<(Entity, &MeshMaterial3d<StandardMaterial>), With<CrowdPlace>>,
    mut crowds: ResMut<Crowds>,
    own: Res<Assets<StandardMaterial>>,
    mut materials: ResMut<Assets<RopeCrowdMaterial>>,
    mut commands: Commands,
) {
    for (entity, MeshMaterial3d(material)) in &ropes {
        let Some(base) = own.get(material) else { continue };
        let Crowds { materials: known, buffer, .. } = &mut *crowds;
        let of_crowd = known.entry(material.id()).or_insert_with(|| {
            let extension = RopeCrowdExtension { entries: buffer.clone() };
            materials.add(RopeCrowdMaterial { base: base.clone(), extension })
        });
        commands
            .entity(entity)
            .try_remove::<MeshMaterial3d<StandardMaterial>>()
            .try_insert((MeshMaterial3d(of_crowd.clone()), OwnMaterial(material.clone())));
    }
}

/// Changes what was made of materials that changed, and drops those that are gone.
fn follow_materials(
    mut changes: MessageReader<AssetEvent<StandardMaterial>>,
    mut crowds: ResMut<Crowds>,
    own: Res<Assets<StandardMaterial>>,
    mut materials: ResMut<Assets<RopeCrowdMaterial>>,
) {
    for change in changes.read() {
        match change {
            AssetEvent::Modified { id } => {
                if let (Some(of_crowd), Some(base)) = (crowds.materials.get(id), own.get(*id))
                    && let Some(mut of_crowd) = materials.get_mut(of_crowd)
                {
                    of_crowd.base = base.clone();
                }
            }
            AssetEvent::Removed { id } => {
                crowds.materials.remove(id);
            }
            _ => {}
        }
    }
}

/// Writes the entries of ropes that moved and are seen into the buffer.
fn publish(
    mut drawings: Query<(&mut Drawing, &CrowdPlace)>,
    mut crowds: ResMut<Crowds>,
    mut buffers: ResMut<Assets<ShaderBuffer>>,
    mut changes: MessageWriter<AssetEvent<ShaderBuffer>>,
    mut material_changes: MessageWriter<AssetEvent<RopeCrowdMaterial>>,
) {
    let Crowds { places, bytes, buffer, materials, stale_frames, .. } = &mut *crowds;
    let needed = places.len().next_power_of_two() as usize * ENTRY_BYTES;
    if bytes.len() < needed {
        bytes.resize(needed, 0);
        // The renderer makes another buffer, of which materials that are there know nothing: before or after they look
        // for it in this frame.
        *stale_frames = 2;
    }
    let mut is_changed = false;
    for (mut drawing, place) in &mut drawings {
        let drawing = drawing.bypass_change_detection();
        let Some(Shape::Crowd(CrowdShape { entries, .. })) = &drawing.shape else { continue };
        if entries.len() != place.count as usize || !drawing.is_pending {
            continue;
        }
        let start = place.start as usize * ENTRY_BYTES;
        let own = &mut bytes[start..start + entries.len() * ENTRY_BYTES];
        for (bytes, value) in own.chunks_exact_mut(4).zip(entries.as_flattened()) {
            bytes.copy_from_slice(&value.to_le_bytes());
        }
        drawing.is_pending = false;
        is_changed = true;
    }
    if *stale_frames > 0 {
        *stale_frames -= 1;
        let modified = |material: &Handle<RopeCrowdMaterial>| AssetEvent::Modified { id: material.id() };
        material_changes.write_batch(materials.values().map(modified));
    }
    // As with meshes: what the tracked way queues would be announced in the next frame.
    if is_changed && let Some(asset) = buffers.get_mut_untracked(&*buffer) {
        // The renderer takes it; where there is none, it stays.
        match &mut asset.data {
            Some(data) => data.clone_from(bytes),
            None => asset.data = Some(bytes.clone()),
        }
        changes.write(AssetEvent::Modified { id: buffer.id() });
    }
}
