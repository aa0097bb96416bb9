//! Guards periodic motions of the plant with the effects of its cavity: the ideal limit, closure, symmetry, and what is refused.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use lovines::{Cavity, Drive, Parameters, Plant, Restitution, State};
use vines_model::orbit::{
    DriveCondition, NoMotion, PlantMotion, exact_backbone, periodic_motion, resonant_motion, resonant_motion_under,
    settled_motion,
};
use vines_model::{Definition, Dimensionless, Reference, Resonance, Sensor};

/// The rig of the study, with a cavity.
fn rig(cavity: Cavity) -> Parameters {
    Parameters {
        primary_mass: 3.807,
        stiffness: 1.9e3,
        damping: 1.0,
        particle_mass: 0.032,
        half_width: 0.01,
        restitution: 0.65,
        cavity,
    }
}

/// Friction, unequal gaps, tilt, and restitution that depends on the speed: alone and together.
fn effects() -> Vec<Cavity> {
    let friction = Cavity { kinetic_friction: 0.03, ..Cavity::IDEAL };
    let held = Cavity { static_friction: Some(0.05), ..friction };
    let gaps = Cavity { b_plus: Some(0.011), b_minus: Some(0.009), ..Cavity::IDEAL };
    let tilt = Cavity { tilt: 0.005, ..Cavity::IDEAL };
    let viscoelastic = [
        Some(Restitution::Viscoelastic(0.4)),
        Some(Restitution::Viscoelastic(0.42)),
    ];
    let soft = Cavity { restitution: viscoelastic, ..Cavity::IDEAL };
    let plastic = Cavity {
        restitution: [None, Some(Restitution::Plastic(0.1))],
        ..Cavity::IDEAL
    };
    let all = Cavity {
        tilt: 0.002,
        restitution: viscoelastic,
        static_friction: Some(0.05),
        ..friction
    };
    vec![
        friction,
        held,
        gaps,
        tilt,
        soft,
        plastic,
        Cavity { b_plus: Some(0.0102), ..all },
    ]
}

/// A response of the symmetric 1:1 motion: C = 0.6.
const RESPONSE: f64 = 0.006;

fn resonant(cavity: Cavity, definition: Definition) -> PlantMotion {
    resonant_motion(&rig(cavity), definition, RESPONSE, None).expect("a motion")
}

#[test]
fn without_effects_the_motion_is_the_exact_orbit() {
    let sensors = [Sensor::V, Sensor::Q1, Sensor::Acceleration];
    let references = [Reference::Base, Reference::Force];
    for (sensor, reference) in sensors.into_iter().flat_map(|s| references.map(|r| (s, r))) {
        let definition = Definition { sensor, reference, ..Definition::default() };
        let p = rig(Cavity::IDEAL);
        let motion = resonant(Cavity::IDEAL, definition);
        let scene = Dimensionless { definition, ..Dimensionless::of(&p, motion.amplitude) };
        let orbit = exact_backbone(&scene, motion.omega / scene.omega0)
            .into_iter()
            .find(|orbit| (orbit.g / scene.g - 1.0).abs() < 1e-9)
            .unwrap_or_else(|| panic!("the exact orbit: {motion:?}"));
        let c = motion.response.norm() / p.half_width;
        assert!((orbit.c - c).abs() < 1e-11, "{definition:?}: C {} {c}", orbit.c);
        assert!(
            (motion.response.norm() - RESPONSE).abs() < 1e-12 * RESPONSE,
            "{:e}",
            motion.response.norm() - RESPONSE
        );
        assert!(
            (motion.response.arg() + FRAC_PI_2).abs() < 1e-11,
            "{}",
            motion.response.arg()
        );
        // Multipliers of the period are the squares of those of half of it.
        for (multiplier, modulus) in motion.multipliers.iter().zip(orbit.multipliers) {
            assert!(
                (multiplier.norm() - modulus * modulus).abs() < 1e-8,
                "{multiplier} {modulus}"
            );
        }
        assert_eq!((motion.impacts, motion.rests, motion.sticks), (2, 0, 0));
        // The state at the impact on w = +b, to which the exact orbit refers.
        let [phase, q1, dq1] = [orbit.start.phase, orbit.start.q1, orbit.start.dq1];
        let at = advanced(&p, &motion, phase.rem_euclid(TAU));
        let [x, v] = [at.q1 / p.half_width, at.dq1 / (p.half_width * scene.omega0)];
        assert!((x - q1).abs() < 1e-10, "{x} {q1}");
        assert!((v - dq1).abs() < 0.1, "before or after the impact: {v} {dq1}");
    }
}

