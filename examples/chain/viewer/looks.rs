//! The appearance of particles, springs, nets and planes, the same for every scene, file and preset.
//!
//! A particle's look is a child of it, so that the particle's own `Transform` stays the simulation's.

use bevy::camera::visibility::VisibilitySystems;
use bevy::color::Mix;
use bevy::prelude::*;
use bevy::transform::TransformSystems;
use bevy_mass_spring::prelude::*;

/// Steps of the colour of links, from full compression over rest to full tension.
const STEPS: usize = 33;
/// Steps of the colour of balls, by mass.
const MASS_STEPS: usize = 9;
/// The |l − l0| / l0 that has half of the full colour.
const HALF_STRETCH: f32 = 0.06;
/// Minimum radius of a drawn ball, m: a radius of 0 is a point.
const MIN_RADIUS: f32 = 0.012;
/// Minimum radius of a drawn rope, m.
const MIN_ROPE_RADIUS: f32 = 0.006;
/// Maximum distance from the origin, in m, at which anything is drawn.
const MAX_DISTANCE: f32 = 1e5;

/// Adds the looks.
pub fn plugin(app: &mut App) {
    app.init_resource::<Looks>()
        .add_systems(Startup, draw_only_the_grip)
        .add_systems(
            Update,
            (add_ball_looks, add_link_looks, add_net_looks, add_plane_looks, remove_link_looks, update_balls),
        )
        .add_systems(
            PostUpdate,
            place_links.after(TransformSystems::Propagate).before(VisibilitySystems::CheckVisibility),
        );
}

/// Balls, links and ground have meshes here: of the gizmos only the ring around a ball is switched on, until key o is
/// pressed.
fn draw_only_the_grip(mut store: ResMut<GizmoConfigStore>) {
    let (config, gizmos) = store.config_mut::<MassSpringGizmos>();
    config.line.width = 3.0;
    (gizmos.particles, gizmos.springs, gizmos.colliders) = (false, false, false);
    gizmos.hovered_color = Color::srgb(1.0, 0.75, 0.1);
    gizmos.dragged_color = Color::srgb(1.0, 0.45, 0.0);
}

/// The look of a particle, its child.
#[derive(Component)]
struct BallLook;

/// The look of the spring that it names.
#[derive(Component)]
struct LinkLook(Entity);

/// Meshes of unit size, and materials.
#[derive(Resource)]
pub struct Looks {
    sphere: Handle<Mesh>,
    cylinder: Handle<Mesh>,
    ground: Handle<Mesh>,
    grid: Handle<Mesh>,
    anchor: Handle<StandardMaterial>,
    balls: Vec<Handle<StandardMaterial>>,
    links: Vec<Handle<StandardMaterial>>,
    rope: Handle<StandardMaterial>,
    surfaces: Vec<Handle<StandardMaterial>>,
    ground_material: Handle<StandardMaterial>,
    grid_material: Handle<StandardMaterial>,
}

impl FromWorld for Looks {
    fn from_world(world: &mut World) -> Self {
        let mut meshes = world.resource_mut::<Assets<Mesh>>();
        let sphere = meshes.add(Sphere::new(1.0).mesh().ico(3).expect("within ico's limit"));
        let cylinder = meshes.add(Cylinder::new(1.0, 1.0).mesh().resolution(10).without_caps());
        let ground = meshes.add(Plane3d::new(Vec3::Y, Vec2::splat(60.0)));
        let grid = meshes.add(grid_mesh());
        let mut materials = world.resource_mut::<Assets<StandardMaterial>>();
        let surfaces = [
            Color::srgb(0.62, 0.14, 0.16),
            Color::srgb(0.12, 0.36, 0.60),
            Color::srgb(0.86, 0.70, 0.34),
            Color::srgb(0.20, 0.48, 0.28),
        ];
        // Cloths are seen from both sides.
        let surface = |color: Color| StandardMaterial {
            base_color: color,
            perceptual_roughness: 0.8,
            double_sided: true,
            cull_mode: None,
            ..default()
        };
        let surfaces = surfaces.into_iter().map(|color| materials.add(surface(color))).collect();
        let mut paint = |color: Color, roughness: f32| {
            let base = StandardMaterial { base_color: color, perceptual_roughness: roughness, ..default() };
            materials.add(base)
        };
        let shares = |steps: usize| (0..steps).map(move |step| step as f32 / (steps - 1) as f32);
        let (light, heavy) = (Color::srgb(0.12, 0.58, 0.68), Color::srgb(0.30, 0.16, 0.55));
        let balls = shares(MASS_STEPS).map(|share| paint(light.mix(&heavy, share), 0.35)).collect();
        let rest = Color::srgb(0.62, 0.58, 0.50);
        let (push, pull) = (Color::srgb(0.10, 0.25, 0.95), Color::srgb(0.92, 0.12, 0.06));
        let link = |share: f32| {
            let stretch = 2.0 * share - 1.0;
            rest.mix(if stretch < 0.0 { &push } else { &pull }, stretch.abs())
        };
        let rope = paint(Color::srgb(0.70, 0.58, 0.38), 0.85);
        let links = shares(STEPS).map(|share| paint(link(share), 0.5)).collect();
        Self {
            sphere,
            cylinder,
            ground,
            grid,
            anchor: paint(Color::srgb(0.85, 0.22, 0.10), 0.3),
            balls,
            links,
            rope,
            surfaces,
            ground_material: paint(Color::srgb(0.66, 0.67, 0.66), 0.95),
            grid_material: paint(Color::srgb(0.40, 0.43, 0.46), 0.95),
        }
    }
}

