//! What a view of a running experiment shows beside its samples: the regime of the last impacts, and frequency and amplitude along the
//! free decay, fitted as the identification fits them, while the samples arrive.

use std::f64::consts::{PI, TAU};

use vines_model::regime::{Impact, MEASURED, Regime, end_of_synchrony, one_to_one};

use crate::identification::{DECAY_TERMS, DECAY_WINDOW, PER_PERIOD, harmonic};
use vines_scene::plan::DECAYED;

/// Impacts that are kept to determine the regime from.
const IMPACTS_KEPT: usize = 40;
/// Smallest number of impacts that a regime is determined from.
const FEWEST_IMPACTS: usize = 12;

/// The last impacts; times are phases of the drive, rad.
#[derive(Debug, Clone, Default)]
pub struct LastImpacts(pub Vec<Impact>);

impl LastImpacts {
    /// Adds an impact, and forgets all but the last forty.
    pub fn add(&mut self, impact: Impact) {
        self.0.push(impact);
        let surplus = self.0.len().saturating_sub(IMPACTS_KEPT);
        self.0.drain(..surplus);
    }

    /// Impacts per period of the drive.
    pub fn per_period(&self) -> f64 {
        match (self.0.first(), self.0.last()) {
            (Some(first), Some(last)) if last.time > first.time => {
                (self.0.len() - 1) as f64 * TAU / (last.time - first.time)
            }
            _ => 0.0,
        }
    }

    /// Their regime at the phase `now`, rad, as it is determined in an experiment.
    pub fn regime(&self, now: f64) -> Regime {
        let since = self.0.last().map_or(now, |last| now - last.time);
        // As many impacts are kept, two per period.
        if since > 0.5 * IMPACTS_KEPT as f64 * TAU {
            return Regime::NoImpacts;
        }
        if self.0.len() < FEWEST_IMPACTS {
            return Regime::Unknown;
        }
        one_to_one(&self.0, self.per_period(), MEASURED)
    }
}

/// Impacts that synchrony is determined from at every sample; it is lost once.
const LAST: usize = 4;

/// A motion that is nearly harmonic.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct HarmonicMotion {
    /// Frequency, rad/s.
    pub omega: f64,
    /// Amplitude of the response, m.
    pub amplitude: f64,
    /// Speed of the particle, m/s: the mean over the window of the fit.
    pub speed: f64,
}

/// The sliding window of a free decay; without a window while there is a drive.
#[derive(Debug, Default)]
pub struct Decay {
    /// Responses, m, of the samples that the next fit uses.
    values: Vec<f64>,
    /// Speeds of the particle there, m/s.
    speeds: Vec<f64>,
    /// Length of the window, and distance between the beginnings of two windows, samples.
    window: usize,
    stride: usize,
    /// Amplitude of the first fit, m.
    first: Option<f64>,
    /// The motion by the last fit; before the first one, as it was at the release.
    pub motion: HarmonicMotion,
    /// Whether the particle has met both walls in turn, at even intervals, since the release.
    pub synchronous: bool,
    /// Whether there are no further fits: the motion has died out.
    pub ended: bool,
}

impl Decay {
    /// A sample with a drive, and its motion: what was fitted before is over.
    pub fn drive(&mut self, motion: HarmonicMotion) {
        *self = Self { motion, synchronous: true, ..Self::default() };
    }

    /// A sample without a drive: response, m, and speed of the particle, m/s.
    pub fn sample(&mut self, response: f64, speed: f64, sample_time: f64) {
        // A plant that has not been driven yet has no decay.
        if self.motion.omega == 0.0 || self.ended {
            return;
        }
        if self.window == 0 {
            let period = TAU / self.motion.omega / sample_time;
            self.window = (DECAY_WINDOW * period).round() as usize + 1;
            self.stride = ((period / PER_PERIOD).round() as usize).max(1);
        }
        self.values.push(response);
        self.speeds.push(speed);
        if self.values.len() < self.window {
            return;
        }
        match harmonic(&self.values, sample_time, self.motion.omega, DECAY_TERMS) {
            Some(fit) => {
                self.ended = fit.amplitude < DECAYED * *self.first.get_or_insert(fit.amplitude);
                self.motion = HarmonicMotion {
                    omega: fit.omega,
                    amplitude: fit.amplitude,
                    speed: self.speeds.iter().sum::<f64>() / self.speeds.len() as f64,
                };
                self.values.drain(..self.stride);
                self.speeds.drain(..self.stride);
            }
            // No motion of that frequency is left.
            None => self.ended = true,
        }
    }

    /// Compares the last impacts with 1:1 motion; their times and `now` are phases of the drive before the release, rad.
    pub fn watch(&mut self, impacts: &LastImpacts, now: f64) {
        let impacts = &impacts.0;
        let last = &impacts[impacts.len().saturating_sub(LAST)..];
        // `end_of_synchrony` ends at an interval that is longer by a quarter.
        let late = |impact: &Impact| now - impact.time > 1.25 * PI;
        let end = end_of_synchrony(last, PI);
        self.synchronous &= last
            .last()
            .is_some_and(|impact| end == Some(impact.time) && !late(impact));
    }
}
