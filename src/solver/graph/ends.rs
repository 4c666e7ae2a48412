//! The ends of a single spring, for readers that know it by its number.

use crate::solver::elements::Elements;

/// The slots of the two ends of a spring.
pub(in crate::solver) fn spring_ends(elements: &Elements, spring: usize) -> [usize; 2] {
    elements.springs().all_ends()[spring].map(|end| end as usize)
}
