//! How much rope a winch with a greatest force takes in within a tick: a law of numbers, apart from nets.
//!
//! Within a tick of h seconds the winch is to turn so far that the tension at its end is the greatest force F, and no
//! farther. What the tension will be depends on what hangs on the rope. Only the motion of that is known: a load that is
//! tied, pressed or stuck to something moves as that does. So the end of the rope counts as a wall that goes on as it went:
//! it comes nearer by
//!
//! ```text
//! d = w h + g
//! ```
//!
//! with w the speed at which the way along the rope became shorter at the end of the last tick, and g by how much more it did
//! so in that tick than the speed before it would have made it: the load is accelerated. A real load gives way to what pulls
//! at it, and is pulled with less than F; the next tick has that in g. A load that is fixed has d = 0.
//!
//! What is taken in beyond d strains the rope: x metres by no more than
//!
//! ```text
//! ΔT = (k + 2 Z / h) x,    1/k = Σ 1/(kᵢ + cᵢ / h),    Z = √(EA μ)
//! ```
//!
//! k is that of the links in series, with their dampers; Z the tension per speed of a wave that runs along a rope of stretch
//! stiffness EA and linear density μ. A rope between a winch and a wall that is taken in at the speed u from rest has
//! the tension Z u at once, and 2 Z u more whenever the wave is back: never more than 2 Z u + k u t. A stiff rope has passed many
//! waves in a tick, and 2 Z / h is small beside k; of one so soft that none is back it is the half that the reflected wave adds.
//!
//! Of a rope with the strain ε at the winch, 1 m that comes in is 1 / (1 + ε) m of rest length. Together
//!
//! ```text
//! x = (d + (F − T) / (k + 2 Z / h)) / (1 + ε)
//! ```
//!
//! at most v h. What is slack is taken in at v, too. Negative, with a load that is stopped or falls, it pays out what the last
//! tick took in, and no more: a brake holds what the motor does not.

/// Below this part of its greatest force a winch takes in what is slack: rope that is longer than the straight way to its
/// end.
const SLACK: f64 = 0.1;

/// A winch that would turn more slowly than this part of its speed stands still.
const STANDSTILL: f64 = 1e-4;

/// What a winch pulls at, at the end of a tick.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Load {
    /// The particle at the end of the rope: the next one that is held, that before a link that is broken, or the last one.
    pub end: u32,
    /// Whether that is held.
    pub is_held: bool,
    /// The tension at the winch, N, or that of the whole rope if it is greater; >= 0.
    pub tension: f64,
    /// The tension of the whole rope: its elongation times its stiffness, N.
    pub mean: f64,
    /// The length of the way along the rope from the winch to its end, m.
    pub way: f64,
    /// The rate at which that becomes shorter, m/s.
    pub approach: f64,
    /// The rate at which the straight way to its end does, m/s.
    pub closing: f64,
    /// The rate at which the first link does, m/s: the speed at which rope arrives at the winch.
    pub inflow: f64,
    /// By how much the way became shorter in the last tick beyond what it would have by its rate before, m.
    pub gain: f64,
}

/// The rope outside, as it is to be in the coming tick.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Outside {
    /// The stiffness of its links in series, N/m: 1 / Σ 1/kᵢ.
    pub stiffness: f64,
    /// The greatest stiffness that it may oppose with to what is taken in within a tick, its dampers included, N/m.
    pub opposed: f64,
    /// EA, N.
    pub stretch_stiffness: f64,
    /// μ, kg/m.
    pub linear_density: f64,
    /// By how much its rest length exceeds the straight way from the winch to its end, m; negative if it is less.
    pub excess: f64,
}

/// What a winch with a greatest force keeps from tick to tick.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Haul {
    /// What it pulled at when the last tick ended; `None` before the first one, and of a rope that is broken at the winch.
    pub load: Option<Load>,
    /// The way along the rope that is expected at the end of the tick if its end goes on at its speed, m.
    expected: Option<f64>,
    /// What the last turn took in and was not paid out since, m, >= 0.
    pulled: f64,
}

impl Haul {
    /// Notes what it pulls at when a tick has ended.
    pub fn note(&mut self, load: Option<Load>) {
        let expected = self.expected.take();
        let gain = |load: &Load| match expected {
            Some(expected) if !load.is_held => expected - load.way,
            _ => 0.0,
        };
        self.load = load.filter(|load| load.way.is_finite() && load.approach.is_finite());
        self.load = self.load.map(|load| Load { gain: gain(&load), ..load });
    }

    /// The winch pays out, or stands still by itself.
    pub fn release(&mut self) {
        (self.expected, self.pulled) = (None, 0.0);
    }

