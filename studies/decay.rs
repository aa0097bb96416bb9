//! How accurate is the fit of the free decay, over its window and noise, and do its uncertainties cover the error?
//!
//! One clean decay of the default plant, with noise of constant power relative to the held response. Bias and RMS error of sigma over the
//! points with C > 0.2, against the zero crossings of the clean decay; share of the points within 1.96 of their standard uncertainties
//! of the same fit without noise.
//!
//! Arguments: the number of SEEDS of the noise, 20 by default. Writes validation/decay.csv.

mod common;

use common::*;

/// Windows of the fit, periods.
const WINDOWS: [f64; 7] = [1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 6.0];
/// Noise, dB.
const RATIOS: [f64; 4] = [f64::INFINITY, 60.0, 50.0, 40.0];

fn main() -> Result<(), Failure> {
    let seeds: u64 = std::env::args().nth(1).map_or(Ok(20), |seeds| seeds.parse())?;
    let scene = scene("", &[""; 0])?;
    let clean = record(&mut Simulated::new(scene.plant, scene.start)?, &scene.plan())?;
    let truth = crossings(&clean, &scene);
    let mut rows = Vec::new();
    for window in WINDOWS {
        let points = decay_points(&clean, &scene.knowledge(), window).points;
        let noiseless: Vec<[f64; 2]> = points.iter().map(|point| [point.tau, point.sigma]).collect();
        for ratio in RATIOS {
            let (mut errors, mut pulls) = (Vec::new(), Vec::new());
            for seed in 1..=if ratio.is_finite() { seeds } else { 1 } {
                let points = decay_points(&noisy(&clean, ratio, seed), &scene.knowledge(), window).points;
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