/// The state of a motion at a phase of the base.
fn advanced(p: &Parameters, motion: &PlantMotion, phase: f64) -> State {
    let mut plant = Plant::new(*p, motion.state).expect("a plant");
    let drive = Drive::harmonic(motion.amplitude, motion.omega);
    plant.begin(drive).expect("a drive");
    plant.advance(drive, phase / motion.omega).expect("a step");
    plant.state()
}

/// Largest difference of two states over b and b omega0, the second times `sign` and its particle shifted.
fn difference(p: &Parameters, one: &State, other: &State, sign: f64) -> f64 {
    let (length, speed) = (p.half_width, p.half_width * p.natural_frequency());
    [
        (one.q1 - sign * other.q1) / length,
        (one.dq1 - sign * other.dq1) / speed,
        (one.q2 - sign * other.q2) / length,
        (one.dq2 - sign * other.dq2) / speed,
    ]
    .into_iter()
    .fold(0.0, |most: f64, value| most.max(value.abs()))
}

#[test]
fn a_stable_motion_returns_after_a_thousand_periods() {
    for cavity in effects() {
        let (p, motion) = (rig(cavity), resonant(cavity, Definition::default()));
        assert!(motion.is_stable(), "{cavity:?}: {:?}", motion.multipliers);
        let later = advanced(&p, &motion, 1000.0 * TAU);
        let error = difference(&p, &later, &motion.state, 1.0);
        assert!(error < 1e-10, "{cavity:?}: {error:e}");
        let event_phases: Vec<f64> = motion.events.iter().map(|(phase, _)| *phase).collect();
        assert!(event_phases.is_sorted() && event_phases.iter().all(|phase| (0.0..=TAU).contains(phase)));
    }
}

#[test]
fn where_the_particle_sticks_the_map_loses_a_dimension_and_the_motion_is_still_solved() {
    let cavity = Cavity {
        kinetic_friction: 0.12,
        static_friction: Some(0.18),
        ..Cavity::IDEAL
    };
    let motion = resonant_motion(&rig(cavity), Definition::default(), 0.01, None).expect("a motion");
    assert_eq!((motion.impacts, motion.sticks), (2, 1), "{:?}", motion.events);
    assert!(motion.multipliers[0].norm() < 1e-8, "{:?}", motion.multipliers);
    assert!(motion.is_stable());
    let later = advanced(&rig(cavity), &motion, 1000.0 * TAU);
    assert!(difference(&rig(cavity), &later, &motion.state, 1.0) < 1e-10);
}

#[test]
fn the_first_harmonic_is_that_of_the_sampled_motion() {
    for cavity in effects() {
        let (p, motion) = (rig(cavity), resonant(cavity, Definition::default()));
        let mut plant = Plant::new(p, motion.state).expect("a plant");
        let drive = Drive::harmonic(motion.amplitude, motion.omega);
        plant.begin(drive).expect("a drive");
        // Impacts are kinks of v: the error is of second order in the distance of the samples.
        let samples = 40_000;
        let mut sum = nalgebra::Complex::new(0.0, 0.0);
        for n in 0..samples {
            let turn = nalgebra::Complex::from_polar(plant.centre(), -TAU * f64::from(n) / f64::from(samples));
            sum += turn * nalgebra::Complex::new(0.0, 2.0 / f64::from(samples));
            plant
                .advance(drive, TAU / (motion.omega * f64::from(samples)))
                .expect("a step");
        }
        assert!(
            (sum - motion.response).norm() < 1e-9 * RESPONSE,
            "{cavity:?}: {sum} {}",
            motion.response
        );
    }
}

