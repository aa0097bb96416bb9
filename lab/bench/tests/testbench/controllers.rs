//! Guards what the bench sees of a controller that is not ours: whether it releases the drive, and whether it holds the phase and the drive that were
//! asked for.

use std::cell::Cell;
use std::f64::consts::{PI, TAU};

use phase_lock::Config;
use vines_bench::experiment::{self, ExperimentError};
use vines_bench::identification::{DecayEnd, Identification, IdentificationError, identify};
use vines_bench::loop_check::check;
use vines_bench::record::Record;
use vines_bench::rig::{BuiltIn, Command, Controller, ControllerError, Drive, Sensors, Simulated};
use vines_bench::scene::Scene;

use super::{Altered, paper};

/// The built-in controller with another answer, and without the control of the response. It does not say whether it has locked.
struct Foreign<F> {
    built_in: BuiltIn,
    change: F,
    asked: Asked,
}

/// What a controller is asked for: whether to drive, and for how many samples it has been asked this.
type Asked = (bool, usize);

impl<F: FnMut(&mut Command, Asked)> Controller for Foreign<F> {
    fn sample(&mut self, sensors: Sensors, active: bool) -> Result<Command, ControllerError> {
        let (before, samples) = self.asked;
        self.asked = (active, if before == active { samples + 1 } else { 0 });
        let command = self.built_in.sample(sensors, active)?;
        let mut command = Command { settled: None, state: None, ..command };
        (self.change)(&mut command, self.asked);
        Ok(command)
    }
}

/// Settings of a run whose decay is short.
const SHORT: &str = "record.decay_periods=30";

fn scene(settings: &[&str]) -> Scene {
    paper(&[&[SHORT][..], settings].concat())
}

/// An experiment with a controller of this configuration and answer, and the last drive that reached the rig, amplitude and displacement, m.
fn run(
    scene: &Scene,
    configure: impl FnOnce(Config) -> Config,
    change: impl FnMut(&mut Command, Asked),
) -> (Result<Record, ExperimentError>, [f64; 2]) {
    let last = Cell::new([f64::NAN; 2]);
    let drive = |drive: Drive, step| {
        last.set([drive.amplitude, drive.displacement]);
        (drive, step)
    };
    let mut rig = Altered {
        rig: Simulated::of(scene).unwrap(),
        read: Box::new(Ok),
        drive: Box::new(drive),
    };
    let built_in = BuiltIn::new(&configure(scene.controller_config())).unwrap();
    let mut controller = Foreign { built_in, change, asked: (true, 0) };
    let record = experiment::run(&mut rig, &mut controller, &scene.plan(), |_, _, _| {});
    drop(rig);
    (record, last.get())
}

#[test]
fn a_controller_that_does_not_release_the_drive_is_an_error_and_the_bench_switches_it_off() {
    let scene = scene(&[]);
    let amplitude = scene.amplitude;
    let refused = |change: &dyn Fn(&mut Command, usize), words: &str| {
        let (record, last) = run(
            &scene,
            |config| config,
            |command, (active, asked)| {
                if !active {
                    change(command, asked);
                }
            },
        );
        let message = record.unwrap_err().to_string();
        assert!(message.contains(words), "{message}");
        assert_eq!(last, [0.0; 2], "{message}");
    };
    let still = "after `active` became false, it commands E = ";
    refused(&|command, _| command.drive.amplitude = amplitude, still);
    refused(
        &|command, _| command.drive.amplitude = amplitude,
        "9.2461e-5 m, 1 times the requested drive",
    );
    // A ramp without an end.
    refused(
        &|command, asked| command.drive.amplitude = amplitude * (-(asked as f64) / 500.0).exp(),
        still,
    );
    refused(&|command, _| command.drive.amplitude = 1e-12, "it commands E = 1e-12 m");
    refused(
        &|command, asked| command.drive.displacement = amplitude * (0.06 * asked as f64).cos(),
        "it commands E = 0, but a displacement of",
    );
    refused(
        &|command, asked| command.drive.amplitude = if asked < 1000 { 0.0 } else { amplitude },
        "10.0 periods after it released the drive, it commands E = 9.2461e-5 m",
    );
}

#[test]
fn a_decay_begins_at_the_end_of_the_ramp() {
    let scene = scene(&["record.decay_periods=60"]);
    let ramp = scene.plan().knowledge.samples(4.0);
    let (record, _) = run(
        &scene,
        |config| config,
        |command, (active, asked)| {
            if !active {
                command.drive.amplitude = scene.amplitude * (1.0 - (asked + 1) as f64 / ramp as f64).max(0.0);
            }
        },
    );
    let record = record.unwrap();
    assert_eq!(record.released - record.hold_end, ramp - 1);
    assert!(
        record
            .decay()
            .iter()
            .all(|sample| sample.command.drive.amplitude == 0.0)
    );
    let found = identify(&record, &scene.plan()).unwrap();
    let (first, points) = (found.decay.points[0], &found.decay.points);
    assert!(first.c < 0.97 * found.lock.at.c, "{} {}", first.c, found.lock.at.c);
    // Beside a run that is released at once.
    let (at_once, _) = run(&scene, |config| config, |_, _| ());
    let at_once = identify(&at_once.unwrap(), &scene.plan()).unwrap().decay.points;
    let compared: Vec<_> = points.iter().filter(|point| point.c > 0.25).collect();
    assert!(compared.len() > 15, "{}", compared.len());
    for point in compared {
        let near = at_once.windows(2).find(|pair| pair[1].c <= point.c).unwrap();
        let share = (point.c - near[0].c) / (near[1].c - near[0].c);
        let [sigma, rate] = [near[0].sigma + share * (near[1].sigma - near[0].sigma), near[1].rate];
        assert!(
            (point.sigma - sigma).abs() < 0.02,
            "{} {sigma} at {}",
            point.sigma,
            point.c
        );
        assert!(
            (point.rate / rate - 1.0).abs() < 0.1,
            "{} {rate} at {}",
            point.rate,
            point.c
        );
    }
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
        let goes_on = Drive {
            omega: omega.get(),
            amplitude: amplitude * left(since),
            ..drive
        };
        (if driven && is_off { goes_on } else { drive }, step)
    };
    let mut rig = Altered {
        rig: Simulated::of(scene).unwrap(),
        read: Box::new(|sensors| Ok(read(sensors))),
        drive: Box::new(drive),
    };
    identify(&super::record(&mut rig, scene).unwrap(), &scene.plan())
}

