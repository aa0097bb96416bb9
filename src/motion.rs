//! The forced motion of one oscillator between two events, in closed form: no step, no step-size error.
//!
//! `x = p + y + Im(Z K)`: `p` the polynomial that follows a polynomial base signal, `y` the free motion that meets the
//! start, `Z K` the answer to the built-in oscillator ([`crate::forcing`]). For times short against every rate of the
//! motion its Taylor series about the start is summed instead: it costs less and keeps the *relative* digits of what has
//! changed since the start, which is what a particle hopping on its wall is made of.

use crate::base_motion::{BaseMotion, sincos_of_product};
use crate::creep::Creep;
use crate::forcing::{Answer, Forcing, divided_difference};
use crate::oscillator::{Oscillator, Transition};
use num_complex::Complex64;

/// The series is used while `fastest rate * t` is at most this; degree 15 then leaves out less than 1e-18.
const SERIES_REACH: f64 = 0.5;
const DEGREE: usize = 15;

/// Position and its first six derivatives.
pub type Derivatives = [f64; 7];

/// One oscillator's motion from a start until the next event.
#[derive(Clone, Copy, Debug)]
pub struct Motion<'a> {
    oscillator: &'a Oscillator,
    forcing: &'a Forcing,
    base: BaseMotion,
    /// `E e^{i phase}` at the start, for a frequency 0 or above; `None` where the oscillator is not driven.
    phasor: Option<Complex64>,
    /// What follows the signal: position polynomial.
    follower: [f64; 4],
    /// Where that is the signal itself: what its curvature and jerk do to the departure from it, m/s² and m/s³.
    pushed: Option<(Creep, [f64; 2])>,
    x0: f64,
    v0: f64,
    /// Position and velocity less those of the follower (and of a steady answer).
    free: (f64, f64),
}

impl<'a> Motion<'a> {
    /// The motion that starts at `x0` (m) with `v0` (m/s) under `base`; `forcing` is for `|base.drive.omega|`.
    pub fn new(
        oscillator: &'a Oscillator,
        forcing: &'a Forcing,
        base: BaseMotion,
        (x0, v0): (f64, f64),
    ) -> Self {
        let pushed = push(oscillator, base.drive.signal);
        let follower = if pushed.is_some() {
            base.drive.signal
        } else {
            follower(oscillator, base.drive.signal)
        };
        let mut free = (x0 - follower[0], v0 - follower[1]);
        let phasor = phasor(&base);
        if let (Some(z), Answer::Steady(h)) = (phasor, forcing.answer) {
            let steady = z * h;
            free.0 -= steady.im;
            free.1 -= forcing.omega * steady.re;
        }
        Self {
            oscillator,
            forcing,
            base,
            phasor,
            follower,
            pushed,
            x0,
            v0,
            free,
        }
    }

    /// The oscillator that moves.
    pub fn oscillator(&self) -> &Oscillator {
        self.oscillator
    }

    /// The fastest rate in the motion, 1/s.
    pub fn fastest(&self) -> f64 {
        let driven = if self.phasor.is_some() {
            self.forcing.omega
        } else {
            0.0
        };
        self.oscillator.fastest.max(driven)
    }

    /// Position (m) and velocity (m/s) after `t` seconds, and the base oscillator's phasor then.
    fn closed_form(&self, t: f64) -> (f64, f64, Complex64) {
        let p = &self.follower;
        let mut x = p[0] + t * (p[1] + t * (p[2] + t * p[3]));
        let mut v = p[1] + t * (2.0 * p[2] + t * 3.0 * p[3]);
        if let Some((creep, [steady, growing])) = self.pushed {
            let ((once, twice), m) = (creep.pushed(t), self.oscillator.transition(t));
            x += steady * once + growing * twice;
            v += steady * m.xv + growing * once;
        }
        let (y, dy) = self.free;
        let apply = |m: &Transition| (m.xx * y + m.xv * dy, m.vx * y + m.vv * dy);
        let Some(z) = self.phasor else {
            let (free, dfree) = apply(&self.oscillator.transition(t));
            return (x + free, v + dfree, Complex64::ZERO);
        };
        let turned = turn(self.forcing.omega, t);
        match self.forcing.answer {
            Answer::FromRest {
                lambda,
                omega_d,
                gain,
                near,
                far,
            } => {
                let (sin, cos) = self.oscillator.turned(omega_d, t);
                let decayed = Complex64::new(cos, sin) * libm::exp(lambda.re * t);
                let m = self.oscillator.oscillating(omega_d, decayed.im, decayed.re);
                let (free, dfree) = apply(&m);
                let first = divided_difference(near, t, turned, decayed);
                let second = (turned - decayed.conj()) * far;
                let z_gain = z * gain;
                x += free + (z_gain * (first - second)).im;
                v += dfree + (z_gain * (lambda * first - lambda.conj() * second)).im;
            }
            Answer::Steady(h) => {
                let (free, dfree) = apply(&self.oscillator.transition(t));
                let steady = z * h * turned;
                x += free + steady.im;
                v += dfree + self.forcing.omega * steady.re;
            }
        }
        (x, v, z * turned)
    }

