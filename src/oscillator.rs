//! The oscillator alone: its transition over a time `t`, for every damping ratio.
//!
//! `x'' + 2 delta x' + omega0² x = 0`. Position and velocity after `t` are a linear map of those now; the map's four
//! entries are written so that none loses digits at any damping ratio, however near to critical.

use crate::base_motion::{evenly, product, sincos_of_product, two_sum};
use crate::creep::APART;
use crate::lane::Lane;
#[cfg(feature = "batch")]
use crate::lane::Lanes;
use serde::{Deserialize, Serialize};

/// Coefficients of one oscillator, derived once from mass, stiffness and damping.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Oscillator {
    /// Decay rate `delta = c/(2 mass)`, 1/s.
    pub delta: f64,
    /// Natural frequency squared, `k/mass`, 1/s².
    pub omega0_squared: f64,
    /// Natural frequency, 1/s.
    pub omega0: f64,
    /// How the free motion goes.
    pub regime: Regime,
    /// What rounding has kept out of the damped natural frequency, rad/s: after a thousand periods it is six thousand
    /// times as much of the phase.
    omega_d_missed: f64,
    /// Longest a unit velocity can carry the free motion, s: `|x(t)| <= |x(0)| + reach |x'(0)|`.
    pub reach: f64,
    /// The fastest rate in the free motion, 1/s.
    pub fastest: f64,
}

