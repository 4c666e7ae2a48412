//! A tree of boxes: of the triangles of a mesh, of the parts of a compound, and of all colliders.
//!
//! Each node has four children. Their boxes lie side by side, so that all four are tested by the same vector
//! instructions. It is built by halving along the longest axis, so that its depth is bounded and it is the same on
//! every run. A query returns all items that overlap, or the nearest one: the order of traversal changes no
//! result as long as the smallest index is taken of those that are equally near.

use bevy::math::{DVec3, Vec3};

/// Children of a node.
const WIDTH: usize = 4;

/// Items of a leaf, at most.
const MAX_LEAF: usize = 4;

/// A leaf is this bit, the first of its items times 8, and their number.
const LEAF: u32 = 1 << 31;

/// The child of a node that has fewer than four.
const NO_CHILD: u32 = u32::MAX;

/// Nodes that wait to be visited: three for each level, of which 2³¹ items have 16 at most.
const MAX_PENDING: usize = 64;

/// Bounds along the axes, m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::solver) struct Bounds {
    pub low: Vec3,
    pub high: Vec3,
}

impl Bounds {
    /// Those of nothing.
    pub const EMPTY: Self = Self { low: Vec3::INFINITY, high: Vec3::NEG_INFINITY };

    /// Those of everything.
    pub const ALL: Self = Self { low: Vec3::NEG_INFINITY, high: Vec3::INFINITY };

    pub fn of_sphere(centre: Vec3, radius: f32) -> Self {
        Self { low: centre - radius, high: centre + radius }
    }

    pub fn union(self, other: Self) -> Self {
        Self { low: self.low.min(other.low), high: self.high.max(other.high) }
    }

    pub fn with(self, point: Vec3) -> Self {
        Self { low: self.low.min(point), high: self.high.max(point) }
    }

    /// Wider by `margin` m on all sides.
    pub fn grown(self, margin: f32) -> Self {
        Self { low: self.low - margin, high: self.high + margin }
    }

    #[inline]
    pub fn overlaps(&self, other: &Self) -> bool {
        self.low.cmple(other.high).all() && other.low.cmple(self.high).all()
    }

    /// How far the two are apart, m; 0 where they overlap.
    pub fn distance(&self, other: &Self) -> f32 {
        (self.low - other.high).max(other.low - self.high).max(Vec3::ZERO).length()
    }

    pub fn contains_point(&self, point: Vec3) -> bool {
        self.low.cmple(point).all() && point.cmple(self.high).all()
    }

    pub fn contains(&self, other: &Self) -> bool {
        self.low.cmple(other.low).all() && other.high.cmple(self.high).all()
    }

    fn centre(&self) -> Vec3 {
        // Half-spaces have infinite bounds.
        let centre = 0.5 * self.low + 0.5 * self.high;
        if centre.is_nan() { Vec3::ZERO } else { centre }
    }
}

#[derive(Debug, Clone, Copy)]
struct Node {
    low: [[f32; WIDTH]; 3],
    high: [[f32; WIDTH]; 3],
    children: [u32; WIDTH],
}

/// The tree.
#[derive(Debug, Clone, Default)]
pub(in crate::solver) struct Tree {
    nodes: Vec<Node>,
    items: Vec<u32>,
}

impl Tree {
    /// Builds the tree of these boxes; its items are their numbers.
    pub fn build(&mut self, bounds: &[Bounds]) {
        self.nodes.clear();
        self.items.clear();
        self.items.extend(0..bounds.len() as u32);
        if !bounds.is_empty() {
            self.add_node(bounds, 0, bounds.len());
        }
    }

    /// Adds the node of the items from `start` to `end`; its number.
    fn add_node(&mut self, bounds: &[Bounds], start: usize, end: usize) -> u32 {
        let number = self.nodes.len();
        let empty =
            Node { low: [[f32::INFINITY; 4]; 3], high: [[f32::NEG_INFINITY; 4]; 3], children: [NO_CHILD; 4] };
        self.nodes.push(empty);
        let middle = halve(&mut self.items[start..end], bounds) + start;
        let quarter = halve(&mut self.items[start..middle], bounds) + start;
        let last_quarter = halve(&mut self.items[middle..end], bounds) + middle;
        let parts = [(start, quarter), (quarter, middle), (middle, last_quarter), (last_quarter, end)];
        for (place, (start, end)) in parts.into_iter().enumerate().filter(|(_, (start, end))| start < end) {
            let own = self.items[start..end]
                .iter()
                .fold(Bounds::EMPTY, |all, item| all.union(bounds[*item as usize]));
            let child = match end - start {
                count @ ..=MAX_LEAF => LEAF | (start as u32) << 3 | count as u32,
                _ => self.add_node(bounds, start, end),
            };
            let node = &mut self.nodes[number];
            node.children[place] = child;
            for axis in 0..3 {
                node.low[axis][place] = own.low[axis];
                node.high[axis][place] = own.high[axis];
            }
        }
        number as u32
    }

