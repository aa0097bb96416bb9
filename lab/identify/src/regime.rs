//! Which motion each window of a record belongs to, by likelihood.

use nalgebra::{Matrix3, Vector3};
use num_complex::Complex64;
use statrs::distribution::{Continuous, ContinuousCDF, Normal};
use vines_estimate::{Record, Window, probabilities, windows};
use vines_model::Sensor;

use crate::ideal_rig::IdealRig;
use crate::particle::Particle;

/// Noise of the mean force of a window over the scale of the force: how long the windows are.
pub const RESOLUTION: f64 = 0.05;
/// What is expected of a force, over the scale of the forces: the harmonics of the host and the scene move it by less.
const LARGEST: f64 = 1.2;
/// Logarithm of the likelihood of a motion that does not exist.
const NEVER: f64 = -1e4;
/// Error of the growth's first order, over its size.
const SECOND_ORDER: f64 = 0.3;

/// Logarithms of the likelihoods of the motions in a window: [`MOTIONS`], and asymmetric 1:1 impacts.
pub type Likelihoods = [f64; 5];

/// Symmetric 1:1 impacts, the particle free, the particle carried, any other motion, among them asymmetric 1:1 impacts.
pub const MOTIONS: [&str; 4] = ["1:1", "free", "carried", "other"];

/// What is expected of the forces.
#[derive(Debug, Clone, Copy)]
pub struct Expected {
    /// The particle.
    pub particle: Particle,
    /// Force per amplitude by errors of frequency and damping.
    pub host: Complex64,
    /// Tolerance of a force over the scale. One for all motions: none may win by being narrower.
    pub tolerance: f64,
    /// Scale of the forces, m.
    pub scale: f64,
    /// Standard uncertainty of the amplitude at which the motion loses its symmetry, relative: that of the half-width.
    pub u_loss: f64,
}

impl Expected {
    /// Of a window. "Other" is any force of the size of the particle's, even harmonics as well.
    pub fn likelihoods(&self, window: &Window) -> Likelihoods {
        let steady = self.particle.steady_motion(window.amplitude);
        let (slope, rate, length) = (
            steady.slope,
            window.rate,
            (window.periods[1] - window.periods[0]) as f64,
        );
        let moved = (slope * rate).norm() * (steady.lag.norm() + length / 4.0);
        let (near, far) = ((self.tolerance * self.scale).powi(2), (LARGEST * self.scale).powi(2));
        let normal = |error: Complex64, variance: f64| -error.norm_sqr() / variance - variance.ln();
        let force = window.force - self.host * window.amplitude;
        let with = |mean: Complex64, variance: f64| normal(force - mean, window.variance + variance);
        let even = |variance: f64| normal(window.even, window.even_variance + variance);
        let (symmetric, any) = (even(near / 4.0), even(far));
        let [lost, beyond] = self.asymmetric(window.amplitude);
        let asymmetric = even(near / 4.0 + far * beyond) + lost.ln();
        let impacts = with(
            steady.force - steady.lag * slope * rate,
            near + (SECOND_ORDER * moved).powi(2),
        );
        let of_impacts = |even: f64| if steady.exists { impacts + even } else { NEVER };
        [
            of_impacts(symmetric + (1.0 - lost).ln()),
            with(Complex64::ZERO, near) + symmetric,
            with((self.particle.epsilon * window.amplitude).into(), near) + symmetric,
            with(Complex64::ZERO, far) + any,
            of_impacts(asymmetric),
        ]
    }

    /// Probability that 1:1 motion of an amplitude, m, has lost its symmetry, and by how much the amplitude is beyond the loss then, relative, on average.
    /// The asymmetry grows with the root of this, as at every pitchfork.
    fn asymmetric(&self, amplitude: f64) -> [f64; 2] {
        let (u, below) = (self.u_loss, (self.particle.symmetry_breaking() / amplitude).ln());
        let normal = Normal::standard();
        let probability = normal.sf(below / u).max(f64::MIN_POSITIVE);
        // Far below the loss both tails are rounding.
        [probability, (u * normal.pdf(below / u) / probability - below).max(0.0)]
    }
}

