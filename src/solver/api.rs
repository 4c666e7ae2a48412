//! The public interface of the solver: checks its arguments.

use bevy::math::Vec3;

use crate::solver::collision::Collider;
use crate::solver::elements::{Bend, Elements, Holds, Spring};
use crate::solver::energy::{Measurements, measure};
use crate::solver::outputs::Outputs;
use crate::solver::particles::PinnedMotion;
use crate::solver::settings::StepSettings;
use crate::solver::stability::{FrequencyBounds, Plan};
use crate::solver::state::State;
use crate::solver::step::{Caches, Inputs, step};
use crate::solver::validation::{check, check_bend, inverse, non_negative};

/// Particles joined by springs, without Bevy's ECS.
///
/// Particles and springs are known by their numbers, in the order in which they were added.
#[derive(Debug, Clone, Default)]
pub struct Solver {
    pub(super) state: State,
    inputs: Inputs,
    caches: Caches,
    outputs: Outputs,
}

/// What a [`Solver`] refuses.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SolverError {
    /// A number is outside its range.
    #[error("{field} is {value}, expected {expected}")]
    OutOfRange {
        /// The name of the parameter.
        field: &'static str,
        /// What was given.
        value: f32,
        /// What would have been accepted.
        expected: &'static str,
    },
    /// The triangles around a gas are not a closed surface with one side outside.
    #[error(
        "the surface around a gas is not closed: its edge from particle {} to {} is not the edge of one other triangle, \
         in the other direction", edge[0], edge[1]
    )]
    NotClosed {
        /// The ends of the edge.
        edge: [usize; 2],
    },
    /// An element to a particle that does not exist.
    #[error("an end is particle {particle}, expected less than {count}")]
    MissingParticle {
        /// The number that was given.
        particle: usize,
        /// The number of particles.
        count: usize,
    },
    /// An element two ends of which are one particle.
    #[error("two ends are particle {particle}")]
    Loop {
        /// The particle.
        particle: usize,
    },
}

impl Solver {
    /// Adds a particle: position in m, velocity in m/s, mass in kg (`f32::INFINITY`: pinned), radius in m. Returns
    /// its number.
    ///
    /// # Errors
    /// If the mass is not > 0, or the radius not finite and >= 0.
    pub fn add_particle(
        &mut self,
        position: Vec3,
        velocity: Vec3,
        mass: f32,
        radius: f32,
    ) -> Result<usize, SolverError> {
        non_negative("radius", radius)?;
        self.state.add_particle(position, velocity, inverse(mass)?, radius);
        Ok(self.particle_count() - 1)
    }

    /// Adds a spring between two different particles. Returns its number.
    ///
    /// # Errors
    /// If an end does not exist, both are the same, or a parameter is not finite and >= 0.
    pub fn add_spring(&mut self, ends: [usize; 2], spring: Spring) -> Result<usize, SolverError> {
        check(spring)?;
        let count = self.particle_count();
        if let Some(&particle) = ends.iter().find(|end| **end >= count) {
            return Err(SolverError::MissingParticle { particle, count });
        }
        if ends[0] == ends[1] {
            return Err(SolverError::Loop { particle: ends[0] });
        }
        Ok(self.state.add_spring(ends, spring))
    }

    /// Adds a bend of three particles, as along a rod. Returns its number among those.
    ///
    /// # Errors
    /// If an end does not exist, two are the same, a parameter is not finite and >= 0, or the weights do not add up
    /// to 0.
    pub fn add_rod(&mut self, ends: [usize; 3], bend: Bend<3>) -> Result<usize, SolverError> {
        self.add_bend(ends, bend)
    }

    /// Adds a bend of four particles, as about the hinge of two triangles. Returns its number among those.
    ///
    /// # Errors
    /// As [`add_rod`](Self::add_rod).
    pub fn add_hinge(&mut self, ends: [usize; 4], bend: Bend<4>) -> Result<usize, SolverError> {
        self.add_bend(ends, bend)
    }

