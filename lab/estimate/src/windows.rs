//! Regimes: the mean force of short windows, and which of some hypotheses each of them belongs to.

use num_complex::Complex64;

use crate::interpolation::unwrapped;
use crate::periods::median;
use crate::record::Record;

/// What a few periods say of the force. Forces are relative to the phase of the response.
#[derive(Debug, Clone)]
pub struct Window {
    /// Numbers of its first period and of the period after its last one.
    pub periods: [usize; 2],
    /// Mean force, m of the base.
    pub force: Complex64,
    /// Variance of the mean force by noise, m² (mean square).
    pub variance: f64,
    /// Mean amplitude of the response, m.
    pub amplitude: f64,
    /// Growth of the logarithm of the amplitude in a period.
    pub rate: f64,
    /// Mean force at twice the frequency, m of the base.
    pub even: Complex64,
    /// Variance of the mean force at twice the frequency, m².
    pub even_variance: f64,
}

/// Fewest and most periods of a window.
const LENGTHS: [f64; 2] = [3.0, 12.0];

/// Windows just long enough that noise moves the mean force by at most `noise`, m, three to twelve periods long. A force that turns at the rate of
/// the response in the frame moves the envelope by a closed form, so that growth and detuning do not matter.
pub fn windows(record: &Record, noise: f64) -> Vec<Window> {
    let periods = &record.periods;
    let (omega0, pole) = (record.linear.omega0, record.linear.pole());
    let i = Complex64::i();
    let phases = unwrapped(periods.response.iter().map(|z| z.arg()));
    let force = |k: usize| {
        let duration = record.steps[k];
        let rate = (phases[k + 1] - phases[k]) / duration;
        let half = Complex64::cis(0.5 * rate * duration);
        let kept = record.transition(duration);
        let near = (i * rate - (pole - i * omega0)).inv();
        let gain =
            record.linear.gain() * (half - kept / half) * (near - (i * periods.omega[k + 1] - pole.conj()).inv());
        let middle = 0.5 * (periods.response[k] + periods.response[k + 1]);
        let turn = Complex64::cis(-middle.arg()) / (1.0 + rate / omega0).powi(record.power);
        let moved = record.departure[k + 1] - kept * record.departure[k];
        (
            moved / gain * turn,
            4.0 * periods.noise[k + 1] / gain.norm_sqr(),
            middle.norm(),
        )
    };
    let forces: Vec<(Complex64, f64, f64)> = (0..record.steps.len()).map(force).collect();
    let deviation = median(forces.iter().map(|one| one.1)).sqrt();
    let length = (deviation / noise).ceil().clamp(LENGTHS[0], LENGTHS[1]) as usize;
    let of = |n: usize| {
        let span = n * length..(n + 1) * length;
        let count = length as f64;
        let mean = |value: &dyn Fn(usize) -> f64| span.clone().map(value).sum::<f64>() / count;
        let [first, last] = [span.start, span.end].map(|k| periods.response[k].norm().ln());
        // A harmonic at twice the frequency takes three times a force: 1 - 2².
        let even: Complex64 = span.clone().map(|k| 3.0 * periods.second[k + 1]).sum();
        Window {
            periods: [span.start + 1, span.end + 1],
            force: span.clone().map(|k| forces[k].0).sum::<Complex64>() / count,
            variance: mean(&|k| forces[k].1) / (count * count) + 2.0 * mean(&|k| periods.base_noise[k + 1]) / count,
            amplitude: mean(&|k| forces[k].2),
            rate: (last - first) / count,
            even: even / count,
            even_variance: 18.0 * mean(&|k| periods.noise[k + 1]) / count,
        }
    };
    (0..forces.len() / length).map(of).collect()
}

/// Probability that the regime changes from a window to the next one.
const CHANGE: f64 = 0.02;

/// Probabilities of N regimes in each window, from the logarithms of their likelihoods: forward and backward (Rabiner, Proceedings of the IEEE 77,
/// 1989).
pub fn probabilities<const N: usize>(likelihoods: &[[f64; N]]) -> Vec<[f64; N]> {
    let normal = |one: [f64; N]| {
        let sum: f64 = one.iter().sum();
        one.map(|value| value / sum)
    };
    let weight = |one: &[f64; N]| {
        let largest = one.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        one.map(|value| (value - largest).exp())
    };
    let weights: Vec<[f64; N]> = likelihoods.iter().map(weight).collect();
    let to_others = CHANGE / (N - 1) as f64;
    let step = |one: &[f64; N]| {
        let sum: f64 = one.iter().sum();
        one.map(|value| value * (1.0 - CHANGE - to_others) + to_others * sum)
    };
    let times = |one: &[f64; N], other: &[f64; N]| std::array::from_fn(|i| one[i] * other[i]);
    let mut forward: Vec<[f64; N]> = Vec::new();
    for weight in &weights {
        forward.push(normal(
            forward.last().map_or(*weight, |before| times(weight, &step(before))),
        ));
    }
    let mut after = [1.0; N];
    let mut backward = Vec::new();
    for weight in weights.iter().rev() {
        backward.push(after);
        after = normal(step(&times(weight, &after)));
    }
    let both = forward.iter().zip(backward.iter().rev());
    both.map(|(one, other)| normal(times(one, other))).collect()
}
