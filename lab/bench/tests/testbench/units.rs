//! Guards the units of messages and results: of a structure that a force drives and an accelerometer observes, all are in N, m/s² and m at the sensor.

use std::cell::RefCell;
use std::f64::consts::TAU;

use num_complex::Complex;
use phase_lock::Config;
use vines_bench::backbone::track;
use vines_bench::comparison::Comparison;
use vines_bench::experiment::{self, ExperimentError};
use vines_bench::identification::identify;
use vines_bench::loop_check::check;
use vines_bench::record::{Record, table};
use vines_bench::rig::{
    BuiltIn, Command, Controller, ControllerError, Drive, Move, RigFault, Sensors, SensorsOnly, Simulated, faulty,
};
use vines_bench::scene::Scene;

use super::preset;
use super::{Altered, changed, identified};

/// The frame with an accelerometer. Its driven mode has 8.8156 Hz, a damping ratio of 0.006 and the shapes 0.45 at drive and sensor and 0.51252 at the
/// cavity.
fn frame(settings: &[&str]) -> Scene {
    let accelerometer = ["resonance.sensor_quantity=acceleration", "record.decay_periods=30"];
    preset("frame", &[&accelerometer, settings].concat()).unwrap()
}

const OMEGA0: f64 = TAU * 8.8156;

/// The force, N, for which a controller answers 1 m.
fn per_metre() -> f64 {
    OMEGA0 * OMEGA0 * 1.0_f64.hypot(2.0 * 0.006) / (0.45 * 0.51252)
}

/// What reached a rig, N, and what it read.
#[derive(Default)]
struct Log {
    drives: Vec<f64>,
    readings: Vec<Sensors>,
}

impl Log {
    fn last(&self) -> Sensors {
        *self.readings.last().unwrap()
    }

    /// Amplitude of the first harmonic of the response in the period before this sample, as a displacement, m; a second has 881.56 samples.
    fn displacement(&self, end: usize, hertz: f64) -> f64 {
        let (omega, step) = (TAU * hertz, 1.0 / 881.56);
        let period = (1.0 / (hertz * step)).round() as usize;
        let readings = (0..).zip(&self.readings[end - period..end]);
        let turned = readings.map(|(n, sensors)| Complex::cis(omega * step * f64::from(n)) * sensors.response);
        2.0 * turned.sum::<Complex<f64>>().norm() / (period as f64 * omega * omega)
    }
}

/// The simulated rig of a scene, without what only a simulation knows if it is `silent`.
fn logged<'a>(scene: &Scene, silent: bool, log: &'a RefCell<Log>) -> Altered<'a> {
    let rig = Simulated::of(scene).unwrap();
    Altered {
        rig: if silent { Box::new(SensorsOnly(rig)) } else { rig },
        read: Box::new(|sensors| {
            log.borrow_mut().readings.push(sensors);
            Ok(sensors)
        }),
        drive: Box::new(|drive: Drive, step| {
            log.borrow_mut().drives.push(drive.amplitude);
            (drive, step)
        }),
    }
}

/// The built-in controller with another answer, by whether it is to drive and for how many samples it was not.
struct Changed<F>(BuiltIn, usize, F);

impl<F: FnMut(&mut Command, Option<usize>)> Controller for Changed<F> {
    fn sample(&mut self, sensors: Sensors, active: bool) -> Result<Command, ControllerError> {
        let mut command = self.0.sample(sensors, active)?;
        command.state = None;
        self.1 = if active { 0 } else { self.1 + 1 };
        (self.2)(&mut command, (!active).then_some(self.1));
        Ok(command)
    }

    fn hold_response(&mut self, to: Move, phase_target: f64) -> Result<(), ControllerError> {
        self.0.hold_response(to, phase_target)
    }

    fn hold_drive(&mut self) -> Result<(), ControllerError> {
        self.0.hold_drive()
    }
}