    fn add_bend<const N: usize>(&mut self, ends: [usize; N], bend: Bend<N>) -> Result<usize, SolverError>
    where
        Elements: Holds<Bend<N>, N>,
    {
        check_bend(&bend)?;
        let count = self.particle_count();
        if let Some(&particle) = ends.iter().find(|end| **end >= count) {
            return Err(SolverError::MissingParticle { particle, count });
        }
        for (index, &particle) in ends.iter().enumerate() {
            if ends[..index].contains(&particle) {
                return Err(SolverError::Loop { particle });
            }
        }
        Ok(self.state.add_bend(ends, bend))
    }

    /// Changes the parameters of a bend of three particles, which go there as those of a
    /// [spring](Self::set_spring) do; weights change at once. Where there is no such bend nothing changes.
    ///
    /// # Errors
    /// If a parameter is not finite and >= 0, or the weights do not add up to 0.
    pub fn set_rod(&mut self, number: usize, bend: Bend<3>) -> Result<(), SolverError> {
        check_bend(&bend)?;
        self.state.set_bend(number, bend);
        Ok(())
    }

    /// Changes the parameters of a bend of four particles: see [`set_rod`](Self::set_rod).
    ///
    /// # Errors
    /// As [`set_rod`](Self::set_rod).
    pub fn set_hinge(&mut self, number: usize, bend: Bend<4>) -> Result<(), SolverError> {
        check_bend(&bend)?;
        self.state.set_bend(number, bend);
        Ok(())
    }

    /// Removes a bend of three particles; the others keep their numbers.
    pub fn remove_rod(&mut self, number: usize) {
        self.state.remove_bend::<3>(number);
    }

    /// Removes a bend of four particles; the others keep their numbers.
    pub fn remove_hinge(&mut self, number: usize) {
        self.state.remove_bend::<4>(number);
    }

    /// Changes the parameters of a spring. In the next tick rest length, stiffness and damping go there in equal
    /// parts, substep by substep.
    ///
    /// # Errors
    /// If a parameter is not finite and >= 0.
    ///
    /// # Panics
    /// If there is no such spring.
    pub fn set_spring(&mut self, number: usize, spring: Spring) -> Result<(), SolverError> {
        check(spring)?;
        self.state.set_spring(number, spring);
        Ok(())
    }

    /// Removes a spring; the others keep their numbers.
    ///
    /// # Panics
    /// If there is no such spring.
    pub fn remove_spring(&mut self, number: usize) {
        self.state.remove_spring(number);
    }

    /// Changes the mass of a particle, kg; `f32::INFINITY` pins it.
    ///
    /// # Errors
    /// If the mass is not > 0.
    ///
    /// # Panics
    /// If there is no such particle.
    pub fn set_mass(&mut self, number: usize, mass: f32) -> Result<(), SolverError> {
        self.state.set_particle(number, inverse(mass)?, self.radius(number));
        Ok(())
    }

    /// Changes the radius of a particle, m.
    ///
    /// # Errors
    /// If the radius is not finite and >= 0.
    ///
    /// # Panics
    /// If there is no such particle.
    pub fn set_radius(&mut self, number: usize, radius: f32) -> Result<(), SolverError> {
        non_negative("radius", radius)?;
        self.state.set_particle(number, self.inverse_mass(number), radius);
        Ok(())
    }

    /// Puts a particle to `position`, m, without a motion from where it was.
    pub fn set_position(&mut self, number: usize, position: Vec3) {
        self.state.teleport(number, position);
    }

    /// Changes the velocity of a particle, m/s.
    pub fn set_velocity(&mut self, number: usize, velocity: Vec3) {
        self.state.particles.velocity.set(number, velocity);
    }

    /// Changes the force that pushes a particle from now on, N.
    pub fn set_applied_force(&mut self, number: usize, force: Vec3) {
        self.state.particles.applied_force.set(number, force);
    }

    /// The motions of pinned particles and the colliders, to be changed freely between ticks.
    pub fn inputs_mut(&mut self) -> &mut Inputs {
        &mut self.inputs
    }

    /// Adds a collider; its number.
    pub fn add_collider(&mut self, collider: Collider) -> usize {
        self.inputs.colliders.push(collider);
        self.inputs.colliders.len() - 1
    }

