//! Which scheme advances each island in a tick, and in how many substeps.

use super::gas::GasBounds;
use super::surface::SurfaceCosts;
use super::tally::Tally;
use super::{FrequencyBounds, SECOND_ORDER_SUBSTEPS, cost};
use crate::solver::elements::{Elements, Exposed};
use crate::solver::graph::{Island, IslandSet, Islands, for_each_coupling, has_loops};
use crate::solver::particles::Particles;
use crate::solver::settings::{Integrator, StepSettings, SubstepMode};
use crate::solver::state::Version;

/// What a tick runs.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Plan {
    /// The scheme of all particles but those of the stiff islands; never [`Integrator::Auto`] in the plan of a
    /// tick.
    pub integrator: Integrator,
    /// Its substeps.
    pub substeps: u32,
    /// The steps that TR-BDF2 takes with the stiff islands beside it; 0 where one scheme advances all.
    pub stiff_substeps: u32,
    /// Number of springs of the stiff islands; 0 where one scheme advances all.
    pub stiff_springs: usize,
}

impl From<(Integrator, u32)> for Plan {
    fn from((integrator, substeps): (Integrator, u32)) -> Self {
        Self { integrator, substeps, ..Self::default() }
    }
}

impl Plan {
    /// Whether an implicit scheme advances any island.
    pub(in crate::solver) fn is_implicit(&self) -> bool {
        self.stiff_substeps > 0 || self.integrator.is_implicit()
    }

    /// Whether a step of it begins with the substep of this `index`.
    pub(in crate::solver) fn begins_implicit_step(&self, index: u32) -> bool {
        let steps = if self.stiff_substeps > 0 { self.stiff_substeps } else { self.substeps };
        self.is_implicit() && index.is_multiple_of(self.substeps / steps)
    }

    /// The part of the tick that is done after a number of substeps.
    pub(in crate::solver) fn elapsed(&self, substeps: u32) -> f32 {
        if substeps == self.substeps { 1.0 } else { substeps as f32 / self.substeps as f32 }
    }
}

/// Makes plans; the bounds that they follow from are computed again only when these have changed.
#[derive(Debug, Clone, Default)]
pub(in crate::solver) struct Planner {
    /// Of everything, and without gases.
    bounds: FrequencyBounds,
    element_bounds: FrequencyBounds,
    gas_bounds: GasBounds,
    surfaces: SurfaceCosts,
    bounds_key: Option<Key>,
    /// Whether the equations of any island are not solved directly, and of which elements and free particles that is.
    has_loops: (bool, Option<(Version, Version)>),
    islands: Islands,
    /// Bounds of each island, and of the free particles in none.
    island_bounds: (Vec<FrequencyBounds>, FrequencyBounds),
    island_key: Option<Key>,
    stiff: IslandSet,
    /// Working memory: what a tick of each island costs, and the islands sorted by its substeps.
    island_costs: Vec<IslandCost>,
    sorted: Vec<u32>,
}

/// What a tick of an island takes.
#[derive(Debug, Clone, Copy)]
struct IslandCost {
    /// Substeps of velocity Verlet.
    substeps: u32,
    /// Whether rounding would heat it.
    is_too_fast: bool,
    elements: usize,
    /// What air and gases take in a substep, ns.
    surface: f64,
    /// The cost of the implicit scheme, see [`cost`].
    implicit: f64,
}

/// What bounds depend on.
type Key = (Version, Version, Option<Version>, u32);

/// Without viscosity a particle without elements matters to no bound.
fn key(elements: &Elements, particles: &Particles, viscosity: f32) -> Key {
    let added = (viscosity > 0.0).then(|| particles.added_version());
    (elements.rates_version(), particles.mass_version(), added, viscosity.to_bits())
}

impl Planner {
    /// The plan of a tick.
    pub fn plan(
        &mut self,
        (elements, exposed): (&Elements, &Exposed),
        particles: &Particles,
        settings: &StepSettings,
    ) -> Plan {
        let StepSettings { integrator, substeps, time_step, viscosity, .. } = *settings;
        let minimum = substeps.minimum();
        match (integrator, substeps) {
            (Integrator::Auto, _) => {
                let bounds = *self.refresh_bounds(elements, particles, viscosity);
                if bounds.angular_frequency == 0.0 {
                    return bounds.cheapest_without_springs(elements.len() > 0, minimum).into();
                }
                if !bounds.may_divide(time_step, minimum) {
                    return bounds.cheapest_explicit(time_step, minimum).into();
                }
                self.refresh_island_bounds(elements, particles, viscosity);
                self.plan_islands((elements, exposed), settings, &[])
            }
            (named, SubstepMode::Fixed(_)) => (named, minimum).into(),
            (named, SubstepMode::Auto) => {
                let bounds = self.refresh_bounds(elements, particles, viscosity);
                (named, bounds.auto_substeps(named, time_step)).into()
            }
        }
    }

