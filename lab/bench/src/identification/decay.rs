//! The backbone along the free decay: a window slides from the release to the loss of synchrony.

use std::f64::consts::{PI, TAU};
use std::ops::Range;

use nalgebra::DVector;
use serde::Serialize;
use vines_estimate::HarmonicBasis;
use vines_model::numerics::{Estimate, SIGNIFICANT, mean};
use vines_model::regime::end_of_synchrony;

use super::response::impacts;
use crate::record::{Record, Sample};
use vines_scene::knowledge::{Knowledge, Target};

/// One point along the decay, in SI units, and dimensionless with the parameters of the scene.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct FreeDecayPoint {
    /// Time since the release, s.
    pub t_s: f64,
    /// Frequency, Hz.
    #[serde(rename = "f_Hz")]
    pub f_hz: f64,
    /// Amplitude of the fundamental of the response: its displacement at the sensor, m.
    #[serde(rename = "A_m")]
    pub a_m: f64,
    /// Standard uncertainty of the frequency, Hz.
    #[serde(rename = "u_f_Hz")]
    pub u_f_hz: f64,
    /// Standard uncertainty of the amplitude, m.
    #[serde(rename = "u_A_m")]
    pub u_a_m: f64,
    /// Time since the release, `omega0 t`.
    pub tau: f64,
    /// Amplitude of the fundamental of v.
    #[serde(rename = "C")]
    pub c: f64,
    /// Particle speed; absent if the rig does not report it.
    #[serde(rename = "B")]
    pub b: Option<f64>,
    /// Detuning.
    pub sigma: f64,
    /// Rate of change of the amplitude, `dC/dtau`.
    pub rate: f64,
    /// Standard uncertainty of C.
    #[serde(rename = "u_C")]
    pub u_c: f64,
    /// Standard uncertainty of sigma.
    pub u_sigma: f64,
}

/// What ended the points of a decay.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub enum DecayEnd {
    /// The impacts are no longer two per period at even intervals.
    #[serde(rename = "loss of synchrony")]
    Synchrony,
    /// The record ended earlier: record.decay_periods is too short to see the loss of synchrony.
    #[serde(rename = "end of the record")]
    Record,
    /// The impacts took away less than half of what they did at the release, on a rig that does not report impacts.
    #[serde(rename = "end of the impacts")]
    Linear,
    /// There are none: the base goes on moving with the frequency of the drive.
    #[serde(rename = "base not at rest")]
    Driven,
    /// There are none: another mode moves freely beside the driven one, nearer than a window can tell apart.
    #[serde(rename = "another mode")]
    OtherMode,
}

/// The points along a decay, and what ended them.
#[derive(Debug, Clone, PartialEq)]
pub struct DecayPoints {
    /// The points.
    pub points: Vec<FreeDecayPoint>,
    /// Why there are no further ones.
    pub end: DecayEnd,
}

/// Window of the fit along the decay, periods of the motion: shorter ones have more noise, longer ones blur the end (studies/decay.rs).
pub const DECAY_WINDOW: f64 = 2.5;
/// Points per period along the decay.
pub(crate) const PER_PERIOD: f64 = 8.0;
/// Smallest loss of amplitude by the impacts of a 1:1 motion, over the loss at the release: with the speed of the particle, it changes by a third
/// down to the fold.
const LEAST_IMPACT_LOSS: f64 = 0.5;

