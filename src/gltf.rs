//! Nets from glTF files: a node with `mass_spring` in its `extras` becomes a cloth, a jelly or a balloon when its scene
//! spawns.
//!
//! In Blender, give the object a custom property `mass_spring` and export with *Include → Custom Properties*. Its value is
//! a group of properties, or a text with this JSON:
//!
//! ```json
//! { "net": "Cloth", "material": "WOOL", "pins": "RED", "radius": 0.01 }
//! { "net": "Jelly", "material": "GELATINE", "cell": 0.1 }
//! { "net": "Balloon", "material": "LATEX", "pressure": 300.0 }
//! ```
//!
//! | field | of | meaning |
//! | --- | --- | --- |
//! | `net` | all | `Cloth`, `Jelly` or `Balloon` |
//! | `material` | all | the name of a constant of [`ClothMaterial`], [`JellyMaterial`] or [`BalloonMaterial`]; optional |
//! | `pins` | all | the group of vertices that the node holds: `RED`, `GREEN` or `BLUE` (vertices of that colour), or `_PIN` (those with an attribute `_PIN` of at least 1/2, see [`ATTRIBUTE_PIN`]; without the attribute those that are `RED`); optional |
//! | `radius` | all | half of the thickness, m; optional |
//! | `cell` | `Jelly` | the side of the cells of the lattice, m; optional |
//! | `pressure` | `Balloon` | of the gas, Pa above the surroundings; optional |
//! | `breaking_strain` | `Cloth` | the strain at which it tears; optional |
//!
//! What is pinned follows the node and whatever moves it. Every mesh of the node becomes a net of its own.

use bevy::gltf::GltfExtras;
use bevy::prelude::*;
use serde::Deserialize;

use crate::nets::{
    Balloon, BalloonMaterial, Breaking, Cloth, ClothMaterial, Jelly, JellyMaterial, Part, PartOf,
};
use crate::particle::Pinned;
use crate::render::NetMesh;

pub use crate::nets::ATTRIBUTE_PIN;

/// Makes nets of the nodes of glTF files: see the [module](self).
///
/// The attribute `_PIN` is read only if it is registered with Bevy's `GltfPlugin`, by its name without the underscore:
///
/// ```
/// # use bevy::prelude::*;
/// use bevy::gltf::GltfPlugin;
/// use bevy_mass_spring::gltf::ATTRIBUTE_PIN;
///
/// let gltf = GltfPlugin::default().add_custom_vertex_attribute("PIN", ATTRIBUTE_PIN);
/// ```
///
/// and `DefaultPlugins.set(gltf)`.
#[derive(Debug, Clone, Copy, Default)]
pub struct MassSpringGltfPlugin;

impl Plugin for MassSpringGltfPlugin {
    fn build(&self, app: &mut App) {
        app.add_systems(PreUpdate, make_nets);
    }
}

/// The extras of a node, as far as they are ours.
#[derive(Deserialize, Debug, Clone, PartialEq)]
#[serde(tag = "net", deny_unknown_fields)]
enum NodeNet {
    Cloth {
        material: Option<String>,
        pins: Option<String>,
        radius: Option<f32>,
        breaking_strain: Option<f32>,
    },
    Jelly {
        material: Option<String>,
        pins: Option<String>,
        radius: Option<f32>,
        cell: Option<f32>,
    },
    Balloon {
        material: Option<String>,
        pins: Option<String>,
        radius: Option<f32>,
        pressure: Option<f32>,
    },
}

/// What stands under `mass_spring` in the extras of a node; `None` if there is nothing.
fn parse(extras: &str) -> Option<Result<NodeNet, String>> {
    let extras: serde_json::Value = serde_json::from_str(extras).ok()?;
    let ours = extras.get("mass_spring")?.clone();
    let net = match ours {
        serde_json::Value::String(text) => serde_json::from_str(&text),
        value => serde_json::from_value(value),
    };
    Some(net.map_err(|error| error.to_string()))
}

/// The constant of this name.
fn named<M: Copy + Default>(all: &[(&str, M)], name: Option<&str>) -> Result<M, String> {
    let Some(name) = name else { return Ok(M::default()) };
    let found = all.iter().find(|(known, _)| *known == name).map(|(_, material)| *material);
    found.ok_or_else(|| {
        let names: Vec<&str> = all.iter().map(|(known, _)| *known).collect();
        format!("material is \"{name}\", expected one of {}", names.join(", "))
    })
}

