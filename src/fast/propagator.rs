//! A propagator: the closed form at one time, applied to any start.

use super::coefficients::Coefficients;
use crate::arithmetic::{Sum, product};
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

impl Increment {
    /// Where it leads.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    pub fn to(&self, start: &Point) -> Point {
        Point {
            y: start.y + self.y,
            dy: start.dy + self.dy,
            phasor: self.phasor,
        }
    }
}

/// The closed form at time `t`; what follows from that is computed when it is needed. By default it is that over no time.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Propagator {
    /// The key: time, s.
    pub t: f64,
    /// The key of the response, rad/s; NaN after a reset.
    pub omega: f64,
    /// What the free motion adds: the sum of both, because a propagator is used many times and the same rounding error would add up.
    pub free: (Transition, Transition),
    /// The key of the free motion, s.
    pub free_t: f64,
    response: Response,
    /// `omega t` from -2π to 2π.
    pub angle: Sum,
}

/// The product of two complex numbers.
#[cfg_attr(not(target_arch = "wasm32"), inline(always))]
pub(super) fn rotate(a: (f64, f64), b: (f64, f64)) -> (f64, f64) {
    (a.0 * b.0 - a.1 * b.1, a.0 * b.1 + a.1 * b.0)
}

/// Coefficients of cosine and sine over angle, in the square of the angle: with alternating sign `1/(2n)!` and `1/(2n + 1)!`. Up to 1/8 they
/// leave out less than 1e-19.
pub(super) const ROTATION: [[f64; 2]; 6] = [
    [1.0, 1.0],
    [-1.0 / 2.0, -1.0 / 6.0],
    [1.0 / 24.0, 1.0 / 120.0],
    [-1.0 / 720.0, -1.0 / 5040.0],
    [1.0 / 40_320.0, 1.0 / 362_880.0],
    [-1.0 / 3_628_800.0, -1.0 / 39_916_800.0],
];

/// Polynomials with these coefficients, at `x`.
#[cfg_attr(not(target_arch = "wasm32"), inline(always))]
pub(super) fn polynomials(coefficients: &[[f64; 2]], x: f64) -> [f64; 2] {
    let last = coefficients.len() - 1;
    (coefficients[..last].iter().rev()).fold(coefficients[last], |[a, b], c| [c[0] + x * a, c[1] + x * b])
}

/// `E Im(z K)` for the phasor `z`.
#[cfg_attr(not(target_arch = "wasm32"), inline(always))]
pub(super) fn forced(amplitude: f64, (cos, sin): (f64, f64), k: Complex64) -> f64 {
    amplitude * (k.re * sin + k.im * cos)
}

/// `omega t` from -2π to 2π.
#[cfg_attr(not(target_arch = "wasm32"), inline(always))]
pub(super) fn angle(omega: f64, t: f64) -> Sum {
    let (mut value, mut error) = product(omega, t);
    if value.abs() >= TAU {
        Phase(value, error) = Phase::default().advanced(omega, t);
    }
    Sum { value, error }
}

impl Propagator {
    /// Makes it the propagator over `t` seconds.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    pub fn reset(&mut self, t: f64) {
        (self.t, self.omega) = (t, f64::NAN);
    }

    /// The same; `free` is what the free motion adds in that time.
    pub fn set(&mut self, t: f64, free: (Transition, Transition)) {
        self.reset(t);
        (self.free, self.free_t) = (free, t);
    }

    /// Makes the response that of these coefficients' frequency.
    #[inline(never)]
    pub fn respond(&mut self, oscillator: &Oscillator, coefficients: &Coefficients) {
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
        self.angle = angle(omega, self.t);
        self.omega = omega;
    }

    /// What the propagator adds to `start`.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
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
}

/// The motion near an instant, as a Taylor polynomial of degree `N + 1`.
pub(super) struct Nearby<const N: usize> {
    /// What has been added to the start until then.
    pub there: Increment,
    /// Velocity then, m/s.
    pub dy: f64,
    /// `y^(n)/n!` for n from 2 on.
    pub c: [f64; N],
    omega: f64,
}

impl<const N: usize> Nearby<N> {
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    pub fn new(coefficients: &Coefficients, amplitude: f64, start: &Point, there: &Increment) -> Self {
        let (f, df) = coefficients.forcing_at(there.phasor);
        let (f, df) = (amplitude * f, amplitude * df);
        let (y, dy) = (start.y + there.y, start.dy + there.dy);
        let [per_y, per_dy, per_f, per_df] = &coefficients.taylor;
        let mut c = [0.0; N];
        for (n, c) in c.iter_mut().enumerate() {
            *c = (per_y[n] * y + per_dy[n] * dy) + (per_f[n] * f + per_df[n] * df);
        }
        Self { there: *there, dy, c, omega: coefficients.omega }
    }

    /// What `h` seconds add to the displacement beyond uniform motion, m, and to the velocity, m/s.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    pub fn change(&self, h: f64) -> (f64, f64) {
        let c = &self.c;
        let (mut deviation, mut gained) = (0.0, 0.0);
        let square = h * h;
        for n in (0..N).step_by(2).rev() {
            let (c0, c1) = (c[n], c[n + 1]);
            let k = (n + 2) as f64;
            deviation = (c0 + h * c1) + square * deviation;
            gained = (k * c0 + h * ((k + 1.0) * c1)) + square * gained;
        }
        (square * deviation, h * gained)
    }

    /// The phasor of the base then.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    pub fn phasor(&self, h: f64) -> (f64, f64) {
        let angle = self.omega * h;
        let [cos, sin] = polynomials(&ROTATION[..N / 2 + 2], angle * angle);
        rotate(self.there.phasor, (cos, angle * sin))
    }

    /// What is added to the start, `h` seconds after that instant.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    pub fn at(&self, h: f64) -> Increment {
        let (deviation, gained) = self.change(h);
        Increment {
            y: self.there.y + (h * self.dy + deviation),
            dy: self.there.dy + gained,
            phasor: self.phasor(h),
        }
    }
}