    /// Position and velocity after `t` seconds, by the closed form at any `t`.
    pub fn position_and_velocity(&self, t: f64) -> (f64, f64) {
        let (x, v, _) = self.closed_form(t);
        (x, v)
    }

    /// Position and its derivatives after `t` seconds; from the second on they follow from the equation of motion.
    pub fn derivatives(&self, t: f64) -> Derivatives {
        let (x, v, phasor) = self.closed_form(t);
        self.by_equation(x, v, phasor, t)
    }

    /// Position and its derivatives at the start.
    pub fn derivatives_at_start(&self) -> Derivatives {
        let phasor = self.phasor.unwrap_or_default();
        self.by_equation(self.x0, self.v0, phasor, 0.0)
    }

    fn by_equation(&self, x: f64, v: f64, phasor: Complex64, t: f64) -> Derivatives {
        let Oscillator {
            delta,
            omega0_squared,
            ..
        } = *self.oscillator;
        let [u0, u1, u2, u3] = self.base.drive.signal;
        let omega = self.forcing.omega;
        let omega2 = omega * omega;
        let (sin, cos) = (phasor.im, omega * phasor.re);
        let base = [
            u0 + t * (u1 + t * (u2 + t * u3)) + sin,
            u1 + t * (2.0 * u2 + t * 3.0 * u3) + cos,
            2.0 * u2 + t * 6.0 * u3 - omega2 * sin,
            6.0 * u3 - omega2 * cos,
            omega2 * omega2 * sin,
            omega2 * omega2 * cos,
        ];
        let mut d = [x, v, 0.0, 0.0, 0.0, 0.0, 0.0];
        for n in 2..d.len() {
            d[n] =
                -2.0 * delta * (d[n - 1] - base[n - 1]) - omega0_squared * (d[n - 2] - base[n - 2]);
        }
        d
    }

    /// A bound on `|x'''|` over the next `window` seconds, given the derivatives now.
    pub fn third_derivative_bound(&self, d: &Derivatives, window: f64) -> f64 {
        let signal = self.oscillator.omega0_squared * 6.0 * libm::fabs(self.base.drive.signal[3]);
        self.bound::<3>(d, window, signal)
    }

    /// A bound on the fifth derivative over the next `window` seconds, given the derivatives now.
    pub fn fifth_derivative_bound(&self, d: &Derivatives, window: f64) -> f64 {
        self.bound::<5>(d, window, 0.0)
    }

    /// Every derivative of the motion obeys the equation of motion with the forcing's derivative: the energy of the free
    /// part never grows, and the forcing adds at most its own integral (variation of constants).
    fn bound<const N: usize>(&self, d: &Derivatives, window: f64, signal: f64) -> f64 {
        let oscillator = self.oscillator;
        let mut forcing = signal;
        if let Some(z) = self.phasor {
            let amplitude = libm::fabs(z.re) + libm::fabs(z.im);
            forcing += amplitude * self.forcing.strength * power::<N>(self.forcing.omega);
        }
        // The last factor covers the rounding of this very bound.
        (oscillator.ceiling(d[N], d[N + 1]) + window * oscillator.reach * forcing) * (1.0 + 1e-12)
    }

    /// The Taylor series about the start.
    pub fn series(&self) -> Series {
        let Oscillator {
            delta,
            omega0_squared,
            ..
        } = *self.oscillator;
        let mut base = [0.0; DEGREE];
        base[..4].copy_from_slice(&self.base.drive.signal);
        if let Some(z) = self.phasor {
            let mut term = z;
            for (n, b) in base.iter_mut().enumerate() {
                *b += term.im;
                let scale = self.forcing.omega / (n as f64 + 1.0);
                term = Complex64::new(-term.im * scale, term.re * scale);
            }
        }
        let mut c = [0.0; DEGREE + 1];
        (c[0], c[1]) = (self.x0, self.v0);
        for n in 0..DEGREE - 1 {
            let (n1, n2) = (n as f64 + 1.0, n as f64 + 2.0);
            let damping = 2.0 * delta * n1 * (c[n + 1] - base[n + 1]);
            c[n + 2] = -(damping + omega0_squared * (c[n] - base[n])) / (n1 * n2);
        }
        Series {
            coefficients: c,
            reach: SERIES_REACH / self.fastest(),
        }
    }