impl Looks {
    /// Heavier balls are darker: one step for each factor of about three, from 10 g on.
    fn ball(&self, particle: &Particle, pinned: bool) -> Handle<StandardMaterial> {
        if pinned {
            return self.anchor.clone();
        }
        let step = (2.0 * (particle.mass / 0.01).log10()).clamp(0.0, (MASS_STEPS - 1) as f32);
        self.balls[step as usize].clone()
    }

    fn link(&self, spring: &Spring, length: f32) -> &Handle<StandardMaterial> {
        let unit = if spring.rest_length > 0.0 { spring.rest_length } else { 1.0 };
        let stretch = (length - spring.rest_length) / unit;
        // Stiff and soft springs alike show a change: the full colour is never quite reached.
        let share = 0.5 * (1.0 + stretch / (stretch.abs() + HALF_STRETCH));
        &self.links[((share * (STEPS - 1) as f32).round() as usize).min(STEPS - 1)]
    }
}

/// A grid of thin strips around the origin, a metre apart, every fifth one thicker.
fn grid_mesh() -> Mesh {
    const REACH: i32 = 40;
    let strip = |index: i32| {
        let half_width = if index % 5 == 0 { 0.014 } else { 0.006 };
        Mesh::from(Plane3d::new(Vec3::Y, Vec2::new(half_width, REACH as f32))).translated_by(Vec3::new(
            index as f32,
            0.0,
            0.0,
        ))
    };
    let mut mesh = strip(0);
    for index in (-REACH..=REACH).filter(|index| *index != 0) {
        mesh.merge(&strip(index)).expect("all strips have the same attributes");
    }
    let across = mesh.clone().rotated_by(Quat::from_rotation_y(std::f32::consts::FRAC_PI_2));
    mesh.merge(&across).expect("all strips have the same attributes");
    mesh
}

fn add_ball_looks(
    looks: Res<Looks>,
    particles: Query<(Entity, &Particle, Has<Pinned>), Added<Particle>>,
    mut commands: Commands,
) {
    for (entity, particle, pinned) in &particles {
        commands.entity(entity).insert_if_new(Visibility::default()).with_child((
            BallLook,
            Mesh3d(looks.sphere.clone()),
            MeshMaterial3d(looks.ball(particle, pinned)),
            Transform::from_scale(Vec3::splat(particle.radius.max(MIN_RADIUS))),
        ));
    }
}

/// Follows changes of radius, mass and pins, and hides what is beyond [`MAX_DISTANCE`].
fn update_balls(
    looks: Res<Looks>,
    particles: Query<(&Particle, &Transform, Has<Pinned>), Without<BallLook>>,
    mut balls: Query<
        (&ChildOf, &mut Transform, &mut MeshMaterial3d<StandardMaterial>, &mut Visibility),
        With<BallLook>,
    >,
) {
    for (parent, mut transform, mut material, mut visibility) in &mut balls {
        let Ok((particle, place, pinned)) = particles.get(parent.parent()) else { continue };
        let scale = Vec3::splat(particle.radius.max(MIN_RADIUS));
        if transform.scale != scale {
            transform.scale = scale;
        }
        material.set_if_neq(MeshMaterial3d(looks.ball(particle, pinned)));
        let gone = place.translation.abs().max_element() > MAX_DISTANCE;
        visibility.set_if_neq(if gone { Visibility::Hidden } else { Visibility::Inherited });
    }
}

