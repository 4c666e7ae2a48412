//! The rules of a scene: which values are refused, and how the field at fault is named.

use std::fmt;
use std::time::Duration;

use super::description::{MassSpringScene, SceneBend, ScenePlane, SceneSolver, SceneSpring};
use super::error::{SceneError, SceneErrorReason};
use super::recipes::SceneLayout;
use crate::collider::ParticleCollider;
use crate::parameter::{self, InvalidParameter};
use crate::particle::Particle;
use crate::settings::SubstepMode;

/// A step from the root of a scene towards one of its fields.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Step {
    Field(&'static str),
    Index(usize),
}

/// The way from the root of a scene to one of its fields. Prints as `particles[3].mass`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Path(pub Vec<Step>);

impl fmt::Display for Path {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (depth, step) in self.0.iter().enumerate() {
            match step {
                Step::Field(name) if depth == 0 => write!(formatter, "{name}")?,
                Step::Field(name) => write!(formatter, ".{name}")?,
                Step::Index(index) => write!(formatter, "[{index}]")?,
            }
        }
        Ok(())
    }
}

/// The first violated rule of a scene, and the field at fault.
pub(super) struct Fault {
    pub path: Path,
    pub reason: SceneErrorReason,
}

impl Fault {
    fn new(parents: &[Step], invalid: InvalidParameter) -> Self {
        let InvalidParameter { field, value, expected } = invalid;
        Self::with_expected(parents, field, value, expected.to_owned())
    }

    fn with_expected(parents: &[Step], field: &'static str, value: String, expected: String) -> Self {
        Self::at(Path([parents, &[Step::Field(field)]].concat()), value, expected)
    }

    fn at(path: Path, value: String, expected: String) -> Self {
        Self { reason: SceneErrorReason::OutOfRange { field: path.to_string(), value, expected }, path }
    }
}

impl SceneSolver {
    /// The time step as Bevy's clock counts it: rounded to whole nanoseconds.
    ///
    /// # Errors
    /// If the time step is not finite and > 0, or rounds to nothing or to more than the clock counts
    /// (about 6e11 years).
    pub fn tick(&self) -> Result<Duration, InvalidParameter> {
        let refuse = |expected| InvalidParameter {
            field: "time_step",
            value: format!("{:?}", self.time_step),
            expected,
        };
        if !(self.time_step.is_finite() && self.time_step > 0.0) {
            return Err(refuse("a finite number of seconds > 0"));
        }
        match Duration::try_from_secs_f64(self.time_step) {
            Ok(tick) if !tick.is_zero() => Ok(tick),
            _ => Err(refuse("a number of seconds that Bevy's clock of whole nanoseconds can count")),
        }
    }
}

impl MassSpringScene {
    /// Checks every value of the scene. A scene from [`from_ron`](Self::from_ron) or
    /// [`read`](Self::read) has passed already.
    ///
    /// # Errors
    /// Names index and field of the first value at fault.
    pub fn validate(&self) -> Result<(), SceneError> {
        self.first_fault().map_err(|fault| fault.reason.into())
    }

    pub(super) fn first_fault(&self) -> Result<(), Fault> {
        self.check_settings()?;
        for (index, particle) in self.particles.iter().enumerate() {
            let parents = [Step::Field("particles"), Step::Index(index)];
            parameter::finite("position", particle.position)
                .and_then(|()| parameter::finite("velocity", particle.velocity))
                .and_then(|()| Particle::new(particle.mass, particle.radius).validate())
                .map_err(|invalid| Fault::new(&parents, invalid))?;
        }
        let layout = self.check_nets()?;
        for (index, spring) in self.springs.iter().enumerate() {
            self.check_spring(index, spring, &layout)?;
        }
        for (index, bend) in self.bends.iter().enumerate() {
            self.check_bend(index, bend)?;
        }
        for (index, plane) in self.planes.iter().enumerate() {
            let parents = [Step::Field("planes"), Step::Index(index)];
            check_plane(plane).map_err(|invalid| Fault::new(&parents, invalid))?;
        }
        for (index, collider) in self.colliders.iter().enumerate() {
            let parents = [Step::Field("colliders"), Step::Index(index)];
            collider.validate().map_err(|invalid| Fault::new(&parents, invalid))?;
            let shape = [&parents[..], &[Step::Field("shape")]].concat();
            collider.shape.validate().map_err(|invalid| Fault::new(&shape, invalid))?;
        }
        Ok(())
    }

