//! What the particles of an implicit step may not enter: planes and pinned spheres, as they are at its end.

use bevy::math::DVec3;

use super::{ContactMemory, ContactPartner, Plane};
use crate::solver::particles::Particles;
use crate::solver::settings::StepSettings;

/// All that may be touched in an implicit step.
#[derive(Clone, Copy)]
pub(in crate::solver) struct Surroundings<'a> {
    pub planes: &'a [Plane],
    pub settings: &'a StepSettings,
    pub memory: &'a ContactMemory,
    /// The fraction of the tick that has passed at the end of the step.
    pub elapsed: f32,
    /// Whether each particle is no sphere of its own; empty if all are.
    pub covered: &'a [bool],
}

/// Something solid that nothing in the step can move.
#[derive(Debug, Clone, Copy)]
pub(in crate::solver) struct Obstacle {
    pub partner: ContactPartner,
    shape: Shape,
    /// Its velocity at a point p is `velocity` + `angular_velocity` × (p − `pivot`): m/s, rad/s, m.
    velocity: DVec3,
    angular_velocity: DVec3,
    pivot: DVec3,
    /// Coefficient of restitution, 0 to 1.
    pub restitution: f64,
    /// Coefficient of Coulomb friction, >= 0.
    pub friction: f64,
}

#[derive(Debug, Clone, Copy)]
enum Shape {
    /// All below the plane through `point`, m, of outward unit normal `normal`.
    HalfSpace { point: DVec3, normal: DVec3 },
    /// m.
    Sphere { centre: DVec3, radius: f64 },
}

impl Obstacle {
    /// The distance in m of a sphere from its surface, negative if they overlap, and the unit vector away from it.
    pub fn gap(&self, position: DVec3, radius: f64) -> (f64, DVec3) {
        match self.shape {
            Shape::HalfSpace { point, normal } => ((position - point).dot(normal) - radius, normal),
            Shape::Sphere { centre, radius: own } => {
                let apart = position - centre;
                let distance = apart.length();
                let normal = if distance > 0.0 { apart / distance } else { DVec3::Y };
                (distance - own - radius, normal)
            }
        }
    }

    /// The slot of the pinned particle that it is, if it is one.
    pub fn pinned_slot(&self) -> Option<usize> {
        match self.partner {
            ContactPartner::Particle(slot) => Some(slot),
            ContactPartner::Plane(_) => None,
        }
    }

    /// The velocity of its surface at a point, m/s.
    pub fn velocity_at(&self, point: DVec3) -> DVec3 {
        self.velocity + self.angular_velocity.cross(point - self.pivot)
    }

    fn of_plane(index: usize, plane: &Plane, elapsed: f32, time_step: f32) -> Self {
        let surface = plane.surface(elapsed, time_step);
        Self {
            partner: ContactPartner::Plane(index),
            shape: Shape::HalfSpace {
                point: surface.point.as_dvec3(),
                normal: surface.normal.as_dvec3().normalize(),
            },
            velocity: surface.velocity.as_dvec3(),
            angular_velocity: surface.angular_velocity.as_dvec3(),
            pivot: surface.point.as_dvec3(),
            restitution: f64::from(plane.restitution),
            friction: f64::from(plane.friction),
        }
    }
}

/// The obstacles of one implicit step.
#[derive(Debug, Clone, Default)]
pub(in crate::solver) struct Obstacles {
    planes: Vec<Obstacle>,
    /// By the least x that they reach.
    spheres: Vec<(f64, Obstacle)>,
    /// The largest diameter of the spheres, m.
    largest: f64,
    /// The longest way of one of them in the step, m.
    longest_way: f64,
}

impl Obstacles {
    /// Makes them those at the end of a step of `duration` seconds; pinned particles are where they were at its
    /// start.
    pub fn gather(&mut self, particles: &Particles, surroundings: Surroundings, duration: f64) {
        let Surroundings { planes, settings, elapsed, .. } = surroundings;
        self.planes.clear();
        self.spheres.clear();
        (self.largest, self.longest_way) = (0.0, 0.0);
        if settings.collide_with_planes {
            let planes = planes.iter().enumerate();
            let time_step = settings.time_step;
            self.planes
                .extend(planes.map(|(index, plane)| Obstacle::of_plane(index, plane, elapsed, time_step)));
        }
        let Some(rules) = settings.pair_rules else { return };
        let pinned = particles.radius().iter().enumerate();
        for (slot, radius) in pinned.filter(|(slot, radius)| **radius > 0.0 && particles.is_pinned(*slot)) {
            let (velocity, radius) = (particles.velocity.get(slot).as_dvec3(), f64::from(*radius));
            let centre = particles.position.get(slot).as_dvec3() + duration * velocity;
            let obstacle = Obstacle {
                partner: ContactPartner::Particle(slot),
                shape: Shape::Sphere { centre, radius },
                velocity,
                angular_velocity: DVec3::ZERO,
                pivot: centre,
                restitution: f64::from(rules.restitution),
                friction: f64::from(rules.friction),
            };
            self.spheres.push((centre.x - radius, obstacle));
            self.largest = self.largest.max(2.0 * radius);
            self.longest_way = self.longest_way.max(duration * velocity.length());
        }
        self.spheres.sort_by(|(one, _), (other, _)| one.total_cmp(other));
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.planes.is_empty() && self.spheres.is_empty()
    }

    /// Calls `found` for each obstacle that a sphere at `position` may touch on a way of `reach` m in `duration`
    /// seconds.
    pub fn near(
        &self,
        position: DVec3,
        radius: f64,
        [reach, duration]: [f64; 2],
        mut found: impl FnMut(&Obstacle),
    ) {
        let mut test = |obstacle: &Obstacle| {
            let own_way = duration * obstacle.velocity_at(position).length();
            if obstacle.gap(position, radius).0 <= reach + own_way {
                found(obstacle);
            }
        };
        self.planes.iter().for_each(&mut test);
        let reach = radius + reach + self.longest_way;
        let (least, most) = (position.x - reach - self.largest, position.x + reach);
        let first = self.spheres.partition_point(|(x, _)| *x < least);
        self.spheres[first..].iter().take_while(|(x, _)| *x <= most).for_each(|(_, sphere)| test(sphere));
    }
}