fn run(scene: &Scene, change: impl FnMut(&mut Command, Option<usize>)) -> (Result<Record, ExperimentError>, Log) {
    let log = RefCell::default();
    let limits = Config { response_max: None, ..scene.plan().lock };
    let mut controller = Changed(BuiltIn::new(&limits).unwrap(), 0, change);
    let mut rig = logged(scene, false, &log);
    let record = experiment::run(&mut Vec::new(), &mut rig, &mut controller, &scene.plan(), |_, _| {});
    drop(rig);
    (record, log.into_inner())
}

/// Numbers with a unit of a channel in a text, in this order.
fn with_units(text: &str) -> Vec<(f64, &str)> {
    let words: Vec<&str> = text.split([' ', '\n']).collect();
    let pairs = words.windows(2).filter_map(|pair| {
        let unit = pair[1].trim_end_matches([',', ';', ':', '.']);
        let is_of_channel = ["m", "m/s", "m/s²", "N", "V", "N/m"].contains(&unit);
        is_of_channel.then_some((pair[0].parse().ok()?, unit))
    });
    pairs.collect()
}

/// The text has these numbers with units, and no others; it states five digits.
#[track_caller]
fn assert_states(text: &str, expected: &[(f64, &str)]) {
    let found = with_units(text);
    let is_same = |((value, unit), (expected, of)): (&(f64, &str), &(f64, &str))| {
        unit == of && (value / expected - 1.0).abs() < 6e-5
    };
    let are_same = found.len() == expected.len() && found.iter().zip(expected).all(is_same);
    assert!(are_same, "{text}\n{found:?}\n{expected:?}");
}

/// What a run ends with, beside what reached the rig and what it read.
fn ended<T>(scene: &Scene, silent: bool, run: impl FnOnce(&mut Altered, &Scene) -> Result<T, String>) -> (String, Log) {
    let log = RefCell::default();
    let error = run(&mut logged(scene, silent, &log), scene).err().unwrap();
    (error, log.into_inner())
}

fn by_search(rig: &mut Altered, scene: &Scene) -> Result<Record, String> {
    super::record(rig, scene).map_err(|error| error.to_string())
}

#[test]
fn a_drive_by_force_that_is_refused_is_stated_in_newton_and_a_response_as_its_sensor_reads_it() {
    let requested = frame(&[]).amplitude * per_metre();
    let settings = &["phase_lock.amplitude_max=20"];
    let (record, log) = run(&frame(settings), |command, _| command.drive.amplitude *= 1e3);
    let expected = [(1e3 * requested, "N"), (20.0, "N"), (per_metre(), "N/m")];
    assert_states(&record.unwrap_err().to_string(), &expected);
    assert!(log.drives.is_empty());
    let (record, _) = run(&frame(&[]), |command, _| command.drive.amplitude = -3e-6);
    assert_states(&record.unwrap_err().to_string(), &[(-3e-6 * per_metre(), "N")]);
    // The limit is a displacement at the sensor, in m.
    let low = frame(&["phase_lock.response_max=0.002"]);
    let limit = [(0.002, "m"), (0.002 * OMEGA0 * OMEGA0, "m/s²")];
    let (record, log) = run(&low, |_, _| ());
    let read = (log.last().response, "m/s²");
    assert_states(&record.unwrap_err().to_string(), &[&[read][..], &limit].concat());
    let (error, log) = ended(&low, false, by_search);
    // The controller has ramped the drive down since.
    let mut readings = log.readings.iter();
    let above = readings.find(|sensors| sensors.response.abs() > limit[1].0);
    let Sensors { response, reference } = *above.unwrap();
    let expected = [(response, "m/s²"), (reference.unwrap(), "N"), (response.abs(), "m/s²")];
    assert_states(&error, &[&expected[..], &limit].concat());
}

#[test]
fn a_drive_by_force_that_is_not_released_is_stated_in_newton() {
    let wrong = 1e-5;
    let says = |change: fn(&mut Command, usize)| {
        let (record, _) = run(&frame(&[]), |command, off| {
            if let Some(samples) = off {
                change(command, samples);
            }
        });
        record.unwrap_err().to_string()
    };
    let amplitude = says(|command, _| command.drive.amplitude = 1e-5);
    let present = says(|command, _| {
        command.drive.amplitude = 0.0;
        command.drive.displacement = 1e-5;
    });
    let again = says(|command, samples| command.drive.amplitude = if samples < 1000 { 0.0 } else { 1e-5 });
    for (text, words) in [
        (amplitude, "does not release the drive"),
        (present, "F = 0, but a force of"),
        (again, "drives again"),
    ] {
        assert!(text.contains(words), "{text}");
        assert_states(&text, &[(wrong * per_metre(), "N")]);
    }
}