    /// Sends a pinned particle to `target`, m, in each tick from now on: it arrives in the next one and stays.
    ///
    /// # Panics
    /// If there is no such particle.
    pub fn move_pinned(&mut self, number: usize, target: Vec3) {
        let motion = PinnedMotion { slot: number, start: self.position(number), target };
        self.inputs.pinned.retain(|other| other.slot != number);
        self.inputs.pinned.push(motion);
    }

    /// Advances everything by a tick.
    pub fn step(&mut self, settings: &StepSettings) -> &Outputs {
        let count = self.particle_count();
        self.inputs.pinned.retain(|motion| motion.slot < count);
        step(&mut self.state, &self.inputs, &mut self.caches, &mut self.outputs, settings);
        for motion in &mut self.inputs.pinned {
            motion.start = motion.target;
        }
        &self.outputs
    }

    /// What the last tick published.
    pub fn outputs(&self) -> &Outputs {
        &self.outputs
    }

    /// What the next ticks are to publish: see the fields `record_…`.
    pub fn outputs_mut(&mut self) -> &mut Outputs {
        &mut self.outputs
    }

    /// What a tick with these settings would run where no nets touch: those that do, or will, take the same scheme.
    pub fn plan(&mut self, settings: &StepSettings) -> Plan {
        self.state.elements.begin_ramps();
        self.caches.plan(&self.state, settings)
    }

    /// Bounds on the frequencies of the whole net in a medium of `viscosity` N·s/m.
    pub fn frequency_bounds(&mut self, viscosity: f32) -> FrequencyBounds {
        self.state.elements.begin_ramps();
        self.caches.frequency_bounds(&self.state, viscosity)
    }

    /// Energies, momentum and extremes in the gravity field `gravity`, m/s².
    pub fn measure(&self, gravity: Vec3) -> Measurements {
        measure(&self.state, gravity)
    }

    /// The state, on which the next ticks depend: a copy of it is a snapshot.
    pub fn state(&self) -> &State {
        &self.state
    }

    /// Puts a state back, or that of another solver. With the same colliders and motions of pinned particles, what
    /// follows is to the bit what followed there. Motions begin where the state has the particles; those of
    /// particles that it lacks end.
    pub fn restore(&mut self, state: State) {
        self.state = state;
        self.inputs.pinned.retain(|motion| motion.slot < self.state.particles.len());
        for motion in &mut self.inputs.pinned {
            motion.start = self.state.particles.position.get(motion.slot);
        }
    }

    /// Drops all that is derived from the state. It changes no result.
    pub fn drop_caches(&mut self) {
        self.caches = Caches::default();
    }

    /// The number of particles.
    pub fn particle_count(&self) -> usize {
        self.state.particles.len()
    }

    /// The number of springs, removed ones included.
    pub fn spring_count(&self) -> usize {
        self.state.spring_count()
    }

    /// The position of a particle, m.
    pub fn position(&self, number: usize) -> Vec3 {
        self.state.particles.position.get(number)
    }

    /// The velocity of a particle, m/s.
    pub fn velocity(&self, number: usize) -> Vec3 {
        self.state.particles.velocity.get(number)
    }

    /// 1 / mass of a particle, 1/kg; 0 if it is pinned.
    pub fn inverse_mass(&self, number: usize) -> f32 {
        self.state.particles.own_inverse_mass()[number]
    }

    /// The radius of a particle, m.
    pub fn radius(&self, number: usize) -> f32 {
        self.state.particles.radius()[number]
    }

    /// Whether a particle sleeps.
    pub fn is_asleep(&self, number: usize) -> bool {
        self.state.is_asleep(number)
    }

    /// The number of particles that sleep.
    pub fn asleep_count(&self) -> usize {
        self.state.asleep_count()
    }

    /// The force that pushes a particle, N.
    pub fn applied_force(&self, number: usize) -> Vec3 {
        self.state.particles.applied_force.get(number)
    }

    /// The ends and parameters of a spring; those of a removed one are zero.
    pub fn spring(&self, number: usize) -> ([usize; 2], Spring) {
        self.state.spring_with_ends(number)
    }
}
