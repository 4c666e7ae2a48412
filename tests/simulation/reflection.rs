//! Reflected types can be saved and loaded by their reflection: inspectors and dynamic scenes do that.

use bevy::prelude::*;
use bevy::reflect::TypeRegistry;
use bevy::reflect::serde::{ReflectDeserializer, ReflectSerializer};
use bevy_mass_spring::prelude::*;
use serde::de::DeserializeSeed;

use crate::common::app_with;

/// Not serialised: handles of assets, which are numbers of this run.
const EXCEPTIONS: [&str; 2] =
    ["bevy_mass_spring::scene::asset::MassSpringSceneRoot", "bevy_mass_spring::render::net_mesh::RestMesh"];

#[test]
fn every_registered_type_is_serialised_by_serde() {
    let app = app_with(MassSpringPlugins::default());
    let registry = app.world().resource::<AppTypeRegistry>().read();
    let ours = registry.iter().filter(|registration| {
        let path = registration.type_info().type_path();
        path.starts_with("bevy_mass_spring::") && !EXCEPTIONS.contains(&path)
    });
    let mut count = 0;
    for registration in ours {
        let path = registration.type_info().type_path();
        assert!(registration.contains::<ReflectSerialize>(), "{path} lacks reflect(Serialize)");
        assert!(registration.contains::<ReflectDeserialize>(), "{path} lacks reflect(Deserialize)");
        count += 1;
    }
    assert!(count >= 15, "{count} types are registered");
}

#[track_caller]
fn assert_round_trip<T: Reflect + PartialEq + std::fmt::Debug + FromReflect>(
    registry: &TypeRegistry,
    value: &T,
) {
    let text = ron::to_string(&ReflectSerializer::new(value, registry)).unwrap();
    let mut deserializer = ron::Deserializer::from_str(&text).unwrap();
    let read = ReflectDeserializer::new(registry).deserialize(&mut deserializer).unwrap();
    assert_eq!(T::from_reflect(&*read).as_ref(), Some(value), "{text}");
}

#[test]
fn values_survive_a_round_trip() {
    let app = app_with(MassSpringPlugins::default());
    let registry = app.world().resource::<AppTypeRegistry>().read();
    assert_round_trip(&registry, &Particle::new(2.0, 0.25));
    assert_round_trip(&registry, &AppliedForce(Vec3::Y));
    assert_round_trip(&registry, &Environment { viscosity_enabled: false, ..default() });
    assert_round_trip(&registry, &CollisionSettings { friction: 0.5, ..default() });
    assert_round_trip(&registry, &TickReport::default());
    let ends = [1, 2].map(|index| Entity::from_raw_u32(index).unwrap());
    assert_round_trip(&registry, &Spring::new(ends[0], ends[1], 0.5).with_damping(0.25));
    #[cfg(feature = "render")]
    {
        assert_round_trip(&registry, &RopeMesh::default().with_sides(5));
        assert_round_trip(&registry, &RopeRibbon { facing: Some(Vec3::Y), ..default() });
        assert_round_trip(&registry, &RopeLinks::new(ends[0]).with_twist(0.5));
        assert_round_trip(&registry, &NetSkin(ends[1]));
        assert_round_trip(&registry, &NetMesh);
    }
}
