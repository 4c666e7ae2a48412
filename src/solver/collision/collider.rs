//! Colliders: solids with a prescribed motion, and their poses in a substep.

use bevy::math::{DVec3, Quat, Vec3};

use super::material::{Layers, Material};
use super::plane::Pose;
use super::shapes::{Bounds, MovingTree, Placement, Shape};

/// A solid that moves from `start` to `target` during the tick.
#[derive(Debug, Clone)]
pub struct Collider {
    /// What it looks like.
    pub shape: Shape,
    /// Pose at the start of the tick.
    pub start: Pose,
    /// Pose at the end of the tick.
    pub target: Pose,
    /// How it rebounds and rubs.
    pub material: Material,
    /// The velocity of its surface in its own axes, beside that of its motion, m/s: a conveyor.
    pub surface_velocity: Vec3,
    /// Which particles it touches.
    pub layers: Layers,
    /// Whether it exerts no force, and is only reported in the contacts.
    pub is_sensor: bool,
}

impl Collider {
    /// One at rest, without friction, that touches all.
    pub fn resting(shape: Shape, pose: Pose) -> Self {
        Self {
            shape,
            start: pose,
            target: pose,
            material: Material::default(),
            surface_velocity: Vec3::ZERO,
            layers: Layers::ALL,
            is_sensor: false,
        }
    }

    /// The half-space below a plane at rest through `point` with unit normal `normal`.
    pub fn half_space(point: Vec3, normal: Vec3, restitution: f32, friction: f32) -> Self {
        let pose = Pose { point, rotation: Quat::from_rotation_arc(Vec3::Y, normal) };
        let material = Material { restitution, friction, ..Material::default() };
        Self { material, ..Self::resting(Shape::HALF_SPACE, pose) }
    }

    /// Whether it is a solid half-space, for which particles are tested in vectors.
    pub(super) fn is_plane(&self) -> bool {
        self.shape.is_half_space() && !self.is_sensor
    }

    /// What bounds it during the whole tick.
    pub(super) fn bounds(&self) -> Bounds {
        let Self { shape, start, target, .. } = self;
        if start.rotation == target.rotation {
            return shape.bounds(*start).union(shape.bounds(*target));
        }
        let reach = shape.reach();
        Bounds::of_sphere(start.point, reach).union(Bounds::of_sphere(target.point, reach))
    }

    /// Where it is between two parts of the tick of `time_step` seconds.
    pub(super) fn between(&self, [from, to]: [f32; 2], time_step: f32) -> SubstepMotion {
        let Self { start, target, .. } = self;
        if !self.moves() {
            let place = Placement::new(*target);
            return SubstepMotion {
                from: place,
                to: place,
                velocity: DVec3::ZERO,
                angular_velocity: DVec3::ZERO,
            };
        }
        let change = (target.rotation.as_dquat() * start.rotation.as_dquat().inverse()).normalize();
        let change = if change.w < 0.0 { -change } else { change };
        let time_step = f64::from(time_step);
        SubstepMotion {
            from: Placement::between(*start, *target, from.into()),
            to: Placement::between(*start, *target, to.into()),
            velocity: (target.point.as_dvec3() - start.point.as_dvec3()) / time_step,
            angular_velocity: change.to_scaled_axis() / time_step,
        }
    }
}

/// The motion of a collider in a substep.
#[derive(Debug, Clone, Copy)]
pub(in crate::solver) struct SubstepMotion {
    /// Where it is at the start of it, and at its end.
    pub from: Placement,
    pub to: Placement,
    /// m/s.
    pub velocity: DVec3,
    /// rad/s.
    pub angular_velocity: DVec3,
}

impl SubstepMotion {
    /// Whether it does not move.
    pub fn is_at_rest(&self) -> bool {
        self.velocity == DVec3::ZERO && self.angular_velocity == DVec3::ZERO
    }

    /// The velocity of its surface at a point at the end, m/s, that of a conveyor included.
    pub fn velocity_at(&self, collider: &Collider, point: DVec3) -> DVec3 {
        if self.is_at_rest() && collider.surface_velocity == Vec3::ZERO {
            return DVec3::ZERO;
        }
        self.velocity + self.angular_velocity.cross(point - self.to.point) + self.sliding(collider)
    }

    /// The velocity of a conveyor, m/s.
    pub fn sliding(&self, collider: &Collider) -> DVec3 {
        self.to.rotation * collider.surface_velocity.as_dvec3()
    }
}

