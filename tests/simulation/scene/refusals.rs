//! What is refused, with the position and message of each error.

use bevy_mass_spring::prelude::*;
use bevy_mass_spring::scene::{Position, SceneErrorReason};

use super::EXAMPLE;

fn refusal(text: &str) -> String {
    MassSpringScene::from_ron(text).expect_err("this scene must be refused").to_string()
}

/// Two particles one below the other, so that the fields of each stand on a line of their own, and
/// whatever else the scene has.
fn two_particles_and(rest: &str) -> String {
    format!(
        "(\n  particles: [\n    (position: (0, 0, 0), mass: 1),\n    (position: (3, 4, 0), mass: 1),\n  ],\n{rest}\n)"
    )
}

#[test]
fn every_integrator_by_its_name() {
    for integrator in Integrator::ALL {
        let text = format!("(solver: (integrator: {integrator}), particles: [])");
        let scene = MassSpringScene::from_ron(&text).unwrap();
        assert_eq!(scene.solver.integrator, integrator);
    }
}

/// Each refusal of the contract: what stands in the file, with a § where the value at fault begins, and
/// the message.
#[test]
fn bad_values_are_refused_with_place_index_and_field() {
    let particle = |fields: &str| format!("(particles: [\n(position: (0, 0, 0), mass: 1),\n({fields}),\n])");
    let spring = |fields: &str| two_particles_and(&format!("springs: [\n({fields})]"));
    let plane = |fields: &str| format!("(particles: [], planes: [\n({fields})])");
    let positive = "expected a finite number > 0";
    let not_negative = "expected a finite number >= 0";
    let fraction = "expected a number from 0 to 1";
    let vector = "expected a vector of finite numbers";
    let cases = [
        (particle("position: (0, 0, 0), mass: §-1"), format!("particles[1].mass is -1.0, {positive}")),
        (particle("position: (0, 0, 0), mass: §0"), format!("particles[1].mass is 0.0, {positive}")),
        (particle("position: (0, 0, 0), mass: §NaN"), format!("particles[1].mass is NaN, {positive}")),
        (particle("position: (0, 0, 0), mass: §inf"), format!("particles[1].mass is inf, {positive}")),
        (particle("position: (0, 0, 0), mass: §1e39"), format!("particles[1].mass is inf, {positive}")),
        (
            particle("position: (0, 0, 0), mass: 1, radius: §-0.1"),
            format!("particles[1].radius is -0.1, {not_negative}"),
        ),
        (
            particle("mass: 1, position: §(0, NaN, 0)"),
            format!("particles[1].position is [0.0, NaN, 0.0], {vector}"),
        ),
        (
            particle("mass: 1, position: (0, 0, 0), velocity: §(-inf, 0, 0)"),
            format!("particles[1].velocity is [-inf, 0.0, 0.0], {vector}"),
        ),
        (
            spring("particles: (0, 1), stiffness: §-5"),
            format!("springs[0].stiffness is -5.0, {not_negative}"),
        ),
        (
            spring("particles: (0, 1), stiffness: 5, damping: §-1e-3"),
            format!("springs[0].damping is -0.001, {not_negative}"),
        ),
        (
            spring("particles: (0, 1), stiffness: 5, max_stretch: §Some(-0.1)"),
            format!("springs[0].max_stretch is -0.1, {not_negative}"),
        ),
        (
            spring("particles: (0, 1), rest_length: §-1, stiffness: 5"),
            format!("springs[0].rest_length is -1.0, {not_negative}"),
        ),
        (
            spring("stiffness: 5, particles: §(0, 2)"),
            "springs[0].particles is (0, 2), expected two indices into the list of 2 particles".to_owned(),
        ),
        (
            spring("stiffness: 5, particles: §(1, 1)"),
            "springs[0].particles is (1, 1), expected the indices of two different particles".to_owned(),
        ),
        (
            plane("normal: §(0, 0, 0)"),
            "planes[0].normal is [0.0, 0.0, 0.0], expected a vector that is not zero".to_owned(),
        ),
        (plane("normal: §(0, inf, 0)"), format!("planes[0].normal is [0.0, inf, 0.0], {vector}")),
        (
            plane("normal: (0, 1, 0), point: §(NaN, 0, 0)"),
            format!("planes[0].point is [NaN, 0.0, 0.0], {vector}"),
        ),
        (plane("normal: (0, 1, 0), restitution: §1.5"), format!("planes[0].restitution is 1.5, {fraction}")),
        (plane("normal: (0, 1, 0), friction: §-1"), format!("planes[0].friction is -1.0, {not_negative}")),
        (
            "(environment: (viscosity: §-1), particles: [])".to_owned(),
            format!("environment.viscosity is -1.0, {not_negative}"),
        ),
        (
            "(environment: (gravity: §(0, -inf, 0)), particles: [])".to_owned(),
            format!("environment.gravity is [0.0, -inf, 0.0], {vector}"),
        ),
        (
            "(environment: (gusts: Some((length: 2, strength: §-1))), particles: [])".to_owned(),
            format!("environment.gusts.strength is -1.0, {not_negative}"),
        ),
        (
            "(environment: (gusts: (time: §0)), particles: [])".to_owned(),
            format!("environment.gusts.time is 0.0, {positive}"),
        ),
        (
            "(collisions: (restitution: §-0.5), particles: [])".to_owned(),
            format!("collisions.restitution is -0.5, {fraction}"),
        ),
        (
            "(collisions: (friction: §inf), particles: [])".to_owned(),
            format!("collisions.friction is inf, {not_negative}"),
        ),
        (
            // A field that is not there: the place of its spring. The distance is too great for f32.
            "(particles: [
                (position: (-3e38, 0, 0), mass: 1),
                (position: (3e38, 0, 0), mass: 1),
            ], springs: [§(particles: (0, 1), stiffness: 5)])"
                .to_owned(),
            format!("springs[0].rest_length is inf, {not_negative}"),
        ),
        (
            "(solver: (substeps: §Fixed(0)), particles: [])".to_owned(),
            "solver.substeps is Fixed(0), expected Auto or Fixed(n) with n >= 1".to_owned(),
        ),
    ];
    for (marked, message) in cases {
        let (before, after) = marked.split_once('§').expect("a mark where the value begins");
        let line = before.lines().count();
        let column = before.lines().last().unwrap().chars().count() + 1;
        let text = format!("{before}{after}");
        let error = MassSpringScene::from_ron(&text).expect_err(&message);
        assert_eq!(error.position, Some(Position { line, column }), "{error}\n{text}");
        let message = format!("line {line}, column {column}: {message}");
        assert!(error.to_string().starts_with(&message), "expected: {message}\nfound:    {error}\n{text}");
    }
}

