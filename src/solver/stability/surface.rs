//! What air and gases add to the cost of a substep of each island.

use super::cost;
use crate::solver::elements::{Elements, Exposed};
use crate::solver::graph::Islands;
use crate::solver::state::Version;

/// Of each island, ns: by faces and filaments, and by gases.
#[derive(Debug, Clone, Default)]
pub(super) struct SurfaceCosts {
    pub air: Vec<f64>,
    pub gas: Vec<f64>,
    key: Option<((Version, Version), Option<Version>)>,
}

impl SurfaceCosts {
    /// Makes them those of the present faces, filaments and gases; `exposed` is what the air acts on, if there is air.
    pub fn refresh(&mut self, islands: &Islands, elements: &Elements, exposed: Option<&Exposed>) {
        let key = Some((islands.key(), exposed.map(Exposed::version)));
        if self.key == key {
            return;
        }
        self.key = key;
        let count = islands.all().len();
        for costs in [&mut self.air, &mut self.gas] {
            costs.clear();
            costs.resize(count, 0.0);
        }
        let island_of = |ends: &[u32]| ends.iter().find_map(|end| islands.of(*end as usize));
        for (_, enclosure) in elements.gases().acting() {
            if let Some(island) = island_of(&enclosure.slots) {
                self.gas[island] += cost::GAS_FACE * enclosure.triangles.len() as f64;
            }
        }
        let Some(exposed) = exposed else { return };
        for (ends, face) in &exposed.faces {
            if let Some(island) = island_of(ends) {
                self.air[island] += if face.lift > 0.0 { cost::LIFTED_FACE } else { cost::FACE };
            }
        }
        for (ends, _) in &exposed.filaments {
            if let Some(island) = island_of(ends) {
                self.air[island] += cost::FILAMENT;
            }
        }
    }
}
