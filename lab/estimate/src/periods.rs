//! The fundamental of a record, period by period.

use std::f64::consts::{LN_2, PI, TAU};
use std::ops::Range;

use nalgebra::DVector;
use num_complex::Complex64;

use crate::harmonics::{HarmonicBasis, HarmonicFit};
use crate::interpolation::{CubicSpline, curvature, gradient, unwrapped};
use crate::level::SURE;

/// What the periods of a record say. A complex amplitude z at the time t is the motion `Im(z exp(i omega t))`, with the frequency of the frame.
#[derive(Debug, Clone, Default)]
pub struct Periods {
    /// Time of the middle of each period, s.
    pub time: Vec<f64>,
    /// Fundamental of the response.
    pub response: Vec<Complex64>,
    /// Fundamental of the linear response.
    pub linear: Vec<Complex64>,
    /// Fundamental of the base.
    pub base: Vec<Complex64>,
    /// Variance of a component of the fundamental of the response by noise.
    pub noise: Vec<f64>,
    /// Variance of a component of the fundamental of the base by noise.
    pub base_noise: Vec<f64>,
    /// Frequency, rad/s.
    pub omega: Vec<f64>,
    /// Second harmonic of what the smooth fundamental leaves: phase as at the middle of the period.
    pub second: Vec<Complex64>,
}

/// Most harmonics that a period's fit contains, and the samples that each of them needs.
const HARMONICS: usize = 15;
const SAMPLES: usize = 5;

/// The least-squares fit of harmonics to a period.
struct Fit {
    samples: Range<usize>,
    basis: HarmonicBasis,
}

impl Fit {
    /// For these samples, `step` rad apart.
    fn new(samples: Range<usize>, step: f64) -> Self {
        let n = samples.len();
        let middle = 0.5 * (n - 1) as f64;
        let phases: Vec<f64> = (0..n).map(|k| (k as f64 - middle) * step).collect();
        let basis = HarmonicBasis::new(&phases, [0, 0], HARMONICS.min(n / SAMPLES));
        Self { samples, basis }
    }

    fn of(&self, signal: &[f64]) -> Option<HarmonicFit> {
        self.basis
            .fit(&DVector::from_column_slice(&signal[self.samples.clone()]))
    }

    /// Variance of a component by white noise, from the median of the sixth differences: impulses are not noise.
    fn white(&self, signal: &[f64]) -> f64 {
        let sixth = |v: &[f64]| (20.0 * v[3] - 15.0 * (v[2] + v[4]) + 6.0 * (v[1] + v[5]) - (v[0] + v[6])).abs();
        let median = median(signal[self.samples.clone()].windows(7).map(sixth));
        // Median of the size of a normal variable; sum of the squares of the factors.
        (median / 0.6745).powi(2) / 924.0 * 2.0 / self.samples.len() as f64
    }
}

/// The median of some values, at least one.
pub(crate) fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut sorted: Vec<f64> = values.collect();
    sorted.sort_by(f64::total_cmp);
    let n = sorted.len();
    0.5 * (sorted[(n - 1) / 2] + sorted[n / 2])
}

fn mean(of: &[f64]) -> f64 {
    of.iter().sum::<f64>() / of.len() as f64
}

/// The second harmonic in a fit, if it contains one.
fn second(fit: &HarmonicFit) -> Complex64 {
    match fit.harmonics() > 1 {
        true => fit.harmonic(2),
        false => Complex64::ZERO,
    }
}

/// The variance of a component by what changes the second harmonics of the response from period to period, if that is more than chance makes of these
/// variances: behind a filter differences of samples show little of the noise. (A base may be moved at once, and has the same filter.)
fn changed(seconds: &[Complex64], variances: &[f64]) -> Option<f64> {
    let mut changes: Vec<f64> = seconds.windows(2).map(|pair| (pair[1] - pair[0]).norm_sqr()).collect();
    changes.sort_by(f64::total_cmp);
    // The median of a sum of two squares, of twice the variance each.
    let changed = changes[changes.len() / 2] / (4.0 * LN_2);
    let white = mean(variances);
    // Relative standard deviation of the median: of an exponential distribution 1/(ln 2 √n), and of neighbours that share a period √1.5 of that.
    let chance = 1.5_f64.sqrt() / LN_2 / (changes.len() as f64).sqrt();
    (changed > white * (1.0 + SURE * chance)).then_some(changed)
}

/// Moving average over `width` values, zero beyond the ends.
fn average(values: &[Complex64], width: usize) -> Vec<Complex64> {
    let mut sums = vec![Complex64::ZERO];
    for value in values {
        sums.push(sums[sums.len() - 1] + value);
    }
    let ahead = (width - 1) / 2 + 1;
    let mean = |k: usize| {
        let [from, to] = [(k + ahead).saturating_sub(width), (k + ahead).min(values.len())];
        (sums[to] - sums[from]) / width as f64
    };
    (0..values.len()).map(mean).collect()
}

/// Fundamental of a signal at each sample, in the frame of `step` rad a sample, averaged three times over a period.
fn envelope(signal: &[f64], step: f64) -> Vec<Complex64> {
    let width = (TAU / step).round() as usize;
    let mut envelope: Vec<Complex64> = (0..)
        .zip(signal)
        .map(|(k, y)| Complex64::cis(-step * f64::from(k)) * y)
        .collect();
    for _ in 0..3 {
        envelope = average(&envelope, width);
    }
    envelope
}