#[test]
fn a_mirrored_cavity_has_the_mirrored_motion() {
    for cavity in effects() {
        let mirrored = Cavity {
            b_plus: cavity.b_minus,
            b_minus: cavity.b_plus,
            tilt: -cavity.tilt,
            restitution: [cavity.restitution[1], cavity.restitution[0]],
            ..cavity
        };
        let definition = Definition::default();
        let (one, other) = (resonant(cavity, definition), resonant(mirrored, definition));
        assert!((one.omega / other.omega - 1.0).abs() < 1e-12);
        assert!((one.amplitude / other.amplitude - 1.0).abs() < 1e-11);
        assert!((one.response - other.response).norm() < 1e-11 * RESPONSE);
        // Half a period later, the base is minus itself.
        let later = advanced(&rig(cavity), &one, PI);
        let error = difference(&rig(cavity), &later, &other.state, -1.0);
        assert!(error < 1e-10, "{cavity:?}: {error:e}");
    }
}

#[test]
fn unequal_gaps_alone_are_a_cavity_of_their_mean_half_width() {
    let gaps = Cavity { b_plus: Some(0.011), b_minus: Some(0.009), ..Cavity::IDEAL };
    let (one, other) = (
        resonant(gaps, Definition::default()),
        resonant(Cavity::IDEAL, Definition::default()),
    );
    assert!((one.omega / other.omega - 1.0).abs() < 1e-13);
    assert!((one.amplitude / other.amplitude - 1.0).abs() < 1e-12);
    assert!((one.state.q2 - other.state.q2 + 0.001).abs() < 1e-12);
}

#[test]
fn a_motion_is_found_from_another_one_and_at_a_given_drive() {
    let near = resonant(effects()[0], Definition::default());
    let p = rig(Cavity { kinetic_friction: 0.031, ..Cavity::IDEAL });
    let fresh = resonant_motion(&p, Definition::default(), RESPONSE, None).expect("a motion");
    let warm = resonant_motion(&p, Definition::default(), RESPONSE, Some(&near)).expect("a motion");
    assert!(difference(&p, &fresh.state, &warm.state, 1.0) < 1e-11);
    let under = [
        DriveCondition::Amplitude(fresh.amplitude),
        DriveCondition::PhaseResonance,
    ];
    let same = periodic_motion(&p, Definition::default(), &near, under).expect("a motion");
    assert!((same.omega / fresh.omega - 1.0).abs() < 1e-11);
}

#[test]
fn a_simulated_motion_and_one_continued_under_the_same_drive_are_the_same() {
    for cavity in effects() {
        let (p, definition) = (rig(cavity), Definition::default());
        let near = resonant(cavity, definition);
        let under = resonant_motion_under(&p, definition, near.amplitude).expect("a motion");
        assert!(difference(&p, &under.state, &near.state, 1.0) < 1e-9, "{cavity:?}");
        let drive = [near.omega, near.amplitude];
        let settled = settled_motion(&p, definition, drive, near.state, 300).expect("a rig");
        let settled = settled.expect("a motion that repeats");
        assert_eq!((settled.periods, settled.impacts), (1, 2));
        assert!(difference(&p, &settled.state, &near.state, 1.0) < 1e-9, "{cavity:?}");
    }
}

#[test]
fn what_has_no_periodic_motion_is_refused() {
    let scatter = Cavity { scatter: 0.02, ..Cavity::IDEAL };
    let peak = Definition { resonance: Resonance::Peak, ..Definition::default() };
    let find = |cavity, definition, response| resonant_motion(&rig(cavity), definition, response, None);
    assert_eq!(
        find(scatter, Definition::default(), RESPONSE),
        Err(NoMotion::Scatter(0.02))
    );
    assert_eq!(find(Cavity::IDEAL, peak, RESPONSE), Err(NoMotion::Peak));
    assert_eq!(
        find(Cavity::IDEAL, Definition::default(), 1e-5),
        Err(NoMotion::NoIdealMotion(1e-5))
    );
    let broken = Cavity { kinetic_friction: -1.0, ..Cavity::IDEAL };
    assert!(matches!(
        find(broken, Definition::default(), RESPONSE),
        Err(NoMotion::Invalid(_))
    ));
    let vertical = Cavity { tilt: FRAC_PI_2, ..Cavity::IDEAL };
    let lost = find(vertical, Definition::default(), RESPONSE);
    assert!(matches!(lost, Err(NoMotion::Lost(_))), "{lost:?}");
}
