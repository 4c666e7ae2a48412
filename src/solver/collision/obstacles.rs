//! What the particles of an implicit step may not enter: colliders and pinned spheres, as they are at its end.

use bevy::math::DVec3;

use super::collider::{Collider, Placed, SubstepMotion};
use super::features::Feature;
use super::material::{ContactProperties, properties_of};
use super::shapes::{Bounds, CornerPaths, Mesh, Nearest, Placement, Shape, Vicinity};
use super::stiff_pairs::touch;
use super::{ContactMemory, ContactPartner};
use crate::solver::particles::Particles;
use crate::solver::settings::StepSettings;
use crate::solver::state::Version;

/// All that may be touched in an implicit step.
#[derive(Clone, Copy)]
pub(in crate::solver) struct Surroundings<'a> {
    pub colliders: &'a [Collider],
    pub properties: &'a [ContactProperties],
    pub settings: &'a StepSettings,
    pub memory: &'a ContactMemory,
    /// The edges and triangles of nets that collide, and their version.
    pub features: &'a [Feature],
    pub features_version: Version,
    /// The fraction of the tick that has passed at the end of the step.
    pub elapsed: f32,
    /// Whether each particle is no sphere of its own; empty if all are.
    pub covered: &'a [bool],
}

/// Something solid that nothing in the step can move.
#[derive(Debug, Clone)]
pub(in crate::solver) struct Obstacle {
    pub partner: ContactPartner,
    form: Form,
    /// Its velocity at a point p is `velocity` + `angular_velocity` × (p − `pivot`) + `sliding`: m/s, rad/s, m.
    velocity: DVec3,
    angular_velocity: DVec3,
    pivot: DVec3,
    /// The velocity of a conveyor, m/s.
    sliding: DVec3,
    /// Coefficient of restitution, 0 to 1.
    pub restitution: f64,
    /// Coefficient of Coulomb friction, >= 0.
    pub friction: f64,
}

#[derive(Debug, Clone)]
enum Form {
    /// All below the plane through `point`, m, of outward unit normal `normal`.
    HalfSpace { point: DVec3, normal: DVec3 },
    /// A pinned particle, which has come to `centre` by `displacement`; m.
    Sphere { centre: DVec3, radius: f64, displacement: DVec3 },
    /// A collider; `from` is where it is at the start of the step, `side` that of a sheet on which a particle is.
    Solid { shape: Shape, from: Placement, to: Placement, side: f64 },
}

impl Obstacle {
    /// The distance in m of a sphere from its surface, negative if they overlap, and the unit vector away from it.
    pub fn gap(&self, position: DVec3, radius: f64) -> (f64, DVec3) {
        self.gap_by(position, radius, |_, _| None)
    }

    /// The same, from what is known of a mesh near by.
    pub fn gap_known(&self, position: DVec3, radius: f64, vicinity: &Vicinity) -> (f64, DVec3) {
        self.gap_by(position, radius, |mesh, place| vicinity.known(mesh, place))
    }

    /// The same; what is known then reaches about `margin` m further.
    pub fn gap_near(&self, position: DVec3, radius: f64, near: (&mut Vicinity, f64)) -> (f64, DVec3) {
        let (vicinity, margin) = near;
        self.gap_by(position, radius, |mesh, place| vicinity.nearest(mesh, place, f64::INFINITY, || margin))
    }

    /// The same, where `look_up` may find the nearest point of a mesh, seen from a side.
    #[inline]
    fn gap_by(
        &self,
        position: DVec3,
        radius: f64,
        look_up: impl FnOnce(&Mesh, (DVec3, f64)) -> Option<Nearest>,
    ) -> (f64, DVec3) {
        match &self.form {
            Form::HalfSpace { point, normal } => ((position - point).dot(*normal) - radius, *normal),
            Form::Sphere { centre, radius: own, .. } => {
                let apart = position - centre;
                let distance = apart.length();
                let normal = if distance > 0.0 { apart / distance } else { DVec3::Y };
                (distance - own - radius, normal)
            }
            Form::Solid { shape, to, side, .. } => {
                let place = (to.to_local(position), *side);
                let known = shape.as_mesh().and_then(|mesh| look_up(mesh, place));
                let nearest = known.unwrap_or_else(|| shape.nearest(place.0, *side));
                (nearest.distance - radius, to.direction(shape, nearest.normal))
            }
        }
    }

