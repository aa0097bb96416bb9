//! Recordings: two channels, the response and the base, of any run near resonance, and what they say of drive and frequency of phase resonance.
//!
//! The curve is that of [`vines_identify::identify`]: held levels, sweeps and decays are one case, and the phase does not matter. Before that, the
//! channels are made displacements, and what is no measurement of a rig near resonance is refused.

use std::f64::consts::{SQRT_2, TAU};
use std::sync::Arc;

use nalgebra::DVector;
use num_complex::Complex64;
use serde::Serialize;
use vines_estimate::{HarmonicBasis, Oscillations};
use vines_identify::{IdealRig, Identified, MOTIONS, MeasuredCurve, Samples, Signals, Unidentified, identify};
use vines_model::numerics::{SIGNIFICANT, mean, range};
use vines_model::{ArgumentError, Measurand, Sensor};
use vines_scene::knowledge::{Knowledge, Target};
use vines_scene::linear::{LinearResponse, MeasuredLinear, POINT_RESOLUTION, ParticleState};
use vines_scene::scene::{Scene, Units};

use super::linear_in_words;
use crate::identification::Line;

/// Two channels of a measurement, sampled at equal distances.
#[derive(Debug, Clone, PartialEq)]
pub struct Recording {
    /// Where it comes from, for messages: the name of a file.
    pub origin: String,
    /// Names of the channels of response and base, for messages.
    pub channels: [String; 2],
    /// Time of the first sample, s.
    pub start: f64,
    /// Time from sample to sample, s.
    pub sample_time: f64,
    /// What response and base measure.
    pub measurands: [Measurand; 2],
    /// Whether the drive is a force, not the motion of a base.
    pub of_force: bool,
    /// Response, m, m/s or m/s².
    pub response: Vec<f64>,
    /// Motion of the base, m, m/s or m/s², or force, N; zeros without a channel of the base, whose name is empty then.
    pub drive: Vec<f64>,
    /// Whether a run of `vines` wrote it, whose scene says what the sensor of the response reads.
    pub is_own: bool,
    /// What is to be known of the way it was read: the clock, and what was cut or interpolated.
    pub notes: Vec<String>,
}

/// What a linear decay says, in words.
pub fn decay_in_words(decay: &MeasuredLinear) -> String {
    format!("no impacts: this is a linear decay, {}", linear_in_words(decay))
}

/// Periods within which a constant hardly drifts, and fewest of a recording: the drift is removed over as many.
const SLOW: usize = 16;
/// Fewest samples in a period: the fit of one has nine unknowns, and the third harmonic must be resolved.
const COARSEST: f64 = 12.0;
/// Fewest periods of a decay, and periods of the pieces whose damping is compared.
const FEWEST_OF_DECAY: usize = 8;
/// Smallest damping ratio of a structure.
pub(super) const LEAST_DAMPING: f64 = 1e-5;
/// Largest share of the response that a base at rest would make at resonance.
const RESTS: f64 = 0.02;
/// Largest relative distance of the frequency from the natural frequency near resonance.
const NEAR_RESONANCE: f64 = 0.2;
/// Largest ratio of the damping in a piece of a linear decay to that of the whole, and of its inverse: impacts in 1:1 motion double the loss near the
/// fold.
const DAMPING_RATIO: f64 = 1.5;

impl Recording {
    /// What is known, with the sample time and the channels of this recording.
    fn knowledge(&self, knowledge: &Knowledge) -> Knowledge {
        let target = Target { measurands: self.measurands, ..knowledge.target };
        Knowledge { sample_time: self.sample_time, target, ..*knowledge }
    }

