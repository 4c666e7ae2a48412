//! The picture that the window shows, drawn into an image.

use std::panic::catch_unwind;

use bevy::camera::RenderTarget;
use bevy::image::Image;
use bevy::prelude::*;
use bevy::render::render_resource::{TextureFormat, TextureUsages};
use bevy::render::renderer::initialize_renderer;
use bevy::render::settings::{Backends, RenderResources, WgpuSettings};
use bevy::render::view::screenshot::{Screenshot, ScreenshotCaptured};
use bevy_mass_spring::prelude::*;

use crate::Outcome;
use crate::app::{HEIGHT, Viewer, WIDTH};

/// A renderer on a Vulkan adapter, if the machine has one.
fn vulkan() -> Option<RenderResources> {
    let hook = std::panic::take_hook();
    std::panic::set_hook(Box::new(|_| {})); // Bevy panics where there is no adapter
    let settings = WgpuSettings { backends: Some(Backends::VULKAN), ..default() };
    let resources =
        catch_unwind(|| bevy::tasks::block_on(initialize_renderer(Backends::VULKAN, None, &settings)));
    std::panic::set_hook(hook);
    resources.ok()
}

pub fn shows_the_chain() -> Outcome {
    let Some(renderer) = vulkan() else { return Outcome::Skipped("no Vulkan adapter") };
    let mut viewer = Viewer::open(Some(renderer));
    let picture = draw_into_image(&mut viewer);
    viewer.run(8);
    let places: Vec<Vec3> = viewer.balls().into_iter().map(|(_, place)| place).collect();
    let on_screen: Vec<UVec2> = places.into_iter().map(|place| viewer.on_screen(place).as_uvec2()).collect();
    let taken = take(&mut viewer, picture);
    check_picture(&taken, &on_screen);
    Outcome::Passed
}

/// The picture of ropes in a crowd is that of ropes with a mesh each, while nothing moves.
pub fn shows_a_crowd_as_ropes() -> Outcome {
    let Some(renderer) = vulkan() else { return Outcome::Skipped("no Vulkan adapter") };
    let mut viewer = Viewer::open(Some(renderer));
    let picture = draw_into_image(&mut viewer);
    viewer.run(4);
    let without = take(&mut viewer, picture.clone());
    let world = viewer.app.world_mut();
    let paint = StandardMaterial { base_color: Color::srgb(0.9, 0.5, 0.1), ..default() };
    let paint = world.resource_mut::<Assets<StandardMaterial>>().add(paint);
    let spawn = |world: &mut World, number: u8| {
        let x = -1.2 + 0.2 * f32::from(number);
        let ends = [Vec3::new(x, 1.9, 0.8), Vec3::new(x + 0.5, 1.4, 1.1)];
        let rope = Rope::hanging(ends[0], ends[1], 0.3).with_segments(24).with_radius(0.02);
        world.spawn((rope, RopeMesh::default(), MeshMaterial3d(paint.clone()))).id()
    };
    let ropes: Vec<Entity> = (0..12).map(|number| spawn(world, number)).collect();
    viewer.run(6);
    let of_single = take(&mut viewer, picture.clone());
    for rope in &ropes {
        viewer.app.world_mut().entity_mut(*rope).insert(RopeCrowd);
    }
    // Its shader is loaded by then.
    viewer.run(20);
    let of_crowd = take(&mut viewer, picture);
    let world = viewer.app.world();
    let meshes: Vec<&Mesh3d> = ropes.iter().map(|rope| world.get::<Mesh3d>(*rope).expect("drawn")).collect();
    assert!(meshes.iter().all(|mesh| *mesh == meshes[0]), "one mesh for all");
    let mut tags: Vec<u32> =
        ropes.iter().map(|rope| world.get::<bevy::mesh::MeshTag>(*rope).expect("a tag").0).collect();
    tags.sort_unstable();
    assert!(tags.windows(2).all(|pair| pair[1] - pair[0] == 25 + 4), "{tags:?}");
    let (drawn, _) = differences(&without, &of_single);
    let (other, worst) = differences(&of_single, &of_crowd);
    println!("{drawn} pixels are drawn by the ropes, {other} differ in the crowd, by {worst} at most");
    // Edges may fall to the other side of a sample.
    assert!(drawn > 5_000 && other * 50 < drawn, "{other} of {drawn} pixels differ, by {worst} at most");
    Outcome::Passed
}

/// The number of pixels that differ by more than 16 of 255 in a channel, and the largest difference.
fn differences(one: &Image, other: &Image) -> (usize, u8) {
    let color = |picture: &Image, x: u32, y: u32| {
        picture.get_color_at(x, y).expect("a colour").to_srgba().to_u8_array_no_alpha()
    };
    let off = |(x, y): (u32, u32)| {
        let [one, other] = [one, other].map(|picture| color(picture, x, y));
        (0..3).map(|channel| one[channel].abs_diff(other[channel])).max().unwrap_or(0)
    };
    let pixels = (0..HEIGHT).flat_map(|y| (0..WIDTH).map(move |x| (x, y)));
    let all: Vec<u8> = pixels.map(off).collect();
    (all.iter().filter(|off| **off > 16).count(), all.into_iter().max().unwrap_or(0))
}

/// Has all cameras draw into an image.
fn draw_into_image(viewer: &mut Viewer) -> Handle<Image> {
    let mut picture = Image::new_target_texture(WIDTH, HEIGHT, TextureFormat::Rgba8UnormSrgb, None);
    picture.texture_descriptor.usage |= TextureUsages::COPY_SRC;
    let world = viewer.app.world_mut();
    let picture = world.resource_mut::<Assets<Image>>().add(picture);
    let cameras: Vec<Entity> = world.query_filtered::<Entity, With<Camera>>().iter(world).collect();
    for camera in cameras {
        world.entity_mut(camera).insert(RenderTarget::Image(picture.clone().into()));
    }
    picture
}

/// What is drawn.
fn take(viewer: &mut Viewer, picture: Handle<Image>) -> Image {
    viewer.app.init_resource::<Taken>();
    let screenshot = Screenshot::image(picture);
    viewer.app.world_mut().spawn(screenshot).observe(
        |captured: On<ScreenshotCaptured>, mut taken: ResMut<Taken>| {
            taken.0 = Some(captured.image.clone());
        },
    );
    for _ in 0..60 {
        viewer.run(1);
        if viewer.resource::<Taken>().0.is_some() {
            break;
        }
    }
    viewer.app.world_mut().resource_mut::<Taken>().0.take().expect("a picture was taken")
}

#[derive(Resource, Default)]
struct Taken(Option<Image>);

fn check_picture(picture: &Image, balls: &[UVec2]) {
    let color =
        |x: u32, y: u32| picture.get_color_at(x, y).expect("a colour").to_srgba().to_u8_array_no_alpha();
    let mut colors = std::collections::HashSet::new();
    for y in (0..HEIGHT).step_by(2) {
        for x in (0..WIDTH).step_by(2) {
            colors.insert(color(x, y));
        }
    }
    assert!(colors.len() > 500, "only {} colours", colors.len());
    let [red, green, blue] = color(balls[0].x, balls[0].y).map(i32::from);
    assert!(red > green + 40 && red > blue + 40, "the anchor is not red: {red} {green} {blue}");
    let teal = balls[1..].iter().filter(|at| {
        let [red, green, blue] = color(at.x, at.y).map(i32::from);
        green > red + 20 && blue > red + 20
    });
    let (teal, free) = (teal.count(), balls.len() - 1);
    assert!(teal * 4 >= free * 3, "only {teal} of {free} balls are seen");
}