    /// The plane that a sphere meets on its way from `start` to `end` and would pass through: as an obstacle.
    pub fn met(&self, [start, end]: [DVec3; 2], radius: f64) -> Option<Self> {
        let (shape, from, to) = match &self.form {
            Form::HalfSpace { .. } => return None,
            Form::Sphere { centre, radius: own, displacement } => {
                let point = passed([start - (centre - displacement), end - centre], *own, radius)?;
                let form = Form::HalfSpace { point: centre + point, normal: point.normalize() };
                return Some(Self { form, ..self.clone() });
            }
            Form::Solid { shape, from, to, .. } => (shape, from, to),
        };
        let (from, end) = (from.to_local(start), to.to_local(end));
        let kept = SWEEP_THRESHOLD * radius;
        if from.distance_squared(end) <= kept * kept {
            return None;
        }
        let touch = shape.first_touch(from, end, kept)?;
        let form =
            Form::HalfSpace { point: to.to_world(touch.foot), normal: to.direction(shape, touch.normal) };
        Some(Self { form, ..self.clone() })
    }

    /// The point of an edge (`count` 2) or triangle that is deepest in it at the end of straight paths of the corners, and it
    /// as that point meets it, on the way where it `is_swept`; `None` if none touches but corners.
    pub fn deepest(
        &self,
        count: usize,
        ([start, end], is_swept): ([[DVec3; 3]; 2], bool),
        radii: [f64; 3],
        duration: f64,
    ) -> Option<(Self, [f64; 3])> {
        let Form::Solid { shape, from, to, .. } = &self.form else { return None };
        let before = start.map(|corner| from.to_local(corner));
        let local = end.map(|corner| to.to_local(corner));
        let paths = CornerPaths { from: before, to: local, count };
        if let Some(found) = is_swept.then(|| shape.swept(&paths, radii)).flatten() {
            let normal = to.direction(shape, found.normal);
            let form = Form::HalfSpace { point: to.to_world(found.foot), normal };
            return Some((Self { form, ..self.clone() }, found.weights));
        }
        let within = 0.5 * duration * RECOVERY + longest(before, local);
        let find = |corners: [DVec3; 3]| match count {
            2 => shape.deepest_on_edge([corners[0], corners[1]], [radii[0], radii[1]], within),
            _ => shape.deepest_on_triangle(corners, radii, within),
        };
        let found = find(local).or_else(|_| find(before)).ok()?;
        Some((self.clone(), found.weights))
    }

    /// The obstacle as it is to a particle that is at `position` when the step begins.
    pub fn seen_from(&self, position: DVec3) -> Self {
        let mut seen = self.clone();
        if let Form::Solid { shape, from, side, .. } = &mut seen.form
            && shape.has_sides()
        {
            *side = shape.side(from.to_local(position));
        }
        seen
    }

    /// Whether its distance is that of a solid, and not of a plane or a pinned particle.
    pub fn is_curved(&self) -> bool {
        matches!(self.form, Form::Solid { .. })
    }

    /// The slot of the pinned particle that it is, if it is one.
    pub fn pinned_slot(&self) -> Option<usize> {
        match self.partner {
            ContactPartner::Particle(slot) => Some(slot),
            ContactPartner::Collider(_) => None,
        }
    }

    /// The velocity of its surface at a point, m/s, without that of a conveyor.
    pub fn motion_at(&self, point: DVec3) -> DVec3 {
        self.velocity + self.angular_velocity.cross(point - self.pivot)
    }

    /// The velocity of a conveyor, m/s.
    pub fn sliding(&self) -> DVec3 {
        self.sliding
    }

    fn of_plane(number: usize, collider: &Collider, elapsed: f32, time_step: f32) -> Self {
        let surface = collider.surface(elapsed, time_step);
        let form = Form::HalfSpace {
            point: surface.point.as_dvec3(),
            normal: surface.normal.as_dvec3().normalize(),
        };
        Self {
            form,
            velocity: surface.velocity.as_dvec3(),
            angular_velocity: surface.angular_velocity.as_dvec3(),
            pivot: surface.point.as_dvec3(),
            sliding: surface.sliding.as_dvec3(),
            ..Self::new(number, collider)
        }
    }

