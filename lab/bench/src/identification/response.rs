//! The regime from the response alone, as on a real rig.
//!
//! Two impacts per period at even intervals excite odd harmonics, and uneven impacts even ones, too: most of all those near another mode of the
//! structure, so that as many are fitted as the samples can show. Irregular impacts make amplitude
//! and phase fluctuate, which leaves a residual. The motion without impacts is the linear mode: response over base is as in a
//! linear test at small amplitude, which the loop check makes.

use std::f64::consts::{PI, TAU};
use std::fmt::{self, Display, Formatter};

use nalgebra::{DVector, RowVector3};
use num_complex::Complex64;
use serde::Serialize;
use vines_estimate::{HarmonicBasis, transform};
use vines_model::numerics::{Estimate, complex_fit, golden_section, mean};
use vines_model::regime::{Impact, MEASURED, Regime, one_to_one};

use super::{Cycle, most_harmonics};
use crate::record::Sample;
use vines_scene::knowledge::Knowledge;
use vines_scene::linear::{Impacts, impacts_by_harmonic, impacts_by_resonance};
use vines_scene::scene::{Definition, Dimensionless, Sensor};

/// Largest residual of a steady motion, relative to the amplitude, unless it is noise.
const STEADY_RESIDUAL: f64 = 3e-3;
/// Smallest standard deviation of third differences, scaled to white noise, over the residual of a motion with noise alone: white noise has 1.
const NOISE_SHARE: f64 = 0.5;
/// Largest number of foreign tones that are subtracted: mains hum and its harmonics.
const LINES: usize = 8;
/// Smallest significant harmonic, in standard errors.
const SIGNIFICANT_HARMONIC: f64 = 4.0;
/// Smallest even harmonic of an asymmetric motion, over the larger odd one next to it: of the second over the third, symmetric motions have about
/// 0.01, irregular ones 2 and more.
const ASYMMETRIC: f64 = 0.5;

/// A straight line and all harmonics that the samples can show, whose amplitudes are quadratic in time for the fundamental, and constant for the others,
/// for `n` samples `turn` rad of the motion apart.
fn basis(n: usize, turn: f64) -> HarmonicBasis {
    let phases: Vec<f64> = (0..n).map(|n| n as f64 * turn).collect();
    HarmonicBasis::new(&phases, [1, 2], most_harmonics(TAU / turn))
}

/// Harmonic content of what a channel reads, relative to its fundamental.
#[derive(Debug, Clone)]
struct Content {
    /// How often the sensor differentiates the displacement.
    order: i32,
    /// Amplitude of the fundamental, as it is read.
    amplitude: f64,
    /// Amplitudes of the harmonics from the second on, relative.
    harmonics: Vec<f64>,
    /// Their standard errors: by noise, and what a change of the motion adds.
    errors: Vec<f64>,
    /// RMS of the residual, relative, and its part that is noise.
    rest: f64,
    noise: f64,
    /// Foreign tones, which are not part of the residual.
    tones: Vec<Line>,
    samples_per_period: usize,
}

impl Content {
    /// Whether a residual is left that is not noise.
    fn is_irregular(&self) -> bool {
        self.rest > STEADY_RESIDUAL && self.noise < NOISE_SHARE * self.rest
    }

    /// Whether an even harmonic is more than noise and more than [`ASYMMETRIC`] of the larger odd one next to it, as displacements. The probability of a
    /// false alarm does not depend on the number of harmonics.
    fn is_asymmetric(&self) -> bool {
        let displacement = |n: usize| {
            self.harmonics
                .get(n - 2)
                .map_or(0.0, |harmonic| harmonic / (n as f64).powi(self.order))
        };
        // Of N samples per period, the odd harmonic N - k looks like k. Up to a third of N it has half of the velocity of those next to k at most.
        let even = (2..self.harmonics.len().min(self.samples_per_period / 3) + 2).step_by(2);
        let significant = (SIGNIFICANT_HARMONIC.powi(2) + 2.0 * (even.len() as f64).ln()).sqrt();
        let neighbour = |n: usize| displacement(n + 1).max(if n > 2 { displacement(n - 1) } else { 0.0 });
        even.clone().any(|n| {
            self.harmonics[n - 2] > significant * self.errors[n - 2] && displacement(n) > ASYMMETRIC * neighbour(n)
        })
    }