    /// Calls `visit` with each item with a box that may overlap these bounds.
    #[inline]
    pub fn overlapping(&self, bounds: &Bounds, mut visit: impl FnMut(u32)) {
        let (mut pending, mut count) = ([0_u32; MAX_PENDING], usize::from(!self.nodes.is_empty()));
        while count > 0 {
            count -= 1;
            let node = &self.nodes[pending[count] as usize];
            let mut overlap = [true; WIDTH];
            for axis in 0..3 {
                for (place, overlap) in overlap.iter_mut().enumerate() {
                    *overlap &= node.low[axis][place] <= bounds.high[axis];
                    *overlap &= bounds.low[axis] <= node.high[axis][place];
                }
            }
            for (child, _) in node.children.into_iter().zip(overlap).filter(|(_, overlap)| *overlap) {
                if child & LEAF == 0 {
                    pending[count] = child;
                    count += 1;
                } else {
                    self.leaf(child).iter().for_each(|item| visit(*item));
                }
            }
        }
    }

    /// Whether the box of any leaf may overlap these bounds.
    pub fn any_overlapping(&self, bounds: &Bounds) -> bool {
        let (mut pending, mut count) = ([0_u32; MAX_PENDING], usize::from(!self.nodes.is_empty()));
        while count > 0 {
            count -= 1;
            let node = &self.nodes[pending[count] as usize];
            for place in 0..WIDTH {
                let mut overlap = node.children[place] != NO_CHILD;
                for axis in 0..3 {
                    overlap &= node.low[axis][place] <= bounds.high[axis];
                    overlap &= bounds.low[axis] <= node.high[axis][place];
                }
                let child = node.children[place];
                if overlap && child & LEAF == 0 {
                    pending[count] = child;
                    count += 1;
                } else if overlap {
                    return true;
                }
            }
        }
        false
    }

    /// Finds what is nearest to `point`, within the square of a distance, m². `visit` has the square of the distance of
    /// an item, and keeps it where it is the nearest so far; it is not called for what is farther than that.
    #[inline]
    pub fn nearest(&self, point: DVec3, within: f64, mut visit: impl FnMut(u32) -> f64) {
        let point = point.as_vec3();
        // What rounding to f32 may have changed of a distance.
        let rounding = 4.0 * f32::EPSILON * point.abs().max_element();
        let mut least = within as f32;
        let (mut pending, mut count) = ([(0.0_f32, 0_u32); MAX_PENDING], usize::from(!self.nodes.is_empty()));
        while count > 0 {
            count -= 1;
            let (distance, child) = pending[count];
            if distance > least {
                continue;
            }
            if child & LEAF != 0 {
                for item in self.leaf(child) {
                    least = least.min(visit(*item) as f32);
                }
                continue;
            }
            let first = count;
            let node = &self.nodes[child as usize];
            let mut squares = [0.0_f32; WIDTH];
            for axis in 0..3 {
                for (place, square) in squares.iter_mut().enumerate() {
                    let below = node.low[axis][place] - point[axis];
                    let above = point[axis] - node.high[axis][place];
                    let apart = (below.max(above) - rounding).max(0.0);
                    *square += apart * apart;
                }
            }
            for (child, square) in node.children.into_iter().zip(squares) {
                // A little less, for the rounding of the square itself.
                let square = square * (1.0 - 8.0 * f32::EPSILON);
                if child != NO_CHILD && square <= least {
                    // The nearest come last, and are looked at first.
                    let mut place = count;
                    while place > first && pending[place - 1].0 < square {
                        pending[place] = pending[place - 1];
                        place -= 1;
                    }
                    pending[place] = (square, child);
                    count += 1;
                }
            }
        }
    }

