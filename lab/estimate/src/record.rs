//! A record, as the envelope of what the linear response leaves.

use num_complex::Complex64;

use crate::interpolation::{CubicSpline, unwrapped};
use crate::linear::Linear;
use crate::periods::Periods;

/// The force of what is not linear, by the amplitude of the response. Forces are displacements of the base, m, relative to the phase of the response.
pub trait Element {
    /// Force in the steady motion of this amplitude; where the motion does not exist, that of the nearest.
    fn steady(&self, amplitude: f64) -> Complex64;

    /// Lag of the force behind the amplitude, in periods: `lag d' + d = steady force`. Zero: the force follows at once.
    fn lag(&self, amplitude: f64) -> Complex64;

    /// Whether the force at this amplitude is a smooth function of it, that follows it with one lag.
    fn is_smooth(&self, amplitude: f64) -> bool;

    /// Times and forces of the motion itself, in stretches, where it is known beyond the first order of its lag.
    fn along(&self, path: &Path) -> Option<Vec<Vec<(f64, Complex64)>>>;
}

/// The response as a path: the logarithm of its complex amplitude over the time.
pub struct Path {
    spline: CubicSpline,
    /// Frequency of the frame, rad/s.
    pub omega0: f64,
    /// Times between which the path is known, s.
    pub ends: [f64; 2],
}

impl Path {
    /// Through these amplitudes.
    pub fn new(time: &[f64], amplitudes: &[Complex64], omega0: f64) -> Self {
        let phases = unwrapped(amplitudes.iter().map(|z| z.arg()));
        let logarithms = amplitudes.iter().zip(phases);
        let logarithms = logarithms
            .map(|(z, phase)| Complex64::new(z.norm().ln(), phase))
            .collect();
        Self {
            spline: CubicSpline::new(time.to_vec(), logarithms),
            omega0,
            ends: [time[0], time[time.len() - 1]],
        }
    }

    /// The logarithm, and its derivative.
    pub fn at(&self, t: f64) -> [Complex64; 2] {
        self.spline.at(t)
    }

    /// The motion itself, `Im exp(ln z + i omega0 t)`, and its velocity.
    pub fn motion(&self, t: f64) -> [f64; 2] {
        let [logarithm, rate] = self.at(t);
        let z = (logarithm + Complex64::new(0.0, self.omega0 * t)).exp();
        [z.im, ((rate + Complex64::new(0.0, self.omega0)) * z).im]
    }
}

/// Equally spaced samples of the response and of the base.
#[derive(Debug, Clone)]
pub struct Signals {
    /// Displacements, m.
    pub displacements: [Vec<f64>; 2],
    /// What the sensors read, over a power of omega0, whose noise is white: the displacements, or their derivatives.
    pub readings: [Vec<f64>; 2],
    /// Time between samples, s.
    pub sample_time: f64,
}

impl Signals {
    /// Of sensors that read displacements.
    pub fn of_displacements(displacements: [Vec<f64>; 2], sample_time: f64) -> Self {
        Self { readings: displacements.clone(), displacements, sample_time }
    }
}

/// A record of response and base, demodulated with a linear response.
#[derive(Debug, Clone)]
pub struct Record {
    /// The linear response.
    pub linear: Linear,
    /// Power of the frequency, over omega0, by which the force on this response grows: 2 for an impulse on the mass whose displacement is measured, 0
    /// for the displacement of a particle in the sum of both.
    pub power: i32,
    /// Its periods; variances are averages over `AVERAGED` of them.
    pub periods: Periods,
    /// Response without its linear part.
    pub departure: Vec<Complex64>,
    /// From the middle of each period to that of the next one, s.
    pub steps: Vec<f64>,
    /// Mean square of what the base may do between its samples on the way to the next period, m²: its amplitude may change in a straight line, at one
    /// sample, or at once, which is a pulse of any phase.
    pub between: Vec<f64>,
}

/// Periods over which the variance of noise is averaged: a hundred degrees of freedom each, so that its own error of 3 % does not count.
const AVERAGED: usize = 21;

/// Average over `AVERAGED` values, mirrored at the ends.
fn averaged(values: &[f64]) -> Vec<f64> {
    let (half, last) = (AVERAGED as isize / 2, values.len() as isize - 1);
    let at = |k: isize| {
        values[(if k < 0 {
            -k
        } else if k > last {
            2 * last - k
        } else {
            k
        }) as usize]
    };
    (0..=last)
        .map(|k| (k - half..=k + half).map(at).sum::<f64>() / AVERAGED as f64)
        .collect()
}

impl Record {
    /// Demodulates equally spaced samples. `None` for fewer than twelve periods, or fewer than ten samples in a period.
    pub fn new(signals: &Signals, linear: Linear, power: i32) -> Option<Self> {
        let Signals { displacements: [response, base], readings, sample_time } = signals;
        let mean = base.iter().sum::<f64>() / base.len() as f64;
        let moving: Vec<f64> = base.iter().map(|x| x - mean).collect();
        let mut periods = Periods::new(
            [response, &linear.response(&moving, *sample_time), base],
            [&readings[0], &readings[1]],
            *sample_time,
            linear.omega0,
        )?;
        for (l, omega) in periods.linear.iter_mut().zip(&periods.omega) {
            // Straight lines between the samples of a sine have less of its frequency.
            let half = 0.5 * omega * sample_time;
            *l /= (half.sin() / half).powi(2);
        }
        periods.noise = averaged(&periods.noise);
        periods.base_noise = averaged(&periods.base_noise);
        let unknown = |k: usize| {
            let change = periods.base[k + 1].norm() - periods.base[k].norm();
            0.5 * (change * sample_time / (periods.time[k + 1] - periods.time[k])).powi(2)
        };
        let between = (0..periods.base.len() - 1).map(unknown).collect();
        let departure = periods
            .response
            .iter()
            .zip(&periods.linear)
            .map(|(z, l)| z - l)
            .collect();
        let steps = periods.time.windows(2).map(|pair| pair[1] - pair[0]).collect();
        Some(Self { linear, power, periods, departure, steps, between })
    }

    /// The free motion of the envelope over a time, in the frame of omega0.
    pub fn transition(&self, duration: f64) -> Complex64 {
        ((self.linear.pole() - Complex64::new(0.0, self.linear.omega0)) * duration).exp()
    }
}