/// The colliders that are no solid half-spaces: where they are, and a tree of them.
#[derive(Debug, Clone, Default)]
pub(in crate::solver) struct Placed {
    /// Their numbers among all colliders.
    pub numbers: Vec<u32>,
    /// What bounds each of them during the tick.
    pub bounds: Vec<Bounds>,
    pub motions: Vec<SubstepMotion>,
    /// The numbers of the solid half-spaces.
    pub planes: Vec<u32>,
    tree: MovingTree,
    /// The places of those that move in the tick.
    moving: Vec<u32>,
    /// Of which shape and pose each was in the last tick, if it was at rest.
    resting: Vec<Option<(Shape, Pose)>>,
}

impl Placed {
    /// To be called when a tick begins.
    pub fn begin_tick(&mut self, colliders: &[Collider], time_step: f32) {
        self.planes.clear();
        self.moving.clear();
        let mut place = 0;
        let mut is_known = true;
        for (number, collider) in (0..).zip(colliders) {
            if collider.is_plane() {
                self.planes.push(number);
                continue;
            }
            if collider.moves() {
                self.moving.push(place as u32);
            }
            let known = self.resting.get(place).is_some_and(|known| {
                self.numbers[place] == number
                    && known.as_ref().is_some_and(|(shape, pose)| {
                        *pose == collider.start && !collider.moves() && shape.is_same(&collider.shape)
                    })
            });
            if !known {
                is_known = false;
                self.place(place, number, collider, time_step);
            }
            place += 1;
        }
        is_known &= place == self.numbers.len();
        self.numbers.truncate(place);
        self.bounds.truncate(place);
        self.motions.truncate(place);
        self.resting.truncate(place);
        if !is_known {
            self.tree.refresh(&self.bounds);
        }
    }

    /// Computes what is known of a collider at the start of a tick.
    fn place(&mut self, place: usize, number: u32, collider: &Collider, time_step: f32) {
        let (bounds, motion) = (collider.bounds(), collider.between([0.0, 1.0], time_step));
        let resting = (!collider.moves()).then(|| (collider.shape.clone(), collider.start));
        if place == self.numbers.len() {
            self.numbers.push(number);
            self.bounds.push(bounds);
            self.motions.push(motion);
            self.resting.push(resting);
        } else {
            self.numbers[place] = number;
            self.bounds[place] = bounds;
            self.motions[place] = motion;
            self.resting[place] = resting;
        }
    }

    /// To be called when a substep between two parts of the tick begins.
    pub fn begin_substep(&mut self, colliders: &[Collider], parts: [f32; 2], time_step: f32) {
        for place in self.moving.iter().map(|place| *place as usize) {
            self.motions[place] = colliders[self.numbers[place] as usize].between(parts, time_step);
        }
    }

    /// The places of those that move in the tick.
    pub fn moving(&self) -> impl Iterator<Item = usize> {
        self.moving.iter().map(|place| *place as usize)
    }

    /// No point of a surface moves farther in the substep, m.
    pub fn max_displacement(&self, place: usize, colliders: &[Collider]) -> f32 {
        let collider = &colliders[self.numbers[place] as usize];
        if !collider.moves() {
            return 0.0;
        }
        let SubstepMotion { from, to, .. } = self.motions[place];
        // Columns of a rotation differ by the displacements of points at a distance of 1 on the axes.
        let turned =
            (to.rotation - from.rotation).to_cols_array().iter().map(|part| part * part).sum::<f64>();
        let displacement = from.point.distance(to.point) + turned.sqrt() * f64::from(collider.shape.reach());
        if displacement.is_nan() { f32::INFINITY } else { displacement as f32 * (1.0 + f32::EPSILON) }
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.numbers.is_empty()
    }

    /// Writes the places of those that may overlap these bounds into `near`, in order.
    pub fn near(&self, bounds: &Bounds, near: &mut Vec<u32>) {
        near.clear();
        self.tree.overlapping(bounds, |place| {
            if self.bounds[place as usize].overlaps(bounds) {
                near.push(place);
            }
        });
        near.sort_unstable();
    }

    /// Calls `visit` with the places of those that may overlap these bounds, in order.
    pub fn for_each_near(&self, bounds: &Bounds, mut visit: impl FnMut(usize)) {
        // Few are near a particle: each is found by the least place above that of the last one.
        let mut next = 0;
        loop {
            let mut least = u32::MAX;
            self.tree.overlapping(bounds, |place| {
                if place >= next && place < least && self.bounds[place as usize].overlaps(bounds) {
                    least = place;
                }
            });
            if least == u32::MAX {
                return;
            }
            visit(least as usize);
            next = least + 1;
        }
    }
}
