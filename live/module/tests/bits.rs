//! Guards the live bench: it is the lab's experiment, sample by sample; its settings, moves and refusals.

use std::f64::consts::TAU;

use vines_bench::experiment::run;
use vines_bench::identification::{DECAY_WINDOW, decay_points};
use vines_bench::live::HarmonicMotion;
use vines_bench::record::Record;
use vines_bench::rig::{BuiltIn, Command, Controller, ControllerError, Sensors, Simulated};
use vines_bench::scene::{PAPER, Scene};
use vines_live::bench::{Bench, Row, regime_at};
use vines_live::settings::{default_scene, index, settings_of};

fn paper() -> Scene {
    Scene::parse("paper.toml", PAPER, &[]).unwrap()
}

/// The controller under a constant drive: the live bench has no script.
struct ConstantDrive(BuiltIn);

impl Controller for ConstantDrive {
    fn sample(&mut self, sensors: Sensors, active: bool) -> Result<Command, ControllerError> {
        self.0.sample(sensors, active)
    }
}

/// The record of the lab's experiment under a constant drive.
fn record_of(scene: &Scene) -> Record {
    let mut rig = Simulated::new(scene.plant, scene.start).unwrap();
    let mut controller = ConstantDrive(BuiltIn::new(&scene.plan().lock).unwrap());
    run(&mut Vec::new(), &mut rig, &mut controller, &scene.plan(), |_, _| {}).unwrap()
}

fn bench() -> Bench {
    Bench::new(Bench::default_settings()).unwrap()
}

#[test]
fn lock_and_free_decay_have_the_bits_of_the_lab_under_a_constant_drive() {
    let (scene, mut bench, mut rows) = (paper(), bench(), Vec::new());
    assert_eq!(default_scene(), scene);
    let record = record_of(&scene);
    bench.run(record.released, |row| rows.push(*row)).unwrap();
    for (n, sample) in record.samples[..record.released].iter().enumerate() {
        let live = [rows[n].response, rows[n].output.omega];
        let lab = [sample.sensors.response, sample.command.drive.omega];
        assert_eq!(live.map(f64::to_bits), lab.map(f64::to_bits), "sample {n}");
    }
    assert!(bench.output.locked);
    let points = decay_points(&record, &scene.knowledge(), DECAY_WINDOW).points;
    assert!(points.len() > 50, "{} points", points.len());
    let released = bench.motion;
    bench.drive(false);
    let (mut fits, mut lost): (Vec<HarmonicMotion>, _) = (Vec::new(), None);
    let see = |row: &Row| {
        if fits.last() != Some(&row.motion) {
            fits.push(row.motion);
        }
        if !row.decays {
            lost.get_or_insert(row.time - record.decay()[0].time);
        }
    };
    bench.run(record.decay().len(), see).unwrap();
    // Until the first fit, the motion is that of the release.
    assert_eq!(fits.remove(0), released);
    // The lab begins where a period of the base is at rest, one stride later.
    for (point, HarmonicMotion { omega, amplitude, speed }) in points.iter().zip(&fits[1..]) {
        assert_eq!([point.f_hz, point.a_m], [omega / TAU, *amplitude], "{}", point.t_s);
        let b = scene.dimensionless().speed(*speed);
        assert!((b - point.b.unwrap()).abs() < 1e-12, "B = {b} at t = {} s", point.t_s);
    }
    // The last window of the lab has 2.5 periods and ends with the synchrony, which the bench judges as it goes, without the impacts
    // that follow: the two agree within the longest interval in synchrony, 1.25 half periods.
    let period = TAU / record.decay()[0].command.drive.omega;
    let late = (lost.unwrap() - points.last().unwrap().t_s) / period;
    let allowed = 1.25 - 0.625..1.25 + 0.625;
    assert!(allowed.contains(&late), "lost {late} periods after the last point");
    assert!(fits.len() >= points.len());
}

#[test]
fn a_mass_that_is_put_somewhere_starts_from_rest_there() {
    let mut bench = bench();
    bench.run(500, |_| {}).unwrap();
    let b = bench.scene.plant.half_width;
    for to in [-1.0, 0.3, 1.0] {
        bench.place(false, to).unwrap();
        let state = bench.plant().state();
        assert!((state.q2 - state.q1 - to * b).abs() < 1e-14, "particle at {to}");
        bench.place(true, 2.0 * to).unwrap();
        let moved = bench.plant().state();
        assert_eq!((moved.q1, moved.dq1, moved.dq2), (2.0 * to * b, 0.0, 0.0));
        assert!((moved.q2 - moved.q1 - to * b).abs() < 1e-14, "with the mass at {to}");
        bench.run(10, |_| {}).unwrap();
    }
}

