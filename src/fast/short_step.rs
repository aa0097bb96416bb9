//! The propagator of a step that is short against every rate and repeated many times.
//!
//! The base moves as a polynomial or a sine. Either is its Taylor series, so that the response from rest is
//! `sum b_n G_n(t)`: `b_n` the n-th derivative of the base displacement at the start, `G_n` the response to `t^n/n!`. The `G_n`
//! belong to the step, not to the drive: a drive that changes at every sample costs two polynomials in `omega²`, and needs
//! neither a sine nor a division. That holds for every damping ratio, at resonance and away from it.

use super::propagator::{Increment, Point, forced, rotate, rotation};
use crate::arithmetic::product;
use crate::base_motion::Drive;
use crate::oscillator::{Oscillator, Transition};
use num_complex::Complex64;

/// Longest step, in units of the fastest rate's time: the first term left out is below 1e-17.
pub(super) const LONGEST: f64 = 1.0 / 8.0;
/// Steps whose lengths differ by less, relative, are the same but for a correction of first order; the second order is below 1e-20.
pub(super) const SAME: f64 = 1e-9;
/// Number of the `G_n`.
const MOMENTS: usize = 9;

/// The propagator of one step length.
#[derive(Clone, Copy, Debug)]
pub(super) struct ShortStep {
    /// The key: length of the step, s; NaN where there is none.
    pub t: f64,
    /// What the free motion adds: the sum of both.
    free: (Transition, Transition),
    /// Velocity per base displacement and, over the frequency, per base velocity: `omega0² xv` and `2 delta xv`.
    pushed: (f64, f64),
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
            pushed: (0.0, 0.0),
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
        let free = oscillator.exact_increment(t);
        let per_velocity = free.0.xv + free.1.xv;
        Self {
            t,
            free,
            pushed: (
                oscillator.omega0_squared * per_velocity,
                2.0 * oscillator.delta * per_velocity,
            ),
            moments: core::array::from_fn(|n| moment(oscillator, n, t)),
            ..Self::default()
        }
    }

    /// Whether a step of `t` seconds can have such a propagator.
    pub fn is_short(oscillator: &Oscillator, omega: f64, t: f64) -> bool {
        t * oscillator.fastest.max(omega.abs()) <= LONGEST && t > 0.0
    }

    /// Whether it serves for a step that is longer by `late` seconds: masters compute equal steps with rounding errors.
    #[inline(always)]
    pub fn serves(&self, drive: &Drive, late: f64) -> bool {
        late == 0.0 || (late.abs() <= SAME * self.t && drive.signal[2] == 0.0 && drive.signal[3] == 0.0)
    }

    /// Forgets the step if it is not short against the drive.
    #[inline(always)]
    pub fn drive_changed(&mut self, drive: &Drive) {
        if drive.omega.abs() * self.t > LONGEST {
            *self = Self::default();
        }
    }

    /// The response at another frequency.
    #[inline(always)]
    fn respond(&mut self, omega: f64) {
        let g = &self.moments;
        let square = -omega * omega;
        let even = g[0] + square * (g[2] + square * (g[4] + square * (g[6] + square * g[8])));
        let odd = omega * (g[1] + square * (g[3] + square * (g[5] + square * g[7])));
        self.position = Complex64::new(even, odd);
        // `K' = i omega K + F xv`.
        let (steady, moving) = self.pushed;
        self.velocity = Complex64::new(steady - omega * odd, omega * (moving + even));
        self.angle = product(omega, self.t);
        self.rotation = rotation::<8>(self.angle.0);
        self.omega = omega;
    }

    /// What one step adds to `start` under `drive`.
    #[inline(always)]
    pub fn increment(&mut self, drive: &Drive, start: &Point) -> Increment {
        if self.omega != drive.omega {
            self.respond(drive.omega);
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

impl Increment {
    /// The same for a step that is longer by `late` seconds, to first order; the signal is a straight line.
    #[inline(never)]
    pub fn later(&self, oscillator: &Oscillator, drive: &Drive, start: &Point, late: f64) -> Self {
        let Oscillator { delta, omega0_squared, .. } = *oscillator;
        let (y, dy) = (start.y + self.y, start.dy + self.dy);
        let strength = Complex64::new(omega0_squared, 2.0 * delta * drive.omega);
        let forcing = forced(drive.amplitude, self.phasor, strength);
        Self {
            y: self.y + late * dy,
            dy: self.dy + late * (forcing - omega0_squared * y - 2.0 * delta * dy),
            phasor: rotate(self.phasor, (1.0, drive.omega * late)),
        }
    }
}

/// `G_n(t)`: the response from rest to a base displacement `t^n/n!`, from its Taylor series.
fn moment(oscillator: &Oscillator, n: usize, t: f64) -> f64 {
    let (damping, spring) = (2.0 * oscillator.delta * t, oscillator.omega0_squared * t * t);
    // Coefficients times powers of t.
    let force = (1..=n).fold(1.0, |force, k| force * t / k as f64);
    let base = |k: usize| if k == n { force } else { 0.0 };
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
