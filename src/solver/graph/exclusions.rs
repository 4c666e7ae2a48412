//! What contacts need of the springs: which pairs do not collide, and which particles have springs.

use crate::solver::buckets::Buckets;
use crate::solver::elements::Elements;
use crate::solver::particles::Particles;

/// Rest lengths are often measured from positions, and radii chosen to fit them. By this part a rest length may
/// be below the sum of the radii without being shorter.
const MEASURING_ERROR: f32 = 1e-4;

/// Whether the two ends of a spring overlap at its `rest_length`, m; `reach` is the sum of their radii, m.
pub(in crate::solver) fn overlap_at_rest(rest_length: f64, reach: f32) -> bool {
    rest_length < f64::from((1.0 - MEASURING_ERROR) * reach)
}

/// The pinned slots that any element pulls at, in order.
pub(in crate::solver) fn sprung_pinned(elements: &Elements, particles: &Particles) -> Vec<u32> {
    let mut slots = Vec::new();
    elements.for_each_acting_ends(|ends| {
        slots.extend(ends.iter().filter(|end| particles.is_pinned(**end as usize)));
    });
    slots.sort_unstable();
    slots.dedup();
    slots
}

/// Derived anew with each search for candidates: then a spring, a radius or a mass has changed.
#[derive(Debug, Clone, Default)]
pub(in crate::solver) struct Exclusions {
    /// For each particle the higher slots of particles that overlap it at rest: the rest length of a spring between the two is
    /// less than the sum of their radii.
    excluded: Buckets<u32>,
    /// Whether a spring pulls at each particle.
    sprung: Vec<bool>,
    /// Whether a spring joins each particle to the one in the slot before.
    continues: Vec<bool>,
    /// The families of particles that do not collide with each other; empty if there are none.
    families: Vec<u32>,
    /// Whether each particle is no sphere of its own; empty if all are.
    covered: Vec<bool>,
    /// Working memory: the ends of the springs that join what overlaps at rest.
    overlapping: Vec<[u32; 2]>,
}

impl Exclusions {
    /// Derives them from all springs; `covered` particles are no spheres of their own.
    pub fn rebuild(&mut self, particles: &Particles, elements: &Elements, is_covered: &[bool]) {
        let radius = particles.radius();
        let Self { excluded, sprung, continues, families, covered, overlapping } = self;
        covered.clear();
        covered.extend_from_slice(is_covered);
        families.clear();
        families.extend_from_slice(particles.families());
        sprung.clear();
        sprung.resize(particles.len(), false);
        elements.for_each_acting_ends(|ends| {
            ends.iter().for_each(|end| sprung[*end as usize] = true);
        });
        continues.clear();
        continues.resize(particles.len(), false);
        overlapping.clear();
        let springs = elements.springs();
        for (&[first, second], spring) in springs.all_ends().iter().zip(springs.elements()) {
            if spring.stiffness > 0.0 && first.abs_diff(second) == 1 {
                continues[first.max(second) as usize] = true;
            }
            let reach = radius[first as usize] + radius[second as usize];
            let acts = spring.stiffness > 0.0 || spring.damping > 0.0;
            // Of points none is within reach: no rest length is negative.
            if reach > 0.0 && acts && overlap_at_rest(f64::from(spring.length_at_rest()), reach) {
                overlapping.push([first.min(second), first.max(second)]);
            }
        }
        excluded.fill(particles.len(), |add| {
            overlapping.iter().for_each(|[lower, higher]| add(*lower as usize, *higher));
        });
    }

    /// Whether a spring pulls at any particle.
    pub fn any_sprung(&self) -> bool {
        self.sprung.contains(&true)
    }

    /// Whether a spring pulls at a particle.
    pub fn is_sprung(&self, slot: usize) -> bool {
        self.sprung.get(slot) == Some(&true)
    }

    /// Whether a particle is no sphere of its own, but a part of a surface.
    pub fn is_covered(&self, slot: usize) -> bool {
        self.covered.get(slot) == Some(&true)
    }

    /// Whether a spring joins each particle to the one in the slot before.
    pub fn continues(&self) -> &[bool] {
        &self.continues
    }

    /// Whether the particles a < b do not collide.
    pub fn contains(&self, a: u32, b: u32) -> bool {
        Self::are_of_one_family(&self.families, a, b)
            || !self.excluded.is_empty() && self.excluded.of(a as usize).contains(&b)
    }

    /// Whether two particles are of one family, as in a net that does not collide with itself.
    pub fn are_of_one_family(families: &[u32], one: u32, other: u32) -> bool {
        let family = families.get(one as usize).copied().unwrap_or(0);
        family != 0 && families.get(other as usize) == Some(&family)
    }
}
