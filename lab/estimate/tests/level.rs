//! The estimator of a level on synthetic periods, whose force is known.

use std::f64::consts::TAU;

use num_complex::Complex64;
use vines_estimate::{Disturbance, Level, Motion};

mod common;
use common::noise;

/// g X over the response at rest, 1/s, and the force at amplitude one, whose size is that of a linear response with 1 % damping; the period is 1 s.
const DRIVE: f64 = 0.01 * TAU;
const FORCE: Complex64 = Complex64::new(-DRIVE, 0.2 * DRIVE);

/// Periods before the record.
const WARM_UP: i32 = 20;

/// What is particular to a rig and its record.
#[derive(Clone, Copy, Default)]
struct Rig {
    /// Noise of response and drive, over their sizes.
    noise: [f64; 2],
    /// Change of the drive over the record, relative.
    drift: f64,
    /// Slope of the force over the logarithm of the amplitude, 1/s, and its lag, s.
    slope: Complex64,
    lag: f64,
    /// Amplitude and pole, 1/s, of what rings.
    ring: (f64, Complex64),
}

/// Periods from an amplitude of one on, as measured.
fn motion(rig: Rig, count: usize, seed: u32) -> Motion {
    let mut noise = noise(seed);
    let mut noise = |size: f64| size * Complex64::new(noise(), noise());
    let (mut z, mut late) = (Complex64::ONE, 0.0);
    let (mut response, mut drive) = (Vec::new(), Vec::new());
    let steps = 400;
    for k in -WARM_UP..count as i32 {
        let is_used = k >= 0;
        // The control turns the drive with the response, and holds the amplitude at a moving level.
        let share = f64::from(k) / count as f64;
        let error = rig.drift * share - z.norm().ln();
        let nominal = DRIVE * (1.0 + 5.0 * error) * Complex64::cis(z.arg());
        let x = nominal + noise(rig.noise[1] * DRIVE);
        for n in 0..steps {
            if n == steps / 2 && is_used {
                let ring = rig.ring.0 * (rig.ring.1 * f64::from(k)).exp();
                let measured = z + ring + noise(rig.noise[0]);
                response.push(measured.ln());
                drive.push((nominal + noise(0.0)) / measured);
            }
            let h = 1.0 / f64::from(steps);
            let a = z.norm().ln();
            late += if rig.lag > 0.0 {
                h * (a - late) / rig.lag
            } else {
                a - late
            };
            z += h * (x + (FORCE + rig.slope * late) * z);
        }
    }
    Motion {
        time: (0..count).map(|k| k as f64).collect(),
        response,
        drive,
        noise: [rig.noise[0].max(1e-6).powi(2), (rig.noise[1] * DRIVE).powi(2)],
        disturbances: Vec::new(),
        rings: Vec::new(),
        slope: None,
        lag: 1.6,
    }
}

/// Errors of both components of the force at the mean amplitude over their uncertainties.
fn pulls(rig: &Rig, level: &Level) -> [f64; 2] {
    let error = level.force() - (FORCE + rig.slope * level.amplitude);
    let u = [Complex64::ONE, Complex64::i()].map(|part| level.uncertainty(part, &[]));
    [error.re / u[0], error.im / u[1]]
}

/// Mean square of the pulls of many records, the largest one, and the share of records that are not white noise.
fn of_many(rig: Rig, count: usize, with: impl Fn(&mut Motion)) -> [f64; 3] {
    let records = 200;
    let (mut squares, mut largest, mut rejected) = (0.0, 0.0_f64, 0.0);
    let mut normal = noise(11);
    for seed in 0..records {
        // The control holds a level up to this slope.
        let slope = 3.0 * DRIVE * Complex64::new(normal().min(1.0), normal());
        let rig = Rig { slope, ..rig };
        let mut motion = motion(rig, count, 7 + 31 * seed);
        with(&mut motion);
        let level = Level::of(&motion).expect("a level");
        for pull in pulls(&rig, &level) {
            squares += pull * pull / f64::from(2 * records);
            largest = largest.max(pull.abs());
        }
        rejected += f64::from(!(level.is_noise() && level.is_white())) / f64::from(records);
    }
    [squares, largest, rejected]
}

#[test]
fn the_uncertainty_is_the_scatter_of_the_force_by_noise_of_response_and_drive() {
    for noise in [[1e-3, 0.0], [1e-3, 1e-2], [1e-4, 1e-2], [1e-5, 1e-3]] {
        for count in [10, 30, 100] {
            let [square, largest, rejected] = of_many(Rig { noise, ..Rig::default() }, count, |_| ());
            // In a short record noise drifts, and a drift may have a lag.
            let least = [0.6, 0.75, 0.8][[10, 30, 100].iter().position(|one| *one == count).unwrap()];
            assert!((least..1.2).contains(&square), "{noise:?} {count}: {square}");
            assert!(
                largest < 7.0 && rejected < 0.01,
                "{noise:?} {count}: {largest} {rejected}"
            );
        }
    }
}

#[test]
fn a_beat_slower_than_the_record_widens_the_uncertainty_and_does_not_move_the_force_out_of_it() {
    let pole = Complex64::new(-0.04, 0.3);
    let rig = Rig { noise: [1e-4, 0.0], ring: (0.01, pole), ..Rig::default() };
    for count in [10, 20, 60] {
        let [square, largest, rejected] = of_many(rig, count, |motion| motion.rings.push(pole));
        assert!((0.5..1.4).contains(&square), "{count}: {square}");
        assert!(largest < 7.0 && rejected < 0.02, "{count}: {largest} {rejected}");
        // Without the ring as an unknown, half a beat looks like a drift; more of it is not white.
        let [square, _, rejected] = of_many(rig, count, |_| ());
        assert!(
            count == 10 || square > 10.0 || rejected > 0.99,
            "{count}: {square} {rejected}"
        );
    }
    let u = |count: usize, rings: bool| {
        let mut motion = motion(rig, count, 1);
        motion.rings.extend(rings.then_some(pole));
        let level = Level::of(&motion).expect("a level");
        level.uncertainty(Complex64::ONE, &[])
    };
    assert!(u(10, true) > 10.0 * u(100, true));
}

#[test]
fn a_drift_with_a_lag_of_the_force_is_covered() {
    for drift in [-0.1, 0.05, 0.1] {
        let slope = Complex64::new(-DRIVE, 3.0 * DRIVE);
        let rig = Rig { noise: [1e-4, 0.0], drift, slope, lag: 0.8, ..Rig::default() };
        for count in [12, 40] {
            let level = Level::of(&motion(rig, count, 3)).expect("a level");
            let pulls = pulls(&rig, &level);
            assert!(pulls.iter().all(|pull| pull.abs() < 3.0), "{drift} {count}: {pulls:?}");
            assert!(level.is_noise() && level.is_white());
        }
    }
}

#[test]
fn an_unknown_disturbance_of_the_drive_is_a_part_of_the_uncertainty() {
    let rig = Rig { noise: [1e-5, 0.0], ..Rig::default() };
    let mut motion = motion(rig, 30, 1);
    let rates = motion.drive.clone();
    motion.disturbances.push(Disturbance { rates, deviation: 0.01 });
    let level = Level::of(&motion).expect("a level");
    let u = level.uncertainty(Complex64::ONE, &[]);
    assert!((u / (0.01 * DRIVE) - 1.0).abs() < 0.1, "{u}");
    // A factor of both changes the drive that holds the level by nothing.
    let known = level.uncertainty(Complex64::ONE, &[DRIVE]);
    assert!(known < 0.1 * u, "{known} {u}");
}