    /// The channels as the bench has them: in m, and without their slow drift.
    ///
    /// # Errors
    /// Channels that are no measurement of a rig near resonance; the message says which, and what to do.
    pub fn prepared(&self, knowledge: &Knowledge) -> Result<Self, ArgumentError> {
        let knowledge = self.knowledge(knowledge);
        let linear = knowledge.linear;
        self.check(&linear)?;
        let mut one = self.clone();
        let of_response = self.measurands[0];
        if of_response != Measurand::Displacement && knowledge.numbers.definition.sensor == Sensor::V {
            let (Self { origin, channels: [response, _], .. }, name) = (self, of_response.name());
            return Err(format!(
                "{origin}: the response {response} measures {name}, and the scene's sensor reads v, which contains the particle: no sensor on the structure \
                 does; set resonance.sensor = \"q1\" in the scene, or with --set"
            ).into());
        }
        let by_force = knowledge.target.units.reference.symbol == "N";
        if self.of_force != by_force && self.drive_is_named() {
            let what = |is_force| if is_force { "a force, N" } else { "the motion of a base" };
            return Err(format!(
                "{}: the drive {} is {}, and the structure of the scene is driven by {}; give the scene that was recorded",
                self.origin,
                self.channels[1],
                what(self.of_force),
                what(by_force)
            ).into());
        }
        for (channel, values) in [&mut one.response, &mut one.drive].into_iter().enumerate() {
            values
                .iter_mut()
                .for_each(|value| *value = knowledge.target.in_metres(channel, *value));
            remove_drift(values, (TAU / linear.omega0 / self.sample_time).round() as usize, SLOW);
        }
        Ok(one)
    }

    /// The linear decay, if the base rests all the time and the damping does not depend on the amplitude: one free oscillation, from the period with the
    /// largest response to the first one that noise hides. It does not tell the state of the particle.
    ///
    /// # Errors
    /// As [`Recording::prepared`], and where the base rests and the response does not decay.
    pub fn linear_decay(&self, knowledge: &Knowledge) -> Result<Option<MeasuredLinear>, ArgumentError> {
        let knowledge = self.knowledge(knowledge);
        let one = self.prepared(&knowledge)?;
        let [response, base] = [0, 1].map(|channel| one.fundamentals(channel, &knowledge));
        if is_driven(&response, &base, knowledge.linear.bandwidth()) {
            return Ok(None);
        }
        let size = |n: &usize| response[*n].value.norm();
        let begin = (0..response.len()).max_by(|one, other| size(one).total_cmp(&size(other)));
        let begin = begin.unwrap_or_default();
        let seen: Vec<&Fundamental> = response[begin..].iter().take_while(|one| one.is_seen()).collect();
        // Change of the logarithm from sample to sample.
        let natural = knowledge.linear.omega0 * self.sample_time;
        let period = (TAU / natural).round() as usize;
        let change = seen
            .windows(2)
            .map(|pair| pair[1].value * pair[0].value.conj())
            .sum::<Complex64>()
            / seen.iter().map(|one| one.value.norm_sqr()).sum::<f64>();
        let start = Complex64::new(0.0, natural) + change.ln() / period as f64;
        let fitted = |values: &[f64]| {
            let found = Oscillations::new(values.iter().copied(), [0.0, 1.0], 0, &[], start, 0.0);
            let of_pole = found.u(&[Complex64::ZERO, Complex64::ONE]);
            (found.pole, found.variance(found.pole.im, period).sqrt() * of_pole)
        };
        let values = &one.response[begin * period..(begin + seen.len()) * period];
        let decay = (seen.len() >= FEWEST_OF_DECAY).then(|| fitted(values));
        let Some((pole, u)) = decay.filter(|(pole, u)| -pole.re > SIGNIFICANT * u) else {
            let Self { origin, channels: [response, drive], .. } = self;
            let base = if self.drive_is_named() {
                format!("the base {drive} rests")
            } else {
                "no channel of the base is named".into()
            };
            return Err(format!(
                "{origin}: {base}, and the response {response} does not decay for {FEWEST_OF_DECAY} periods. Name the channel of the base with --drive NAME:UNIT; if it is named, is \
                 it connected?"
            ).into());
        };
        let pieces: Vec<_> = values.chunks_exact(FEWEST_OF_DECAY * period).map(fitted).collect();
        let significant = (SIGNIFICANT.powi(2) + 2.0 * (pieces.len() as f64).ln()).sqrt();
        let is_another = |(of_piece, u): &(Complex64, f64)| {
            let is_alike = (1.0 / DAMPING_RATIO..DAMPING_RATIO).contains(&(of_piece.re / pole.re));
            !is_alike && (of_piece.re - pole.re).abs() > significant * u
        };
        if pieces.iter().any(is_another) {
            return Ok(None);
        }
        // A frequency that changes with the amplitude is as uncertain as it changes.
        let changes = pieces
            .iter()
            .map(|(of_piece, u)| (of_piece.im - pole.im).abs() - significant * u);
        let changed = changes.fold(0.0, f64::max);
        // As of a stated point: of the half-power bandwidth.
        let u = u.hypot(POINT_RESOLUTION * 2.0 * -pole.re);
        let [omega, u_omega, rate, u_rate] =
            [pole.norm(), u.hypot(changed), -pole.re, u].map(|per_sample| per_sample / self.sample_time);
        Ok(Some(MeasuredLinear {
            f0: omega / TAU,
            u_f0: u_omega / TAU,
            zeta: rate / omega,
            u_zeta: u_rate / omega,
            correlation: 0.0,
            particle: ParticleState::Unknown,
        }))
    }

