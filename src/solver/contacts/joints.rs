//! What the contacts must know of the springs.

use crate::solver::particles::Particles;
use crate::solver::springs::Springs;

/// Rest lengths are often measured from positions, and radii chosen to fit them: by so much, as a part,
/// a rest length may be below the sum of the radii without being shorter.
const MEASURING_ERROR: f32 = 1e-4;

/// The springs as the contacts see them; found out anew when a spring, a radius or a mass has changed.
#[derive(Debug, Clone, Default)]
pub(super) struct Joints {
    /// `starts[a]..starts[a + 1]` are the partners of a.
    starts: Vec<u32>,
    /// The particles b > a that lie in a at rest: a spring joins them whose rest length is shorter than
    /// the two radii together.
    partners: Vec<u32>,
    /// Whether a spring pulls at each particle.
    sprung: Vec<bool>,
}

impl Joints {
    /// Finds out about all springs.
    pub fn rebuild(&mut self, particles: &Particles, springs: &Springs) {
        let Self { starts, partners, sprung } = self;
        sprung.clear();
        sprung.resize(particles.len(), false);
        starts.clear();
        starts.resize(particles.len() + 1, 0);
        for spring in acting(springs) {
            let (first, second) = springs.ends(spring);
            (sprung[first], sprung[second]) = (true, true);
        }
        for (a, _) in overlapping(particles, springs) {
            starts[a as usize] += 1;
        }
        let mut total = 0;
        for start in &mut *starts {
            total += *start;
            *start = total;
        }
        partners.clear();
        partners.resize(total as usize, 0);
        for (a, b) in overlapping(particles, springs) {
            let start = &mut starts[a as usize];
            *start -= 1;
            partners[*start as usize] = b;
        }
    }

    /// Whether a spring pulls at any particle.
    pub fn any(&self) -> bool {
        self.sprung.contains(&true)
    }

    /// Whether a spring pulls at a particle.
    pub fn is_sprung(&self, slot: usize) -> bool {
        self.sprung.get(slot) == Some(&true)
    }

    /// Whether a spring says that a and b, a < b, overlap at rest: such a pair does not collide.
    pub fn overlap_at_rest(&self, a: u32, b: u32) -> bool {
        if self.partners.is_empty() {
            return false;
        }
        let bounds = self.starts[a as usize] as usize..self.starts[a as usize + 1] as usize;
        self.partners[bounds].contains(&b)
    }
}

/// The pairs (a, b), a < b, of the springs that are shorter than the two radii together.
fn overlapping(particles: &Particles, springs: &Springs) -> impl Iterator<Item = (u32, u32)> {
    acting(springs).filter_map(|spring| {
        let (first, second) = springs.ends(spring);
        let reach = particles.radius[first] + particles.radius[second];
        let (a, b) = (first.min(second) as u32, first.max(second) as u32);
        (springs.rest_length()[spring] < (1.0 - MEASURING_ERROR) * reach).then_some((a, b))
    })
}

/// The springs that exert forces; not those that are only an empty slot.
fn acting(springs: &Springs) -> impl Iterator<Item = usize> {
    (0..springs.len()).filter(|spring| springs.stiffness()[*spring] > 0.0 || springs.damping()[*spring] > 0.0)
}