/// Logarithm of the sum of the likelihoods.
fn evidence(likelihoods: &Likelihoods) -> f64 {
    let largest = likelihoods.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    largest + likelihoods.iter().map(|one| (one - largest).exp()).sum::<f64>().ln()
}

/// Half the number of grid steps of a parameter, over two standard uncertainties of the scene.
const GRID: i32 = 6;
/// Rounds of regimes and parameters; in the first two all windows are 1:1, because a free particle on another frequency explains any hold.
const MIXTURE_ROUNDS: usize = 10;
const ALL_IMPACTS: usize = 2;

/// A scene that fits the mixture of the motions: r and b on a grid, the rest by linear least squares, weighted by the motions' probabilities.
pub fn rough_scene(record: &Record, scene: &IdealRig, sensor: Sensor) -> IdealRig {
    let scale = scene.epsilon * scene.b;
    let windows = windows(record, RESOLUTION * scale);
    let u = IdealRig::UNCERTAINTY;
    let steps = || (-GRID..=GRID).map(|n| 2.0 * f64::from(n) / f64::from(GRID));
    let mut best = (f64::INFINITY, *scene);
    for r in steps().map(|step| (scene.r + u[2] * step).clamp(0.1, 0.95)) {
        for b in steps().map(|step| scene.b * (u[3] * step).exp()) {
            let (cost, [epsilon, frequency, damping]) = mixture(&windows, scene, [r, b], sensor);
            let cost =
                cost + (r - scene.r).powi(2) / (2.0 * u[2] * u[2]) + (b / scene.b).ln().powi(2) / (2.0 * u[3] * u[3]);
            if cost < best.0 {
                let f0 = scene.f0 * (1.0 - 0.5 * frequency);
                let zeta = (scene.zeta - 0.5 * damping).max(scene.zeta / 5.0);
                best = (cost, IdealRig { f0, zeta, r, b, epsilon });
            }
        }
    }
    best.1
}

/// Cost, epsilon, and the force per amplitude by errors of frequency and damping, of windows with given r and b.
fn mixture(windows: &[Window], scene: &IdealRig, [r, b]: [f64; 2], sensor: Sensor) -> (f64, [f64; 3]) {
    let u = IdealRig::UNCERTAINTY;
    let scale = scene.epsilon * scene.b;
    let prior = [u[4] * scene.epsilon, 2.0 * u[0], 2.0 * u[1] * scene.zeta].map(|one| 1.0 / (2.0 * one * one));
    let unit = Particle::ideal([1.0, b, r], sensor);
    let steady: Vec<_> = windows
        .iter()
        .map(|window| unit.steady_motion(window.amplitude))
        .collect();
    let mut weights: Vec<[f64; 2]> = steady
        .iter()
        .map(|one| [if one.exists { 1.0 } else { 1e-9 }, 0.0])
        .collect();
    let mut found = Vector3::new(scene.epsilon, 0.0, 0.0);
    let mut cost = f64::INFINITY;
    for round in 0..MIXTURE_ROUNDS {
        let mut normal = Matrix3::from_diagonal(&Vector3::from(prior));
        let mut right = Vector3::new(scene.epsilon * prior[0], 0.0, 0.0);
        for ((window, steady), weight) in windows.iter().zip(&steady).zip(&weights) {
            for (force, weight) in [steady.force, Complex64::ZERO].into_iter().zip(weight) {
                let weight = weight / (window.variance + (RESOLUTION * scale).powi(2));
                let a = window.amplitude;
                for (component, value) in [(force.re, window.force.re), (force.im, window.force.im)]
                    .iter()
                    .enumerate()
                {
                    let row = Vector3::new(
                        value.0,
                        if component == 0 { a } else { 0.0 },
                        if component == 1 { a } else { 0.0 },
                    );
                    normal += row * row.transpose() * weight;
                    right += row * (value.1 * weight);
                }
            }
        }
        let Some(solution) = normal.lu().solve(&right) else {
            break;
        };
        found = solution;
        found[0] = found[0].max(scene.epsilon / 3.0);
        let particle = Particle::ideal([found[0], b, r], sensor);
        let expected = Expected {
            particle,
            host: Complex64::new(found[1], found[2]),
            tolerance: TOLERANCES[0],
            scale,
            // The half-widths that are tried are so far apart.
            u_loss: 2.0 * u[3] / f64::from(GRID),
        };
        let all: Vec<Likelihoods> = windows.iter().map(|window| expected.likelihoods(window)).collect();
        let change = found - Vector3::new(scene.epsilon, 0.0, 0.0);
        cost = -all.iter().map(evidence).sum::<f64>() + change.component_mul(&change).dot(&Vector3::from(prior));
        if round >= ALL_IMPACTS {
            let probability = |one: &Likelihoods| [one[0], one[1]].map(|likelihood| (likelihood - evidence(one)).exp());
            weights = all.iter().map(probability).collect();
        }
    }
    (cost, found.into())
}