    fn drive_is_named(&self) -> bool {
        !self.channels[1].is_empty()
    }

    /// Refuses what is no measurement.
    fn check(&self, linear: &LinearResponse) -> Result<(), ArgumentError> {
        let Self { origin, channels, sample_time, .. } = self;
        let refused = |message: String| Err(format!("{origin}{message}").into());
        let hertz = linear.omega0 / TAU;
        let both = [&self.response, &self.drive];
        let [count, drives] = both.map(Vec::len);
        if count != drives {
            let [one, another] = channels;
            return refused(format!(
                ": channel {one} has {count} samples and channel {another} has {drives}; both must have been sampled together"
            ));
        }
        for (values, channel) in both.into_iter().zip(channels) {
            if let Some(sample) = values.iter().position(|value| !value.is_finite()) {
                let (number, seconds) = (sample + 1, sample as f64 * sample_time);
                return refused(format!(
                    ", channel {channel}: sample {number} ({seconds:.4} s) is not a finite number; cut the recording there, or repair the channel"
                ));
            }
        }
        let (rate, per_period) = (1.0 / sample_time, 1.0 / (hertz * sample_time));
        if per_period < COARSEST {
            return refused(format!(
                ": {rate:.6} samples a second are {per_period:.1} in a period of the scene's natural frequency {hertz:.4} Hz, and at least {COARSEST} \
                 are needed: give the rate with --rate, or the stiffness and the mass with --scene"
            ));
        }
        let (seconds, periods) = (count as f64 * sample_time, count as f64 * sample_time * hertz);
        if periods < SLOW as f64 {
            return refused(format!(
                ": {seconds:.3} s are {periods:.1} periods of the scene's natural frequency {hertz:.4} Hz; at least {SLOW} are needed"
            ));
        }
        for ((values, channel), measurand) in both.into_iter().zip(channels).zip(self.measurands) {
            let (low, high) = range((f64::INFINITY, f64::NEG_INFINITY), values.iter().copied());
            // A base may rest.
            if low == high && std::ptr::eq(values, &raw const self.response) {
                return refused(format!(
                    ", channel {channel} is constant: is it connected, and is it the right one?"
                ));
            }
            let rounding = rounding(values);
            for value in [low, high].into_iter().filter(|_| low < high) {
                if let Some((sample, [from, to])) = glitch(values, value, rounding) {
                    return refused(format!(
                        ", channel {channel}: sample {} ({:.4} s) is {value:.4e} {unit}, and all others are from {from:.4e} to {to:.4e} {unit}: no oscillation \
                         has such a sample; repair it, or cut the recording there",
                        sample + 1,
                        sample as f64 * sample_time,
                        unit = measurand.unit()
                    ));
                }
                if let Some(stay) = clipped(values, value, rounding) {
                    return refused(format!(
                        ", channel {channel} is clipped: it stays at {value:.4e} {} for {stay:.1} samples at a time, longer than a smooth peak; reduce \
                         the gain, and record again",
                        measurand.unit()
                    ));
                }
            }
        }
        Ok(())
    }

    /// The fundamental of a channel, 0 the response or 1 the base, one natural period of the scene after the other.
    fn fundamentals(&self, channel: usize, knowledge: &Knowledge) -> Vec<Fundamental> {
        let omega0 = knowledge.linear.omega0;
        let turn = omega0 * self.sample_time;
        let period = (TAU / turn).round() as usize;
        let phases: Vec<f64> = (0..period).map(|n| n as f64 * turn).collect();
        let basis = HarmonicBasis::new(&phases, [0, 0], 3);
        let unit = knowledge.target.displacement(channel, omega0);
        let fundamental = |(n, values): (usize, &[f64])| {
            let values = DVector::from_column_slice(values);
            let fit = basis.fit(&values)?;
            let phase = Complex64::cis(-turn * (n * period) as f64);
            let noise = fit.noise * unit.norm_sqr() * 2.0 / period as f64;
            Some(Fundamental { value: fit.harmonic(1) * unit * phase, noise })
        };
        let values = [&self.response, &self.drive][channel];
        values
            .chunks_exact(period)
            .enumerate()
            .filter_map(fundamental)
            .collect()
    }