    fn of_solid(number: usize, collider: &Collider, motion: &SubstepMotion) -> Self {
        let (from, to) = (motion.from, motion.to);
        Self {
            form: Form::Solid { shape: collider.shape.clone(), from, to, side: 0.0 },
            velocity: motion.velocity,
            angular_velocity: motion.angular_velocity,
            pivot: to.point,
            sliding: motion.sliding(collider),
            ..Self::new(number, collider)
        }
    }

    fn new(number: usize, collider: &Collider) -> Self {
        Self {
            partner: ContactPartner::Collider(number),
            form: Form::HalfSpace { point: DVec3::ZERO, normal: DVec3::Y },
            velocity: DVec3::ZERO,
            angular_velocity: DVec3::ZERO,
            pivot: DVec3::ZERO,
            sliding: DVec3::ZERO,
            restitution: collider.material.restitution.into(),
            friction: collider.material.friction.into(),
        }
    }
}

/// Displacement in a step above which a particle is swept, as a part of its radius.
const SWEEP_THRESHOLD: f64 = 0.5;

/// Where a sphere of this `radius` first touches another one, about the origin, on its way between two places, if it is beyond it at the
/// end.
fn passed([start, end]: [DVec3; 2], own: f64, radius: f64) -> Option<DVec3> {
    let (sweep_threshold, reach) = (SWEEP_THRESHOLD * radius, own + radius);
    if start.distance_squared(end) <= sweep_threshold * sweep_threshold {
        return None;
    }
    let normal = touch(start.as_vec3(), end.as_vec3(), reach as f32)?.as_dvec3().normalize();
    // What ends in front of it is held by the sphere itself.
    let is_beyond = end.length_squared() >= reach * reach || end.dot(normal) <= 0.0;
    is_beyond.then_some(own * normal)
}

/// Edges and faces are looked for that would come as near as what moves at this speed does in the step, m/s.
const RECOVERY: f64 = 0.1;

/// The longest displacement of a corner, m.
fn longest(from: [DVec3; 3], to: [DVec3; 3]) -> f64 {
    from.iter().zip(to).map(|(from, to)| from.distance(to)).fold(0.0, f64::max)
}

/// The obstacles of one implicit step.
#[derive(Debug, Clone, Default)]
pub(in crate::solver) struct Obstacles {
    planes: Vec<Obstacle>,
    placed: Placed,
    solids: Vec<Obstacle>,
    /// By the least x that they reach.
    spheres: Vec<(f64, Obstacle)>,
    /// The largest diameter of the spheres, m.
    largest: f64,
    /// The longest displacement of one of them in the step, m.
    max_displacement: f64,
}

impl Obstacles {
    /// Makes them those at the end of a step of `duration` seconds; pinned particles are where they were at its
    /// start.
    pub fn gather(&mut self, particles: &Particles, surroundings: Surroundings, duration: f64) {
        let Surroundings { colliders, settings, elapsed, .. } = surroundings;
        self.planes.clear();
        self.solids.clear();
        self.spheres.clear();
        (self.largest, self.max_displacement) = (0.0, 0.0);
        let time_step = settings.time_step;
        let colliders = if settings.collide_with_colliders { colliders } else { &[] };
        let planes = colliders.iter().enumerate().filter(|(_, collider)| collider.is_plane());
        self.planes.extend(
            planes.map(|(number, collider)| Obstacle::of_plane(number, collider, elapsed, time_step)),
        );
        let before = elapsed - duration as f32 / time_step;
        self.placed.begin_tick(colliders, time_step);
        self.placed.begin_substep(colliders, [before, elapsed], time_step);
        let solids = self.placed.numbers.iter().map(|number| *number as usize).zip(&self.placed.motions);
        self.solids
            .extend(solids.map(|(number, motion)| Obstacle::of_solid(number, &colliders[number], motion)));
        let Some(rules) = settings.pair_rules else { return };
        let is_covered = |slot: usize| surroundings.covered.get(slot) == Some(&true);
        let pinned = particles.radius().iter().enumerate();
        for (slot, radius) in
            pinned.filter(|(slot, radius)| **radius > 0.0 && particles.is_pinned(*slot) && !is_covered(*slot))
        {
            let (velocity, radius) = (particles.velocity.get(slot).as_dvec3(), f64::from(*radius));
            let displacement = duration * velocity;
            let centre = particles.position.get(slot).as_dvec3() + displacement;
            let obstacle = Obstacle {
                partner: ContactPartner::Particle(slot),
                form: Form::Sphere { centre, radius, displacement },
                velocity,
                angular_velocity: DVec3::ZERO,
                pivot: centre,
                sliding: DVec3::ZERO,
                restitution: f64::from(rules.restitution),
                friction: f64::from(rules.friction),
            };
            self.spheres.push((centre.x - radius, obstacle));
            self.largest = self.largest.max(2.0 * radius);
            self.max_displacement = self.max_displacement.max(duration * velocity.length());
        }
        self.spheres.sort_by(|(one, _), (other, _)| one.total_cmp(other));
    }