/// Tolerances of a force over the scale: with the rough scene, and with that of a fit.
pub const TOLERANCES: [f64; 2] = [0.1, 0.05];
/// What is left of a deviation of the particle, which falls by r in half a period, after half of the periods in which it settles: 1e-3 at their end.
const TRANSIENT: f64 = 0.03;
/// Probability of symmetric 1:1 motion above which a window counts: to leave out one of these costs a little information, to count one of another motion
/// makes a bias.
const COUNTS: f64 = 0.95;
/// Periods that a window may be late.
const LATE: usize = 3;

/// The periods of symmetric 1:1 motion, after the particle has settled, and the most probable motion of each window.
pub fn one_to_one(record: &Record, expected: &Expected) -> (Vec<bool>, Vec<(Window, usize)>) {
    let windows = windows(record, RESOLUTION * expected.scale);
    let likelihoods: Vec<Likelihoods> = windows.iter().map(|window| expected.likelihoods(window)).collect();
    let probabilities = probabilities(&likelihoods);
    let mut used = vec![false; record.periods.time.len()];
    let mut motions = Vec::new();
    for (window, probability) in windows.into_iter().zip(&probabilities) {
        let [from, to] = window.periods;
        used[from..to].fill(probability[0] > COUNTS);
        let other = MOTIONS.len() - 1;
        let most = (0..probability.len()).max_by(|i, j| probability[*i].total_cmp(&probability[*j]));
        motions.push((window, most.map_or(other, |most| most.min(other))));
    }
    // A deviation of the particle falls by r in half a period.
    let settling = (TRANSIENT.ln() / expected.particle.r.ln()) as usize + LATE;
    let begins: Vec<usize> = (1..used.len()).filter(|k| used[*k] && !used[k - 1]).collect();
    for begin in begins {
        let end = (begin + settling).min(used.len());
        used[begin..end].fill(false);
    }
    (used, motions)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_window_of_any_amplitude_has_likelihoods() {
        for r in [0.1, 0.65, 0.95, 0.99] {
            let particle = Particle::ideal([0.01, 0.01, r], Sensor::Q1);
            let expected = Expected {
                particle,
                host: Complex64::ZERO,
                tolerance: TOLERANCES[1],
                scale: 1e-4,
                u_loss: IdealRig::UNCERTAINTY[3],
            };
            for amplitude in [0.0, 1e-5, 1.01 * particle.fold(), 1e-3, 7e-3, 8e-3, 0.1] {
                let window = Window {
                    periods: [1, 4],
                    force: Complex64::ZERO,
                    variance: 1e-14,
                    amplitude,
                    rate: 0.0,
                    even: Complex64::new(1e-5, 0.0),
                    even_variance: 1e-14,
                };
                let found = expected.likelihoods(&window);
                assert!(!found.iter().any(|one| one.is_nan()), "{r}, {amplitude}: {found:?}");
            }
        }
    }
}