impl NodeNet {
    /// Makes a net of an entity with a mesh.
    fn apply(&self, mut entity: EntityCommands) -> Result<(), String> {
        match self {
            Self::Cloth { material, radius, breaking_strain, .. } => {
                let material = named(&ClothMaterial::ALL, material.as_deref())?;
                let mut cloth = Cloth::from_mesh().with_material(material);
                cloth.radius = radius.unwrap_or(cloth.radius);
                entity.insert((cloth, NetMesh));
                if breaking_strain.is_some() {
                    entity.insert(Breaking { strain: *breaking_strain, ..default() });
                }
            }
            Self::Jelly { material, radius, cell, .. } => {
                let material = named(&JellyMaterial::ALL, material.as_deref())?;
                let mut jelly = Jelly::fill_mesh(cell.unwrap_or(0.1)).with_material(material);
                jelly.radius = radius.unwrap_or(jelly.radius);
                entity.insert((jelly, NetMesh));
            }
            Self::Balloon { material, radius, pressure, .. } => {
                let material = named(&BalloonMaterial::ALL, material.as_deref())?;
                let mut balloon = Balloon::from_mesh().with_material(material);
                balloon.radius = radius.unwrap_or(balloon.radius);
                balloon.material.pressure = pressure.unwrap_or(balloon.material.pressure);
                entity.insert((balloon, NetMesh));
            }
        }
        Ok(())
    }

    /// The name of the group that is pinned.
    fn pins(&self) -> Option<&str> {
        let (Self::Cloth { pins, .. } | Self::Jelly { pins, .. } | Self::Balloon { pins, .. }) = self;
        match pins.as_deref() {
            Some("_PIN") => Some("PIN"),
            pins => pins,
        }
    }
}

fn make_nets(
    nodes: Query<(Entity, &GltfExtras, Option<&Name>, &Children), Added<GltfExtras>>,
    meshes: Query<(), With<Mesh3d>>,
    mut commands: Commands,
) {
    for (node, extras, name, children) in &nodes {
        let Some(net) = parse(&extras.value) else { continue };
        let made = net.and_then(|net| {
            for mesh in children.iter().filter(|child| meshes.contains(*child)) {
                net.apply(commands.entity(mesh))?;
                if let Some(pins) = net.pins() {
                    commands.spawn((PartOf(mesh), Part::Painted(pins.to_owned()), Pinned, ChildOf(node)));
                }
            }
            Ok(())
        });
        if let Err(problem) = made {
            let name = name.map_or("", Name::as_str);
            log::warn!("the glTF node {node} \"{name}\" does not become a net: {problem}");
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn extras_are_read_as_a_group_or_as_text() {
        let group = r#"{"mass_spring": {"net": "Jelly", "material": "FOAM", "cell": 0.2}, "other": 1}"#;
        let text = r#"{"mass_spring": "{\"net\": \"Jelly\", \"material\": \"FOAM\", \"cell\": 0.2}"}"#;
        let net =
            NodeNet::Jelly { material: Some("FOAM".to_owned()), pins: None, radius: None, cell: Some(0.2) };
        assert_eq!(parse(group), Some(Ok(net.clone())));
        assert_eq!(parse(text), Some(Ok(net)));
    }

    #[test]
    fn other_extras_are_left_alone_and_bad_ones_refused_by_name() {
        assert_eq!(parse(r#"{"colour": "red"}"#), None);
        assert_eq!(parse("3"), None);
        let refusal = |text: &str| parse(text).expect("ours").expect_err("refused");
        assert!(refusal(r#"{"mass_spring": {"net": "Goo"}}"#).contains("`Goo`"));
        assert!(refusal(r#"{"mass_spring": {"net": "Cloth", "pin": "RED"}}"#).contains("`pin`"));
        let unknown = named(&ClothMaterial::ALL, Some("FLAX")).expect_err("refused");
        assert!(unknown.starts_with("material is \"FLAX\", expected one of SILK, "), "{unknown}");
    }
}
