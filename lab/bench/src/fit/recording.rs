//! Points of phase resonance from a recording: two channels, the response and the base, of any run near resonance.
//!
//! 1. The base is the clock. Where it moves, its amplitude and phase over [`CLOCK_WINDOW`] periods, interpolated, stand for the command that a bench
//!    would know; where it rests, the rig decays.
//! 2. The periods of a driven part are cut into windows of about the same amplitude, near phase resonance: long where the response is held,
//!    short where it is swept.
//! 3. Each window gives a point by the fit that the bench itself uses ([`Criterion::best`]); the slopes are those of the points whose amplitudes are
//!    next to it.
//! 4. A decay gives drive and frequency from the rate and the frequency of the response, with E = 0 in the balance of the amplitude.
//!
//! The impacts follow a change of the amplitude late. The errors by this are alike within a sweep or a decay of n points, so that averaging does
//! not reduce them: each counts with the factor √n.

use std::collections::BTreeSet;
use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::fmt::{self, Display, Formatter};

use serde::Serialize;
use thiserror::Error;
use vines_model::numerics::{Estimate, RANDOM, mean, range, slope};
use vines_model::regime::Regime;
use vines_model::theory::{B_SYMMETRY_BREAKING, Manifold};
use vines_model::{Measurand, Sensor};

use super::{MeasuredPoint, decimals};
use crate::identification::{
    Criterion, Cycle, Harmonic, LAG, LevelEstimate, Line, PHASE_RANGE, ResonanceFit, harmonic, regime_by_response,
};
use crate::record::Sample;
use crate::rig::{Command, Drive, Sensors};
use vines_scene::knowledge::{Knowledge, Target};
use vines_scene::linear::LinearResponse;
use vines_scene::scene::Scene;

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
    /// What is to be known of the way it was read: the clock, and what was cut or interpolated.
    pub notes: Vec<String>,
}

/// Natural frequency and damping ratio of a structure, from its free decay without impacts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LinearDecay {
    /// Natural frequency, rad/s.
    pub omega: Estimate,
    /// Damping ratio.
    pub zeta: Estimate,
}

impl Display for LinearDecay {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let [f0, zeta] = [self.omega.scaled(1.0 / TAU), self.zeta].map(|Estimate { value, uncertainty }| {
            let decimals = decimals(uncertainty);
            format!("{value:.decimals$} ± {uncertainty:.decimals$}")
        });
        write!(f, "no impacts: this is a linear decay, f0 = {f0} Hz, zeta = {zeta}")
    }
}

/// What a part of a recording is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// The response is held.
    Held,
    /// The response changes slowly while the base moves.
    Sweep,
    /// The base rests.
    Decay,
}

/// A part of a recording that gives a point, or the reason why it gives none.
#[derive(Debug, Clone, Serialize)]
pub struct Part {
    /// Its begin and end, s since the first sample.
    pub seconds: [f64; 2],
    /// What it is.
    pub kind: Kind,
    /// The point; absent if it is not one of the backbone, or if another part has a better one at this amplitude.
    #[serde(skip)]
    pub point: Option<MeasuredPoint>,
    /// What the point is if the motion is 1:1, where only the record as a whole can show whether it is.
    #[serde(skip)]
    pub(super) candidate: Option<MeasuredPoint>,
    /// The regime of its motion.
    pub regime: Regime,
}

/// Why a recording gives no points: the message says what is wrong, and what to do.
#[derive(Debug, Error)]
#[error("{0}")]
pub struct RecordingError(String);

impl RecordingError {
    /// With this message.
    #[must_use]
    pub fn new(message: String) -> Self {
        Self(message)
    }
}