    fn check_settings(&self) -> Result<(), Fault> {
        let environment = [Step::Field("environment")];
        if let Some(gusts) = self.environment.gusts {
            let parents = [&environment[..], &[Step::Field("gusts")]].concat();
            gusts.validate().map_err(|invalid| Fault::new(&parents, invalid))?;
        }
        self.environment.validate().map_err(|invalid| Fault::new(&environment, invalid))?;
        let solver = [Step::Field("solver")];
        self.solver.tick().map_err(|invalid| Fault::new(&solver, invalid))?;
        if self.solver.substeps == SubstepMode::Fixed(0) {
            let expected = "Auto or Fixed(n) with n >= 1".to_owned();
            return Err(Fault::with_expected(&solver, "substeps", "Fixed(0)".to_owned(), expected));
        }
        self.collisions.validate().map_err(|invalid| Fault::new(&[Step::Field("collisions")], invalid))
    }

    /// Checks the nets, and lays them out.
    fn check_nets(&self) -> Result<SceneLayout, Fault> {
        for (index, net) in self.nets.iter().enumerate() {
            let parents = [Step::Field("nets"), Step::Index(index)];
            net.validate().map_err(|invalid| match net.missing_pin() {
                Some(place) if invalid.field == "pinned" => {
                    let path = [&parents[..], &[Step::Field("pinned"), Step::Index(place)]].concat();
                    Fault::at(Path(path), invalid.value, invalid.expected.to_owned())
                }
                _ => Fault::new(&parents, invalid),
            })?;
        }
        self.lay_out().map_err(|(index, source)| {
            let path = Path(vec![Step::Field("nets"), Step::Index(index)]);
            Fault {
                reason: SceneErrorReason::Net { field: path.to_string(), source: Box::new(source) },
                path,
            }
        })
    }

    /// What an index that is in no list should have been.
    fn expected_indices(&self, number: &str) -> String {
        let (count, of_list) = (self.particle_count(), self.particles.len());
        if count == of_list {
            return format!("{number} indices into the list of {count} particles, the first of which is 0");
        }
        format!("{number} indices of the {count} particles, those of nets included, the first of which is 0")
    }

    fn check_spring(&self, index: usize, spring: &SceneSpring, layout: &SceneLayout) -> Result<(), Fault> {
        let parents = [Step::Field("springs"), Step::Index(index)];
        let refuse = |expected| {
            let ends = format!("{:?}", spring.particles);
            Err(Fault::with_expected(&parents, "particles", ends, expected))
        };
        let (first, second) = spring.particles;
        if first.max(second) >= layout.positions.len() {
            return refuse(self.expected_indices("two"));
        }
        if first == second {
            return refuse("the indices of two different particles".to_owned());
        }
        // An omitted rest length is checked as well: the distance of two ends may be too great for f32.
        let rest_length = layout.rest_length(spring).unwrap_or_default();
        parameter::non_negative("rest_length", rest_length)
            .and_then(|()| parameter::non_negative("stiffness", spring.stiffness))
            .and_then(|()| parameter::non_negative("damping", spring.damping))
            .and_then(|()| {
                spring.max_stretch.map_or(Ok(()), |limit| parameter::non_negative("max_stretch", limit))
            })
            .and_then(|()| {
                let force = spring.breaking_force;
                force.map_or(Ok(()), |force| parameter::non_negative("breaking_force", force))
            })
            .map_err(|invalid| Fault::new(&parents, invalid))
    }
}

impl MassSpringScene {
    fn check_bend(&self, index: usize, bend: &SceneBend) -> Result<(), Fault> {
        let parents = [Step::Field("bends"), Step::Index(index)];
        let refuse = |expected| {
            let ends = format!("{:?}", bend.particles);
            Err(Fault::with_expected(&parents, "particles", ends, expected))
        };
        let (first, middle, last) = bend.particles;
        if first.max(middle).max(last) >= self.particle_count() {
            return refuse(self.expected_indices("three"));
        }
        if first == middle || middle == last || last == first {
            return refuse("the indices of three different particles".to_owned());
        }
        parameter::non_negative("stiffness", bend.stiffness)
            .and_then(|()| parameter::non_negative("damping", bend.damping))
            .map_err(|invalid| Fault::new(&parents, invalid))
    }
}

fn check_plane(plane: &ScenePlane) -> Result<(), InvalidParameter> {
    parameter::finite("point", plane.point)?;
    parameter::finite("normal", plane.normal)?;
    if plane.unit_normal().is_none() {
        let value = format!("{:?}", plane.normal.to_array());
        return Err(InvalidParameter { field: "normal", value, expected: "a vector that is not zero" });
    }
    ParticleCollider::half_space()
        .with_restitution(plane.restitution)
        .with_friction(plane.friction)
        .validate()
}