/// Turns of the response at each sample.
fn turns(response: &[f64], step: f64) -> Vec<f64> {
    let angles = unwrapped(envelope(response, step).iter().map(|value| value.arg()));
    (0..)
        .zip(angles)
        .map(|(k, angle)| (angle + step * f64::from(k)) / TAU)
        .collect()
}

/// First samples of whole turns; the record ends where the response has lost its phase, which then takes less than half a period or more than two.
fn edges(turns: &[f64], width: usize) -> Vec<usize> {
    let (first, last) = (turns[width].ceil() as i64, turns[turns.len() - width].floor() as i64);
    let mut edges: Vec<usize> = Vec::new();
    for turn in first..=last {
        let edge = turns.partition_point(|one| *one < turn as f64);
        if edges
            .last()
            .is_some_and(|before| !(before + width / 2..before + 2 * width).contains(&edge))
        {
            break;
        }
        edges.push(edge);
    }
    edges
}

impl Periods {
    /// The periods of a response, with its linear part and the base, in the frame of the frequency `omega`, rad/s. `None` for fewer than 12.
    ///
    /// A fit to one period finds the Fourier coefficient of a varying amplitude w, `w - i conj(w')/(2 omega) + (pi²/6 w'' - conj(w'')/4)/omega²`. What is
    /// beside w is taken off: of a decay by a tenth in a period it is 1e-2 and 4e-4 of w. Noise and second harmonic are
    /// those of what the smooth fundamental leaves: growth inside a period would inflate them.
    /// `readings`: what the sensors of response and base read.
    pub fn new(
        [response, linear, base]: [&[f64]; 3],
        readings: [&[f64]; 2],
        sample_time: f64,
        omega: f64,
    ) -> Option<Self> {
        let step = omega * sample_time;
        let width = (TAU / step).round() as usize;
        // Twelve periods, and one at each end.
        if response.len() < 14 * width || width < 2 * SAMPLES {
            return None;
        }
        let turns = turns(response, step);
        let edges = edges(&turns, width);
        if edges.len() < 13 {
            return None;
        }
        let mut periods = Self::default();
        let (mut fits, mut phases) = (Vec::new(), Vec::new());
        for pair in edges.windows(2) {
            let [i, j] = [pair[0], pair[1]];
            let turn_per_sample = (turns[j] - turns[i]) / (j - i) as f64;
            fits.push(Fit::new(i..j, TAU * turn_per_sample));
            phases.push(Complex64::cis(TAU * 0.5 * (turns[i] + turns[j - 1])));
            periods.omega.push(TAU * turn_per_sample / sample_time);
            periods.time.push((i as f64 + 0.5 * (j - i - 1) as f64) * sample_time);
        }
        let [response_of, linear_of, base_of] =
            [response, linear, base].map(|signal| periods.smooth(&fits, &phases, signal, omega));
        (periods.response, periods.linear, periods.base) = (response_of?, linear_of?, base_of?);
        let envelope = CubicSpline::new(periods.time.clone(), periods.response.clone());
        let mut rest = response.to_vec();
        for (k, value) in rest.iter_mut().enumerate().take(edges[edges.len() - 1]).skip(edges[0]) {
            let t = k as f64 * sample_time;
            *value -= (envelope.at(t)[0] * Complex64::cis(omega * t)).im;
        }
        let (mut seconds, mut whites) = (Vec::new(), Vec::new());
        let is_displacement = readings[0] == response;
        for fit in &fits {
            let of_rest = fit.of(&rest)?;
            let noise = of_rest.noise * 2.0 / fit.samples.len() as f64;
            periods.second.push(second(&of_rest));
            seconds.push(match is_displacement {
                true => second(&of_rest),
                false => second(&fit.of(readings[0])?),
            });
            // What is left of an integral has not the noise of its sensor.
            let [white, of_base] = readings.map(|reading| fit.white(reading));
            whites.push(white);
            periods
                .noise
                .push(if is_displacement { noise.min(white) } else { white });
            periods.base_noise.push(of_base);
        }
        if let Some(changed) = changed(&seconds, &periods.noise) {
            let [of_response, of_base] = [mean(&periods.noise), mean(&whites)].map(|white| changed / white);
            periods.noise.iter_mut().for_each(|one| *one *= of_response);
            periods.base_noise.iter_mut().for_each(|one| *one *= of_base);
        }
        Some(periods)
    }

    /// Fundamental of a signal, without what its drift leaves in it. Drift is that in the frame of the response, whose phases in the middles of the
    /// periods are given: in a frame of constant frequency differences would miss a part of the detuning.
    fn smooth(&self, fits: &[Fit], phases: &[Complex64], signal: &[f64], omega: f64) -> Option<Vec<Complex64>> {
        let one = |(fit, phase): (&Fit, &Complex64)| Some(fit.of(signal)?.harmonic(1) * phase.conj());
        let z: Vec<Complex64> = fits.iter().zip(phases).map(one).collect::<Option<_>>()?;
        let rates = gradient(&z, &self.time);
        let curvatures = curvature(&z, &self.time);
        let corrected = |k: usize| {
            let omega_k = self.omega[k];
            let [rate, curvature] = [rates[k], curvatures[k]].map(|one| one * phases[k]);
            let own = z[k] * phases[k] + Complex64::i() * rate.conj() / (2.0 * omega_k)
                - (curvature * (PI * PI / 6.0) - curvature.conj() / 4.0) / (omega_k * omega_k);
            own * Complex64::cis(-omega * self.time[k])
        };
        Some((0..z.len()).map(corrected).collect())
    }
}
