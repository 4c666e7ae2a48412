//! The results of a few scenes, to the bit.

use bevy::prelude::*;
use bevy_mass_spring::prelude::*;

use crate::common::{self, *};
use crate::scenes::scene;
use crate::{TICKS, history};

/// The hashes of scenes after 150 ticks: see `golden_hash`. Taken on x86_64, where the vectorised and the
/// plain kernel give the same bits, and Linux, whose C library computes the sines that place the balls.
const GOLDEN: [(&str, u64); 6] = [
    ("springs", 0x35aa_256a_53c2_714e),
    ("contacts", 0x2eba_4e8f_7dbb_ea19),
    ("implicit Euler", 0x1349_8244_3c32_79ce),
    ("TR-BDF2", 0xd6b7_6aee_af14_91c3),
    ("XPBD", 0xaef5_6717_aac2_f43c),
    ("two schemes", 0x34cf_c4e8_f51c_ebf8),
];

/// Guards against unintended changes of results: springs, anchors, the ground, gather and scatter in all
/// scenes, and what each is named after.
#[test]
fn the_golden_hashes_are_unchanged() {
    let found = GOLDEN.map(|(name, _)| (name, golden_hash(name)));
    let table: String = found
        .iter()
        .map(|(name, hash)| {
            let digits = format!("{hash:016x}");
            let groups: Vec<&str> = (0..4).map(|group| &digits[4 * group..][..4]).collect();
            format!("    ({name:?}, 0x{}),\n", groups.join("_"))
        })
        .collect();
    assert!(
        found == GOLDEN,
        "the results have changed in some bit. If that is intended (say why in CHANGELOG.md), the entries of \
         GOLDEN in tests/determinism/golden.rs become\n\n{table}"
    );
}

/// The hash of a cloth and a rope, and what `name` says, after 150 ticks.
fn golden_hash(name: &str) -> u64 {
    let mut app = app();
    let balls = if name == "contacts" { 20 } else { 0 };
    app.world_mut().resource_mut::<CollisionSettings>().particles = balls > 0;
    let mut all = scene(&mut app, balls, |_| {});
    match name {
        "implicit Euler" => {
            app.insert_resource(common::scheme(Integrator::ImplicitEuler, 2));
        }
        "TR-BDF2" => {
            app.insert_resource(common::scheme(Integrator::TrBdf2, 2));
        }
        "XPBD" => {
            app.insert_resource(common::scheme(Integrator::Xpbd, 8));
        }
        "two schemes" => {
            all.extend(spawn_rope(&mut app, Vec3::Y * 20.0, 12, 0.05, |spring| spring.with_stiffness(1e9)));
        }
        _ => {}
    }
    let hash = *history(&mut app, &all, TICKS).last().expect("some ticks were run");
    assert_eq!(report(&app).stiff_substeps > 0, name == "two schemes", "{}", report(&app).schemes());
    // More than the planes alone could have, soon at least: balls touch balls.
    let touch = |_| {
        app.update();
        report(&app).contacts > usize::from(balls)
    };
    assert!(balls == 0 || (0..100).any(touch), "{} contacts", report(&app).contacts);
    hash
}
