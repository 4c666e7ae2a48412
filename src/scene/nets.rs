//! The nets of a scene: ropes, cloths, jellies and balloons in the units of their data sheets.

use bevy::math::Vec3;
use serde::{Deserialize, Serialize};

use crate::nets::{Balloon, Jelly};
use crate::parameter::{self, InvalidParameter};

/// One net. Its particles come after those of the scene's list and of the nets before it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename = "Net", deny_unknown_fields)]
#[non_exhaustive]
pub enum SceneNet {
    /// A rope from `from` to `to`, particles 0 to `segments` in this order.
    Rope {
        /// The place of the first particle, m.
        from: Vec3,
        /// The place of the last particle, m, different from the first.
        to: Vec3,
        /// The number of springs, >= 1.
        segments: u32,
        /// Half of its thickness, m, >= 0. Default 0: it collides with colliders only.
        #[serde(default)]
        radius: f32,
        /// Its mass by length, kg/m, > 0.
        linear_density: f32,
        /// EA, N, > 0: a rope of length l that is pulled by F lengthens by F l / EA.
        stretch_stiffness: f32,
        /// EI, N·m², >= 0. Default 0.
        #[serde(default)]
        bending_stiffness: f32,
        /// τ, s, >= 0 (Kelvin–Voigt): every damping is τ times its stiffness. Default 0.
        #[serde(default)]
        retardation_time: f32,
        /// Whether its springs only pull. Default false.
        #[serde(default)]
        tension_only: bool,
        /// The strain limit of its springs, >= 0. Default none.
        #[serde(default)]
        max_stretch: Option<f32>,
        /// The tension at which a spring of it breaks, N, >= 0. Default: never.
        #[serde(default)]
        breaking_force: Option<f32>,
        /// The particles that are pinned, by their numbers in the net. Default none.
        #[serde(default)]
        pinned: Vec<u32>,
    },
    /// A cloth: particle (i, j), at corner + i/nx width + j/ny height, is number j (nx + 1) + i.
    Cloth {
        /// The place of particle 0, m.
        corner: Vec3,
        /// From there to particle nx, m.
        width: Vec3,
        /// From there to particle ny (nx + 1), m; not along `width`.
        height: Vec3,
        /// The number of cells (nx, ny), each >= 1.
        cells: (u32, u32),
        /// Half of its thickness, m, >= 0. Default 0.
        #[serde(default)]
        radius: f32,
        /// Its mass by area, kg/m², > 0.
        area_density: f32,
        /// K, N/m, > 0: a strip of width w pulled by F, its sides free, lengthens by F l / (w K).
        stretch_stiffness: f32,
        /// N/m, > 0.
        shear_stiffness: f32,
        /// D, N·m, >= 0: a strip of width w under a moment M, its sides free, bends by M / (w D). Default 0.
        #[serde(default)]
        bending_stiffness: f32,
        /// τ, s, >= 0 (Kelvin–Voigt). Default 0.
        #[serde(default)]
        retardation_time: f32,
        /// The strain limit of its springs, >= 0. Default none.
        #[serde(default)]
        max_stretch: Option<f32>,
        /// The strain at which a spring of it breaks, >= 0. Default: never.
        #[serde(default)]
        breaking_strain: Option<f32>,
        /// The particles that are pinned, by their numbers in the net. Default none.
        #[serde(default)]
        pinned: Vec<u32>,
        /// The coefficient of its drag, >= 0. Default 1.
        #[serde(default = "one")]
        drag_coefficient: f32,
        /// The coefficient of its lift, >= 0. Default 0.
        #[serde(default)]
        lift_coefficient: f32,
        /// Whether its particles collide with each other, where particles collide at all. Default true.
        #[serde(default = "yes")]
        self_collision: bool,
    },
    /// A box of jelly: particle (i, j, k) is number (k (ny + 1) + j) (nx + 1) + i.
    Jelly {
        /// The corner with the least coordinates, m.
        min: Vec3,
        /// The opposite corner, m.
        max: Vec3,
        /// The number of cells (nx, ny, nz), each >= 1.
        cells: (u32, u32, u32),
        /// The radius of its particles, m, >= 0. Default 0.
        #[serde(default)]
        radius: f32,
        /// Its mass by volume, kg/m³, > 0.
        density: f32,
        /// Young's modulus, Pa, > 0. Poisson's ratio is 1/4.
        youngs_modulus: f32,
        /// τ, s, >= 0 (Kelvin–Voigt). Default 0.
        #[serde(default)]
        retardation_time: f32,
        /// The particles that are pinned, by their numbers in the net. Default none.
        #[serde(default)]
        pinned: Vec<u32>,
    },
    /// A balloon: a sphere of membrane around gas, p V of which is constant.
    Balloon {
        /// Its centre, m.
        centre: Vec3,
        /// Its radius at rest, m, > 0.
        radius: f32,
        /// How often the triangles of an icosahedron are divided into four. At most 8.
        subdivisions: u32,
        /// Of the membrane, m, >= 0: its particles collide with half of it as their radius. Default 0.
        #[serde(default)]
        thickness: f32,
        /// The mass of the membrane by area, kg/m², > 0.
        area_density: f32,
        /// K of the membrane, N/m, > 0.
        stretch_stiffness: f32,
        /// p, Pa above the surroundings, at the volume at rest, > 0.
        pressure: f32,
        /// τ, s, >= 0 (Kelvin–Voigt). Default 0.
        #[serde(default)]
        retardation_time: f32,
    },
}

