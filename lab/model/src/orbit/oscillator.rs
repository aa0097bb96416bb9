//! The oscillator between impacts, `q'' + 2 zeta q' + q = f`, in closed form for every damping ratio: free, and under the harmonic base.

use nalgebra::{Complex, Matrix2, Vector2};

use crate::Dimensionless;

/// The damped oscillator with unit natural frequency; `zeta = epsilon lambda/2`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct FreeOscillator {
    pub(super) zeta: f64,
}

impl FreeOscillator {
    pub(crate) fn new(zeta: f64) -> Self {
        Self { zeta }
    }

    /// Maps (q, q') over the time `t` without forcing.
    pub(crate) fn propagator(&self, t: f64) -> Matrix2<f64> {
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

    /// Response to the force `exp(i omega t)`: `1/(1 - omega^2 + 2 i zeta omega)`.
    pub(crate) fn compliance(&self, omega: f64) -> Complex<f64> {
        self.stiffness(omega).inv()
    }

    /// `1 - omega^2 + 2 i zeta omega`.
    pub(crate) fn stiffness(&self, omega: f64) -> Complex<f64> {
        Complex::new(1.0 - omega * omega, 2.0 * self.zeta * omega)
    }

    /// Force made by the base displacement `exp(i omega t)`: `1 + 2 i zeta omega`, through spring and damper.
    pub(crate) fn base_force(&self, omega: f64) -> Complex<f64> {
        Complex::new(1.0, 2.0 * self.zeta * omega)
    }

    /// `-q - 2 zeta q'`: acceleration without forcing.
    pub(crate) fn free_acceleration(&self, q: f64, dq: f64) -> f64 {
        -q - 2.0 * self.zeta * dq
    }
}

/// The oscillator at one frequency and excitation.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ForcedOscillator {
    pub(super) free: FreeOscillator,
    pub(super) omega: f64,
    epsilon: f64,
    pub(super) g: f64,
    /// Harmonic response of q1 to the base, per G, and its derivative by Omega.
    pub(super) unit: [Complex<f64>; 2],
}

impl ForcedOscillator {
    /// The oscillator of `scene` (except its G) at the frequency `omega` over omega0 and the excitation `g`.
    pub(crate) fn new(scene: &Dimensionless, omega: f64, g: f64) -> Self {
        let zeta = scene.epsilon * scene.lambda / 2.0;
        let free = FreeOscillator::new(zeta);
        let (force, compliance) = (free.base_force(omega), free.compliance(omega));
        let unit = force * compliance * scene.epsilon;
        let stiffness_by = Complex::new(-2.0 * omega, 2.0 * zeta);
        let unit_by = (Complex::new(0.0, 2.0 * zeta) * scene.epsilon - unit * stiffness_by) * compliance;
        Self {
            free,
            omega,
            epsilon: scene.epsilon,
            g,
            unit: [unit, unit_by],
        }
    }

    /// Bound of the acceleration of the steady response.
    pub(crate) fn acceleration(&self) -> f64 {
        self.driven(self.unit[0] * self.g).norm() * self.omega * self.omega
    }

    /// Force of the base on the primary mass.
    pub(super) fn force(&self, phase: f64) -> f64 {
        let amplitude = self.free.base_force(self.omega) * (self.epsilon * self.g);
        (amplitude * Complex::from_polar(1.0, phase)).im
    }

    /// Harmonic response (q, q') at a phase of the base.
    pub(crate) fn harmonic(&self, phase: f64) -> Vector2<f64> {
        let z = self.driven(self.unit[0] * self.g) * Complex::from_polar(1.0, phase);
        Vector2::new(z.im, self.omega * z.re)
    }

    /// Derivatives of the harmonic response by phase, Omega and G.
    pub(super) fn derivatives(&self, phase: f64) -> [Vector2<f64>; 3] {
        let [unit, unit_by] = self.unit;
        let turned = [unit * self.g, unit_by * self.g, unit].map(|z| self.driven(z) * Complex::from_polar(1.0, phase));
        let [z, slope, per_g] = turned;
        [
            Vector2::new(z.re, -self.omega * z.im),
            Vector2::new(slope.im, z.re + self.omega * slope.re),
            Vector2::new(per_g.im, self.omega * per_g.re),
        ]
    }

    /// A response to the base: without excitation it is zero, even at an undamped resonance.
    pub(super) fn driven(&self, z: Complex<f64>) -> Complex<f64> {
        if z.is_nan() && self.g == 0.0 {
            return Complex::new(0.0, 0.0);
        }
        z
    }
}

#[cfg(test)]
#[path = "../../tests/unit/oscillator.rs"]
mod tests;