#[test]
fn responses_that_a_search_or_a_track_states_are_displacements_at_the_sensor() {
    let b = 0.01 * 0.45 / 0.51252;
    let is_near = |value: f64, expected: f64| (value / expected - 1.0).abs() < 0.02;
    let of = |timeout: &str, silent| ended(&frame(&[timeout]), silent, by_search).0;
    let errors = [false, true].map(|silent| of("phase_lock.acquire_timeout=5", silent));
    assert_eq!(errors[0], errors[1]);
    let [(_, "N"), (low, "m"), (high, "m")] = with_units(&errors[0])[..] else {
        panic!("{}", errors[0])
    };
    assert!(is_near(low, 0.151 * b) && high > low, "{}", errors[0]);
    let error = of("phase_lock.acquire_timeout=125", true);
    let [_, _, (high, "m"), (nearest, "m"), (drive, "N")] = with_units(&error)[..] else {
        panic!("{error}")
    };
    let is_nearest = is_near(nearest, 0.85 * b) && high / nearest < 1.2;
    assert!(is_nearest && drive > 0.0, "{error}");
    let scene = frame(&["controller.phase_target=-80", "start.dq2=0"]);
    let log = RefCell::default();
    let record = super::record(&mut logged(&scene, true, &log), &scene).unwrap();
    let error = identify(&record, &scene.plan()).unwrap_err().to_string();
    let [(locked, "m")] = with_units(&error)[..] else {
        panic!("{error}")
    };
    let expected = log.borrow().displacement(record.hold_end, 8.81331);
    assert!(is_near(locked, expected), "{error}");
    let levels = ["backbone.C_from=0.45", "backbone.C_to=0.15", "backbone.points=3"];
    let settings = &[&levels[..], &["phase_lock.lock.unlock_tolerance=1.5"]].concat();
    for silent in [false, true] {
        let (error, _) = ended(&frame(settings), silent, |rig, scene| {
            let mut controller = BuiltIn::new(&scene.plan().tracking).unwrap();
            let tracked = track(&mut Vec::new(), rig, &mut controller, &super::checked(scene), |_| {});
            tracked.unwrap().end.map_or(Ok(()), |end| Err(end.to_string()))
        });
        assert_states(&error, &[(0.45 * b, "m"), (0.3 * b, "m")]);
    }
}

#[test]
fn results_of_a_force_test_are_in_newton_and_metres_at_the_sensor_and_are_read_again() {
    let (scene, log) = (frame(&[]), RefCell::default());
    let checked = check(&mut logged(&scene.clone().at_rest(), true, &log), &scene.plan()).unwrap();
    let strongest = log.borrow().drives.iter().copied().fold(0.0, f64::max);
    assert!((checked.amplitude / strongest - 1.0).abs() < 1e-12);
    let log = RefCell::default();
    let record = super::record(&mut logged(&scene, false, &log), &scene).unwrap();
    let found = identify(&record, &scene.plan()).unwrap();
    let (lock, hold_end, log) = (found.lock, record.hold_end, log.into_inner());
    let near = |value: f64, expected: f64, by: f64| assert!((value / expected - 1.0).abs() < by, "{value} {expected}");
    near(lock.at.f_n.unwrap(), log.drives[hold_end - 1], 2e-3);
    near(lock.requested(), frame(&[]).amplitude * per_metre(), 1e-12);
    near(lock.at.a_m, log.displacement(hold_end, lock.at.f_hz), 0.02);
    // The half-width as a response at the sensor.
    let b = 0.01 * 0.45 / 0.51252;
    near(lock.at.a_m / lock.at.c, b, 1e-12);
    let point = lock.at.measured(&scene.units());
    near(point.drive.value, scene.dimensionless().amplitude(lock.at.g), 1e-12);
    near(point.response.value, 0.01 * lock.at.c, 1e-12);
    let json = serde_json::to_value(Comparison::of(&found, &scene)).unwrap();
    let keys: Vec<&str> = json["lock"].as_object().unwrap().keys().map(String::as_str).collect();
    let in_metres: Vec<_> = keys.iter().filter(|key| key.ends_with("_m")).collect();
    assert_eq!(in_metres, [&"A_m", &"u_A_m"], "{keys:?}");
    let in_newton = ["F_N", "u_F_N", "F_requested_N"];
    assert!(in_newton.iter().all(|key| keys.contains(key)), "{keys:?}");
    let table = table(&record.samples, &scene.knowledge().target);
    assert!(table.starts_with("time,response [m/s²],reference [N],omega,E [N],"));
}