#[test]
fn a_decay_begins_where_the_measured_base_rests_within_the_noise_of_its_channel() {
    let floor = 1e-3 * scene(&[]).amplitude;
    for snr in ["chain.snr=none", "chain.snr=40"] {
        let scene = scene(&[snr]);
        let period = scene.plan().knowledge.samples(1.0) as f64;
        // A base that goes on has no free decay.
        for share in [1.0, 0.05] {
            let found = identified_on(&scene, |_| share, |sensors| sensors).unwrap();
            assert_eq!(
                (found.decay.points.len(), found.decay.end),
                (0, DecayEnd::Driven),
                "{snr}"
            );
            let ratio = found.base_after_release.unwrap().value / scene.amplitude;
            assert!((ratio / share - 1.0).abs() < 0.15, "{snr}: {ratio} {share}");
        }
        // One that comes to rest in ten periods has one from then on, and one that stops at once from the release on.
        for (periods, [earliest, latest]) in [(0.0, [0.0, 0.2]), (10.0, [9.0, 10.5])] {
            let fades = |since: f64| (1.0 - since / (periods * period + 1.0)).max(0.0);
            let found = identified_on(&scene, fades, |sensors| sensors).unwrap();
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
    let clean = identified_on(&scene, |_| 0.0, |sensors| sensors)
        .unwrap()
        .decay
        .points
        .len();
    let points = found.decay.points.len();
    assert!(first < 0.5 && points.abs_diff(clean) <= 4, "{first}: {points} {clean}");
}

#[test]
fn another_phase_or_drive_than_asked_is_said_before_anything_else_is_blamed() {
    let scene = scene(&["phase_lock.acquire_timeout=60"]);
    let said = |turned: f64, times: f64, settled: Option<bool>| {
        let configure = |config: Config| Config {
            phase_target: config.phase_target + turned * PI / 180.0,
            amplitude: times * config.amplitude,
            response_max: None,
            residual_max: None,
            ..config
        };
        let (record, last) = run(&scene, configure, |command, _| command.settled = settled);
        let message = match record {
            Err(error) => error.to_string(),
            Ok(record) => match identify(&record, &scene.plan()) {
                Err(error) => error.to_string(),
                Ok(found) => {
                    assert!(!found.lock.at_requested_drive, "{turned} {times}");
                    format!(
                        "{:.3} times the requested",
                        found.lock.at.drive().value / found.lock.requested()
                    )
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
        assert!(
            message.contains(&phase) && message.contains("degrees off controller.phase_target"),
            "{message}"
        );
        assert!(message.contains("the controller reports"), "{message}");
    }
    for times in [2.0, 0.5, 1.09, 0.91, 1.02] {
        let message = said(0.0, times, None);
        assert!(
            message.contains(&format!("{times:.3} times the requested")),
            "{message}"
        );
    }
    let both = said(20.0, 2.0, None);
    assert!(
        both.contains("degrees off controller.phase_target") && both.contains("2.000 times"),
        "{both}"
    );
}

#[test]
fn a_lock_at_the_requested_drive_and_phase_says_so_through_noise() {
    for snr in ["chain.snr=none", "chain.snr=60", "chain.snr=40"] {
        let scene = scene(&[snr]);
        let (record, _) = run(&scene, |config| config, |_, _| ());
        let found = identify(&record.unwrap(), &scene.plan()).unwrap();
        let (at, requested) = (found.lock.at, found.lock.requested());
        assert!(
            found.lock.at_requested_drive,
            "{snr}: {} ± {} m, {requested} m",
            at.drive().value,
            at.drive().uncertainty
        );
        assert!(TAU * at.f_hz > 0.0 && found.decay.end != DecayEnd::Driven);
    }
}

#[test]
fn a_loop_check_does_not_cut_the_stinger() {
    let text = include_str!("../../../../scenes/shaker-cantilever.toml");
    let scene = super::common::scene(text, &["shaker.release=cut", "start.dq2=0"]).unwrap();
    let force = |is_checked: bool| {
        let mut rig = Simulated::of(&scene).unwrap();
        if is_checked {
            check(rig.as_mut(), &scene.plan()).unwrap();
        }
        let drive = Drive {
            omega: scene.dimensionless().omega0,
            amplitude: scene.knowledge().target.units.command.of_metres(1e-6),
            displacement: 0.0,
        };
        let mut largest = 0.0_f64;
        for _ in 0..200 {
            rig.advance(drive, scene.sample_time()).unwrap();
            largest = largest.max(rig.sense().unwrap().reference.unwrap().abs());
        }
        largest
    };
    let [fresh, checked] = [false, true].map(force);
    assert!((checked / fresh - 1.0).abs() < 0.5, "{fresh:e} {checked:e} N");
}
