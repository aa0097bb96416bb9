//! Guards the accuracy of the fit along the decay, clean and in noise, and that zero crossings are exact on clean samples;
//! `studies/decay.rs` takes more windows.

use rand_chacha::{ChaCha8Rng, rand_core::SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use vines_model::numerics::mean_square;
use vines_testbench::comparison::COMPARED_ABOVE;
use vines_testbench::experiment::{self, Plan};
use vines_testbench::identification::{DecayPoint, decay_points};
use vines_testbench::record::Record;
use vines_testbench::rig::{BuiltIn, Simulated};
use vines_testbench::scene::{Estimator, Scene};

/// A record of the default plant, with this many samples per period.
fn record(samples: u32) -> (Record, Scene) {
    let text = include_str!("../../../scenes/dimensionless.toml");
    let setting = format!("controller.samples_per_period={samples}").parse().unwrap();
    let scene = Scene::parse("dimensionless.toml", text, &[setting]).unwrap();
    let mut rig = Simulated::new(scene.plant, scene.start).unwrap();
    let mut controller = BuiltIn::new(&scene.controller_config()).unwrap();
    let record = experiment::run(&mut rig, &mut controller, &Plan::of(&scene), |_, _, _| {}).unwrap();
    (record, scene)
}

/// The points of the decay above the fold.
fn points(record: &Record, scene: &Scene, estimator: Estimator) -> Vec<DecayPoint> {
    let mut scene = scene.clone();
    scene.record.estimator = estimator;
    let mut points = decay_points(record, &scene).points;
    points.retain(|point| point.c > COMPARED_ABOVE);
    points
}

/// RMS of sigma less that of the zero crossings of a clean decay, between whose points it is interpolated.
fn rms(points: &[DecayPoint], truth: &[DecayPoint]) -> f64 {
    let error = |point: &DecayPoint| {
        let after = truth.partition_point(|one| one.tau < point.tau);
        let (from, to) = (truth.get(after.checked_sub(1)?)?, truth.get(after)?);
        let share = (point.tau - from.tau) / (to.tau - from.tau);
        Some(point.sigma - from.sigma - share * (to.sigma - from.sigma))
    };
    let errors: Vec<f64> = points.iter().filter_map(error).collect();
    assert!(errors.len() > 10);
    mean_square(errors).sqrt()
}

/// The record with noise of 40 dB relative to the held response.
fn noisy(record: &Record) -> Record {
    let mut noisy = record.clone();
    let deviation = 0.01 * mean_square(record.hold().iter().map(|sample| sample.sensors.response)).sqrt();
    let mut random = ChaCha8Rng::seed_from_u64(1);
    for sample in &mut noisy.samples {
        let normal: f64 = StandardNormal.sample(&mut random);
        sample.sensors.response += deviation * normal;
    }
    noisy
}

#[test]
fn clean_the_fit_is_within_0_02_in_sigma_and_through_40_db_within_0_04() {
    let (clean, scene) = record(100);
    let truth = points(&clean, &scene, Estimator::Crossings);
    let [fit, noisy] = [&clean, &noisy(&clean)].map(|record| rms(&points(record, &scene, Estimator::Fit), &truth));
    println!("clean {fit:.1e}, at 40 dB {noisy:.1e}");
    assert!(fit <= 0.02 && noisy <= 0.04);
}

#[test]
fn zero_crossings_are_exact_on_clean_data_and_no_good_in_noise() {
    let (clean, scene) = record(100);
    let (fine, of_fine) = record(400);
    let truth = points(&fine, &of_fine, Estimator::Crossings);
    let [exact, noisy] =
        [&clean, &noisy(&clean)].map(|record| rms(&points(record, &scene, Estimator::Crossings), &truth));
    println!("clean {exact:.1e}, at 40 dB {noisy:.1e}");
    assert!(exact <= 1e-4 && noisy > 0.1);
}
