//! The core, coarsened: neighbours form groups, groups larger groups, and so on.

use super::NodeRun;

/// A level of at most this number of groups is the last.
const MIN_GROUPS: usize = 8;

/// The levels, from fine to coarse.
#[derive(Debug, Clone, Default)]
pub(in crate::solver) struct Hierarchy {
    pub levels: Vec<Level>,
}

/// Groups of the members of the next finer level; of the core nodes on the first.
#[derive(Debug, Clone, Default)]
pub(in crate::solver) struct Level {
    /// The group of each member.
    pub groups: Vec<u32>,
    /// The number of groups.
    pub count: usize,
    /// The links between different groups: index of the link, and its groups.
    pub crossings: Vec<(u32, [u32; 2])>,
}

/// The group of a member that has none yet.
const NO_GROUP: u32 = u32::MAX;

impl Hierarchy {
    /// Coarsens `count` nodes that are joined by the links of `runs`.
    pub fn build(&mut self, count: usize, runs: &[NodeRun]) {
        self.levels.clear();
        let ends = runs.iter().flat_map(|run| {
            (0..run.count).map(|place| [(run.first + place) as u32, (run.second + place) as u32])
        });
        let mut links: Vec<(u32, [u32; 2])> = (0..).zip(ends).collect();
        let mut members = count;
        while members > MIN_GROUPS && !links.is_empty() {
            let (groups, count) = aggregate(members, &links);
            for (_, ends) in &mut links {
                *ends = ends.map(|end| groups[end as usize]);
            }
            links.retain(|(_, ends)| ends[0] != ends[1]);
            self.levels.push(Level { groups, count, crossings: links.clone() });
            members = count;
        }
    }
}

/// Makes a group of each member and its neighbours where none of these is in a group yet, and adds each other member to the group of a
/// neighbour.
/// (Vaněk, Mandel and Brezina, *Computing* 56, 179, 1996.)
fn aggregate(members: usize, links: &[(u32, [u32; 2])]) -> (Vec<u32>, usize) {
    let mut pairs: Vec<(u32, u32)> =
        links.iter().flat_map(|(_, [first, second])| [(*first, *second), (*second, *first)]).collect();
    pairs.sort_unstable();
    pairs.dedup();
    let mut groups = vec![NO_GROUP; members];
    let mut count = 0;
    for neighbourhood in pairs.chunk_by(|one, next| one.0 == next.0) {
        let center = neighbourhood[0].0;
        let all = neighbourhood.iter().map(|pair| pair.1).chain([center]);
        if all.clone().all(|member| groups[member as usize] == NO_GROUP) {
            all.for_each(|member| groups[member as usize] = count);
            count += 1;
        }
    }
    for neighbourhood in pairs.chunk_by(|one, next| one.0 == next.0) {
        let center = neighbourhood[0].0 as usize;
        if groups[center] == NO_GROUP {
            let found =
                neighbourhood.iter().map(|pair| groups[pair.1 as usize]).find(|group| *group != NO_GROUP);
            groups[center] = found.unwrap_or(count);
            count += u32::from(found.is_none());
        }
    }
    for group in &mut groups {
        if *group == NO_GROUP {
            *group = count;
            count += 1;
        }
    }
    (groups, count as usize)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_is_grouped_by_threes() {
        let mut hierarchy = Hierarchy::default();
        hierarchy.build(27, &[NodeRun { first: 0, second: 1, count: 26 }]);
        let first = &hierarchy.levels[0];
        assert_eq!(first.count, 9);
        assert_eq!(first.groups[..7], [0, 0, 1, 1, 1, 2, 2]);
        assert_eq!(first.crossings[0], (1, [0, 1]));
        assert_eq!(hierarchy.levels.last().unwrap().count, 3);
    }

    #[test]
    fn separate_rows_are_not_mixed() {
        let mut hierarchy = Hierarchy::default();
        hierarchy.build(
            20,
            &[NodeRun { first: 0, second: 1, count: 9 }, NodeRun { first: 10, second: 11, count: 9 }],
        );
        let groups = &hierarchy.levels[0].groups;
        assert!(groups[..10].iter().all(|group| !groups[10..].contains(group)));
    }
}
