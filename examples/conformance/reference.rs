//! The reference: the same equations in f64, without code of the crate, solved to convergence.

use bevy::math::DVec3;

use crate::net::{GRAVITY, Net, root_mean_square};

/// A motion and its uncertainty.
pub struct Reference {
    /// Positions at the end, m.
    pub position: Vec<DVec3>,
    /// Root of the mean square distance to the end with half as many steps, m. The error of a method of
    /// fourth order is about a fifteenth of that.
    pub uncertainty: f64,
    /// The number of steps.
    pub steps: usize,
}

/// Runs `net` for `seconds` by the classical Runge–Kutta method, with twice as many steps each time
/// until the uncertainty is at most `tolerance` (m).
pub fn motion(net: &Net, seconds: f64, tolerance: f64) -> Reference {
    let mut steps = least_steps(net, seconds);
    let run = |steps: usize| {
        let mut net = net.clone();
        advance(&mut net, seconds, steps);
        net.position
    };
    let mut coarse = run(steps);
    loop {
        steps *= 2;
        assert!(steps < 1 << 22, "the reference does not converge to {tolerance} m");
        let position = run(steps);
        let uncertainty = root_mean_square(&position, &coarse);
        if uncertainty <= tolerance {
            return Reference { position, uncertainty, steps };
        }
        coarse = position;
    }
}

/// A stable number of steps: half of the bound of 2.6 on the imaginary and on the real axis.
pub fn least_steps(net: &Net, seconds: f64) -> usize {
    let bounds = net.frequency_bounds();
    let fastest = bounds.angular_frequency.max(bounds.damping_rate);
    (seconds * fastest / 1.3).ceil().max(8.0) as usize
}

/// The classical Runge–Kutta method.
pub fn advance(net: &mut Net, seconds: f64, steps: usize) {
    let h = seconds / steps as f64;
    let count = net.position.len();
    let mut acceleration = vec![DVec3::ZERO; count];
    for _ in 0..steps {
        let (mut x, mut v) = (net.position.clone(), net.velocity.clone());
        let (mut moved, mut gained) = (vec![DVec3::ZERO; count], vec![DVec3::ZERO; count]);
        // How far ahead the next stage looks, and the weight of this one.
        for (ahead, weight) in [(0.5, 1.0), (0.5, 2.0), (1.0, 2.0), (0.0, 1.0)] {
            accelerations(net, &x, &v, &mut acceleration);
            for slot in 0..count {
                moved[slot] += weight * v[slot];
                gained[slot] += weight * acceleration[slot];
                x[slot] = net.position[slot] + ahead * h * v[slot];
                v[slot] = net.velocity[slot] + ahead * h * acceleration[slot];
            }
        }
        for slot in 0..count {
            net.position[slot] += h / 6.0 * moved[slot];
            net.velocity[slot] += h / 6.0 * gained[slot];
        }
    }
}

/// Newton's second law with Hooke's law, the damper's and the medium's.
fn accelerations(net: &Net, x: &[DVec3], v: &[DVec3], a: &mut [DVec3]) {
    a.fill(DVec3::ZERO);
    for link in &net.links {
        let [i, j] = link.ends;
        let separation = x[i] - x[j];
        let length = separation.length();
        let direction = separation / length;
        let pull = link.stiffness * (length - link.rest_length) + link.damping * (v[i] - v[j]).dot(direction);
        a[i] -= pull * direction;
        a[j] += pull * direction;
    }
    for ((a, v), inverse_mass) in a.iter_mut().zip(v).zip(&net.inverse_mass) {
        *a = match *inverse_mass {
            0.0 => DVec3::ZERO,
            inverse => (*a - net.viscosity * *v) * inverse + GRAVITY * DVec3::NEG_Y,
        };
    }
    if let Some(slot) = net.on_ground {
        assert!(a[slot].y < 0.0, "what slides on the ground is lifted off it");
        a[slot].y = 0.0;
    }
}
