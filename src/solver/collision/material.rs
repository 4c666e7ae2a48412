//! Restitution, friction and layers of surfaces.

use bevy::reflect::Reflect;
use bevy::reflect::prelude::ReflectDefault;
#[cfg(feature = "serialize")]
use bevy::reflect::{ReflectDeserialize, ReflectSerialize};

use crate::solver::settings::PairRules;

/// How the coefficients of two surfaces become that of their contact. Of two different rules the later one in this list
/// holds.
#[derive(Reflect, Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serialize", reflect(Serialize, Deserialize))]
#[reflect(Default, Debug, Clone, PartialEq, Hash)]
#[non_exhaustive]
pub enum CombineRule {
    /// Their mean.
    #[default]
    Average,
    /// The smaller one.
    Minimum,
    /// Their product.
    Multiply,
    /// The larger one.
    Maximum,
}

impl CombineRule {
    /// The coefficient of a contact between surfaces of these.
    fn combine(self, [one, other]: [f32; 2]) -> f32 {
        match self {
            Self::Average => 0.5 * (one + other),
            Self::Minimum => one.min(other),
            Self::Multiply => one * other,
            Self::Maximum => one.max(other),
        }
    }
}

/// What a surface does to what touches it.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
pub struct Material {
    /// Coefficient of restitution, 0 to 1.
    pub restitution: f32,
    /// Coefficient of Coulomb friction, >= 0.
    pub friction: f32,
    /// How its restitution is combined with that of the other surface.
    pub restitution_rule: CombineRule,
    /// How its friction is combined with that of the other surface.
    pub friction_rule: CombineRule,
}

impl Material {
    /// Restitution and friction between this surface and another one; one without any takes those of this one.
    pub(super) fn between(self, other: Option<Self>) -> [f32; 2] {
        let Some(other) = other else { return [self.restitution, self.friction] };
        let restitution = self.restitution_rule.max(other.restitution_rule);
        let friction = self.friction_rule.max(other.friction_rule);
        [
            restitution.combine([self.restitution, other.restitution]),
            friction.combine([self.friction, other.friction]),
        ]
    }

    /// The same between the surfaces of two particles, of which one or both may have no material of its own.
    pub(super) fn of_pair([one, other]: [Option<Self>; 2], rules: PairRules) -> [f32; 2] {
        match (one, other) {
            (Some(one), other) => one.between(other),
            (None, Some(other)) => other.between(None),
            (None, None) => [rules.restitution, rules.friction],
        }
    }
}

/// The layers that something is in, and those that it touches: two touch if each filters one that the other is in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
pub struct Layers {
    /// Those that it is in, a bit each.
    pub memberships: u32,
    /// Those that it touches.
    pub filters: u32,
    /// What it does not touch whatever its layers.
    #[cfg_attr(feature = "serialize", serde(default))]
    pub exemptions: Exemptions,
}

impl Layers {
    /// In all layers, and touching all.
    pub const ALL: Self = Self::new(u32::MAX, u32::MAX);

    /// In these layers, touching those, without exemptions.
    pub const fn new(memberships: u32, filters: u32) -> Self {
        Self { memberships, filters, exemptions: Exemptions::NONE }
    }

    /// Whether two may touch.
    #[inline]
    pub fn meet(self, other: Self) -> bool {
        self.memberships & other.filters != 0
            && other.memberships & self.filters != 0
            && !self.exemptions.name(other.exemptions)
            && !other.exemptions.name(self.exemptions)
    }
}

/// A body by its number, and the bodies that it does not touch.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
pub struct Exemptions {
    /// Its own number; 0: it has none.
    pub body: u16,
    /// Those of the bodies that it does not touch, in ascending order, and zeros.
    pub of: [u16; Self::MAX],
}

impl Exemptions {
    /// Number of bodies that one may be exempt from.
    pub const MAX: usize = 7;

    /// Without a number, and exempt from none.
    pub const NONE: Self = Self { body: 0, of: [0; Self::MAX] };

    /// Whether they name the body of others.
    fn name(self, other: Self) -> bool {
        other.body != 0 && self.of.contains(&other.body)
    }
}

impl Default for Layers {
    fn default() -> Self {
        Self::ALL
    }
}

/// How a particle touches others and colliders, where that is not as of all others.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
pub struct ContactProperties {
    /// `None`: what it touches decides.
    pub material: Option<Material>,
    /// Which colliders and particles it touches.
    pub layers: Layers,
}

/// What `properties` of all particles by slot, which are empty or shorter where the others have the default ones, say of one.
pub(in crate::solver) fn properties_of(properties: &[ContactProperties], slot: usize) -> ContactProperties {
    properties.get(slot).copied().unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_later_rule_of_two_holds() {
        let material = |friction, friction_rule| Material { friction, friction_rule, ..Material::default() };
        let cases = [
            (CombineRule::Average, CombineRule::Average, 0.4),
            (CombineRule::Minimum, CombineRule::Average, 0.2),
            (CombineRule::Minimum, CombineRule::Multiply, 0.2 * 0.6),
            (CombineRule::Maximum, CombineRule::Multiply, 0.6),
        ];
        for (one, other, expected) in cases {
            let [_, found] = material(0.2, one).between(Some(material(0.6, other)));
            let [_, turned] = material(0.6, other).between(Some(material(0.2, one)));
            assert!((found - expected).abs() < 1e-7 && found == turned, "{one:?} and {other:?}: {found}");
        }
        assert_eq!(material(0.3, CombineRule::Minimum).between(None), [0.0, 0.3]);
    }

    #[test]
    fn both_must_want_to_meet() {
        let layers = Layers::new;
        assert!(layers(1, 2).meet(layers(2, 1)));
        assert!(!layers(1, 2).meet(layers(2, 4)));
        assert!(!layers(1, 4).meet(layers(2, 1)));
        assert!(Layers::ALL.meet(layers(8, 8)) && !Layers::ALL.meet(layers(0, 8)));
    }

    #[test]
    fn one_exemption_is_enough_for_both() {
        let body = |body, of| Layers { exemptions: Exemptions { body, of }, ..Layers::ALL };
        let (character, cape) = (body(3, [0; 7]), body(0, [3, 0, 0, 0, 0, 0, 0]));
        assert!(!character.meet(cape) && !cape.meet(character));
        assert!(cape.meet(cape) && character.meet(character) && Layers::ALL.meet(cape));
        assert!(body(4, [0; 7]).meet(cape));
    }
}
