//! Walks down the trees of all bodies, to the clusters with overlapping boxes, which are then looked at on all threads.

use std::sync::atomic::{AtomicUsize, Ordering};

use bevy::math::Vec3A;

use super::lanes::Lanes;
use super::order::path_to;
use super::pair_collector::{PairCollector, PairQuery, is_one_family};
use super::search::Candidate;
use super::spread::enlarged;
use super::tree::{Box3, Forest, Node};
use crate::solver::parallel;

/// Number of tasks of a part of the work.
const PART: usize = 32;

/// Number of tasks from which on all threads take part: some milliseconds of work.
const MIN_SHARED: usize = 512;

/// Number of tasks that are kept, at most.
const MAX_TASKS: usize = 1 << 16;

/// Clusters in which pairs are looked for.
#[derive(Debug, Clone, Copy)]
enum Task {
    /// Two leaves of trees, of one body or of two, or twice the same one.
    Leaves { nodes: [u32; 2], is_within: bool },
    /// The ball in a slot, and a leaf.
    Ball { slot: u32, node: u32 },
}

/// Boxes and working memory.
#[derive(Debug, Clone, Default)]
pub(super) struct Walks {
    /// The boxes of nodes, with their body and in the world.
    nodes: [Vec<Box3>; 2],
    /// By node: whether a vertex in it has begun anew in the last renewal.
    is_fresh: Vec<bool>,
    lanes: Lanes,
    /// By body: its box, where it has been.
    pub body_boxes: Vec<Box3>,
    order: Vec<(f32, u32)>,
    /// The pairs of bodies, balls behind them, with overlapping boxes.
    partners: Vec<[u32; 2]>,
    stack: Vec<[u32; 2]>,
    tasks: Vec<Task>,
    parts: Vec<Vec<Candidate>>,
    /// The number of pairs from which on there are too many.
    limit: usize,
}

impl Walks {
    /// Finds all pairs with overlapping boxes, in an order that follows from the mesh alone; false, and none, where
    /// there are `limit` or more.
    /// The `boxes` are those of vertices, by slot, with their body and in the world. By body: in how many `frames` it is near something,
    /// 1 or 0 if it has diverged, to which those are added that have a partner; and its displacement as a whole, m.
    pub fn find(
        &mut self,
        (query, limit): (PairQuery, usize),
        boxes: &[Vec<Box3>; 2],
        (frames, drifts): (&mut [usize], &[Vec3A]),
        candidates: &mut Vec<Candidate>,
    ) -> bool {
        let forest = &query.primitives.forest;
        self.fit(query, boxes);
        self.body_boxes.clear();
        let roots = forest.bodies.iter().map(|body| self.nodes[1][body.nodes.start as usize]);
        self.body_boxes.extend(roots.zip(drifts).map(|(root, displacement)| enlarged(root, *displacement)));
        self.find_partners(query, &boxes[1], frames);
        let bodies = frames.len() as u32;
        for body in self.partners.iter().flatten().filter(|body| **body < bodies) {
            frames[*body as usize] = 2;
        }
        candidates.clear();
        self.walk_all((query, limit), boxes, frames, candidates);
        let is_overfull = candidates.len() >= limit;
        if is_overfull {
            candidates.clear();
        }
        !is_overfull
    }

    /// Appends the pairs of what has begun anew since all were found, with other boxes; false where there are `limit` or more.
    pub fn find_renewed(
        &mut self,
        (query, limit): (PairQuery, usize),
        boxes: &[Vec<Box3>; 2],
        frames: &[usize],
        candidates: &mut Vec<Candidate>,
    ) -> bool {
        self.fit(query, boxes);
        self.walk_all((query, limit), boxes, frames, candidates);
        candidates.len() < limit
    }

