//! The connected components of a net, and which of them are stiff.

use super::super::integrators::Scheme;
use super::FrequencyBounds;
use super::tally::{Tally, rates};

/// What a tick runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Choice {
    /// The scheme of all particles, but for the stiff ones of a mixture.
    pub scheme: Scheme,
    /// Its substeps.
    pub substeps: u32,
    /// The steps that implicit Euler takes with the stiff components; 0 where one scheme advances all.
    pub stiff_substeps: u32,
    /// Springs in the stiff components; 0 where one scheme advances all.
    pub stiff_springs: usize,
}

impl From<(Scheme, u32)> for Choice {
    fn from((scheme, substeps): (Scheme, u32)) -> Self {
        Self { scheme, substeps, stiff_substeps: 0, stiff_springs: 0 }
    }
}

/// The parts of a net that springs join, with bounds on the frequencies of each.
///
/// Pinned particles connect nothing: what hangs on two sides of one moves independently. Nor do springs
/// without stiffness and damping. The particles without springs count together as one component.
#[derive(Debug, Clone, Default)]
pub struct Components {
    /// The component of each particle; [`NONE`] of a pinned one.
    numbers: Vec<u32>,
    /// The first is that of the particles without springs.
    components: Vec<Component>,
}

#[derive(Debug, Clone, Copy)]
struct Component {
    bounds: FrequencyBounds,
    springs: usize,
    is_stiff: bool,
}

/// The component of particles without springs.
const LONE: u32 = 0;

/// The component of a pinned particle.
const NONE: u32 = u32::MAX;

impl Components {
    /// The components of a net that is given as for [`FrequencyBounds::of`].
    pub fn of(
        inverse_mass: &[f32],
        springs: impl Iterator<Item = (usize, usize, f32, f32)> + Clone,
        viscosity: f32,
    ) -> Self {
        let acting = springs.filter(|&(.., stiffness, damping)| stiffness > 0.0 || damping > 0.0);
        let free = |particle: usize| inverse_mass[particle] > 0.0;
        let mut forest = Forest::new(inverse_mass.len());
        let mut joined = vec![false; inverse_mass.len()];
        let mut closing = Vec::new();
        for (first, second, ..) in acting.clone() {
            (joined[first], joined[second]) = (true, true);
            if free(first) && free(second) && !forest.join(first, second) {
                closing.push(first);
            }
        }
        let mut numbers = vec![NONE; inverse_mass.len()];
        let mut count = LONE;
        for particle in 0..inverse_mass.len() {
            let root = forest.root(particle);
            numbers[particle] = match (free(particle), joined[particle]) {
                (false, _) => NONE,
                (true, false) => LONE,
                (true, true) if root == particle => {
                    count += 1;
                    count
                }
                (true, true) => NONE,
            };
        }
        for particle in (0..inverse_mass.len()).filter(|particle| free(*particle)) {
            numbers[particle] = numbers[forest.root(particle)];
        }
        let mut tallies = vec![(Tally::default(), 0, false); count as usize + 1];
        for (&number, &inverse_mass) in
            numbers.iter().zip(inverse_mass).filter(|(number, _)| **number != NONE)
        {
            tallies[number as usize].0.add_particle(inverse_mass);
        }
        let rates = rates(inverse_mass, acting.clone());
        for (first, second, stiffness, damping) in acting {
            let number = numbers[first].min(numbers[second]);
            if number != NONE {
                let (tally, springs, _) = &mut tallies[number as usize];
                tally.add_spring([rates[first], rates[second]], stiffness, damping);
                *springs += 1;
            }
        }
        for particle in closing {
            tallies[numbers[particle] as usize].2 = true;
        }
        let components = tallies
            .into_iter()
            .map(|(tally, springs, has_loops)| Component {
                bounds: tally.bounds(viscosity, has_loops),
                springs,
                is_stiff: false,
            })
            .collect();
        Self { numbers, components }
    }

    /// What takes a tick of `time_step` seconds through well at the least cost, with `least` substeps at
    /// least. `whole` are bounds on the whole net: where all components that have springs want the same,
    /// what is [cheapest](FrequencyBounds::cheapest) for the whole is chosen.
    pub fn choose(&mut self, whole: &FrequencyBounds, time_step: f32, least: u32) -> Choice {
        let (mut stiff, mut soft) = (0, 0);
        let mut has_loops = false;
        let mut explicit = least;
        let mut stiff_springs = 0;
        for (number, component) in (0..).zip(&mut self.components) {
            let Component { bounds, springs, is_stiff } = component;
            *is_stiff = bounds.is_stiff(time_step, least);
            if *is_stiff {
                stiff += 1;
                stiff_springs += *springs;
                has_loops |= bounds.has_loops;
            } else {
                soft += u32::from(number != LONE);
                explicit = explicit.max(bounds.verlet_substeps(time_step));
            }
        }
        if soft == 0 {
            return whole.cheapest(time_step, least).into();
        }
        if stiff == 0 {
            let together = whole.cheapest(time_step, least);
            let is_explicit = together.0 != Scheme::ImplicitEuler;
            return if is_explicit { together } else { (Scheme::VelocityVerlet, explicit) }.into();
        }
        let implicit =
            FrequencyBounds { has_loops, ..*whole }.auto_substeps(Scheme::ImplicitEuler, time_step);
        let stiff_substeps = implicit.max(least);
        let substeps = explicit.next_multiple_of(stiff_substeps);
        Choice { scheme: Scheme::VelocityVerlet, substeps, stiff_substeps, stiff_springs }
    }

