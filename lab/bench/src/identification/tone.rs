//! Foreign tones: lines in the response that no motion of the particle produces.
//!
//! The response is that of a linear oscillator, which only its base and the particle excite. The particle stays in its cavity: a line of its
//! relative position has at most the amplitude 4b/π, that of a square wave. With x = ω/ω0, a line of the response v therefore has at most
//! the amplitude `4 epsilon b/(π |x² - 1|)`, of q1 x² times as much, and of the acceleration x⁴ times as much, whatever the motion: irregular,
//! period-doubled or quasi-periodic. A larger line comes from a sensor or a cable, for instance from the mains.

use std::f64::consts::{PI, TAU};
use std::fmt::{self, Display, Formatter};

use serde::Serialize;
use vines_model::numerics::golden_section;

use crate::scene::{Dimensionless, Sensor};

/// Factor above the largest line of a motion: epsilon and b are known within a factor of two.
const ABOVE: f64 = 2.0;

/// Largest number of values in which a line is searched for: the work grows with its square.
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
pub(super) struct Line {
    /// Frequency, rad per sample.
    pub turn: f64,
    /// Amplitudes of the cosine and the sine.
    parts: [f64; 2],
}

impl Line {
    /// The strongest line of these values; where there are many, the strongest of the last ones.
    pub fn strongest(values: &[f64]) -> Self {
        let power = |values: &[f64], turn: f64| transform(values, turn).iter().map(|part| part * part).sum::<f64>();
        let highest = |values: &[f64], turn: f64, width: f64| {
            golden_section(turn - width, turn + width, |turn| -power(values, turn))
        };
        let last = &values[values.len().saturating_sub(SEARCHED)..];
        let [bin, fine] = [last.len(), values.len()].map(|count| PI / count as f64);
        let (coarse, _) = (1..last.len())
            .map(|k| (k as f64 * bin, power(last, k as f64 * bin)))
            .fold((bin, 0.0), |best, next| if next.1 > best.1 { next } else { best });
        let turn = highest(values, highest(last, coarse, bin), fine);
        let scale = 2.0 / values.len() as f64;
        Self {
            turn,
            parts: transform(values, turn).map(|part| scale * part),
        }
    }

    pub fn amplitude(&self) -> f64 {
        self.parts[0].hypot(self.parts[1])
    }

    /// The value at a sample.
    pub fn at(&self, sample: usize) -> f64 {
        let (sine, cosine) = (self.turn * sample as f64).sin_cos();
        self.parts[0] * cosine + self.parts[1] * sine
    }

    /// Whether no motion of the particle produces it.
    pub fn is_foreign(&self, d: &Dimensionless, sample_time: f64) -> bool {
        let square = (self.turn / (sample_time * d.omega0)).powi(2);
        let factor = match d.definition.sensor {
            Sensor::V => 1.0,
            Sensor::Q1 => square,
            Sensor::Acceleration => square * square,
        };
        let largest = 4.0 / PI * d.epsilon * d.b * factor / (square - 1.0).abs();
        self.amplitude() > ABOVE * largest
    }

    /// As a share of a response of the amplitude `response`, m.
    pub fn tone(&self, sample_time: f64, response: f64) -> Tone {
        Tone {
            hertz: self.turn / (TAU * sample_time),
            share: self.amplitude() / response,
        }
    }
}

/// Sums of the values times cosine and sine.
fn transform(values: &[f64], turn: f64) -> [f64; 2] {
    let (sine, cosine) = turn.sin_cos();
    let (mut sums, mut rotor) = ([0.0; 2], [1.0, 0.0]);
    for value in values {
        sums = [sums[0] + value * rotor[0], sums[1] + value * rotor[1]];
        rotor = [rotor[0] * cosine - rotor[1] * sine, rotor[1] * cosine + rotor[0] * sine];
    }
    sums
}