/// Periods of the fits that make the clock, and of those of a decay.
const CLOCK_WINDOW: f64 = 2.5;
/// Periods within which a constant hardly drifts.
const SLOW: usize = 16;
/// Fewest periods of a recording.
const FEWEST_PERIODS: f64 = 16.0;
/// Fewest samples in a period: the fit of one has nine unknowns, and the third harmonic must be resolved.
const COARSEST: f64 = 12.0;
/// Fewest periods of a window: the fit needs four, and so do its halves, which are compared.
const LEAST: usize = 2 * ResonanceFit::FEWEST;
/// Largest relative distance of the amplitude from the mean of the first [`LEAST`] periods of a window, in these: drive and frequency are nearly
/// linear in the amplitude there.
const RANGE: f64 = 0.04;
/// Largest such distance within a window of more periods, whose response is held. A change by twice this is a sweep; so far apart, two points give a
/// slope.
const HELD: f64 = 0.005;
/// Largest relative standard uncertainty of the drive of a point.
const LARGEST_DRIVE_UNCERTAINTY: f64 = 0.2;
/// Base over its largest amplitude below which it rests, unless the noise is larger.
const RESTS: f64 = 0.02;
/// Smallest amplitude of an oscillation over its standard uncertainty.
const SEEN: f64 = 8.0;
/// Share of the samples at the same extreme value from which a channel is clipped: a sine that is sampled 100 times a period and rounded to 10
/// bits has 4 %.
const CLIPPED_SHARE: f64 = 0.06;
/// Largest relative distance of the frequency from the natural frequency near resonance.
const NEAR_RESONANCE: f64 = 0.2;
/// Largest ratio of the damping in the two halves of a linear decay, and in a piece and the whole, and of its inverse: impacts in 1:1 motion double
/// the loss near the fold.
const DAMPING_RATIO: f64 = 1.5;
/// Relative standard uncertainty of the damping that a scene states: three of them are 30 %.
const DAMPING: f64 = 0.1;

/// The parts of each recording of a rig that is about as `scene` says.
///
/// # Errors
/// As [`Recording::parts`].
pub fn parts(recordings: &[Recording], scene: &Scene) -> Result<Vec<Vec<Part>>, RecordingError> {
    let linear = LinearResponse::of(&scene.plant);
    let uncertainty = DAMPING * linear.damping_rate;
    let knowledge = scene.knowledge().measured(LinearResponse { uncertainty, ..linear });
    recordings.iter().map(|record| record.parts(&knowledge)).collect()
}

impl Recording {
    /// The parts of the recording, with their points. `knowledge`: of the rig, with the natural frequency and the damping of the structure without
    /// impacts.
    ///
    /// # Errors
    /// Channels that cannot be those of a rig near resonance; the message says which, and what to do.
    pub fn parts(&self, knowledge: &Knowledge) -> Result<Vec<Part>, RecordingError> {
        self.prepared(knowledge)?
            .parts_near_resonance(&self.knowledge(knowledge))
    }

    /// What is known, with the sample time and the channels of this recording.
    fn knowledge(&self, knowledge: &Knowledge) -> Knowledge {
        let target = Target { measurands: self.measurands, ..knowledge.target };
        Knowledge { sample_time: self.sample_time, target, ..*knowledge }
    }

    fn parts_near_resonance(&self, knowledge: &Knowledge) -> Result<Vec<Part>, RecordingError> {
        let linear = &knowledge.linear;
        let anchors = self.anchors(knowledge);
        let moves = |anchor: &Anchor| anchor.response.map(|_| anchor.drive.is_some());
        let stretches = anchors.chunk_by(|anchor, next| moves(anchor) == moves(next));
        let of = |base_moves: bool| move |stretch: &&[Anchor]| moves(&stretch[0]) == Some(base_moves);
        let target = knowledge.target;
        let periods = |stretch: &[Anchor]| {
            let samples = self.samples(stretch);
            let cycles = Cycle::all(&samples, self.sample_time, target);
            (samples, cycles)
        };
        let driven: Vec<_> = stretches.clone().filter(of(true)).map(periods).collect();
        self.plausible(&driven.iter().flat_map(|(_, cycles)| cycles).collect::<Vec<_>>())?;
        let windows = driven.iter().flat_map(|(samples, cycles)| windows(samples, cycles));
        let mut parts = evaluated(&windows.collect::<Vec<_>>(), knowledge);
        let decays = stretches.filter(of(false));
        parts.extend(decays.flat_map(|stretch| decay(stretch, linear, self.sample_time)));
        parts.sort_by(|first, second| first.seconds[0].total_cmp(&second.seconds[0]));
        best_of_each_amplitude(&mut parts);
        let is_seen = 2 * anchors.iter().filter(|anchor| anchor.response.is_some()).count() >= anchors.len();
        if !is_seen && parts.iter().all(|part| part.candidate.is_none()) {
            return Err(self.nothing(&parts, knowledge));
        }
        Ok(parts)
    }

