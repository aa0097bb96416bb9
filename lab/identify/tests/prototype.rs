//! The estimator against a prototype in Python, on a record of an independent simulator: a hold, a sweep and a decay of 140 periods, at 50 dB.
//!
//! `prototype.json` has the samples, in 1e-8 m (response) and 1e-10 m (base), and what the prototype computed of them with numpy 2.4 and scipy 1.17. Three
//! things were changed in the prototype: the drift of a period's fundamental is taken in the frame of the response, its second derivative is taken
//! off as well, and a period counts between two others only. The errors of the path, and the curvature that is expected of the force, are new here, and switched off where values are compared.

use std::f64::consts::TAU;

use num_complex::Complex64;
use serde::Deserialize;
use vines_estimate::{Element, Estimate, Linear, Record, Signals};
use vines_identify::{IdealRig, Particle, Samples, identify, rough_scene};
use vines_model::Sensor;

type Pair = [f64; 2];

#[derive(Deserialize)]
struct Prototype {
    sample_time: f64,
    response: Vec<f64>,
    base: Vec<f64>,
    scene: [f64; 5],
    truth: [f64; 5],
    time: Vec<f64>,
    z: Vec<Pair>,
    u: Vec<Pair>,
    noise: Vec<f64>,
    base_noise: Vec<f64>,
    even: Vec<Pair>,
    omega: Vec<f64>,
    impacts: Impacts,
    used: usize,
    deviance_change: f64,
    amplitude: Vec<f64>,
    drive: Vec<f64>,
    frequency: Vec<f64>,
    u_drive: Vec<f64>,
    u_frequency: Vec<f64>,
    correlation: f64,
    lag_change: Pair,
    smooth: Vec<Pair>,
    rough: [f64; 5],
    fit: [f64; 5],
    u_fit: [f64; 5],
    chi: f64,
    used_fit: usize,
}

#[derive(Deserialize)]
struct Impacts {
    force: Vec<Pair>,
    slope: Vec<Pair>,
    lag: Vec<Pair>,
}

fn scene([f0, zeta, r, b, epsilon]: [f64; 5]) -> IdealRig {
    IdealRig { f0, zeta, r, b, epsilon }
}

impl Prototype {
    fn load() -> (Self, [Vec<f64>; 2]) {
        let prototype: Self = serde_json::from_str(include_str!("prototype.json")).expect("the file is complete");
        let metres = |values: &[f64], unit: f64| values.iter().map(|value| value * unit).collect();
        let samples = [metres(&prototype.response, 1e-8), metres(&prototype.base, 1e-10)];
        (prototype, samples)
    }

    fn particle(&self) -> Particle {
        let [_, _, r, b, epsilon] = self.truth;
        Particle::ideal([epsilon, b, r], Sensor::Q1)
    }

    fn record(&self, samples: &[Vec<f64>; 2]) -> Record {
        let linear = Linear { omega0: TAU * self.truth[0], zeta: self.truth[1] };
        let signals = Signals::of_displacements(samples.clone(), self.sample_time);
        let mut record = Record::new(&signals, linear, 2).expect("140 periods");
        // The prototype's base moves in straight lines.
        record.between.fill(0.0);
        record
    }
}

/// Each value is that of the prototype, within this share of the largest.
fn same(values: impl IntoIterator<Item = f64>, reference: &[f64], share: f64) {
    let scale = reference
        .iter()
        .fold(0.0, |largest: f64, value| largest.max(value.abs()));
    let values: Vec<f64> = values.into_iter().collect();
    assert_eq!(values.len(), reference.len());
    for (value, expected) in values.iter().zip(reference) {
        assert!(
            (value - expected).abs() <= share * scale,
            "{value:e} instead of {expected:e}, of {scale:e}"
        );
    }
}

fn same_complex<'a>(values: impl IntoIterator<Item = &'a Complex64>, reference: &[Pair], share: f64) {
    same(
        values.into_iter().flat_map(|z| [z.re, z.im]),
        &reference.concat(),
        share,
    );
}