    fn leaf(&self, child: u32) -> &[u32] {
        // Infinite bounds overlap a place without a child, too.
        if child == NO_CHILD {
            return &[];
        }
        let (first, count) = ((child & !LEAF) >> 3, child & 7);
        &self.items[first as usize..(first + count) as usize]
    }
}

/// Orders items so that the first half lies before the second along the longest axis of their middles; the number of
/// the first half.
fn halve(items: &mut [u32], bounds: &[Bounds]) -> usize {
    let middle = items.len() / 2;
    if items.len() < 2 {
        return items.len();
    }
    let centre = |item: u32| bounds[item as usize].centre();
    let all = items.iter().fold(Bounds::EMPTY, |all, item| all.with(centre(*item)));
    let size = all.high - all.low;
    let axis = (0..3).max_by(|one, other| size[*one].total_cmp(&size[*other])).unwrap_or(0);
    items.select_nth_unstable_by(middle, |one, other| {
        centre(*one)[axis].total_cmp(&centre(*other)[axis]).then(one.cmp(other))
    });
    middle
}

/// A tree over boxes that move: it is built anew where one has left the wider box that the tree has of it.
#[derive(Debug, Clone, Default)]
pub(in crate::solver) struct MovingTree {
    tree: Tree,
    wide: Vec<Bounds>,
}

/// How much wider the boxes of a [`MovingTree`] are, as a part of their longest side.
const SLACK: f32 = 0.25;

impl MovingTree {
    /// Makes it that of these boxes.
    pub fn refresh(&mut self, bounds: &[Bounds]) {
        let is_known = self.wide.len() == bounds.len()
            && self.wide.iter().zip(bounds).all(|(wide, own)| wide.contains(own));
        if is_known {
            return;
        }
        self.wide.clear();
        self.wide.extend(bounds.iter().map(|own| own.grown(SLACK * (own.high - own.low).max_element())));
        self.tree.build(&self.wide);
    }

    /// Calls `visit` with each item with a box that may overlap these bounds, in no order.
    #[inline]
    pub fn overlapping(&self, bounds: &Bounds, visit: impl FnMut(u32)) {
        self.tree.overlapping(bounds, visit);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn boxes(count: u32) -> Vec<Bounds> {
        let place = |number: u32| (number.wrapping_mul(2_654_435_761) >> 8) as f32 / 16_777_216.0;
        let centre = |number| Vec3::new(place(number), place(number + 1000), place(number + 2000)) * 10.0;
        (0..count).map(|number| Bounds::of_sphere(centre(number), 0.3 * place(number + 3000))).collect()
    }

    #[test]
    fn it_finds_what_a_search_through_all_finds() {
        for count in [0, 1, 3, 4, 5, 17, 500] {
            let all = boxes(count);
            let mut tree = Tree::default();
            tree.build(&all);
            for (number, wanted) in boxes(40).iter().enumerate() {
                let mut found = Vec::new();
                tree.overlapping(wanted, |item| {
                    if all[item as usize].overlaps(wanted) {
                        found.push(item);
                    }
                });
                found.sort_unstable();
                let expected: Vec<u32> =
                    (0..count).filter(|item| all[*item as usize].overlaps(wanted)).collect();
                assert_eq!(found, expected, "{count} boxes, search {number}");
                let point = wanted.low.as_dvec3();
                let square = |item: u32| all[item as usize].centre().as_dvec3().distance_squared(point);
                let mut nearest = (f64::INFINITY, u32::MAX);
                tree.nearest(point, f64::INFINITY, |item| {
                    let found = square(item);
                    if found < nearest.0 {
                        nearest = (found, item);
                    }
                    nearest.0
                });
                let expected = (0..count).map(square).fold(f64::INFINITY, f64::min);
                assert_eq!(nearest.0, expected, "{count} boxes, search {number}");
            }
        }
    }

    #[test]
    fn a_moving_tree_follows_what_leaves_its_boxes() {
        let mut all = boxes(50);
        let mut tree = MovingTree::default();
        tree.refresh(&all);
        all[7] = Bounds::of_sphere(Vec3::splat(50.0), 1.0);
        tree.refresh(&all);
        let mut found = Vec::new();
        tree.overlapping(&Bounds::of_sphere(Vec3::splat(50.0), 0.1), |item| found.push(item));
        assert!(found.contains(&7), "{found:?}");
    }
}
