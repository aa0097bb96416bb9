//! The anti-alias filter in the channels of a rig: what it makes of a signal, and of white noise.

use std::f64::consts::{FRAC_1_SQRT_2, SQRT_2};

use num_complex::Complex64;

/// A Butterworth low pass of second order, `y'' + sqrt(2) wc y' + wc^2 y = wc^2 u`, exact for a signal that is a parabola through the last three
/// samples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LowPass {
    cut_off: f64,
    /// Last sample of the signal.
    input: f64,
    /// Mean slope of the signal between the last two samples, and the time between them, s.
    before: Option<(f64, f64)>,
    output: f64,
    slope: f64,
}

impl LowPass {
    /// A filter at rest with the cut-off frequency `cut_off`, rad/s.
    pub fn new(cut_off: f64) -> Self {
        Self { cut_off, input: 0.0, before: None, output: 0.0, slope: 0.0 }
    }

    /// The output `elapsed` seconds after the last sample, when the signal is `input`.
    pub fn pass(&mut self, input: f64, elapsed: f64) -> f64 {
        if elapsed > 0.0 {
            let rise = (input - self.input) / elapsed;
            let bend = self
                .before
                .map_or(0.0, |(rise_before, time)| 2.0 * (rise - rise_before) / (elapsed + time));
            self.before = Some((rise, elapsed));
            let rate = FRAC_1_SQRT_2 * self.cut_off;
            let delay = SQRT_2 / self.cut_off;
            // On a parabola the output is late, and ahead by the bend; the initial transient decays.
            let steady = |value: f64, slope: f64| {
                [
                    value - delay * slope + bend / self.cut_off.powi(2),
                    slope - delay * bend,
                ]
            };
            let half = 0.5 * bend * elapsed;
            let (begin, end) = (steady(self.input, rise - half), steady(input, rise + half));
            let cosine = self.output - begin[0];
            let sine = (self.slope - begin[1]) / rate + cosine;
            let (sin, cos) = (rate * elapsed).sin_cos();
            let decay = (-rate * elapsed).exp();
            let (ringing, quadrature) = (decay * (cosine * cos + sine * sin), decay * (sine * cos - cosine * sin));
            self.output = end[0] + ringing;
            self.slope = end[1] + rate * (quadrature - ringing);
        }
        self.input = input;
        self.output
    }

    /// Correlation of the noise behind a filter with the cut-off frequency `cut_off` over `time`, if the noise before it is white.
    pub fn correlation(cut_off: f64, time: f64) -> f64 {
        let angle = FRAC_1_SQRT_2 * cut_off * time;
        (-angle).exp() * (angle.cos() + angle.sin())
    }

    /// Power density of samples of this noise, `sample_time` apart, at the frequency `omega`, over that of white noise with the same variance.
    pub fn colour(cut_off: f64, omega: f64, sample_time: f64) -> f64 {
        // The sum of `correlation cos(omega time)` over all times, as geometric series: the correlation is the real part of (1 - i) exp((i - 1) angle).
        let step = FRAC_1_SQRT_2 * cut_off * sample_time;
        let turn = omega * sample_time;
        let series = |turn: f64| {
            let factor = Complex64::from_polar((-step).exp(), step + turn);
            (Complex64::new(1.0, -1.0) * factor / (1.0 - factor)).re
        };
        1.0 + series(turn) + series(-turn)
    }

    /// Gain of a filter with the cut-off frequency `cut_off` at the frequency `omega`.
    pub fn gain(cut_off: f64, omega: f64) -> f64 {
        1.0 / (omega / cut_off).powi(2).hypot(1.0)
    }
}
