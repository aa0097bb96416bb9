//! The regime from the response alone, as on a real rig.
//!
//! Two impacts per period at even intervals excite odd harmonics, and uneven impacts even ones, too. Irregular impacts make amplitude
//! and phase fluctuate, which leaves a residual. The motion without impacts is the linear mode: response over base is that of a
//! linear test at small amplitude, which the loop check makes.

use std::f64::consts::TAU;

use nalgebra::DVector;
use num_complex::Complex64;
use vines_model::numerics::{HarmonicBasis, noise};
use vines_model::regime::Regime;

use super::tone::{Line, Tone};
use crate::record::Sample;
use crate::scene::{Dimensionless, LinearResponse, Scene};

/// Largest residual of a steady motion, relative to the amplitude, unless it is noise.
const STEADY: f64 = 3e-3;
/// A residual counts as noise if third differences find at least this share of it.
const NOISE_SHARE: f64 = 0.5;
/// Largest number of lines that are subtracted as foreign tones.
const LINES: usize = 8;
/// Smallest significant harmonic, in standard errors.
const SIGNIFICANT: f64 = 4.0;
/// Smallest amplitude of the second harmonic over the third of an asymmetric motion: about 0.01 where it is symmetric, from 2 on where it is
/// irregular.
pub(crate) const ASYMMETRIC: f64 = 0.5;
/// Relative distance from the linear response within which a motion counts as the linear mode, beside the uncertainty of that response.
const LINEAR: f64 = 0.1;
/// Degrees of the amplitudes of the harmonics in time: quadratic for the fundamental, constant for the others.
const HARMONICS: [Option<usize>; 5] = [Some(2), Some(0), Some(0), Some(0), Some(0)];

/// Harmonic content of the response, relative to its fundamental.
#[derive(Debug, Clone)]
struct Content {
    /// Amplitude of the fundamental, m.
    amplitude: f64,
    /// Amplitudes of the second and the third harmonic, relative.
    second: f64,
    third: f64,
    /// Standard error of either: by noise, and what a change of the motion adds to a harmonic, as the fourth shows. The impacts excite the
    /// fourth harmonic twenty times less than the second.
    error: f64,
    /// RMS of the residual, relative, and its part that is noise.
    rest: f64,
    noise: f64,
    /// Foreign tones, which are not part of the residual.
    tones: Vec<Line>,
}

impl Content {
    /// Whether a residual is left that is not noise.
    fn is_irregular(&self) -> bool {
        self.rest > STEADY && !self.is_noise()
    }

    fn is_noise(&self) -> bool {
        self.noise >= NOISE_SHARE * self.rest
    }

    /// Fits the samples; `None` for too few samples or no motion.
    fn of(samples: &[Sample], sample_time: f64, omega: f64, d: &Dimensionless) -> Option<Self> {
        let n = samples.len();
        // The phase of the response is more uniform than that of a drive that a loop still corrects.
        let phases: Vec<f64> = (0..n).map(|n| n as f64 * sample_time * omega).collect();
        let basis = HarmonicBasis::new(&phases, 1, &HARMONICS);
        if n < 2 * basis.terms() {
            return None;
        }
        let mut values = DVector::from_iterator(n, samples.iter().map(|s| s.sensors.response));
        let (mut content, mut rest) = Self::fitted(&basis, &values)?;
        let mut lines: Vec<Line> = Vec::new();
        // Tones and harmonics are fitted in turn: what a tone has in common with the harmonics remains in the residual.
        while content.is_irregular() && lines.len() < LINES {
            let line = Line::strongest(rest.as_slice());
            let is_known = |one: &Line| (one.turn - line.turn).abs() < TAU / n as f64;
            if !line.is_foreign(d, sample_time) && !lines.iter().any(is_known) {
                break;
            }
            values -= DVector::from_fn(n, |n, _| line.at(n));
            lines.push(line);
            (content, rest) = Self::fitted(&basis, &values)?;
        }
        Some(Self { tones: lines, ..content })
    }