    /// The same, by [`Integrator::Auto`], where islands that touch take the same scheme.
    pub fn plan_joined(
        &mut self,
        elements: (&Elements, &Exposed),
        settings: &StepSettings,
        touching: &[[usize; 2]],
    ) -> Plan {
        self.plan_islands(elements, settings, touching)
    }

    /// Bounds on the whole net in a medium of `viscosity` N·s/m.
    pub fn refresh_bounds(
        &mut self,
        elements: &Elements,
        particles: &Particles,
        viscosity: f32,
    ) -> &FrequencyBounds {
        let key = Some(key(elements, particles, viscosity));
        if self.bounds_key != key {
            self.bounds_key = key;
            let present = Some((elements.ends_version(), particles.free_version()));
            if self.has_loops.1 != present {
                self.has_loops = (has_loops(elements, particles), present);
            }
            self.element_bounds = FrequencyBounds::of(elements, particles, viscosity, self.has_loops.0);
        }
        self.gas_bounds.refresh(elements, particles);
        self.bounds = self.element_bounds.with_gas(self.gas_bounds.of(|_| true));
        &self.bounds
    }

    /// The islands of the present elements.
    pub fn refresh_islands(&mut self, elements: &Elements, particles: &Particles) -> &Islands {
        if self.islands.refresh(elements, particles) {
            self.island_key = None;
        }
        &self.islands
    }

    /// The islands, and those of them that the last plan has found to be stiff.
    pub fn stiff_islands(&self) -> (&Islands, &IslandSet) {
        (&self.islands, &self.stiff)
    }

    fn refresh_island_bounds(&mut self, elements: &Elements, particles: &Particles, viscosity: f32) {
        self.refresh_islands(elements, particles);
        let key = Some(key(elements, particles, viscosity));
        if self.island_key == key {
            return;
        }
        self.island_key = key;
        let islands = &self.islands;
        let mut tallies = vec![Tally::default(); islands.all().len()];
        let mut others = Tally::default();
        for (slot, inverse_mass) in particles.inverse_mass().iter().enumerate() {
            let tally = islands.of(slot).map_or(&mut others, |island| &mut tallies[island]);
            tally.add_particle(*inverse_mass);
        }
        for_each_coupling(elements, particles, |coupling| {
            if let Some(island) = islands.of(coupling.free_slot) {
                tallies[island].add_coupling(&coupling);
            }
        });
        let bounds = tallies.iter().zip(islands.all());
        let bounds = bounds.map(|(tally, island)| tally.bounds(viscosity, island.has_loops));
        self.island_bounds = (bounds.collect(), others.bounds(viscosity, false));
    }

