//! Do the curve of phase resonance and the parameters that are estimated from a record cover the truth?
//!
//! Records of random rigs: f0 2 to 80 Hz, epsilon 0.003 to 0.03, lambda 0.4 to 2.5, r 0.35 to 0.85, b 2 to 20 mm; a phase loop of the study, a base
//! whose amplitude is continuous, 100 samples a period, noise with a constant floor on both sensors, below a response of 0.4 b and the drive of the
//! largest level. The scene is wrong by up to 1 % in f0, 25 % in zeta, 15 % in epsilon, 10 % in b and 0.15 in r. Kinds: `levels`, `sweep`, `decay`
//! and their mixture `mix`; and `asymmetric`, levels from 1.1 to 0.7 times the amplitude at which the motion loses its symmetry.
//!
//! Errors over standard uncertainties, pooled over 25 amplitudes from 1.07 times the fold, or over the five parameters: root mean square, the bias
//! that is largest (of drive and frequency, or of a parameter), and the largest. `without`: records without a result. `rejected`: with p < 0.01.
//! `not_1to1`: share of the used periods in which the impacts of the rig do not alternate, one in each half of the period. `u_drive` over `b
//! epsilon`, `u_sigma`, and `u_r` over r: medians.
//!
//! Arguments: KIND, RIGS, SEED, SNR in dB. Writes validation/estimator.csv.

mod common;
mod recorder;

use std::time::Instant;

use common::*;
use recorder::*;
use std::f64::consts::TAU;
use vines_estimate::CubicSpline;
use vines_identify::{IdealRig, Identified, Samples, Signals, identify};
use vines_model::Sensor;

/// A rig, what is known of it, and the seed of its noise.
#[derive(Debug, Clone, Copy)]
struct Rig {
    truth: IdealRig,
    scene: IdealRig,
    seed: u64,
}

fn drawn(uniform: Uniform, n: usize) -> Rig {
    let mut logarithmic = |low: f64, high: f64| uniform(low.ln(), high.ln()).exp();
    let [f0, epsilon, b] = [[2.0, 80.0], [0.003, 0.03], [0.002, 0.02]].map(|[low, high]| logarithmic(low, high));
    let truth = IdealRig {
        f0,
        zeta: 0.5 * epsilon * uniform(0.4, 2.5),
        r: uniform(0.35, 0.85),
        b,
        epsilon,
    };
    let scene = IdealRig {
        f0: f0 * (1.0 + uniform(-0.01, 0.01)),
        zeta: truth.zeta * (1.0 + uniform(-0.25, 0.25)),
        r: (truth.r + uniform(-0.15, 0.15)).clamp(0.2, 0.95),
        b: b * (1.0 + uniform(-0.1, 0.1)),
        epsilon: epsilon * (1.0 + uniform(-0.15, 0.15)),
    };
    Rig { truth, scene, seed: uniform(0.0, 1e9) as u64 + n as u64 }
}

/// Errors over uncertainties of the curve, drive then frequency, and median uncertainties over `b epsilon` and epsilon.
fn of_curve(truth: &IdealRig, found: &Identified) -> Option<([Vec<f64>; 2], [f64; 2])> {
    let exact = truth.backbone(Sensor::Q1)?;
    let logarithms: Vec<f64> = exact.iter().map(|point| point[0].ln()).collect();
    let [low, high] = found.curve.basis.ends;
    let low = low.max(logarithms[0] + 1.07f64.ln());
    let high = high.min(logarithms[logarithms.len() - 1]);
    let amplitudes: Vec<f64> = (0..25)
        .map(|n| (low + (high - low) * f64::from(n) / 24.0).exp())
        .collect();
    let values = exact
        .iter()
        .map(|point| num_complex::Complex64::new(point[1], point[2]))
        .collect();
    let exact = CubicSpline::new(logarithms, values);
    let measured = found.curve.at(&amplitudes);
    let u = |n: usize| measured.covariance[(n, n)].sqrt();
    let at = |n: usize| exact.at(amplitudes[n].ln())[0];
    let drive = (0..25).map(|n| (measured.drive[n] - at(n).re) / u(n)).collect();
    let omega = (0..25).map(|n| (measured.omega[n] - at(n).im) / u(25 + n)).collect();
    let unit = truth.epsilon * truth.b;
    let [u_drive, u_omega] = [0, 25].map(|from| ends(&(from..from + 25).map(u).collect::<Vec<f64>>())[0]);
    (low < high).then_some((
        [drive, omega],
        [u_drive / unit, u_omega / (TAU * truth.f0 * truth.epsilon)],
    ))
}

/// What is found of a record.
struct Judged {
    curve: [Vec<f64>; 2],
    parameters: [f64; 5],
    /// Of drive, sigma and r.
    u: [f64; 3],
    rejected: bool,
    periods: [usize; 2],
}