    /// The channels as the bench has them: in m, and without their slow drift.
    ///
    /// # Errors
    /// As [`Recording::parts`].
    pub fn prepared(&self, knowledge: &Knowledge) -> Result<Self, RecordingError> {
        let knowledge = self.knowledge(knowledge);
        let linear = knowledge.linear;
        self.check(&linear)?;
        let mut one = self.clone();
        let of_response = self.measurands[0];
        if of_response != Measurand::Displacement && knowledge.numbers.definition.sensor == Sensor::V {
            let (Self { origin, channels: [response, _], .. }, name) = (self, of_response.name());
            return Err(RecordingError(format!(
                "{origin}: the response {response} measures {name}, and the scene's sensor reads v, which contains the particle: no sensor on the structure \
                 does; set resonance.sensor = \"q1\" in the scene, or with --set"
            )));
        }
        let by_force = knowledge.target.units.reference.symbol == "N";
        if self.of_force != by_force && self.drive_is_named() {
            let what = |is_force| if is_force { "a force, N" } else { "the motion of a base" };
            return Err(RecordingError(format!(
                "{}: the drive {} is {}, and the structure of the scene is driven by {}; give the scene that was recorded",
                self.origin,
                self.channels[1],
                what(self.of_force),
                what(by_force)
            )));
        }
        for (channel, values) in [&mut one.response, &mut one.drive].into_iter().enumerate() {
            values
                .iter_mut()
                .for_each(|value| *value = knowledge.target.in_metres(channel, *value));
            remove_drift(values, (TAU / linear.omega0 / self.sample_time).round() as usize);
        }
        Ok(one)
    }

    /// The linear decay, if the base rests all the time and the damping does not depend on the amplitude.
    ///
    /// # Errors
    /// As [`Recording::parts`], and where the base rests and the response does not decay.
    pub fn linear_decay(&self, knowledge: &Knowledge) -> Result<Option<LinearDecay>, RecordingError> {
        let knowledge = self.knowledge(knowledge);
        let one = self.prepared(&knowledge)?;
        let anchors = one.anchors(&knowledge);
        let fits: Vec<&Harmonic> = anchors.iter().filter_map(|one| one.response.as_ref()).collect();
        if anchors.iter().any(|one| one.drive.is_some()) || 2 * fits.len() < anchors.len() && self.drive_is_named() {
            return Ok(None);
        }
        let largest = fits.iter().map(|one| one.amplitude).fold(0.0, f64::max);
        let decaying: Vec<(f64, &Harmonic)> = anchors
            .iter()
            .map(|one| (one.middle * self.sample_time, one.response.as_ref()))
            .skip_while(|(_, one)| one.is_none_or(|one| one.amplitude < largest))
            .map_while(|(time, one)| Some((time, one?)))
            .collect();
        let all = rate(&decaying);
        let mean_omega = omega(&decaying);
        if decaying.len() < LEAST || all.value < SEEN * all.uncertainty {
            let Self { origin, channels: [response, drive], .. } = self;
            let base = if self.drive_is_named() {
                format!("the base {drive} rests")
            } else {
                "no channel of the base is named".into()
            };
            return Err(RecordingError(format!(
                "{origin}: {base}, and the response {response} does not decay for {LEAST} periods. Name the channel of the base with --drive NAME:UNIT; if it is named, is \
                 it connected?"
            )));
        }
        let (first, second) = decaying.split_at(decaying.len() / 2);
        let is_steady =
            |[one, other]: [Estimate; 2]| (1.0 / DAMPING_RATIO..DAMPING_RATIO).contains(&(one.value / other.value));
        // Held levels whose base is not recorded fall as slowly in both halves, but in steps.
        let is_step = |one: Estimate| !is_steady([one, all]) && (one.value - all.value).abs() > SEEN * one.uncertainty;
        let has_steps = decaying.chunks_exact(2 * LEAST).any(|piece| is_step(rate(piece)));
        let is_linear = is_steady([first, second].map(rate)) && !has_steps;
        Ok(is_linear.then(|| LinearDecay { omega: mean_omega, zeta: all.scaled(1.0 / mean_omega.value) }))
    }

    fn drive_is_named(&self) -> bool {
        !self.channels[1].is_empty()
    }

