//! Recipes into nets: laid out when they are inserted, their materials live.
//!
//! A [`ParticleNet`] that is inserted with the recipe of its topology is laid out already: it stays as it is.

use std::sync::{Arc, Weak};

use bevy::ecs::intern::Interned;
use bevy::ecs::schedule::ScheduleLabel;
use bevy::ecs::system::SystemParam;
use bevy::prelude::*;
use bevy::transform::helper::TransformHelper;

use super::missing_mesh::{MissingMeshes, any_missing, warn_of_missing_meshes};
use super::{
    Balloon, BalloonShape, Cloth, ClothShape, Jelly, JellyShape, NetError, ParticleNet, Rope, Topology,
    TriangleMesh,
};
use crate::schedule::MassSpringSystems;

/// The triangles of the mesh from which the recipe on the same entity is made.
///
/// The feature `render` inserts it where there is a `Mesh3d`; without that feature, the game does. A recipe from a mesh
/// waits for it; one that has no mesh to wait for is named in the log. Insert it again to lay the net out anew.
#[derive(Component, Debug, Clone)]
pub struct RecipeMesh(pub Arc<TriangleMesh>);

/// A component that describes a net.
trait Recipe: Component + Clone {
    const NAME: &'static str;

    fn needs_mesh(&self) -> bool;

    fn build(&self, mesh: Option<&TriangleMesh>) -> Result<Topology, NetError>;

    /// Itself, but for what acts on insertion only: that is as in the recipe that was laid out.
    fn on_topology_of(&self, laid_out: &AnyRecipe) -> Option<Self>;

    fn into_any(self) -> AnyRecipe;

    /// The recipe that was laid out, if it is one of this kind.
    fn of(laid_out: &AnyRecipe) -> Option<&Self>;
}

/// Any recipe.
#[derive(Debug, Clone, PartialEq)]
enum AnyRecipe {
    Rope(Rope),
    Cloth(Cloth),
    Jelly(Jelly),
    Balloon(Balloon),
}

impl Recipe for Rope {
    const NAME: &'static str = "rope";

    fn needs_mesh(&self) -> bool {
        false
    }

    fn build(&self, _mesh: Option<&TriangleMesh>) -> Result<Topology, NetError> {
        self.topology()
    }

    fn on_topology_of(&self, laid_out: &AnyRecipe) -> Option<Self> {
        let AnyRecipe::Rope(Rope { path, is_closed, segments, spacing, .. }) = laid_out else { return None };
        let (path, is_closed, segments, spacing) = (path.clone(), *is_closed, *segments, *spacing);
        Some(Self { path, is_closed, segments, spacing, ..self.clone() })
    }

    fn into_any(self) -> AnyRecipe {
        AnyRecipe::Rope(self)
    }

    fn of(laid_out: &AnyRecipe) -> Option<&Self> {
        if let AnyRecipe::Rope(rope) = laid_out { Some(rope) } else { None }
    }
}

/// The recipes that have a shape, which may be a mesh.
macro_rules! shaped_recipe {
    ($recipe:ident, $name:literal, $shape:ident, $($field:ident),*) => {
        impl Recipe for $recipe {
            const NAME: &'static str = $name;

            fn needs_mesh(&self) -> bool {
                matches!(self.shape, $shape::Mesh)
            }

            fn build(&self, mesh: Option<&TriangleMesh>) -> Result<Topology, NetError> {
                match mesh.filter(|_| self.needs_mesh()) {
                    Some(mesh) => self.topology_with(mesh),
                    None => self.topology(),
                }
            }

            fn on_topology_of(&self, laid_out: &AnyRecipe) -> Option<Self> {
                let AnyRecipe::$recipe(laid_out) = laid_out else { return None };
                Some(Self { $($field: laid_out.$field.clone(),)* ..self.clone() })
            }

            fn into_any(self) -> AnyRecipe {
                AnyRecipe::$recipe(self)
            }

            fn of(laid_out: &AnyRecipe) -> Option<&Self> {
                if let AnyRecipe::$recipe(recipe) = laid_out { Some(recipe) } else { None }
            }
        }
    };
}
shaped_recipe!(Cloth, "cloth", ClothShape, shape, cells, spacing);
shaped_recipe!(Jelly, "jelly", JellyShape, shape, cells, spacing);
shaped_recipe!(Balloon, "balloon", BalloonShape, shape, subdivisions);

