//! Strength of springs: the tension at which they break, and the strain at which they yield.

use super::{Element, Elements, Spring};
use crate::solver::particles::Particles;
use crate::solver::state::Version;

/// How a spring yields: beyond a strain it stays longer, or shorter, than it was.
///
/// Perfect plasticity in one dimension, independent of the rate: with the length l and the rest length l0 the elastic
/// strain is e = l/l0 − 1 − p. It never exceeds the yield strain, as long as p, the plastic strain, has not reached its
/// limit; from there on the spring is elastic again.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
pub struct Plasticity {
    /// The elastic strain beyond which it yields, finite and >= 0.
    pub yield_strain: f32,
    /// The largest plastic strain either way, finite and >= 0. A spring is shortened by its whole rest length at most.
    pub max_strain: f32,
    /// The present plastic strain p, finite and >= -1: without force the spring is (1 + p) rest lengths long. The
    /// solver changes it. One that is beyond `max_strain` can only come back.
    pub strain: f32,
}

impl Plasticity {
    /// The plastic strain after the spring was `stretch` = l/l0 − 1 longer than its rest length.
    ///
    /// The return mapping of J. C. Simo and T. J. R. Hughes, *Computational Inelasticity* (1998), box 1.4, without
    /// hardening: what the trial e exceeds the yield strain by goes to p. Cables yield by tension alone.
    fn returned(self, stretch: f64, tension_only: bool) -> f32 {
        let [yield_strain, max_strain, strain] =
            [self.yield_strain, self.max_strain, self.strain].map(f64::from);
        let limits = [strain.min(-max_strain.min(1.0)), strain.max(max_strain)];
        let trial = stretch - strain;
        let beyond = trial.abs() - yield_strain;
        if beyond <= 0.0 || (tension_only && trial < 0.0) {
            return self.strain;
        }
        (strain + beyond.copysign(trial)).clamp(limits[0], limits[1]) as f32
    }
}

impl Spring {
    /// The length without force, m, what has yielded included.
    #[inline(always)]
    pub fn length_at_rest(&self) -> f32 {
        match self.plasticity {
            Some(Plasticity { strain, .. }) => self.rest_length * (1.0 + strain),
            None => self.rest_length,
        }
    }

    /// The plasticity on the way from this spring to another one, which has gone by `share` and has this rest length: the
    /// length without force goes evenly.
    pub(super) fn plasticity_between(
        &self,
        other: &Self,
        share: f32,
        rest_length: f32,
    ) -> Option<Plasticity> {
        let (Some(from), Some(to)) = (self.plasticity, other.plasticity) else { return other.plasticity };
        if from.strain == to.strain || rest_length == 0.0 {
            return other.plasticity;
        }
        let [start, end] = [self.rest_length * from.strain, other.rest_length * to.strain];
        Some(Plasticity { strain: ((start + share * (end - start)) / rest_length).max(-1.0), ..to })
    }

    /// The plastic strain that it has at this length, if it yields.
    pub(in crate::solver) fn yielded(&self, length: f64) -> Option<f32> {
        let plasticity = self.plasticity?;
        let rest_length = f64::from(self.rest_length);
        if rest_length == 0.0 {
            return None;
        }
        let strain = plasticity.returned(length / rest_length - 1.0, self.tension_only);
        (strain != plasticity.strain).then_some(strain)
    }
}

/// A break in a rope or tree, while its release travels through it: nothing else breaks there until then.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
pub(in crate::solver) struct Release {
    /// The slots of the ends of the spring that broke.
    pub slots: [u32; 2],
    /// How long it goes on, s.
    pub time_left: f32,
}

impl Release {
    /// Takes the slots `new_slots[old]`; false if a particle is gone.
    pub fn renumber(&mut self, new_slots: &[Option<u32>]) -> bool {
        let [first, second] = self.slots.map(|slot| new_slots.get(slot as usize).copied().flatten());
        let Some(slots) = first.zip(second) else { return false };
        self.slots = slots.into();
        true
    }
}

impl Elements {
    /// Changes when springs that may fail are added, removed or changed.
    pub(in crate::solver) fn failures_version(&self) -> Version {
        self.versions.failures
    }

