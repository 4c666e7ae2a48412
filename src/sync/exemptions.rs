//! Exemptions from contact: entities into the numbers of bodies that the solver compares.

use bevy::ecs::entity::EntityHashMap;
use bevy::ecs::system::SystemParam;
use bevy::prelude::*;

use crate::collider::ContactExemptions;
use crate::particle::Particle;
use crate::solver::Exemptions;

use super::hierarchy::Hierarchy;
use super::registry::Slot;
use super::state::Warnings;

/// What exemptions are read from.
#[derive(SystemParam)]
pub(super) struct ExemptionQueries<'w, 's> {
    exempt: Query<'w, 's, (Entity, &'static ContactExemptions)>,
    children: Query<'w, 's, &'static Children>,
    slots: Query<'w, 's, &'static Slot<Particle>>,
}

/// The exemptions of this tick.
#[derive(Default)]
pub(super) struct GatheredExemptions {
    /// The numbers of the entities that are named, from 1 on.
    numbers: EntityHashMap<u16>,
    /// An entity that is named, and the number of each that is named and is it or below it; sorted.
    within: Vec<(Entity, u16)>,
    /// The entities that are named or exempt, and those below them.
    concerned: Vec<Entity>,
    warnings: Warnings,
}

impl GatheredExemptions {
    /// Numbers the entities that are named, in the order of the query.
    pub fn gather(&mut self, queries: &ExemptionQueries, hierarchy: &Hierarchy) {
        let Self { numbers, within, concerned, warnings } = self;
        numbers.clear();
        within.clear();
        concerned.clear();
        for (entity, exemptions) in &queries.exempt {
            concerned.push(entity);
            for named in &exemptions.0 {
                let next = numbers.len() + 1;
                let Ok(number) = u16::try_from(next) else {
                    let message = format_args!(
                        "the ContactExemptions of {entity} do not all count: 65,535 bodies are named already"
                    );
                    warnings.warn_once(entity, message);
                    continue;
                };
                if !numbers.contains_key(named) {
                    numbers.insert(*named, number);
                    concerned.push(*named);
                }
            }
        }
        for (named, number) in &*numbers {
            let outer = hierarchy.lineage(*named).filter(|outer| numbers.contains_key(outer));
            within.extend(outer.map(|outer| (outer, *number)));
        }
        within.sort_unstable();
        let mut next = 0;
        while let Some(entity) = concerned.get(next) {
            concerned.extend(queries.children.get(*entity).into_iter().flatten());
            next += 1;
        }
        concerned.sort_unstable();
        concerned.dedup();
    }

    /// Those of an entity: it is a part of the nearest one above it that is named, and exempt as all above it are.
    pub fn of(&mut self, entity: Entity, queries: &ExemptionQueries, hierarchy: &Hierarchy) -> Exemptions {
        let Self { numbers, within, warnings, .. } = self;
        if numbers.is_empty() {
            return Exemptions::NONE;
        }
        let mut exemptions = Exemptions::NONE;
        let mut count = 0;
        for ancestor in hierarchy.lineage(entity) {
            if exemptions.body == 0 {
                exemptions.body = numbers.get(&ancestor).copied().unwrap_or(0);
            }
            let named = queries.exempt.get(ancestor).into_iter().flat_map(|(_, exempt)| &exempt.0);
            for number in named.flat_map(|named| numbers_within(within, *named)) {
                if exemptions.of[..count].contains(&number) {
                    continue;
                }
                if count == Exemptions::MAX {
                    let message = format_args!(
                        "the ContactExemptions of {ancestor} do not all count for {entity}: they name more than {} bodies",
                        Exemptions::MAX
                    );
                    warnings.warn_once(entity, message);
                    break;
                }
                exemptions.of[count] = number;
                count += 1;
            }
        }
        exemptions.of[..count].sort_unstable();
        exemptions
    }

    /// The entities that any of them may concern, and the slots of those that are particles.
    pub fn for_each_concerned(
        &mut self,
        queries: &ExemptionQueries,
        mut visit: impl FnMut(&mut Self, Entity, Option<usize>),
    ) {
        let concerned = std::mem::take(&mut self.concerned);
        for entity in &concerned {
            visit(self, *entity, queries.slots.get(*entity).ok().and_then(Slot::get));
        }
        self.concerned = concerned;
    }
}

/// The numbers of those that are named and are this entity or below it.
fn numbers_within(within: &[(Entity, u16)], named: Entity) -> impl Iterator<Item = u16> {
    let from = within.partition_point(|(entity, _)| *entity < named);
    within[from..].iter().take_while(move |(entity, _)| *entity == named).map(|(_, number)| *number)
}
