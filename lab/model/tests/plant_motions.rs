//! Guards periodic motions of the plant with the effects of its cavity: the ideal limit, closure, symmetry, and what is refused.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use lovines::{Cavity, Drive, Parameters, Plant, Restitution, State};
use nalgebra::Complex;
use vines_model::orbit::{
    Condition, NoMotion, PlantMotion, exact_backbone, periodic_motion, resonant_motion, resonant_motion_under,
    settled_motion,
};
use vines_model::{Definition, Dimensionless, Measurand, Reference, Sensor};

mod common;
use common::close;

const STUDY: Definition = Definition {
    phase: -FRAC_PI_2,
    reference: Reference::Base,
    sensor: Sensor::V,
    sensor_quantity: Measurand::Displacement,
    reference_quantity: Measurand::Displacement,
};
const FRICTION: Cavity = Cavity { kinetic_friction: 0.03, ..Cavity::IDEAL };
const GAPS: Cavity = Cavity { b_plus: Some(0.011), b_minus: Some(0.009), ..Cavity::IDEAL };

/// Beside the symmetric motion is one in which the particle sticks once a period.
const STICKING: Cavity = Cavity {
    kinetic_friction: 0.12,
    static_friction: Some(0.18),
    ..Cavity::IDEAL
};

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
fn effects() -> [Cavity; 7] {
    let held = Cavity { static_friction: Some(0.05), ..FRICTION };
    let viscoelastic = [0.4, 0.42].map(|strength| Some(Restitution::Viscoelastic(strength)));
    let plastic = [None, Some(Restitution::Plastic(0.1))];
    let soft = |restitution| Cavity { restitution, ..Cavity::IDEAL };
    let all = Cavity { tilt: 0.002, restitution: viscoelastic, ..held };
    [
        FRICTION,
        held,
        GAPS,
        Cavity { tilt: 0.005, ..Cavity::IDEAL },
        soft(viscoelastic),
        soft(plastic),
        Cavity { b_plus: Some(0.0102), ..all },
    ]
}

/// A response of the symmetric 1:1 motion: C = 0.6.
const RESPONSE: f64 = 0.006;

fn resonant(cavity: Cavity, definition: Definition) -> PlantMotion {
    resonant_motion(&rig(cavity), definition, RESPONSE, None).expect("a motion")
}

/// The plant on a motion, and its drive.
fn started(p: &Parameters, motion: &PlantMotion) -> (Plant, Drive) {
    let mut plant = Plant::new(*p, motion.state).expect("a plant");
    let drive = Drive::harmonic(motion.amplitude, motion.omega);
    plant.begin(drive).expect("a drive");
    (plant, drive)
}

/// The state of a motion at a phase of the base.
fn advanced(p: &Parameters, motion: &PlantMotion, phase: f64) -> State {
    let (mut plant, drive) = started(p, motion);
    plant.advance(drive, phase / motion.omega).expect("a step");
    plant.state()
}

/// Requires that two states differ by less than `tolerance` over b and b omega0, the second times `sign`.
fn same(p: &Parameters, one: &State, other: &State, sign: f64, tolerance: f64) {
    let [one, other] = [one, other].map(|state| Dimensionless::of(p, 0.0).state(state));
    let apart = (0..4).map(|n| (one[n] - sign * other[n]).abs()).fold(0.0, f64::max);
    assert!(apart < tolerance, "{:?}: {one:?} {other:?}", p.cavity);
}