    /// Fits what a channel reads, 0 the response or 1 the reference, of a motion of the frequency `omega`, rad/s; `None` for too few samples or no motion.
    /// `is_moving`: the motion may change in the meantime.
    fn of(samples: &[Sample], knowledge: &Knowledge, omega: f64, channel: usize, is_moving: bool) -> Option<Self> {
        let reading = |sample: &Sample| match channel {
            0 => sample.sensors.response,
            _ => sample.sensors.reference.unwrap_or(f64::NAN),
        };
        // The phase of the response is more uniform than the phase of a drive that a loop still corrects.
        let (n, turn) = (samples.len(), omega * knowledge.sample_time);
        let mut values = DVector::from_iterator(n, samples.iter().map(reading));
        let of_all = basis(n, turn);
        if n < 2 * of_all.terms() {
            return None;
        }
        let fitted = |values: &DVector<f64>| Self::fitted(&of_all, values, omega, knowledge, channel);
        let (mut content, mut rest) = fitted(&values)?;
        let mut lines: Vec<Line> = Vec::new();
        // Tones and harmonics are fitted in turn: what a tone has in common with the harmonics remains in the residual.
        while channel == 0 && content.is_irregular() && lines.len() < LINES {
            let line = Line::strongest(rest.as_slice());
            let is_known = |known: &Line| (known.turn - line.turn).abs() < TAU / n as f64;
            if !line.is_foreign(knowledge) && !lines.iter().any(is_known) {
                break;
            }
            values -= DVector::from_fn(n, |n, _| line.at(n));
            lines.push(line);
            (content, rest) = fitted(&values)?;
        }
        let content = Self { tones: lines, ..content };
        match is_moving {
            true => content.changed(&values, turn),
            false => Some(content),
        }
    }

    /// With what a change of the motion, as both halves of the values show it, adds to the errors of the harmonics.
    fn changed(mut self, values: &DVector<f64>, turn: f64) -> Option<Self> {
        let (n, half) = (values.len(), values.len() / 2);
        let of_half = basis(half, turn);
        let [first, second] =
            [0, n - half].map(|from| of_half.fit(&DVector::from_column_slice(&values.as_slice()[from..][..half])));
        let halves = [first?, second?];
        for (n, error) in (2..).zip(&mut self.errors) {
            // Harmonics keep their phase relative to the fundamental.
            let [one, two] = halves.each_ref().map(|fit| {
                let (size, phase) = fit.harmonic(1).to_polar();
                fit.harmonic(n) * Complex64::cis(-(n as f64) * phase) / size
            });
            // Noise alone changes them by 2 error² in the mean.
            let change = 0.25 * (one - two).norm_sqr() - 2.0 * error.powi(2);
            *error = error.hypot(change.max(0.0).sqrt());
        }
        Some(self)
    }

    /// The content of these values of a channel, and their residual.
    fn fitted(
        basis: &HarmonicBasis,
        values: &DVector<f64>,
        omega: f64,
        knowledge: &Knowledge,
        channel: usize,
    ) -> Option<(Self, DVector<f64>)> {
        let Knowledge { sample_time, target, .. } = *knowledge;
        let n = values.len();
        let fit = basis.fit(values)?;
        let amplitude = fit.harmonic(1).norm();
        if amplitude == 0.0 || !amplitude.is_finite() {
            return None;
        }
        let rms = fit.noise.sqrt() / amplitude;
        // Behind a filter a converter and a remainder of the motion are as white as before.
        let coloured = |k: usize| target.colour(k as f64 * omega, sample_time).max(1.0);
        let error = |k: usize| rms * (2.0 / n as f64 * coloured(k)).sqrt();
        let harmonics: Vec<f64> = (2..=fit.harmonics())
            .map(|n| fit.harmonic(n).norm() / amplitude)
            .collect();
        let content = Self {
            order: target.measurands[channel].order(),
            amplitude,
            errors: (2..=fit.harmonics()).map(error).collect(),
            harmonics,
            rest: rms,
            noise: target.noise(fit.rest.as_slice(), sample_time) / amplitude,
            tones: Vec::new(),
            samples_per_period: (TAU / (omega * sample_time)) as usize,
        };
        Some((content, fit.rest))
    }
}

/// The largest foreign tone in the response of these samples, if they would be irregular with it. `omega` (rad/s) is the frequency of the motion.
pub(crate) fn foreign_tone(samples: &[Sample], knowledge: &Knowledge, omega: f64) -> Option<Tone> {
    let content = Content::of(samples, knowledge, omega, 0, false)?;
    let tones = content.tones.iter();
    let largest = tones.max_by(|a, b| a.amplitude().total_cmp(&b.amplitude()))?;
    Some(Tone {
        hertz: largest.turn / (TAU * knowledge.sample_time),
        share: largest.amplitude() / content.amplitude,
    })
}