    /// What takes a tick of `time_step` seconds through well at the least cost, with `minimum` substeps at
    /// least.
    ///
    /// The substeps of velocity Verlet are those of the fastest island that takes part. So the islands are sorted by
    /// the substeps that they need, and those up to some number take part: of all numbers the one of the least cost. Those that
    /// are `touching` need what the fastest of them needs.
    fn plan_islands(
        &mut self,
        (elements, exposed): (&Elements, &Exposed),
        settings: &StepSettings,
        touching: &[[usize; 2]],
    ) -> Plan {
        let (time_step, minimum) = (settings.time_step, settings.substeps.minimum());
        let exposed = Some(exposed).filter(|_| settings.air_density > 0.0);
        self.surfaces.refresh(&self.islands, elements, exposed);
        let SurfaceCosts { air, gas, .. } = &self.surfaces;
        let steps = SECOND_ORDER_SUBSTEPS.max(minimum);
        let (bounds, others) = &self.island_bounds;
        let islands = || bounds.iter().zip(self.islands.all());
        self.island_costs.clear();
        let gas_bounds = &self.gas_bounds;
        let gas_island = |number: usize| {
            let slots = &elements.gases().all()[number].slots;
            slots.iter().find_map(|slot| self.islands.of(*slot as usize))
        };
        let with_gas = |(number, (bounds, island)): (usize, (&FrequencyBounds, &Island))| {
            let gas = gas_bounds.of(|gas| gas_island(gas) == Some(number));
            (bounds.with_gas(gas), *island)
        };
        let costs = air.iter().zip(gas);
        self.island_costs.extend(islands().enumerate().map(with_gas).zip(costs).map(
            |((bounds, island), (air, gas))| IslandCost {
                substeps: bounds.verlet_substeps(time_step).max(minimum),
                is_too_fast: bounds.is_too_fast(time_step, minimum),
                elements: island.elements,
                surface: air + gas,
                implicit: cost::implicit(steps, island.elements, bounds.has_loops, *air),
            },
        ));
        // Until all that touch, through others, too, agree.
        while touching.iter().fold(false, |any, pair| agree(&mut self.island_costs, *pair) | any) {}
        self.sorted.clear();
        self.sorted.extend(0..self.island_costs.len() as u32);
        let island_costs = &self.island_costs;
        self.sorted.sort_unstable_by_key(|island| island_costs[*island as usize].substeps);
        let mut implicit: f64 = island_costs.iter().map(|island_cost| island_cost.implicit).sum();
        let (mut least, mut most_substeps, mut elements, mut surface) = (implicit, None, 0, 0.0);
        for island_cost in self.sorted.iter().map(|island| &island_costs[*island as usize]) {
            if island_cost.is_too_fast {
                continue;
            }
            elements += island_cost.elements;
            surface += island_cost.surface;
            implicit -= island_cost.implicit;
            // Rounding of the sums is nothing against the costs.
            let total = implicit.max(0.0) + cost::explicit(island_cost.substeps, elements, surface);
            if total <= least {
                (least, most_substeps) = (total, Some(island_cost.substeps));
            }
        }
        let Some(most_substeps) = most_substeps else { return (Integrator::TrBdf2, steps).into() };
        let is_stiff =
            |island_cost: &IslandCost| island_cost.is_too_fast || island_cost.substeps > most_substeps;
        let others_are_stiff = others.verlet_substeps(time_step) > most_substeps;
        if !others_are_stiff && !island_costs.iter().any(is_stiff) {
            return self.bounds.cheapest_explicit(time_step, minimum).into();
        }
        let stiff_springs = island_costs
            .iter()
            .filter(|island_cost| is_stiff(island_cost))
            .map(|island_cost| island_cost.elements)
            .sum();
        self.stiff.set(&self.islands, island_costs.iter().map(is_stiff), others_are_stiff);
        let substeps = most_substeps.next_multiple_of(steps);
        Plan { integrator: Integrator::VelocityVerlet, substeps, stiff_substeps: steps, stiff_springs }
    }
}

/// Gives two islands the substeps of the faster one; whether they were others.
fn agree(island_costs: &mut [IslandCost], [one, other]: [usize; 2]) -> bool {
    let [first, second] = [island_costs[one], island_costs[other]];
    let substeps = first.substeps.max(second.substeps);
    let is_too_fast = first.is_too_fast || second.is_too_fast;
    for island in [one, other] {
        (island_costs[island].substeps, island_costs[island].is_too_fast) = (substeps, is_too_fast);
    }
    [first, second]
        .iter()
        .any(|island_cost| (island_cost.substeps, island_cost.is_too_fast) != (substeps, is_too_fast))
}

#[cfg(test)]
pub(super) mod tests {
    use bevy::math::Vec3;

    use super::*;
    use crate::solver::elements::{Face, Spring};

    const TIME_STEP: f32 = 1.0 / 64.0;

    /// ω = 890 rad/s at 1 kg, which takes 10 substeps of velocity Verlet: hω <= 1.4.
    const SOFT: f32 = 792_100.0;

    /// 1000 substeps.
    const STIFF: f32 = 7.921e9;

    /// Springs as (first, second, stiffness, damping).
    pub fn net(inverse_mass: &[f32], springs: &[(u32, u32, f32, f32)]) -> (Elements, Particles) {
        let (mut elements, mut particles) = (Elements::default(), Particles::default());
        inverse_mass.iter().for_each(|inverse| particles.push(Vec3::ZERO, Vec3::ZERO, *inverse, 0.0));
        for &(first, second, stiffness, damping) in springs {
            elements
                .push([first, second], Spring { rest_length: 1.0, stiffness, damping, ..Spring::default() });
        }
        (elements, particles)
    }

