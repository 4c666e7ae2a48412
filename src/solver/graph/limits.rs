//! What hangs together by springs with a strain limit, in the order in which the limits are solved for.

use super::islands::Forest;
use crate::solver::buckets::Buckets;
use crate::solver::elements::Elements;
use crate::solver::particles::Particles;
use crate::solver::state::Version;

/// The springs with a strain limit, in groups that share no free particle.
#[derive(Debug, Clone, Default)]
pub(in crate::solver) struct Limits {
    pub groups: Vec<LimitGroup>,
    key: Option<(Version, Version)>,
    /// Whether there is any spring with a limit, be it between pinned particles.
    any: bool,
}

/// Some particles and the limited springs between them.
#[derive(Debug, Clone, Default)]
pub(in crate::solver) struct LimitGroup {
    /// The slot of each node: the free ones from those that hang on pinned ones outwards, then the pinned ones.
    pub slots: Vec<u32>,
    /// The number of free nodes.
    pub free: usize,
    /// The springs, by the later one of their free nodes.
    pub links: Vec<LimitLink>,
    /// Whether they close a loop, among free nodes or by way of pinned ones.
    pub has_loops: bool,
}

/// A spring with a strain limit.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(in crate::solver) struct LimitLink {
    /// The outer node, which is free, and the inner one: an earlier free node, or a pinned one.
    pub nodes: [u32; 2],
    /// The number of the spring.
    pub spring: u32,
}

const NO_NODE: u32 = u32::MAX;

impl Limits {
    /// Makes them those of the present springs.
    pub fn refresh(&mut self, elements: &Elements, particles: &Particles) {
        let key = Some((elements.limits_version(), particles.free_version()));
        let has_same_springs = self.key.is_some_and(|(limits, _)| limits == elements.limits_version());
        if self.key == key || has_same_springs && !self.any {
            return;
        }
        self.key = key;
        self.groups.clear();
        let limited = limited(elements);
        self.any = !limited.is_empty();
        let has_free_end =
            |(_, ends): &(u32, [u32; 2])| !ends.iter().all(|end| particles.is_pinned(*end as usize));
        let limited: Vec<_> = limited.into_iter().filter(has_free_end).collect();
        if !limited.is_empty() {
            self.groups = groups(&limited, particles);
        }
    }
}

/// The numbers and ends of the springs with a strain limit.
fn limited(elements: &Elements) -> Vec<(u32, [u32; 2])> {
    let springs = elements.springs();
    let all = (0..).zip(springs.elements()).zip(springs.all_ends());
    let limited = all.filter(|((_, spring), _)| spring.max_stretch.is_some());
    limited.map(|((number, _), ends)| (number, *ends)).collect()
}

fn groups(limited: &[(u32, [u32; 2])], particles: &Particles) -> Vec<LimitGroup> {
    let is_pinned = |slot: u32| particles.is_pinned(slot as usize);
    let mut forest = Forest::new(particles.len());
    for (_, [first, second]) in limited {
        if !is_pinned(*first) && !is_pinned(*second) {
            forest.join(*first as usize, *second as usize);
        }
    }
    let mut group_of_root = vec![NO_NODE; particles.len()];
    let mut count = 0;
    let group_of: Vec<usize> = limited
        .iter()
        .map(|(_, [first, second])| {
            let root = forest.root(if is_pinned(*first) { *second } else { *first } as usize);
            if group_of_root[root] == NO_NODE {
                group_of_root[root] = count;
                count += 1;
            }
            group_of_root[root] as usize
        })
        .collect();
    let mut members = Buckets::default();
    members.fill(count as usize, |add| (0..).zip(&group_of).for_each(|(link, group)| add(*group, link)));
    let mut nodes = vec![NO_NODE; particles.len()];
    let link = |member: &u32| limited[*member as usize];
    (0..members.len())
        .map(|group| {
            let links: Vec<(u32, [u32; 2])> = members.of(group).iter().map(link).collect();
            LimitGroup::of(&links, particles, &mut nodes)
        })
        .collect()
}

impl LimitGroup {
    /// The group of these springs; `nodes` is working memory.
    fn of(links: &[(u32, [u32; 2])], particles: &Particles, nodes: &mut [u32]) -> Self {
        let is_pinned = |slot: u32| particles.is_pinned(slot as usize);
        let mut at: Vec<(u32, u32)> = links.iter().flat_map(|(_, [a, b])| [(*a, *b), (*b, *a)]).collect();
        at.sort_unstable();
        let mut group = Self::default();
        let within = links.iter().filter(|(_, [a, b])| !is_pinned(*a) && !is_pinned(*b)).count();
        let anchors = links.len() - within;
        group.has_loops =
            anchors > 1 || within >= at.chunk_by(|a, b| a.0 == b.0).filter(|of| !is_pinned(of[0].0)).count();
        // Breadth first, from all that hangs on pinned particles, or from the first one; a tree has one root.
        let mut slots: Vec<u32> = at
            .iter()
            .filter(|(slot, other)| !is_pinned(*slot) && is_pinned(*other))
            .map(|(slot, _)| *slot)
            .collect();
        slots.dedup();
        slots.truncate(if group.has_loops { slots.len() } else { 1 });
        if slots.is_empty() {
            slots.extend(at.first().map(|(slot, _)| *slot));
        }
        (0..).zip(&slots).for_each(|(node, slot)| nodes[*slot as usize] = node);
        let mut done = 0;
        while let Some(&slot) = slots.get(done) {
            done += 1;
            let first = at.partition_point(|(other, _)| *other < slot);
            for &(_, other) in at[first..].iter().take_while(|(from, _)| *from == slot) {
                if nodes[other as usize] == NO_NODE && !is_pinned(other) {
                    nodes[other as usize] = slots.len() as u32;
                    slots.push(other);
                }
            }
        }
        group.free = slots.len();
        for &(slot, _) in at.iter().filter(|(slot, _)| is_pinned(*slot)) {
            if nodes[slot as usize] == NO_NODE {
                nodes[slot as usize] = slots.len() as u32;
                slots.push(slot);
            }
        }
        group.number_links(links, nodes);
        slots.iter().for_each(|slot| nodes[*slot as usize] = NO_NODE);
        group.slots = slots;
        group
    }

    fn number_links(&mut self, links: &[(u32, [u32; 2])], nodes: &[u32]) {
        let free = self.free as u32;
        self.links.extend(links.iter().map(|&(spring, ends)| {
            let [first, second] = ends.map(|end| nodes[end as usize]);
            let is_outer = second >= free || (first < free && first > second);
            LimitLink { nodes: if is_outer { [first, second] } else { [second, first] }, spring }
        }));
        self.links.sort_unstable();
    }
}
