//! Whether the lock of a controller that does not say so has settled.

use std::f64::consts::TAU;

use phase_lock::Config;
use vines_model::numerics::{mean, range};

use super::Period;
use crate::identification::Cycle;
use crate::record::Sample;
use vines_scene::knowledge::Target;

/// Range of noise, in standard deviations: ten independent normal values exceed it with a probability of 5 % (studentised range).
const NOISE_RANGE: f64 = 4.5;
/// Parts of the dwell whose means are compared.
const DWELL_PARTS: usize = 4;

/// Judges a lock by the periods of the drive, as the bench fits them.
///
/// The lock has settled if the mean phase error is within its tolerance, and frequency and amplitude are constant over the dwell, but for the
/// allowed drift. Where noise hides that, twice the dwell is judged, and noise may explain a part of their ranges. The response shows how much:
///
/// - The amplitude of a period scatters by the noise of its fit.
/// - The loop is not known, but the structure is: its phase turns by the difference between its frequency and that of the drive. A phase that
///   scatters by `u` therefore belongs to a frequency that scatters by `u` per period at most.
///
/// The means of the quarters are compared as well, with the scatter from period to period that is really there: a slow change has little.
pub(super) struct Judge {
    config: Config,
    target: Target,
    /// The present period, and the last complete ones: at most two dwells.
    begins: Period,
    cycles: Vec<Cycle>,
    settled: bool,
}

/// A condition of a settled lock.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Condition {
    /// What must be small: a phase in rad, or a relative range.
    pub name: &'static str,
    /// The parameter of the lock criterion that bounds it.
    pub key: &'static str,
    /// Its value over the last periods.
    pub found: f64,
    /// Largest allowed value.
    pub allowed: f64,
}

impl Judge {
    /// By the lock criterion of a configuration.
    pub fn new(config: &Config, target: Target) -> Self {
        Self {
            config: *config,
            target,
            begins: (0, 0.0),
            cycles: Vec::new(),
            settled: false,
        }
    }

    /// Takes the last of these samples, after which the drive has turned `turns` times since the start. Returns whether the lock has settled.
    pub fn sample(&mut self, samples: &[Sample], turns: f64) -> bool {
        let (begin, before) = self.begins;
        if turns < before.floor() + 1.0 {
            return self.settled;
        }
        self.begins = (samples.len(), turns);
        let period = samples.get(begin..).unwrap_or_default();
        match Cycle::of(period, self.config.sample_time, before * TAU, self.target) {
            Some(cycle) => self.cycles.push(cycle),
            None => self.cycles.clear(),
        }
        let dwell = self.config.lock.dwell as usize;
        self.cycles.drain(..self.cycles.len().saturating_sub(2 * dwell));
        let last = &self.cycles[self.cycles.len().saturating_sub(dwell)..];
        self.settled = last.len() == dwell && self.is_steady(last, 0.0)
            || self.cycles.len() == 2 * dwell && self.is_steady(&self.cycles, NOISE_RANGE);
        self.settled
    }

    /// The condition that the last two dwells do not meet; `None` before them.
    pub fn unmet(&self) -> Option<Condition> {
        let is_long = self.cycles.len() == 2 * self.config.lock.dwell as usize;
        let conditions = is_long.then(|| self.conditions(&self.cycles, NOISE_RANGE));
        conditions?.into_iter().find(|one| one.found > one.allowed)
    }

    fn is_steady(&self, cycles: &[Cycle], noise_range: f64) -> bool {
        let conditions = self.conditions(cycles, noise_range);
        conditions.iter().all(|one| one.found <= one.allowed)
    }

    /// Of the mean phase error, and of the ranges of frequency and amplitude from period to period and from part to part. `noise_range`: range that
    /// noise explains, in standard deviations.
    fn conditions(&self, cycles: &[Cycle], noise_range: f64) -> [Condition; 5] {
        let of = |value: fn(&Cycle) -> f64| mean(cycles.iter().map(value));
        let (response, base) = (of(Cycle::amplitude), of(|cycle| cycle.base.norm()));
        let [noise, base_noise] = [0, 1].map(|i| mean(cycles.iter().map(|cycle| cycle.noise[i])).sqrt());
        let noise = noise_range * noise / response;
        let phase_noise = noise.hypot(noise_range * base_noise / base);
        let lock = &self.config.lock;
        let condition = |name, key, [found, allowed]: [f64; 2]| Condition { name, key, found, allowed };
        let frequency = ranges(cycles, |cycle| cycle.omega, lock.frequency_drift, phase_noise / TAU);
        let amplitude = ranges(cycles, Cycle::amplitude, lock.amplitude_drift, noise);
        let error = [of(|cycle| cycle.phase_error).abs(), lock.phase_tolerance];
        let (of_frequency, of_amplitude) = ("range of the frequency", "range of the amplitude");
        [
            condition("mean phase error", "phase_tolerance", error),
            condition(of_frequency, "frequency_drift", frequency[0]),
            condition(of_frequency, "frequency_drift", frequency[1]),
            condition(of_amplitude, "amplitude_drift", amplitude[0]),
            condition(of_amplitude, "amplitude_drift", amplitude[1]),
        ]
    }
}

/// The relative ranges of a value from period to period and from part to part, each with the largest allowed; `drift`: allowed relative change
/// per period, `noise`: relative range from period to period that noise explains.
fn ranges(cycles: &[Cycle], value: fn(&Cycle) -> f64, drift: f64, noise: f64) -> [[f64; 2]; 2] {
    let values: Vec<f64> = cycles.iter().map(value).collect();
    let length = values.len().div_ceil(DWELL_PARTS);
    let parts: Vec<f64> = values.chunks(length).map(|part| mean(part.iter().copied())).collect();
    let level = mean(values.iter().copied());
    let [found, of_parts] = [&values, &parts].map(|values| {
        let (low, high) = range((f64::INFINITY, f64::NEG_INFINITY), values.iter().copied());
        (high - low) / level
    });
    let drift = drift * (values.len() as f64 - 1.0);
    // Independent deviations from period to period explain this range of the means.
    let explained = noise.min(found) / (length as f64).sqrt();
    [[found, drift + noise], [of_parts, drift + explained]]
}
