//! A propagator: the closed form at one time, applied to any start.

use super::coefficients::Coefficients;
use crate::arithmetic::product;
use crate::base_motion::Phase;
use crate::forcing::Response;
use crate::oscillator::{Oscillator, Regime, Transition};
use core::f64::consts::TAU;
use num_complex::Complex64;

/// Where the motion stands, relative to the line that follows the base signal.
#[derive(Clone, Copy, Debug)]
pub(super) struct Point {
    /// Displacement, m.
    pub y: f64,
    /// Velocity, m/s.
    pub dy: f64,
    /// `e^{i phase}` of the base: cosine and sine.
    pub phasor: (f64, f64),
}

/// What is added to a start, and the phasor then.
#[derive(Clone, Copy, Debug)]
pub(super) struct Increment {
    pub y: f64,
    pub dy: f64,
    pub phasor: (f64, f64),
}

/// The closed form at time `t`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Propagator {
    /// The key: time, s; NaN where the propagator is empty.
    pub t: f64,
    /// The key of the response, rad/s.
    omega: f64,
    /// What the free motion adds: the sum of both.
    free: (Transition, Transition),
    /// Whether that is exact beyond rounding: where a propagator is used many times, the same error would add up.
    pub exact: bool,
    response: Response,
    /// `omega t` in [0, 2π), and its rounding error.
    pub angle: (f64, f64),
}

impl Default for Propagator {
    fn default() -> Self {
        Self {
            t: f64::NAN,
            omega: f64::NAN,
            free: Default::default(),
            exact: false,
            response: Response::default(),
            angle: (0.0, 0.0),
        }
    }
}

/// The product of two complex numbers.
#[inline(always)]
pub(super) fn rotate(a: (f64, f64), b: (f64, f64)) -> (f64, f64) {
    (a.0 * b.0 - a.1 * b.1, a.0 * b.1 + a.1 * b.0)
}

/// `E Im(z K)` for the phasor `z`.
#[inline(always)]
pub(super) fn forced(amplitude: f64, (cos, sin): (f64, f64), k: Complex64) -> f64 {
    amplitude * (k.re * sin + k.im * cos)
}

impl Propagator {
    /// The propagator over `t` seconds, `exact` beyond rounding or not.
    pub fn new(oscillator: &Oscillator, t: f64, exact: bool) -> Self {
        let free = if exact {
            oscillator.exact_increment(t)
        } else {
            let Transition { xx, xv, vx, vv } = oscillator.transition(t);
            let (xx, vv) = (xx - 1.0, vv - 1.0);
            (Transition { xx, xv, vx, vv }, Transition::default())
        };
        Self { t, free, exact, ..Self::default() }
    }

    /// Makes the response that of these coefficients' frequency.
    #[inline(always)]
    pub fn prepare(&mut self, oscillator: &Oscillator, coefficients: &Coefficients) {
        if self.omega != coefficients.omega {
            self.respond(oscillator, coefficients);
        }
    }

    #[inline(never)]
    fn respond(&mut self, oscillator: &Oscillator, coefficients: &Coefficients) {
        let (head, tail) = &self.free;
        let free = Transition {
            xx: 1.0 + (head.xx + tail.xx),
            xv: head.xv + tail.xv,
            vx: head.vx + tail.vx,
            vv: 1.0 + (head.vv + tail.vv),
        };
        let decayed = match oscillator.regime {
            Regime::Oscillating { omega_d } => Complex64::new(free.xx - oscillator.delta * free.xv, omega_d * free.xv),
            Regime::Overdamped { .. } => Complex64::ZERO,
        };
        let omega = coefficients.omega;
        self.response = coefficients.forcing.response(self.t, &free, decayed);
        let (angle, error) = product(omega, self.t);
        self.angle = if angle < TAU {
            (angle, error)
        } else {
            Phase::default().advanced(omega, self.t).parts()
        };
        self.omega = omega;
    }

    /// What the propagator adds to `start`.
    #[inline(always)]
    pub fn increment(&self, amplitude: f64, start: &Point) -> Increment {
        let (head, tail) = &self.free;
        let (y, dy) = head.of(start.y, start.dy);
        let (more_y, more_dy) = tail.of(start.y, start.dy);
        let Response { base, position, velocity } = &self.response;
        Increment {
            y: y + (more_y + forced(amplitude, start.phasor, *position)),
            dy: dy + (more_dy + forced(amplitude, start.phasor, *velocity)),
            phasor: rotate(start.phasor, (base.re, base.im)),
        }
    }

    /// Where `start` has moved to, without the correction of rounding errors: for a march.
    #[inline(always)]
    pub fn roughly(&self, amplitude: f64, start: &Point) -> Point {
        let (y, dy) = self.free.0.of(start.y, start.dy);
        let response = &self.response;
        Point {
            y: start.y + (y + forced(amplitude, start.phasor, response.position)),
            dy: start.dy + (dy + forced(amplitude, start.phasor, response.velocity)),
            phasor: rotate(start.phasor, (response.base.re, response.base.im)),
        }
    }

    /// What is added to `start` at a time near that of the propagator, `h` seconds later.
    #[inline(always)]
    pub fn shortly(&self, coefficients: &Coefficients, amplitude: f64, start: &Point, h: f64) -> Increment {
        let increment = self.increment(amplitude, start);
        if h == 0.0 {
            return increment;
        }
        Nearby::new(coefficients, amplitude, start, &increment).at(h)
    }
}

/// The motion near a propagator's time, as a Taylor polynomial.
pub(super) struct Nearby {
    at_propagator: Increment,
    /// Velocity then, m/s.
    pub dy: f64,
    /// `y^(n)/n!` for n = 2 to 5.
    pub c: [f64; 4],
    omega: f64,
}

impl Nearby {
    #[inline(always)]
    pub fn new(coefficients: &Coefficients, amplitude: f64, start: &Point, at_propagator: &Increment) -> Self {
        let (f, df) = coefficients.forcing_at(at_propagator.phasor);
        let (f, df) = (amplitude * f, amplitude * df);
        let (y, dy) = (start.y + at_propagator.y, start.dy + at_propagator.dy);
        let term = |n: usize| {
            let [per_y, per_dy, per_f, per_df] = coefficients.taylor[n];
            (per_y * y + per_dy * dy) + (per_f * f + per_df * df)
        };
        Self {
            at_propagator: *at_propagator,
            dy,
            c: [term(0), term(1), term(2), term(3)],
            omega: coefficients.omega,
        }
    }

    /// What is added to the start, `h` seconds after the propagator's time.
    #[inline(always)]
    pub fn at(&self, h: f64) -> Increment {
        let [c2, c3, c4, c5] = self.c;
        let h2 = h * h;
        let bent = h2 * ((c2 + h * c3) + h2 * (c4 + h * c5));
        let quickened = h * ((2.0 * c2 + h * (3.0 * c3)) + h2 * (4.0 * c4 + h * (5.0 * c5)));
        let angle = self.omega * h;
        let angle2 = angle * angle;
        let sin = angle - angle * (angle2 * (1.0 / 6.0));
        let cos = 1.0 - angle2 * (0.5 - angle2 * (1.0 / 24.0));
        Increment {
            y: self.at_propagator.y + (h * self.dy + bent),
            dy: self.at_propagator.dy + quickened,
            phasor: rotate(self.at_propagator.phasor, (cos, sin)),
        }
    }
}