    /// A spring's length, m, and its tension, N.
    pub(in crate::solver) fn measure_spring(&self, index: u32, particles: &Particles) -> [f64; 2] {
        let (ends, spring) = self.springs.with_ends(index as usize);
        let [position, velocity] = [&particles.position, &particles.velocity]
            .map(|vectors| vectors.get(ends[0]).as_dvec3() - vectors.get(ends[1]).as_dvec3());
        [position.length(), spring.tension(position, velocity)]
    }

    /// Empties the place of a spring within a tick: it acts no more, not even to the end of a ramp.
    pub(in crate::solver) fn break_spring(&mut self, index: u32) {
        let spring = self.springs.elements()[index as usize];
        self.springs.replace(index, |spring| *spring = spring.emptied());
        let new = Version::new();
        self.versions.all = new;
        (self.versions.rates, self.versions.ends, self.versions.failures) = (new, new, new);
        if spring.max_stretch.is_some() {
            self.versions.limits = new;
        }
    }

    /// Gives a spring another plastic strain within a tick. Where that is on a ramp the rest of the way stays as it is.
    pub(in crate::solver) fn deform_spring(&mut self, index: u32, strain: f32) {
        let old =
            self.springs.elements()[index as usize].plasticity.map_or(strain, |plasticity| plasticity.strain);
        self.springs.replace(index, |spring| {
            if let Some(plasticity) = &mut spring.plasticity {
                let is_here = plasticity.strain == old;
                plasticity.strain =
                    if is_here { strain } else { (plasticity.strain + strain - old).max(-1.0) };
            }
        });
        self.versions.all = Version::new();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WIRE: Plasticity = Plasticity { yield_strain: 0.125, max_strain: 0.5, strain: 0.0 };

    #[test]
    fn the_elastic_strain_never_exceeds_the_yield_strain() {
        // Numbers of few bits: exact.
        assert_eq!(WIRE.returned(0.125, false), 0.0);
        assert_eq!(WIRE.returned(0.25, false), 0.125);
        assert_eq!(WIRE.returned(-0.25, false), -0.125);
        assert_eq!(WIRE.returned(-0.25, true), 0.0);
        let stretched = Plasticity { strain: 0.25, ..WIRE };
        // Back by less than twice the yield strain: elastic. By more: it yields the other way.
        assert_eq!(stretched.returned(0.125, false), 0.25);
        assert_eq!(stretched.returned(0.0, false), 0.125);
        assert_eq!(stretched.returned(2.0, false), 0.5, "the limit");
        // A limit that was lowered: it goes no further, and comes back.
        let limited = Plasticity { max_strain: 0.0625, ..stretched };
        assert_eq!(limited.returned(2.0, false), 0.25);
        assert_eq!(limited.returned(0.0, false), 0.125);
        assert_eq!(limited.returned(-2.0, false), -0.0625);
    }

    #[test]
    fn a_yielded_spring_pulls_from_its_new_length_on() {
        let spring = Spring { rest_length: 2.0, stiffness: 100.0, ..Spring::default() };
        let wire = Spring { plasticity: Some(WIRE), ..spring };
        assert_eq!(wire.length_at_rest(), 2.0);
        let strain = wire.yielded(3.0).expect("a strain of 0.5");
        assert_eq!(strain, 0.375);
        let yielded = Spring { plasticity: Some(Plasticity { strain, ..WIRE }), ..wire };
        assert_eq!(yielded.length_at_rest(), 2.75);
        assert_eq!(yielded.tension(bevy::math::DVec3::X * 3.0, bevy::math::DVec3::ZERO), 25.0);
        assert_eq!(yielded.yielded(3.0), None);
        assert_eq!(Spring { rest_length: 0.0, ..wire }.yielded(3.0), None);
    }

    #[test]
    fn the_length_without_force_goes_evenly_to_another_one() {
        use crate::solver::elements::Element;
        let of = |rest_length, strain| {
            let plasticity = Some(Plasticity { strain, ..WIRE });
            Spring { rest_length, stiffness: 1.0, plasticity, ..Spring::default() }
        };
        let [from, to] = [of(1.0, 0.5), of(2.0, 0.25)];
        let halfway = from.between(&to, 0.5);
        assert_eq!((halfway.rest_length, halfway.length_at_rest()), (1.5, 2.0));
        assert_eq!(from.between(&of(2.0, 0.5), 0.5).plasticity, from.plasticity);
    }
}
