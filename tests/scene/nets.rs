//! The nets of scene files.

use bevy_mass_spring::prelude::*;
use bevy_mass_spring::scene::{Position, SceneNet};

/// The nets of the contract, to the letter but for the comments.
const NETS: &str = "(particles: [], nets: [
    Rope(from: (0.0, 0.0, 0.0), to: (1.0, 0.0, 0.0), segments: 20,
         radius: 0.0, linear_density: 0.1, stretch_stiffness: 1e4, bending_stiffness: 0.0,
         retardation_time: 0.0, tension_only: false, max_stretch: None, breaking_force: None, pinned: [0]),
    Cloth(corner: (0.0, 0.0, 0.0), width: (1.0, 0.0, 0.0), height: (0.0, 0.0, 1.0), cells: (20, 20),
          radius: 0.0, area_density: 0.2, stretch_stiffness: 1e3, shear_stiffness: 3e2, bending_stiffness: 0.0,
          retardation_time: 0.0, max_stretch: None, breaking_strain: None, pinned: [0, 20],
          drag_coefficient: 1.0, lift_coefficient: 0.0, self_collision: true),
    Jelly(min: (0.0, 0.0, 0.0), max: (1.0, 1.0, 1.0), cells: (4, 4, 4),
          radius: 0.0, density: 1e3, youngs_modulus: 1e5, retardation_time: 0.0, pinned: []),
    Balloon(centre: (0.0, 0.0, 0.0), radius: 0.5, subdivisions: 3, thickness: 0.0, area_density: 0.2,
            stretch_stiffness: 1e3, pressure: 100.0, retardation_time: 0.0),
])";

/// The same with what has a default left out.
const SHORT: &str = "(particles: [], nets: [
    Rope(from: (0, 0, 0), to: (1, 0, 0), segments: 20, linear_density: 0.1, stretch_stiffness: 1e4, pinned: [0]),
    Cloth(corner: (0, 0, 0), width: (1, 0, 0), height: (0, 0, 1), cells: (20, 20), area_density: 0.2,
          stretch_stiffness: 1e3, shear_stiffness: 3e2, pinned: [0, 20]),
    Jelly(min: (0, 0, 0), max: (1, 1, 1), cells: (4, 4, 4), density: 1e3, youngs_modulus: 1e5),
    Balloon(centre: (0, 0, 0), radius: 0.5, subdivisions: 3, area_density: 0.2, stretch_stiffness: 1e3,
            pressure: 100),
])";

#[test]
fn the_nets_of_the_contract_and_their_defaults() {
    let scene = MassSpringScene::from_ron(NETS).unwrap();
    assert_eq!(scene, MassSpringScene::from_ron(SHORT).unwrap());
    assert_eq!(scene, MassSpringScene::from_ron(&scene.to_ron()).unwrap());
    let counts: Vec<usize> = scene.nets.iter().map(SceneNet::particle_count).collect();
    assert_eq!(counts, [21, 441, 125, 642]);
}

/// Each rule: the nets with one value replaced, and what the error says.
#[test]
fn bad_nets_are_refused_with_place_index_and_field() {
    let positive = "expected a finite number > 0";
    let cases = [
        ("linear_density: 0.1", "linear_density: §0", format!("nets[0].linear_density is 0.0, {positive}")),
        ("to: (1, 0, 0)", "to: §(0, 0, 0)", "nets[0].to is [0.0, 0.0, 0.0], expected another place".into()),
        ("segments: 20", "segments: §0", "nets[0].segments is 0, expected a number from 1".into()),
        ("pinned: [0])", "pinned: §[21])", "nets[0].pinned is [21], expected indices".into()),
        ("1e4,", "1e4, radius: §-1,", "nets[0].radius is -1.0, expected a finite number >= 0".into()),
        ("1e4,", "1e4, breaking_force: §NaN,", "nets[0].breaking_force is NaN, expected".into()),
        ("cells: (20, 20)", "cells: §(20, 0)", "nets[1].cells is (20, 0), expected numbers >= 1".into()),
        (
            "cells: (20, 20)",
            "cells: §(100000, 100000)",
            "nets[1].cells is (100000, 100000), expected fewer than 2^24 particles".into(),
        ),
        (
            "height: (0, 0, 1)",
            "height: §(2, 0, 0)",
            "nets[1].height is [2.0, 0.0, 0.0], expected a vector that is not along `width`".into(),
        ),
        ("3e2,", "3e2, lift_coefficient: §-1,", "nets[1].lift_coefficient is -1.0, expected".into()),
        ("max: (1, 1, 1)", "max: §(1, 0, 1)", "nets[2].max is [1.0, 0.0, 1.0], expected coordinates".into()),
        ("density: 1e3", "density: §-1", format!("nets[2].density is -1.0, {positive}")),
        ("subdivisions: 3", "subdivisions: §8", "nets[3].subdivisions is 8, expected a number from 0".into()),
        ("pressure: 100", "pressure: §0", format!("nets[3].pressure is 0.0, {positive}")),
    ];
    for (old, new, message) in cases {
        assert!(SHORT.contains(old), "{old}");
        let marked = SHORT.replacen(old, new, 1);
        let (before, after) = marked.split_once('§').expect("a mark where the value begins");
        let line = before.lines().count();
        let column = before.lines().last().unwrap().chars().count() + 1;
        let error = MassSpringScene::from_ron(&format!("{before}{after}")).expect_err(&message);
        assert_eq!(error.position, Some(Position { line, column }), "{error}");
        assert!(error.to_string().contains(&message), "expected: {message}\nfound:    {error}");
    }
}

#[test]
fn unknown_kinds_and_fields_are_refused_by_name() {
    let refusal = |text: &str| MassSpringScene::from_ron(text).expect_err(text).to_string();
    assert!(refusal("(particles: [], nets: [Chain(from: (0, 0, 0))])").contains("`Chain`"));
    assert!(refusal(&SHORT.replace("segments", "segmnts")).contains("`segmnts`"));
    assert!(refusal(&SHORT.replace("linear_density: 0.1, ", "")).contains("`linear_density`"));
}
