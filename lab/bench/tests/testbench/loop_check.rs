//! Guards the verdicts of the loop check, on random rigs, healthy and with faults, and what it measures; `studies/check.rs` takes more rigs.

use std::f64::consts::TAU;

use lovines::State;
use vines_bench::loop_check::{LoopCheck, Verdict, check};
use vines_bench::rig::{Chain, Drive, RigFault, SensorFault, Simulated, faulty};
use vines_bench::scene::{Dimensionless, Scene};

use super::common::{checked_faults, checked_rig, uniform};
use super::{Altered, paper};

/// The default scene with these settings, at rest.
fn at_rest(settings: &[&str]) -> Scene {
    paper(&[settings, &["start.dq2=0"]].concat())
}

#[test]
fn healthy_rigs_pass_and_faults_are_named() {
    let mut between = uniform(5);
    for n in 0..60 {
        let [scene, rig] = checked_rig(&mut between).unwrap();
        let found = check(&mut *Simulated::of(&rig).unwrap(), &scene.plan()).unwrap();
        assert_eq!(found.verdict, Verdict::Healthy, "{found:?}");
        let linear = found.linear.unwrap();
        let rig_damping = 0.5 * rig.plant.damping / rig.plant.primary_mass;
        let gain = 0.5 * rig.plant.natural_frequency();
        // Four standard uncertainties; 3 % where noise is small.
        let limit = (4.0 * linear.u_gain).max(0.03);
        assert!((linear.response_gain / gain - 1.0).abs() < limit, "{linear:?}");
        let off = (linear.damping_rate - rig_damping).abs();
        assert!(off < 4.0 * linear.u_damping_rate, "{linear:?}");
        let integral = |damping: f64| phase_lock::Gains::from_bandwidth(linear.bandwidth, damping).integral;
        let ratio = |damping: f64| (integral(damping) / integral(rig_damping) - 1.0).abs();
        let limit = ratio(rig_damping + 4.0 * linear.u_damping_rate).max(0.01);
        assert!(ratio(linear.damping_rate) < limit, "{linear:?}");
        // A damping that is measured below zero counts as zero.
        assert_eq!(linear.gains[1], integral(linear.damping_rate.max(0.0)));
        let faults = checked_faults(&mut between);
        let (expected, fault) = faults[n % faults.len()];
        let found = check(&mut faulty(&rig, fault, 0.0, |_| {}).unwrap(), &scene.plan()).unwrap();
        assert_eq!(found.verdict, expected, "{fault:?}: {found:?}");
    }
}

/// The check of the rig of a scene with another clock and a drive from elsewhere, m; the largest drive, m, and its phase at the end, turns.
fn altered(scene: &Scene, clock: f64, hum: f64) -> (LoopCheck, [f64; 2]) {
    let (mut largest, mut turns) = (0.0_f64, 0.0);
    let drive = |drive: Drive, step: f64| {
        largest = largest.max(drive.amplitude).max(drive.displacement.abs());
        turns += drive.omega * step / TAU;
        let amplitude = drive.amplitude + hum;
        (Drive { amplitude, ..drive }, clock * step)
    };
    let found = check(&mut Altered::driven(scene, drive), &scene.plan());
    (found.unwrap(), [largest, turns])
}

#[test]
fn where_noise_hides_the_phase_the_check_raises_its_drive_up_to_that_of_the_scene_and_says_how_long_it_took() {
    for (snr, shares, most) in [
        ("chain.snr=120", 0.01..=0.01, 30.0),
        ("chain.snr=60", 0.16..=0.16, 200.0),
        ("chain.snr=40", 0.64..=1.0, 300.0),
        ("chain.snr=30", 1.0..=1.0, 400.0),
    ] {
        for seed in ["chain.seed=1", "chain.seed=2", "chain.seed=3"] {
            let scene = at_rest(&[snr, seed]);
            let (found, [largest, turns]) = altered(&scene, 1.0, 0.0);
            assert_eq!(found.verdict, Verdict::Healthy, "{snr}, {seed}: {found:?}");
            let is_expected = shares.contains(&found.share) && found.periods < most;
            assert!(is_expected, "{snr}, {seed}: {found:?}");
            assert!(largest <= found.share * scene.amplitude * (1.0 + 1e-12), "{largest}");
            assert!((turns - found.periods).abs() < 2.0, "{turns} {}", found.periods);
            // It ends at the phase where it began.
            assert!((turns - turns.round()).abs() < 1e-9, "{turns}");
            let linear = found.linear.unwrap();
            let off = (linear.omega_0 - scene.plant.natural_frequency()).abs();
            assert!(off < 4.0 * linear.u_damping_rate, "{linear:?}");
        }
    }
}

#[test]
fn a_rig_that_moves_before_the_drive_comes_to_rest_first_or_is_named() {
    let mut scene = at_rest(&[]);
    let b = scene.plant.half_width;
    // A particle beside the middle is an offset.
    for (dq1, q2, dq2, hum, expected) in [
        (0.05, 0.0, 0.0, 0.0, Verdict::Healthy),
        (0.05, 0.0, 0.0, 1e-5, Verdict::NotAtRest),
        (0.0, 0.95 * b, 0.0, 0.0, Verdict::Healthy),
        (0.0, -0.5 * b, 0.005, 0.0, Verdict::Healthy),
    ] {
        scene.start = State { dq1, q2, dq2, ..State::default() };
        let (found, _) = altered(&scene, 1.0, hum);
        assert_eq!(found.verdict, expected, "{:?}, {hum}: {found:?}", scene.start);
    }
}

