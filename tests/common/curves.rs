//! Curves along which ropes lie.

use bevy::math::Vec3;

/// Places along an overhand knot with long ends, evenly, `count` + 1 of them on `length` m: Shastri's polynomial trefoil,
/// (t³ − 3t, t⁴ − 4t², t⁵ − 10t), flattened.
pub fn overhand(length: f32, count: usize) -> Vec<Vec3> {
    let fine: Vec<Vec3> = (0..=20_000)
        .map(|number| {
            let t = -2.35 + 4.7 * number as f32 / 20_000.0;
            let (square, cube) = (t * t, t * t * t);
            Vec3::new(cube - 3.0 * t, square * square - 4.0 * square, 0.25 * (cube * square - 10.0 * t))
        })
        .collect();
    let total: f32 = fine.windows(2).map(|pair| pair[0].distance(pair[1])).sum();
    let scale = length / total;
    let (mut places, mut walked) = (vec![fine[0] * scale], 0.0);
    for pair in fine.windows(2) {
        walked += pair[0].distance(pair[1]);
        if walked >= total * places.len() as f32 / count as f32 && places.len() < count {
            places.push(pair[1] * scale);
        }
    }
    places.push(fine[fine.len() - 1] * scale);
    places
}
