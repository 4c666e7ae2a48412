//! Springs in the order in which a processor likes to take them.
//!
//! The particles are divided into *blocks* of consecutive slots. A block owns the forces on its
//! particles and lists every spring that ends in it; a spring between two blocks is listed in both, and
//! each computes it for its own end, so that blocks need not wait for each other and a tick has the
//! same bits on any number of threads.
//!
//! Within a block springs are sorted by the offset between their two slots, then by slot. Ropes, cloths
//! and lattices then fall into long *runs*, in which the first ends are consecutive and the second ends
//! too: eight springs are loaded, computed and stored at a time without gathering. What is left over
//! is *loose* and taken one by one.

use super::springs::Springs;

/// Runs shorter than this are loose: a vector would not be filled.
pub(super) const SHORTEST_RUN: usize = 8;

/// Runs stay within so many particles, whose state fits in the first-level cache.
const TILE: usize = 1024;

/// Blocks have at least so many particles: smaller ones list more of their springs twice.
pub(super) const SMALLEST_BLOCK: usize = 2048;

/// From about so many particles and springs together on it pays to wake other threads. Measured: a rope of
/// 10,000 (20,000 of them) takes two threads a twentieth longer than one, a cloth of 70² (34,000) a twelfth
/// less.
const WORTH_SHARING: usize = 25_000;

/// The part of the springs that may be listed twice: a larger block is taken until no more are.
const MOST_CUT: f32 = 0.04;

/// One in so many springs may be loose because they came later; then all are sorted anew.
const MOST_APPENDED: usize = 8;

/// Which ends of a spring lie in a block.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Side {
    Both,
    Lower,
    Upper,
}

/// Springs whose lower ends are consecutive slots, and whose upper ends are too.
#[derive(Debug, Clone, Copy)]
pub(super) struct Run {
    /// The first of the lower slots.
    pub lower: u32,
    /// The first of the upper slots.
    pub upper: u32,
    /// How many springs.
    pub count: u32,
    /// Where their parameters begin in the block.
    pub start: u32,
    /// Which ends lie in the block.
    pub side: Side,
    /// Stiffness and damping, if they are those of all its springs: less to read.
    pub material: Option<[f32; 2]>,
}

/// A spring that is in no run.
#[derive(Debug, Clone, Copy)]
pub(super) struct Loose {
    pub lower: u32,
    pub upper: u32,
    pub side: Side,
}

/// The springs that end in one block of particles.
#[derive(Debug, Clone, Default)]
pub(super) struct Block {
    pub runs: Vec<Run>,
    pub loose: Vec<Loose>,
    /// Parameters of the runs, then of the loose springs.
    pub rest_length: Vec<f32>,
    pub stiffness: Vec<f32>,
    pub damping: Vec<f32>,
    /// The spring whose parameters each of these are.
    springs: Vec<u32>,
}

/// A spring of a block, in the order of sorting.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Entry {
    tile: u32,
    side: Side,
    offset: u32,
    lower: u32,
    spring: u32,
}

/// All springs in blocks.
#[derive(Debug, Clone, Default)]
pub(super) struct Batches {
    pub blocks: Vec<Block>,
    /// Particles in each block but the last.
    pub block_size: usize,
    particles: usize,
    /// Whether they are those of the springs.
    good: bool,
    /// How many springs came since they were sorted.
    appended: usize,
    /// Where the parameters of each spring are: (block, index), the second only for a spring between
    /// two blocks.
    places: Vec<[Option<Place>; 2]>,
}

#[derive(Debug, Clone, Copy)]
struct Place {
    block: u32,
    index: u32,
}

impl Batches {
    /// To be called when a spring came or went.
    pub fn invalidate(&mut self) {
        self.good = false;
    }

    /// Makes room for particles that came, and says whether the batches still are those of all springs.
    pub fn grow(&mut self, particles: usize) -> bool {
        if self.good && particles > self.particles {
            self.particles = particles;
            self.blocks.resize_with(particles.div_ceil(self.block_size), Block::default);
        }
        self.good && particles == self.particles
    }

    /// Adds a spring as a loose one, in constant time.
    pub fn append(&mut self, ends: [u32; 2], parameters: [f32; 3]) {
        self.appended += 1;
        self.good &= self.appended * MOST_APPENDED < self.places.len();
        if !self.good {
            return;
        }
        let [lower, upper] = ends;
        self.grow(self.particles.max(upper as usize + 1));
        let spring = self.places.len() as u32;
        let shift = self.block_size.ilog2();
        let (first, second) = (lower >> shift, upper >> shift);
        let mut append =
            |block, side| Some(self.append_to(block, Loose { lower, upper, side }, spring, parameters));
        let places = if first == second {
            [append(first, Side::Both), None]
        } else {
            [append(first, Side::Lower), append(second, Side::Upper)]
        };
        self.places.push(places);
    }

