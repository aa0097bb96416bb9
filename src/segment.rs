//! One trajectory of an oscillator between two events, in closed form: no step, no step-size error.
//!
//! `x = p + y + E Im(z K)`: `p` the polynomial that follows a polynomial base signal, `y` the free motion from the start,
//! `z K` the response to the harmonic base motion ([`crate::forcing`]). For times that are short against every rate of the
//! motion its Taylor series about the start is summed instead. It keeps the *relative* digits of what has changed since the
//! start, which is what a particle hopping on its wall is made of.

use crate::arithmetic::sincos_of_product;
use crate::base_motion::BaseMotion;
use crate::clearance::{Gap, Look};
use crate::forcing::Forcing;
use crate::oscillator::{Oscillator, is_apart, pushed};
use num_complex::Complex64;

/// The series is used while `fastest rate * t` is at most this; degree 15 then leaves out less than 1e-18.
pub(crate) const SERIES_REACH: f64 = 0.5;
pub(crate) const SERIES_DEGREE: usize = 15;

/// Position and its first six derivatives.
pub type Derivatives = [f64; 7];

impl Look for Derivatives {}

/// The motion of the cavity from a start until the next event.
pub trait Motion {
    /// The motion at one instant.
    type Look: Look;

    /// The fastest rate in the motion, 1/s.
    fn fastest(&self) -> f64;

    /// Position and its derivatives at the start.
    fn derivatives_at_start(&self) -> Self::Look;

    /// The Taylor series about the start.
    fn series(&self) -> Series;

    /// What happens `t` seconds after the start; `series` is that of this motion.
    fn at(&self, series: &Series, t: f64) -> Instant<Self::Look> {
        // Every search begins with a look at the start.
        if t == 0.0 {
            let derivatives = self.derivatives_at_start();
            return Instant { moved: 0.0, departure: (0.0, 0.0), derivatives };
        }
        self.later(series, t)
    }

    /// What happens `t` seconds after the start, for `t` above 0; [`Motion::at`] knows the start itself.
    fn later(&self, series: &Series, t: f64) -> Instant<Self::Look>;

    /// How long `gap`, to the wall of the sign `sign`, is certainly open during a flight, s, at most `window`.
    fn certainly_open(&self, _sign: f64, gap: &Gap, d: &Self::Look, window: f64) -> f64 {
        gap.certainly_open(window, |h| self.third_derivative_bound(d, h))
    }

    /// A bound on `|x'''|` over the next `window` seconds, given the derivatives now.
    fn third_derivative_bound(&self, d: &Self::Look, window: f64) -> f64;

    /// A bound on the fourth derivative over the next `window` seconds, given the derivatives now.
    fn fourth_derivative_bound(&self, d: &Self::Look, window: f64) -> f64;

    /// A bound on the fifth derivative over the next `window` seconds, given the derivatives now.
    fn fifth_derivative_bound(&self, d: &Self::Look, window: f64) -> f64;
}

/// The motion of one oscillator from a start until the next event.
#[derive(Clone, Copy, Debug)]
pub struct Segment {
    oscillator: Oscillator,
    base: BaseMotion,
    /// `E e^{i phase}` at the start, for a frequency 0 or above, and the response to it; `None` where it is not driven.
    driven: Option<(Complex64, Forcing)>,
    /// The polynomial that follows the signal.
    follower: [f64; 4],
    /// Where the follower is the signal itself: the forcing by its curvature and jerk, m/s² and m/s³.
    pushed: Option<[f64; 2]>,
    x0: f64,
    v0: f64,
}

impl Segment {
    /// The motion that starts at `x0` (m) with `v0` (m/s) under `base`.
    pub fn new(oscillator: &Oscillator, base: BaseMotion, (x0, v0): (f64, f64)) -> Self {
        let [_, _, u2, u3] = base.drive.signal;
        // The departure from the signal `u` obeys `z'' + 2 delta z' + omega0² z = -u''`.
        let pushed = (!base.drive.is_straight() && is_apart(oscillator)).then_some([-2.0 * u2, -6.0 * u3]);
        let follower = if pushed.is_some() {
            base.drive.signal
        } else {
            follower(oscillator, base.drive.signal)
        };
        let forcing = || Forcing::new(oscillator, base.drive.omega.abs());
        Self {
            oscillator: *oscillator,
            base,
            driven: phasor(&base).map(|phasor| (phasor, forcing())),
            follower,
            pushed,
            x0,
            v0,
        }
    }