    /// The plan, and the slots of the stiff islands where it divides the net.
    fn plan(inverse_mass: &[f32], springs: &[(u32, u32, f32)], viscosity: f32) -> (Plan, Vec<usize>) {
        let springs: Vec<_> = springs.iter().map(|&(a, b, stiffness)| (a, b, stiffness, 0.0)).collect();
        let (elements, particles) = net(inverse_mass, &springs);
        let mut planner = Planner::default();
        let settings = StepSettings { time_step: TIME_STEP, viscosity, ..StepSettings::default() };
        let plan = planner.plan((&elements, &Exposed::default()), &particles, &settings);
        let (islands, stiff) = planner.stiff_islands();
        let slots = (0..particles.len()).filter(|slot| stiff.contains(islands, &particles, *slot));
        (plan, if plan.stiff_substeps > 0 { slots.collect() } else { Vec::new() })
    }

    #[test]
    fn a_pinned_particle_connects_nothing() {
        // 1 and 2 hang on 0, 1 by a soft spring; 3 is alone.
        let (plan, stiff) = plan(&[0.0, 1.0, 1.0, 1.0], &[(0, 1, SOFT), (0, 2, STIFF)], 0.0);
        // 10 substeps, a multiple of 2.
        let (integrator, substeps) = (Integrator::VelocityVerlet, 10);
        assert_eq!(plan, Plan { integrator, substeps, stiff_substeps: 2, stiff_springs: 1 });
        assert_eq!(stiff, [2]);
    }

    #[test]
    fn springs_that_join_free_particles_make_all_of_them_stiff() {
        let springs = [(0, 1, SOFT), (1, 2, 1.0), (2, 3, STIFF)];
        assert_eq!(plan(&[0.0, 1.0, 1.0, 1.0], &springs, 0.0).0, (Integrator::TrBdf2, 2).into());
        // A spring that exerts no force joins nothing.
        let (plan, stiff) = plan(&[0.0, 1.0, 1.0, 1.0], &[(0, 1, SOFT), (1, 2, 0.0), (2, 3, STIFF)], 0.0);
        assert_eq!((plan.integrator, stiff), (Integrator::VelocityVerlet, vec![2, 3]));
    }

    #[test]
    fn where_all_agree_the_whole_net_decides() {
        let soft = plan(&[0.0, 1.0, 1.0], &[(0, 1, SOFT), (0, 2, 1.0)], 0.0);
        assert_eq!(soft, ((Integrator::VelocityVerlet, 10).into(), vec![]));
        // A particle without springs goes with those that have some.
        let stiff = plan(&[0.0, 1.0, 1.0, 1.0], &[(0, 1, STIFF), (0, 2, STIFF)], 0.0);
        assert_eq!(stiff.0, (Integrator::TrBdf2, 2).into());
    }

    #[test]
    fn a_stiff_sheet_is_an_island() {
        let springs = [(0, 1, SOFT), (2, 3, STIFF), (3, 4, STIFF), (4, 2, STIFF)];
        let (plan, stiff) = plan(&[0.0, 1.0, 1.0, 1.0, 1.0], &springs, 0.0);
        assert_eq!((plan.substeps, plan.stiff_substeps, plan.stiff_springs), (10, 2, 3));
        assert_eq!(stiff, [2, 3, 4]);
    }

    #[test]
    fn what_the_air_costs_counts() {
        let stiff = 25.0 * SOFT;
        let (elements, particles) =
            net(&[1.0; 3], &[(0, 1, stiff, 0.0), (1, 2, stiff, 0.0), (2, 0, stiff, 0.0)]);
        let mut exposed = Exposed::default();
        exposed.add_faces([[0, 1, 2]; 100], Face { drag: 1.0, lift: 0.0 });
        let plans = [0.0, 1.2].map(|air_density| {
            let settings = StepSettings { time_step: TIME_STEP, air_density, ..StepSettings::default() };
            Planner::default().plan((&elements, &exposed), &particles, &settings).integrator
        });
        assert_eq!(plans, [Integrator::VelocityVerlet, Integrator::TrBdf2]);
    }

    #[test]
    fn what_the_medium_stops_at_once_is_stiff_too() {
        let (plan, stiff) = plan(&[0.0, 1.0, 1e6], &[(0, 1, 1.0)], 0.1);
        assert_eq!((plan.substeps, stiff), (4, vec![2]));
    }
}