/// These samples without the foreign tones in their response; `None` if there are none.
pub(crate) fn without_tones(samples: &[Sample], knowledge: &Knowledge, omega: f64) -> Option<Vec<Sample>> {
    let tones = Content::of(samples, knowledge, omega, 0, false)?.tones;
    let mut cleaned = samples.to_vec();
    for (n, sample) in cleaned.iter_mut().enumerate() {
        sample.sensors.response -= tones.iter().map(|line| line.at(n)).sum::<f64>();
    }
    (!tones.is_empty()).then_some(cleaned)
}

/// Harmonics 2 to 7 of the reference over its first; `None` without a reference, and where the samples do not show all of them.
pub fn drive_harmonics(samples: &[Sample], knowledge: &Knowledge, omega: f64) -> Option<[f64; 6]> {
    let content = Content::of(samples, knowledge, omega, 1, false)?;
    content.harmonics.first_chunk().copied()
}

/// Cycles of periods that a bifurcation of a 1:1 motion leads to and locks in place, the strong resonances of two to four periods: number of periods, and
/// turns in them.
const CYCLES: [(usize, usize); 5] = [(2, 1), (3, 1), (3, 2), (4, 1), (4, 3)];

/// The number of periods after which the motion in these samples of a hold repeats, if it is more than one. `omega` (rad/s): its frequency.
///
/// The responses of the periods are a complex number each. Without their trend, noise is as large at a subharmonic as at other frequencies,
/// or smaller, because loops are slow. A subharmonic of the power P, of n periods with the remaining power Q, then exceeds `P/Q` with the probability
/// `(1 + P/Q)^-(n-4)`. The samples that differ from their harmonics within a period are noise at least.
pub(crate) fn subharmonic(samples: &[Sample], knowledge: &Knowledge, omega: f64) -> Option<usize> {
    let cleaned = without_tones(samples, knowledge, omega);
    let cycles = Cycle::all(cleaned.as_deref().unwrap_or(samples), 0.0, knowledge);
    let row = |k: usize| {
        let time = Complex64::from(2.0 * k as f64 / cycles.len() as f64 - 1.0);
        RowVector3::new(Complex64::ONE, time, time * time)
    };
    let (trend, _) = complex_fit(cycles.iter().enumerate().map(|(k, cycle)| (row(k), cycle.response)))?;
    let deviation = |(k, cycle): (usize, &Cycle)| cycle.response - (row(k) * trend)[0];
    let deviations: Vec<Complex64> = cycles.iter().enumerate().map(deviation).collect();
    let free = cycles.len() as f64 - 4.0;
    let noise = 2.0 * mean(cycles.iter().map(|cycle| cycle.noise[0]));
    let total: f64 = deviations.iter().map(Complex64::norm_sqr).sum();
    let chance = |(periods, turns): (usize, usize)| {
        let line = transform(&deviations, TAU * turns as f64 / periods as f64);
        let power = line.norm_sqr() / cycles.len() as f64;
        (1.0 + power / (total - power).max(free * noise)).powf(-free)
    };
    let lines = CYCLES.map(|cycle| (cycle.0, chance(cycle)));
    let (periods, chance) = lines.into_iter().min_by(|one, other| one.1.total_cmp(&other.1))?;
    (chance * (lines.len() as f64) < (-0.5 * SIGNIFICANT_HARMONIC.powi(2)).exp()).then_some(periods)
}

/// Periods from which a regime is determined.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Span {
    /// A few periods under the control of a loop, for the choice of the next move. What the harmonics do not describe is the way of the setpoint.
    Moving,
    /// A few periods at a setpoint that rests, for the choice of the next move.
    AtRest,
    /// A hold, or a level.
    Held,
}