/// The points along the decay of a record, up to the loss of synchrony where the rig reports impacts, otherwise to
/// the end of the impacts. `window`: length of each fit, periods of the motion, [`DECAY_WINDOW`] by default; behind a shaker 1.2 times that.
pub fn decay_points(record: &Record, knowledge: &Knowledge, window: f64) -> DecayPoints {
    let d = knowledge.numbers;
    let none = |end| DecayPoints { points: Vec::new(), end };
    let Ok(begin) = base_at_rest(record, knowledge) else {
        return none(DecayEnd::Driven);
    };
    let decay = record.decay().get(begin..).unwrap_or_default();
    let dt = record.sample_time;
    let (Some(first), Some(last)) = (decay.first(), decay.last()) else {
        return none(DecayEnd::Record);
    };
    let omega = last_driven(record).unwrap_or(d.omega0);
    let half_period = PI / omega;
    let has_impacts = first.ground_truth.is_some();
    let until = if has_impacts {
        end_of_synchrony(&impacts(decay), half_period).unwrap_or(first.time)
    } else {
        f64::INFINITY
    };
    let values: Vec<f64> = decay.iter().map(|s| s.sensors.response).collect();
    let terms = if knowledge.shaker.is_some() {
        BEHIND_SHAKER
    } else {
        DECAY_TERMS
    };
    let window = terms.length * window;
    // A pole nearer than the main lobe of the window looks like a part of the fundamental.
    if knowledge.nearest_pole * window / omega < terms.lobe {
        return none(DecayEnd::OtherMode);
    }
    let mut windows = fitted(&values, [dt, window], omega, terms);
    for window in &mut windows {
        window.time += begin as f64 * dt;
        window.fit = window.fit.displacement(0, &knowledge.target);
    }
    // Loss of amplitude by the impacts alone, m/s; the mean over the first period belongs to the 1:1 motion.
    let damping = knowledge.linear.damping_rate;
    let taken = |window: &SlidingFit| -window.fit.rate - damping * window.fit.amplitude;
    let at_release = mean(windows.iter().take(PER_PERIOD as usize).map(taken));
    // A rig that loses no more than its linear damping has no impacts that could end.
    let may_end = !has_impacts && at_release > 0.0;
    let is_linear = |window: &SlidingFit| may_end && taken(window) < LEAST_IMPACT_LOSS * at_release;
    let end = if windows.iter().any(is_linear) {
        DecayEnd::Linear
    } else if has_impacts && until + 2.0 * half_period < last.time {
        DecayEnd::Synchrony
    } else {
        DecayEnd::Record
    };
    let points = windows
        .iter()
        .take_while(|window| decay[window.samples.end - 1].time <= until && !is_linear(window))
        .map(|window| window.point(decay, knowledge))
        .collect();
    DecayPoints { points, end }
}

/// Frequency of the last drive before the release, rad/s.
fn last_driven(record: &Record) -> Option<f64> {
    let driven = record.samples[..record.released].iter().rev();
    driven
        .map(|sample| sample.command.drive.omega)
        .find(|omega| *omega > 0.0)
}

/// Rounding of a fit over the largest reading: the least noise.
const LEAST_NOISE: f64 = 1e-14;

/// Index of the sample of the decay from which on the rig is free: the base rests as well as the command.
///
/// The base rests where a fit of one period finds no motion of the last drive's frequency: its amplitude is not significant against the noise of the
/// channel, which is what the fit leaves of the readings. Without a sensor of the base, and behind a shaker, whose armature the structure moves, only
/// the command is known: the rig is then free as soon as the readings are of the time of the release.
///
/// # Errors
/// The amplitude of the base, m, in the period in which it is least, if the base rests nowhere.
pub(crate) fn base_at_rest(record: &Record, knowledge: &Knowledge) -> Result<usize, Estimate> {
    let (decay, dt, target) = (record.decay(), record.sample_time, &knowledge.target);
    let readings: Option<Vec<f64>> = decay.iter().map(|sample| sample.sensors.reference).collect();
    let readings = readings.filter(|_| knowledge.shaker.is_none());
    let Some((readings, omega)) = readings.zip(last_driven(record)) else {
        return Ok((target.delay / dt).ceil() as usize);
    };
    let period = (TAU / (omega * dt)).round() as usize;
    let step = ((period as f64 / PER_PERIOD).round() as usize).max(1);
    let phases: Vec<f64> = (0..period).map(|n| n as f64 * dt * omega).collect();
    let basis = HarmonicBasis::new(&phases, [1, 0], 1);
    let displacement = target.displacement(1, omega).norm();
    let mut least: Option<Estimate> = None;
    for (n, values) in readings.windows(period).enumerate().step_by(step) {
        let values = DVector::from_column_slice(values);
        let Some(fit) = basis.fit(&values).filter(|_| period > basis.terms()) else {
            break;
        };
        let variance =
            fit.noise.max((LEAST_NOISE * values.amax()).powi(2)) * target.colour_of_fundamental(omega, dt, 1);
        let uncertainty = displacement * (2.0 * variance / period as f64).sqrt();
        let value = displacement * fit.harmonic(1).norm();
        if value <= SIGNIFICANT * uncertainty {
            return Ok(n);
        }
        if least.is_none_or(|least| value < least.value) {
            least = Some(Estimate { value, uncertainty });
        }
    }
    // A decay of less than a period has no points, whatever moves.
    least.map_or(Ok(0), Err)
}

/// A fit of some samples; `time`: its middle since the release, s.
struct SlidingFit {
    samples: Range<usize>,
    time: f64,
    fit: Harmonic,
}

