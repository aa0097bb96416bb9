//! Guards that every fault of a rig, of its connection and of a controller ends the run with a drive of zero, and how soon, and that a record with
//! a fault which no longer matters to the drive is refused; `studies/faults.rs` takes more instants.

use std::cell::Cell;
use std::f64::consts::TAU;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::rc::Rc;

use phase_lock::Config;
use vines_bench::experiment::{self, ExperimentError};
use vines_bench::identification::{IdentificationError, identify};
use vines_bench::record::Record;
use vines_bench::rig::{Command, ControllerError, Drive, RigError, RigFault, SensorFault, Simulated, faulty};
use vines_bench::scene::Scene;

use super::{Altered, Asked, Foreign, checked, foreign, paper as scene, record, record_of, tracked, tracked_of};

/// Time from a fault to a drive of zero, s, and whether the run ended early.
fn injected(scene: &Scene, fault: RigFault, seconds: f64, tracks: bool) -> (Option<f64>, bool) {
    let zero = Rc::new(Cell::new(None));
    let told = Rc::clone(&zero);
    let mut rig = faulty(scene, fault, seconds, move |time| told.set(time)).unwrap();
    let ended = if tracks {
        tracked(&mut rig, scene).map_or(true, |tracked| tracked.ended.is_some())
    } else {
        record(&mut rig, scene).is_err()
    };
    drop(rig);
    (zero.get(), ended)
}

/// Injects every fault at `instants` phases while the loop locks, holds, tracks and releases. The drive must be zero within `limit`
/// seconds and the ramp.
fn inject(settings: &[&str], instants: usize, limit: f64) {
    let scene = scene(&[settings, &["phase_lock.release_rate=4.1e-4", "record.decay_periods=6"]].concat());
    let record = record_of(&scene);
    let (step, period) = (record.sample_time, scene.dimensionless().natural_period());
    let [settled, released] = [record.settled, record.released].map(|sample| sample as f64 * step);
    let tracked = tracked_of(&scene);
    let tracking = (tracked.periods_to_lock + 40.0) * period;
    let config = scene.plan().lock;
    let ramp = config
        .ramp_rate
        .map_or(0.0, |rate| config.amplitude_max.unwrap_or(config.amplitude) / rate);
    for (name, fault) in RigFault::ALL {
        let is_wrong_sign = name.contains("reversed") || name.contains("swapped");
        let limit = if is_wrong_sign { 0.03 } else { limit } + ramp;
        for n in 0..instants {
            // The phases of the instants fill the period evenly.
            let phase = (0.618 * n as f64) % 1.0 * period;
            for (begins, tracks) in [(settled / 3.0, false), (settled, false), (tracking, true)] {
                let (zero, ended) = injected(&scene, fault, begins + phase, tracks);
                let is_off = zero.is_some_and(|time| time <= limit);
                assert!(ended && is_off, "{name} at {begins} + {phase} s: {zero:?}");
            }
            // The drive ramps down in two periods whatever happens.
            let (zero, _) = injected(&scene, fault, released + step, false);
            let is_off = zero.is_some_and(|time| time <= 2.0 * period);
            assert!(is_off, "{name} at the release: {zero:?}");
        }
    }
}

#[test]
fn every_fault_switches_the_drive_off_within_its_ramp() {
    inject(&[], 2, 0.06);
}

#[test]
fn every_fault_is_found_through_noise_and_12_bits() {
    let noisy = ["chain.snr=40", "chain.adc_bits=12", "phase_lock.ramp_rate=1.6e-3"];
    inject(&noisy, 1, 0.07);
}

#[test]
fn faults_in_the_first_periods_of_the_drive_are_found_within_a_second() {
    use {RigFault::*, SensorFault::*};
    let at_rest = scene(&["start.dq2=0"]);
    for fault in [
        Response(Reversed),
        Base(Reversed),
        Both(Dead),
        Response(Dead),
        Base(Dead),
        Response(Gain(0.3)),
        Response(Gain(3.0)),
        Shaker(0.0),
        Swapped,
    ] {
        // A gain that is wrong from the start is found by the loop check, which compares it with the drive.
        let from_the_start = usize::from(fault == Response(Gain(3.0)));
        for seconds in [0.0, 0.25, 0.6, 0.9, 1.3, 2.0].into_iter().skip(from_the_start) {
            let (zero, ended) = injected(&at_rest, fault, seconds, false);
            let is_found = ended && zero.is_some_and(|time| time < 1.0);
            assert!(is_found, "{fault:?} at {seconds} s: {zero:?}");
        }
    }
    // A held drive that does not reach the rig.
    let (zero, ended) = injected(&scene(&["chain.hold=true"]), Shaker(0.0), 10.0, false);
    assert!(ended && zero.is_some_and(|time| time < 0.06), "{zero:?}");
}

#[test]
fn an_impact_on_a_small_response_and_the_acceleration_of_a_base_whose_drive_changes_are_no_faults() {
    let accelerations = "resonance.sensor=q1 resonance.sensor_quantity=acceleration resonance.reference_quantity=acceleration \
                         plant.r=0.56 excitation.G=1.11";
    for settings in [
        "plant.m=0.0783 plant.r=0.845 plant.c=5.905 excitation.G=1.19",
        accelerations,
    ] {
        let scene = scene(&settings.split(' ').collect::<Vec<_>>());
        let ended = record(&mut *Simulated::of(&scene).unwrap(), &scene);
        let is_fault = matches!(ended, Err(ExperimentError::Tripped { .. }));
        assert!(!is_fault, "{settings:?}: {:?}", ended.err());
    }
}

