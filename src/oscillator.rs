//! The oscillator alone: its transition over a time `t`, for every damping ratio.
//!
//! `x'' + 2 delta x' + omega0² x = 0`. Position and velocity after `t` are a linear map of those now; the map's four
//! entries are written so that none loses digits at any damping ratio, however near to critical.

use crate::arithmetic::{product, quotient, sincos_of_product, two_sum};
use num_complex::Complex64;

/// Below this part of the decay rate the two rates are too near each other to be told apart by subtraction.
pub(crate) const APART: f64 = 0.1;

/// Coefficients of one oscillator, derived once from mass, stiffness and damping.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Oscillator {
    /// Decay rate `delta = c/(2 mass)`, 1/s.
    pub delta: f64,
    /// Natural frequency squared, `k/mass`, 1/s².
    pub omega0_squared: f64,
    /// Natural frequency, 1/s.
    pub omega0: f64,
    /// Whether the free motion oscillates.
    pub regime: Regime,
    /// Rounding error of the damped natural frequency, rad/s. After a thousand periods the error of the phase is six thousand
    /// times as large.
    pub(crate) omega_d_error: f64,
    /// Rounding errors of `2 delta` (1/s) and `omega0²` (1/s²).
    errors: (f64, f64),
    /// Longest a unit velocity can carry the free motion, s: `|x(t)| <= |x(0)| + reach |x'(0)|`.
    pub reach: f64,
    /// The fastest rate in the free motion, 1/s.
    pub fastest: f64,
}

/// Whether the free motion oscillates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Regime {
    /// Below critical damping, down to none: oscillation at `omega_d`, rad/s.
    Oscillating {
        /// Damped natural frequency, rad/s.
        omega_d: f64,
    },
    /// Critical damping and above: two decaying exponentials whose rates differ by `2 half_gap`.
    Overdamped {
        /// The slow rate, 1/s, at most 0.
        slow: f64,
        /// The fast rate, 1/s, below 0.
        fast: f64,
        /// Half the difference of the rates, 1/s; 0 at critical damping.
        half_gap: f64,
    },
}

/// Position and velocity after a time, as a linear map of those before it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Transition {
    /// Position per position.
    pub xx: f64,
    /// Velocity per position, 1/s.
    pub vx: f64,
    /// Position per velocity, s.
    pub xv: f64,
    /// Velocity per velocity.
    pub vv: f64,
}

impl Transition {
    /// Position and velocity after it.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    pub fn of(&self, x: f64, v: f64) -> (f64, f64) {
        (self.xx * x + self.xv * v, self.vx * x + self.vv * v)
    }
}

impl Oscillator {
    /// Coefficients of the oscillator of this mass (kg), stiffness (N/m) and damping (N·s/m).
    pub fn new(mass: f64, stiffness: f64, damping: f64) -> Self {
        let (rate, rate_error) = quotient(damping, mass);
        let delta = 0.5 * rate;
        let (omega0_squared, stiffness_error) = quotient(stiffness, mass);
        let omega0 = libm::sqrt(omega0_squared);
        // `omega0² - delta²` with what rounding keeps out of it, so that no digit is lost near critical damping.
        let (square, square_error) = product(delta, delta);
        let (difference, error) = two_sum(omega0_squared, -square);
        let error = error + (stiffness_error - square_error - delta * rate_error);
        let discriminant = difference + error;
        let mut omega_d_error = 0.0;
        let (regime, reach, fastest) = if discriminant > 0.0 {
            let omega_d = libm::sqrt(discriminant);
            let (got, got_error) = product(omega_d, omega_d);
            omega_d_error = ((difference - got) + (error - got_error)) / (2.0 * omega_d);
            (Regime::Oscillating { omega_d }, 1.0 / omega0, omega0)
        } else {
            let half_gap = libm::sqrt(-discriminant);
            let fast = -(delta + half_gap);
            let slow = omega0_squared / fast;
            let regime = Regime::Overdamped { slow, fast, half_gap };
            (regime, -1.0 / fast, -fast)
        };
        Self {
            delta,
            omega0_squared,
            omega0,
            regime,
            omega_d_error,
            errors: (rate_error, stiffness_error),
            reach,
            fastest,
        }
    }

    /// A bound on `|y|` from now on, for a free motion that has `y` and `y'` now (each derivative of the motion obeys
    /// the same equation): its energy never grows.
    pub fn ceiling(&self, y: f64, dy: f64) -> f64 {
        let carried = self.reach * dy;
        match self.regime {
            Regime::Oscillating { .. } => libm::sqrt(y * y + carried * carried),
            Regime::Overdamped { .. } => libm::fabs(y) + libm::fabs(carried),
        }
    }

    /// The free motion over `t` seconds and, where it oscillates, `exp((-delta + i omega_d) t)`.
    pub(crate) fn flow(&self, t: f64) -> (Transition, Complex64) {
        match self.regime {
            Regime::Oscillating { omega_d } => {
                let (sin, cos) = sincos_of_product((omega_d, self.omega_d_error), t);
                let decay = libm::exp(-self.delta * t);
                let turned = Complex64::new(decay * cos, decay * sin);
                let s = turned.im / omega_d;
                let free = Transition {
                    xx: turned.re + self.delta * s,
                    xv: s,
                    vx: -self.omega0_squared * s,
                    vv: turned.re - self.delta * s,
                };
                (free, turned)
            }
            Regime::Overdamped { slow, fast, half_gap } => (self.overdamped(t, slow, fast, half_gap), Complex64::ZERO),
        }
    }

    /// `2 delta` and `omega0²` with their rounding errors.
    pub(crate) fn rates(&self) -> ((f64, f64), (f64, f64)) {
        ((2.0 * self.delta, self.errors.0), (self.omega0_squared, self.errors.1))
    }

    fn overdamped(&self, t: f64, slow: f64, fast: f64, half_gap: f64) -> Transition {
        let (e_slow, e_fast) = (libm::exp(slow * t), libm::exp(fast * t));
        let gap = 2.0 * half_gap;
        // (e_slow - e_fast)/gap without subtracting near-equals; its limit is t e_slow.
        let s = if gap * t < 1e-300 {
            t * e_slow
        } else {
            e_slow * (-libm::expm1(-gap * t) / gap)
        };
        let (xx, vv) = if half_gap > APART * self.delta {
            // Far from critical the mean of the exponentials and delta s nearly cancel; this form has no such loss.
            (
                (slow * e_fast - fast * e_slow) / gap,
                (slow * e_slow - fast * e_fast) / gap,
            )
        } else {
            let mean = 0.5 * (e_slow + e_fast);
            (mean + self.delta * s, mean - self.delta * s)
        };
        Transition { xx, xv: s, vx: -self.omega0_squared * s, vv }
    }
}

#[cfg(test)]
#[path = "../tests/unit/oscillator.rs"]
mod tests;