/// The recipe by which a net is laid out, and the mesh that it was made from.
#[derive(Component, Debug, Clone)]
pub(crate) struct LaidOut {
    recipe: AnyRecipe,
    mesh: Option<Arc<TriangleMesh>>,
}

/// The topologies of present nets by their recipes, so that equal recipes share one.
#[derive(Resource, Default)]
pub(crate) struct Topologies(Vec<(LaidOut, Weak<Topology>)>);

impl Topologies {
    /// The topology of a recipe: the one of another net, or a new one.
    fn get<R: Recipe>(
        &mut self,
        recipe: &R,
        mesh: Option<&Arc<TriangleMesh>>,
    ) -> Result<Arc<Topology>, NetError> {
        let mesh = mesh.filter(|_| recipe.needs_mesh());
        let any = recipe.clone().into_any();
        let is_same = |known: &LaidOut| {
            let is_same_mesh = match (&known.mesh, mesh) {
                (Some(known), Some(mesh)) => Arc::ptr_eq(known, mesh),
                (None, None) => true,
                _ => false,
            };
            is_same_mesh && known.recipe == any
        };
        let known = self.0.iter().find(|(known, _)| is_same(known));
        if let Some(topology) = known.and_then(|(_, topology)| topology.upgrade()) {
            return Ok(topology);
        }
        let topology = Arc::new(recipe.build(mesh.map(|mesh| &**mesh))?);
        self.0.retain(|(_, topology)| topology.strong_count() > 0);
        self.0.push((LaidOut { recipe: any, mesh: mesh.cloned() }, Arc::downgrade(&topology)));
        Ok(topology)
    }
}

/// The entities with a recipe or mesh that was inserted and not laid out yet.
#[derive(Resource, Default)]
struct PendingRecipes(Vec<Entity>);

/// Lays out nets before each tick and at the end of each frame.
pub(crate) fn build(app: &mut App, schedule: Interned<dyn ScheduleLabel>) {
    app.init_resource::<Topologies>()
        .init_resource::<PendingRecipes>()
        .init_resource::<MissingMeshes>()
        .add_observer(note_inserted::<Rope>)
        .add_observer(note_inserted::<Cloth>)
        .add_observer(note_inserted::<Jelly>)
        .add_observer(note_inserted::<Balloon>)
        .add_observer(note_inserted::<RecipeMesh>)
        .add_systems(PostStartup, lay_out_nets.run_if(any_pending))
        .add_systems(Last, warn_of_missing_meshes.run_if(any_missing))
        .add_systems(PostUpdate, lay_out_nets.run_if(any_pending))
        .add_systems(schedule, lay_out_nets.run_if(any_pending).before(MassSpringSystems::Gather));
    note_existing::<Rope>(app.world_mut());
    note_existing::<Cloth>(app.world_mut());
    note_existing::<Jelly>(app.world_mut());
    note_existing::<Balloon>(app.world_mut());
}

fn note_inserted<T: Component>(inserted: On<Insert, T>, mut pending: ResMut<PendingRecipes>) {
    pending.0.push(inserted.entity);
}

fn note_existing<T: Component>(world: &mut World) {
    let mut existing: Vec<Entity> = world.query_filtered::<Entity, With<T>>().iter(world).collect();
    existing.sort_unstable_by_key(|entity| entity.index_u32());
    world.resource_mut::<PendingRecipes>().0.extend(existing);
}

fn any_pending(pending: Res<PendingRecipes>) -> bool {
    !pending.0.is_empty()
}

/// What laying out needs.
#[derive(SystemParam)]
struct Layouts<'w, 's> {
    topologies: ResMut<'w, Topologies>,
    missing: ResMut<'w, MissingMeshes>,
    helper: TransformHelper<'w, 's>,
    transforms: Query<'w, 's, &'static Transform>,
    meshes: Query<'w, 's, &'static RecipeMesh>,
    /// Nets that came with their recipe, as from a scene.
    ready: Query<'w, 's, &'static ParticleNet, Without<LaidOut>>,
    commands: Commands<'w, 's>,
}

type Recipes<'w, 's, R> = Query<'w, 's, &'static R>;

