//! Jumps of the base, and starts and ends on a wall: what moves the particle, and what is rounding.

use lovines::cavity::GRAVITY;
use lovines::{Cavity, Drive, Event, Parameters, Plant, State};

const RAMP: f64 = 0.3;
const SAMPLES: [u32; 8] = [1, 2, 8, 10, 64, 100, 1000, 4001];

/// `M = k = b = 1`.
fn rig(damping: f64, particle_mass: f64, cavity: Cavity) -> Parameters {
    let dimensionless = Parameters::dimensionless(particle_mass, 1.0, 0.5);
    Parameters { damping, cavity, ..dimensionless }
}

/// Two seconds of a ramp in samples, each with its exact displacement and slope.
fn ramp(plant: &mut Plant, samples: u32, offset: f64) {
    let step = 2.0 / f64::from(samples);
    for n in 0..samples {
        let signal = [offset + RAMP * (f64::from(n) * step), RAMP, 0.0, 0.0];
        plant.advance(Drive { signal, ..Drive::default() }, step).unwrap();
    }
}

#[test]
fn the_samples_of_a_ramp_do_not_break_static_friction() {
    let cavity = Cavity {
        kinetic_friction: 0.02,
        static_friction: Some(0.04),
        ..Cavity::IDEAL
    };
    for samples in SAMPLES {
        for offset in [0.0, 1.0, -0.3] {
            let start = State { q1: offset, q2: offset, ..State::default() };
            let mut plant = Plant::new(rig(0.1, 0.1, cavity), start).unwrap();
            plant.begin(Drive::held(offset)).unwrap();
            ramp(&mut plant, samples, offset);
            let totals = plant.totals();
            assert_eq!(
                (plant.relative_displacement(), totals.sticks),
                (0.0, 1),
                "{samples} from {offset}"
            );
            assert!((totals.stuck_time - 2.0).abs() < 1e-12 && totals.friction == 0.0);
        }
    }
}

#[test]
fn the_samples_of_a_ramp_are_no_impacts_of_a_particle_at_rest_on_its_wall() {
    for tilt in [-0.05, 0.05] {
        for samples in SAMPLES {
            let start = State { q2: f64::copysign(1.0, tilt), ..State::default() };
            let mut plant = Plant::new(rig(0.5, 0.1, Cavity { tilt, ..Cavity::IDEAL }), start).unwrap();
            ramp(&mut plant, samples, 0.0);
            assert_eq!(
                (plant.totals().impacts, plant.totals().dissipated),
                (0, 0.0),
                "{samples}, {tilt}"
            );
        }
    }
}

#[test]
fn a_jump_of_the_base_releases_a_particle_only_if_it_moves_it() {
    let cavity = Cavity { kinetic_friction: 1.0 / GRAVITY, ..Cavity::IDEAL };
    // Jumps that friction can transmit: without damping there is no kick, with damping every kick slides a little.
    for (damping, jump, sticks, impacts) in [(0.0, 0.01, 1, 0), (0.3, 0.01, 41, 0), (0.3, 1e-11, 1, 0)] {
        for oscillator in [false, true] {
            let mut plant = Plant::new(rig(damping, 0.1, cavity), State::default()).unwrap();
            plant.advance(Drive::default(), 0.02).unwrap();
            for n in 0..40 {
                let e = if n % 2 == 0 { jump } else { 0.0 };
                // At a frequency of 0 the phase stays where it is, at a quarter of a turn.
                let drive = if oscillator {
                    Drive { amplitude: e, ..Drive::default() }
                } else {
                    Drive::held(e)
                };
                if oscillator && n == 0 {
                    plant
                        .advance(Drive::harmonic(0.0, core::f64::consts::FRAC_PI_2 / 0.02), 0.02)
                        .unwrap();
                }
                plant.advance(drive, 0.02).unwrap();
            }
            let totals = plant.totals();
            assert_eq!(
                (totals.sticks, totals.impacts),
                (sticks, impacts),
                "{damping} {jump} {oscillator}"
            );
            assert_eq!(plant.relative_displacement() != 0.0, sticks > 1);
        }
    }
}

