//! The equations of backward Euler, solved by brute force: Newton's method with a dense matrix that is
//! found by differences.

use bevy::math::DVec3;

use super::reference::Reference;

/// The positions after a step of `h` seconds: the x' for which v' = (x' − x)/h = v + h a(x', v'). The dampers begin with
/// these `lengths`.
pub fn solve(start: &Reference, lengths: &[f64], h: f64) -> Vec<DVec3> {
    let mut x: Vec<DVec3> = start
        .position
        .iter()
        .zip(&start.velocity)
        .map(|(position, velocity)| *position + h * *velocity)
        .collect();
    let free: Vec<usize> = (0..x.len()).filter(|slot| start.inverse_mass[*slot] > 0.0).collect();
    for _ in 0..60 {
        let residual = residual(start, lengths, &x, h);
        let mut rows: Vec<Vec<f64>> = Vec::new();
        for slot in &free {
            for axis in 0..3 {
                let nudge = 1e-7;
                let mut moved = x.clone();
                moved[*slot][axis] += nudge;
                let change = self::residual(start, lengths, &moved, h);
                rows.push(
                    free.iter()
                        .flat_map(|slot| ((change[*slot] - residual[*slot]) / nudge).to_array())
                        .collect(),
                );
            }
        }
        let right = free.iter().flat_map(|slot| (-residual[*slot]).to_array()).collect();
        let step = eliminate(transposed(rows), right);
        for (place, slot) in free.iter().enumerate() {
            x[*slot] += DVec3::from_slice(&step[3 * place..]);
        }
        if step.iter().all(|change| change.abs() < 1e-14) {
            break;
        }
    }
    x
}

/// x' − x − h v − h² a(x', v'), m: zero where the equations hold.
fn residual(start: &Reference, lengths: &[f64], x: &[DVec3], h: f64) -> Vec<DVec3> {
    let v: Vec<DVec3> = x.iter().zip(&start.position).map(|(new, old)| (*new - *old) / h).collect();
    // The dampers by their mean rate over the step; their own force is left out of the accelerations.
    let mut undamped = start.clone();
    for (spring, start) in undamped.springs.iter_mut().zip(lengths) {
        let [i, j] = spring.ends;
        let length = (x[i] - x[j]).length();
        let rate = (length - start) / h;
        // As a tension: k (l − l0) + c rate = k (l − (l0 − c rate / k)).
        spring.rest_length -= spring.damping * rate / spring.stiffness;
        spring.damping = 0.0;
    }
    let a = undamped.acceleration(x, &v);
    (0..x.len())
        .map(|slot| x[slot] - start.position[slot] - h * start.velocity[slot] - h * h * a[slot])
        .collect()
}

fn transposed(rows: Vec<Vec<f64>>) -> Vec<Vec<f64>> {
    (0..rows.len()).map(|column| rows.iter().map(|row| row[column]).collect()).collect()
}

/// Gauss's elimination with partial pivoting.
fn eliminate(mut matrix: Vec<Vec<f64>>, mut right: Vec<f64>) -> Vec<f64> {
    let count = right.len();
    for column in 0..count {
        let pivot = (column..count)
            .max_by(|one, other| matrix[*one][column].abs().total_cmp(&matrix[*other][column].abs()))
            .expect("there is a row left");
        matrix.swap(column, pivot);
        right.swap(column, pivot);
        let (done, below) = matrix.split_at_mut(column + 1);
        let pivot_row = &done[column];
        for (row, entries) in (column + 1..).zip(below) {
            let factor = entries[column] / pivot_row[column];
            for (entry, pivot_entry) in entries.iter_mut().zip(pivot_row).skip(column) {
                *entry -= factor * pivot_entry;
            }
            right[row] -= factor * right[column];
        }
    }
    for row in (0..count).rev() {
        let known: f64 = (row + 1..count).map(|column| matrix[row][column] * right[column]).sum();
        right[row] = (right[row] - known) / matrix[row][row];
    }
    right
}
