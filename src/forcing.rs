//! The response of the oscillator to the harmonic base motion, from rest, in closed form.
//!
//! `x'' + 2 delta x' + omega0² x = Im(F e^{i omega t})` with `F = omega0² + 2 i delta omega`, per unit base amplitude. The
//! response from rest is `x = Im K(t)`, in one of two exact forms:
//!
//! - *Away from an undamped resonance*, `K = H (e^{i omega t} - xx(t) - i omega xv(t))`: the steady response
//!   `H = F/(omega0² - omega² + 2 i delta omega)` less the free motion that starts where it starts.
//! - *Near it*, where steady response and free motion are large and cancel, divided differences
//!   `K = F/(2 i omega_d) [ (e^{i omega t} - e^{lambda t})/(i omega - lambda) - (e^{i omega t} - e^{lambda* t})/(i omega - lambda*) ]`
//!   with `lambda = -delta + i omega_d`. The first quotient is `t e^{lambda t} phi((i omega - lambda) t)`,
//!   `phi(z) = (e^z - 1)/z`, which is a series for small `z`. At the resonance itself it is `t e^{lambda t}` (secular growth).

use crate::arithmetic::{product, sincos_of_product};
use crate::oscillator::{Oscillator, Regime, Transition};
use num_complex::Complex64;

/// Largest `|H|` for which the first form is used: its rounding error is `|H|` times that of a unit amplitude.
const LARGEST_STEADY: f64 = 64.0;

/// Coefficients of the response at one frequency.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Forcing {
    /// Frequency, rad/s, 0 or above.
    pub omega: f64,
    /// `F`, 1/s².
    pub strength: Complex64,
    form: Form,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Form {
    /// `H`.
    Steady(Complex64),
    DividedDifferences {
        /// `F/(2 i omega_d)`.
        gain: Complex64,
        /// `i omega - lambda`: small near resonance.
        near: Complex64,
        /// `1/(i omega - lambda*)`.
        far: Complex64,
    },
}

impl Default for Form {
    fn default() -> Self {
        Self::Steady(Complex64::ZERO)
    }
}

/// The response from rest after a time, per unit base amplitude, for a base phasor of 1 at the start.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Response {
    /// `e^{i omega t}`: the base phasor now.
    pub base: Complex64,
    /// `K`: the displacement is `Im K`.
    pub position: Complex64,
    /// `K'`, 1/s: the velocity is `Im K'`.
    pub velocity: Complex64,
}

impl Forcing {
    /// Coefficients for `omega` (rad/s), 0 or above.
    pub fn new(oscillator: &Oscillator, omega: f64) -> Self {
        let Oscillator { delta, omega0_squared, .. } = *oscillator;
        Self::with_strength(oscillator, omega, Complex64::new(omega0_squared, 2.0 * delta * omega))
    }

    /// Coefficients for `omega` (rad/s), 0 or above, and a forcing of the strength `F`, 1/s², which need not be that of a base.
    pub(crate) fn with_strength(oscillator: &Oscillator, omega: f64, strength: Complex64) -> Self {
        let Oscillator { delta, omega0_squared, .. } = *oscillator;
        let base = Complex64::new(omega0_squared, 2.0 * delta * omega);
        let (square, error) = product(omega, omega);
        let detuned = Complex64::new((omega0_squared - square) - error, base.im);
        let limit = LARGEST_STEADY * LARGEST_STEADY * detuned.norm_sqr();
        let form = match oscillator.regime {
            Regime::Oscillating { omega_d } if base.norm_sqr() > limit => Form::DividedDifferences {
                gain: strength / Complex64::new(0.0, 2.0 * omega_d),
                near: Complex64::new(delta, (omega - omega_d) - oscillator.omega_d_error),
                far: Complex64::new(delta, omega + omega_d).inv(),
            },
            _ => Form::Steady(strength / detuned),
        };
        Self { omega, strength, form }
    }

    /// `H`, where the first form is used.
    pub(crate) fn steady(&self) -> Option<Complex64> {
        match self.form {
            Form::Steady(steady) => Some(steady),
            Form::DividedDifferences { .. } => None,
        }
    }

    /// The response after `t` seconds; `free` and `decayed` are the free motion's ([`Oscillator::flow`]) after that time.
    pub(crate) fn response(&self, t: f64, free: &Transition, decayed: Complex64) -> Response {
        let (sin, cos) = sincos_of_product((self.omega, 0.0), t);
        self.response_to(Complex64::new(cos, sin), t, free, decayed)
    }

    /// The same; `base` is `e^{i omega t}`.
    #[inline(always)]
    pub(crate) fn response_to(&self, base: Complex64, t: f64, free: &Transition, decayed: Complex64) -> Response {
        let position = match self.form {
            Form::Steady(steady) => steady * (base - Complex64::new(free.xx, self.omega * free.xv)),
            Form::DividedDifferences { gain, near, far } => {
                let first = divided_difference(near, t, base, decayed);
                let second = (base - decayed.conj()) * far;
                gain * (first - second)
            }
        };
        // `K' = i omega K + F xv`: the response to the slope of the base motion, and to its jump from rest.
        let turned = Complex64::new(-self.omega * position.im, self.omega * position.re);
        Response { base, position, velocity: self.strength * free.xv + turned }
    }
}

/// `(e^{i omega t} - e^{lambda t})/(i omega - lambda)`, whatever the distance between the two exponents.
fn divided_difference(near: Complex64, t: f64, turned: Complex64, decayed: Complex64) -> Complex64 {
    let z = near * t;
    if z.norm_sqr() < 0.25 {
        decayed * t * phi(z)
    } else {
        (turned - decayed) / near
    }
}

/// `(e^z - 1)/z` for `|z| <= 1/2`, from its series: the first term left out is below 1e-19.
fn phi(z: Complex64) -> Complex64 {
    let terms = match z.norm_sqr() {
        tiny if tiny < 1e-6 => 6,
        small if small < 1e-3 => 9,
        _ => 16,
    };
    let mut sum = Complex64::new(1.0, 0.0);
    for n in (2..=terms).rev() {
        sum = sum * z * (1.0 / f64::from(n)) + 1.0;
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_series_of_phi_agrees_with_the_quotient() {
        for angle in 0..16 {
            for (size, error) in [(0.5, 1e-15), (0.032, 1e-14), (0.031, 1e-14), (1e-3, 1e-12)] {
                let z = Complex64::from_polar(size, f64::from(angle) * 0.4);
                let quotient = (z.exp() - 1.0) / z;
                assert!((phi(z) - quotient).norm() < error, "{size}");
            }
        }
    }
}
