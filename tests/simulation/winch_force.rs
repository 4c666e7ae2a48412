//! The greatest force of a winch.

use std::sync::Arc;

use bevy::prelude::*;
use bevy_mass_spring::prelude::*;

use super::net_breaking::{net, watching};
use crate::common::{run, scheme};

const LINKS: u32 = 26;
const LINK: f32 = 0.1;
const GRAVITY: f32 = 9.81;
/// Speed at which the winches take in, m/s.
const SPEED: f32 = 0.45;
/// At this one, the steel cable gains 2.5 times its greatest force in a tick of 1/60 s, the rod 10 times.
const MATERIALS: [(RopeMaterial, f32); 5] = [
    (RopeMaterial::RUBBER_CORD, 30.0),
    (RopeMaterial::HEMP, 4e3),
    (RopeMaterial::POLYETHYLENE, 1e3),
    (RopeMaterial::STEEL_CABLE, 4e3),
    (RopeMaterial::STEEL_ROD, 4e3),
];
const TIME_STEPS: [f64; 3] = [1.0 / 120.0, 1.0 / 60.0, 1.0 / 30.0];

/// A winch with a rope in an app.
struct Crane {
    app: App,
    rope: Entity,
    jib: Entity,
    time_step: f64,
    max_force: f32,
}

impl Crane {
    /// With a rope of 2.6 m that hangs from the origin in equilibrium, a load of these newtons at its end. The winch stands
    /// still.
    fn new(
        material: RopeMaterial,
        max_force: f32,
        load: f32,
        integrator: Integrator,
        time_step: f64,
    ) -> Self {
        let mut app = watching();
        app.init_resource::<SpringForces>();
        app.insert_resource(SolverSettings { integrator, ..default() });
        app.insert_resource(Time::<Fixed>::from_seconds(time_step));
        let path = Rope::between(Vec3::ZERO, Vec3::NEG_Y * (LINKS as f32 * LINK));
        let mut topology =
            path.with_spacing(LINK).with_material(material).topology().expect("the recipe is sound");
        *topology.masses.last_mut().unwrap() += load / GRAVITY;
        let mut hanging = ParticleNet::new(Arc::new(topology.clone()), &Transform::IDENTITY);
        for number in 1..hanging.len() {
            let below: f32 = topology.masses[number..].iter().sum();
            let length = LINK * (1.0 + below * GRAVITY / material.stretch_stiffness);
            hanging.positions_mut()[number] = hanging.positions()[number - 1] + Vec3::NEG_Y * length;
        }
        let rope = app.world_mut().spawn(hanging).id();
        let winch = Winch { max_force: Some(max_force), min_length: 0.3, ..default() };
        let jib = app.world_mut().spawn((PartOf(rope), Part::Start, Pinned, winch)).id();
        let mut crane = Self { app, rope, jib, time_step, max_force };
        crane.run(2);
        crane
    }

    fn turn(&mut self, speed: f32) {
        self.app.world_mut().get_mut::<Winch>(self.jib).unwrap().speed = speed;
    }

    fn run(&mut self, ticks: u32) {
        run(&mut self.app, ticks);
    }

    fn ticks(&self, seconds: f64) -> u32 {
        (seconds / self.time_step).round() as u32
    }

    fn net(&self) -> &ParticleNet {
        net(&self.app, self.rope)
    }

    fn net_mut(&mut self) -> Mut<'_, ParticleNet> {
        self.app.world_mut().get_mut(self.rope).unwrap()
    }

    fn length(&self) -> f64 {
        self.net().wound_out().unwrap()
    }

    /// The tension of the link at the winch in parts of the greatest force. It bears most of those that do not end at
    /// two particles that are held, as one does that is on its way out.
    fn tension(&self) -> f32 {
        let net = self.net();
        let springs = net.topology().springs.iter().enumerate();
        let bearing = springs.filter(|(_, (ends, _))| !ends.iter().all(|end| net.is_pinned(*end)));
        bearing.map(|(number, _)| net.tension(number)).fold(0.0, f32::max) / self.max_force
    }

    /// The greatest tension at the end of any of the next ticks.
    fn greatest_tension(&mut self, seconds: f64) -> f32 {
        (0..self.ticks(seconds)).fold(0.0, |greatest, _| {
            self.run(1);
            greatest.max(self.tension())
        })
    }

    fn bits(&self) -> Vec<u32> {
        let net = self.net();
        let vectors = net.positions().iter().chain(net.velocities());
        let length = self.length().to_bits();
        let bits = vectors.flat_map(|vector| vector.to_array().map(f32::to_bits));
        bits.chain([length as u32, (length >> 32) as u32]).collect()
    }
}

