//! Harmonics of the sensor signals over one period of the drive.

use std::f64::consts::TAU;

use nalgebra::{Complex, DVector};
use vines_estimate::HarmonicBasis;
use vines_model::numerics::mean;

use super::{HARMONICS, most_harmonics};
use crate::record::{Sample, drive_phases};
use vines_scene::knowledge::Knowledge;
use vines_scene::scene::Measurand;

/// Harmonics of the sensor signals over one period of the drive.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cycle {
    /// Mean time, s.
    pub time: f64,
    /// Mean phase of the drive, rad, counted on from period to period.
    pub drive_phase: f64,
    /// Mean frequency of the drive, rad/s.
    pub omega: f64,
    /// Fundamental of the commanded base motion, m, without noise, or of the measured reference behind a shaker.
    pub commanded: Complex<f64>,
    /// Fundamental of the response relative to the drive's phase, m: `Im a exp(i phase)`.
    pub response: Complex<f64>,
    /// Fundamental of the base, m: measured if a sensor reads it, otherwise commanded.
    pub base: Complex<f64>,
    /// Phase error, rad: response minus base minus target.
    pub phase_error: f64,
    /// Variances of the fundamental of response and base by the noise of the sensors, m², if it is white: of each of its two components.
    pub noise: [f64; 2],
    /// Second harmonics of response and base, scaled as their fundamentals are, m.
    pub second: [Complex<f64>; 2],
    /// Number of samples.
    pub samples: usize,
}

impl Cycle {
    /// The samples of one period; `phase` (rad): phase of the drive at the first. `None` for too few samples.
    pub fn of(samples: &[Sample], phase: f64, knowledge: &Knowledge) -> Option<Self> {
        let Knowledge { sample_time, target, .. } = *knowledge;
        // Offset, sine and cosine of the harmonics, and the drift of the first.
        if samples.len() <= 2 * HARMONICS + 3 {
            return None;
        }
        let phases = drive_phases(samples, sample_time, phase);
        let mean_omega = mean(samples.iter().map(|s| s.command.drive.omega));
        let drive_phase = mean(phases.iter().copied());
        // The response does not follow every change of the drive's frequency: its phase grows uniformly.
        let middle = 0.5 * (samples.len() - 1) as f64;
        let uniform: Vec<f64> = (0..samples.len())
            .map(|n| drive_phase + (n as f64 - middle) * sample_time * mean_omega)
            .collect();
        let all = most_harmonics(samples.len() as f64);
        // Impacts jerk the force of a shaker as they jerk an acceleration.
        let in_base = if target.through_shaker { all } else { HARMONICS };
        let in_response = match target.measurands[0] {
            Measurand::Displacement => HARMONICS,
            _ => all,
        };
        // The first harmonic drifts as well: a change of the amplitude within the period is not noise.
        let with_drift = |count: usize| [0, 1].map(|drift| HarmonicBasis::new(&uniform, [0, drift], count));
        let of_base = with_drift(in_base);
        let of_response = (in_response != in_base).then(|| with_drift(in_response));
        let bases = [of_response.as_ref().unwrap_or(&of_base), &of_base];
        let [basis, drifting] = &of_base;
        let fitted = |channel: usize, value: fn(&Sample) -> f64| {
            let values = DVector::from_iterator(samples.len(), samples.iter().map(value));
            let [fit, noise] = bases[channel].each_ref().map(|basis| basis.fit(&values));
            let (fit, noise) = (fit?, noise?.noise);
            // Above many harmonics a sensor shows impacts rather than noise.
            let least = if fit.harmonics() > HARMONICS { 0 } else { HARMONICS };
            let coloured = target.colour_of_fundamental(mean_omega, sample_time, least);
            let displacement = target.displacement(channel, mean_omega);
            let harmonics = [1, 2].map(|n| fit.harmonic(n) * displacement);
            let variance = noise * coloured * 2.0 / samples.len() as f64;
            Some((harmonics, variance * displacement.norm_sqr()))
        };
        let ([response, second], noise) = fitted(0, |s| s.sensors.response)?;
        let mean = |value: fn(&Sample) -> f64| mean(samples.iter().map(value));
        // The amplitude commanded at a sample begins there; a sensor reads what the one before left.
        let before = |n: usize| samples[n.saturating_sub(1)].command.drive.amplitude;
        let motion =
            |amplitude: &dyn Fn(usize) -> f64| DVector::from_fn(samples.len(), |n, _| amplitude(n) * phases[n].sin());
        let mut commanded = drifting
            .fit(&motion(&|n| 0.5 * (before(n) + samples[n].command.drive.amplitude)))?
            .harmonic(1);
        let as_read = basis.fit(&motion(&before))?.harmonic(1);
        let measured = samples.iter().all(|s| s.sensors.reference.is_some());
        let (base, base_second, base_noise, phase_error) = if measured {
            let ([mut base, second], noise) = fitted(1, |s| s.sensors.reference.unwrap_or(0.0))?;
            match target.through_shaker {
                true => commanded = base,
                false => base = base * commanded / as_read,
            }
            let phase_error = (response * base.conj() * Complex::from_polar(1.0, -target.phase)).arg();
            (base, second, noise, phase_error)
        } else {
            let base = mean(|s| s.command.drive.amplitude) * target.base_per_sample(mean_omega, sample_time);
            let asked = DVector::from_iterator(samples.len(), samples.iter().map(|s| s.command.drive.displacement));
            let asked = basis.fit(&asked).map(|fit| fit.harmonic(1));
            let phase_error = match asked.filter(|asked| *asked != Complex::ZERO) {
                // The drive of then. (The estimate of a controller is of some periods before.)
                Some(asked) => {
                    let late = Complex::from_polar(1.0, mean_omega * target.delay - target.phase);
                    (response * asked.conj() * late).arg()
                }
                // A controller that tells no displacement compensates the delay.
                None => mean(|s| s.command.phase_error.unwrap_or(0.0)),
            };
            (Complex::new(base, 0.0), Complex::ZERO, 0.0, phase_error)
        };
        Some(Self {
            commanded,
            time: mean(|s| s.time),
            drive_phase,
            omega: mean_omega,
            response,
            base,
            phase_error,
            noise: [noise, base_noise],
            second: [second, base_second],
            samples: samples.len(),
        })
    }

