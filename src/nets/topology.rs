//! What a net is made of: a pure value, shared by all nets of equal recipes.

use bevy::math::Vec3;
use bevy::reflect::Reflect;
use bevy::reflect::prelude::ReflectDefault;

use super::NetError;
use crate::parameter::{self, InvalidParameter};
use crate::solver::{Bend, Spring};

/// The particles of a net at rest, and what joins them. Particles are known by their numbers, for life.
#[derive(Debug, Clone, Default, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
pub struct Topology {
    /// The places of the particles at rest, m, in the frame of the recipe.
    pub positions: Vec<Vec3>,
    /// The mass of each particle, kg, > 0.
    pub masses: Vec<f32>,
    /// The radius of all particles, m: half of the thickness of a rope or cloth.
    pub radius: f32,
    /// The springs and their ends.
    pub springs: Vec<([u32; 2], Spring)>,
    /// Bends of three particles, weights (1, −2, 1), along ropes.
    pub rods: Vec<([u32; 3], Bend<3>)>,
    /// Bends of four particles, about the common edges of triangles.
    pub hinges: Vec<([u32; 4], Bend<4>)>,
    /// The surface, counter-clockwise seen from outside or from the front. None of a rope.
    pub triangles: Vec<[u32; 3]>,
    /// How the particles are arranged.
    pub layout: Layout,
    /// Groups of particles that an artist painted or a closure chose, by name.
    pub painted: Vec<(String, Vec<u32>)>,
    /// By the name of a group the weight of each of its particles, in its order, 0 < w <= 1. Groups without weights have 1.
    ///
    /// An [`Attachment`](crate::nets::Attachment) of the group ties each particle with w times its stiffness.
    /// [`Pinned`](crate::Pinned) holds all of the group as it is: for pins, choose those above a weight by
    /// [`paint`](Self::paint).
    #[cfg_attr(feature = "serialize", serde(default))]
    pub weights: Vec<(String, Vec<f32>)>,
    /// How air acts on it.
    pub air: Air,
    /// The pressure of the gas inside at the rest volume, Pa above the surroundings. `None`: it encloses none.
    pub pressure: Option<f32>,
    /// Whether its particles do not collide with each other.
    #[cfg_attr(feature = "serialize", serde(default))]
    pub ignores_itself: bool,
    /// How the vertices of the user's mesh hang on the particles; `None` if there is no such mesh.
    pub binding: Option<MeshBinding>,
}

impl Topology {
    /// Whether it is a solid: cells with springs across them, of which the triangles are only the outside.
    pub fn is_solid(&self) -> bool {
        matches!(self.layout, Layout::Lattice { .. } | Layout::Cells)
    }

    /// The same, if it is [valid](Self::validate).
    pub(super) fn checked(self) -> Result<Self, NetError> {
        self.validate()?;
        Ok(self)
    }
}

/// How the particles of a net are arranged.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum Layout {
    /// No known arrangement.
    #[default]
    Free,
    /// A chain: particle i is joined to i + 1; the last to the first if it is closed.
    Rope {
        /// Whether it is a loop.
        is_closed: bool,
    },
    /// A grid of cells: particle (i, j) is number `j (cells[0] + 1) + i`.
    Grid {
        /// The number of cells along each axis.
        cells: [u32; 2],
    },
    /// A box of cells: particle (i, j, k) is number (k (ny + 1) + j) (nx + 1) + i.
    Lattice {
        /// The number of cells along each axis.
        cells: [u32; 3],
    },
    /// Some cells of a box, as where it fills a mesh: no known numbering.
    Cells,
}

/// The aerodynamic coefficients of a net.
#[derive(Reflect, Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[reflect(Default, Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serialize", reflect(Serialize, Deserialize))]
pub struct Air {
    /// Of the drag, on the area that faces the wind (cloths), or on length × diameter (ropes); >= 0.
    pub drag: f32,
    /// Of the lift, >= 0.
    pub lift: f32,
}

#[cfg(feature = "serialize")]
use bevy::reflect::{ReflectDeserialize, ReflectSerialize};

impl Air {
    /// Checks that both coefficients are finite and >= 0.
    ///
    /// # Errors
    /// Names the field at fault.
    pub fn validate(&self) -> Result<(), InvalidParameter> {
        parameter::non_negative("drag", self.drag)?;
        parameter::non_negative("lift", self.lift)
    }
}

impl Default for Air {
    fn default() -> Self {
        Self { drag: 1.0, lift: 0.0 }
    }
}

/// How the vertices of a mesh hang on the particles of a net.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum MeshBinding {
    /// Vertex v is at particle `self[v]`: vertices in the same place share one.
    Welded(Vec<u32>),
    /// Vertex v is the mean of four particles with weights that add up to 1 (the fourth is 1 − the other three): a
    /// fine mesh on a coarse lattice.
    Skinned(Vec<([u32; 4], [f32; 3])>),
}