/// Each material, scheme and time step, with the weight of the rope in parts of the greatest force.
fn for_all(mut test: impl FnMut(&str, RopeMaterial, f32, Integrator, f64)) {
    for (material, max_force) in MATERIALS {
        for integrator in [Integrator::Auto, Integrator::ImplicitEuler, Integrator::VelocityVerlet] {
            // Stiffer ones move by less than an ulp in an explicit substep.
            if integrator == Integrator::VelocityVerlet && material != RopeMaterial::RUBBER_CORD {
                continue;
            }
            for time_step in TIME_STEPS {
                let name = format!("EA = {} N, {integrator}, {time_step:.4} s", material.stretch_stiffness);
                test(&name, material, max_force, integrator, time_step);
            }
        }
    }
}

/// The end is held fast, from the start or when a load of a quarter of the force has been lifted: the tension goes up to the
/// greatest force and stays there. The law ends within 1e-4 v h (k + 2 Z / h) of it, 0.3 % for the rod; positions are known
/// to 1e-7 m, on which the rod has 0.02 %.
#[test]
fn a_winch_stalls_at_its_greatest_force() {
    for_all(|name, material, max_force, integrator, time_step| {
        for share in [0.0, 0.25] {
            let mut crane = Crane::new(material, max_force, share * max_force, integrator, time_step);
            crane.turn(-SPEED);
            if share > 0.0 {
                crane.run(crane.ticks(1.5));
                assert!(crane.length() < 2.0, "{name}: {} m", crane.length());
            }
            crane.net_mut().set_pinned(LINKS, true);
            let greatest = crane.greatest_tension(4.0);
            assert!(greatest < 1.01, "{name}, {share}: up to {greatest}");
            let (tension, length) = (crane.tension(), crane.length());
            assert!(tension > 0.99, "{name}, {share}: {tension} at last");
            for _ in 0..crane.ticks(0.5) {
                crane.run(1);
                assert!((crane.tension() - tension).abs() < 1e-3, "{name}, {share}: {}", crane.tension());
                assert!((crane.length() - length).abs() < 1e-6, "{name}, {share}: {} m", crane.length());
            }
            // Half of the rope's own weight hangs on its middle: T = EA (D / L − 1).
            let way = f64::from(-crane.net().positions()[LINKS as usize].y);
            let weight = length as f32 * material.linear_density * GRAVITY;
            let mean = f64::from(material.stretch_stiffness) * (way / length - 1.0);
            let expected = f64::from(tension * max_force - 0.5 * weight);
            assert!((mean / expected - 1.0).abs() < 0.01, "{name}, {share}: {mean} N of {expected} N");
        }
    });
}

/// Tensions under Xpbd converge with its substeps: to a tenth with 400 of them and 26 links.
#[test]
fn a_winch_stalls_near_its_greatest_force_under_xpbd() {
    let mut crane = Crane::new(RopeMaterial::RUBBER_CORD, 30.0, 7.5, Integrator::Auto, 1.0 / 60.0);
    crane.app.insert_resource(scheme(Integrator::Xpbd, 400));
    crane.turn(-SPEED);
    crane.run(crane.ticks(1.5));
    assert!(crane.length() < 2.1, "{} m", crane.length());
    crane.net_mut().set_pinned(LINKS, true);
    let greatest = crane.greatest_tension(4.0);
    assert!(greatest < 1.1, "up to {greatest}");
    let length = crane.length();
    for _ in 0..crane.ticks(0.5) {
        crane.run(1);
        assert!((crane.tension() - 1.0).abs() < 0.1, "{}", crane.tension());
        assert!((crane.length() - length).abs() < 1e-3, "{} m", crane.length());
    }
}

/// A load of 95 % of the greatest force goes up at the winch's speed: what is left accelerates it by g / 19. One of 105 %
/// stays where it is, and the rope with it.
#[test]
fn a_winch_lifts_what_is_just_below_its_greatest_force() {
    for_all(|name, material, max_force, integrator, time_step| {
        let weight = 2.6 * material.linear_density * GRAVITY;
        for share in [0.95, 1.05] {
            let mut crane =
                Crane::new(material, max_force, share * max_force - weight, integrator, time_step);
            let whole = crane.length();
            crane.turn(-SPEED);
            let greatest = crane.greatest_tension(3.0);
            let start = crane.length();
            crane.run(crane.ticks(1.0));
            let speed = (start - crane.length()) as f32 / SPEED;
            if share < 1.0 {
                assert!(greatest < 1.02, "{name}: up to {greatest}");
                assert!((speed - 1.0).abs() < 0.01, "{name}: {speed} of its speed");
            } else {
                assert_eq!((start, speed), (whole, 0.0), "{name}");
                assert!((crane.tension() - share).abs() < 0.01, "{name}: {}", crane.tension());
            }
        }
    });
}