    /// The frequency of the base, rad/s, 0 or above; 0 where it has none.
    fn omega(&self) -> f64 {
        self.driven.as_ref().map_or(0.0, |(_, forcing)| forcing.omega)
    }

    /// Position (m) and velocity (m/s) after `t` seconds, and the base oscillator's phasor then.
    fn closed_form(&self, t: f64) -> (f64, f64, Complex64) {
        let p = &self.follower;
        let (free, decayed) = self.oscillator.flow(t);
        let (y, dy) = free.of(self.x0 - p[0], self.v0 - p[1]);
        let mut x = p[0] + t * (p[1] + t * (p[2] + t * p[3])) + y;
        let mut v = p[1] + t * (2.0 * p[2] + t * 3.0 * p[3]) + dy;
        if let Some([steady, growing]) = self.pushed {
            let (once, twice) = pushed(&self.oscillator, t);
            x += steady * once + growing * twice;
            v += steady * free.xv + growing * once;
        }
        let Some((z, forcing)) = &self.driven else {
            return (x, v, Complex64::ZERO);
        };
        let response = forcing.response(t, &free, decayed);
        x += (z * response.position).im;
        v += (z * response.velocity).im;
        (x, v, z * response.base)
    }

    /// Position and its derivatives after `t` seconds; from the second on they follow from the equation of motion.
    pub fn derivatives(&self, t: f64) -> Derivatives {
        let (x, v, phasor) = self.closed_form(t);
        self.by_equation(x, v, phasor, t)
    }

    fn by_equation(&self, x: f64, v: f64, phasor: Complex64, t: f64) -> Derivatives {
        let Oscillator { delta, omega0_squared, .. } = self.oscillator;
        let [u0, u1, u2, u3] = self.base.drive.signal;
        let omega = self.omega();
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
            d[n] = -2.0 * delta * (d[n - 1] - base[n - 1]) - omega0_squared * (d[n - 2] - base[n - 2]);
        }
        d
    }

    /// Every derivative of the motion obeys the equation of motion with the forcing's derivative: the energy of the free
    /// part never grows, and the forcing adds at most its own integral (variation of constants).
    #[cfg_attr(not(target_arch = "wasm32"), inline)]
    fn bound<const N: usize>(&self, d: &Derivatives, window: f64, signal: f64) -> f64 {
        let oscillator = &self.oscillator;
        let mut forcing = signal;
        if let Some((z, driven)) = &self.driven {
            forcing += z.l1_norm() * driven.strength.l1_norm() * driven.omega.powi(N as i32);
        }
        // The last factor covers the rounding of this very bound.
        (oscillator.ceiling(d[N], d[N + 1]) + window * oscillator.reach * forcing) * (1.0 + 1e-12)
    }
}

impl Motion for Segment {
    type Look = Derivatives;

    fn fastest(&self) -> f64 {
        self.oscillator.fastest.max(self.omega())
    }

    fn derivatives_at_start(&self) -> Derivatives {
        let phasor = self.driven.map_or(Complex64::ZERO, |(phasor, _)| phasor);
        self.by_equation(self.x0, self.v0, phasor, 0.0)
    }

    fn series(&self) -> Series {
        let Oscillator { delta, omega0_squared, .. } = self.oscillator;
        let mut base = [0.0; SERIES_DEGREE];
        base[..4].copy_from_slice(&self.base.drive.signal);
        if let Some((z, forcing)) = self.driven {
            let mut term = z;
            for (n, b) in base.iter_mut().enumerate() {
                *b += term.im;
                let scale = forcing.omega / (n as f64 + 1.0);
                term = Complex64::new(-term.im * scale, term.re * scale);
            }
        }
        let mut c = [0.0; SERIES_DEGREE + 1];
        (c[0], c[1]) = (self.x0, self.v0);
        for n in 0..SERIES_DEGREE - 1 {
            let (n1, n2) = (n as f64 + 1.0, n as f64 + 2.0);
            let damping = 2.0 * delta * n1 * (c[n + 1] - base[n + 1]);
            c[n + 2] = -(damping + omega0_squared * (c[n] - base[n])) / (n1 * n2);
        }
        Series { coefficients: c, reach: SERIES_REACH / self.fastest() }
    }

