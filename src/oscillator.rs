//! The oscillator alone: its transition over a time `t`, for every damping ratio.
//!
//! `x'' + 2 delta x' + omega0² x = 0`. Position and velocity after `t` are a linear map of those now; the map's four
//! entries are written so that none loses digits at any damping ratio, however near to critical.

use crate::arithmetic::{divided, plus, product, quotient, sincos_of_product, split_coefficient, times, two_sum};
use num_complex::Complex64;

/// Below this part of the decay rate the two rates are too near each other to be told apart by subtraction.
pub(crate) const SEPARATE_RATES: f64 = 0.1;

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
        Self::from_rates(quotient(damping, mass), quotient(stiffness, mass))
    }

    /// The same from `2 delta` (1/s) and `omega0²` (1/s²), each with its rounding error.
    pub(crate) fn from_rates((rate, rate_error): (f64, f64), (omega0_squared, stiffness_error): (f64, f64)) -> Self {
        let delta = 0.5 * rate;
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
            // A mass without spring and damper has no rates.
            let slow = omega0_squared / fast.min(-f64::MIN_POSITIVE);
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
    #[cfg_attr(not(target_arch = "wasm32"), inline)]
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
        let (xx, vv) = if half_gap > SEPARATE_RATES * self.delta {
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

// A constant or growing force on an overdamped oscillator, from rest
//
// `x'' + 2 delta x' + omega0² x = 1` and `= t`: the integrals of `(e^{slow t} - e^{fast t})/(slow - fast)`, once and twice.
// With damping far above critical the position at which such a motion comes to rest at last lies far off, and taking it off
// at the start to add it again later would leave no digits of what happens in between.

/// Whether the rates of `oscillator` are far apart.
pub(crate) fn is_apart(oscillator: &Oscillator) -> bool {
    matches!(oscillator.regime, Regime::Overdamped { half_gap, .. } if half_gap > SEPARATE_RATES * oscillator.delta)
}

/// Positions after `t` seconds under a push of 1 and under one that grows as the time, s² and s³, where the rates are apart.
pub(crate) fn pushed(oscillator: &Oscillator, t: f64) -> (f64, f64) {
    let Regime::Overdamped { slow, fast, .. } = oscillator.regime else {
        return (0.0, 0.0);
    };
    let (of_slow, of_fast) = (integrals(slow, t), integrals(fast, t));
    let gap = slow - fast;
    ((of_slow.0 - of_fast.0) / gap, (of_slow.1 - of_fast.1) / gap)
}

/// The integral of `e^{rate t}` from 0 to `t`, and the integral of that, for a rate of 0 or below.
fn integrals(rate: f64, t: f64) -> (f64, f64) {
    let z = rate * t;
    if z > -0.5 {
        // `(e^z - 1 - z)/z²`; the first term left out is below 2^-14/16! = 3e-18.
        let mut series = 1.0;
        for n in (3..=15).rev() {
            series = series * z / f64::from(n) + 1.0;
        }
        let twice = 0.5 * series;
        (t * (1.0 + z * twice), t * t * twice)
    } else {
        let once = libm::expm1(z);
        (once / rate, (once - z) / rate / rate)
    }
}

// The free motion in double-double arithmetic, for a propagator that is used many times

/// `1/n!` with its rounding error.
const PER_FACTORIAL: [(f64, f64); 18] = {
    let (mut terms, mut n) = ([(1.0, 0.0); 18], 2);
    while n < terms.len() {
        terms[n] = divided(terms[n - 1], n as f64);
        n += 1;
    }
    terms
};

impl Oscillator {
    /// What the free motion over `t` seconds adds: a Taylor series over a time that is short against every rate, doubled as often as
    /// needed.
    pub(crate) fn increment(&self, t: f64) -> FreeIncrement {
        // Terms from `PLAIN` on are so small that rounding them leaves 23 digits; those from `TERMS` on are below that.
        const PLAIN: usize = 7;
        const TERMS: usize = 18;
        let (mut t, mut doublings) = (t, 0);
        while 4.0 * self.fastest * t > 1.0 {
            (t, doublings) = (0.5 * t, doublings + 1);
        }
        let (damping, spring) = self.rates();
        let (damping, spring) = (times(damping, (-t, 0.0)), times(spring, product(-t, t)));
        // Derivatives of the motion that starts with a displacement of 0 and a velocity of 1/t, in units of time of t.
        let (mut d, mut s, mut p) = ([(0.0, 0.0), (1.0, 0.0)], (1.0, 0.0), (0.0, 0.0));
        for n in 2..PLAIN {
            d = [d[1], plus(times(damping, d[1]), times(spring, d[0]))];
            s = plus(s, times(d[1], PER_FACTORIAL[n]));
            p = plus(p, times(d[1], PER_FACTORIAL[n - 1]));
        }
        let (mut d, mut small) = (d.map(|(d, _)| d), (0.0, 0.0));
        for n in PLAIN..TERMS {
            d = [d[1], damping.0 * d[1] + spring.0 * d[0]];
            small = (
                small.0 + PER_FACTORIAL[n].0 * d[1],
                small.1 + PER_FACTORIAL[n - 1].0 * d[1],
            );
        }
        let short = FreeIncrement {
            p: plus(p, (small.1, 0.0)),
            s: times(plus(s, (small.0, 0.0)), (t, 0.0)),
        };
        (0..doublings).fold(short, |one, _| self.composed(&one, &one))
    }

    /// What two times, one after the other, add.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    pub(crate) fn composed(&self, a: &FreeIncrement, b: &FreeIncrement) -> FreeIncrement {
        let (damping, spring) = self.rates();
        let square = times(a.s, b.s);
        let p = plus(times(a.p, b.p), times((-spring.0, -spring.1), square));
        let s = plus(plus(times(a.p, b.s), times(b.p, a.s)), times(damping, square));
        FreeIncrement { p: plus(plus(a.p, b.p), p), s: plus(plus(a.s, b.s), s) }
    }

    /// What an increment adds to position and velocity, as the sum of two maps: for one that is used many times. A rounded one would be a
    /// steady source or sink of energy, and shift the phase.
    pub(crate) fn split(&self, FreeIncrement { p, s }: &FreeIncrement) -> (Transition, Transition) {
        let (damping, spring) = self.rates();
        let entries = [plus(*p, times(damping, *s)), *s, times((-spring.0, -spring.1), *s), *p];
        let [xx, xv, vx, vv] = entries.map(split_coefficient);
        let part = |xx, xv, vx, vv| Transition { xx, xv, vx, vv };
        (part(xx.0, xv.0, vx.0, vv.0), part(xx.1, xv.1, vx.1, vv.1))
    }
}

/// What a transition adds, in double-double arithmetic: `p = vv - 1` and `s = xv`. With them `xx = 1 + p + 2 delta s` and
/// `vx = -omega0² s`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FreeIncrement {
    p: (f64, f64),
    s: (f64, f64),
}

