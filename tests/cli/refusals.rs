//! What is refused: exit status 2, and nothing is written.

use crate::workplace::{Workplace, shipped};

#[test]
fn bad_arguments_are_refused() {
    let place = Workplace::with_scene(&shipped("pendulum"));
    for (arguments, expected) in [
        (&["--duration", "-1"][..], "expected a finite number of seconds > 0"),
        (&["--duration", "0"], "expected a finite number of seconds > 0"),
        (&["--duration", "NaN"], "expected a finite number of seconds > 0"),
        (&["--duration", "inf"], "expected a finite number of seconds > 0"),
        (&["--duration", "1e300"], "too long"),
        (&["--time-step", "0"], "expected a finite number of seconds > 0"),
        (&["--time-step", "-0.1"], "expected a finite number of seconds > 0"),
        (&["--time-step", "nan"], "expected a finite number of seconds > 0"),
        (&["--time-step", "1e-12"], "clock"),
        (&["--duration", "1", "--ticks", "1"], "cannot be used with"),
        (&["--ticks", "-1"], "-1"),
        (&["--ticks", "1.5"], "1.5"),
        (&["--every", "0"], "every"),
        (&["--threads", "0"], "threads"),
        (&["--substeps", "0"], "expected a whole number >= 1, or auto"),
        (&["--substeps", "few"], "expected a whole number >= 1, or auto"),
        (&["--integrator", "Leapfrog"], "VelocityVerlet"),
        (&["--csv", "-", "--json", "-"], "both"),
        (&["--csv", "same", "--json", "same"], "both"),
        (&["--csv", "a.scene.ron"], "overwritten"),
        (&["--csv", "missing/states.csv"], "missing/states.csv"),
        (&["--csv", "states.csv", "--json", "missing/summary.json"], "missing/summary.json"),
        (&["--csv", "."], "cannot write"),
        (&["--frobnicate"], "--frobnicate"),
    ] {
        let arguments = [&["run", "a.scene.ron"], arguments].concat();
        let errors = place.refusal(&arguments);
        assert!(errors.contains(expected), "{arguments:?}: {errors}");
    }
    place.refusal(&[]);
    place.refusal(&["run"]);
    place.refusal(&["check"]);
    place.refusal(&["walk", "a.scene.ron"]);
}

#[test]
fn a_refused_scene_is_named_with_place_and_field() {
    let place = Workplace::with_scene("(particles: [\n  (position: (0, 0, 0), mass: -1),\n])");
    let message = "a.scene.ron:2:31: particles[0].mass is -1.0, expected a finite number > 0";
    for arguments in
        [&["run", "a.scene.ron", "--csv", "b.csv", "--json", "b.json"][..], &["check", "a.scene.ron"]]
    {
        let errors = place.refusal(arguments);
        assert_eq!(errors, format!("error: {message}\n"), "{arguments:?}");
        assert!(
            place.refusal(&[arguments[0], "missing.scene.ron"]).contains("missing.scene.ron: cannot be read")
        );
    }
}