    /// The content of these values, and their residual.
    fn fitted(basis: &HarmonicBasis, values: &DVector<f64>) -> Option<(Self, DVector<f64>)> {
        let n = values.len();
        let fit = basis.fit(values)?;
        let rest = basis.residual(values, &fit);
        let [amplitude, second, third, fourth] = [1, 2, 3, 4].map(|n| fit.harmonic(n).norm());
        if amplitude == 0.0 || !amplitude.is_finite() {
            return None;
        }
        let rms = (rest.norm_squared() / (n - basis.terms()) as f64).sqrt() / amplitude;
        let content = Self {
            amplitude,
            second: second / amplitude,
            third: third / amplitude,
            error: (rms * (2.0 / n as f64).sqrt()).hypot(fourth / amplitude),
            rest: rms,
            noise: noise(rest.as_slice()) / amplitude,
            tones: Vec::new(),
        };
        Some((content, rest))
    }
}

/// The largest foreign tone in the response of these samples, if they would be irregular with it. `omega` (rad/s) is the frequency of the motion.
#[must_use]
pub fn foreign_tone(samples: &[Sample], scene: &Scene, omega: f64) -> Option<Tone> {
    let content = Content::of(samples, scene.sample_time(), omega, &scene.dimensionless())?;
    let largest = content
        .tones
        .iter()
        .max_by(|a, b| a.amplitude().total_cmp(&b.amplitude()))?;
    Some(largest.tone(scene.sample_time(), content.amplitude))
}

/// These samples without the foreign tones in their response; `None` if there are none.
pub(crate) fn without_tones(samples: &[Sample], scene: &Scene, omega: f64) -> Option<Vec<Sample>> {
    let tones = Content::of(samples, scene.sample_time(), omega, &scene.dimensionless())?.tones;
    let mut cleaned = samples.to_vec();
    for (n, sample) in cleaned.iter_mut().enumerate() {
        sample.sensors.response -= tones.iter().map(|line| line.at(n)).sum::<f64>();
    }
    (!tones.is_empty()).then_some(cleaned)
}

/// The regime determined from the response of these samples. `base` (m) is the base amplitude that holds the motion at the phase `phase` (rad)
/// of the response to the base, and `omega` (rad/s) its frequency.
///
/// Impacts need evidence: response over base departs from the linear response. Of a linear response that was measured on the rig, this is
/// sufficient; where that of the scene stands for it, the third harmonic must be significant as well.
#[must_use]
pub fn regime_by_response(samples: &[Sample], scene: &Scene, base: f64, phase: f64, omega: f64) -> Regime {
    let Some(content) = Content::of(samples, scene.sample_time(), omega, &scene.dimensionless()) else {
        return Regime::Unknown;
    };
    if content.is_irregular() {
        return Regime::Other;
    }
    let measured = Complex64::from_polar(content.amplitude / base, phase);
    let departs = base > 0.0 && !is_linear(&scene.linear(), measured, omega);
    // The parameters of a simulation are known.
    let is_known = scene.measured.is_some() || samples.iter().any(|sample| sample.ground_truth.is_some());
    let significant = SIGNIFICANT * content.error;
    match (departs, is_known) {
        (false, true) => Regime::NoImpacts,
        (false, false) => Regime::NotEstablished,
        _ if content.second > significant.max(ASYMMETRIC * content.third) => Regime::Asymmetric,
        _ if content.third > significant => Regime::Symmetric,
        (true, true) => Regime::Unresolved,
        (true, false) => Regime::NotEstablished,
    }
}

/// Whether response over base, `measured`, at the frequency `omega` (rad/s) is that of the linear response.
fn is_linear(linear: &LinearResponse, measured: Complex64, omega: f64) -> bool {
    let tolerance = LINEAR + SIGNIFICANT * linear.uncertainty / linear.damping_rate.abs();
    (linear.at(omega) / measured - 1.0).norm() <= tolerance
}