    /// The curve of phase resonance of a rig that is about as `scene` says, and the motions that the recording shows.
    ///
    /// # Errors
    /// Channels that cannot be those of a rig near resonance, and a recording without symmetric 1:1 motion; the message says what to do.
    pub fn curve(&self, scene: &Scene) -> Result<(MeasuredCurve, Vec<Stretch>), ArgumentError> {
        let knowledge = self.knowledge(&scene.knowledge());
        let one = self.prepared(&knowledge)?;
        one.plausible(&knowledge)?;
        let Self { origin, sample_time, measurands, .. } = &one;
        // A filter before the sampling passes less of the natural frequency.
        let passed = |channel: usize, values: &[f64]| {
            let factor = knowledge.target.displacement(channel, knowledge.linear.omega0).norm();
            values.iter().map(|value| factor * value).collect::<Vec<f64>>()
        };
        let readings = [passed(0, &one.response), passed(1, &one.drive)];
        let natural = knowledge.linear.omega0 * sample_time;
        let moved = [0, 1].map(|channel| displacements(&readings[channel], measurands[channel], natural));
        // At both ends the drift is not known: running means do not reach there.
        let margin = (0.5 * (SLOW + 3) as f64 * (TAU / knowledge.linear.omega0 / sample_time).round()) as usize;
        let end = one.response.len().saturating_sub(margin).max(margin);
        let inner = |both: [Vec<f64>; 2]| both.map(|values| values[margin..end].to_vec());
        let signals = Signals {
            displacements: inner(moved),
            readings: inner(readings),
            sample_time: *sample_time,
        };
        let samples = Arc::new(Samples { signals, sensor: scene.definition().sensor });
        let mut found = identify(&samples, &rough(scene)).map_err(|why| self.without_curve(&why))?;
        found
            .time
            .iter_mut()
            .for_each(|time| *time += margin as f64 * sample_time);
        let stretches = Stretch::all(&found, &knowledge.target.units);
        let periods = found.time.iter().zip(&found.amplitude).zip(&found.used);
        let periods = periods
            .filter(|(_, used)| **used)
            .map(|((time, amplitude), _)| [*time, *amplitude])
            .collect();
        let curve = found.curve.resolved(POINT_RESOLUTION);
        let curve = MeasuredCurve {
            origin: origin.clone(),
            curve: curve.ok_or_else(|| self.without_curve(&Unidentified::default()))?,
            periods,
            samples,
            used: found.used,
            read: found.read,
            resolution: POINT_RESOLUTION,
        };
        Ok((curve, stretches))
    }

