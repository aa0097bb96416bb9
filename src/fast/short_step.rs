//! The propagator of a step that is short against every rate and repeated many times.
//!
//! The base moves as a polynomial or a sine. Either is its Taylor series, so that the response from rest is
//! `sum b_n G_n(t)`: `b_n` the n-th derivative of the base displacement at the start, `G_n` the response to `t^n/n!`. The `G_n`
//! belong to the step, not to the drive: a drive that changes at every sample costs two polynomials in `omega²`, and needs
//! neither a sine nor a division. That holds for every damping ratio, at resonance and away from it.

use super::propagator::{Increment, Point, forced, rotate};
use crate::arithmetic::product;
use crate::base_motion::Drive;
use crate::oscillator::{Oscillator, Transition};
use num_complex::Complex64;

/// Longest step, in units of the fastest rate's time: the first term left out is below 1e-17.
pub(super) const LONGEST: f64 = 1.0 / 8.0;
/// Number of the `G_n`.
const MOMENTS: usize = 9;

/// The propagator of one step length.
#[derive(Clone, Copy, Debug)]
pub(super) struct ShortStep {
    /// The key: length of the step, s; NaN where there is none.
    pub t: f64,
    /// What the free motion adds: the sum of both.
    free: (Transition, Transition),
    /// `G_n`, in the unit of `t^n`.
    moments: [f64; MOMENTS],
    /// The key of the response, rad/s.
    omega: f64,
    /// `omega t`, and its rounding error.
    pub angle: (f64, f64),
    rotation: (f64, f64),
    position: Complex64,
    velocity: Complex64,
}

impl Default for ShortStep {
    fn default() -> Self {
        Self {
            t: f64::NAN,
            free: Default::default(),
            moments: [0.0; MOMENTS],
            omega: f64::NAN,
            angle: (0.0, 0.0),
            rotation: (1.0, 0.0),
            position: Complex64::ZERO,
            velocity: Complex64::ZERO,
        }
    }
}

impl ShortStep {
    /// The propagator of a step of `t` seconds.
    pub fn new(oscillator: &Oscillator, t: f64) -> Self {
        Self {
            t,
            free: oscillator.split_short_increment(t),
            moments: core::array::from_fn(|n| moment(oscillator, n, t)),
            ..Self::default()
        }
    }

    /// Whether a step of this length can have such a propagator.
    pub fn serves(oscillator: &Oscillator, omega: f64, t: f64) -> bool {
        t * oscillator.fastest.max(omega.abs()) <= LONGEST && t > 0.0
    }

    /// The response at another frequency.
    #[inline(always)]
    fn respond(&mut self, oscillator: &Oscillator, omega: f64) {
        let g = &self.moments;
        let square = -omega * omega;
        let even = g[0] + square * (g[2] + square * (g[4] + square * (g[6] + square * g[8])));
        let odd = omega * (g[1] + square * (g[3] + square * (g[5] + square * g[7])));
        self.position = Complex64::new(even, odd);
        // `K' = i omega K + F xv`.
        let per_velocity = self.free.0.xv + self.free.1.xv;
        self.velocity = Complex64::new(
            oscillator.omega0_squared * per_velocity - omega * odd,
            2.0 * oscillator.delta * omega * per_velocity + omega * even,
        );
        self.angle = product(omega, self.t);
        let (angle, error) = self.angle;
        let square = angle * angle;
        // The Taylor series of sine and cosine, from the last term to the first.
        let sum =
            |divisors: [f64; 6]| (divisors.iter().rev()).fold(1.0, |sum, divisor| 1.0 - square * (1.0 / divisor) * sum);
        let cos = sum([2.0, 12.0, 30.0, 56.0, 90.0, 132.0]);
        let sin = angle * sum([6.0, 20.0, 42.0, 72.0, 110.0, 156.0]);
        self.rotation = (cos - error * sin, sin + error * cos);
        self.omega = omega;
    }

    /// What one step adds to `start` under `drive`.
    #[inline(always)]
    pub fn increment(&mut self, oscillator: &Oscillator, drive: &Drive, start: &Point) -> Increment {
        if self.omega != drive.omega {
            self.respond(oscillator, drive.omega);
        }
        let (head, tail) = &self.free;
        let (y, dy) = head.of(start.y, start.dy);
        let (mut more_y, mut more_dy) = tail.of(start.y, start.dy);
        let [_, _, u2, u3] = drive.signal;
        if u2 != 0.0 || u3 != 0.0 {
            more_y += 2.0 * u2 * self.moments[2] + 6.0 * u3 * self.moments[3];
            more_dy += 2.0 * u2 * self.moments[1] + 6.0 * u3 * self.moments[2];
        }
        Increment {
            y: y + (more_y + forced(drive.amplitude, start.phasor, self.position)),
            dy: dy + (more_dy + forced(drive.amplitude, start.phasor, self.velocity)),
            phasor: rotate(start.phasor, self.rotation),
        }
    }
}

/// `G_n(t)`: the response from rest to a base displacement `t^n/n!`, from its Taylor series.
fn moment(oscillator: &Oscillator, n: usize, t: f64) -> f64 {
    let (damping, spring) = (2.0 * oscillator.delta * t, oscillator.omega0_squared * t * t);
    let factorial = |n: usize| (1..=n).fold(1.0, |product, k| product * k as f64);
    // Coefficients times powers of t.
    let base = |k: usize| {
        if k == n { t.powi(n as i32) / factorial(n) } else { 0.0 }
    };
    let (mut before, mut last, mut sum) = (0.0, 0.0, 0.0);
    for k in 0..n + 16 {
        let k1 = (k + 1) as f64;
        let next = (spring * (base(k) - before) + damping * k1 * (base(k + 1) - last)) / (k1 * (k1 + 1.0));
        sum += next;
        (before, last) = (last, next);
    }
    sum
}

#[cfg(test)]
#[path = "../../tests/unit/fast_short_step.rs"]
mod tests;
