//! The generators of a device: Fourier series on one master phase, and the waveform table.

use std::f64::consts::TAU;

use super::registry::HARMONICS;

/// A turn of the phase accumulator.
const TURN: f64 = 4_294_967_296.0;

/// Step of a phase accumulator per sample.
pub fn increment(frequency: f64, sample_rate: f64) -> u32 {
    (frequency / sample_rate * TURN).round() as u32
}

pub fn turns(phase: u32) -> f64 {
    f64::from(phase) / TURN
}

/// A Fourier series: mean, cosines and sines, V.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    mean: f64,
    harmonics: [[f64; 2]; HARMONICS],
}

impl Series {
    /// From `[mean, a_1.., b_1..]`; what is missing is zero.
    pub fn new(coefficients: &[f64]) -> Self {
        let at = |n: usize| coefficients.get(n).copied().unwrap_or_default();
        Self {
            mean: at(0),
            harmonics: std::array::from_fn(|k| [at(1 + k), at(1 + HARMONICS + k)]),
        }
    }

    /// Upper bound of the absolute value.
    pub fn bound(&self) -> f64 {
        self.mean.abs() + self.harmonics.iter().map(|[a, b]| a.hypot(*b)).sum::<f64>()
    }

    /// Value at a phase of the fundamental.
    pub fn at(&self, phase: u32) -> f64 {
        let harmonic = |(k, [a, b]): (usize, &[f64; 2])| {
            if *a == 0.0 && *b == 0.0 {
                return 0.0;
            }
            let (sine, cosine) = (TAU * turns(phase.wrapping_mul(k as u32 + 1))).sin_cos();
            a * cosine + b * sine
        };
        self.mean + self.harmonics.iter().enumerate().map(harmonic).sum::<f64>()
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TableSettings {
    /// Of the free modes, Hz.
    pub frequency: f64,
    pub gain: f64,
    /// Linear interpolation; otherwise a value is held.
    pub linear: bool,
    /// 0 off, 1 loop, 2 one-shot, 3 locked loop, 4 locked one-shot.
    pub mode: u32,
    /// Frequency of the locked modes over the master's.
    pub multiple: u32,
    /// Offset of the locked modes, turns.
    pub phase: f64,
}

#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
enum Shot {
    #[default]
    Idle,
    /// Waits for the beginning of a master period.
    Armed,
    Playing,
}

/// The table and where it is played.
#[derive(Debug, Clone, Default)]
pub struct Table {
    pub values: Vec<f32>,
    /// Phase of the free modes, or what a locked one-shot has played.
    phase: u32,
    shot: Shot,
}

impl Table {
    /// Starts a one-shot.
    pub fn trigger(&mut self, settings: &TableSettings) {
        self.phase = 0;
        self.shot = match settings.mode {
            2 => Shot::Playing,
            4 => Shot::Armed,
            _ => self.shot,
        };
    }

    /// Value of this sample, V, and a step to the next one. `master` is the master phase, `step` its increment, `wrapped` says that a
    /// master period begins here.
    pub fn next(&mut self, settings: &TableSettings, sample_rate: f64, master: (u32, u32), wrapped: bool) -> f64 {
        let (master, step) = master;
        if self.shot == Shot::Armed && wrapped {
            self.shot = Shot::Playing;
        }
        let offset = (settings.phase * TURN) as u32;
        let own = match settings.mode {
            1 | 2 => increment(settings.frequency, sample_rate),
            _ => step.wrapping_mul(settings.multiple),
        };
        let phase = match settings.mode {
            1 => Some(self.phase),
            3 => Some(master.wrapping_mul(settings.multiple).wrapping_add(offset)),
            2 | 4 if self.shot == Shot::Playing => {
                Some(self.phase.wrapping_add(if settings.mode == 4 { offset } else { 0 }))
            }
            _ => None,
        };
        let value = phase.map_or(0.0, |phase| settings.gain * self.at(phase, settings.linear));
        let (next, ended) = self.phase.overflowing_add(own);
        if settings.mode == 1 || self.shot == Shot::Playing {
            self.phase = next;
        }
        if ended && self.shot == Shot::Playing {
            self.shot = Shot::Idle;
        }
        value
    }

    fn at(&self, phase: u32, linear: bool) -> f64 {
        let length = self.values.len();
        if length < 2 {
            return 0.0;
        }
        let place = turns(phase) * length as f64;
        let (index, share) = (place as usize, place.fract());
        let [here, next] = [index, index + 1].map(|n| f64::from(self.values[n % length]));
        if linear { here + share * (next - here) } else { here }
    }
}