/// The regime determined from the response of these samples. `at`: mean response, m, the base, m, that holds it at the phase target, and frequency, rad/s.
///
/// Impacts need evidence: frequency and loss that no particle between carried and free produces; without a linear response that was measured on
/// the rig, a third harmonic that none produces.
pub(crate) fn regime_by_response(samples: &[Sample], knowledge: &Knowledge, at: [Estimate; 3], span: Span) -> Regime {
    let (target, omega) = (knowledge.target, at[2].value);
    let Some(content) = Content::of(samples, knowledge, omega, 0, span != Span::Held) else {
        return Regime::Unknown;
    };
    if span != Span::Moving && content.is_irregular() {
        return Regime::Other;
    }
    let Dimensionless { epsilon, definition, omega0, .. } = knowledge.numbers;
    let third = Estimate { value: content.harmonics[1], uncertainty: content.errors[1] };
    let has_third = third.value > SIGNIFICANT_HARMONIC * third.uncertainty;
    // The force on the mass M over its inertia in the fundamental.
    let square = (3.0 * omega / omega0).powi(2);
    let force = third.scaled(9.0 * (square - 1.0) / over_v(definition, square));
    // The parameters of a simulation are known; for the choice of a move, they count as known.
    let is_known =
        span != Span::Held || knowledge.is_measured || samples.iter().any(|sample| sample.ground_truth.is_some());
    let by_resonance = match is_known {
        true => impacts_by_resonance(&knowledge.linear, at, target.phase, epsilon),
        false => Impacts::Doubtful,
    };
    // Behind a shaker the reference also contains the impacts, and more of them where the stinger resonates.
    let of_reference = || Content::of(samples, knowledge, omega, 1, false);
    let is_asymmetric = || {
        content.is_asymmetric() || knowledge.shaker.is_some() && of_reference().is_some_and(|one| one.is_asymmetric())
    };
    // Where the resonance does not tell, a third harmonic may.
    let by_harmonic = has_third && impacts_by_harmonic(force, epsilon) == Impacts::Needed;
    match by_resonance {
        Impacts::NotNeeded => Regime::NoImpacts,
        Impacts::Doubtful if !by_harmonic => Regime::NotEstablished,
        _ if is_asymmetric() => Regime::Asymmetric,
        _ if has_third => Regime::Symmetric,
        _ => Regime::Unresolved,
    }
}

// Foreign tones: lines in the response that no motion of the particle produces.
//
// The response belongs to a linear oscillator, which only its base and the particle excite. The particle stays in its cavity: a line of its
// relative position has at most the amplitude 4b/π, as a square wave has. With x = ω/ω0, a line of the response v therefore has at most
// the amplitude `4 epsilon b/(π |x² - 1|)`, of q1 x² times as much, of its velocity x³ and of its acceleration x⁴ times as much, whatever the
// motion: irregular, period-doubled or quasi-periodic. A larger line comes from a sensor or a cable, for instance from the mains.

/// Smallest foreign tone, over the largest line of a motion: epsilon and b are known within a factor of two.
const ABOVE: f64 = 2.0;

/// Largest number of values in which a line is searched for: the work grows with the square of it.
const SEARCHED: usize = 2048;

/// A sine in the response that is not part of the motion.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Tone {
    /// Frequency, Hz.
    pub hertz: f64,
    /// Amplitude over the response.
    pub share: f64,
}

impl Display for Tone {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "a foreign tone of {:.1} Hz, {:.1} % of the response",
            self.hertz,
            100.0 * self.share
        )
    }
}

/// A line of a signal.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Line {
    /// Frequency, rad per sample.
    pub turn: f64,
    /// Complex amplitude a of `Re(a exp(i turn n))`.
    phasor: Complex64,
}

impl Line {
    /// The strongest line of these values; where there are many, the strongest of the last ones.
    pub fn strongest(values: &[f64]) -> Self {
        let power = |values: &[f64], turn: f64| transform(values, turn).norm_sqr();
        let highest = |values: &[f64], turn: f64, width: f64| {
            golden_section(turn - width, turn + width, |turn| -power(values, turn))
        };
        let last = &values[values.len().saturating_sub(SEARCHED)..];
        let [bin, fine] = [last.len(), values.len()].map(|count| PI / count as f64);
        let bins = (1..last.len()).map(|k| k as f64 * bin);
        let (coarse, _) = bins
            .map(|turn| (turn, power(last, turn)))
            .fold((bin, 0.0), |best, next| if next.1 > best.1 { next } else { best });
        let turn = highest(values, highest(last, coarse, bin), fine);
        let phasor = transform(values, turn) * (2.0 / values.len() as f64);
        Self { turn, phasor }
    }

    pub fn amplitude(&self) -> f64 {
        self.phasor.norm()
    }

    /// The value at a sample.
    pub fn at(&self, sample: usize) -> f64 {
        (self.phasor * Complex64::cis(self.turn * sample as f64)).re
    }

    /// Whether no motion of the particle produces it.
    fn is_foreign(&self, Knowledge { numbers: d, sample_time, .. }: &Knowledge) -> bool {
        let square = (self.turn / (sample_time * d.omega0)).powi(2);
        let largest = 4.0 / PI * d.epsilon * d.b * over_v(d.definition, square) / (square - 1.0).abs();
        self.amplitude() > ABOVE * largest
    }
}