#[test]
fn what_would_falsify_a_measurement_is_refused_also_where_noise_hides_it_at_a_hundredth_of_the_drive() {
    use {RigFault::*, SensorFault::*};
    for settings in [
        &[][..],
        &["chain.snr=50"],
        &["chain.snr=40"],
        &["chain.snr=30", "chain.seed=9"],
        &["resonance.reference='force'"],
    ] {
        let scene = at_rest(settings);
        for (clock, expected) in [(1.0, Verdict::Healthy), (1.01, Verdict::Clock), (0.99, Verdict::Clock)] {
            let (found, _) = altered(&scene, clock, 0.0);
            assert_eq!(found.verdict, expected, "{settings:?}: {found:?}");
        }
        for (fault, expected) in [
            (Response(Gain(2.0)), Verdict::ResponseGain),
            (Response(Gain(0.9)), Verdict::ResponseGain),
            (Base(Gain(2.0)), Verdict::BaseGain),
            (Base(Gain(1.1)), Verdict::BaseGain),
            (Response(Late(3)), Verdict::ResponseLate),
            (Base(Late(3)), Verdict::BaseLate),
            (Response(Late(1)), Verdict::ResponseLate),
            (Both(Late(5)), Verdict::Healthy),
            (Response(Dead), Verdict::ResponseDead),
            (Base(Dead), Verdict::BaseDead),
            (Response(Reversed), Verdict::ResponseReversed),
            (Base(Reversed), Verdict::BaseReversed),
            (Swapped, Verdict::Swapped),
            (Shaker(0.0), Verdict::ShakerOff),
        ] {
            let found = check(&mut faulty(&scene, fault, 0.0, |_| {}).unwrap(), &scene.plan()).unwrap();
            assert_eq!(found.verdict, expected, "{settings:?}, {fault:?}: {found:?}");
        }
    }
    // A delay of both channels cancels; from 40 on, the phase alone looks like the opposite sign.
    let scene = at_rest(&[]);
    for delay in [16, 30, 40, 44, 48] {
        let mut rig = faulty(&scene, Both(Late(delay)), 0.0, |_| {}).unwrap();
        let found = check(&mut rig, &scene.plan()).unwrap();
        assert_eq!(found.verdict, Verdict::Healthy, "{found:?}");
        assert!((found.base.unwrap().delay - delay as f64).abs() < 0.5, "{found:?}");
    }
}

#[test]
fn natural_frequency_and_damping_of_the_rig_replace_those_of_the_scene() {
    for settings in [&[][..], &["chain.snr=40"]] {
        let scene = at_rest(settings);
        let stated = scene.dimensionless();
        let mut plant = scene.plant;
        plant.stiffness *= 1.01;
        plant.damping *= 0.7;
        let rig = Simulated::new(plant, scene.start).unwrap();
        let found = check(&mut *Chain::around(Box::new(rig), &scene), &scene.plan()).unwrap();
        assert_eq!(found.verdict, Verdict::Healthy, "{found:?}");
        let differ = found.quantities.iter().filter(|one| one.differs()).map(|one| one.name);
        assert!(differ.eq(["natural frequency", "damping rate"]));
        let linear = found.linear.unwrap();
        let (omega0, damping) = (plant.natural_frequency(), 0.5 * plant.damping / plant.primary_mass);
        // Clean, the fit is exact but for rounding.
        let limit = 3.0 * linear.u_damping_rate + 1e-6 * omega0;
        assert!((linear.omega_0 - omega0).abs() < limit && (linear.damping_rate - damping).abs() < limit);
        assert!(linear.u_damping_rate < 3e-4 * omega0);
        assert!((50.0..60.0).contains(&linear.phase_margin));
        let step = scene.sample_time();
        let plan = scene.plan_on(scene.knowledge().measured(linear.response));
        let (measured, config) = (plan.knowledge.numbers, plan.lock);
        assert_eq!((measured.omega0, config.sample_time), (linear.omega_0, step));
        assert!((config.damping_rate.unwrap() / linear.damping_rate - 1.0).abs() < 1e-12);
        assert!((config.omega_start / linear.omega_0 - 1.0).abs() < 1e-12);
        assert!((config.response_gain - 0.5 * linear.omega_0).abs() < 1e-9);
        let kept = |of: &Dimensionless| [of.epsilon, of.r, of.b, of.g];
        assert_eq!(kept(&measured), kept(&stated));
    }
}

#[test]
fn a_particle_that_slides_at_the_drive_that_noise_asks_for_is_not_taken_for_a_late_sensor() {
    // Without noise it sticks at the drive of the check.
    for (mu, noise, verdict) in [
        ("0.2", "chain.snr=90", Verdict::Healthy),
        ("0.2", "chain.snr=40", Verdict::NotProportional),
        ("0.3", "chain.snr=40", Verdict::NotProportional),
    ] {
        let found = check(
            &mut *Simulated::of(&at_rest(&[noise, &format!("plant.mu_k={mu}")])).unwrap(),
            &at_rest(&[noise]).plan(),
        );
        let found = found.unwrap();
        assert_eq!(found.verdict, verdict, "{mu}, {noise}: {found:?}");
        assert_eq!(found.linear.is_some(), verdict == Verdict::Healthy);
    }
}