    /// Refuses channels of which the response has no oscillation near the natural frequency, and channels that are swapped, or of which one has the
    /// wrong sign.
    fn plausible(&self, knowledge: &Knowledge) -> Result<(), ArgumentError> {
        let Self { origin, channels: [response, drive], .. } = self;
        let middle = mean(self.response.iter().copied());
        let centred: Vec<f64> = self.response.iter().map(|value| value - middle).collect();
        let rate = 1.0 / self.sample_time;
        let [hertz, strongest] =
            [knowledge.linear.omega0, rate * Line::strongest(&centred).turn].map(|omega| omega / TAU);
        let [of_response, of_base] = [0, 1].map(|channel| self.fundamentals(channel, knowledge));
        let pairs = || of_response.iter().zip(&of_base);
        let turned: Complex64 = of_response
            .windows(2)
            .map(|pair| pair[1].value * pair[0].value.conj())
            .sum();
        let is_near = 2 * of_response.iter().filter(|one| one.is_seen()).count() >= of_response.len()
            && turned.arg().abs() < NEAR_RESONANCE * TAU;
        if !is_near && (strongest / hertz - 1.0).abs() > NEAR_RESONANCE {
            return Err(format!(
                "{origin}, channel {response}: the strongest oscillation has {strongest:.4} Hz, and the scene's natural frequency is {hertz:.4} Hz. \
                 If the rate of {rate:.6} samples a second is wrong, give it with --rate; if the scene is wrong, give stiffness and mass with --scene"
            ).into());
        }
        let ratio = (power(&of_base) / power(&of_response)).sqrt();
        if ratio > 1.0 {
            return Err(format!(
                "{origin}: channel {drive} (base) is {ratio:.1} times as large as channel {response} (response), and at resonance the response is the \
                 larger one: are the channels swapped, or their units different?"
            ).into());
        }
        // The base feeds a passive rig, which lags.
        let fed: Complex64 = pairs().map(|(response, base)| response.value * base.value.conj()).sum();
        if fed.im > fed.re.abs() {
            return Err(format!(
                "{origin}: the response (channel `{response}`) leads the base (channel `{drive}`) by about a quarter of a period, where it lags on \
                 every passive rig: one of the channels has the wrong sign; give it a unit with a minus, for instance --drive {drive}:-1mm"
            ).into());
        }
        Ok(())
    }

    /// Why there is no curve.
    fn without_curve(&self, why: &Unidentified) -> ArgumentError {
        let Self { origin, .. } = self;
        let found: Vec<&str> = why.motions.iter().map(|motion| MOTIONS[*motion]).collect();
        let found = match &found[..] {
            [] => "nothing".into(),
            some => some.join(", "),
        };
        format!(
            "{origin}: fewer than thirty periods show symmetric 1:1 impacts of the particle that the scene describes (found: {found}). Record held \
             levels, a slow sweep or a decay above the fold, and give the scene that was recorded: f0 within 1 %, b within 10 %, masses within 15 %"
        ).into()
    }
}

/// The step to which values are rounded: the smallest distance between two of them.
fn rounding(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let steps = sorted.windows(2).map(|pair| pair[1] - pair[0]);
    steps.filter(|step| *step > 0.0).fold(f64::INFINITY, f64::min)
}

/// The sample with this extreme value, and the range of all others, if it is farther from the middle of its neighbours than that range and a rounding: an
/// oscillation of any frequency up to half the sampling rate is not.
fn glitch(values: &[f64], extreme: f64, rounding: f64) -> Option<(usize, [f64; 2])> {
    let others = values.iter().copied().filter(|value| *value != extreme);
    let (low, high) = range((f64::INFINITY, f64::NEG_INFINITY), others);
    let at = values.iter().position(|value| *value == extreme)?;
    let [before, after] = [at.checked_sub(1), Some(at + 1)].map(|n| values.get(n?));
    let middle = mean(before.into_iter().chain(after).copied());
    ((extreme - middle).abs() > high - low + rounding).then_some((at, [low, high]))
}

/// Mean number of samples for which values stay at their extreme, if that is longer than a smooth peak stays there. Rounding puts at most its last step
/// into the extreme value. A parabola stays √2 times as long within the last two steps.
fn clipped(values: &[f64], extreme: f64, rounding: f64) -> Option<f64> {
    let is_near = |value: &f64| (value - extreme).abs() < 1.5 * rounding;
    let stays = values.chunk_by(|one, other| is_near(one) == is_near(other));
    let stays = stays.map(|stay| [stay.iter().filter(|value| **value == extreme).count(), stay.len()]);
    let stays: Vec<_> = stays.filter(|[at, _]| *at > 0).collect();
    let [at, near] = [0, 1].map(|n| mean(stays.iter().map(|stay| stay[n] as f64)));
    // A channel may be held for some samples.
    let mut held: Vec<usize> = values.chunk_by(|one, other| one == other).map(<[f64]>::len).collect();
    held.sort_unstable();
    (at > near / SQRT_2 + held[held.len() / 2] as f64).then_some(at)
}