impl SlidingFit {
    fn point(&self, decay: &[Sample], knowledge: &Knowledge) -> FreeDecayPoint {
        let Harmonic { amplitude, omega, rate, uncertainties } = self.fit;
        let d = &knowledge.numbers;
        let estimate = |value, uncertainty| Estimate { value, uncertainty };
        let measured = [
            estimate(amplitude, uncertainties[0]),
            estimate(0.0, 0.0),
            estimate(omega, uncertainties[1]),
        ];
        let [u_amplitude, _, u_omega] = knowledge.linear.resolved(measured).map(|one| one.uncertainty);
        let speeds = decay[self.samples.clone()]
            .iter()
            .map(|s| s.ground_truth.map(|w| w.particle_velocity.abs()));
        FreeDecayPoint {
            t_s: self.time,
            f_hz: omega / TAU,
            a_m: knowledge.target.units.response.of_metres(amplitude),
            u_f_hz: u_omega / TAU,
            u_a_m: knowledge.target.units.response.of_metres(u_amplitude),
            tau: d.omega0 * self.time,
            c: amplitude / d.b,
            // The mean is the value at the middle of the straight line that fits best.
            b: speeds.collect::<Option<Vec<f64>>>().map(|speeds| d.speed(mean(speeds))),
            sigma: d.sigma(omega),
            rate: rate / (d.b * d.omega0),
            u_c: u_amplitude / d.b,
            u_sigma: u_omega / d.omega_change(1.0),
        }
    }
}

/// Fits of these terms in a sliding window of some periods. Each fit starts from the frequency of the one before, the first from `omega`.
fn fitted(values: &[f64], [dt, periods]: [f64; 2], mut omega: f64, terms: Terms) -> Vec<SlidingFit> {
    let period = TAU / omega / dt;
    let window = (periods * period).round() as usize + 1;
    let step = ((period / PER_PERIOD).round() as usize).max(1);
    let fits = values.windows(window).enumerate().step_by(step);
    fits.map_while(|(n, values)| {
        let fit = harmonic(values, dt, omega, terms)?;
        omega = fit.omega;
        let time = (n as f64 + 0.5 * (window - 1) as f64) * dt;
        Some(SlidingFit { samples: n..n + window, time, fit })
    })
    .collect()
}

// Least squares of a harmonic whose amplitude and phase drift linearly across the window.

/// A harmonic fitted to a window of samples; everything holds at the middle of the window.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Harmonic {
    /// Amplitude of the fundamental, in the unit of the samples.
    pub amplitude: f64,
    /// Angular frequency, rad/s.
    pub omega: f64,
    /// Rate of change of the amplitude, 1/s times its unit.
    pub rate: f64,
    /// Standard uncertainties of amplitude and frequency by the noise of the samples.
    pub uncertainties: [f64; 2],
}

impl Harmonic {
    /// The displacement of which a channel reads this harmonic.
    #[must_use]
    pub fn displacement(self, channel: usize, target: &Target) -> Self {
        let factor = target.displacement(channel, self.omega).norm();
        Self {
            amplitude: self.amplitude * factor,
            rate: self.rate * factor,
            uncertainties: [self.uncertainties[0] * factor, self.uncertainties[1]],
            ..self
        }
    }
}

/// What is fitted to a window.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Terms {
    /// Degree of the trend.
    trend: i32,
    /// Degrees of the harmonics.
    harmonics: &'static [Option<i32>],
    /// Whether residuals have the weights of Hann's window, in which what is not fitted leaks least into the fundamental.
    is_hann: bool,
    /// Length of the window over one without weights. With Hann's weights it averages the frequency over less time: the average has the second moment
    /// 0.026 L², and L²/20 without weights, so that as long a time would take 1.38 (validation/shaker_decay.csv).
    length: f64,
    /// Main lobe of the window, over 2 pi and its length, and wider by 1 because of the amplitude's second degree.
    lobe: f64,
}

/// A constant, and harmonics 1 and 3 with drift.
pub(crate) const DECAY_TERMS: Terms = Terms {
    trend: 0,
    harmonics: &[Some(2), None, Some(1)],
    is_hann: false,
    length: 1.0,
    lobe: 2.0,
};
/// A shaker that is released returns slowly, a sensor at the cavity sees the walls' impulses, and other modes are free: a trend, harmonics up to 9,
/// and Hann's window.
const BEHIND_SHAKER: Terms = Terms {
    trend: 2,
    harmonics: &[Some(2), None, Some(1), None, Some(1), None, Some(1), None, Some(1)],
    is_hann: true,
    length: 1.2,
    lobe: 3.0,
};

