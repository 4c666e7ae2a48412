//! The gallery: ropes, cloths, jellies and balloons, each with its parameters live and a sentence that says what to
//! look at.
//!
//! ```text
//! cargo run --release --features viewer --example gallery
//! cargo run --release --features viewer --example gallery -- --help
//! ```
//!
//! Page up and Page down (or the list in the panel) change the exhibit, Enter pauses, Home restarts it, o shows the
//! outlines of colliders and the contacts.

#[path = "../chain/capture.rs"]
mod capture;
#[path = "../chain/display.rs"]
mod display;
mod exhibits;
mod frame;
mod gallery;
#[path = "../chain/viewer/panel_view.rs"]
mod panel_view;
mod stage;
#[path = "../chain/viewer/switches.rs"]
mod switches;

use std::process::ExitCode;

fn main() -> ExitCode {
    frame::run("Gallery", "Ropes, cloths, jellies and balloons to look at and to play with", exhibits::plugin)
}
