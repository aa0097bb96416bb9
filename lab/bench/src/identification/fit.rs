//! Least squares of a harmonic whose amplitude and phase drift linearly across the window.

use nalgebra::{DMatrix, DVector};

/// A harmonic fitted to a window of samples; everything holds at the middle of the window.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Harmonic {
    /// Amplitude of the fundamental, in the unit of the samples.
    pub amplitude: f64,
    /// Phase of the fundamental, rad: the samples go as `amplitude sin(phase)` there.
    pub phase: f64,
    /// Angular frequency, rad/s.
    pub omega: f64,
}

/// Rounds of refitting about the frequency found; it converges by orders of magnitude each.
const ROUNDS: usize = 6;

/// Fits `values`, sampled every `sample_time` seconds, by a fundamental near `omega` (rad/s) and its third harmonic, both
/// with linear drift, and a constant.
///
/// The basis functions are sin and cos of the phase and the same times the time from the middle; the drift of the fitted
/// phase corrects the frequency, and the fit is repeated about that. `None` where the window is too short for that.
pub fn harmonic(values: &[f64], sample_time: f64, omega: f64) -> Option<Harmonic> {
    let n = values.len();
    if n < 16 {
        return None;
    }
    let middle = 0.5 * (n - 1) as f64;
    let right = DVector::from_column_slice(values);
    let mut omega = omega;
    let mut fitted = None;
    for _ in 0..ROUNDS {
        let basis = DMatrix::from_fn(n, 9, |row, column| {
            let t = (row as f64 - middle) / middle;
            let phase = (row as f64 - middle) * sample_time * omega;
            match column {
                0 => phase.sin(),
                1 => phase.cos(),
                2 => t * phase.sin(),
                3 => t * phase.cos(),
                4 => (3.0 * phase).sin(),
                5 => (3.0 * phase).cos(),
                6 => t * (3.0 * phase).sin(),
                7 => t * (3.0 * phase).cos(),
                _ => 1.0,
            }
        });
        let normal = basis.tr_mul(&basis).cholesky()?;
        let c = normal.solve(&basis.tr_mul(&right));
        let (s, k, s_drift, k_drift) = (c[0], c[1], c[2], c[3]);
        let square = s * s + k * k;
        if square == 0.0 || !square.is_finite() {
            return None;
        }
        // The phase of s sin + k cos is atan2(k, s); its drift is per half window.
        omega += (s * k_drift - k * s_drift) / square / (middle * sample_time);
        fitted = Some(Harmonic {
            amplitude: square.sqrt(),
            phase: k.atan2(s),
            omega,
        });
    }
    fitted
}

/// Value at the middle of a window of the straight line that fits it best.
pub fn mean_at_middle(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    // With equally spaced samples about the middle the value of the fitted line there is the mean.
    let n = values.len() as f64;
    values.sum::<f64>() / n
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_drifting_harmonic_is_found_from_a_poor_guess(
            amplitude in 0.1..2.0f64, phase in -3.0..3.0f64, decay in 0.0..0.02f64, guess in 0.98..1.02f64,
        ) {
            let (dt, n) = (0.063, 151);
            let middle = 75.0;
            let values: Vec<f64> = (0..n).map(|i| {
                let t = (f64::from(i) - middle) * dt;
                let theta = phase + t;
                amplitude * (1.0 - decay * t) * theta.sin() + 0.02 * (3.0 * theta + 0.3).sin() + 0.01
            }).collect();
            let fit = harmonic(&values, dt, guess).unwrap();
            prop_assert!((fit.omega - 1.0).abs() < 1e-9, "{fit:?}");
            prop_assert!((fit.amplitude - amplitude).abs() < 1e-9);
            prop_assert!((fit.phase - phase).abs() < 1e-9);
        }
    }

    #[test]
    fn silence_has_no_harmonic() {
        assert_eq!(harmonic(&[0.0; 100], 0.1, 1.0), None);
    }
}
