//! Guards the accuracy of the fit along the decay, clean and in noise; `studies/decay.rs` takes more windows.

#[path = "../../../studies/crossings.rs"]
mod crossings;

use rand_chacha::{ChaCha8Rng, rand_core::SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use vines_model::numerics::mean_square;
use vines_testbench::comparison::COMPARED_ABOVE;
use vines_testbench::experiment::{self, Plan};
use vines_testbench::identification::decay_points;
use vines_testbench::record::Record;
use vines_testbench::rig::{BuiltIn, Simulated};
use vines_testbench::scene::Scene;

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

/// RMS of the fit's sigma, above the fold, less the zero crossings of a clean decay.
fn rms(record: &Record, scene: &Scene, truth: &[[f64; 2]]) -> f64 {
    let points = decay_points(record, scene).points;
    let above = points.iter().filter(|point| point.c > COMPARED_ABOVE);
    let errors: Vec<f64> = above
        .filter_map(|point| Some(point.sigma - crossings::at(truth, point.tau)?))
        .collect();
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
    let truth = crossings::detunings(&clean, &scene);
    let [fit, noisy] = [&clean, &noisy(&clean)].map(|record| rms(record, &scene, &truth));
    println!("clean {fit:.1e}, at 40 dB {noisy:.1e}");
    assert!(fit <= 0.02 && noisy <= 0.04);
}

#[test]
fn the_zero_crossings_that_the_fit_is_compared_with_do_not_depend_on_the_sample_time() {
    let [(coarse, of_coarse), (fine, of_fine)] = [100, 400].map(record);
    let truth = crossings::detunings(&fine, &of_fine);
    let fitted = decay_points(&coarse, &of_coarse).points;
    let last = fitted.iter().rfind(|point| point.c > COMPARED_ABOVE).unwrap().tau;
    let points = crossings::detunings(&coarse, &of_coarse);
    let above = points.iter().filter(|[tau, _]| *tau < last);
    let errors: Vec<f64> = above
        .filter_map(|[tau, sigma]| Some(sigma - crossings::at(&truth, *tau)?))
        .collect();
    assert!(errors.len() > 10 && mean_square(errors).sqrt() <= 1e-4);
}
