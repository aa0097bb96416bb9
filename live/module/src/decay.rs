//! Frequency and amplitude along the free decay, fitted as the lab fits them, while the samples arrive.

use std::f64::consts::TAU;

use vines_testbench::identification::{Harmonic, harmonic};

/// Fits per period, as in the lab.
const PER_PERIOD: f64 = 8.0;
/// Share of the first amplitude at which the fits end: the lab records a decay down to it.
const END: f64 = 0.05;

/// The sliding window of a free decay.
#[derive(Default)]
pub struct Decay {
    /// Responses, m, of the samples that the next fit uses.
    values: Vec<f64>,
    /// Length of the window, and distance between the beginnings of two windows, samples.
    window: usize,
    stride: usize,
    /// Frequency of the last fit, or of the drive before the release, rad/s.
    omega: f64,
    /// Amplitude of the first fit, m.
    first: Option<f64>,
    /// The last fit.
    pub fit: Option<Harmonic>,
}

impl Decay {
    /// The next decay begins after a drive of `omega` rad/s; the window has `periods` periods.
    pub fn release(&mut self, omega: f64, sample_time: f64, periods: f64) {
        let period = TAU / omega / sample_time;
        self.window = (periods * period).round() as usize + 1;
        self.stride = ((period / PER_PERIOD).round() as usize).max(1);
        self.values.clear();
        (self.omega, self.first, self.fit) = (omega, None, None);
    }

    /// The response, m, at a sample without a drive.
    pub fn sample(&mut self, response: f64, sample_time: f64) {
        let has_ended = |first: f64| self.fit.is_some_and(|fit| fit.amplitude < END * first);
        // A plant that starts without a drive has no window.
        if self.window == 0 || self.first.is_some_and(has_ended) {
            return;
        }
        self.values.push(response);
        if self.values.len() < self.window {
            return;
        }
        match harmonic(&self.values, sample_time, self.omega) {
            Some(fit) => {
                self.omega = fit.omega;
                self.first.get_or_insert(fit.amplitude);
                self.fit = Some(fit);
                self.values.drain(..self.stride);
            }
            // No motion of that frequency is left.
            None => self.window = 0,
        }
    }
}