    fn walk_all(
        &mut self,
        (query, limit): (PairQuery, usize),
        boxes: &[Vec<Box3>; 2],
        frames: &[usize],
        candidates: &mut Vec<Candidate>,
    ) {
        let PairQuery { primitives, particles, displacements, .. } = query;
        let forest = &primitives.forest;
        self.limit = limit;
        self.tasks.clear();
        self.lanes.begin(primitives, displacements);
        let families = particles.families();
        for (body, _) in forest.bodies.iter().zip(frames).filter(|(_, frames)| **frames > 0) {
            if !is_one_family(forest.vertices_of(body), families) {
                self.walk([body.nodes.start; 2], true, (query, boxes, candidates));
            }
        }
        let partners = std::mem::take(&mut self.partners);
        let bodies = forest.bodies.len() as u32;
        for [one, other] in partners.iter().copied() {
            let root = forest.bodies[one as usize].nodes.start;
            match other.checked_sub(bodies) {
                None => {
                    let other = forest.bodies[other as usize].nodes.start;
                    self.walk([root, other], false, (query, boxes, candidates));
                }
                Some(ball) => {
                    self.walk_ball(root, primitives.balls[ball as usize], forest, &boxes[1]);
                }
            }
        }
        self.partners = partners;
        self.work((query, boxes, candidates));
    }

    /// Finds the nodes of what has begun anew, and fits their boxes.
    fn fit(&mut self, PairQuery { primitives, displacements, .. }: PairQuery, boxes: &[Vec<Box3>; 2]) {
        let Self { nodes, is_fresh, .. } = self;
        let forest = &primitives.forest;
        is_fresh.resize(forest.nodes.len(), false);
        for (number, Node { second, is_leaf }) in forest.nodes.iter().enumerate().rev() {
            is_fresh[number] = match is_leaf {
                true => displacements.any_renewed(forest.corners_of(&forest.clusters[*second as usize])),
                false => is_fresh[number + 1] || is_fresh[*second as usize],
            };
        }
        for (nodes, boxes) in nodes.iter_mut().zip(boxes) {
            nodes.resize(forest.nodes.len(), Box3::NOTHING);
            forest.fit(|node| is_fresh[node], boxes, nodes);
        }
    }

    /// Finds the pairs of bodies, and of bodies and balls, with overlapping boxes.
    fn find_partners(
        &mut self,
        PairQuery { primitives, .. }: PairQuery,
        vertices: &[Box3],
        frames: &[usize],
    ) {
        // The boxes of bodies, swept along x; balls are bodies, too.
        let Self { body_boxes, order, partners, .. } = self;
        order.clear();
        let present = (0..).zip(&*body_boxes).filter(|(number, _)| frames[*number as usize] > 0);
        order.extend(present.map(|(number, body)| (body.least.x, number)));
        let bodies = body_boxes.len() as u32;
        let balls = (bodies..).zip(&primitives.balls);
        order.extend(balls.map(|(number, slot)| (vertices[*slot as usize].least.x, number)));
        order.sort_unstable_by(|(one, a), (other, b)| one.total_cmp(other).then(a.cmp(b)));
        let box_of = |number: u32| match number.checked_sub(bodies) {
            None => body_boxes[number as usize],
            Some(ball) => vertices[primitives.balls[ball as usize] as usize],
        };
        partners.clear();
        for (place, (_, one)) in order.iter().enumerate() {
            let own = box_of(*one);
            let others = order[place + 1..].iter().take_while(|(least, _)| *least <= own.most.x);
            for (_, other) in others {
                let is_mesh = *one < bodies || *other < bodies;
                if is_mesh && own.overlaps(&box_of(*other)) {
                    partners.push([*one.min(other), *one.max(other)]);
                }
            }
        }
        partners.sort_unstable();
    }

