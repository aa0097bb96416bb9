//! Whether the lock of a controller that does not say so has settled.

use std::f64::consts::TAU;

use phase_lock::Config;
use vines_model::numerics::{mean, range};

use super::Period;
use crate::identification::Cycle;
use crate::record::Sample;

/// Range of noise, in standard deviations: ten independent normal values exceed it with a probability of 5 % (studentised range).
const NOISE_RANGE: f64 = 4.5;
/// Parts of the dwell whose means are compared.
const PARTS: usize = 4;

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
    /// The present period, and the last complete ones: at most two dwells.
    begins: Period,
    cycles: Vec<Cycle>,
    settled: bool,
}

/// How far frequency and amplitude varied over the last periods, relative to themselves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scatter {
    /// Number of periods.
    pub periods: usize,
    /// Of the frequency.
    pub frequency: Spread,
    /// Of the amplitude of the response.
    pub amplitude: Spread,
}

/// A relative range, and the largest that counts as constant.
#[derive(Debug, Clone, Copy, PartialEq)]
#[expect(missing_docs, reason = "the structure explains them")]
pub struct Spread {
    pub found: f64,
    pub allowed: f64,
}

impl Judge {
    /// By the lock criterion of a configuration.
    pub fn new(config: &Config) -> Self {
        Self {
            config: *config,
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
        match Cycle::of(period, self.config.sample_time, before * TAU, self.config.phase_target) {
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

    /// What varied over the last two dwells; `None` before them.
    pub fn scatter(&self) -> Option<Scatter> {
        if self.cycles.len() < 2 * self.config.lock.dwell as usize {
            return None;
        }
        let [frequency, amplitude] = self.spreads(&self.cycles, NOISE_RANGE).map(|[all, parts]| {
            // The parts decide where the periods do not.
            if all.found > all.allowed { all } else { parts }
        });
        Some(Scatter { periods: self.cycles.len(), frequency, amplitude })
    }

    fn is_steady(&self, cycles: &[Cycle], noise_range: f64) -> bool {
        let error = mean(cycles.iter().map(|cycle| cycle.phase_error));
        let spreads = self.spreads(cycles, noise_range);
        error.abs() <= self.config.lock.phase_tolerance
            && spreads.as_flattened().iter().all(|one| one.found <= one.allowed)
    }

    /// The ranges of frequency and amplitude, each from period to period and from part to part. `noise_range`: range that noise explains, in
    /// standard deviations.
    fn spreads(&self, cycles: &[Cycle], noise_range: f64) -> [[Spread; 2]; 2] {
        let of = |value: fn(&Cycle) -> f64| mean(cycles.iter().map(value));
        let (response, base) = (of(Cycle::amplitude), of(|cycle| cycle.base.norm()));
        let [noise, base_noise] = [0, 1].map(|i| mean(cycles.iter().map(|cycle| cycle.noise[i])).sqrt());
        let phase_noise = (noise / response).hypot(base_noise / base);
        let lock = &self.config.lock;
        [
            spread(
                cycles,
                |cycle| cycle.omega,
                lock.frequency_drift,
                noise_range * phase_noise / TAU,
            ),
            spread(
                cycles,
                Cycle::amplitude,
                lock.amplitude_drift,
                noise_range * noise / response,
            ),
        ]
    }
}

/// The ranges of a value from period to period and from part to part; `drift`: allowed relative change per period, `noise`: relative range from
/// period to period that noise explains.
fn spread(cycles: &[Cycle], value: fn(&Cycle) -> f64, drift: f64, noise: f64) -> [Spread; 2] {
    let values: Vec<f64> = cycles.iter().map(value).collect();
    let parts: Vec<f64> = values
        .chunks(values.len().div_ceil(PARTS))
        .map(|part| mean(part.iter().copied()))
        .collect();
    let level = mean(values.iter().copied());
    let relative_range = |values: &[f64]| {
        let (low, high) = range((f64::INFINITY, f64::NEG_INFINITY), values.iter().copied());
        (high - low) / level
    };
    let found = relative_range(&values);
    let drift = drift * (values.len() as f64 - 1.0);
    // Independent deviations from period to period explain this range of the means.
    let explained = noise.min(found) / (values.len() as f64 / PARTS as f64).sqrt();
    [
        Spread { found, allowed: drift + noise },
        Spread { found: relative_range(&parts), allowed: drift + explained },
    ]
}