/// Fits these terms to `values`, sampled every `sample_time` seconds: a fundamental near `omega` (rad/s) and its harmonics, with their drift, and a trend.
///
/// The drift of the fitted phase corrects the frequency, and the fit is repeated about that. `None` for a window that is too
/// short or contains no motion of about that frequency.
pub(crate) fn harmonic(values: &[f64], sample_time: f64, omega: f64, terms: Terms) -> Option<Harmonic> {
    let middle = 0.5 * (values.len() - 1) as f64;
    let values = DVector::from_column_slice(values);
    // Their squares are Hann's window.
    let hann = |n: usize| (PI * (n as f64 + 0.5) / values.len() as f64).sin();
    let weights = DVector::from_fn(values.len(), |n, _| if terms.is_hann { hann(n) } else { 1.0 });
    // Half a window, s.
    let half = middle * sample_time;
    let (mut omega, mut last) = (omega, None);
    // Each fit about the frequency that the fit before found reduces the error by orders of magnitude.
    for _ in 0..6 {
        let phases: Vec<f64> = (0..values.len())
            .map(|n| (n as f64 - middle) * sample_time * omega)
            .collect();
        let basis = HarmonicBasis::weighted(&phases, terms.trend, terms.harmonics, weights.clone());
        if values.len() <= basis.terms() {
            return None;
        }
        let fit = basis.fit(&values)?;
        let a = fit.harmonic(1);
        let square = a.norm_sqr();
        if square == 0.0 || !square.is_finite() {
            return None;
        }
        // The phase of a turns by Im(drift/a) per half window.
        let change = fit.drift(1) * a.conj() / half;
        omega += change.im / square;
        last = Some((basis, fit, a, change.re));
    }
    let (basis, fit, a, growth) = last?;
    let amplitude = a.norm_sqr().sqrt();
    let largest = |degree: usize| basis.variances(1, degree).into_iter().fold(0.0, f64::max);
    let u = |degree: usize| (fit.noise * largest(degree)).sqrt();
    Some(Harmonic {
        amplitude,
        omega,
        rate: growth / amplitude,
        uncertainties: [u(0), u(1) / (amplitude * half)],
    })
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
            let fit = harmonic(&values, dt, guess, DECAY_TERMS).unwrap();
            prop_assert!((fit.omega - 1.0).abs() < 1e-9, "{fit:?}");
            prop_assert!((fit.amplitude - amplitude).abs() < 1e-9);
            // Silence has no harmonic.
            prop_assert_eq!(harmonic(&[0.0; 100], dt, guess, DECAY_TERMS), None);
        }

        #[test]
        fn behind_a_shaker_the_free_motion_of_a_second_mode_hardly_moves_the_frequency(
            phase in -3.0..3.0f64, ratio in 6.1..6.9f64,
        ) {
            let dt = 0.063;
            let values: Vec<f64> = (0..300).map(|i| {
                let t = (f64::from(i) - 149.5) * dt;
                (1.0 - 0.01 * t) * t.sin() + 0.01 * (-0.04 * t).exp() * (ratio * t + phase).sin()
            }).collect();
            let error = |terms: Terms| (harmonic(&values, dt, 1.0, terms).unwrap().omega - 1.0).abs();
            let bare = error(Terms { is_hann: false, ..BEHIND_SHAKER });
            prop_assert!(error(BEHIND_SHAKER) < 2e-6, "{:e}, without Hann's window {bare:e}", error(BEHIND_SHAKER));
        }
    }

    #[test]
    fn the_stated_uncertainty_under_hanns_window_is_the_scatter_by_noise() {
        let (dt, noise, mut random) = (0.063, 1e-3, 1_u64);
        // Sums of twelve uniform values of a linear congruential generator: nearly normal, of variance 1.
        let mut normal = move || -> f64 {
            let uniform = |_| {
                random = random
                    .wrapping_mul(6_364_136_223_846_793_005)
                    .wrapping_add(1_442_695_040_888_963_407);
                (random >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
            };
            (0..12).map(uniform).sum()
        };
        let pulls = (0..60).map(|_| {
            let values: Vec<f64> = (0..300).map(|i| (f64::from(i) * dt).sin() + noise * normal()).collect();
            let fit = harmonic(&values, dt, 1.0, BEHIND_SHAKER).unwrap();
            (fit.omega - 1.0) / fit.uncertainties[1]
        });
        // The mean square of 60 normal values has a standard deviation of 0.18.
        let square = vines_model::numerics::mean_square(pulls);
        assert!((0.6..1.5).contains(&square), "{square}");
    }
}