    /// Lists the leaves with overlapping boxes below two nodes.
    fn walk(
        &mut self,
        pair: [u32; 2],
        is_within: bool,
        (query, boxes, candidates): (PairQuery, &[Vec<Box3>; 2], &mut Vec<Candidate>),
    ) {
        let forest = &query.primitives.forest;
        self.stack.clear();
        self.stack.push(pair);
        while let Some([one, other]) = self.stack.pop() {
            if self.tasks.len() >= MAX_TASKS {
                self.work((query, boxes, candidates));
            }
            if candidates.len() >= self.limit {
                return;
            }
            let Self { stack, tasks, nodes, is_fresh, .. } = self;
            if !is_fresh[one as usize] && !is_fresh[other as usize] {
                continue;
            }
            let nodes = &nodes[usize::from(!is_within)];
            let [first, second] = [one, other].map(|node| forest.nodes[node as usize]);
            if one == other {
                match first.is_leaf {
                    true => tasks.push(Task::Leaves { nodes: [one; 2], is_within }),
                    false => stack.extend([
                        [one + 1, one + 1],
                        [first.second, first.second],
                        [one + 1, first.second],
                    ]),
                }
                continue;
            }
            if !nodes[one as usize].overlaps(&nodes[other as usize]) {
                continue;
            }
            match (first.is_leaf, second.is_leaf) {
                (true, true) => tasks.push(Task::Leaves { nodes: [one, other], is_within }),
                (false, true) => stack.extend([[one + 1, other], [first.second, other]]),
                (true, false) => stack.extend([[one, other + 1], [one, second.second]]),
                (false, false) => stack.extend([
                    [one + 1, other + 1],
                    [one + 1, second.second],
                    [first.second, other + 1],
                    [first.second, second.second],
                ]),
            }
        }
    }

    /// Lists the leaves below a node with boxes that overlap that of a ball.
    fn walk_ball(&mut self, root: u32, slot: u32, forest: &Forest, vertices: &[Box3]) {
        let own = vertices[slot as usize];
        self.stack.clear();
        self.stack.push([root; 2]);
        while let Some([node, _]) = self.stack.pop() {
            if !self.is_fresh[node as usize] || !self.nodes[1][node as usize].overlaps(&own) {
                continue;
            }
            let second = forest.nodes[node as usize].second;
            match forest.nodes[node as usize].is_leaf {
                true => self.tasks.push(Task::Ball { slot, node }),
                false => self.stack.extend([[node + 1; 2], [second; 2]]),
            }
        }
    }

    /// Does all tasks, and appends the pairs in their order.
    fn work(&mut self, (query, boxes, candidates): (PairQuery, &[Vec<Box3>; 2], &mut Vec<Candidate>)) {
        let Self { tasks, parts, lanes, nodes: around, .. } = self;
        let PairQuery { primitives, particles, displacements, .. } = query;
        let forest = &primitives.forest;
        for task in &*tasks {
            if let Task::Leaves { nodes, .. } = task {
                let numbers = nodes.map(|node| forest.nodes[node as usize].second);
                numbers
                    .iter()
                    .for_each(|number| lanes.fill(*number, (primitives, particles.radius()), displacements));
            }
        }
        let lanes = &*lanes;
        let (most, count) = (self.limit, AtomicUsize::new(candidates.len()));
        let cluster = |node: u32| forest.nodes[node as usize].second;
        let number = tasks.len().div_ceil(PART);
        if parts.len() < number {
            parts.resize(number, Vec::new());
        }
        let is_shared = tasks.len() >= MIN_SHARED;
        parallel::for_each(tasks.chunks(PART).zip(&mut *parts), is_shared, |(tasks, found)| {
            // Where there are too many, none is wanted.
            if count.load(Ordering::Relaxed) >= most {
                return;
            }
            let mut collector = PairCollector { query, lanes, path: 0, candidates: found };
            let root = |node: u32| {
                let corner = forest.corners_of(&forest.clusters[cluster(node) as usize])[0];
                forest.bodies[primitives.body_of[corner as usize] as usize].nodes.start
            };
            for task in tasks {
                match *task {
                    Task::Leaves { nodes, is_within } => {
                        collector.path = path_to(nodes.map(root), nodes, forest);
                        let frame = usize::from(!is_within);
                        let around = nodes.map(|node| around[frame][node as usize]);
                        collector.test_clusters(nodes.map(cluster), is_within, around, &boxes[frame]);
                    }
                    Task::Ball { slot, node } => {
                        collector.path = path_to([root(node), node], [node; 2], forest);
                        collector.test_ball(slot, cluster(node), &boxes[1]);
                    }
                }
            }
            count.fetch_add(collector.candidates.len(), Ordering::Relaxed);
        });
        parts[..number].iter_mut().for_each(|found| candidates.append(found));
        tasks.clear();
    }
}
