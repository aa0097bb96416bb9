//! The estimator on signals whose truth is known in closed form.

use std::f64::consts::TAU;

use num_complex::Complex64;
use vines_estimate::{Element, Estimate, Linear, Path, Periods, Record, Signals, probabilities};

mod common;
use common::noise;

const SAMPLE_TIME: f64 = 0.01;
const LINEAR: Linear = Linear { omega0: TAU, zeta: 0.01 };

fn samples(count: usize, value: impl Fn(f64) -> f64) -> Vec<f64> {
    (0..count).map(|k| value(k as f64 * SAMPLE_TIME)).collect()
}

#[test]
fn the_linear_response_to_a_sine_is_that_of_the_frequency_response() {
    let omega = 0.97 * LINEAR.omega0;
    let base = samples(100_000, |t| (omega * t).sin());
    let response = LINEAR.response(&base, SAMPLE_TIME);
    // A polygon through a sine has this share of its frequency.
    let half = 0.5 * omega * SAMPLE_TIME;
    let expected = LINEAR.base(omega) / LINEAR.taken(omega) * (half.sin() / half).powi(2);
    for (k, response) in response.iter().enumerate().skip(90_000).take(1_000) {
        let exact = (expected * Complex64::cis(omega * k as f64 * SAMPLE_TIME)).im;
        assert!((response - exact).abs() < 1e-5 * expected.norm(), "{response} {exact}");
    }
}

#[test]
fn the_fundamental_of_a_decay_is_its_amplitude_at_the_middle_of_each_period() {
    // A decay by a tenth in a period, 4 % beside the frequency of the frame, with a small third harmonic, whose own decay moves the fundamental.
    let (rate, omega) = (0.1, 0.96 * TAU);
    let signal = samples(3_000, |t| {
        (-rate * t).exp() * ((omega * t).sin() + 0.005 * (3.0 * omega * t).cos())
    });
    let zero = vec![0.0; signal.len()];
    let periods = Periods::new([&signal, &zero, &zero], [&signal, &zero], SAMPLE_TIME, TAU).expect("28 periods");
    for k in 2..20 {
        let t = periods.time[k];
        let exact = (-rate * t).exp() * Complex64::cis((omega - TAU) * t);
        let error = (periods.response[k] - exact).norm() / exact.norm();
        assert!(error < 1e-4, "{error:e} at {t} s");
    }
}

/// An element whose force follows at once, and of which nothing else is known.
struct Immediate;

impl Element for Immediate {
    fn steady(&self, _: f64) -> Complex64 {
        Complex64::ZERO
    }

    fn lag(&self, _: f64) -> Complex64 {
        Complex64::ZERO
    }

    fn is_smooth(&self, _: f64) -> bool {
        true
    }

    fn along(&self, _: &Path) -> Option<Vec<Vec<(f64, Complex64)>>> {
        None
    }
}

#[test]
fn a_linear_rig_has_its_own_drive_and_frequency_whatever_linear_response_is_assumed() {
    let rig = Linear { omega0: 1.001 * LINEAR.omega0, zeta: 0.012 };
    let mut noise = noise(1);
    let base = samples(40_000, |t| (0.6 + 0.4 * (0.01 * t).cos()) * (1.001 * TAU * t).sin());
    let mut response = rig.response(&base, SAMPLE_TIME);
    // The base is a sine, of which a polygon through its samples has this share.
    let half = 0.5 * 1.001 * TAU * SAMPLE_TIME;
    let share = (half.sin() / half).powi(2);
    response.iter_mut().for_each(|y| *y = *y / share + 0.1 * noise());
    let measured: Vec<f64> = base.iter().map(|x| x + 1e-4 * noise()).collect();
    let record =
        Record::new(&Signals::of_displacements([response, measured], SAMPLE_TIME), LINEAR, 0).expect("400 periods");
    // What the rig has beside the assumed response depends on the base as well, so that it is a function of the amplitude in steady motion only: here
    // it moves omega_R by 1e-5, half of the uncertainty at this noise, and by a fourteenth of that where the amplitude changes four times more slowly.
    let used: Vec<bool> = record.periods.time.iter().map(|t| *t > 100.0).collect();
    let (estimate, solution) = Estimate::new(&record, &Immediate, 1.0, &used)
        .and_then(Estimate::fit)
        .expect("a smooth force");
    let curve = estimate.curve(&solution).expect("information");
    let [low, high] = curve.basis.ends;
    let amplitudes: Vec<f64> = (1..10)
        .map(|n| (low + (high - low) * f64::from(n) / 10.0).exp())
        .collect();
    let resonance = curve.at(&amplitudes);
    for (n, amplitude) in amplitudes.iter().enumerate() {
        let u = |n: usize| resonance.covariance[(n, n)].sqrt();
        // Where the response lags by a quarter of a period.
        let (mut omega, h) = (rig.omega0, 1e-6);
        let base = |omega: f64| amplitude * rig.taken(omega) / rig.base(omega);
        for _ in 0..20 {
            omega -= base(omega).re / ((base(omega + h) - base(omega)).re / h);
        }
        let (drive, own) = (base(omega).im, [resonance.drive[n], resonance.omega[n]]);
        assert!((own[0] - drive).abs() < 4.0 * u(n), "{own:?} {drive} ± {}", u(n));
        assert!(
            (own[1] - omega).abs() < 4.0 * u(9 + n),
            "{own:?} {omega} ± {}",
            u(9 + n)
        );
        assert!(u(n) < 0.01 * drive, "{} of {drive}", u(n));
    }
}

#[test]
fn a_window_that_says_little_has_the_regime_of_its_neighbours() {
    let sure = [0.0, -20.0];
    let doubtful = [-0.5, 0.0];
    let windows = [sure, sure, doubtful, sure, [-20.0, 0.0]];
    let regimes = probabilities(&windows);
    assert!(regimes[2][0] > 0.99 && regimes[4][1] > 0.99, "{regimes:?}");
}