    fn append_to(&mut self, block: u32, loose: Loose, spring: u32, parameters: [f32; 3]) -> Place {
        let listed = &mut self.blocks[block as usize];
        listed.loose.push(loose);
        Place { block, index: listed.place(spring, parameters) }
    }

    /// The springs that end in a particle; `None` if the batches are not good.
    pub fn ending_at(&self, slot: u32) -> Option<Vec<usize>> {
        if !self.good {
            return None;
        }
        let block = self.blocks.get(slot as usize / self.block_size)?;
        let in_runs = block.runs.iter().flat_map(|run| {
            let ends = [(run.lower, Side::Upper), (run.upper, Side::Lower)];
            ends.into_iter().filter_map(move |(first, other_side)| {
                let at = slot.checked_sub(first).filter(|at| *at < run.count && run.side != other_side)?;
                Some(run.start + at)
            })
        });
        let after_runs = block.springs.len() - block.loose.len();
        let among_loose = block.loose.iter().zip(after_runs as u32..);
        let among_loose = among_loose.filter(|(loose, _)| loose.lower == slot || loose.upper == slot);
        let places = in_runs.chain(among_loose.map(|(_, place)| place));
        Some(places.map(|place| block.springs[place as usize] as usize).collect())
    }

    /// Whether there is so much work in an evaluation that other threads should help.
    pub fn are_worth_sharing(&self) -> bool {
        self.blocks.len() > 1 && self.particles + self.places.len() >= WORTH_SHARING
    }

    /// How many springs are in no run; those between two blocks count twice.
    pub fn loose(&self) -> usize {
        self.blocks.iter().map(|block| block.loose.len()).sum()
    }

    /// Changes the parameters of a spring.
    pub fn set_parameters(&mut self, spring: usize, parameters: [f32; 3]) {
        if !self.good {
            return;
        }
        for place in self.places[spring].into_iter().flatten() {
            self.blocks[place.block as usize].set_parameters(place.index as usize, parameters);
        }
    }

    /// Sorts all springs.
    pub fn build(&mut self, springs: &Springs, particles: usize) {
        self.good = true;
        self.particles = particles;
        self.block_size = block_size(springs, particles);
        let shift = self.block_size.ilog2();
        self.appended = 0;
        let count = particles.div_ceil(self.block_size);
        self.blocks.resize_with(count, Block::default);
        let mut entries = vec![Vec::new(); count];
        for (spring, (&first, &second)) in springs.first().iter().zip(springs.second()).enumerate() {
            let (lower, upper) = (first.min(second), first.max(second));
            let entry = |slot: u32, side| Entry {
                tile: slot / TILE as u32,
                side,
                offset: upper - lower,
                lower,
                spring: spring as u32,
            };
            let (lower_block, upper_block) = ((lower >> shift) as usize, (upper >> shift) as usize);
            if lower_block == upper_block {
                entries[lower_block].push(entry(lower, Side::Both));
            } else {
                entries[lower_block].push(entry(lower, Side::Lower));
                entries[upper_block].push(entry(upper, Side::Upper));
            }
        }
        self.places.clear();
        self.places.resize(springs.len(), [None; 2]);
        for (number, (block, mut entries)) in self.blocks.iter_mut().zip(entries).enumerate() {
            entries.sort_unstable();
            block.batch(springs, &entries);
            for (spring, index) in block.springs.iter().zip(0..) {
                let place = Some(Place { block: number as u32, index });
                let [first, second] = &mut self.places[*spring as usize];
                *(if first.is_none() { first } else { second }) = place;
            }
        }
    }
}

impl Block {
    fn set_parameters(&mut self, index: usize, [rest_length, stiffness, damping]: [f32; 3]) {
        self.rest_length[index] = rest_length;
        self.stiffness[index] = stiffness;
        self.damping[index] = damping;
        let run = self.runs.partition_point(|run| run.start as usize <= index).checked_sub(1);
        if let Some(run) = run.map(|run| &mut self.runs[run])
            && run.material != Some([stiffness, damping])
        {
            run.material = None;
        }
    }

    /// Appends the parameters of a spring; where they are.
    fn place(&mut self, spring: u32, [rest_length, stiffness, damping]: [f32; 3]) -> u32 {
        self.springs.push(spring);
        self.rest_length.push(rest_length);
        self.stiffness.push(stiffness);
        self.damping.push(damping);
        self.springs.len() as u32 - 1
    }