fn judged(rig: &Rig, recorded: &Recorded) -> Option<Judged> {
    let signals = Signals::of_displacements([recorded.response.clone(), recorded.base.clone()], recorded.sample_time);
    let samples = Samples { signals, sensor: Sensor::Q1 };
    let found = identify(&samples, &rig.scene).ok()?;
    let (curve, [u_drive, u_sigma]) = of_curve(&rig.truth, &found)?;
    let (values, truth) = (found.scene.values(), rig.truth.values());
    let parameters = std::array::from_fn(|i| (values[i] - truth[i]) / found.uncertainty[i]);
    let used = found.time.iter().zip(&found.used).filter(|(_, used)| **used);
    let wrong = used
        .clone()
        .filter(|(t, _)| !recorded.is_one_to_one(**t, 1.0 / rig.truth.f0));
    let periods = [used.count(), wrong.count()];
    println!(
        "{:.3e} p {:.4} curve {:.2} {:.1} parameters {parameters:.1?} periods {periods:?} of {} passes {}{} lag {:.2}",
        rig.seed as f64,
        found.p(),
        mean_square(curve.concat()).sqrt(),
        curve.concat().iter().fold(0.0, |most: f64, one| most.max(one.abs())),
        found.used.len(),
        found.passes,
        if found.converged { "" } else { " (not converged)" },
        found.lag,
    );
    let u = [u_drive, u_sigma, found.uncertainty[2] / found.scene.r];
    Some(Judged { curve, parameters, u, rejected: found.p() < 0.01, periods })
}

/// Root mean square, largest bias of a group, and largest size.
fn pooled(groups: &[Vec<f64>]) -> String {
    let all = groups.concat();
    let bias = groups
        .iter()
        .map(|group| mean(group.iter().copied()).abs())
        .fold(0.0, f64::max);
    let worst = all.iter().fold(0.0, |most: f64, one| most.max(one.abs()));
    format!("{:.2},{bias:.2},{worst:.1}", mean_square(all.iter().copied()).sqrt())
}

fn main() -> Result<(), Failure> {
    let [kind, count, seed, snr] = &arguments(["levels|asymmetric|sweep|decay|mix", "RIGS", "SEED", "SNR"])?;
    let mut uniform = uniform(seed.parse()?);
    let rigs: Vec<Rig> = (0..count.parse()?).map(|n| drawn(&mut uniform, n)).collect();
    let noise: f64 = snr.parse()?;
    let one = |rig: &Rig| -> Result<_, Failure> {
        let levels = schedule(kind, &rig.truth)?;
        let IdealRig { f0, zeta, r, b, epsilon } = rig.truth;
        let mut plant = plant(parameters([f0, zeta, epsilon, r, b], Cavity::IDEAL), levels[0])?;
        let recorded = recorded(&mut plant, &rig.truth, &levels, [noise, rig.seed as f64])?;
        let begin = Instant::now();
        let judged = judged(rig, &recorded);
        if judged.is_none() {
            println!("no result: {rig:.4?}");
        }
        Ok((judged, begin.elapsed().as_secs_f64()))
    };
    let all = rigs.par_iter().map(one).collect::<Result<Vec<_>, _>>()?;
    let seconds: Vec<f64> = all.iter().map(|one| one.1).collect();
    let found: Vec<&Judged> = all.iter().filter_map(|one| one.0.as_ref()).collect();
    let curve = [0, 1].map(|n| found.iter().flat_map(|one| one.curve[n].clone()).collect::<Vec<f64>>());
    let parameters = [0, 1, 2, 3, 4].map(|n| found.iter().map(|one| one.parameters[n]).collect::<Vec<f64>>());
    let [u_drive, u_sigma, u_r] = [0, 1, 2].map(|n| ends(&found.iter().map(|one| one.u[n]).collect::<Vec<f64>>())[0]);
    let [used, wrong] = [0, 1].map(|n| found.iter().map(|one| one.periods[n]).sum::<usize>());
    let row = format!(
        "{kind},{snr},{seed},{count},{},{},{},{},{:.4},{u_drive:.1e},{u_sigma:.1e},{u_r:.1e},{:.1}",
        all.len() - found.len(),
        found.iter().filter(|one| one.rejected).count(),
        pooled(&curve),
        pooled(&parameters),
        wrong as f64 / used as f64,
        ends(&seconds)[0],
    );
    let header = "kind,snr_dB,seed,rigs,without,rejected,curve_rms,curve_bias,curve_worst,parameters_rms,parameters_bias,parameters_worst,\
        not_1to1,u_drive,u_sigma,u_r,median_s";
    write("estimator", header, 3, &[row])
}