#[test]
fn the_drive_is_zero_at_once_when_rig_or_controller_is_lost_or_the_lab_panics() {
    let scene = scene(&[]);
    let ends = |fails: fn() -> Result<(), RigError>, breaks: fn(&mut Command) -> Result<(), ControllerError>| {
        let (mut sample, last) = (0, Cell::new(f64::NAN));
        let read = |sensors| {
            sample += 1;
            if sample == 2000 {
                fails().map(|()| sensors)
            } else {
                Ok(sensors)
            }
        };
        let drive = |drive: Drive, step| {
            last.set(drive.amplitude);
            (drive, step)
        };
        let mut rig = Altered { read: Box::new(read), ..Altered::driven(&scene, drive) };
        let answer = |command: &mut Command, (_, sample): Asked| if sample < 2000 { Ok(()) } else { breaks(command) };
        let mut controller = Foreign::new(&scene.plan().lock, answer);
        let run = || experiment::run(&mut Vec::new(), &mut rig, &mut controller, &scene.plan(), |_, _| {});
        let ended = catch_unwind(AssertUnwindSafe(run));
        assert_eq!(last.get(), 0.0);
        ended
    };
    let ended = ends(|| Err(RigError::Failed("the connection is lost".into())), |_| Ok(()));
    assert!(matches!(ended, Ok(Err(ExperimentError::Rig(_)))));
    assert!(ends(|| panic!("injected"), |_| Ok(())).is_err());
    let lost = |_: &mut Command| Err(ControllerError::Failed("the connection is lost".into()));
    assert!(matches!(ends(|| Ok(()), lost), Ok(Err(ExperimentError::Controller(_)))));
    let nan = |command: &mut Command| {
        command.drive.amplitude = f64::NAN;
        Ok(())
    };
    let ended = ends(|| Ok(()), nan);
    let Ok(Err(ExperimentError::Refused(message))) = ended else {
        panic!("{ended:?}");
    };
    assert!(message.starts_with("answered E = NaN"), "{message}");
}

/// An experiment with a controller without limits and with another answer, and the largest drive that reached the rig, m.
fn unlimited(scene: &Scene, change: fn(&mut Command, usize)) -> (Result<Record, ExperimentError>, f64) {
    let limits = Config {
        amplitude_max: None,
        response_max: None,
        residual_max: None,
        ..scene.plan().lock
    };
    let (record, _, largest) = foreign(scene, &limits, |command, (_, sample)| change(command, sample));
    (record, largest)
}

#[test]
fn the_limits_of_the_scene_guard_the_rig_whatever_controls_it() {
    let scene = scene(&[]);
    let limit = scene.plan().lock.amplitude_max.unwrap();
    let refused = |scene: &Scene, change, words: &str| {
        let (record, largest) = unlimited(scene, change);
        let message = record.unwrap_err().to_string();
        assert!(message.contains(words) && largest <= limit, "{message} {largest}");
    };
    let allowed = "phase_lock.amplitude_max allows 0.00052791 m";
    refused(&scene, |command, _| command.drive.amplitude *= 1e3, allowed);
    refused(&scene, |command, _| command.drive.omega /= TAU, "not in Hz");
    refused(&scene, |command, _| command.drive.omega *= -1.0, "omega = -55.");
    let nan = |command: &mut Command, _: usize| command.phase_error = Some(f64::NAN);
    refused(&scene, nan, "phase_error = NaN rad");
    let low = self::scene(&["phase_lock.response_max=0.003"]);
    refused(&low, |_, _| (), "phase_lock.response_max allows 0.003 m");
}

#[test]
fn the_bench_measures_that_a_lock_has_settled_through_noise_in_less_than_twice_the_time() {
    let settled = |settings: &[&str], change| unlimited(&scene(settings), change).0.map(|record| record.settled);
    let silent = settled(&[], |_, _| ()).unwrap();
    for snr in ["chain.snr=80", "chain.snr=60", "chain.snr=40"] {
        let noisy = settled(&[snr], |_, _| ()).unwrap();
        assert!(noisy < 2 * silent, "{snr}: {noisy} {silent}");
    }
}

/// Refuses the record of a rig with a fault after some seconds.
fn refused(scene: &Scene, fault: RigFault, seconds: f64) -> IdentificationError {
    let failed = record(&mut faulty(scene, fault, seconds, |_| {}).unwrap(), scene).unwrap();
    identify(&failed, &checked(scene)).unwrap_err()
}

#[test]
fn a_sensor_that_dies_after_the_release_or_becomes_late_in_the_hold_is_an_error() {
    use {RigFault::*, SensorFault::*};
    for settings in [&[][..], &["chain.adc_bits=14"], &["chain.snr=40"]] {
        let scene = scene(settings);
        // A fault that never comes.
        let healthy = record(&mut faulty(&scene, Response(Dead), 1e9, |_| {}).unwrap(), &scene).unwrap();
        identify(&healthy, &checked(&scene)).unwrap();
        let release = healthy.released as f64 * healthy.sample_time;
        for fault in [
            Response(Dead),
            Response(Frozen),
            Response(Value(f64::NAN)),
            Base(Value(f64::NAN)),
        ] {
            let error = refused(&scene, fault, release + 0.5);
            let is_named = matches!(error, IdentificationError::SensorAfterRelease { seconds, .. } if (seconds - 0.5).abs() < 0.25);
            assert!(is_named, "{settings:?}, {fault:?}: {error}");
        }
    }
    let scene = scene(&[]);
    let healthy = record_of(&scene);
    let settled = (healthy.settled + 2) as f64 * healthy.sample_time;
    let error = refused(&scene, Base(Late(3)), settled);
    assert!(matches!(error, IdentificationError::OffTarget { .. }), "{error}");
}