    /// What happens `t` seconds after the start; `series` is that of this motion.
    pub fn at(&self, series: &Series, t: f64) -> Instant {
        if t <= series.reach {
            let (dx, dv) = series.departure(t);
            let phasor = self
                .phasor
                .map_or(Complex64::ZERO, |z| z * turn(self.forcing.omega, t));
            let derivatives =
                self.by_equation(self.x0 + (self.v0 * t + dx), self.v0 + dv, phasor, t);
            Instant {
                departure: (dx, dv),
                derivatives,
            }
        } else {
            let derivatives = self.derivatives(t);
            let [x, v, ..] = derivatives;
            Instant {
                departure: (x - self.x0 - self.v0 * t, v - self.v0),
                derivatives,
            }
        }
    }
}

/// The motion at one instant.
#[derive(Clone, Copy, Debug)]
pub struct Instant {
    /// What has changed since the start beyond uniform motion: `x - x0 - v0 t` (m) and `v - v0` (m/s).
    pub departure: (f64, f64),
    /// Position and its derivatives.
    pub derivatives: Derivatives,
}

/// Position and velocity `h` seconds on by the local Taylor polynomial, for `h` far below every period.
pub fn nearby(d: &Derivatives, h: f64) -> (f64, f64) {
    (
        d[0] + h * (d[1] + h * (d[2] / 2.0 + h * (d[3] / 6.0 + h * d[4] / 24.0))),
        d[1] + velocity_change(d, h),
    )
}

/// Change of velocity over the next `h` seconds by the local Taylor polynomial.
pub fn velocity_change(d: &Derivatives, h: f64) -> f64 {
    h * (d[2] + h * (d[3] / 2.0 + h * (d[4] / 6.0 + h * d[5] / 24.0)))
}

/// The motion's Taylor series about its start.
#[derive(Clone, Copy, Debug)]
pub struct Series {
    coefficients: [f64; DEGREE + 1],
    /// Longest time the series is good for, s.
    pub reach: f64,
}

impl Series {
    /// `x - x0 - v0 t` and `v - v0` after `t` seconds, both with full relative accuracy for small `t`.
    pub fn departure(&self, t: f64) -> (f64, f64) {
        let (mut x, mut v) = (0.0, 0.0);
        for n in (2..=DEGREE).rev() {
            x = x * t + self.coefficients[n];
            v = v * t + self.coefficients[n] * n as f64;
        }
        (x * t * t, v * t)
    }
}

/// `e^{i omega t}`.
fn turn(omega: f64, t: f64) -> Complex64 {
    let (sin, cos) = sincos_of_product((omega, 0.0), t);
    Complex64::new(cos, sin)
}

/// `E e^{i phase}` for a frequency 0 or above: `E sin(phase - |omega| t) = -E sin(-phase + |omega| t)`.
fn phasor(base: &BaseMotion) -> Option<Complex64> {
    let amplitude = base.drive.amplitude;
    if amplitude == 0.0 {
        return None;
    }
    let (sin, cos) = libm::sincos(base.phase.radians());
    Some(if base.drive.omega < 0.0 {
        Complex64::new(-amplitude * cos, amplitude * sin)
    } else {
        Complex64::new(amplitude * cos, amplitude * sin)
    })
}

fn power<const N: usize>(x: f64) -> f64 {
    (0..N).fold(1.0, |product, _| product * x)
}

/// `-u''` of a bent signal `u` and what it grows by, where the oscillator creeps: the departure from the signal obeys
/// `z'' + 2 delta z' + omega0² z = -u''`.
fn push(oscillator: &Oscillator, [_, _, u2, u3]: [f64; 4]) -> Option<(Creep, [f64; 2])> {
    if u2 == 0.0 && u3 == 0.0 {
        return None;
    }
    Some((Creep::of(oscillator)?, [-2.0 * u2, -6.0 * u3]))
}

/// The polynomial motion that follows a polynomial base signal `u`: `u + s` with `s'' + 2 delta s' + omega0² s = -u''`.
fn follower(oscillator: &Oscillator, [u0, u1, u2, u3]: [f64; 4]) -> [f64; 4] {
    if u2 == 0.0 && u3 == 0.0 {
        return [u0, u1, 0.0, 0.0];
    }
    let s1 = -6.0 * u3 / oscillator.omega0_squared;
    let s0 = (-2.0 * u2 - 2.0 * oscillator.delta * s1) / oscillator.omega0_squared;
    [u0 + s0, u1 + s1, u2, u3]
}