/// Below the greatest force the length is L₀ − v t.
#[test]
fn a_winch_below_its_greatest_force_turns_at_its_speed() {
    for_all(|name, material, max_force, integrator, time_step| {
        let mut crane = Crane::new(material, max_force, 0.5 * max_force, integrator, time_step);
        let mut expected = crane.length();
        let ticks = crane.ticks(3.0);
        for tick in 0..ticks {
            let speed = SPEED * (tick.min(ticks - tick) as f32 * time_step as f32).min(1.0);
            crane.turn(-speed);
            crane.run(1);
            expected -= f64::from(speed) * time_step;
            assert!((crane.length() - expected).abs() < 1e-3, "{name}, tick {tick}: {} m", crane.length());
        }
    });
}

/// A load that becomes too heavy on its way is stopped and held: of what is wound up no more goes out again than a tick took in.
#[test]
fn a_winch_holds_what_becomes_too_heavy() {
    for_all(|name, material, max_force, integrator, time_step| {
        let mut crane = Crane::new(material, max_force, 0.5 * max_force, integrator, time_step);
        crane.turn(-SPEED);
        crane.run(crane.ticks(2.0));
        let mut least = crane.length();
        assert!(least < 2.0, "{name}: {least} m");
        crane.net_mut().applied_forces_mut()[LINKS as usize] = Vec3::NEG_Y * (0.7 * max_force);
        for _ in 0..crane.ticks(4.0) {
            crane.run(1);
            let length = crane.length();
            assert!(length - least < f64::from(SPEED) * time_step, "{name}: {length} m after {least} m");
            least = least.min(length);
        }
        let length = crane.length();
        crane.run(crane.ticks(1.0));
        assert!((crane.length() - length).abs() < 0.01, "{name}: {} m after {length} m", crane.length());
    });
}

/// What is slack is taken in at full speed until what remains is less than two ticks of it. Then the rope is taut, and no
/// more than that. (A rod does not hang in a bight.)
#[test]
fn a_winch_takes_in_what_is_slack() {
    for_all(|name, material, max_force, integrator, time_step| {
        if material == RopeMaterial::STEEL_ROD {
            return;
        }
        let mut crane = Crane::new(material, max_force, 0.0, integrator, time_step);
        // Hangs in a bight between two points at 1.5 m.
        let mut net = crane.net_mut();
        for number in 0..=LINKS {
            let (share, half) = (number as f32 / LINKS as f32, LINKS as f32 / 2.0);
            let depth = LINK * (1.0 - 0.75 * 0.75 / 1.69_f32).sqrt() * (half - (number as f32 - half).abs());
            net.positions_mut()[number as usize] = Vec3::new(1.5 * share, -depth, 0.0);
        }
        net.velocities_mut().fill(Vec3::ZERO);
        net.set_pinned(LINKS, true);
        // Its swings die out within 0.4 s; it moves against 0.1 % of the force of the softest.
        let viscosity = 5.0 * LINK * material.linear_density;
        crane.app.world_mut().resource_mut::<Environment>().viscosity = viscosity;
        crane.run(crane.ticks(3.0));
        crane.turn(-SPEED);
        let (mut expected, mut greatest) = (crane.length(), 0.0_f32);
        for _ in 0..crane.ticks(6.0) {
            crane.run(1);
            expected -= f64::from(SPEED) * time_step;
            greatest = greatest.max(crane.tension());
            if crane.length() - 1.5 > 2.0 * f64::from(SPEED) * time_step && greatest < 0.1 {
                assert!((crane.length() - expected).abs() < 1e-3, "{name}: {} m", crane.length());
            }
        }
        assert!(greatest < 1.05, "{name}: up to {greatest}");
        assert!((crane.tension() - 1.0).abs() < 0.01, "{name}: {}", crane.tension());
    });
}

