//! The peak of the response from points at several phases.
//!
//! Along a frequency response, at a constant drive, the amplitude is largest where at constant amplitude the drive is smallest: both are
//! the point at which the curves of constant drive and of constant amplitude touch. The loop therefore holds each level at several phases
//! about resonance. The balances of amplitude and phase convert each point to the drive and the detuning of resonance, which hardly depend on
//! the phase x from resonance, so that a parabola in x describes them. The drive at the phase x is `E(x)/cos x`; its minimum is the peak.

use super::point::{Held, Known};
use super::track::extrapolated;
use vines_model::numerics::{Estimate, mean};

/// Phases from resonance at which every level is held, rad.
pub const PHASES: [f64; 3] = [-0.25, 0.0, 0.25];

/// Largest error of the drives, m, for an error `omega`, rad/s, of the peak which follows from them, at the response `response`, m: the phase of
/// the peak is the slope of the drive over the phase, and the frequency changes by `omega0 E/(2 A)` with it.
pub fn drive_for(omega: f64, response: f64, omega0: f64) -> f64 {
    (PHASES[2] - PHASES[0]) * std::f64::consts::SQRT_2 * response * omega / omega0
}

/// Drive, m, and frequency, rad/s, that hold the resonance `known` at the phase `x`, rad, from it.
pub fn at_phase(known: &Known, x: f64, omega0: f64) -> [f64; 2] {
    let drive = known.drive / x.cos();
    let gain = 0.5 * omega0 * omega0 / known.omega;
    [drive, known.omega - gain * drive / known.response * x.sin()]
}

/// The peaks at the levels at which all phases were held: `scans` has the points of each phase, level by level.
pub fn peaks(scans: &[Vec<Held>], omega0: f64) -> Vec<Held> {
    let levels = scans.iter().map(Vec::len).min().unwrap_or(0);
    (0..levels)
        .map(|level| {
            let response = mean(scans.iter().map(|scan| scan[level].response.value));
            let points: Vec<Held> = scans.iter().map(|scan| at_level(scan, level, response)).collect();
            peak(&points, omega0)
        })
        .collect()
}

/// A point corrected to the amplitude `response`, m, by the parabola through its neighbours in the same scan.
fn at_level(scan: &[Held], level: usize, response: f64) -> Held {
    let first = level.saturating_sub(1).min(scan.len().saturating_sub(3));
    let usable = |n: &usize| *n != level && scan[*n].settled && scan[*n].reached;
    let others = (first..scan.len().min(first + 3)).filter(usable);
    // The nearest is the last but one, the last is the one that is corrected.
    let mut order: Vec<usize> = others.collect();
    order.sort_by_key(|n| std::cmp::Reverse(n.abs_diff(level)));
    let known: Vec<Known> = order
        .into_iter()
        .chain([level])
        .filter_map(|n| scan[n].known())
        .collect();
    let own = scan[level];
    // The polynomial through all of them, and the one of a lower degree, less the value of the last.
    let change = |known: &[Known]| {
        extrapolated(known, response).map_or([0.0; 2], |there| {
            [there.drive - own.drive.value, there.omega - own.omega.value]
        })
    };
    let (change, simpler) = (change(&known), change(&known[1.min(known.len().saturating_sub(1))..]));
    let [drive, omega] = [0, 1].map(|i| {
        let one = [own.drive, own.omega][i];
        Estimate::new(one.value + change[i], &[one.uncertainty, change[i] - simpler[i]])
    });
    let response = Estimate { value: response, ..own.response };
    Held { response, drive, omega, ..own }
}

fn peak(points: &[Held], omega0: f64) -> Held {
    let phases: Vec<f64> = points.iter().map(|one| one.phase_error.value).collect();
    let sum = |weights: &[f64], value: &dyn Fn(usize) -> f64| -> f64 {
        weights.iter().enumerate().map(|(n, weight)| weight * value(n)).sum()
    };
    let size = |weights: &[f64], value: &dyn Fn(usize) -> f64| {
        let squares = weights
            .iter()
            .enumerate()
            .map(|(n, weight)| (weight * value(n)).powi(2));
        squares.sum::<f64>().sqrt()
    };
    let [drive_at, omega_at] = [
        &|n: usize| points[n].drive.value,
        &(|n: usize| points[n].omega.value) as &dyn Fn(usize) -> f64,
    ];
    let mut x = 0.0_f64;
    for _ in 0..ROUNDS {
        let [values, slopes] = parabola(&phases, x);
        x = -(sum(&slopes, drive_at) / sum(&values, drive_at)).atan();
    }
    let [values, slopes] = parabola(&phases, x);
    let resonance = Known {
        response: points[0].response.value,
        drive: sum(&values, drive_at),
        omega: sum(&values, omega_at),
    };
    let [drive, omega] = at_phase(&resonance, x, omega0);
    // A cubic term is neglected: smaller than the quadratic one by about the distance of the phases.
    let neglected = |value: &dyn Fn(usize) -> f64| (PHASES[2] * (value(0) - 2.0 * value(1) + value(2))).abs();
    let [by_drive, by_omega] = [neglected(drive_at), neglected(omega_at)];
    let u_drive = |n: usize| points[n].drive.uncertainty;
    let u_phase = size(&slopes, &u_drive).hypot(by_drive / PHASES[2]) / resonance.drive;
    let u_response = size(&vec![1.0 / points.len() as f64; points.len()], &|n| {
        points[n].response.uncertainty
    });
    let turned = u_phase * 0.5 * omega0 * drive / resonance.response;
    Held {
        response: Estimate { value: resonance.response, uncertainty: u_response },
        drive: Estimate::new(drive, &[size(&values, &u_drive), by_drive]),
        omega: Estimate::new(
            omega,
            &[size(&values, &|n| points[n].omega.uncertainty), by_omega, turned],
        ),
        phase_error: Estimate { value: x, uncertainty: u_phase },
        periods: points.iter().map(|one| one.periods).sum(),
        averaged: points.iter().map(|one| one.averaged).sum(),
        settled: points.iter().all(|one| one.settled),
        reached: points.iter().all(|one| one.reached),
        ..points[points.len() / 2]
    }
}

/// Rounds of the fixed-point iteration, each of which gains a factor of the order of epsilon.
const ROUNDS: usize = 12;

/// Weights of the values at the places `at` in the parabola through them: of its value and of its slope at `x`.
fn parabola(at: &[f64], x: f64) -> [Vec<f64>; 2] {
    let weights = |n: usize| {
        let others: Vec<f64> = at
            .iter()
            .enumerate()
            .filter(|(m, _)| *m != n)
            .map(|(_, one)| *one)
            .collect();
        let scale: f64 = others.iter().map(|one| at[n] - one).product();
        let value: f64 = others.iter().map(|one| x - one).product();
        let slope: f64 = (0..others.len())
            .map(|m| {
                others
                    .iter()
                    .enumerate()
                    .filter(|(k, _)| *k != m)
                    .map(|(_, one)| x - one)
                    .product::<f64>()
            })
            .sum();
        [value / scale, slope / scale]
    };
    [0, 1].map(|which| (0..at.len()).map(|n| weights(n)[which]).collect())
}

#[cfg(test)]
#[path = "../../tests/unit/peak.rs"]
mod tests;