#[test]
fn without_effects_the_motion_is_the_exact_orbit_at_any_phase() {
    let at_phases = |one: Definition| [-90.0_f64, -80.0, -110.0].map(|phase| one.at_phase(phase.to_radians()));
    for definition in Definition::all().into_iter().flat_map(at_phases) {
        let p = rig(Cavity::IDEAL);
        let motion = resonant(Cavity::IDEAL, definition);
        let scene = Dimensionless { definition, ..Dimensionless::of(&p, motion.amplitude) };
        let orbits = exact_backbone(&scene, motion.omega / scene.omega0).into_iter();
        let mut same_g = orbits.filter(|orbit| (orbit.g / scene.g - 1.0).abs() < 1e-9);
        let orbit = same_g.next().expect("the exact orbit");
        let (c, phase) = motion.response.to_polar();
        close(orbit.c, c / p.half_width, 1e-11);
        close(c / RESPONSE, 1.0, 1e-12);
        close(phase - definition.phase, 0.0, 1e-11);
        close(orbit.gamma - definition.phase, 0.0, 1e-11);
        // Multipliers of the period are the squares of those of half of it.
        for (multiplier, modulus) in motion.stability.multipliers.iter().zip(orbit.multipliers) {
            close(multiplier[0].hypot(multiplier[1]), modulus * modulus, 1e-8);
        }
        assert_eq!((motion.impacts, motion.rests, motion.sticks), (2, 0, 0));
        // The state at the impact on w = +b, to which the exact orbit refers.
        let at = scene.state(&advanced(&p, &motion, orbit.start.phase.rem_euclid(TAU)));
        close(at[0], orbit.start.q1, 1e-10);
        // Before or after the impact.
        close(at[1], orbit.start.dq1, 0.1);
    }
}

#[test]
fn a_stable_motion_returns_after_a_thousand_periods_and_has_the_harmonic_of_its_samples() {
    for cavity in effects() {
        let (p, motion) = (rig(cavity), resonant(cavity, STUDY));
        assert!(
            motion.stability.stable,
            "{cavity:?}: {:?}",
            motion.stability.multipliers
        );
        same(&p, &advanced(&p, &motion, 1000.0 * TAU), &motion.state, 1.0, 1e-10);
        let event_phases: Vec<f64> = motion.events.iter().map(|(phase, _)| *phase).collect();
        assert!(event_phases.is_sorted() && event_phases.iter().all(|phase| (0.0..=TAU).contains(phase)));

        let (mut plant, drive) = started(&p, &motion);
        // Impacts are kinks of v: the error is of second order in the distance of the samples.
        let samples = 40_000;
        let step = TAU / (drive.omega * f64::from(samples));
        let mut sum = Complex::new(0.0, 0.0);
        for n in 0..samples {
            let turned = Complex::from_polar(plant.centre(), -TAU * f64::from(n) / f64::from(samples));
            sum += turned * Complex::new(0.0, 2.0 / f64::from(samples));
            plant.advance(drive, step).expect("a step");
        }
        close((sum - motion.response).norm() / RESPONSE, 0.0, 1e-9);
    }
}

#[test]
fn near_the_fold_the_motion_is_the_one_that_continues_the_larger_responses() {
    // A random rig. The ideal motion with this response leads beyond the fold, where the impacts are slower and the motion is unstable.
    let p = Parameters {
        primary_mass: 1.0,
        stiffness: 1.0,
        damping: 0.00574,
        particle_mass: 0.002846,
        half_width: 1.0,
        restitution: 0.4587,
        cavity: Cavity { kinetic_friction: 0.000677, ..Cavity::IDEAL },
    };
    let motion = |response, guess: Option<&PlantMotion>| resonant_motion(&p, STUDY, response, guess).expect("a motion");
    let continued = [0.26, 0.25, 0.246, 0.2432].into_iter();
    let continued = continued.fold(motion(0.29, None), |near: PlantMotion, response| {
        motion(response, Some(&near))
    });
    close(motion(0.2432, None).omega / continued.omega, 1.0, 1e-12);
    assert!(continued.stability.stable);
}

#[test]
fn where_the_particle_sticks_the_map_loses_a_dimension_and_the_motion_is_still_solved() {
    let p = rig(Cavity { tilt: 0.002, ..STICKING });
    let motion = resonant_motion(&p, STUDY, 0.01, None).expect("a motion");
    assert_eq!((motion.impacts, motion.sticks), (2, 1), "{:?}", motion.events);
    assert!(motion.stability.multipliers[0].iter().all(|part| part.abs() < 1e-8) && motion.stability.stable);
    same(&p, &advanced(&p, &motion, 1000.0 * TAU), &motion.state, 1.0, 1e-10);
}

