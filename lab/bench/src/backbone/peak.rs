//! The peak of the response from points at several phases.
//!
//! Along a frequency response, at constant G, the amplitude is largest where at constant amplitude the drive is smallest: both are
//! the point at which the curves of constant G and of constant C touch. The loop therefore holds each level at several phases
//! about resonance. The balances of amplitude and phase convert each point to the drive and the detuning of resonance, which hardly depend on
//! the phase x from resonance, so that a parabola in x describes them. The drive at the phase x is `G(x)/cos x`; its minimum is the peak.

use super::point::{Known, Point};
use super::track::extrapolated;
use vines_model::{Dimensionless, numerics::mean};

/// Phases from resonance at which every level is held, rad.
pub const PHASES: [f64; 3] = [-0.25, 0.0, 0.25];

/// Error of the drives at the level `c` over that of sigma at the peak which follows from them: the phase of the peak is the slope of the
/// drive over the phase, and sigma changes by G/(2 C) with it.
pub fn share_of_drive(c: f64) -> f64 {
    (c * (PHASES[2] - PHASES[0]) * std::f64::consts::SQRT_2).min(1.0)
}

/// Drive and detuning that hold the resonance `(C, G, sigma)` at the phase `x`, rad, from it.
pub fn at_phase(known: &Known, x: f64, epsilon: f64) -> [f64; 2] {
    let g = known.g / x.cos();
    let omega = 1.0 + epsilon * known.sigma;
    [g, known.sigma - g * x.sin() / (2.0 * known.c * omega)]
}

/// The peaks at the levels at which all phases were held: `scans` has the points of each phase, level by level.
pub fn peaks(scans: &[Vec<Point>], scene: &Dimensionless) -> Vec<Point> {
    let levels = scans.iter().map(Vec::len).min().unwrap_or(0);
    (0..levels)
        .map(|level| {
            let c = mean(scans.iter().map(|scan| scan[level].c));
            let points: Vec<Point> = scans.iter().map(|scan| at_level(scan, level, c)).collect();
            peak(&points, scene.epsilon)
        })
        .collect()
}

/// A point corrected to the amplitude `c`, by the parabola through its neighbours in the same scan.
fn at_level(scan: &[Point], level: usize, c: f64) -> Point {
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
    let change =
        |known: &[Known]| extrapolated(known, c).map_or([0.0; 2], |there| [there.g - own.g, there.sigma - own.sigma]);
    let (change, simpler) = (change(&known), change(&known[1.min(known.len().saturating_sub(1))..]));
    Point {
        c,
        g: own.g + change[0],
        sigma: own.sigma + change[1],
        u_g: own.u_g.hypot(change[0] - simpler[0]),
        u_sigma: own.u_sigma.hypot(change[1] - simpler[1]),
        ..own
    }
}

fn peak(points: &[Point], epsilon: f64) -> Point {
    let phases: Vec<f64> = points.iter().map(|one| one.phase_error_deg.to_radians()).collect();
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
    let mut x = 0.0_f64;
    for _ in 0..ROUNDS {
        let [values, slopes] = parabola(&phases, x);
        x = -(sum(&slopes, &|n| points[n].g) / sum(&values, &|n| points[n].g)).atan();
    }
    let [values, slopes] = parabola(&phases, x);
    let resonance = Known {
        c: points[0].c,
        g: sum(&values, &|n| points[n].g),
        sigma: sum(&values, &|n| points[n].sigma),
    };
    let [g, sigma] = at_phase(&resonance, x, epsilon);
    // A cubic term is neglected: smaller than the quadratic one by about the distance of the phases.
    let neglected = |value: &dyn Fn(usize) -> f64| (PHASES[2] * (value(0) - 2.0 * value(1) + value(2))).abs();
    let [by_g, by_sigma] = [neglected(&|n| points[n].g), neglected(&|n| points[n].sigma)];
    let u_phase = size(&slopes, &|n| points[n].u_g).hypot(by_g / PHASES[2]) / resonance.g;
    let centre = points[points.len() / 2];
    Point {
        c: resonance.c,
        sigma,
        g,
        phase_error_deg: x.to_degrees(),
        u_c: size(&vec![1.0 / points.len() as f64; points.len()], &|n| points[n].u_c),
        u_sigma: size(&values, &|n| points[n].u_sigma)
            .hypot(by_sigma)
            .hypot(u_phase * g / (2.0 * resonance.c)),
        u_g: size(&values, &|n| points[n].u_g).hypot(by_g),
        u_phase_deg: u_phase.to_degrees(),
        periods: points.iter().map(|one| one.periods).sum(),
        averaged: points.iter().map(|one| one.averaged).sum(),
        settled: points.iter().all(|one| one.settled),
        reached: points.iter().all(|one| one.reached),
        ..centre
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