/// The mass of what is tied to the rope is not the rope's own: what it does is found by what it has done.
#[test]
fn a_winch_lifts_a_load_that_is_tied_to_its_rope() {
    for_all(|name, material, max_force, integrator, time_step| {
        for share in [0.9, 1.1] {
            let load = share * max_force - 2.6 * material.linear_density * GRAVITY;
            let mut crane = Crane::new(material, max_force, load, integrator, time_step);
            let mut net = crane.net_mut();
            let mut topology = (**net.topology()).clone();
            *topology.masses.last_mut().unwrap() -= load / GRAVITY;
            net.set_topology(Arc::new(topology));
            let place = Transform::from_translation(net.positions()[LINKS as usize]);
            let world = crane.app.world_mut();
            let tied = world.spawn((Particle::new(load / GRAVITY, 0.0), place)).id();
            world.spawn((PartOf(crane.rope), Part::End, Attachment::to(tied)));
            crane.run(2);
            crane.turn(-SPEED);
            crane.run(crane.ticks(2.0));
            let start = crane.length();
            crane.run(crane.ticks(1.0));
            let speed = (start - crane.length()) as f32 / SPEED;
            let expected = if share < 1.0 { 1.0 } else { 0.0 };
            assert!((speed - expected).abs() < 0.02, "{name}, {share}: {speed} of its speed");
        }
    });
}

/// The jib rises and sinks by 0.5 m with the load: the rope is no longer or shorter for it.
#[test]
fn a_winch_on_a_moving_jib_turns_as_on_one_at_rest() {
    for_all(|name, material, max_force, integrator, time_step| {
        let mut crane = Crane::new(material, max_force, 0.5 * max_force, integrator, time_step);
        let mut expected = crane.length();
        for tick in 0..crane.ticks(4.0) {
            let time = (tick + 1) as f32 * time_step as f32;
            let speed = 0.2 * time.min(1.0);
            crane.turn(-speed);
            let height = 0.25 * (1.0 - (1.5 * time).cos());
            crane.app.world_mut().get_mut::<Transform>(crane.jib).unwrap().translation.y = height;
            crane.run(1);
            expected -= f64::from(speed) * time_step;
            assert!((crane.length() - expected).abs() < 1e-3, "{name}, tick {tick}: {} m", crane.length());
        }
    });
}

/// From any tick on, on the way to the stall and in it.
#[test]
fn snapshots_and_restarts_of_a_stalled_winch_repeat_every_bit() {
    for (material, max_force) in MATERIALS {
        let mut crane = Crane::new(material, max_force, 0.97 * max_force, Integrator::Auto, 1.0 / 60.0);
        crane.turn(-SPEED);
        let mut history = Vec::new();
        for _ in 0..40 {
            history.push((Snapshot::take(crane.app.world()), crane.bits()));
            crane.run(1);
        }
        let last = crane.bits();
        for (tick, (snapshot, bits)) in history.iter().enumerate() {
            snapshot.restore(crane.app.world_mut());
            assert!(crane.bits() == *bits, "tick {tick}");
            crane.run(40 - tick as u32);
            assert!(crane.bits() == last, "from tick {tick} on");
        }
        let restarted = |crane: &mut Crane| {
            RestoreInitialState.apply(crane.app.world_mut());
            crane.turn(-SPEED);
            crane.run(60);
            crane.bits()
        };
        let first = restarted(&mut crane);
        assert!(restarted(&mut crane) == first);
    }
}

/// Ropes of hemp and steel with a load: within 1 mm of L₀ + v t, the tension in steps below 5 % as links come and go. At
/// 0.1 m/s² the load swings by 1 % of its weight.
#[test]
fn winches_with_ropes_of_data_sheets_turn_without_a_jerk() {
    for (name, material, load) in
        [("hemp", RopeMaterial::HEMP, 200.0), ("steel", RopeMaterial::STEEL_CABLE, 2e3)]
    {
        let mut crane = Crane::new(material, 4e3, load, Integrator::Auto, 1.0 / 64.0);
        crane.run(60);
        for direction in [-1.0, 1.0_f32] {
            let (start, mut turned, mut last) = (crane.length(), 0.0, crane.tension());
            for tick in 0..500 {
                let speed = direction * 0.3 * (tick.min(499 - tick) as f32 / 192.0).min(1.0);
                crane.turn(speed);
                crane.run(1);
                turned += f64::from(speed) / 64.0;
                assert!((crane.length() - start - turned).abs() < 1e-3, "{name}: {} m", crane.length());
                let now = crane.tension();
                assert!((now / last - 1.0).abs() < 0.05, "{name}, tick {tick}: {now} after {last}");
                last = now;
            }
            assert!(turned.abs() > 1.0, "a dozen links");
        }
    }
}
