//! Guards what the bench sees of a controller that is not ours: whether it releases the drive, and whether it holds the phase and the drive that were
//! asked for.

use std::cell::Cell;
use std::f64::consts::PI;

use phase_lock::Config;
use vines_bench::identification::{DecayEnd, Identification, IdentificationError, identify};
use vines_bench::loop_check::check;
use vines_bench::rig::{Command, Drive, Rig, Sensors, Simulated};
use vines_bench::scene::Scene;

use super::{Altered, foreign, paper};

/// Settings of a run whose decay is short.
const SHORT: &str = "record.decay_periods=30";

fn scene(settings: &[&str]) -> Scene {
    paper(&[&[SHORT][..], settings].concat())
}

#[test]
fn a_controller_that_does_not_release_the_drive_is_an_error_and_the_bench_switches_it_off() {
    let scene = scene(&[]);
    let amplitude = scene.amplitude;
    let refused = |change: &dyn Fn(&mut Command, usize), words: &str| {
        let (record, last, _) = foreign(&scene, &scene.plan().lock, |command, (active, asked)| {
            if !active {
                change(command, asked);
            }
        });
        let message = record.unwrap_err().to_string();
        assert!(message.contains(words), "{message}");
        assert_eq!(last, [0.0; 2], "{message}");
    };
    let commands = |of: &dyn Fn(f64) -> [f64; 2], words: &str| {
        let command = |command: &mut Command, asked: usize| {
            [command.drive.amplitude, command.drive.displacement] = of(asked as f64).map(|share| share * amplitude);
        };
        refused(&command, words);
    };
    let still = "after `active` became false, it commands E = ";
    commands(
        &|_| [1.0, 0.0],
        &format!("{still}9.2461e-5 m, 1 times the requested drive"),
    );
    // A ramp without an end.
    commands(&|asked| [(-asked / 500.0).exp(), 0.0], still);
    commands(&|_| [1e-12 / amplitude, 0.0], "it commands E = 1e-12 m");
    commands(
        &|asked| [0.0, (0.06 * asked).cos()],
        "it commands E = 0, but a displacement of",
    );
    let again = "10.0 periods after it released the drive, it commands E = 9.2461e-5 m";
    commands(&|asked| [f64::from(asked >= 1000.0), 0.0], again);
}

#[test]
fn a_decay_begins_at_the_end_of_the_ramp() {
    let scene = scene(&["record.decay_periods=60"]);
    let ramp = scene.plan().knowledge.samples(4.0);
    let (record, ..) = foreign(&scene, &scene.plan().lock, |command, (active, asked)| {
        if !active {
            command.drive.amplitude = scene.amplitude * (1.0 - (asked + 1) as f64 / ramp as f64).max(0.0);
        }
    });
    let record = record.unwrap();
    assert_eq!(record.released - record.hold_end, ramp - 1);
    let mut decay = record.decay().iter();
    assert!(decay.all(|sample| sample.command.drive.amplitude == 0.0));
    let found = identify(&record, &scene.plan()).unwrap();
    let first = found.decay.points[0];
    assert!(first.c < 0.97 * found.lock.at.c, "{} {}", first.c, found.lock.at.c);
}

/// What is identified on a rig whose drive after the release, and whose readings, pass a function each; both take the samples since the release.
fn identified_on(
    scene: &Scene,
    mut left: impl FnMut(f64) -> f64,
    mut read: impl FnMut(Sensors) -> Sensors,
) -> Result<Identification, IdentificationError> {
    let (mut driven, mut since) = (false, 0.0);
    let (amplitude, omega) = (scene.amplitude, Cell::new(0.0));
    let drive = |drive: Drive, step| {
        let is_off = drive.amplitude == 0.0;
        since = if driven && is_off { since + 1.0 } else { 0.0 };
        driven |= !is_off;
        if !is_off {
            omega.set(drive.omega);
        }
        let (omega, amplitude) = (omega.get(), amplitude * left(since));
        let goes_on = Drive { omega, amplitude, ..drive };
        (if driven && is_off { goes_on } else { drive }, step)
    };
    let mut rig = Altered { drive: Box::new(drive), ..Altered::reading(scene, &mut read) };
    identify(&super::record(&mut rig, scene).unwrap(), &scene.plan())
}

