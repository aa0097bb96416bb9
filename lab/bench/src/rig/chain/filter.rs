//! The anti-alias filter.

use std::f64::consts::{FRAC_1_SQRT_2, SQRT_2};

/// A Butterworth low pass of second order, `y'' + sqrt(2) wc y' + wc^2 y = wc^2 u`, exact for a signal that is
/// linear between samples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LowPass {
    cut_off: f64,
    /// Last sample of the signal.
    input: f64,
    output: f64,
    slope: f64,
}

impl LowPass {
    /// A filter at rest with the cut-off frequency `cut_off`, rad/s.
    pub fn new(cut_off: f64) -> Self {
        Self { cut_off, input: 0.0, output: 0.0, slope: 0.0 }
    }

    /// The output `elapsed` seconds after the last sample, when the signal is `input`.
    pub fn pass(&mut self, input: f64, elapsed: f64) -> f64 {
        if elapsed > 0.0 {
            let rise = (input - self.input) / elapsed;
            let rate = FRAC_1_SQRT_2 * self.cut_off;
            // On a ramp the output lags by sqrt(2)/wc; the initial transient decays.
            let lag = SQRT_2 / self.cut_off * rise;
            let cosine = self.output - (self.input - lag);
            let sine = (self.slope - rise) / rate + cosine;
            let (sin, cos) = (rate * elapsed).sin_cos();
            let decay = (-rate * elapsed).exp();
            let (ringing, quadrature) = (decay * (cosine * cos + sine * sin), decay * (sine * cos - cosine * sin));
            self.output = input - lag + ringing;
            self.slope = rise + rate * (quadrature - ringing);
        }
        self.input = input;
        self.output
    }
}

#[cfg(test)]
#[path = "../../../tests/unit/filter.rs"]
mod tests;
