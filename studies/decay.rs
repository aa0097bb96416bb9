//! How accurate are the estimators of the free decay, over their window and noise, and do their uncertainties cover the error?
//!
//! One clean decay of the default plant, with noise of constant power relative to the held response. Bias and RMS error of sigma over the
//! points with C > 0.2, against the zero crossings of the clean decay; share of the points within 1.96 of their standard uncertainties
//! of the same estimator without noise.
//!
//! ```sh
//! cargo run --release -p vines-testbench --example decay -- [SEEDS]    # of the noise, 20; writes validation/decay.csv
//! ```

mod common;

use common::{Failure, arguments, scene, share, write};
use rand_chacha::{ChaCha8Rng, rand_core::SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use vines_model::numerics::{mean, mean_square};
use vines_testbench::comparison::COMPARED_ABOVE;
use vines_testbench::experiment::{self, Plan};
use vines_testbench::identification::{DecayPoint, decay_points};
use vines_testbench::record::Record;
use vines_testbench::rig::{BuiltIn, Simulated};
use vines_testbench::scene::Estimator;

/// Windows of the fit, periods.
const WINDOWS: [f64; 7] = [1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 6.0];
/// Noise, dB.
const RATIOS: [f64; 4] = [f64::INFINITY, 60.0, 50.0, 40.0];

/// Sigma of some points at a time, interpolated linearly.
fn sigma(points: &[DecayPoint], tau: f64) -> Option<f64> {
    let after = points.partition_point(|one| one.tau < tau);
    let (from, to) = (points.get(after.checked_sub(1)?)?, points.get(after)?);
    Some(from.sigma + (tau - from.tau) / (to.tau - from.tau) * (to.sigma - from.sigma))
}

fn noisy(record: &Record, ratio: f64, seed: u64) -> Record {
    let mut noisy = record.clone();
    let power = mean_square(record.hold().iter().map(|sample| sample.sensors.response));
    let deviation = power.sqrt() * 10_f64.powf(-ratio / 20.0);
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    for sample in &mut noisy.samples[record.released..] {
        let normal: f64 = StandardNormal.sample(&mut random);
        sample.sensors.response += deviation * normal;
    }
    noisy
}

fn main() -> Result<(), Failure> {
    let seeds: u64 = arguments().first().map_or(Ok(20), |seeds| seeds.parse())?;
    let mut scene = scene("", &[""; 0])?;
    let mut rig = Simulated::new(scene.plant, scene.start)?;
    let mut controller = BuiltIn::new(&scene.controller_config())?;
    let clean = experiment::run(&mut rig, &mut controller, &Plan::of(&scene), |_, _, _| {})?;
    scene.record.estimator = Estimator::Crossings;
    let truth = decay_points(&clean, &scene).points;
    let fits = WINDOWS.map(|window| ("fit", Estimator::Fit, window));
    let mut rows = Vec::new();
    for (name, estimator, window) in fits.into_iter().chain([("crossings", Estimator::Crossings, 1.0)]) {
        (scene.record.estimator, scene.record.window_periods) = (estimator, window);
        let alike = decay_points(&clean, &scene).points;
        for ratio in RATIOS {
            let (mut errors, mut pulls) = (Vec::new(), Vec::new());
            for seed in 1..=if ratio.is_finite() { seeds } else { 1 } {
                let points = decay_points(&noisy(&clean, ratio, seed), &scene).points;
                for point in points.iter().filter(|point| point.c > COMPARED_ABOVE) {
                    errors.extend(sigma(&truth, point.tau).map(|exact| point.sigma - exact));
                    pulls.extend(sigma(&alike, point.tau).map(|alike| (point.sigma - alike).abs() / point.u_sigma));
                }
            }
            let (bias, rms) = (mean(errors.iter().copied()), mean_square(errors).sqrt());
            let covered = share(&pulls, 1.96);
            rows.push(format!("{name},{window},{ratio},{bias:+.4},{rms:.4},{covered:.3}"));
        }
    }
    write(
        "decay",
        "estimator,window_periods,snr_dB,bias,rms,within_1.96u",
        3,
        &rows,
    )
}