/// Removes what changes slowly: running means over a period of the natural frequency, three times, which the oscillation does not pass, and over
/// `slow` periods. At both ends a straight line goes on.
fn remove_drift(values: &mut [f64], period: usize, slow: usize) {
    let slow = (slow * period).min((values.len() / 2).saturating_sub(2 * period));
    let mut drift = values.to_vec();
    for length in [period, period, period, slow] {
        let first: f64 = drift[..length].iter().sum();
        let later = drift.windows(length + 1).scan(first, |sum, one| {
            *sum += one[length] - one[0];
            Some(*sum)
        });
        let sums = std::iter::once(first).chain(later);
        drift = sums.map(|sum| sum / length as f64).collect();
    }
    let last = drift.len() - 1;
    let first = (values.len() - drift.len()) / 2;
    let apart = slow.min(last).max(1);
    let slopes = [
        drift[apart.min(last)] - drift[0],
        drift[last] - drift[last.saturating_sub(apart)],
    ]
    .map(|change| change / apart as f64);
    for (n, value) in values.iter_mut().enumerate() {
        let at = n.saturating_sub(first).min(last);
        let beyond = n as f64 - (first + at) as f64;
        *value -= drift[at] + beyond * slopes[usize::from(beyond > 0.0)];
    }
}

/// The fundamental of a channel in a period.
struct Fundamental {
    /// Complex amplitude in the frame of the natural frequency of the scene, a displacement, m.
    value: Complex64,
    /// Variance of a component by noise, m².
    noise: f64,
}

impl Fundamental {
    fn is_seen(&self) -> bool {
        self.value.norm_sqr() > 2.0 * SIGNIFICANT.powi(2) * self.noise
    }
}

/// Mean square of the amplitudes, m².
fn power(periods: &[Fundamental]) -> f64 {
    mean(periods.iter().map(|one| one.value.norm_sqr()))
}

/// Whether a base moves: more than its noise, and by more than the share [`RESTS`] of what makes the response at resonance, for a bandwidth over omega0.
fn is_driven(response: &[Fundamental], base: &[Fundamental], bandwidth: f64) -> bool {
    let noise = 2.0 * mean(base.iter().map(|one| one.noise));
    let largest = noise * (1.0 + SIGNIFICANT / (base.len() as f64).sqrt());
    power(base) > largest.max((RESTS * bandwidth).powi(2) * power(response))
}

/// The ideal rig of a scene: what is expected of the one that was recorded.
pub(super) fn rough(scene: &Scene) -> IdealRig {
    let rig = IdealRig::of_plant(&scene.plant);
    IdealRig { zeta: rig.zeta.max(LEAST_DAMPING), ..rig }
}

/// A part of a recording with one motion.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Stretch {
    /// Its begin and end, s since the first sample.
    pub seconds: [f64; 2],
    /// Smallest and largest amplitude of the response, displacements at the sensor, m.
    pub response_m: [f64; 2],
    /// The motion, of [`MOTIONS`].
    pub motion: &'static str,
}

impl Stretch {
    /// Neighbouring windows with the same motion are one.
    fn all(found: &Identified, units: &Units) -> Vec<Self> {
        let mut all: Vec<Self> = Vec::new();
        for (window, motion) in &found.motions {
            let ([from, to], amplitude) = (window.periods, units.response.of_metres(window.amplitude));
            let seconds = [found.time[from], found.time[to - 1]];
            match all.last_mut() {
                Some(last) if last.motion == MOTIONS[*motion] => {
                    last.seconds[1] = seconds[1];
                    last.response_m = [last.response_m[0].min(amplitude), last.response_m[1].max(amplitude)];
                }
                _ => all.push(Self {
                    seconds,
                    response_m: [amplitude; 2],
                    motion: MOTIONS[*motion],
                }),
            }
        }
        all
    }
}

/// Displacements, m, from velocities or accelerations: their integrals, without what changes slowly. `natural`: phase by which the natural frequency
/// turns from sample to sample, rad.
fn displacements(values: &[f64], of: Measurand, natural: f64) -> Vec<f64> {
    let mut values = values.to_vec();
    for _ in 0..of.order() {
        let (mut sum, mut before) = (0.0, 0.0);
        for value in &mut values {
            // The trapezoidal rule, exact for a sine of this frequency.
            sum += (0.5 * natural).tan() * (before + *value);
            (before, *value) = (*value, sum);
        }
        // An integral raises the noise below the natural frequency. Twice leaves of noise at a quarter of it, which two integrals raise sixteen times, as
        // much as of noise near it.
        for _ in 0..2 {
            remove_drift(&mut values, (TAU / natural).round() as usize, 1);
        }
    }
    values
}
