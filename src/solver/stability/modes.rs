//! The spectral radius of a step of each scheme for one mode, with which the tests compare the bounds.

use crate::solver::settings::Integrator;

/// The largest modulus of the eigenvalues of one step on the mode x'' = −ω² x − γ x'.
pub(super) fn spectral_radius(scheme: Integrator, omega: f64, gamma: f64, step: f64) -> f64 {
    let (a, g) = (step * step * omega * omega, step * gamma);
    // z solves z² + g z + a = 0: the eigenvalues of h times the exact system.
    let (trace, determinant) = match scheme {
        Integrator::ExplicitEuler => (2.0 - g, 1.0 - g + a),
        Integrator::SemiImplicitEuler => (2.0 - a - g, 1.0 - g),
        Integrator::SecondOrderTaylor => (2.0 - a / 2.0 - g, 1.0 - g + a / 2.0),
        Integrator::VelocityVerlet => return cubic_radius([a + 1.5 * g - 2.0, 1.0 - 2.0 * g, g / 2.0]),
        Integrator::RungeKutta4 => return runge_kutta_4_radius(a, g),
        Integrator::TrBdf2 => return tr_bdf2_radius(a, g),
        // One spring by itself is solved for exactly.
        Integrator::Auto | Integrator::ImplicitEuler | Integrator::Xpbd => {
            let denominator = 1.0 + g + a;
            ((2.0 + g) / denominator, 1.0 / denominator)
        }
    };
    quadratic_radius(trace, determinant)
}

/// The largest modulus of the roots of λ² − trace λ + determinant.
pub(super) fn quadratic_radius(trace: f64, determinant: f64) -> f64 {
    let discriminant = trace * trace / 4.0 - determinant;
    if discriminant < 0.0 {
        return determinant.sqrt();
    }
    (trace / 2.0).abs() + discriminant.sqrt()
}

/// The largest modulus of the roots of λ³ + b λ² + c λ + d.
fn cubic_radius([b, c, d]: [f64; 3]) -> f64 {
    // One is real, within Cauchy's bound; the other two follow when it is divided off.
    let bound = 1.0 + b.abs().max(c.abs()).max(d.abs());
    let (mut low, mut high) = (-bound, bound);
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        let value = ((middle + b) * middle + c) * middle + d;
        *(if value < 0.0 { &mut low } else { &mut high }) = middle;
    }
    let root = 0.5 * (low + high);
    root.abs().max(quadratic_radius(-(b + root), c + root * (b + root)))
}

fn runge_kutta_4_radius(a: f64, g: f64) -> f64 {
    let discriminant = g * g / 4.0 - a;
    let roots = if discriminant < 0.0 {
        [(-g / 2.0, (-discriminant).sqrt()); 2]
    } else {
        [(-g / 2.0 - discriminant.sqrt(), 0.0), (-g / 2.0 + discriminant.sqrt(), 0.0)]
    };
    let amplification = |(re, im): (f64, f64)| {
        // Horner's rule for 1 + z (1 + z/2 (1 + z/3 (1 + z/4))).
        let mut value = (1.0, 0.0);
        for divisor in [4.0, 3.0, 2.0, 1.0] {
            let product = (value.0 * re - value.1 * im, value.0 * im + value.1 * re);
            value = (1.0 + product.0 / divisor, product.1 / divisor);
        }
        f64::hypot(value.0, value.1)
    };
    roots.into_iter().map(amplification).fold(0.0, f64::max)
}

/// Of the two stages, with z in units of the step.
fn tr_bdf2_radius(a: f64, g: f64) -> f64 {
    let (s, w) = (1.0 - 0.5_f64.sqrt(), (2.0_f64.sqrt() - 1.0) / 2.0);
    // Backward Euler of s from (x, v): x' = x + s v', v' = v − s (a x' + g v').
    let solve = |[x, v]: [f64; 2]| {
        let v = (v - s * a * x) / (1.0 + s * g + s * s * a);
        [x + s * v, v]
    };
    let columns = [[1.0, 0.0], [0.0, 1.0]].map(|[x, v]| {
        let [xm, vm] = solve([x + s * v, v - s * (a * x + g * v)]);
        solve([(1.0 + w) * xm - w * x, (1.0 + w) * vm - w * v])
    });
    let [[xx, vx], [xv, vv]] = columns;
    quadratic_radius(xx + vv, xx * vv - xv * vx)
}
