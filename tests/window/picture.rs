//! The picture that the window shows, drawn into an image.

use std::panic::catch_unwind;

use bevy::camera::RenderTarget;
use bevy::image::Image;
use bevy::prelude::*;
use bevy::render::render_resource::{TextureFormat, TextureUsages};
use bevy::render::renderer::initialize_renderer;
use bevy::render::settings::{Backends, RenderResources, WgpuSettings};
use bevy::render::view::screenshot::{Screenshot, ScreenshotCaptured};

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
    let mut picture = Image::new_target_texture(WIDTH, HEIGHT, TextureFormat::Rgba8UnormSrgb, None);
    picture.texture_descriptor.usage |= TextureUsages::COPY_SRC;
    let world = viewer.app.world_mut();
    let picture = world.resource_mut::<Assets<Image>>().add(picture);
    let cameras: Vec<Entity> = world.query_filtered::<Entity, With<Camera>>().iter(world).collect();
    for camera in cameras {
        world.entity_mut(camera).insert(RenderTarget::Image(picture.clone().into()));
    }
    viewer.run(8);
    let places: Vec<Vec3> = viewer.balls().into_iter().map(|(_, place)| place).collect();
    let on_screen: Vec<UVec2> = places.into_iter().map(|place| viewer.on_screen(place).as_uvec2()).collect();

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
    let taken = viewer.app.world_mut().resource_mut::<Taken>().0.take().expect("a picture was taken");
    check_picture(&taken, &on_screen);
    Outcome::Passed
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