#[test]
fn gap_difference_friction_and_tilt_reach_the_plant() {
    let mut settings = Bench::default_settings();
    settings[index::GAP_DIFFERENCE] = 10.0;
    settings[index::FRICTION] = 0.05;
    settings[index::TILT] = 30.0;
    let mut bench = Bench::new(settings).unwrap();
    let (plant, b) = (bench.scene.plant, bench.scene.plant.half_width);
    assert_eq!(plant.gaps(), [1.1 * b, 0.9 * b]);
    assert_eq!(plant.cavity.kinetic_friction, 0.05);
    assert_eq!(plant.cavity.tilt, 30f64.to_radians());
    bench.run(500, |_| {}).unwrap();
    assert!(bench.plant().totals().friction > 0.0);
    for (to, w) in [(-2.0, 1.1), (2.0, -0.9)] {
        bench.place(false, to).unwrap();
        let off = bench.plant().relative_displacement() - w * b;
        assert!(off.abs() < 1e-14, "particle at {to}");
    }
    // Friction and tilt change while the bench runs, and can be switched off.
    let time = bench.time();
    (settings[index::FRICTION], settings[index::TILT]) = (0.0, 0.0);
    bench.apply(settings).unwrap();
    let lovines::Cavity { b_plus, b_minus, .. } = plant.cavity;
    let ideal = lovines::Cavity { b_plus, b_minus, ..lovines::Cavity::IDEAL };
    assert_eq!((bench.time(), bench.plant().parameters().cavity), (time, ideal));
    assert_eq!(settings_of(&bench.scene), settings);
    settings[index::GAP_DIFFERENCE] = 0.0;
    bench.apply(settings).unwrap();
    assert_eq!(bench.scene, paper());
}

#[test]
fn slow_motion_between_two_samples_ends_at_the_next_one() {
    let mut bench = bench();
    for _ in 0..500 {
        bench.run(1, |_| {}).unwrap();
        let step = bench.controller.lock.config().sample_time;
        assert_eq!(bench.between(step).state(), bench.plant().state());
    }
}

#[test]
fn the_tracked_backbone_is_repeated_with_the_same_bits() {
    let mut bench = bench();
    bench.run(2000, |_| {}).unwrap();
    bench.track().unwrap();
    let points = bench.tracking.as_ref().unwrap().points.clone();
    assert!(points.len() > 20);
    for point in points {
        bench.run((point.sample - bench.samples) as usize, |_| {}).unwrap();
        assert_eq!(bench.output.omega.to_bits(), point.omega.to_bits(), "C = {}", point.c);
    }
}

#[test]
fn a_refused_setting_changes_nothing_and_says_why() {
    let mut bench = bench();
    let mut settings = bench.settings;
    settings[index::RESTITUTION] = 1.5;
    let message = bench.apply(settings).unwrap_err();
    let text = "r (coefficient of restitution) = {} is refused";
    assert!(message.text.starts_with(text), "{message:?}");
    assert_eq!(message.numbers, [1.5]);
    assert_eq!(bench.scene, paper());
}

#[test]
fn a_cell_of_the_map_has_the_regime_that_the_bench_reaches_under_that_drive() {
    let mut settings = Bench::default_settings();
    settings[index::CLOSED] = 0.0;
    let mut found = Vec::new();
    for (sigma, g) in [(-1.0, 1.2), (-1.0, 1.7), (0.0, 0.8), (-0.5, 3.6)] {
        (settings[index::DETUNING], settings[index::EXCITATION]) = (sigma, g);
        let mut bench = Bench::new(settings).unwrap();
        bench.run(40_000, |_| {}).unwrap();
        let regime = regime_at(&bench.scene, sigma, g).unwrap();
        assert_eq!(regime, bench.regime(), "sigma = {sigma}, G = {g}");
        found.push(regime);
    }
    found.sort();
    found.dedup();
    assert!(found.len() >= 3, "{found:?}");
}
