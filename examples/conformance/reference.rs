//! What is true: the same equations in f64, with nothing of the crate in them, solved until it does not
//! matter how.

use bevy::math::DVec3;

use crate::net::{GRAVITY, Net, root_mean_square};

/// A motion, and how sure it is.
pub struct Reference {
    /// Positions at the end, m.
    pub position: Vec<DVec3>,
    /// Root of the mean square distance to the end with half as many steps, m. The error of a method of
    /// fourth order is about a fifteenth of that.
    pub doubt: f64,
    /// The number of steps.
    pub steps: usize,
}

/// Runs `net` for `seconds` by the classical Runge–Kutta method, with twice as many steps each time
/// until the doubt is at most `tolerance` (m).
pub fn motion(net: &Net, seconds: f64, tolerance: f64) -> Reference {
    let bounds = net.frequency_bounds();
    // Stable: half of 2.6 on the imaginary and on the real axis.
    let fastest = bounds.angular_frequency.max(bounds.damping_rate);
    let mut steps = (seconds * fastest / 1.3).ceil().max(8.0) as usize;
    let mut coarse = runge_kutta(net, seconds, steps);
    loop {
        steps *= 2;
        let position = runge_kutta(net, seconds, steps);
        let doubt = root_mean_square(&position, &coarse);
        if doubt <= tolerance {
            return Reference { position, doubt, steps };
        }
        coarse = position;
    }
}

fn runge_kutta(net: &Net, seconds: f64, steps: usize) -> Vec<DVec3> {
    let h = seconds / steps as f64;
    let (mut x, mut v) = (net.position.clone(), net.velocity.clone());
    let count = x.len();
    let mut a = [(); 4].map(|()| vec![DVec3::ZERO; count]);
    let mut stage = (x.clone(), v.clone());
    for _ in 0..steps {
        let mut moved = vec![DVec3::ZERO; count];
        let mut gained = vec![DVec3::ZERO; count];
        for (part, (ahead, weight)) in
            [(0.0, 1.0), (0.5, 2.0), (0.5, 2.0), (1.0, 1.0)].into_iter().enumerate()
        {
            if part > 0 {
                // The slopes of the positions are the velocities of the stage before.
                for slot in 0..count {
                    stage.0[slot] = x[slot] + ahead * h * stage.1[slot];
                    stage.1[slot] = v[slot] + ahead * h * a[part - 1][slot];
                }
            } else {
                stage.0.clone_from(&x);
                stage.1.clone_from(&v);
            }
            accelerations(net, &stage.0, &stage.1, &mut a[part]);
            for slot in 0..count {
                moved[slot] += weight * stage.1[slot];
                gained[slot] += weight * a[part][slot];
            }
        }
        for slot in 0..count {
            x[slot] += h / 6.0 * moved[slot];
            v[slot] += h / 6.0 * gained[slot];
        }
    }
    x
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
}
