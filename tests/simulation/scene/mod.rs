//! Scene files: what is read, what is refused and where, and what a scene becomes.

mod assets;
mod colliders;
mod nets;
mod reading;
mod refusals;
mod spawning;

/// The example of the contract, to the letter.
pub const EXAMPLE: &str = r#"(
    environment: (                       // optional; these are the defaults
        gravity: (0.0, -9.81, 0.0),      // m/s²
        viscosity: 0.0,                  // N·s/m
    ),
    solver: (                            // optional; these are the defaults
        time_step: 0.016666666666666666, // s, one fixed tick
        integrator: Auto,                // see below
        substeps: Auto,                  // Auto | Fixed(n), n >= 1
    ),
    collisions: (                        // optional; these are the defaults
        ground: true,                    // particles against planes
        particles: true,                 // particles against particles
        restitution: 0.0,                // particle against particle, 0..=1
        friction: 0.0,                   // particle against particle, Coulomb, >= 0
    ),
    particles: [
        // velocity: (0,0,0), radius: 0.0 and pinned: false are the defaults
        (position: (0.0, 2.0, 0.0), mass: 1.0, radius: 0.05, pinned: true),
        (position: (0.1, 2.0, 0.0), velocity: (0.0, 0.0, 0.0), mass: 1.0, radius: 0.05),
    ],
    springs: [                           // optional; damping: 0.0 is the default
        // particles: indices into the list above. rest_length omitted: the initial distance
        (particles: (0, 1), rest_length: 0.1, stiffness: 1000.0, damping: 1.0),
    ],
    planes: [                            // optional; point (0,0,0), restitution 0.0, friction 0.0 are the defaults
        (point: (0.0, 0.0, 0.0), normal: (0.0, 1.0, 0.0), restitution: 0.5, friction: 0.0),
    ],
)
"#;
