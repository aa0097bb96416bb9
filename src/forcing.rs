//! The oscillator's answer to the built-in base oscillator, from rest, in closed form.
//!
//! `x'' + 2 delta x' + omega0² x = Im(F e^{i omega t})`, `F = omega0² + 2 i delta omega` (per unit base amplitude).
//!
//! Two exact forms, chosen by the damping ratio:
//!
//! - *Lightly damped*: the answer from rest, `x = Im K(t)` with
//!   `K = F/(2 i omega_d) [ (e^{i omega t} - e^{lambda t})/(i omega - lambda) - (e^{i omega t} - e^{lambda* t})/(i omega - lambda*) ]`,
//!   `lambda = -delta + i omega_d`. At an undamped resonance `i omega = lambda` and the first quotient is `t e^{lambda t}`
//!   (secular growth); near it, it is `t e^{lambda t} phi((i omega - lambda) t)`, `phi(z) = (e^z - 1)/z`, taken from its
//!   series. There is nothing to divide by zero and nothing that cancels.
//! - *Heavily damped*: the steady answer `H e^{i omega t}`, `H = F/(omega0² - omega² + 2 i delta omega)`, whose
//!   denominator is never small there; the free motion takes up the difference at the start.

use crate::oscillator::{Oscillator, Regime};
use num_complex::Complex64;
use serde::{Deserialize, Serialize};

/// Below this damping ratio the answer is taken from rest, above it as a steady answer.
const LIGHT_DAMPING: f64 = 0.5;

/// Coefficients of the answer at one frequency.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Forcing {
    /// Frequency, rad/s, 0 or above.
    pub omega: f64,
    /// `|F|`, 1/s²: how strongly a unit base amplitude drives the oscillator.
    pub strength: f64,
    pub(crate) answer: Answer,
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) enum Answer {
    /// From rest, by divided differences.
    FromRest {
        lambda: Complex64,
        omega_d: f64,
        /// `F/(2 i omega_d)`.
        gain: Complex64,
        /// `i omega - lambda`: small near resonance.
        near: Complex64,
        /// `1/(i omega - lambda*)`.
        far: Complex64,
    },
    /// The steady answer per unit base amplitude.
    Steady(Complex64),
}

impl Forcing {
    /// Coefficients for `omega` >= 0.
    pub fn new(oscillator: &Oscillator, omega: f64) -> Self {
        let Oscillator {
            delta,
            omega0,
            omega0_squared,
            ..
        } = *oscillator;
        let f = Complex64::new(omega0_squared, 2.0 * delta * omega);
        let answer = match oscillator.regime {
            Regime::Oscillating { omega_d } if delta < LIGHT_DAMPING * omega0 => Answer::FromRest {
                lambda: Complex64::new(-delta, omega_d),
                omega_d,
                gain: f / Complex64::new(0.0, 2.0 * omega_d),
                near: Complex64::new(delta, oscillator.detuning(omega, omega_d)),
                far: Complex64::new(delta, omega + omega_d).inv(),
            },
            _ => Answer::Steady(
                f / Complex64::new((omega0 - omega) * (omega0 + omega), 2.0 * delta * omega),
            ),
        };
        Self {
            omega,
            strength: libm::hypot(f.re, f.im),
            answer,
        }
    }
}

/// `(e^{i omega t} - e^{lambda t})/(i omega - lambda)`, whatever the distance between the two exponents.
pub(crate) fn divided_difference(
    near: Complex64,
    t: f64,
    turned: Complex64,
    decayed: Complex64,
) -> Complex64 {
    let z = near * t;
    if z.norm_sqr() < 0.25 {
        decayed * t * phi(z)
    } else {
        (turned - decayed) / near
    }
}

/// `(e^z - 1)/z` for `|z| <= 1/2`, from its series: the first term left out is below 2^-16/17! = 4e-20.
fn phi(z: Complex64) -> Complex64 {
    let mut sum = Complex64::new(1.0, 0.0);
    for n in (2..=16).rev() {
        sum = sum * z * (1.0 / f64::from(n)) + 1.0;
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_series_of_phi_meets_the_quotient_where_they_change_over() {
        for angle in 0..16 {
            let z = Complex64::from_polar(0.5, f64::from(angle) * 0.4);
            let quotient = (z.exp() - 1.0) / z;
            assert!((phi(z) - quotient).norm() < 1e-15);
        }
    }
}
