//! Gusts: a smooth, random velocity field, carried along by the wind ("frozen turbulence", Taylor 1938) while it turns
//! slowly into another one.
//!
//! Value noise (Perlin, *Improving noise*, SIGGRAPH 2002, for the fifth-degree interpolation): random vectors on the
//! corners of a lattice, blended in place and time. Of integers, sums and products alone, so that the bits are the same on
//! every machine.

use bevy::math::{DVec3, Vec3};

use crate::solver::settings::Gusts;

/// What has passed since the simulation began; a part of the state.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct AirClock {
    /// s
    time: f64,
    /// How far the wind has carried the air, m.
    drift: DVec3,
}

impl AirClock {
    pub fn advance(&mut self, wind: Vec3, time_step: f32) {
        self.time += f64::from(time_step);
        self.drift += wind.as_dvec3() * f64::from(time_step);
    }
}

/// The field at one time, and the corners of the cell that was asked for last: neighbours are often in one.
pub(super) struct GustField {
    gusts: Gusts,
    drift: DVec3,
    /// The whole part of the time in [`Gusts::time`], and the share of the way to the next.
    tick: i64,
    share: f64,
    cell: Option<[i64; 3]>,
    corners: [DVec3; 8],
}

impl GustField {
    pub fn new(gusts: Gusts, clock: AirClock) -> Self {
        let time = clock.time / f64::from(gusts.time);
        let tick = time.floor();
        let share = smooth(time - tick);
        Self { gusts, drift: clock.drift, tick: tick as i64, share, cell: None, corners: Default::default() }
    }

    /// The gust at a place of the world (m), m/s.
    pub fn at(&mut self, place: DVec3) -> Vec3 {
        let place = (place - self.drift) / f64::from(self.gusts.length);
        let floor = place.floor();
        let cell = floor.to_array().map(|coordinate| coordinate as i64);
        if self.cell != Some(cell) {
            self.cell = Some(cell);
            for (number, corner) in self.corners.iter_mut().enumerate() {
                let of = |axis: usize| cell[axis].wrapping_add((number >> axis & 1) as i64);
                let at = |tick: i64| random([of(0), of(1), of(2), tick], self.gusts.seed);
                *corner = at(self.tick).lerp(at(self.tick.wrapping_add(1)), self.share);
            }
        }
        let [x, y, z] = (place - floor).to_array().map(smooth);
        let along_x = |first: usize| self.corners[first].lerp(self.corners[first + 1], x);
        let along_y = |first: usize| along_x(first).lerp(along_x(first + 2), y);
        let value = along_y(0).lerp(along_y(4), z).as_vec3();
        value * self.gusts.strength
    }
}

/// 6 t⁵ − 15 t⁴ + 10 t³.
fn smooth(t: f64) -> f64 {
    t * t * t * (t * (t * 6.0 - 15.0) + 10.0)
}

/// A vector of three numbers from −1 to 1, from a mixer of integers (Steele, Lea and Flood, *Fast splittable
/// pseudorandom number generators*, OOPSLA 2014).
fn random(key: [i64; 4], seed: u32) -> DVec3 {
    let mut mixed = u64::from(seed);
    for part in key {
        mixed = mix(mixed ^ part as u64);
    }
    let part = |shift: u32| ((mixed >> shift & 0x1f_ffff) as f64) * (2.0 / f64::from(0x1f_ffff)) - 1.0;
    DVec3::new(part(0), part(21), part(42))
}

fn mix(value: u64) -> u64 {
    let value = value.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let value = (value ^ (value >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let value = (value ^ (value >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    value ^ (value >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    const GUSTS: Gusts = Gusts { strength: Vec3::new(2.0, 1.0, 0.0), length: 3.0, time: 2.0, seed: 7 };

    fn clock(ticks: usize) -> AirClock {
        let mut clock = AirClock::default();
        (0..ticks).for_each(|_| clock.advance(Vec3::X, 1.0 / 64.0));
        clock
    }

    /// The steepest that the interpolation gets is 15/8, times the difference of two corners, at most 2.
    #[test]
    fn gusts_are_smooth_bounded_and_different_from_place_to_place() {
        let mut field = GustField::new(GUSTS, clock(37));
        let (mut last, mut least, mut most) = (None::<Vec3>, Vec3::INFINITY, Vec3::NEG_INFINITY);
        for step in 0..4000 {
            let gust = field.at(DVec3::new(0.01, -0.006, 0.003) * f64::from(step));
            assert!(gust.abs().cmple(GUSTS.strength).all(), "{gust}");
            if let Some(last) = last {
                let slope = 1.875 * 2.0 / GUSTS.length * 0.019 * GUSTS.strength;
                assert!((gust - last).abs().cmple(slope).all(), "{gust} after {last}");
            }
            (last, least, most) = (Some(gust), least.min(gust), most.max(gust));
        }
        assert!((most - least).x > 1.5 && (most - least).y > 0.75, "{least} to {most}");
    }

    #[test]
    fn the_wind_carries_them_along_and_time_changes_them() {
        let frozen = Gusts { time: 1e9, ..GUSTS };
        let place = DVec3::new(0.3, -4.0, 2.0);
        let at = |gusts: Gusts, ticks: usize, place: DVec3| GustField::new(gusts, clock(ticks)).at(place);
        let carried = at(frozen, 128, place + DVec3::X * 2.0);
        assert!((at(frozen, 0, place) - carried).length() < 1e-5);
        assert!((at(GUSTS, 0, place) - at(GUSTS, 128, place + DVec3::X * 2.0)).length() > 0.05);
        assert_ne!(at(GUSTS, 0, place), at(Gusts { seed: 8, ..GUSTS }, 0, place));
    }
}