#[test]
fn bad_time_steps_are_refused() {
    for (time_step, printed) in [
        ("0", "0.0"),
        ("-0.01", "-0.01"),
        ("NaN", "NaN"),
        ("inf", "inf"),
        ("1e-12", "1e-12"),
        ("1e300", "1e300"),
    ] {
        let error = refusal(&format!("(\n\n  solver: (time_step: {time_step}),\n  particles: [])"));
        let message = format!("line 3, column 23: solver.time_step is {printed}, expected a ");
        assert!(error.starts_with(&message), "{error}");
    }
}

/// Faults that RON itself finds: the place, the field that was being read, and what was expected.
#[test]
fn malformed_text_is_refused_with_place_and_field() {
    let cases = [
        // A missing comma.
        (two_particles_and("springs: [\n(particles: (0, 1) stiffness: 5)]"), 7, "springs[0]", "comma"),
        // A field that does not exist.
        (two_particles_and("springs: [\n(particles: (0, 1), stifness: 5)]"), 7, "springs[0]", "stifness"),
        (two_particles_and("sprigns: []"), 6, "", "`sprigns`"),
        (two_particles_and("environment: (\nviscosty: 1)"), 7, "environment", "`viscosty` in `Environment`"),
        (two_particles_and("collisions: (\ngroud: true)"), 7, "collisions", "`groud` in `Collisions`"),
        // A field that must be there.
        (two_particles_and("springs: [\n(particles: (0, 1))]"), 7, "springs[0]", "`stiffness`"),
        ("(planes: [\n()])".to_owned(), 2, "planes[0]", "`normal`"),
        // Wrong types.
        ("(particles: [\n(position: (0, 0), mass: 1)])".to_owned(), 2, "particles[0].position", "3"),
        ("(particles: [\n(position: (0, 0, 0), mass: \"1\")])".to_owned(), 2, "particles[0].mass", "float"),
        (
            two_particles_and("springs: [\n(particles: (0, -1), stiffness: 5)]"),
            7,
            "springs[0].particles[1]",
            "whole number",
        ),
        (
            "(particles: [\n(position: (0, 0, 0), mass: 1, pinned: 1)])".to_owned(),
            2,
            "particles[0].pinned",
            "bool",
        ),
        // Unknown names.
        (
            "(\nsolver: (integrator: Leapfrog), particles: [])".to_owned(),
            2,
            "solver.integrator",
            "VelocityVerlet",
        ),
        ("(\nsolver: (substeps: Fixed(-1)), particles: [])".to_owned(), 2, "solver.substeps", "whole number"),
        // Not a scene at all.
        (String::new(), 1, "", ""),
        ("{\"particles\": []}".to_owned(), 1, "", ""),
        ("(particles: [])\n(particles: [])".to_owned(), 2, "", "trailing"),
        ("(\nparticles: [(position: (0, 0, 0), mass: 1)".to_owned(), 2, "particles", ""),
    ];
    for (text, line, path, expected) in cases {
        let error = MassSpringScene::from_ron(&text).expect_err(&text);
        assert_eq!(error.position.map(|position| position.line), Some(line), "{error}\n{text}");
        let SceneErrorReason::Malformed { path: found, message } = &error.reason else {
            panic!("{error}\n{text}");
        };
        assert!(found.starts_with(path), "{error}\n{text}");
        assert!(message.to_lowercase().contains(expected) || message.contains(expected), "{error}\n{text}");
    }
}