#[test]
fn a_jump_within_the_rounding_of_the_amplitude_does_not_break_static_friction() {
    let cavity = Cavity {
        kinetic_friction: 0.5 / GRAVITY,
        static_friction: Some(2.0 / GRAVITY),
        ..Cavity::IDEAL
    };
    // The spring pulls at the particle with more than kinetic friction, so that it would go on sliding.
    let start = State { q1: 1.0, q2: 1.0, ..State::default() };
    let amplitude = 0.01;
    for (share, sticks) in [(1.5, true), (2.5, false)] {
        let mut plant = Plant::new(rig(0.1, 0.1, cavity), start).unwrap();
        let drive = Drive { amplitude, ..Drive::default() };
        plant.advance(drive, 1e-3).unwrap();
        assert!(plant.sticks());
        // The amplitude before and after counts, in units of the rounding of eight additions.
        let signal = [-share * 8.0 * f64::EPSILON * amplitude, 0.0, 0.0, 0.0];
        plant.advance(Drive { signal, ..drive }, 1e-3).unwrap();
        assert_eq!(plant.sticks(), sticks, "{share}");
    }
}

#[test]
fn a_kick_whose_hop_cannot_be_resolved_moves_both_masses_as_one() {
    let parameters = rig(0.5, 0.25, Cavity { tilt: -0.05, ..Cavity::IDEAL });
    let press = GRAVITY * 0.05f64.sin();
    // The hop has the height `kick²/(2 a)`.
    let kick = (2.0 * 2f64.powi(-56) * press).sqrt();
    for (share, impacts) in [(0.9, 0), (1.2, 1)] {
        // The displacement of the spring does not matter: the jump is of 1e-8.
        for sign in [1.0, -1.0] {
            let mut plant = Plant::new(parameters, State { q2: -1.0, ..State::default() }).unwrap();
            plant.begin(Drive::default()).unwrap();
            plant.advance(Drive::default(), 1e-12).unwrap();
            assert!(plant.contact().is_some());
            let before = plant.state();
            let jump = sign * share * kick / 0.5;
            let mut events = Vec::new();
            plant
                .advance_with(Drive::held(jump), 1e-12, |event| events.push(event))
                .unwrap();
            let state = plant.state();
            let hit = events
                .iter()
                .filter(|event| matches!(event, Event::Impact { .. }))
                .count();
            assert_eq!(hit, if sign > 0.0 { impacts } else { 0 }, "{share} {sign} {events:?}");
            assert_eq!(plant.contact().is_some(), share < 1.0, "{share} {sign} {events:?}");
            let momentum = (state.dq1 - before.dq1) + 0.25 * (state.dq2 - before.dq2);
            assert!((momentum / (0.5 * jump) - 1.0).abs() < 1e-3, "{momentum:e} {jump:e}");
        }
    }
}

#[test]
fn a_start_on_a_wall_is_on_it_whatever_the_gaps() {
    let mut random = fastrand::Rng::with_seed(1);
    for _ in 0..2000 {
        let [plus, minus] = [0.0; 2].map(|_| 0.3 + 2.0 * random.f64());
        let q1 = 6.0 * (random.f64() - 0.5);
        let cavity = Cavity { b_plus: Some(plus), b_minus: Some(minus), ..Cavity::IDEAL };
        for w in [plus, -minus] {
            let start = State { q1, q2: q1 - w, ..State::default() };
            let mut plant = Plant::new(rig(0.1, 0.1, cavity), start).unwrap();
            assert_eq!(plant.relative_displacement(), w);
            // The spring presses the wall towards the particle.
            plant.advance(Drive::held(q1 + w), 1e-9).unwrap();
            assert_eq!(
                (plant.contact().is_some(), plant.relative_displacement()),
                (true, w),
                "{plus} {minus} {q1}"
            );
        }
    }
}

#[test]
fn friction_that_ends_the_last_hop_holds_the_particle_on_the_floor() {
    // Gravity does not press the particle to the wall, friction alone stops it after a slow impact.
    let cavity = Cavity {
        kinetic_friction: 0.02,
        static_friction: Some(0.04),
        ..Cavity::IDEAL
    };
    for direction in [1.0, -1.0] {
        let start = State {
            dq1: direction * 1e-9,
            q2: -direction * (1.0 - 1e-18),
            ..State::default()
        };
        let mut plant = Plant::new(rig(0.1, 0.1, cavity), start).unwrap();
        let mut events = Vec::new();
        for n in 0..20 {
            plant
                .advance_with(Drive::held(0.0), 0.05, |event| events.push((n, event)))
                .unwrap();
        }
        assert_eq!(
            (plant.contact(), plant.sticks(), plant.totals().sticks),
            (None, true, 1),
            "{events:?}"
        );
        // A push towards the wall: the particle slips the nothing that is left and rests on the wall.
        let push = Drive { signal: [0.0, direction * 6.0, 0.0, 0.0], ..Drive::default() };
        plant.advance(push, 0.05).unwrap();
        assert_eq!(
            (plant.contact().map(|wall| wall.sign()), plant.totals().impacts),
            (Some(direction), 1)
        );
    }
}