#[test]
fn a_lock_is_at_the_requested_drive_and_its_decay_begins_where_the_base_rests_also_through_noise() {
    let floor = 1e-3 * scene(&[]).amplitude;
    for snr in ["chain.snr=none", "chain.snr=60", "chain.snr=40"] {
        let scene = scene(&[snr]);
        let period = scene.plan().knowledge.samples(1.0) as f64;
        // A base that goes on has no free decay.
        for share in [1.0, 0.05] {
            let found = identified_on(&scene, |_| share, |sensors| sensors).unwrap();
            let decay = (found.decay.points.len(), found.decay.end);
            assert_eq!(decay, (0, DecayEnd::Driven), "{snr}");
            let ratio = found.base_after_release.unwrap().value / scene.amplitude;
            assert!((ratio / share - 1.0).abs() < 0.15, "{snr}: {ratio} {share}");
        }
        // One that comes to rest in ten periods has one from then on, and one that stops at once from the release on.
        for (periods, [earliest, latest]) in [(0.0, [0.0, 0.2]), (10.0, [9.0, 10.5])] {
            let fades = |since: f64| (1.0 - since / (periods * period + 1.0)).max(0.0);
            let found = identified_on(&scene, fades, |sensors| sensors).unwrap();
            let is_driven = found.decay.end == DecayEnd::Driven;
            assert!(found.lock.at_requested_drive && !is_driven, "{snr}: {:?}", found.lock);
            // A point is the middle of its window of 2.5 periods.
            let first = found.decay.points[0].t_s / scene.dimensionless().natural_period() - 1.25;
            assert!((earliest..=latest).contains(&first), "{snr}, {periods}: {first}");
        }
    }
    // A floor that does not fall with the signal, and a sensor with an offset and a drift, are no motion.
    let scene = scene(&[]);
    let (mut noise, mut reading) = (super::common::uniform(7), 0.0);
    let read = |sensors: Sensors| {
        reading += 1.0;
        let offset = 3e-5 + 1e-10 * reading;
        let reference = sensors.reference.map(|value| value + offset + floor * noise(-1.0, 1.0));
        Sensors { reference, ..sensors }
    };
    let found = identified_on(&scene, |_| 0.0, read).unwrap();
    let first = found.decay.points[0].t_s / scene.dimensionless().natural_period() - 1.25;
    let clean = identified_on(&scene, |_| 0.0, |sensors| sensors).unwrap();
    let [points, clean] = [&found, &clean].map(|one| one.decay.points.len());
    assert!(first < 0.5 && points.abs_diff(clean) <= 4, "{first}: {points} {clean}");
}

#[test]
fn another_phase_or_drive_than_asked_is_said_before_anything_else_is_blamed() {
    let scene = scene(&["phase_lock.acquire_timeout=60"]);
    let said = |turned: f64, times: f64, settled: Option<bool>| {
        let config = scene.plan().lock;
        let config = Config {
            phase_target: config.phase_target + turned * PI / 180.0,
            amplitude: times * config.amplitude,
            response_max: None,
            residual_max: None,
            ..config
        };
        let (record, last, _) = foreign(&scene, &config, |command, _| command.settled = settled);
        let message = match record {
            Err(error) => error.to_string(),
            Ok(record) => match identify(&record, &scene.plan()) {
                Err(error) => error.to_string(),
                Ok(found) => {
                    assert!(!found.lock.at_requested_drive, "{turned} {times}");
                    let ratio = found.lock.at.drive().value / found.lock.requested();
                    format!("{ratio:.3} times the requested")
                }
            },
        };
        assert_eq!(last, [0.0; 2]);
        println!("{turned} degrees, {times} times, {settled:?}: {message}");
        message
    };
    for turned in [20.0, -20.0, 8.0] {
        let message = said(turned, 1.0, None);
        let phase = format!("{turned:.2} ± ");
        let words = [&phase, "degrees off controller.phase_target", "the controller reports"];
        assert!(words.iter().all(|word| message.contains(word)), "{message}");
    }
    for times in [2.0, 0.5, 1.09, 0.91, 1.02] {
        let message = said(0.0, times, None);
        let ratio = format!("{times:.3} times the requested");
        assert!(message.contains(&ratio), "{message}");
    }
    let both = said(20.0, 2.0, None);
    let words = ["degrees off controller.phase_target", "2.000 times"];
    assert!(words.iter().all(|word| both.contains(word)), "{both}");
}

#[test]
fn neither_a_loop_check_nor_a_held_sample_of_zero_cuts_the_stinger() {
    let scene = super::preset("shaker-cantilever", &["shaker.release=cut", "start.dq2=0"]).unwrap();
    let (omega, step) = (scene.dimensionless().omega0, scene.sample_time());
    // The largest force in 200 samples, in which every tenth drive is zero where samples are held.
    let force = |rig: &mut dyn Rig, amplitude: f64, holds: bool| {
        let amplitude = scene.knowledge().target.units.command.of_metres(amplitude);
        let sample = |n: u32| {
            let sine = (0.06 * f64::from(n)).sin() * f64::from(!n.is_multiple_of(10));
            let displacement = if holds { amplitude * sine } else { 0.0 };
            let drive = Drive { omega, amplitude, displacement, is_held: holds };
            let driven = rig.advance(drive, step);
            driven.and_then(|()| rig.sense()).unwrap().reference.unwrap().abs()
        };
        (0..200).map(sample).fold(0.0, f64::max)
    };
    let mut rig = Simulated::of(&scene).unwrap();
    check(rig.as_mut(), &scene.plan()).unwrap();
    let checked = force(&mut *rig, 1e-6, false);
    let mut rig = Simulated::of(&scene).unwrap();
    let fresh = force(&mut *rig, 1e-6, false);
    assert!((checked / fresh - 1.0).abs() < 0.5, "{fresh:e} {checked:e} N");
    let [driven, again, released] = [1e-6, 1e-6, 0.0].map(|amplitude| force(&mut *rig, amplitude, true));
    assert!(
        again > 0.1 * driven && released < 1e-6 * driven,
        "{driven:e} {again:e} {released:e}"
    );
}