    /// The complete periods of the drive in these samples, in order; `start`: phase of the drive at the first sample, turns.
    pub fn all(samples: &[Sample], start: f64, knowledge: &Knowledge) -> Vec<Self> {
        let (mut cycles, mut begin, mut turns, mut phase) = (Vec::new(), 0, start, start);
        for (n, sample) in samples.iter().enumerate() {
            turns += sample.command.drive.omega * knowledge.sample_time / TAU;
            if turns >= f64::floor(phase) + 1.0 {
                cycles.extend(Self::of(&samples[begin..=n], phase * TAU, knowledge));
                (begin, phase) = (n + 1, turns);
            }
        }
        cycles
    }

    /// Standard deviations of each component of the fundamentals of response and base in some periods by the noise of the sensors, m: what the samples of
    /// a period show, or behind a filter, which leaves little of that, what changes the second harmonics of a motion that is held.
    pub fn noise_of(cycles: &[Self], is_held: bool) -> [f64; 2] {
        [0, 1].map(|n| {
            let white = mean(cycles.iter().map(|cycle| cycle.noise[n]));
            let changes = cycles
                .windows(2)
                .map(|pair| (pair[1].second[n] - pair[0].second[n]).norm_sqr());
            let changed = if is_held { mean(changes) / 4.0 } else { 0.0 };
            white.max(changed).sqrt()
        })
    }

    /// Amplitude of the response, m.
    pub fn amplitude(&self) -> f64 {
        self.response.norm()
    }
}
