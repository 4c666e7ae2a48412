//! The playground: what ropes, cloths and balls collide with, and how.
//!
//! ```text
//! cargo run --release --features viewer --example playground
//! cargo run --release --features viewer --example playground -- --help
//! ```
//!
//! Page up and Page down (or the list in the panel) change the exhibit, Enter pauses, Home restarts it, o shows the
//! outlines of colliders and the contacts.

#[path = "../chain/capture.rs"]
mod capture;
#[path = "../chain/display.rs"]
mod display;
mod exhibits;
#[path = "../gallery/frame.rs"]
mod frame;
#[path = "../gallery/gallery.rs"]
mod gallery;
#[path = "../chain/viewer/panel_view.rs"]
mod panel_view;
#[path = "../gallery/stage.rs"]
mod stage;
#[path = "../chain/viewer/switches.rs"]
mod switches;

use std::process::ExitCode;

fn main() -> ExitCode {
    frame::run("Playground", "Things that ropes, cloths and balls collide with", exhibits::plugin)
}
