//! Counts what passes through what, without a line of the solver: in f64, by determinants.

use bevy::math::{DVec3, Vec3};

/// The triangles and the edges that are to be looked at, by the numbers of their particles.
#[derive(Debug, Clone, Default)]
pub struct Shapes {
    pub triangles: Vec<[usize; 3]>,
    pub edges: Vec<[usize; 2]>,
    /// Loose balls, as points.
    pub points: Vec<usize>,
}

impl Shapes {
    /// Triangles with their edges.
    pub fn of_triangles(triangles: Vec<[usize; 3]>) -> Self {
        let mut edges: Vec<[usize; 2]> =
            triangles.iter().flat_map(|[a, b, c]| [[*a, *b], [*b, *c], [*c, *a]]).collect();
        edges.iter_mut().for_each(|edge| edge.sort_unstable());
        edges.sort_unstable();
        edges.dedup();
        Self { triangles, edges, points: Vec::new() }
    }

    /// Both together.
    pub fn and(mut self, other: Self) -> Self {
        self.triangles.extend(other.triangles);
        self.edges.extend(other.edges);
        self.points.extend(other.points);
        self
    }

    /// The number of edges that pierce a triangle.
    pub fn crossings(&self, positions: &[Vec3]) -> usize {
        let place = |particle: usize| positions[particle].as_dvec3();
        let mut count = 0;
        for_each_pair(
            self.edges.iter().map(|edge| bounds(edge.iter().map(|end| place(*end)))),
            self.triangles.iter().map(|corners| bounds(corners.iter().map(|corner| place(*corner)))),
            |edge, triangle| {
                let (edge, corners) = (self.edges[edge], self.triangles[triangle]);
                let is_apart = !edge.iter().any(|end| corners.contains(end));
                count += usize::from(is_apart && pierces(edge.map(place), corners.map(place)));
            },
        );
        count
    }

    /// The number of times that an edge passes through an edge, or a point through a triangle, where all particles go
    /// straight from where they are `before` to where they are `after`.
    pub fn passings(&self, before: &[Vec3], after: &[Vec3]) -> usize {
        let path = |particle: usize| [before[particle].as_dvec3(), after[particle].as_dvec3()];
        let ends = |particles: &[usize]| bounds(particles.iter().flat_map(|particle| path(*particle)));
        let boxes = || self.edges.iter().map(|edge| ends(edge));
        let mut count = 0;
        for_each_pair(boxes(), boxes(), |one, other| {
            let (first, second) = (self.edges[one], self.edges[other]);
            if one < other && !first.iter().any(|end| second.contains(end)) {
                let [a, b, c, d] = [first[0], first[1], second[0], second[1]].map(path);
                count += passes([a, b, c, d], |[a, b, c, d]| segments_meet([a, b], [c, d]));
            }
        });
        let mut points: Vec<usize> = self.triangles.as_flattened().to_vec();
        points.extend(self.edges.as_flattened());
        points.extend(&self.points);
        points.sort_unstable();
        points.dedup();
        for_each_pair(
            points.iter().map(|point| ends(&[*point])),
            self.triangles.iter().map(|corners| ends(corners)),
            |point, triangle| {
                let (point, corners) = (points[point], self.triangles[triangle]);
                if !corners.contains(&point) {
                    let [a, b, c] = corners.map(path);
                    count += passes([path(point), a, b, c], |[p, a, b, c]| is_inside(p, [a, b, c]));
                }
            },
        );
        count
    }
}

type Bounds = [DVec3; 2];

fn bounds(points: impl Iterator<Item = DVec3>) -> Bounds {
    points.fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[least, most], point| {
        [least.min(point), most.max(point)]
    })
}

/// Calls `visit` for each pair whose boxes overlap.
fn for_each_pair(
    ones: impl Iterator<Item = Bounds>,
    others: impl Iterator<Item = Bounds>,
    mut visit: impl FnMut(usize, usize),
) {
    let others: Vec<Bounds> = others.collect();
    let mut order: Vec<usize> = (0..others.len()).collect();
    order.sort_by(|one, other| others[*one][0].x.total_cmp(&others[*other][0].x));
    let widest = others.iter().map(|[least, most]| most.x - least.x).fold(0.0, f64::max);
    for (one, [least, most]) in ones.enumerate() {
        let first = order.partition_point(|other| others[*other][0].x < least.x - widest);
        for other in order[first..].iter().take_while(|other| others[**other][0].x <= most.x) {
            let [other_least, other_most] = others[*other];
            if least.cmple(other_most).all() && other_least.cmple(most).all() {
                visit(one, *other);
            }
        }
    }
}

/// Six times the volume of a tetrahedron.
fn volume([a, b, c, d]: [DVec3; 4]) -> f64 {
    (b - a).cross(c - a).dot(d - a)
}

