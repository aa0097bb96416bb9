//! How far are the parameters that a fit finds from the truth, from what they state, and from the best that the points allow?
//!
//! A rig is drawn (epsilon 0.002 to 0.03, lambda 0.4 to 2.5, r 0.4 to 0.9), and a client's scene that is wrong: r by 0.2, b by 10 %, m by 20 %,
//! c by 30 %, k by 1 %. The client tracks the backbone and fits f0, zeta, r, b and epsilon. For each: the share within 1.96 of the stated
//! standard uncertainty u, the largest error over u, and the root mean square of it, of the fits that are not rejected; and the numbers of fits
//! that leave points out, and of those that are rejected.
//!
//! ```sh
//! cargo run --release -p vines-testbench --example fit -- RIGS SEED SNR    # SNR: dB, or none; writes validation/fit.csv
//! ```

mod common;

use common::{Failure, arguments, is_kept, quantile, share, tracked, uniform, write};
use rayon::prelude::*;
use vines_model::numerics::mean_square;
use vines_testbench::fit::{Fit, Quantity, fit};

fn main() -> Result<(), Failure> {
    let [count, seed, snr] = &arguments()[..] else {
        return Err("arguments: RIGS SEED SNR|none".into());
    };
    let mut uniform = uniform(seed.parse()?);
    let mut rigs = Vec::new();
    for _ in 0..count.parse::<usize>()? {
        let epsilon = uniform(2e-3_f64.ln(), 0.03_f64.ln()).exp();
        let (lambda, r) = (uniform(0.4, 2.5), uniform(0.4, 0.9));
        let noise = uniform(0.0, 1e6);
        let [k, c, m, b] = [0.01, 0.3, 0.2, 0.1].map(|range| uniform(-range, range));
        let wrong_r = (r + uniform(-0.2, 0.2)).clamp(0.2, 0.98);
        rigs.push(([epsilon, lambda, r], noise as u64, [k, c, m, b, wrong_r / r - 1.0]));
    }
    let fits: Vec<_> = rigs
        .par_iter()
        .map(|(rig, noise, scales)| {
            fitted(*rig, *noise, snr, *scales)
                .inspect_err(|error| println!("{rig:.4?}: {error}"))
                .ok()
        })
        .collect();
    let mut rows = Vec::new();
    for (n, quantity) in Quantity::ALL[..5].iter().enumerate() {
        let ratios: Vec<f64> = fits
            .iter()
            .flatten()
            .filter(|(_, fit)| !fit.is_rejected())
            .map(|(ratios, _)| ratios[n])
            .collect();
        let text = format!(
            "{:.3},{:.1},{:.2}",
            share(&ratios, 1.96),
            quantile(&ratios, 1.0),
            mean_square(ratios.iter().copied()).sqrt()
        );
        let rejected = fits.iter().flatten().filter(|(_, fit)| fit.is_rejected()).count();
        rows.push(format!(
            "{snr},{quantity},{count},{seed},{},{text},{rejected}",
            ratios.len()
        ));
    }
    write(
        "fit",
        "snr_dB,parameter,rigs,seed,fitted,within_1.96u,largest_u,rms_u,points_left_out,rejected",
        2,
        &rows,
    )
}

/// Errors of the five parameters over their standard uncertainties, and the fit.
fn fitted(rig: [f64; 3], noise: u64, snr: &str, scales: [f64; 5]) -> Result<([f64; 5], Fit), Failure> {
    let [epsilon, lambda, r] = rig;
    let (tracked, scene) = tracked(rig, noise, snr, scales)?;
    let points: Vec<_> = tracked
        .points
        .iter()
        .filter(is_kept)
        .map(|point| (&point.at).into())
        .collect();
    let fit = fit(&points, scene.resonance, &scene.plant, &[])?;
    let truth = [1.0 / std::f64::consts::TAU, 0.5 * epsilon * lambda, r, 1.0, epsilon];
    let ratios = [0, 1, 2, 3, 4].map(|n| {
        let estimate = fit.estimate(Quantity::ALL[n]).expect("a fitted parameter");
        (estimate.value - truth[n]).abs() / estimate.uncertainty
    });
    let worst = ratios.iter().copied().fold(0.0, f64::max);
    println!(
        "{rig:.4?} {} of {} points: worst {worst:.1} u {ratios:.1?}, chi-square {:.1} of {}, r {:.5?}",
        fit.residuals.len(),
        points.len(),
        fit.chi_square,
        fit.degrees,
        fit.estimate(Quantity::R)
    );
    Ok((ratios, fit))
}