/// A line of what a sensor reads over the line of v, relative to their fundamentals; `square`: of its frequency over omega0.
fn over_v(definition: Definition, square: f64) -> f64 {
    match definition.sensor {
        Sensor::V => 1.0,
        Sensor::Q1 => square * square.sqrt().powi(definition.sensor_quantity.order()),
    }
}

// The regime, from the impacts that a simulated rig reports.

/// The impacts in the samples; of several between two samples, the last one.
pub(super) fn impacts(samples: &[Sample]) -> Vec<Impact> {
    let truths: Vec<_> = samples.iter().filter_map(|sample| sample.ground_truth).collect();
    truths
        .windows(2)
        .filter(|pair| pair[1].impacts > pair[0].impacts)
        .map(|pair| Impact { time: pair[1].impact_time, velocity: pair[1].impact_velocity })
        .collect()
}

/// Impacts per period of `omega` (rad/s) over the samples, and the regime they make.
pub(crate) fn classify(samples: &[Sample], sample_time: f64, omega: f64) -> (f64, Regime) {
    let mut truths = samples.iter().filter_map(|sample| sample.ground_truth);
    let (Some(first), Some(last)) = (truths.next(), truths.next_back()) else {
        return (f64::NAN, Regime::Unknown);
    };
    let impacts = impacts(samples);
    let (Some(from), Some(to)) = (impacts.first(), impacts.last()) else {
        return (0.0, Regime::NoImpacts);
    };
    let (span, period) = (to.time - from.time, TAU / omega);
    // Counted from impact to impact, so that the ends of the record have no influence.
    let count = (last.impacts - first.impacts) as f64;
    let per_period = if span > 0.0 {
        (count - 1.0) * period / span
    } else {
        count * period / (samples.len() as f64 * sample_time)
    };
    (per_period, one_to_one(&impacts, per_period, MEASURED))
}

#[cfg(test)]
mod tests {
    use vines_scene::scene::Scene;

    use super::*;
    use crate::rig::{Command, Drive, Simulated};

    #[test]
    fn no_motion_of_a_particle_is_a_foreign_tone() {
        let quantities = ["displacement", "displacement", "velocity", "acceleration"];
        let mut irregular = 0;
        // Values that fill their intervals evenly.
        for n in 0..60 {
            let share = |k: u32| (0.5 + f64::from(n) * 0.754_877_666_246_692_7_f64.powi(k as i32)).fract();
            let between = |k: u32, low: f64, high: f64| low * (high / low).powf(share(k));
            let settings = [
                format!("plant.m={}", 3.807 * between(1, 0.001, 0.05)),
                format!("plant.r={}", 0.3 + 0.65 * share(2)),
                format!("excitation.G={}", between(3, 0.1, 4.0)),
                format!("resonance.sensor={}", if n % 4 == 0 { "v" } else { "q1" }),
                format!("resonance.sensor_quantity={}", quantities[n as usize % 4]),
            ];
            let overrides = settings.each_ref().map(|setting| setting.parse().unwrap());
            let scene = Scene::load(None, &overrides).unwrap();
            let omega = scene.dimensionless().omega(6.0 * share(4) - 3.0);
            let drive = Drive { omega, amplitude: scene.amplitude, ..Drive::default() };
            let knowledge = scene.knowledge();
            let knowledge = knowledge.measured(knowledge.linear);
            let step = scene.sample_time();
            let mut rig = Simulated::of(&scene).unwrap();
            let samples: Vec<Sample> = (0..6000)
                .map(|n| {
                    let (time, sensors) = (step * f64::from(n), knowledge.target.scaled(rig.sense().unwrap()));
                    rig.advance(drive, step).unwrap();
                    let command = Command { drive, ..Command::default() };
                    Sample { time, sensors, command, ..Sample::default() }
                })
                .collect();
            // The first of these windows contains the transient.
            for window in [&samples[1000..3000], &samples[4000..]] {
                assert_eq!(foreign_tone(window, &knowledge, drive.omega), None, "{settings:?}");
                let exact = |value| Estimate { value, uncertainty: 0.0 };
                let at = [knowledge.numbers.b, drive.amplitude, drive.omega].map(exact);
                let regime = regime_by_response(window, &knowledge, at, Span::Held);
                irregular += usize::from(regime == Regime::Other);
            }
        }
        assert!(irregular >= 30);
    }
}