#[test]
fn periods_have_the_fundamentals_and_the_noise_of_the_prototype() {
    let (prototype, samples) = Prototype::load();
    let record = prototype.record(&samples);
    let periods = &record.periods;
    let each = |values: &[f64]| values.iter().step_by(20).copied().collect::<Vec<f64>>();
    same(each(&periods.time), &prototype.time, 1e-12);
    same(each(&periods.omega), &prototype.omega, 1e-9);
    same(each(&periods.noise), &prototype.noise, 1e-6);
    same(each(&periods.base_noise), &prototype.base_noise, 1e-6);
    same_complex(periods.response.iter().step_by(20), &prototype.z, 1e-9);
    same_complex(record.departure.iter().step_by(20), &prototype.u, 1e-8);
    let even: Vec<Complex64> = periods.second.iter().step_by(20).map(|second| 3.0 * second).collect();
    same_complex(&even, &prototype.even, 1e-6);
}

#[test]
fn the_closed_form_of_the_impacts_is_that_of_the_prototype() {
    let (prototype, _) = Prototype::load();
    let particle = prototype.particle();
    let steady = [0.25, 0.5].map(|c| particle.steady_motion(c * particle.b));
    same_complex(&steady.map(|one| one.force), &prototype.impacts.force, 1e-12);
    same_complex(&steady.map(|one| one.slope), &prototype.impacts.slope, 1e-12);
    same_complex(&steady.map(|one| one.lag), &prototype.impacts.lag, 1e-12);
}

#[test]
fn with_a_given_path_the_curve_and_its_covariance_are_those_of_the_prototype() {
    let (prototype, samples) = Prototype::load();
    let record = prototype.record(&samples);
    let particle = prototype.particle();
    let mut used = vec![true; record.periods.time.len()];
    let count = used.len();
    used[count - 22..].fill(false);
    let estimate = Estimate::new(&record, &particle as &dyn Element, particle.epsilon * particle.b, &used)
        .expect("118 periods")
        .with_given_path();
    assert_eq!(estimate.used.iter().filter(|used| **used).count(), prototype.used);
    let solve = |hyper| estimate.solve(hyper).expect("equations");
    let (here, there) = (solve([0.03, 0.1, 1.0]), solve([0.2, 0.01, 1.2]));
    same([there.deviance - here.deviance], &[prototype.deviance_change], 1e-5);
    let [lag_change, _] = [46, 48].map(|n| [here.unknowns[n], here.unknowns[n + 1]]);
    same(lag_change, &prototype.lag_change, 1e-5);
    let resonance = estimate.curve(&here).expect("information").at(&prototype.amplitude);
    same(resonance.drive.clone(), &prototype.drive, 1e-6);
    same(resonance.omega.clone(), &prototype.frequency, 1e-8);
    let u = |n: usize| resonance.covariance[(n, n)].sqrt();
    same((0..5).map(u), &prototype.u_drive, 1e-6);
    same((5..10).map(u), &prototype.u_frequency, 1e-6);
    same(
        [resonance.covariance[(0, 6)] / (u(0) * u(6))],
        &[prototype.correlation],
        1e-5,
    );
    let smooth = estimate.smooth([0.03, 0.1, 1.0], &here);
    same_complex(smooth.iter().step_by(20), &prototype.smooth, 1e-6);
}

#[test]
fn the_rough_scene_is_that_of_the_prototype() {
    let (prototype, samples) = Prototype::load();
    let rough = scene(prototype.scene);
    let signals = Signals::of_displacements(samples, prototype.sample_time);
    let record = Record::new(&signals, rough.linear(), 2).expect("140 periods");
    for (value, expected) in rough_scene(&record, &rough, Sensor::Q1)
        .values()
        .into_iter()
        .zip(prototype.rough)
    {
        same([value], &[expected], 1e-6);
    }
}

#[test]
fn the_parameters_are_those_of_the_prototype_within_their_uncertainty_and_the_true_ones_within_three() {
    let (prototype, samples) = Prototype::load();
    let signals = Signals::of_displacements(samples, prototype.sample_time);
    let samples = Samples { signals, sensor: Sensor::Q1 };
    let identified = identify(&samples, &scene(prototype.scene)).expect("1:1 motion");
    println!(
        "{:?} {:?}, chi-square {} ({})",
        identified.scene, identified.uncertainty, identified.chi_square, prototype.chi
    );
    assert_eq!(identified.used.iter().filter(|used| **used).count(), prototype.used_fit);
    for (i, value) in identified.scene.values().into_iter().enumerate() {
        let u = identified.uncertainty[i];
        assert!(
            (value - prototype.fit[i]).abs() < u.max(prototype.u_fit[i]),
            "{i}: {value} {}",
            prototype.fit[i]
        );
        assert!((value - prototype.truth[i]).abs() < 3.0 * u, "{i}: {value} ± {u}");
    }
}