    fn later(&self, series: &Series, t: f64) -> Instant<Derivatives> {
        if t <= series.reach {
            let (dx, dv) = series.departure(t);
            let (sin, cos) = sincos_of_product((self.omega(), 0.0), t);
            let phasor = (self.driven).map_or(Complex64::ZERO, |(z, _)| z * Complex64::new(cos, sin));
            let derivatives = self.by_equation(self.x0 + (self.v0 * t + dx), self.v0 + dv, phasor, t);
            Instant { moved: self.v0 * t + dx, departure: (dx, dv), derivatives }
        } else {
            let derivatives = self.derivatives(t);
            let [x, v, ..] = derivatives;
            Instant {
                moved: x - self.x0,
                departure: (x - self.x0 - self.v0 * t, v - self.v0),
                derivatives,
            }
        }
    }

    #[cfg_attr(not(target_arch = "wasm32"), inline)]
    fn third_derivative_bound(&self, d: &Derivatives, window: f64) -> f64 {
        let signal = self.oscillator.omega0_squared * 6.0 * libm::fabs(self.base.drive.signal[3]);
        self.bound::<3>(d, window, signal)
    }

    fn fourth_derivative_bound(&self, d: &Derivatives, window: f64) -> f64 {
        self.bound::<4>(d, window, 0.0)
    }

    fn fifth_derivative_bound(&self, d: &Derivatives, window: f64) -> f64 {
        self.bound::<5>(d, window, 0.0)
    }
}

/// The motion at one instant.
#[derive(Clone, Copy, Debug)]
pub struct Instant<D> {
    /// Change of position since the start, m.
    pub moved: f64,
    /// What has changed since the start beyond uniform motion: `x - x0 - v0 t` (m) and `v - v0` (m/s).
    pub departure: (f64, f64),
    /// Position and its derivatives.
    pub derivatives: D,
}

/// Change of position over the next `h` seconds by the local Taylor polynomial, for `h` far below every period.
pub fn position_change(d: &impl Look, h: f64) -> f64 {
    h * (d[1] + h * (d[2] / 2.0 + h * (d[3] / 6.0 + h * d[4] / 24.0)))
}

/// Change of velocity over the next `h` seconds by the local Taylor polynomial.
pub fn velocity_change(d: &impl Look, h: f64) -> f64 {
    h * (d[2] + h * (d[3] / 2.0 + h * (d[4] / 6.0 + h * d[5] / 24.0)))
}

/// The motion's Taylor series about its start.
#[derive(Clone, Copy, Debug)]
pub struct Series {
    pub(crate) coefficients: [f64; SERIES_DEGREE + 1],
    /// Longest time the series is good for, s.
    pub reach: f64,
}

impl Series {
    /// `x - x0 - v0 t` and `v - v0` after `t` seconds, both with full relative accuracy for small `t`.
    pub fn departure(&self, t: f64) -> (f64, f64) {
        let (mut x, mut v) = (0.0, 0.0);
        for n in (2..=SERIES_DEGREE).rev() {
            x = x * t + self.coefficients[n];
            v = v * t + self.coefficients[n] * n as f64;
        }
        (x * t * t, v * t)
    }
}

/// `E e^{i phase}` for a frequency 0 or above: `E sin(phase - |omega| t) = -E sin(-phase + |omega| t)`.
pub(crate) fn phasor(base: &BaseMotion) -> Option<Complex64> {
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

/// The polynomial motion that follows a polynomial base signal `u`: `u + s` with `s'' + 2 delta s' + omega0² s = -u''`.
fn follower(oscillator: &Oscillator, [u0, u1, u2, u3]: [f64; 4]) -> [f64; 4] {
    if u2 == 0.0 && u3 == 0.0 {
        return [u0, u1, 0.0, 0.0];
    }
    let s1 = -6.0 * u3 / oscillator.omega0_squared;
    let s0 = (-2.0 * u2 - 2.0 * oscillator.delta * s1) / oscillator.omega0_squared;
    [u0 + s0, u1 + s1, u2, u3]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base_motion::{Drive, Phase};

    #[test]
    fn a_drive_of_negative_frequency_turns_backwards() {
        let (amplitude, omega, start) = (0.3, 1.7, 0.9_f64);
        for omega in [omega, -omega] {
            let phase = Phase::default().advanced(1.0, start);
            let base = BaseMotion { drive: Drive::harmonic(amplitude, omega), phase };
            let phasor = phasor(&base).expect("a drive");
            for t in [0.0, 0.4, 2.0] {
                let turned = phasor * Complex64::from_polar(1.0, omega.abs() * t);
                let expected = amplitude * libm::sin(start + omega * t);
                assert!(
                    (turned.im - expected).abs() < 1e-15,
                    "{omega} {t}: {} {expected}",
                    turned.im
                );
            }
        }
    }
}