    /// Refuses what is no measurement.
    fn check(&self, linear: &LinearResponse) -> Result<(), RecordingError> {
        let Self { origin, channels, sample_time, .. } = self;
        let refused = |message: String| Err(RecordingError(format!("{origin}{message}")));
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
        if periods < FEWEST_PERIODS {
            return refused(format!(
                ": {seconds:.3} s are {periods:.1} periods of the scene's natural frequency {hertz:.4} Hz; at least {FEWEST_PERIODS} are needed"
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
            for value in [low, high] {
                let share = values.iter().filter(|sample| **sample == value).count() as f64 / count as f64;
                if share > CLIPPED_SHARE && value != 0.0 {
                    return refused(format!(
                        ", channel {channel} is clipped: {:.1} % of its samples are equal to its largest or smallest value, {value:e} {}; reduce the \
                         gain, and record again",
                        100.0 * share,
                        measurand.unit()
                    ));
                }
            }
        }
        Ok(())
    }

    /// The displacements of both channels at intervals of a period.
    fn anchors(&self, knowledge: &Knowledge) -> Vec<Anchor> {
        let (dt, linear) = (self.sample_time, &knowledge.linear);
        let period = TAU / linear.omega0 / dt;
        let window = (CLOCK_WINDOW * period).round() as usize + 1;
        let step = (period.round() as usize).max(1);
        let mut omega = linear.omega0;
        let mut anchors: Vec<Anchor> = (0..(self.response.len() + 1).saturating_sub(window))
            .step_by(step)
            .map(|from| {
                let fit = |values: &[f64], omega| {
                    let found = harmonic(&values[from..from + window], dt, omega);
                    found.filter(|harmonic| {
                        harmonic.amplitude > SEEN * harmonic.uncertainties[0]
                            && (harmonic.omega / omega - 1.0).abs() < NEAR_RESONANCE
                    })
                };
                let response = fit(&self.response, omega).or_else(|| fit(&self.response, linear.omega0));
                omega = response.map_or(linear.omega0, |harmonic| harmonic.omega);
                let displacement =
                    |channel| move |harmonic: Harmonic| harmonic.displacement(channel, &knowledge.target);
                Anchor {
                    middle: from as f64 + 0.5 * (window - 1) as f64,
                    response: response.map(displacement(0)),
                    drive: fit(&self.drive, omega).map(displacement(1)),
                }
            })
            .collect();
        let drives = anchors.iter().filter_map(|anchor| anchor.drive);
        let largest = drives.map(|drive| drive.amplitude).fold(0.0, f64::max);
        for anchor in &mut anchors {
            anchor.drive = anchor.drive.filter(|drive| drive.amplitude > RESTS * largest);
        }
        anchors
    }

    /// The samples of a part in which the base moves, with the command that its fits stand for.
    fn samples(&self, run: &[Anchor]) -> Vec<Sample> {
        let knots: Vec<(f64, Harmonic)> = run.iter().filter_map(|at| Some((at.middle, at.drive?))).collect();
        let mut samples = Vec::new();
        for pair in knots.windows(2) {
            let [(from, left), (to, right)] = [pair[0], pair[1]];
            let duration = (to - from) * self.sample_time;
            // The number of turns between the two phases is that of the mean frequency.
            let expected = 0.5 * (left.omega + right.omega) * duration;
            let rest = right.phase - left.phase - expected;
            let omega = (expected + rest - TAU * (rest / TAU).round()) / duration;
            for n in from.round() as usize..to.round() as usize {
                let share = (n as f64 - from) / (to - from);
                let amplitude = left.amplitude + share * (right.amplitude - left.amplitude);
                let drive = Drive { omega, amplitude, displacement: 0.0 };
                samples.push(Sample {
                    time: n as f64 * self.sample_time,
                    sensors: Sensors { response: self.response[n], reference: Some(self.drive[n]) },
                    command: Command { drive, ..Command::default() },
                    ..Sample::default()
                });
            }
        }
        samples
    }

    /// Refuses channels that are swapped, or of which one has the wrong sign. `cycles`: the periods in which the base moves.
    fn plausible(&self, cycles: &[&Cycle]) -> Result<(), RecordingError> {
        let Self { origin, channels: [response, drive], .. } = self;
        let ratio =
            mean(cycles.iter().map(|cycle| cycle.base.norm())) / mean(cycles.iter().map(|cycle| cycle.amplitude()));
        if ratio > 1.0 {
            return Err(RecordingError(format!(
                "{origin}: channel {drive} (base) is {ratio:.1} times as large as channel {response} (response), and at resonance the response is the \
                 larger one: are the channels swapped, or their units different?"
            )));
        }
        let is_near = |cycle: &Cycle, phase: f64| (cycle.phase_error.abs() - phase).abs() < PHASE_RANGE;
        let near = |phase: f64| cycles.iter().filter(|cycle| is_near(cycle, phase)).count();
        if near(PI) > near(0.0) {
            return Err(RecordingError(format!(
                "{origin}: the response (channel `{response}`) leads the base (channel `{drive}`) by about a quarter of a period, where it lags on \
                 every passive rig: one of the channels has the wrong sign; give it with a negative factor, for instance --drive {drive}:-1"
            )));
        }
        Ok(())
    }

    /// Why less than half of the recording has an oscillation near the natural frequency.
    fn nothing(&self, parts: &[Part], knowledge: &Knowledge) -> RecordingError {
        let linear = &knowledge.linear;
        let Self { origin, channels: [response, _], .. } = self;
        let (hertz, strongest, rate) = (linear.omega0 / TAU, self.strongest(), 1.0 / self.sample_time);
        if (strongest / hertz - 1.0).abs() > NEAR_RESONANCE {
            return RecordingError(format!(
                "{origin}, channel {response}: the strongest oscillation has {strongest:.4} Hz, and the scene's natural frequency is {hertz:.4} Hz. \
                 If the rate of {rate:.6} samples a second is wrong, give it with --rate; if the scene is wrong, give stiffness and mass with --scene"
            ));
        }
        self.without_points(parts, knowledge)
    }

    /// That the base moves, but half of the time far from the phase target, where a part gives no point. The recording is prepared.
    pub(super) fn off_target(&self, knowledge: &Knowledge) -> Option<String> {
        let (knowledge, target) = (self.knowledge(knowledge), knowledge.target.phase);
        let error = |anchor: &Anchor| {
            let error = anchor.response?.phase - anchor.drive?.phase - target;
            Some(error - TAU * (error / TAU).round())
        };
        let mut errors: Vec<f64> = self.anchors(&knowledge).iter().filter_map(error).collect();
        errors.sort_by(f64::total_cmp);
        let (periods, error) = (errors.len(), *errors.get(errors.len() / 2)?);
        let phase = target + error;
        let phase = (phase - TAU * (phase / TAU).round()).to_degrees();
        let Self { origin, channels: [response, drive], .. } = self;
        (error.abs() > PHASE_RANGE).then(|| {
            format!(
                "{origin}: in the {periods} periods in which the base {drive} moves, the phase of the response {response} relative to it is {phase:.1} degrees \
                 (median), and the scene asks for {} degrees. If the rig was held at this phase, give it: --set controller.phase_target={phase:.1}",
                knowledge.numbers.definition.phase_in_degrees()
            )
        })
    }

    /// That nothing in the recording shows 1:1. The recording is prepared.
    pub(super) fn without_points(&self, parts: &[Part], knowledge: &Knowledge) -> RecordingError {
        let Self { origin, channels: [response, drive], .. } = self;
        let regimes: BTreeSet<String> = parts.iter().map(|part| part.regime.to_string()).collect();
        let found = match regimes.into_iter().collect::<Vec<_>>().join(", ") {
            none if none.is_empty() => "no such stretch".into(),
            some => format!("found: {some}"),
        };
        if let Some(message) = self.off_target(knowledge) {
            return RecordingError(message);
        }
        if parts.iter().all(|part| part.kind == Kind::Decay) && self.drive_is_named() {
            return RecordingError(format!(
                "{origin}: the base {drive} rests, and the response {response} decays neither without impacts nor with those of a 1:1 motion: is channel \
                 {drive} connected?"
            ));
        }
        RecordingError(format!(
            "{origin}: no stretch of {LEAST} periods near the phase target is symmetric 1:1 ({found}). A point needs a held response or a slow sweep, \
             where the phase of the response {response} relative to the base {drive} is {} degrees, or a decay",
            knowledge.numbers.definition.phase_in_degrees()
        ))
    }

    /// Frequency of the strongest oscillation at the end of the response, Hz.
    fn strongest(&self) -> f64 {
        let middle = mean(self.response.iter().copied());
        let centred: Vec<f64> = self.response.iter().map(|value| value - middle).collect();
        Line::strongest(&centred).turn / (TAU * self.sample_time)
    }
}

/// Removes what changes slowly: running means over a period of the natural frequency, three times, which the oscillation does not pass, and over
/// [`SLOW`] periods, so that the noise near the natural frequency stays white. At both ends a straight line goes on.
pub(super) fn remove_drift(values: &mut [f64], period: usize) {
    let slow = (SLOW * period).min((values.len() / 2).saturating_sub(2 * period));
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

/// Logarithmic rate of a decay, 1/s: the straight line through the logarithms of the amplitudes, weighted by their uncertainties.
fn rate(fits: &[(f64, &Harmonic)]) -> Estimate {
    let weight = |one: &Harmonic| (one.amplitude / one.uncertainties[0]).powi(2);
    let sum =
        |of: &dyn Fn(f64, &Harmonic) -> f64| fits.iter().map(|(time, one)| weight(one) * of(*time, one)).sum::<f64>();
    let total = sum(&|_, _| 1.0);
    let [middle, level] = [sum(&|time, _| time), sum(&|_, one| one.amplitude.ln())].map(|sum| sum / total);
    let squares = sum(&|time, _| (time - middle).powi(2));
    let slope = sum(&|time, one| (time - middle) * (one.amplitude.ln() - level)) / squares;
    let misfit = sum(&|time, one| (one.amplitude.ln() - level - slope * (time - middle)).powi(2));
    Estimate {
        value: -slope,
        uncertainty: uncertainty(misfit, squares, fits.len()),
    }
}

/// Weighted mean of the frequencies of a decay.
fn omega(fits: &[(f64, &Harmonic)]) -> Estimate {
    let weight = |one: &Harmonic| one.uncertainties[1].powi(-2);
    let total: f64 = fits.iter().map(|(_, one)| weight(one)).sum();
    let value = fits.iter().map(|(_, one)| weight(one) * one.omega).sum::<f64>() / total;
    let misfit = fits
        .iter()
        .map(|(_, one)| weight(one) * (one.omega - value).powi(2))
        .sum();
    Estimate { value, uncertainty: uncertainty(misfit, total, fits.len()) }
}

/// Standard uncertainty of a fit with this sum of weights: the fits of neighbouring periods overlap, and their scatter may exceed the noise.
fn uncertainty(misfit: f64, weights: f64, count: usize) -> f64 {
    (CLOCK_WINDOW.ceil() * (misfit / count as f64).max(1.0) / weights).sqrt()
}

/// Both channels at one time. The base rests, or the response cannot be seen, where there is no oscillation.
struct Anchor {
    /// In samples.
    middle: f64,
    response: Option<Harmonic>,
    drive: Option<Harmonic>,
}

/// Periods of about the same amplitude, near phase resonance, while the base moves.
struct Window<'a> {
    cycles: &'a [Cycle],
    samples: &'a [Sample],
    /// Change of the amplitude in a period, m; 0 if it is noise.
    change: f64,
    /// Amplitude, m, by which the impacts follow the change late. These errors are alike in all windows of a stretch that change the same way.
    late: f64,
}

/// Number of samples.
fn count(cycles: &[Cycle]) -> usize {
    cycles.iter().map(|cycle| cycle.samples).sum()
}

/// The windows of a stretch in which the base moves.
fn windows<'a>(samples: &'a [Sample], cycles: &'a [Cycle]) -> Vec<Window<'a>> {
    let (mut windows, mut rest, mut from) = (Vec::new(), cycles, 0);
    while !rest.is_empty() {
        let level = mean(rest.iter().take(LEAST).map(Cycle::amplitude));
        let belongs = |(n, cycle): &(usize, &Cycle)| {
            let [noise, base_noise] = cycle.noise.map(|variance| 4.0 * variance.sqrt());
            let phase_noise = (noise / level).hypot(base_noise / cycle.base.norm());
            let range = if *n < LEAST { RANGE } else { HELD };
            (cycle.amplitude() - level).abs() <= (range * level).max(noise)
                && cycle.phase_error.abs() <= PHASE_RANGE.max(phase_noise)
        };
        let length = rest.iter().enumerate().take_while(belongs).count();
        let (taken, later) = rest.split_at(length.max(1));
        if length >= LEAST {
            // The impacts follow a move late.
            let (before, cycles) = taken.split_at(if length >= 3 * LEAST { LEAST } else { 0 });
            let samples = &samples[from + count(before)..from + count(taken)];
            windows.push(Window { cycles, samples, change: change(cycles), late: 0.0 });
        }
        (rest, from) = (later, from + count(taken));
    }
    let changes: Vec<f64> = windows.iter().map(|window| window.change).collect();
    for window in &mut windows {
        let alike = changes.iter().filter(|change| **change * window.change > 0.0).count() as f64;
        window.late = LAG * window.change * (alike - 1.0).max(0.0).sqrt();
    }
    windows
}

/// Amplitude of the response, m, drive, m, and frequency, rad/s.
type Held = [f64; 3];

/// The parts of the windows, which are evaluated twice: the points of the first time give the slopes of the second.
fn evaluated(windows: &[Window], knowledge: &Knowledge) -> Vec<Part> {
    let estimate = |window: &Window, before| {
        let largest = window.cycles.iter().map(Cycle::amplitude).fold(0.0, f64::max);
        Criterion { knowledge: *knowledge, precision: 1.0, largest, before }.best(window.cycles)
    };
    let held = |level: LevelEstimate| [level.response.value, level.at[0].value, level.at[1].value];
    let first: Vec<Option<Held>> = windows
        .iter()
        .map(|window| estimate(window, [None; 2]).map(held))
        .collect();
    let mut curve: Vec<Held> = first.iter().copied().flatten().collect();
    curve.sort_by(|first, second| first[0].total_cmp(&second[0]));
    let second = windows.iter().zip(first).map(|(window, first)| {
        let estimate = first.and_then(|first| estimate(window, neighbours(&curve, first)));
        part(window, estimate, &curve, knowledge)
    });
    second.collect()
}

/// Leaves of points with about the same amplitude the best one: their errors are alike, whatever their number.
fn best_of_each_amplitude(parts: &mut [Part]) {
    let u = |point: &MeasuredPoint| point.drive.uncertainty / point.drive.value;
    let points: Vec<MeasuredPoint> = parts.iter().filter_map(|part| part.point).collect();
    for part in parts {
        let is_second = |point: &MeasuredPoint| {
            let better = |next: &MeasuredPoint| {
                (next.response.value / point.response.value - 1.0).abs() < HELD && u(next) < u(point)
            };
            points.iter().any(better)
        };
        part.point = part.point.filter(|point| !is_second(point));
        part.candidate = part.candidate.filter(|point| !is_second(point));
    }
}

/// Change of the amplitude in a period, m; 0 if it is noise.
fn change(cycles: &[Cycle]) -> f64 {
    let change = slope(&cycles.iter().map(Cycle::amplitude).collect::<Vec<f64>>());
    let n = cycles.len() as f64;
    let noise = (12.0 * mean(cycles.iter().map(|cycle| cycle.noise[0])) / n.powi(3)).sqrt();
    if change.abs() > RANDOM * noise { change } else { 0.0 }
}

/// The two points whose amplitudes are next to that of `here`, the nearest last.
fn neighbours(curve: &[Held], here: Held) -> [Option<Held>; 2] {
    let mut others: Vec<Held> = curve
        .iter()
        .copied()
        .filter(|point| (point[0] / here[0] - 1.0).abs() > 2.0 * HELD)
        .collect();
    others.sort_by(|first, second| (first[0] - here[0]).abs().total_cmp(&(second[0] - here[0]).abs()));
    [others.get(1).copied(), others.first().copied()]
}

/// The part of a window.
fn part(window: &Window, estimate: Option<LevelEstimate>, curve: &[Held], knowledge: &Knowledge) -> Part {
    let Window { cycles, samples, change, late } = *window;
    let seconds = [samples[0].time, samples[samples.len() - 1].time];
    let Some(estimate) = estimate else {
        let (kind, regime) = (Kind::Held, Regime::Unknown);
        return Part { seconds, kind, point: None, candidate: None, regime };
    };
    let ([base, omega], level) = (estimate.at, estimate.response);
    let samples = &samples[samples.len() - count(&cycles[cycles.len() - estimate.periods..])..];
    let kind = if (change * cycles.len() as f64).abs() > 2.0 * HELD * level.value {
        Kind::Sweep
    } else {
        Kind::Held
    };
    let regime = regime_by_response(samples, knowledge, base, omega);
    // What the estimate contains once of the lag, and of the phase error in the second order.
    let here = [level.value, base.value, omega.value];
    let slopes = neighbours(curve, here)[1].map_or([0.0; 2], |neighbour| slopes(here, neighbour));
    let beside = estimate.phase_error.value.abs() * base.value / level.value;
    let aside = beside * (omega.value - knowledge.linear.omega0);
    let drive = Estimate::new(base.value, &[base.uncertainty, slopes[0] * late, beside * base.value]);
    let omega = Estimate::new(omega.value, &[omega.uncertainty, slopes[1] * late, aside]);
    // Beyond the amplitude at which the symmetric motion loses its symmetry, noise hides another motion.
    let manifold = Manifold::new(knowledge.numbers.r);
    let largest = manifold.c(B_SYMMETRY_BREAKING) * knowledge.numbers.b;
    let is_symmetric = regime == Regime::Symmetric || (regime == Regime::Unresolved && level.value < largest);
    let is_another = matches!(regime, Regime::Other | Regime::Asymmetric | Regime::Unknown);
    let candidate = point([level, drive, omega], knowledge.target.phase, &knowledge.linear).filter(|_| !is_another);
    let point = candidate.filter(|_| is_symmetric);
    Part { seconds, kind, point, candidate, regime }
}

/// A point from response, drive and frequency at a phase of the response relative to the base, rad, if its uncertainties are small enough.
fn point(measured: [Estimate; 3], phase: f64, linear: &LinearResponse) -> Option<MeasuredPoint> {
    let [response, drive, omega] = linear.resolved(measured);
    let is_known = drive.uncertainty < LARGEST_DRIVE_UNCERTAINTY * drive.value && omega.uncertainty.is_finite();
    (drive.value > 0.0 && is_known).then_some(MeasuredPoint { response, omega, drive, phase })
}

/// Slopes of drive and frequency over the amplitude.
fn slopes(here: Held, neighbour: Held) -> [f64; 2] {
    [1, 2].map(|i| (neighbour[i] - here[i]) / (neighbour[0] - here[0]))
}

/// The points of a decay, with `E = -A'/g`. The fits do not overlap.
fn decay(anchors: &[Anchor], linear: &LinearResponse, sample_time: f64) -> Vec<Part> {
    let apart = CLOCK_WINDOW.ceil() as usize;
    let fits: Vec<(f64, Harmonic)> = anchors
        .iter()
        .step_by(apart)
        .filter_map(|anchor| Some((anchor.middle * sample_time, anchor.response?)))
        .collect();
    let held = |harmonic: &Harmonic| {
        let gain = 0.5 * linear.omega0 * linear.omega0 / harmonic.omega;
        [harmonic.amplitude, -harmonic.rate / gain, harmonic.omega]
    };
    // The impacts have ended where what remains is the damping of the structure.
    let damping = linear.damping_rate;
    let taken = |harmonic: &Harmonic| -harmonic.rate - damping * harmonic.amplitude;
    let at_first = fits.first().map_or(0.0, |(_, harmonic)| taken(harmonic));
    // Without impacts nothing is taken but by an error of the damping.
    let has_impacts = |harmonic: &Harmonic| taken(harmonic) > 0.5 * f64::max(at_first, damping * harmonic.amplitude);
    let synchronous: Vec<_> = fits.iter().take_while(|(_, harmonic)| has_impacts(harmonic)).collect();
    let count = synchronous.len() as f64;
    let half = 0.5 * CLOCK_WINDOW * TAU / linear.omega0;
    // The rest of the decay: the loss that the scene states may hide the impacts there.
    let rest = &fits[synchronous.len().saturating_sub(1)..];
    let rest = rest.first().zip(rest.last()).map(|((from, _), (to, _))| Part {
        seconds: [from - half, to + half],
        kind: Kind::Decay,
        point: None,
        candidate: None,
        regime: Regime::NotEstablished,
    });
    synchronous
        .windows(2)
        .map(|pair| {
            let [(time, harmonic), (_, next)] = [pair[0], pair[1]];
            let here = held(harmonic);
            let slopes = slopes(here, held(next));
            let late = LAG * harmonic.rate * TAU / harmonic.omega;
            let gain = -harmonic.rate / here[1];
            // A misfit of one balance widens the other one as well: both have the same samples.
            let units = [1.0, harmonic.amplitude / gain];
            let systematic = (slopes[0] * late).hypot(units[1] * slopes[1] * late) * count.sqrt();
            let [u_amplitude, u_omega] = harmonic.uncertainties;
            let u_rate = u_omega * harmonic.amplitude;
            let drive = Estimate::new(here[1], &[u_rate / gain, systematic]);
            let omega = Estimate::new(harmonic.omega, &[u_omega, systematic / units[1]]);
            let response = Estimate { value: harmonic.amplitude, uncertainty: u_amplitude };
            // Without a drive, the motion is the one of phase resonance.
            let point = point([response, drive, omega], -FRAC_PI_2, linear);
            Part {
                seconds: [time - half, time + half],
                kind: Kind::Decay,
                point,
                candidate: point,
                regime: Regime::Unresolved,
            }
        })
        .chain(rest)
        .collect()
}
