//! How accurate is the fit of the free decay, over its window and noise, and do its uncertainties cover the error?
//!
//! One clean decay of the default plant, with noise of constant power relative to the held response. Bias and RMS error of sigma over the
//! points with C > 0.2, against the zero crossings of the clean decay; share of the points within 1.96 of their standard uncertainties
//! of the same fit without noise.
//!
//! ```sh
//! cargo run --release -p vines-testbench --example decay -- [SEEDS]    # of the noise, 20; writes validation/decay.csv
//! ```

mod common;

use common::{Failure, arguments, at, crossings, noisy, scene, share, write};
use vines_model::numerics::{mean, mean_square};
use vines_testbench::comparison::COMPARED_ABOVE;
use vines_testbench::experiment;
use vines_testbench::identification::decay_points;
use vines_testbench::rig::{BuiltIn, Simulated};

/// Windows of the fit, periods.
const WINDOWS: [f64; 7] = [1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 6.0];
/// Noise, dB.
const RATIOS: [f64; 4] = [f64::INFINITY, 60.0, 50.0, 40.0];

fn main() -> Result<(), Failure> {
    let seeds: u64 = arguments().first().map_or(Ok(20), |seeds| seeds.parse())?;
    let scene = scene("", &[""; 0])?;
    let mut rig = Simulated::new(scene.plant, scene.start)?;
    let mut controller = BuiltIn::new(&scene.controller_config())?;
    let clean = experiment::run(&mut rig, &mut controller, &scene, |_, _, _| {})?;
    let truth = crossings(&clean, &scene);
    let mut rows = Vec::new();
    for window in WINDOWS {
        let points = decay_points(&clean, &scene, window).points;
        let noiseless: Vec<[f64; 2]> = points.iter().map(|point| [point.tau, point.sigma]).collect();
        for ratio in RATIOS {
            let (mut errors, mut pulls) = (Vec::new(), Vec::new());
            for seed in 1..=if ratio.is_finite() { seeds } else { 1 } {
                let points = decay_points(&noisy(&clean, ratio, seed), &scene, window).points;
                for point in points.iter().filter(|point| point.c > COMPARED_ABOVE) {
                    errors.extend(at(&truth, point.tau).map(|exact| point.sigma - exact));
                    let noise = at(&noiseless, point.tau).map(|sigma| (point.sigma - sigma).abs());
                    pulls.extend(noise.map(|noise| noise / point.u_sigma));
                }
            }
            let (bias, rms) = (mean(errors.iter().copied()), mean_square(errors).sqrt());
            let covered = share(&pulls, 1.96);
            rows.push(format!("{window},{ratio},{bias:+.4},{rms:.4},{covered:.3}"));
        }
    }
    write("decay", "window_periods,snr_dB,bias,rms,within_1.96u", 2, &rows)
}
