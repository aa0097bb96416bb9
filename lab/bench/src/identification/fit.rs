//! Least squares of a harmonic whose amplitude and phase drift linearly across the window.

use nalgebra::DVector;
use vines_model::numerics::HarmonicBasis;

/// A harmonic fitted to a window of samples; everything holds at the middle of the window.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Harmonic {
    /// Amplitude of the fundamental, in the unit of the samples.
    pub amplitude: f64,
    /// Phase of the fundamental, rad: the samples are `amplitude sin(phase)` there.
    pub phase: f64,
    /// Angular frequency, rad/s.
    pub omega: f64,
    /// Rate of change of the amplitude, 1/s times its unit.
    pub rate: f64,
    /// Standard uncertainties of amplitude and frequency by the noise of the samples.
    pub uncertainties: [f64; 2],
}

/// Rounds of refitting about the frequency found; each reduces the error by orders of magnitude.
const ROUNDS: usize = 6;
/// Fewest samples of a window.
const FEWEST: usize = 16;
/// Largest relative distance of the frequency from the guess: beyond that, the rounds diverge.
const FARTHEST: f64 = 0.5;

/// Fits `values`, sampled every `sample_time` seconds, by a fundamental near `omega` (rad/s) and its third harmonic, both
/// with linear drift, and a constant.
///
/// The drift of the fitted phase corrects the frequency, and the fit is repeated about that. `None` for a window that is too
/// short or contains no motion of about that frequency.
pub fn harmonic(values: &[f64], sample_time: f64, omega: f64) -> Option<Harmonic> {
    if values.len() < FEWEST {
        return None;
    }
    let middle = 0.5 * (values.len() - 1) as f64;
    let right = DVector::from_column_slice(values);
    // Half a window, s.
    let half = middle * sample_time;
    let (guess, mut omega, mut last) = (omega, omega, None);
    for _ in 0..ROUNDS {
        let phases: Vec<f64> = (0..values.len())
            .map(|n| (n as f64 - middle) * sample_time * omega)
            .collect();
        let basis = HarmonicBasis::new(&phases, 0, &[Some(2), None, Some(1)]);
        let fit = basis.fit(&right)?;
        let a = fit.harmonic(1);
        let square = a.norm_sqr();
        if square == 0.0 || !square.is_finite() {
            return None;
        }
        // The phase of a turns by Im(drift/a) per half window.
        let change = fit.drift(1) * a.conj() / half;
        omega += change.im / square;
        if (omega / guess - 1.0).abs() > FARTHEST {
            return None;
        }
        last = Some((basis, fit, a, change.re));
    }
    let (basis, fit, a, growth) = last?;
    let amplitude = a.norm_sqr().sqrt();
    let degrees = (values.len() - basis.terms()) as f64;
    let noise = (basis.residual(&right, &fit).norm_squared() / degrees).sqrt();
    let largest = |degree: usize| basis.variances(1, degree).into_iter().fold(0.0, f64::max).sqrt();
    Some(Harmonic {
        amplitude,
        phase: a.arg(),
        omega,
        rate: growth / amplitude,
        uncertainties: [
            noise * largest(0),
            noise * largest(1) / (amplitude * middle * sample_time),
        ],
    })
}

#[cfg(test)]
#[path = "../../tests/unit/fit.rs"]
mod tests;