    /// How much it takes in within the coming tick of `time_step` s, m, of the `wanted` v h, with a greatest force, N.
    pub fn take_in(&mut self, wanted: f64, force: f64, time_step: f64, (load, rope): (Load, Outside)) -> f64 {
        let Load { tension, mean, way, approach, closing, inflow, gain, .. } = load;
        let comes = approach * time_step + gain;
        // Half of what is slack in a tick at most: a rope that is nearly straight is the faster across the less of it is left.
        let slack = 0.5 * rope.excess.max(0.0);
        // What arrives at the winch comes as fast as the end, unless the rope is strained or slackens between them; what is slack
        // comes until it is straight.
        let straight = closing * time_step + slack;
        let arrives = comes.min(inflow * time_step + gain).min(straight + gain).max(0.0);
        // Waves go as they came: paid out again is only what strains the whole rope. To answer a wave by a turn when it has
        // passed would feed the next one.
        let lasting = if tension > force { mean.clamp(force, tension) } else { tension };
        let left = force - lasting - rope.stiffness * (-comes).max(0.0);
        let impedance = (rope.stretch_stiffness * rope.linear_density).sqrt();
        let opposed = rope.opposed + 2.0 * impedance / time_step;
        let mut taken = (arrives + left / opposed) / (1.0 + tension / rope.stretch_stiffness);
        if tension < SLACK * force {
            taken = taken.max(slack);
        }
        taken = taken.clamp(-self.pulled, wanted);
        if taken.is_nan() || taken.abs() < STANDSTILL * wanted {
            taken = 0.0;
        }
        self.expected = Some(way - approach * time_step);
        self.pulled = if taken < 0.0 { self.pulled + taken } else { taken };
        taken
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FORCE: f64 = 100.0;
    const STEP: f64 = 0.02;

    /// A string between the winch and a wall, as d'Alembert has it: a wave that goes out is the one that comes in and Z u,
    /// and comes in after 2 L / c. In ticks that are a part of that, the tension comes to the greatest force, and exceeds it
    /// by no more than waves differ by that nothing damps.
    #[test]
    fn waves_between_winch_and_wall_stay_below_the_greatest_force() {
        let impedance = 4.0;
        for delay in [1, 2, 5, 20] {
            for wanted in [0.01, 0.3] {
                // k = EA / L = Z c / L.
                let stiffness = 2.0 * impedance / (delay as f64 * STEP);
                // Long enough that its strain is small: Z² = EA μ.
                let rope = Outside {
                    stiffness,
                    opposed: stiffness,
                    stretch_stiffness: 1e9,
                    linear_density: impedance * impedance / 1e9,
                    excess: -1.0,
                };
                let (mut haul, mut waves, mut taken) = (Haul::default(), vec![0.0; delay], 0.0);
                let (mut tension, mut speed) = (0.0_f64, 0.0);
                for tick in 0..40_000 {
                    let mean = stiffness * taken;
                    let load = Load {
                        tension: tension.max(mean),
                        mean,
                        way: 10.0,
                        inflow: speed,
                        ..Load::default()
                    };
                    let by = haul.take_in(wanted * STEP, FORCE, STEP, (load, rope));
                    (taken, speed) = (taken + by, by / STEP);
                    let arriving = waves[tick % delay];
                    waves[tick % delay] = arriving + impedance * speed;
                    tension = 2.0 * arriving + impedance * speed;
                    assert!(tension < FORCE * 1.02, "{delay}, {wanted}, tick {tick}: {tension} N");
                }
                assert!(tension > 0.98 * FORCE, "{delay}, {wanted}: {tension} N");
            }
        }
    }

    /// A load that goes as the rope goes, as in long ticks with a stiff one, has the tension W + m Δu / h. It is accelerated
    /// by (F − W) / m, though its mass is not known.
    #[test]
    fn a_load_of_unknown_mass_is_accelerated_by_what_force_is_left() {
        let (mass, weight) = (5.0, 60.0);
        // (ω h)² = 10.
        let stiffness = 10.0 * mass / (STEP * STEP);
        let rope = Outside {
            stiffness,
            opposed: stiffness,
            stretch_stiffness: 1e12,
            linear_density: 0.0,
            excess: -1.0,
        };
        let mut haul = Haul::default();
        let (mut load, mut speed, mut gained) =
            (Load { tension: weight, way: 10.0, ..Load::default() }, 0.0, 0.0);
        for _ in 0..200 {
            let taken = haul.take_in(40.0 * STEP, FORCE, STEP, (load, rope));
            gained = taken / STEP - speed;
            speed += gained;
            let tension = weight + mass * gained / STEP;
            assert!(tension < FORCE * 1.000_001, "{tension} N");
            haul.note(Some(Load {
                tension,
                way: load.way - taken,
                approach: speed,
                closing: speed,
                inflow: speed,
                ..load
            }));
            load = haul.load.unwrap();
        }
        assert!((gained / STEP / ((FORCE - weight) / mass) - 1.0).abs() < 1e-3, "{} m/s²", gained / STEP);
    }

    /// What a stop within a tick strains the rope by is paid out again, and nothing else is.
    #[test]
    fn what_was_taken_in_too_much_is_paid_out_again() {
        let rope = Outside {
            stiffness: 1e4,
            opposed: 1e4,
            stretch_stiffness: 1e9,
            linear_density: 0.0,
            excess: -1.0,
        };
        let wanted = 0.02;
        let free = Load { way: 10.0, approach: 1.0, closing: 1.0, inflow: 1.0, ..Load::default() };
        let mut haul = Haul::default();
        assert_eq!(haul.take_in(wanted, FORCE, STEP, (free, rope)), wanted);
        // It stood still all the tick: 200 N. Half of it goes out.
        let stopped = Load { tension: 200.0, mean: 200.0, way: 10.0, ..Load::default() };
        let out = haul.take_in(wanted, FORCE, STEP, (stopped, rope));
        assert!((out + 0.01).abs() < 1e-6, "{out}");
        // A load that is too heavy has the rest, and no more.
        let out: f64 = (0..9).map(|_| haul.take_in(wanted, FORCE, STEP, (stopped, rope))).sum();
        assert!((out + 0.01).abs() < 1e-6, "{out}");
    }
}
