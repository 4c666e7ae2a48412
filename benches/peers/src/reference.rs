//! The reference: the classical Runge–Kutta method in f64, its step halved until the result converges.

use std::io::Result;
use std::path::PathBuf;

use bevy::math::{DVec3, Vec3};

use crate::scene::{GRAVITY, Scene, TICKS};

/// No particle moves by more than this when the step of the reference is halved, m.
const TOLERANCE: f64 = 1e-5;
/// Steps a tick that are tried first, and where halving ends.
const STEPS_A_TICK: std::ops::RangeInclusive<u32> = 16..=2048;

/// The positions after one second, from the cache if they are there.
pub fn positions(scene: &Scene) -> Result<Vec<DVec3>> {
    let file = cache_file(scene)?;
    if let Ok(bytes) = std::fs::read(&file) {
        return Ok(decode(&bytes));
    }
    let positions = converge(scene);
    std::fs::write(file, positions.iter().flat_map(encode).collect::<Vec<u8>>())?;
    Ok(positions)
}

/// The root of the mean square distance from `reference`, m.
pub fn root_mean_square_error(found: &[Vec3], reference: &[DVec3]) -> f64 {
    let squares = found.iter().zip(reference).map(|(found, truth)| found.as_dvec3().distance_squared(*truth));
    (squares.sum::<f64>() / reference.len() as f64).sqrt()
}

/// Beside the program, in the target folder.
fn cache_file(scene: &Scene) -> Result<PathBuf> {
    let folder = std::env::current_exe()?.with_file_name("references");
    std::fs::create_dir_all(&folder)?;
    Ok(folder.join(format!("{:016x}", scene.fingerprint())))
}

fn encode(position: &DVec3) -> Vec<u8> {
    position.to_array().into_iter().flat_map(f64::to_le_bytes).collect()
}

fn decode(bytes: &[u8]) -> Vec<DVec3> {
    let (numbers, _) = bytes.as_chunks::<8>();
    let numbers: Vec<f64> = numbers.iter().map(|number| f64::from_le_bytes(*number)).collect();
    numbers.as_chunks::<3>().0.iter().map(|position| DVec3::from_array(*position)).collect()
}

fn converge(scene: &Scene) -> Vec<DVec3> {
    let mut steps = *STEPS_A_TICK.start();
    let mut coarse = simulate(scene, steps);
    loop {
        steps *= 2;
        let fine = simulate(scene, steps);
        let distances = coarse.iter().zip(&fine).map(|(coarse, fine)| coarse.distance(*fine));
        // Not `f64::max`, which would overlook NaN.
        let change =
            distances.fold(0.0, |largest, distance| if distance <= largest { largest } else { distance });
        eprintln!("{}: reference, {steps} steps a tick, moved by {change:.1e} m", scene.name);
        if change < TOLERANCE {
            return fine;
        }
        assert!(steps < *STEPS_A_TICK.end(), "{}: the reference does not converge", scene.name);
        coarse = fine;
    }
}

fn simulate(scene: &Scene, steps_a_tick: u32) -> Vec<DVec3> {
    let step = 1.0 / (TICKS as f64 * f64::from(steps_a_tick));
    let system = System::new(scene);
    let mut state = State {
        positions: scene.positions.iter().map(|position| position.as_dvec3()).collect(),
        velocities: vec![DVec3::ZERO; scene.positions.len()],
    };
    for _ in 0..TICKS as u32 * steps_a_tick {
        system.advance(&mut state, step);
    }
    state.positions
}

#[derive(Clone)]
struct State {
    positions: Vec<DVec3>,
    velocities: Vec<DVec3>,
}

impl State {
    /// `self` + `step` · (`velocities`, `accelerations`)
    fn moved_by(&self, step: f64, velocities: &[DVec3], accelerations: &[DVec3]) -> Self {
        let sum = |values: &[DVec3], rates: &[DVec3]| {
            values.iter().zip(rates).map(|(value, rate)| *value + step * *rate).collect()
        };
        Self { positions: sum(&self.positions, velocities), velocities: sum(&self.velocities, accelerations) }
    }
}

/// The equations of motion of a scene, with the same f32 parameters as the peers.
struct System {
    inverse_masses: Vec<f64>,
    springs: Vec<([usize; 2], f64)>,
    stiffness: f64,
    damping: f64,
}

impl System {
    fn new(scene: &Scene) -> Self {
        let inverse_mass = |particle| match scene.inverse_mass(particle) {
            0.0 => 0.0,
            _ => 1.0 / f64::from(scene.mass),
        };
        Self {
            inverse_masses: (0..scene.positions.len()).map(inverse_mass).collect(),
            springs: scene.springs.iter().map(|ends| (*ends, f64::from(scene.rest_length(*ends)))).collect(),
            stiffness: f64::from(scene.stiffness),
            damping: f64::from(scene.damping),
        }
    }

    fn accelerations(&self, state: &State) -> Vec<DVec3> {
        let mut forces = vec![DVec3::ZERO; state.positions.len()];
        for &([first, second], rest_length) in &self.springs {
            let separation = state.positions[first] - state.positions[second];
            let relative_velocity = state.velocities[first] - state.velocities[second];
            let length = separation.length();
            let direction = separation / length;
            let tension =
                self.stiffness * (length - rest_length) + self.damping * relative_velocity.dot(direction);
            forces[first] -= tension * direction;
            forces[second] += tension * direction;
        }
        let gravity = GRAVITY.as_dvec3();
        for (force, &inverse_mass) in forces.iter_mut().zip(&self.inverse_masses) {
            *force = if inverse_mass > 0.0 { *force * inverse_mass + gravity } else { DVec3::ZERO };
        }
        forces
    }

    /// One step of the classical Runge–Kutta method (Kutta 1901).
    fn advance(&self, state: &mut State, step: f64) {
        let first = self.accelerations(state);
        let second_state = state.moved_by(step / 2.0, &state.velocities, &first);
        let second = self.accelerations(&second_state);
        let third_state = state.moved_by(step / 2.0, &second_state.velocities, &second);
        let third = self.accelerations(&third_state);
        let fourth_state = state.moved_by(step, &third_state.velocities, &third);
        let fourth = self.accelerations(&fourth_state);
        for particle in 0..first.len() {
            state.positions[particle] += step / 6.0
                * (state.velocities[particle]
                    + 2.0 * (second_state.velocities[particle] + third_state.velocities[particle])
                    + fourth_state.velocities[particle]);
            state.velocities[particle] += step / 6.0
                * (first[particle] + 2.0 * (second[particle] + third[particle]) + fourth[particle]);
        }
    }
}