/// How the free motion goes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Regime {
    /// Below critical damping, down to none: oscillation at `omega_d`, rad/s.
    Oscillating {
        /// Damped natural frequency, rad/s.
        omega_d: f64,
    },
    /// Critical damping and above: two decaying exponentials whose rates differ by `2 half_gap`.
    Creeping {
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
pub struct Transition<T = f64> {
    /// Position per position.
    pub xx: T,
    /// Position per velocity, s.
    pub xv: T,
    /// Velocity per position, 1/s.
    pub vx: T,
    /// Velocity per velocity.
    pub vv: T,
}

impl Transition {
    /// The transition over no time at all.
    pub const NONE: Self = Self {
        xx: 1.0,
        xv: 0.0,
        vx: 0.0,
        vv: 1.0,
    };
}

impl<T: Lane> Transition<T> {
    /// Position and velocity after it.
    #[inline(always)]
    pub fn of(&self, x: T, v: T) -> (T, T) {
        (self.xx * x + self.xv * v, self.vx * x + self.vv * v)
    }
}

#[cfg(feature = "batch")]
impl<const N: usize> Transition<Lanes<N>> {
    /// Several transitions abreast.
    pub(crate) fn abreast(transitions: [&Transition; N]) -> Self {
        let all = |f: fn(&Transition) -> f64| Lanes(transitions.map(f));
        Self {
            xx: all(|m| m.xx),
            xv: all(|m| m.xv),
            vx: all(|m| m.vx),
            vv: all(|m| m.vv),
        }
    }

    /// One of them.
    pub(crate) fn of_lane(&self, lane: usize) -> Transition {
        Transition {
            xx: self.xx.0[lane],
            xv: self.xv.0[lane],
            vx: self.vx.0[lane],
            vv: self.vv.0[lane],
        }
    }

    /// Replaces one of them.
    pub(crate) fn put(&mut self, lane: usize, m: &Transition) {
        self.xx.0[lane] = m.xx;
        self.xv.0[lane] = m.xv;
        self.vx.0[lane] = m.vx;
        self.vv.0[lane] = m.vv;
    }
}

/// A number, and what rounding has kept out of it.
type Two = (f64, f64);

fn times(a: Two, b: Two) -> Two {
    let (whole, missed) = product(a.0, b.0);
    (whole, missed + (a.0 * b.1 + a.1 * b.0))
}

fn plus(a: Two, b: Two) -> Two {
    let (whole, missed) = two_sum(a.0, b.0);
    (whole, missed + (a.1 + b.1))
}

impl Oscillator {
    /// Coefficients of the oscillator of this mass (kg), stiffness (N/m) and damping (N·s/m).
    pub fn new(mass: f64, stiffness: f64, damping: f64) -> Self {
        let (rate, rate_missed) = quotient(damping, mass);
        let delta = 0.5 * rate;
        let (omega0_squared, stiffness_missed) = quotient(stiffness, mass);
        let omega0 = libm::sqrt(omega0_squared);
        // `omega0² - delta²` with what rounding keeps out of it, so that no digit is lost near critical damping.
        let (square, square_missed) = product(delta, delta);
        let (difference, missed) = two_sum(omega0_squared, -square);
        let missed = missed + (stiffness_missed - square_missed - delta * rate_missed);
        let discriminant = difference + missed;
        let mut omega_d_missed = 0.0;
        let (regime, reach, fastest) = if discriminant > 0.0 {
            let omega_d = libm::sqrt(discriminant);
            let (got, got_missed) = product(omega_d, omega_d);
            omega_d_missed = ((difference - got) + (missed - got_missed)) / (2.0 * omega_d);
            (Regime::Oscillating { omega_d }, 1.0 / omega0, omega0)
        } else {
            let half_gap = libm::sqrt(-discriminant);
            let fast = -(delta + half_gap);
            let slow = omega0_squared / fast;
            let regime = Regime::Creeping {
                slow,
                fast,
                half_gap,
            };
            (regime, -1.0 / fast, -fast)
        };
        Self {
            delta,
            omega0_squared,
            omega0,
            regime,
            omega_d_missed,
            reach,
            fastest,
        }
    }

    /// `omega` less the damped natural frequency `omega_d`, with all its digits.
    pub(crate) fn detuning(&self, omega: f64, omega_d: f64) -> f64 {
        (omega - omega_d) - self.omega_d_missed
    }

    /// Sine and cosine of `omega_d t`, for the `omega_d` of this oscillator.
    pub(crate) fn turned(&self, omega_d: f64, t: f64) -> (f64, f64) {
        sincos_of_product((omega_d, self.omega_d_missed), t)
    }

    /// A bound on `|y|` from now on, for a free motion that has `y` and `y'` now (each derivative of the motion obeys
    /// the same equation): its energy never grows.
    pub fn ceiling(&self, y: f64, dy: f64) -> f64 {
        let carried = self.reach * dy;
        match self.regime {
            Regime::Oscillating { .. } => libm::sqrt(y * y + carried * carried),
            Regime::Creeping { .. } => libm::fabs(y) + libm::fabs(carried),
        }
    }

    /// The free motion over `t` seconds.
    pub fn transition(&self, t: f64) -> Transition {
        match self.regime {
            Regime::Oscillating { omega_d } => {
                let (sin, cos) = self.turned(omega_d, t);
                let decay = libm::exp(-self.delta * t);
                self.oscillating(omega_d, decay * sin, decay * cos)
            }
            Regime::Creeping {
                slow,
                fast,
                half_gap,
            } => self.creeping(t, slow, fast, half_gap),
        }
    }

    /// The free motion over `t` seconds as the sum of two maps: for a transition that is used again and again.
    ///
    /// A rounded one would be a steady source or sink of energy, small as it is. What is left here is an error of the
    /// frequency, of which energy knows nothing. Where the motion does not swing, it dies out too fast for that, and the second
    /// map is none.
    pub fn kept_transition(&self, t: f64) -> (Transition, Transition) {
        let Regime::Oscillating { omega_d } = self.regime else {
            return (self.transition(t), Transition::default());
        };
        let (sin, cos) = self.turned(omega_d, t);
        // How far the rounded sine and cosine are off the unit circle.
        let (cos2, sin2) = (product(cos, cos), product(sin, sin));
        let (sum, missed) = two_sum(cos2.0, sin2.0);
        let outside = (sum - 1.0) + (missed + cos2.1 + sin2.1);
        let decay = two_sum(1.0, libm::expm1(-self.delta * t));
        let radius = (decay.0, decay.1 - 0.5 * outside * decay.0);
        let (cos, sin) = (times((cos, 0.0), radius), times((sin, 0.0), radius));
        let quotient = sin.0 / omega_d;
        let (got, got_missed) = product(quotient, omega_d);
        let omega_d = (omega_d, self.omega_d_missed);
        let lost = (sin.0 - got) - got_missed + sin.1 - quotient * omega_d.1;
        let s = (quotient, lost / omega_d.0);
        let leaning = times((self.delta, 0.0), s);
        // `omega0²` as it is for this very `omega_d`: it is what the transition keeps.
        let stiffness = plus(times(omega_d, omega_d), product(self.delta, self.delta));
        let pull = times(stiffness, s);
        let entries = [
            plus(cos, leaning),
            s,
            (-pull.0, -pull.1),
            plus(cos, (-leaning.0, -leaning.1)),
        ]
        .map(|(entry, missed)| evenly(entry, missed));
        let part = |f: fn(&Two) -> f64| {
            let [xx, xv, vx, vv] = entries.each_ref().map(f);
            Transition { xx, xv, vx, vv }
        };
        (part(|e| e.0), part(|e| e.1))
    }

    /// The transition from `exp(-delta t) sin(omega_d t)` and `exp(-delta t) cos(omega_d t)`.
    pub(crate) fn oscillating(&self, omega_d: f64, sin: f64, cos: f64) -> Transition {
        let s = sin / omega_d;
        Transition {
            xx: cos + self.delta * s,
            xv: s,
            vx: -self.omega0_squared * s,
            vv: cos - self.delta * s,
        }
    }

    fn creeping(&self, t: f64, slow: f64, fast: f64, half_gap: f64) -> Transition {
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
        Transition {
            xx,
            xv: s,
            vx: -self.omega0_squared * s,
            vv,
        }
    }
}

/// `a / b` as a rounded quotient and its rounding error.
fn quotient(a: f64, b: f64) -> (f64, f64) {
    let rounded = a / b;
    let (got, got_missed) = product(rounded, b);
    (rounded, ((a - got) - got_missed) / b)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The Taylor series of the matrix exponential, in steps short enough to converge at once: an independent way.
    fn by_series(o: &Oscillator, t: f64) -> [f64; 4] {
        let steps = (o.fastest * t * 4.0).ceil().max(1.0);
        let h = t / steps;
        let column = |mut x: f64, mut v: f64| {
            for _ in 0..steps as usize {
                let mut c = [0.0; 24];
                (c[0], c[1]) = (x, v);
                for n in 0..22 {
                    let (n1, n2) = (n as f64 + 1.0, n as f64 + 2.0);
                    c[n + 2] =
                        (-2.0 * o.delta * n1 * c[n + 1] - o.omega0_squared * c[n]) / (n1 * n2);
                }
                x = c.iter().rev().fold(0.0, |sum, c| sum * h + c);
                v = (1..24).rev().fold(0.0, |sum, n| sum * h + n as f64 * c[n]);
            }
            (x, v)
        };
        let ((xx, vx), (xv, vv)) = (column(1.0, 0.0), column(0.0, 1.0));
        [xx, xv, vx, vv]
    }

    #[test]
    fn no_entry_loses_digits_across_critical_damping() {
        let around_critical = [-1e-3, -1e-8, -1e-12, -1e-15, 0.0, 1e-15, 1e-12, 1e-8, 1e-3];
        let ratios = [0.0, 1e-9, 0.006, 0.5, 0.9, 1.1, 1.5, 5.0, 40.0];
        for zeta in around_critical.iter().map(|d| 1.0 + d).chain(ratios) {
            let o = Oscillator::new(1.0, 1.0, 2.0 * zeta);
            for t in [1e-6, 0.01, 0.3, 1.0, 3.0, 10.0] {
                let m = o.transition(t);
                let reference = by_series(&o, t);
                let scale = [1.0, o.reach.min(t), o.fastest.min(1.0 / t), 1.0];
                for (got, (want, scale)) in [m.xx, m.xv, m.vx, m.vv]
                    .iter()
                    .zip(reference.iter().zip(scale))
                {
                    let error = (got - want).abs() / scale;
                    assert!(error < 2e-14, "zeta {zeta}, t {t}: {got} {want} {error:e}");
                }
            }
        }
    }

    #[test]
    fn far_above_critical_nothing_overflows() {
        let o = Oscillator::new(1.0, 1.0, 2e8);
        let m = o.transition(1e6);
        assert!((m.xx - (-1e6f64 / 2e8).exp()).abs() < 1e-12);
        assert!(m.vv.abs() < 1e-12 && m.xv.is_finite() && m.vx.is_finite());
    }
}