    /// Divides sorted entries into runs and loose springs.
    fn batch(&mut self, springs: &Springs, entries: &[Entry]) {
        *self = Self::default();
        let parameters = |entry: &Entry| {
            let spring = entry.spring as usize;
            [springs.rest_length()[spring], springs.stiffness()[spring], springs.damping()[spring]]
        };
        let material = |entry: &Entry| [parameters(entry)[1], parameters(entry)[2]];
        let consecutive = |one: &Entry, next: &Entry| {
            (one.tile, one.side, one.offset, one.lower + 1) == (next.tile, next.side, next.offset, next.lower)
        };
        let groups = || entries.chunk_by(consecutive);
        for group in groups().filter(|group| group.len() >= SHORTEST_RUN) {
            let Entry { side, offset, lower, .. } = group[0];
            let uniform = group.iter().all(|entry| material(entry) == material(&group[0]));
            self.runs.push(Run {
                lower,
                upper: lower + offset,
                count: group.len() as u32,
                start: self.springs.len() as u32,
                side,
                material: uniform.then(|| material(&group[0])),
            });
            for entry in group {
                self.place(entry.spring, parameters(entry));
            }
        }
        for entry in groups().filter(|group| group.len() < SHORTEST_RUN).flatten() {
            let Entry { side, offset, lower, spring, .. } = *entry;
            self.loose.push(Loose { lower, upper: lower + offset, side });
            self.place(spring, parameters(entry));
        }
    }
}

/// The size of the blocks: the smallest power of two that cuts few springs. It depends on the springs
/// alone, never on the number of threads.
fn block_size(springs: &Springs, particles: usize) -> usize {
    let mut size = SMALLEST_BLOCK;
    while size < particles {
        let shift = size.ilog2();
        let ends = springs.first().iter().zip(springs.second());
        let cut = ends.filter(|(first, second)| *first >> shift != *second >> shift).count();
        if cut as f32 <= MOST_CUT * springs.len() as f32 {
            break;
        }
        size *= 2;
    }
    size
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Each spring as (lower, upper, rest length), once for each of its ends that a block serves.
    fn listed(batches: &Batches) -> Vec<(u32, u32, u32)> {
        let mut ends = Vec::new();
        for block in &batches.blocks {
            let runs = block.runs.iter().flat_map(|run| {
                (0..run.count).map(|at| (run.lower + at, run.upper + at, run.side, run.start + at))
            });
            let after = block.rest_length.len() - block.loose.len();
            let loose = block.loose.iter().zip(after as u32..);
            let loose = loose.map(|(spring, place)| (spring.lower, spring.upper, spring.side, place));
            for (lower, upper, side, place) in runs.chain(loose) {
                let count = if side == Side::Both { 2 } else { 1 };
                let listing = (lower, upper, block.rest_length[place as usize].to_bits());
                ends.extend(std::iter::repeat_n(listing, count));
            }
        }
        ends.sort_unstable();
        ends
    }

    #[test]
    fn both_ends_of_every_spring_are_served_once() {
        let count = 5 * SMALLEST_BLOCK;
        let mut springs = Springs::default();
        let mut expected = Vec::new();
        for slot in 0..count {
            // A rope, one link in ten the other way round, and some springs from anywhere to anywhere.
            let next = (slot + 1) % count;
            let (first, second) = if slot % 10 == 0 { (next, slot) } else { (slot, next) };
            springs.push(first, second, slot as f32, 1.0, 0.0);
            if slot % 100 == 0 {
                springs.push(slot, slot * 7 % count + 1, 0.5, 1.0, 0.0);
            }
        }
        for spring in 0..springs.len() {
            let (first, second) = springs.ends(spring);
            let ends = (first.min(second) as u32, first.max(second) as u32);
            let listing = (ends.0, ends.1, springs.rest_length()[spring].to_bits());
            expected.extend([listing, listing]);
        }
        expected.sort_unstable();
        springs.prepare(count);
        assert!(springs.batches().blocks.len() > 1);
        assert_eq!(listed(springs.batches()), expected);

        springs.set_parameters(3, 17.5, 2.0, 0.1);
        let edited = listed(springs.batches()).iter().filter(|spring| spring.2 == 17.5_f32.to_bits()).count();
        assert_eq!(edited, 2);
    }

    #[test]
    fn a_rope_is_one_run_in_each_tile() {
        let mut springs = Springs::default();
        for slot in 1..1500 {
            springs.push(slot - 1, slot, 0.1, 1.0, 0.0);
        }
        springs.prepare(1500);
        let runs: Vec<u32> = springs.batches().blocks[0].runs.iter().map(|run| run.count).collect();
        assert_eq!(runs, [1024, 475]);
    }
}
