//! The material of ropes in a crowd: Bevy's own, with another vertex shader.

use bevy::pbr::{ExtendedMaterial, MaterialExtension};
use bevy::prelude::*;
use bevy::render::render_resource::AsBindGroup;
use bevy::render::storage::ShaderBuffer;
use bevy::shader::ShaderRef;

const SHADER: &str = "embedded://bevy_mass_spring/render/crowd/crowd.wgsl";

/// The material that a rope with a [`RopeCrowd`](super::RopeCrowd) gets, made of its `StandardMaterial`.
pub type RopeCrowdMaterial = ExtendedMaterial<StandardMaterial, RopeCrowdExtension>;

/// What the vertex shader of a [`RopeCrowdMaterial`] reads: the particles of all ropes in crowds.
#[derive(Asset, AsBindGroup, Reflect, Debug, Clone, Default)]
pub struct RopeCrowdExtension {
    #[storage(100, read_only, visibility(vertex))]
    pub(super) entries: Handle<ShaderBuffer>,
}

impl MaterialExtension for RopeCrowdExtension {
    fn vertex_shader() -> ShaderRef {
        SHADER.into()
    }

    fn prepass_vertex_shader() -> ShaderRef {
        SHADER.into()
    }

    fn deferred_vertex_shader() -> ShaderRef {
        SHADER.into()
    }
}