fn one() -> f32 {
    1.0
}

fn yes() -> bool {
    true
}

/// Number of particles of a scene's net from which on it is refused.
const MAX_PARTICLES: u64 = 1 << 24;

fn refuse<T: std::fmt::Debug>(
    field: &'static str,
    value: T,
    expected: &'static str,
) -> Result<(), InvalidParameter> {
    Err(InvalidParameter { field, value: format!("{value:?}"), expected })
}

fn cells(count: &[u32], value: impl std::fmt::Debug) -> Result<(), InvalidParameter> {
    if count.contains(&0) {
        return refuse("cells", value, "numbers >= 1");
    }
    let particles = count.iter().fold(1_u64, |product, cells| product.saturating_mul(u64::from(*cells) + 1));
    if particles > MAX_PARTICLES {
        return refuse("cells", value, "fewer than 2^24 particles");
    }
    Ok(())
}

/// The number of corners of a lattice with these numbers of cells along its axes.
fn lattice(cells: &[u32]) -> usize {
    cells.iter().fold(1, |product: usize, cells| product.saturating_mul(*cells as usize + 1))
}

fn optional(field: &'static str, value: Option<f32>) -> Result<(), InvalidParameter> {
    value.map_or(Ok(()), |value| parameter::non_negative(field, value))
}