    /// The slots of the stiff components, as they were [chosen](Self::choose) last.
    pub fn stiff_slots(&self) -> impl Iterator<Item = usize> {
        let is_stiff = |number: u32| self.components.get(number as usize).is_some_and(|found| found.is_stiff);
        (0..).zip(&self.numbers).filter(move |(_, number)| is_stiff(**number)).map(|(slot, _)| slot)
    }
}

/// Disjoint sets of particles: each points to another one of its set, the root to itself.
struct Forest(Vec<usize>);

impl Forest {
    fn new(particles: usize) -> Self {
        Self((0..particles).collect())
    }

    fn root(&mut self, mut particle: usize) -> usize {
        let Self(parents) = self;
        while parents[particle] != particle {
            parents[particle] = parents[parents[particle]];
            particle = parents[particle];
        }
        particle
    }

    /// Unites the sets of two particles; says whether they were different ones.
    fn join(&mut self, first: usize, second: usize) -> bool {
        let (first, second) = (self.root(first), self.root(second));
        self.0[first] = second;
        first != second
    }
}

/// Whether springs with these ends close a loop among free particles.
pub(super) fn has_loops(inverse_mass: &[f32], springs: impl Iterator<Item = [usize; 2]>) -> bool {
    let mut forest = Forest::new(inverse_mass.len());
    springs
        .filter(|ends| ends.iter().all(|end| inverse_mass[*end] > 0.0))
        .any(|[first, second]| !forest.join(first, second))
}

#[cfg(test)]
mod tests {
    use super::*;

    const TIME_STEP: f32 = 1.0 / 64.0;

    /// ω = 890 rad/s at 1 kg, which takes 10 substeps of velocity Verlet: hω <= 1.4.
    const SOFT: f32 = 792_100.0;

    /// 1000 substeps.
    const STIFF: f32 = 7.921e9;

    fn choose(inverse_mass: &[f32], springs: &[(usize, usize, f32)]) -> (Choice, Vec<usize>) {
        let springs = || springs.iter().map(|&(first, second, stiffness)| (first, second, stiffness, 0.0));
        let whole = FrequencyBounds::of(inverse_mass, springs(), 0.0);
        let mut components = Components::of(inverse_mass, springs(), 0.0);
        let choice = components.choose(&whole, TIME_STEP, 1);
        (choice, components.stiff_slots().collect())
    }

    #[test]
    fn a_pinned_particle_connects_nothing() {
        // 1 and 2 hang on 0, 1 by a soft spring; 3 is alone.
        let (choice, stiff) = choose(&[0.0, 1.0, 1.0, 1.0], &[(0, 1, SOFT), (0, 2, STIFF)]);
        // 10 substeps, rounded up to a multiple of 4.
        let (scheme, substeps) = (Scheme::VelocityVerlet, 12);
        assert_eq!(choice, Choice { scheme, substeps, stiff_substeps: 4, stiff_springs: 1 });
        assert_eq!(stiff, [2]);
    }

    #[test]
    fn springs_that_join_free_particles_make_all_of_them_stiff() {
        let springs = [(0, 1, SOFT), (1, 2, 1.0), (2, 3, STIFF)];
        assert_eq!(choose(&[0.0, 1.0, 1.0, 1.0], &springs).0, (Scheme::ImplicitEuler, 4).into());
        // A spring that exerts no force joins nothing.
        let (choice, stiff) = choose(&[0.0, 1.0, 1.0, 1.0], &[(0, 1, SOFT), (1, 2, 0.0), (2, 3, STIFF)]);
        assert_eq!((choice.scheme, stiff), (Scheme::VelocityVerlet, vec![2, 3]));
    }

    #[test]
    fn where_all_agree_the_whole_net_decides() {
        let soft = choose(&[0.0, 1.0, 1.0], &[(0, 1, SOFT), (0, 2, 1.0)]);
        assert_eq!(soft, ((Scheme::VelocityVerlet, 10).into(), vec![]));
        // A particle without springs goes with those that have some.
        let stiff = choose(&[0.0, 1.0, 1.0, 1.0], &[(0, 1, STIFF), (0, 2, STIFF)]);
        assert_eq!(stiff.0, (Scheme::ImplicitEuler, 4).into());
    }

    #[test]
    fn a_stiff_sheet_takes_the_steps_of_sheets() {
        let springs = [(0, 1, SOFT), (2, 3, STIFF), (3, 4, STIFF), (4, 2, STIFF)];
        let (choice, stiff) = choose(&[0.0, 1.0, 1.0, 1.0, 1.0], &springs);
        assert_eq!((choice.substeps, choice.stiff_substeps, choice.stiff_springs), (10, 2, 3));
        assert_eq!(stiff, [2, 3, 4]);
    }

    #[test]
    fn what_the_medium_stops_at_once_is_stiff_too() {
        let springs = || [(0, 1, 1.0, 0.0)].into_iter();
        let inverse_mass = [0.0, 1.0, 1e6];
        let whole = FrequencyBounds::of(&inverse_mass, springs(), 0.1);
        let mut components = Components::of(&inverse_mass, springs(), 0.1);
        assert_eq!(components.choose(&whole, TIME_STEP, 1).substeps, 4);
        assert_eq!(components.stiff_slots().collect::<Vec<_>>(), [2]);
    }
}