#[test]
fn a_file_is_named_in_its_errors() {
    let folder = tempfile::tempdir().unwrap();
    let missing = folder.path().join("missing.scene.ron");
    let error = MassSpringScene::read(&missing).unwrap_err().to_string();
    assert!(error.starts_with(&format!("{}: cannot be read: ", missing.display())), "{error}");

    let negative = folder.path().join("negative.scene.ron");
    std::fs::write(&negative, "(particles: [\n  (position: (0, 0, 0), mass: -1),\n])").unwrap();
    let error = MassSpringScene::read(&negative).unwrap_err().to_string();
    let message = "particles[0].mass is -1.0, expected a finite number > 0";
    assert_eq!(error, format!("{}:2:31: {message}", negative.display()));

    let binary = folder.path().join("binary.scene.ron");
    std::fs::write(&binary, b"(\n  \xff)").unwrap();
    let error = MassSpringScene::read(&binary).unwrap_err().to_string();
    assert_eq!(error, format!("{}:2:3: expected UTF-8 text", binary.display()));
}

#[test]
fn a_scene_made_in_code_is_checked_by_the_same_rules() {
    let mut scene = MassSpringScene::from_ron(EXAMPLE).unwrap();
    assert!(scene.validate().is_ok());
    scene.springs[0].particles = (0, 9);
    let error = scene.validate().unwrap_err().to_string();
    assert!(error.starts_with("springs[0].particles is (0, 9), expected two indices"), "{error}");
}