impl SceneNet {
    /// Which kind of net it is, in lower case: `rope`, `cloth`, `jelly` or `balloon`.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Rope { .. } => "rope",
            Self::Cloth { .. } => "cloth",
            Self::Jelly { .. } => "jelly",
            Self::Balloon { .. } => "balloon",
        }
    }

    /// The number of its particles.
    pub fn particle_count(&self) -> usize {
        match *self {
            Self::Rope { segments, .. } => segments as usize + 1,
            Self::Cloth { cells: (x, y), .. } => lattice(&[x, y]),
            Self::Jelly { cells: (x, y, z), .. } => lattice(&[x, y, z]),
            Self::Balloon { subdivisions, .. } => {
                10 * 4_usize.pow(subdivisions.min(Balloon::MAX_SUBDIVISIONS)) + 2
            }
        }
    }

    /// The particles that are pinned.
    pub fn pinned(&self) -> &[u32] {
        match self {
            Self::Rope { pinned, .. } | Self::Cloth { pinned, .. } | Self::Jelly { pinned, .. } => pinned,
            Self::Balloon { .. } => &[],
        }
    }

    /// Checks every value.
    ///
    /// # Errors
    /// Names the first field at fault.
    pub fn validate(&self) -> Result<(), InvalidParameter> {
        self.check_shape()?;
        self.check_material()?;
        match self.missing_pin() {
            Some(place) => refuse("pinned", self.pinned()[place], "the index of a particle of the net"),
            None => Ok(()),
        }
    }

    /// The place in `pinned` of the first index that is of no particle of the net.
    pub(super) fn missing_pin(&self) -> Option<usize> {
        let count = self.particle_count();
        self.pinned().iter().position(|pinned| *pinned as usize >= count)
    }

    fn check_shape(&self) -> Result<(), InvalidParameter> {
        match *self {
            Self::Rope { from, to, segments, .. } => {
                parameter::finite("from", from)?;
                parameter::finite("to", to)?;
                if from == to {
                    return refuse("to", to.to_array(), "another place than `from`");
                }
                if segments == 0 || u64::from(segments) >= MAX_PARTICLES {
                    return refuse("segments", segments, "a number from 1 to 2^24");
                }
                Ok(())
            }
            Self::Cloth { corner, width, height, cells: (x, y), .. } => {
                parameter::finite("corner", corner)?;
                parameter::finite("width", width)?;
                parameter::finite("height", height)?;
                cells(&[x, y], (x, y))?;
                let (wide, high) = (width.as_dvec3(), height.as_dvec3());
                if wide.length() == 0.0 {
                    return refuse("width", width.to_array(), "a vector that is not zero");
                }
                // Directions that differ by less than the rounding of f32 span no area.
                if wide.cross(high).length() <= 1e-6 * wide.length() * high.length() {
                    return refuse("height", height.to_array(), "a vector that is not along `width`");
                }
                Ok(())
            }
            Self::Jelly { min, max, cells: (x, y, z), .. } => {
                parameter::finite("min", min)?;
                parameter::finite("max", max)?;
                if min.cmpge(max).any() {
                    return refuse(
                        "max",
                        max.to_array(),
                        "coordinates that are all greater than those of `min`",
                    );
                }
                cells(&[x, y, z], (x, y, z))?;
                if [x, y, z].into_iter().map(u64::from).product::<u64>() > Jelly::MAX_CELLS.into() {
                    return refuse("cells", (x, y, z), "at most 2^21 cells in all");
                }
                Ok(())
            }
            Self::Balloon { centre, radius, subdivisions, .. } => {
                parameter::finite("centre", centre)?;
                parameter::positive("radius", radius)?;
                if subdivisions > Balloon::MAX_SUBDIVISIONS {
                    return refuse("subdivisions", subdivisions, "a number from 0 to 8");
                }
                Ok(())
            }
        }
    }

    fn check_material(&self) -> Result<(), InvalidParameter> {
        match *self {
            Self::Rope {
                radius,
                linear_density,
                stretch_stiffness,
                bending_stiffness,
                retardation_time,
                max_stretch,
                breaking_force,
                ..
            } => {
                parameter::non_negative("radius", radius)?;
                parameter::positive("linear_density", linear_density)?;
                parameter::positive("stretch_stiffness", stretch_stiffness)?;
                parameter::non_negative("bending_stiffness", bending_stiffness)?;
                parameter::non_negative("retardation_time", retardation_time)?;
                optional("max_stretch", max_stretch)?;
                optional("breaking_force", breaking_force)
            }
            Self::Cloth {
                radius,
                area_density,
                stretch_stiffness,
                shear_stiffness,
                bending_stiffness,
                retardation_time,
                max_stretch,
                breaking_strain,
                drag_coefficient,
                lift_coefficient,
                ..
            } => {
                parameter::non_negative("radius", radius)?;
                parameter::positive("area_density", area_density)?;
                parameter::positive("stretch_stiffness", stretch_stiffness)?;
                parameter::positive("shear_stiffness", shear_stiffness)?;
                parameter::non_negative("bending_stiffness", bending_stiffness)?;
                parameter::non_negative("retardation_time", retardation_time)?;
                optional("max_stretch", max_stretch)?;
                optional("breaking_strain", breaking_strain)?;
                parameter::non_negative("drag_coefficient", drag_coefficient)?;
                parameter::non_negative("lift_coefficient", lift_coefficient)
            }
            Self::Jelly { radius, density, youngs_modulus, retardation_time, .. } => {
                parameter::non_negative("radius", radius)?;
                parameter::positive("density", density)?;
                parameter::positive("youngs_modulus", youngs_modulus)?;
                parameter::non_negative("retardation_time", retardation_time)
            }
            Self::Balloon {
                thickness, area_density, stretch_stiffness, pressure, retardation_time, ..
            } => {
                parameter::non_negative("thickness", thickness)?;
                parameter::positive("area_density", area_density)?;
                parameter::positive("stretch_stiffness", stretch_stiffness)?;
                parameter::positive("pressure", pressure)?;
                parameter::non_negative("retardation_time", retardation_time)
            }
        }
    }
}