fn add_link_looks(looks: Res<Looks>, springs: Query<Entity, Added<Spring>>, mut commands: Commands) {
    for spring in &springs {
        commands.spawn((
            LinkLook(spring),
            Mesh3d(looks.cylinder.clone()),
            MeshMaterial3d(looks.links[STEPS / 2].clone()),
            Visibility::Hidden,
        ));
    }
}

/// Draws ropes as tubes and everything else by its surface.
fn add_net_looks(
    looks: Res<Looks>,
    nets: Query<(Entity, &ParticleNet), Added<ParticleNet>>,
    mut commands: Commands,
    mut count: Local<usize>,
) {
    for (entity, net) in &nets {
        let mut entity = commands.entity(entity);
        if net.topology().triangles.is_empty() {
            let tube = RopeMesh::default().with_radius(net.radius().max(MIN_ROPE_RADIUS));
            entity.insert_if_new((tube, MeshMaterial3d(looks.rope.clone())));
        } else {
            let surface = looks.surfaces[*count % looks.surfaces.len()].clone();
            entity.insert_if_new((NetMesh, MeshMaterial3d(surface)));
            *count += 1;
        }
    }
}

fn remove_link_looks(
    mut removed: RemovedComponents<Spring>,
    links: Query<(Entity, &LinkLook)>,
    mut commands: Commands,
) {
    if removed.is_empty() {
        return;
    }
    let gone: bevy::ecs::entity::EntityHashSet = removed.read().collect();
    for (entity, _) in links.iter().filter(|(_, link)| gone.contains(&link.0)) {
        commands.entity(entity).despawn();
    }
}

/// Stretches each link between its balls, where those are seen in this very frame.
fn place_links(
    looks: Res<Looks>,
    springs: Query<&Spring>,
    ends: Query<(&GlobalTransform, Option<&Particle>), (Or<(With<Particle>, With<Part>)>, Without<LinkLook>)>,
    mut links: Query<(
        &LinkLook,
        &mut GlobalTransform,
        &mut MeshMaterial3d<StandardMaterial>,
        &mut Visibility,
        &mut InheritedVisibility,
    )>,
) {
    for (link, mut transform, mut material, mut visibility, mut inherited) in &mut links {
        let placed = springs.get(link.0).ok().and_then(|spring| {
            let [(first, first_particle), (second, second_particle)] =
                ends.get_many(spring.particles).ok()?;
            let (first, second) = (first.translation(), second.translation());
            let between = second - first;
            let direction = between
                .try_normalize()
                .filter(|_| first.abs().max(second.abs()).max_element() < MAX_DISTANCE)?;
            let radius =
                |particle: Option<&Particle>| particle.map_or(f32::INFINITY, |particle| particle.radius);
            let radius = radius(first_particle).min(radius(second_particle));
            let thickness = (0.28 * radius).clamp(0.004, 0.02);
            material.set_if_neq(MeshMaterial3d(looks.link(spring, between.length()).clone()));
            Some(Transform {
                translation: first.midpoint(second),
                rotation: Quat::from_rotation_arc(Vec3::Y, direction),
                scale: Vec3::new(thickness, between.length(), thickness),
            })
        });
        if let Some(placed) = placed {
            *transform = placed.into();
        }
        // Visibility is propagated before links are placed: both are set here.
        visibility.set_if_neq(if placed.is_some() { Visibility::Visible } else { Visibility::Hidden });
        if inherited.get() != placed.is_some() {
            *inherited =
                if placed.is_some() { InheritedVisibility::VISIBLE } else { InheritedVisibility::HIDDEN };
        }
    }
}

fn add_plane_looks(
    looks: Res<Looks>,
    planes: Query<Entity, Added<ParticleCollider>>,
    mut commands: Commands,
) {
    for plane in &planes {
        commands.entity(plane).insert_if_new(Visibility::default()).with_children(|parts| {
            parts.spawn((Mesh3d(looks.ground.clone()), MeshMaterial3d(looks.ground_material.clone())));
            parts.spawn((
                Mesh3d(looks.grid.clone()),
                MeshMaterial3d(looks.grid_material.clone()),
                // Above the ground by as little as the depth buffer can tell from afar.
                Transform::from_xyz(0.0, 0.002, 0.0),
                bevy::light::NotShadowCaster,
            ));
        });
    }
}