/// From its two maps ([`Oscillator::split`]).
impl From<&(Transition, Transition)> for FreeIncrement {
    fn from((head, tail): &(Transition, Transition)) -> Self {
        Self { p: two_sum(head.vv, tail.vv), s: two_sum(head.xv, tail.xv) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn far_above_critical_nothing_overflows() {
        let o = Oscillator::new(1.0, 1.0, 2e8);
        let m = o.flow(1e6).0;
        assert!((m.xx - (-1e6f64 / 2e8).exp()).abs() < 1e-12);
        assert!(m.vv.abs() < 1e-12 && m.xv.is_finite() && m.vx.is_finite());
    }

    #[test]
    fn a_mass_without_spring_and_damper_moves_in_a_straight_line() {
        let expected = Transition { xx: 1.0, vx: 0.0, xv: 3.0, vv: 1.0 };
        assert_eq!(Oscillator::new(0.5, 0.0, 0.0).flow(3.0).0, expected);
    }

    #[test]
    fn the_series_meets_the_quotient_where_they_change_over() {
        let (below, above) = (integrals(-0.5 + 1e-15, 1.0), integrals(-0.5 - 1e-15, 1.0));
        assert!((below.0 - above.0).abs() < 4e-15 && (below.1 - above.1).abs() < 4e-15);
    }

    #[test]
    fn a_push_from_rest_obeys_the_equation_of_motion() {
        let oscillator = Oscillator::new(1.0, 1.0, 6.0);
        assert!(is_apart(&oscillator));
        for t in [0.01, 0.3, 2.0, 30.0] {
            let ((once, twice), m) = (pushed(&oscillator, t), oscillator.flow(t).0);
            // The integral of the equation of the velocity, once and twice.
            assert!((m.vv + 6.0 * m.xv + once - 1.0).abs() < 1e-14);
            assert!((m.xv + 6.0 * once + twice - t).abs() < 1e-14 * t.max(1.0));
        }
    }
}