/// Makes nets of the recipes that were inserted, at once.
pub(crate) fn lay_out_now(world: &mut World) {
    if let Err(problem) = world.run_system_cached(lay_out_nets) {
        log::error!("nets are not laid out: {problem}");
    }
}

/// Makes nets of the recipes that were inserted, in the order of that.
fn lay_out_nets(
    mut pending: ResMut<PendingRecipes>,
    ropes: Recipes<Rope>,
    cloths: Recipes<Cloth>,
    jellies: Recipes<Jelly>,
    balloons: Recipes<Balloon>,
    mut layouts: Layouts,
) {
    let mut known = bevy::ecs::entity::EntityHashSet::default();
    for entity in std::mem::take(&mut pending.0) {
        if !known.insert(entity) {
            continue;
        }
        if let Ok(rope) = ropes.get(entity) {
            layouts.lay_out(entity, rope);
        } else if let Ok(cloth) = cloths.get(entity) {
            layouts.lay_out(entity, cloth);
        } else if let Ok(jelly) = jellies.get(entity) {
            layouts.lay_out(entity, jelly);
        } else if let Ok(balloon) = balloons.get(entity) {
            layouts.lay_out(entity, balloon);
        }
    }
}

impl Layouts<'_, '_> {
    fn lay_out<R: Recipe>(&mut self, entity: Entity, recipe: &R) {
        let mesh = self.meshes.get(entity).ok().map(|mesh| &mesh.0);
        if recipe.needs_mesh() && mesh.is_none() {
            // It comes when it is loaded.
            self.missing.note(entity, R::NAME);
            return;
        }
        let topology = match self.topologies.get(recipe, mesh) {
            Ok(topology) => topology,
            Err(problem) => {
                log::warn!("{} {entity} is not laid out: {problem}", R::NAME);
                return;
            }
        };
        let laid_out = LaidOut { recipe: recipe.clone().into_any(), mesh: mesh.cloned() };
        if self.ready.get(entity).is_ok_and(|net| **net.topology() == *topology) {
            self.commands.entity(entity).try_insert(laid_out);
            return;
        }
        let own = || self.transforms.get(entity).copied().unwrap_or_default().compute_affine();
        let frame =
            self.helper.compute_global_transform(entity).map_or_else(|_| own(), |frame| frame.affine());
        let net = ParticleNet::laid_out(topology, |place| frame.transform_point3(place));
        self.commands.entity(entity).try_insert((net, laid_out));
    }
}

type Changes<'w, 's, R> =
    Query<'w, 's, (Entity, &'static R, &'static mut ParticleNet, &'static mut LaidOut), Changed<R>>;

/// Gives nets the materials that their recipes have by now.
pub(crate) fn change_materials(
    mut queries: ParamSet<(Changes<Rope>, Changes<Cloth>, Changes<Jelly>, Changes<Balloon>)>,
    mut topologies: ResMut<Topologies>,
) {
    queries.p0().iter_mut().for_each(|net| change_material(net, &mut topologies));
    queries.p1().iter_mut().for_each(|net| change_material(net, &mut topologies));
    queries.p2().iter_mut().for_each(|net| change_material(net, &mut topologies));
    queries.p3().iter_mut().for_each(|net| change_material(net, &mut topologies));
}

fn change_material<R: Recipe>(
    (entity, recipe, mut net, mut laid_out): (Entity, &R, Mut<ParticleNet>, Mut<LaidOut>),
    topologies: &mut Topologies,
) {
    let Some(recipe) = recipe.on_topology_of(&laid_out.recipe) else { return };
    let any = recipe.clone().into_any();
    if any == laid_out.recipe {
        return;
    }
    let mesh = laid_out.mesh.as_ref();
    let Some(old) = R::of(&laid_out.recipe) else { return };
    let topologies = topologies.get(old, mesh).and_then(|old| Ok((old, topologies.get(&recipe, mesh)?)));
    match topologies {
        Ok((old, new)) if net.change_material(&old, &new) => laid_out.recipe = any,
        Ok(_) => log::warn!("{} {entity} keeps its material: its particles are others by now", R::NAME),
        Err(problem) => log::warn!("{} {entity} keeps its material: {problem}", R::NAME),
    }
}
