//! The oscillator between impacts: `q'' + 2 zeta q' + q = f`, in closed form for every damping ratio.

use nalgebra::{Complex, Matrix2};

/// The damped oscillator with unit natural frequency; `zeta = epsilon lambda/2`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Oscillator {
    zeta: f64,
}

impl Oscillator {
    pub(super) fn new(zeta: f64) -> Self {
        Self { zeta }
    }

    /// Maps (q, q') over the time `t` without forcing.
    pub(super) fn propagator(&self, t: f64) -> Matrix2<f64> {
        let (cosine, sine) = self.envelope(t);
        let zeta = self.zeta;
        Matrix2::new(cosine + zeta * sine, sine, -sine, cosine - zeta * sine)
    }

    /// `exp(-zeta t)` times cos(d t) and sin(d t)/d, with `d^2 = 1 - zeta^2` of either sign or zero.
    fn envelope(&self, t: f64) -> (f64, f64) {
        let square = 1.0 - self.zeta * self.zeta;
        let decay = (-self.zeta * t).exp();
        let x = square * t * t;
        if x.abs() < 1e-4 {
            // Nearly critical: the Taylor series of both, exact to 1e-17 here.
            let cosine = 1.0 - x / 2.0 * (1.0 - x / 12.0 * (1.0 - x / 30.0));
            let sine = t * (1.0 - x / 6.0 * (1.0 - x / 20.0 * (1.0 - x / 42.0)));
            return (decay * cosine, decay * sine);
        }
        let d = square.abs().sqrt();
        if square > 0.0 {
            let (sine, cosine) = (d * t).sin_cos();
            return (decay * cosine, decay * sine / d);
        }
        // Decaying exponentials only: cosh and sinh alone would overflow long before their product with the decay.
        let (slow, fast) = (((d - self.zeta) * t).exp(), ((-d - self.zeta) * t).exp());
        ((slow + fast) / 2.0, (slow - fast) / (2.0 * d))
    }

    /// As [`Self::propagator`], with functions of single precision.
    pub(super) fn rough_propagator(&self, t: f64) -> Matrix2<f64> {
        let square = 1.0 - self.zeta * self.zeta;
        if square < 1e-4 {
            return self.propagator(t);
        }
        let d = square.sqrt();
        let (sine, cosine) = rough_sin_cos(d * t);
        let decay = f64::from(((-self.zeta * t) as f32).exp());
        let (cosine, sine) = (decay * cosine, decay * sine / d);
        let zeta = self.zeta;
        Matrix2::new(cosine + zeta * sine, sine, -sine, cosine - zeta * sine)
    }

    /// Response to the force `exp(i omega t)`: `1/(1 - omega^2 + 2 i zeta omega)`.
    pub(super) fn compliance(&self, omega: f64) -> Complex<f64> {
        self.stiffness(omega).inv()
    }

    /// `1 - omega^2 + 2 i zeta omega`.
    pub(super) fn stiffness(&self, omega: f64) -> Complex<f64> {
        Complex::new(1.0 - omega * omega, 2.0 * self.zeta * omega)
    }

    /// Force made by the base displacement `exp(i omega t)`: `1 + 2 i zeta omega`, through spring and damper.
    pub(super) fn base_force(&self, omega: f64) -> Complex<f64> {
        Complex::new(1.0, 2.0 * self.zeta * omega)
    }

    /// `-q - 2 zeta q'`: acceleration without forcing.
    pub(super) fn free_acceleration(&self, q: f64, dq: f64) -> f64 {
        -q - 2.0 * self.zeta * dq
    }
}

/// Sine and cosine in single precision.
pub(super) fn rough_sin_cos(angle: f64) -> (f64, f64) {
    let (sine, cosine) = (angle as f32).sin_cos();
    (f64::from(sine), f64::from(cosine))
}

#[cfg(test)]
#[path = "../../tests/unit/oscillator.rs"]
mod tests;