#[test]
fn of_a_symmetric_plant_the_symmetric_motion_is_found_though_the_one_beside_it_is_stable() {
    let p = rig(STICKING);
    let motion = resonant_motion(&p, STUDY, 0.01, None).expect("a motion");
    assert!(
        motion.is_mirrored && motion.stability.is_unstable() && motion.sticks == 0,
        "{motion:?}"
    );
    same(&p, &advanced(&p, &motion, PI), &motion.state, -1.0, 1e-10);
    // The multipliers of half a period are those of the whole one: a tilt of nothing is no symmetric plant.
    let tilted = rig(Cavity { tilt: 1e-12, ..STICKING });
    let conditions = [
        Condition::Phase(STUDY.phase),
        Condition::Sigma(Dimensionless::of(&p, 0.0).sigma(motion.omega)),
    ];
    let whole = periodic_motion(&tilted, STUDY, &motion, conditions).expect("a motion");
    assert!(!whole.is_mirrored);
    for (one, other) in motion.stability.multipliers.iter().zip(&whole.stability.multipliers) {
        close((one[0] - other[0]).hypot(one[1] - other[1]) + 1.0, 1.0, 1e-6);
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
        let (one, other) = (resonant(cavity, STUDY), resonant(mirrored, STUDY));
        close(one.omega / other.omega, 1.0, 1e-12);
        close(one.amplitude / other.amplitude, 1.0, 1e-11);
        assert!((one.response - other.response).norm() < 1e-11 * RESPONSE);
        // Half a period later, the base is minus itself.
        let p = rig(cavity);
        same(&p, &advanced(&p, &one, PI), &other.state, -1.0, 1e-10);
    }
}

#[test]
fn unequal_gaps_alone_are_a_cavity_of_their_mean_half_width() {
    let (one, other) = (resonant(GAPS, STUDY), resonant(Cavity::IDEAL, STUDY));
    close(one.omega / other.omega, 1.0, 1e-13);
    close(one.amplitude / other.amplitude, 1.0, 1e-12);
    close(other.state.q2 - one.state.q2, 0.001, 1e-12);
}

#[test]
fn a_motion_is_found_from_another_one_at_a_given_drive_and_by_simulation() {
    let near = resonant(FRICTION, STUDY);
    let p = rig(Cavity { kinetic_friction: 0.031, ..Cavity::IDEAL });
    let [fresh, warm] = [None, Some(&near)].map(|guess| resonant_motion(&p, STUDY, RESPONSE, guess).expect("a motion"));
    same(&p, &fresh.state, &warm.state, 1.0, 1e-11);
    let amplitude = Condition::Excitation(Dimensionless::of(&p, fresh.amplitude).g);
    let again = periodic_motion(&p, STUDY, &near, [amplitude, Condition::Phase(STUDY.phase)]);
    close(again.expect("a motion").omega / fresh.omega, 1.0, 1e-11);
    for cavity in effects() {
        let (p, near) = (rig(cavity), resonant(cavity, STUDY));
        let under = resonant_motion_under(&p, STUDY, near.amplitude).expect("a motion");
        same(&p, &under.state, &near.state, 1.0, 1e-9);
        let settled = settled_motion(&p, STUDY, [near.omega, near.amplitude], near.state, 300);
        let settled = settled.expect("a rig").expect("a motion that repeats");
        assert_eq!((settled.periods, settled.impacts), (1, 2));
        same(&p, &settled.state, &near.state, 1.0, 1e-9);
    }
}

#[test]
fn what_has_no_periodic_motion_is_refused() {
    let error = |cavity, definition, response| resonant_motion(&rig(cavity), definition, response, None).unwrap_err();
    let scatter = Cavity { scatter: 0.02, ..Cavity::IDEAL };
    assert_eq!(error(scatter, STUDY, RESPONSE), NoMotion::Scatter(0.02));
    assert_eq!(error(Cavity::IDEAL, STUDY, 1e-5), NoMotion::NoIdealMotion(1e-5));
    let broken = Cavity { kinetic_friction: -1.0, ..Cavity::IDEAL };
    assert!(matches!(error(broken, STUDY, RESPONSE), NoMotion::Invalid(_)));
    let vertical = Cavity { tilt: FRAC_PI_2, ..Cavity::IDEAL };
    assert!(matches!(error(vertical, STUDY, RESPONSE), NoMotion::Lost(_)));
}