/// Whether an edge goes through the inside of a triangle.
fn pierces([p, q]: [DVec3; 2], [a, b, c]: [DVec3; 3]) -> bool {
    let sides = [volume([a, b, c, p]), volume([a, b, c, q])];
    if sides[0] * sides[1] >= 0.0 {
        return false;
    }
    let around = [volume([p, q, a, b]), volume([p, q, b, c]), volume([p, q, c, a])];
    around.iter().all(|volume| *volume > 0.0) || around.iter().all(|volume| *volume < 0.0)
}

/// How often four points that move straight are in one plane, with what `meets` then.
fn passes(paths: [[DVec3; 2]; 4], meets: impl Fn([DVec3; 4]) -> bool) -> usize {
    let at = |time: f64| paths.map(|[from, to]| from.lerp(to, time));
    let value = |time: f64| volume(at(time));
    // A cubic, from four values: its derivative is a quadratic, between whose roots it is monotonous.
    let [f0, f1, f2, f3] = [0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0].map(value);
    let c3 = 4.5 * (f3 - 3.0 * f2 + 3.0 * f1 - f0);
    let c2 = 4.5 * (2.0 * f0 - 5.0 * f1 + 4.0 * f2 - f3);
    let c1 = -5.5 * f0 + 9.0 * f1 - 4.5 * f2 + f3;
    let mut cuts = vec![0.0];
    let discriminant = c2 * c2 - 3.0 * c3 * c1;
    if discriminant > 0.0 {
        let root = discriminant.sqrt();
        let q = -(c2 + c2.signum() * root);
        cuts.extend([q / (3.0 * c3), c1 / q].into_iter().filter(|time| *time > 0.0 && *time < 1.0));
    } else if c3 == 0.0 && c2 != 0.0 {
        cuts.push((-0.5 * c1 / c2).clamp(0.0, 1.0));
    }
    cuts.push(1.0);
    cuts.sort_by(f64::total_cmp);
    let mut count = 0;
    for interval in cuts.windows(2) {
        let [mut low, mut high] = [interval[0], interval[1]];
        if value(low) * value(high) >= 0.0 {
            continue;
        }
        for _ in 0..100 {
            let middle = 0.5 * (low + high);
            if value(low) * value(middle) <= 0.0 { high = middle } else { low = middle }
        }
        count += usize::from(meets(at(0.5 * (low + high))));
    }
    count
}

/// Whether two segments that are in one plane meet.
fn segments_meet([a, b]: [DVec3; 2], [c, d]: [DVec3; 2]) -> bool {
    let normal = (b - a).cross(d - c);
    let side = |p: DVec3, q: DVec3, x: DVec3| (q - p).cross(x - p).dot(normal);
    side(a, b, c) * side(a, b, d) < 0.0 && side(c, d, a) * side(c, d, b) < 0.0
}

/// Whether a point in the plane of a triangle is inside of it.
fn is_inside(p: DVec3, [a, b, c]: [DVec3; 3]) -> bool {
    let normal = (b - a).cross(c - a);
    [[a, b], [b, c], [c, a]].iter().all(|[from, to]| (*to - *from).cross(p - *from).dot(normal) > 0.0)
}

#[test]
fn the_counter_counts() {
    let places = |z: f32| {
        [
            Vec3::new(-1.0, -1.0, 0.0),
            Vec3::new(1.0, -1.0, 0.0),
            Vec3::new(0.0, 1.0, 0.0),
            Vec3::new(0.0, 0.0, z),
            Vec3::new(0.1, 0.0, z + 1.0),
        ]
    };
    let shapes =
        Shapes::of_triangles(vec![[0, 1, 2]]).and(Shapes { edges: vec![[3, 4]], ..Shapes::default() });
    assert_eq!([0.5, -0.5, -1.5].map(|z| shapes.crossings(&places(z))), [0, 1, 0]);
    assert_eq!(shapes.passings(&places(0.5), &places(-0.5)), 1, "an end goes through");
    assert_eq!(shapes.passings(&places(0.5), &places(0.1)), 0);
    assert_eq!(shapes.passings(&places(0.5), &places(-1.5)), 2, "both do");
    let bar = |y: f32| {
        [Vec3::new(-1.0, y, 0.5), Vec3::new(1.0, y, 0.5), Vec3::new(0.0, 0.0, -1.0), Vec3::new(0.1, 0.0, 1.0)]
    };
    let bars = Shapes { edges: vec![[0, 1], [2, 3]], ..Shapes::default() };
    assert_eq!([0.5, -0.5].map(|y| bars.passings(&bar(1.0), &bar(y))), [0, 1]);
}
