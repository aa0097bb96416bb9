//! How far are tracked points from the truth, and from what they state, on rigs that are not the scene of the client?
//!
//! A rig is drawn (epsilon 0.001 to 0.02, lambda 0.7 to 2.5, r 0.5 to 0.8), and a scene that may differ from it. The backbone is tracked from
//! sensor readings alone, with the linear response that a loop check measures; the truth is the exact backbone of the rig: errors of sigma
//! and G at equal C of the settled points, over their standard uncertainties u, and periods a point.
//!
//! ```sh
//! cargo run --release -p vines-testbench --example off_scene -- RIGS SEED SNR SHIFT
//! ```
//!
//! SNR: dB, or none. SHIFT of the scene: none, or random. It writes validation/tracking.csv.

mod common;

use common::{Failure, Found, STATISTICS, arguments, is_kept, quantile, statistics, tracked, uniform, write};
use rayon::prelude::*;
use vines_model::Dimensionless;
use vines_testbench::comparison::ExactCurve;

fn main() -> Result<(), Failure> {
    let [count, seed, snr, shift] = &arguments()[..] else {
        return Err("arguments: RIGS SEED SNR|none none|random".into());
    };
    let mut uniform = uniform(seed.parse()?);
    let mut rigs = Vec::new();
    for _ in 0..count.parse::<usize>()? {
        let epsilon = uniform(1e-3_f64.ln(), 0.02_f64.ln()).exp();
        let (lambda, r) = (uniform(0.7, 2.5), uniform(0.5, 0.8));
        let noise = uniform(0.0, 1e6);
        let scales = [0.01, 0.3, 0.2, 0.1, 0.2].map(|range| uniform(-range, range));
        let scales = if shift == "none" { [0.0; 5] } else { scales };
        rigs.push(([epsilon, lambda, r], noise as u64, scales));
    }
    let one = |(rig, noise, scales): &([f64; 3], u64, [f64; 5])| {
        run(*rig, *noise, snr, *scales).unwrap_or_else(|error| {
            println!("{rig:.4?}: {error}");
            Found { counts: [0, 0, 1, 0], ..Found::default() }
        })
    };
    let (text, [points, settled, ended, _]) = statistics(&rigs.par_iter().map(one).collect::<Vec<_>>());
    let which = if shift == "none" { "the rig" } else { "another" };
    let row = format!("{count},{seed},{snr},{which},{points},{settled},{text},{ended}");
    let header = format!("rigs,seed,snr_dB,scene,points,settled,{STATISTICS},ended_early");
    write("tracking", &header, 4, &[row])
}

/// Counts the points, the settled ones, and whether tracking ended early.
fn run([epsilon, lambda, r]: [f64; 3], noise: u64, snr: &str, scales: [f64; 5]) -> Result<Found, Failure> {
    let curve = ExactCurve::of(&Dimensionless::new(epsilon, lambda, r, 0.0));
    let (tracked, scene) = tracked([epsilon, lambda, r], noise, snr, scales)?;
    let width = scene.plant.half_width;
    let own = scene.dimensionless();
    let (mut ratios, mut errors, mut settled) = (vec![], vec![], 0);
    for point in tracked.points.iter().filter(is_kept) {
        settled += 1;
        // In units of the rig.
        let (c, omega, e) = (point.at.c * width, own.omega(point.at.sigma), own.amplitude(point.at.g));
        let [sigma, g] = [(omega - 1.0) / epsilon, e / epsilon];
        let u_sigma = own.omega_change(point.at.u_sigma) / epsilon;
        let u_g = own.amplitude(point.at.u_g) / epsilon;
        if let Some([exact_sigma, exact_g]) = curve.at(c) {
            let [off_sigma, off_g] = [(sigma - exact_sigma).abs(), (g - exact_g).abs()];
            ratios.extend([off_sigma / u_sigma, off_g / u_g]);
            errors.push(off_sigma.max(off_g));
        }
    }
    let count = tracked.points.len();
    let why = tracked.ended.as_ref().map_or_else(String::new, ToString::to_string);
    let worst = quantile(&ratios, 1.0);
    println!("epsilon {epsilon:.4} lambda {lambda:.2} r {r:.2}: worst {worst:.1} u {why}");
    Ok(Found {
        ratios,
        errors,
        periods: (count > 0).then(|| tracked.periods / count as f64),
        counts: [count, settled, usize::from(tracked.ended.is_some()), 0],
    })
}