    /// Whether any of them is a collider that an edge or triangle may pass through within a step.
    pub fn any_thin(&self) -> bool {
        !self.solids.is_empty()
    }

    /// Whether a particle may pass through any of them within a step.
    pub fn any_swept(&self) -> bool {
        !(self.solids.is_empty() && self.spheres.is_empty())
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.planes.is_empty() && self.solids.is_empty() && self.spheres.is_empty()
    }

    /// Calls `found` for each collider that an edge or triangle may touch when its corners move from the first to the second
    /// places in `duration` seconds; with the collider's coefficients of restitution and friction against the particle in this
    /// `slot`.
    pub fn near_feature(
        &self,
        (slot, surroundings): (usize, Surroundings),
        [from, to]: [[DVec3; 3]; 2],
        radii: [f64; 3],
        duration: f64,
        mut found: impl FnMut(&Obstacle, [f64; 2]),
    ) {
        let corners = from.iter().chain(&to).map(|corner| corner.as_vec3());
        let bounds = corners.fold(Bounds::EMPTY, Bounds::with);
        let size = bounds.low.abs().max(bounds.high.abs()).max_element();
        let reach = radii[0].max(radii[1]).max(radii[2]) + longest(from, to) + RECOVERY * duration;
        let bounds = bounds.grown(reach as f32 + 16.0 * f32::EPSILON * size);
        let own_properties = properties_of(surroundings.properties, slot);
        self.placed.for_each_near(&bounds, |place| {
            let obstacle = &self.solids[place];
            let collider = &surroundings.colliders[self.placed.numbers[place] as usize];
            if !collider.is_sensor && own_properties.layers.meet(collider.layers) {
                found(obstacle, collider.material.between(own_properties.material).map(f64::from));
            }
        });
    }

    /// Calls `found` for each obstacle that a sphere at `position` may touch on a path of `reach` m in `duration`
    /// seconds, with its coefficients of restitution and friction against the particle in this `slot`.
    pub fn near(
        &self,
        (slot, surroundings): (usize, Surroundings),
        position: DVec3,
        radius: f64,
        [reach, duration]: [f64; 2],
        mut found: impl FnMut(&Obstacle, [f64; 2]),
    ) {
        let own_properties = properties_of(surroundings.properties, slot);
        let mut test = |obstacle: &Obstacle| {
            let mut coefficients = [obstacle.restitution, obstacle.friction];
            if let ContactPartner::Collider(number) = obstacle.partner {
                let collider = &surroundings.colliders[number];
                if collider.is_sensor || !own_properties.layers.meet(collider.layers) {
                    return;
                }
                if own_properties.material.is_some() {
                    coefficients = collider.material.between(own_properties.material).map(f64::from);
                }
            }
            let is_covered = || surroundings.covered.get(slot) == Some(&true);
            if let ContactPartner::Particle(pinned) = obstacle.partner
                && (is_covered()
                    || !own_properties.layers.meet(properties_of(surroundings.properties, pinned).layers))
            {
                return;
            }
            let own_displacement = duration * obstacle.motion_at(position).length();
            if obstacle.gap(position, radius).0 <= reach + own_displacement {
                found(obstacle, coefficients);
            }
        };
        self.planes.iter().for_each(&mut test);
        if !self.solids.is_empty() {
            let bounds =
                Bounds::of_sphere(position.as_vec3(), ((radius + reach) * (1.0 + 1e-6)) as f32 + 1e-6);
            self.placed.for_each_near(&bounds, |place| test(&self.solids[place]));
        }
        let reach = radius + reach + self.max_displacement;
        let (least, most) = (position.x - reach - self.largest, position.x + reach);
        let first = self.spheres.partition_point(|(x, _)| *x < least);
        self.spheres[first..].iter().take_while(|(x, _)| *x <= most).for_each(|(_, sphere)| test(sphere));
    }
}