#[test]
fn points_of_a_decay_are_displacements_at_the_sensor() {
    // The frame without its second mode, which would ring beside the decay.
    let second = "    { frequency = 9.3, damping = 0.006, shape = { left = 0.51252, right = -0.45 } },\n";
    let text = include_str!("../../../../scenes/frame.toml").replace(second, "");
    let found = identified(&Scene::parse("one mode", &text, &[]).unwrap()).unwrap();
    let points = found.decay.points;
    assert!(!points.is_empty());
    for point in points {
        let b = 0.01 * 0.45 / 0.51252;
        assert!((point.a_m / (point.c * b) - 1.0).abs() < 1e-12 && (point.u_a_m / (point.u_c * b) - 1.0).abs() < 1e-12);
    }
}

/// The shaker on the cantilever, with a sensor of velocity in its middle.
#[test]
fn behind_a_shaker_a_motion_that_is_not_steady_is_stated_at_the_sensor_and_a_force_that_contradicts_in_newton() {
    let middle = "root = 0.04672 -> middle = 0.17399, root = 0.04672 ;; root = 0.20366 -> middle = 0.36568, root = 0.20366 ;; \
                  root = 0.36168 -> middle = 0.01008, root = 0.36168 ;; sensor = \"tip\" -> sensor = \"middle\"";
    let text = changed(include_str!("../../../../scenes/shaker-cantilever.toml"), middle);
    let velocity = "resonance.sensor_quantity=velocity".parse().unwrap();
    let scene = Scene::parse("middle", &text, &[velocity]).unwrap();
    let (log, mut n) = (RefCell::default(), 0.0);
    let mut rig = logged(&scene, false, &log);
    rig.read = Box::new(|sensors| {
        // The sensor changes its sensitivity by 3 % in a beat of 41 periods of 100 samples, which the loop follows.
        n += 1.0;
        let response = sensors.response * (1.0 + 0.03 * f64::sin(TAU * n / 4100.0));
        log.borrow_mut().readings.push(Sensors { response, ..sensors });
        Ok(Sensors { response, ..sensors })
    });
    let error = super::record(&mut rig, &scene).err().unwrap();
    drop(rig);
    let is_in_time = matches!(error, ExperimentError::NotSteady { periods: 150..170, .. });
    let error = error.to_string();
    assert!(is_in_time && error.contains("is not steady: its "), "{error}");
    let [(held, "m")] = with_units(&error)[..] else {
        panic!("{error}")
    };
    let log = log.into_inner();
    let expected = OMEGA0 * log.displacement(log.readings.len(), 8.7);
    assert!((held / expected - 1.0).abs() < 0.05, "{error} {expected}");
    let [_, amplifier, _] = RigFault::OF_SHAKER.map(|(_, fault)| fault);
    let mut rig = faulty(&scene, amplifier, 20.0, |_| {}).unwrap();
    let error = super::record(&mut rig, &scene).err().unwrap().to_string();
    assert!(error.contains("the force contradicts command and response"), "{error}");
    let [(expected, "N"), (read, "N")] = with_units(&error)[..] else {
        panic!("{error}")
    };
    // The amplifier clips at half of the command.
    assert!((0.4..0.7).contains(&(read / expected)), "{error}");
}
