//! Second-order sections between impacts, in closed form for every damping ratio; and the study's oscillator, which is one of them, under the
//! harmonic base.

use nalgebra::{Complex, Matrix2, Vector2};

use crate::Dimensionless;

/// A section of a host as in [`lovines::host`]: its state (x, v) has `x' = v + d u`, `v' = -omega0² x - 2 delta v + (c - 2 delta d) u`
/// under the drive u. An impulse J on the host at the cavity adds `kick J`, and the displacement of the cavity is the sum of `a x + b v`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Section {
    /// Decay rate, 1/s.
    pub delta: f64,
    /// Natural frequency squared, 1/s².
    pub omega0_squared: f64,
    /// (c, d).
    pub drive: [f64; 2],
    /// Jump of (x, v) per impulse.
    pub kick: [f64; 2],
    /// (a, b).
    pub cavity: [f64; 2],
}

impl From<&lovines::Section> for Section {
    fn from(section: &lovines::Section) -> Self {
        let lovines::Section { oscillator, drive, kick, cavity } = *section;
        Self {
            delta: oscillator.delta,
            omega0_squared: oscillator.omega0_squared,
            drive,
            kick,
            cavity,
        }
    }
}

impl Section {
    /// The study's oscillator on its base, dimensionless: mass and natural frequency are 1, and `damping` is `2 zeta = epsilon lambda`.
    pub(crate) fn oscillator(damping: f64) -> Self {
        Self {
            delta: damping / 2.0,
            omega0_squared: 1.0,
            drive: [1.0, damping],
            kick: [0.0, 1.0],
            cavity: [1.0, 0.0],
        }
    }

    /// A free particle as a section of a host whose displacement at the cavity is the relative displacement w.
    pub(super) fn particle(mass: f64) -> Self {
        Self {
            delta: 0.0,
            omega0_squared: 0.0,
            drive: [0.0; 2],
            kick: [0.0, -1.0 / mass],
            cavity: [-1.0, 0.0],
        }
    }

    /// Displacement and velocity of the cavity for (x, v), without drive.
    pub(super) fn at_cavity(&self, state: Vector2<f64>) -> Vector2<f64> {
        let ([a, b], rate) = (self.cavity, self.rate(state));
        Vector2::new(a * state[0] + b * state[1], a * rate[0] + b * rate[1])
    }

    /// Velocity of the cavity per impulse.
    pub(super) fn mobility(&self) -> f64 {
        self.at_cavity(self.kick.into())[1]
    }

    /// Factors of (x, v) whose squares sum up to twice the energy, up to a factor that all sections have in common: those of a
    /// mass-normalised mode are omega0 and 1. Without a natural frequency, the displacement counts as at the frequency `omega`.
    pub(super) fn energy_scales(&self, omega: f64) -> [f64; 2] {
        let omega0 = if self.omega0_squared > 0.0 {
            self.omega0_squared.sqrt()
        } else {
            omega
        };
        let ([a, b], [x, dx]) = (self.cavity, self.kick);
        let (seen, kicked) = (a.hypot(omega0 * b), dx.hypot(omega0 * x));
        let scale = if seen > 0.0 && kicked > 0.0 {
            (seen / kicked).sqrt()
        } else {
            1.0
        };
        [scale * omega0, scale]
    }

    /// (x, v) after one of the unit impulses of alternating sign that the propagator `flow` separates: minus the state after the one before.
    #[inline(always)]
    pub(super) fn alternating(&self, flow: &Matrix2<f64>) -> Option<Vector2<f64>> {
        let sum = Matrix2::identity() + flow;
        let (determinant, [x, dx]) = (sum.determinant(), self.kick);
        let solution = Vector2::new(sum.m22 * x - sum.m12 * dx, sum.m11 * dx - sum.m21 * x) / determinant;
        (determinant != 0.0).then_some(solution)
    }

    /// Response of (x, v) to the drive `exp(i omega t)`, over the compliance.
    pub(super) fn driven(&self, omega: f64) -> [Complex<f64>; 2] {
        let [c, d] = self.drive;
        let v = Complex::new(-d * self.omega0_squared, (c - 2.0 * self.delta * d) * omega);
        [self.drive_force(omega), v]
    }

    /// Response of (x, v) to the force `exp(i omega t)` on the host at the cavity, over the compliance.
    pub(super) fn kicked(&self, omega: f64) -> [Complex<f64>; 2] {
        let [x, v] = self.kick;
        [
            Complex::new(v + 2.0 * self.delta * x, x * omega),
            Complex::new(-x * self.omega0_squared, v * omega),
        ]
    }

    /// Maps (x, v) over the time `t` without drive.
    #[inline(always)]
    pub(crate) fn propagator(&self, t: f64) -> Matrix2<f64> {
        let (cosine, sine) = self.envelope(t);
        let Self { delta, omega0_squared, .. } = *self;
        Matrix2::new(
            cosine + delta * sine,
            sine,
            -omega0_squared * sine,
            cosine - delta * sine,
        )
    }

    /// `exp(-delta t)` times cos(d t) and sin(d t)/d, with `d² = omega0² - delta²` of either sign or zero.
    #[inline(always)]
    fn envelope(&self, t: f64) -> (f64, f64) {
        let square = self.omega0_squared - self.delta * self.delta;
        let decay = (-self.delta * t).exp();
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
        let (slow, fast) = (((d - self.delta) * t).exp(), ((-d - self.delta) * t).exp());
        ((slow + fast) / 2.0, (slow - fast) / (2.0 * d))
    }

    /// Response of x to the force `exp(i omega t)` on it.
    pub(crate) fn compliance(&self, omega: f64) -> Complex<f64> {
        self.stiffness(omega).inv()
    }

    /// `omega0² - omega² + 2 i delta omega`.
    pub(crate) fn stiffness(&self, omega: f64) -> Complex<f64> {
        Complex::new(self.omega0_squared - omega * omega, 2.0 * self.delta * omega)
    }

    /// `c u + d u'` for the drive `exp(i omega t)`.
    pub(crate) fn drive_force(&self, omega: f64) -> Complex<f64> {
        let [c, d] = self.drive;
        Complex::new(c, d * omega)
    }

    /// x'' without drive.
    pub(crate) fn free_acceleration(&self, x: f64, dx: f64) -> f64 {
        -self.omega0_squared * x - 2.0 * self.delta * dx
    }

    /// The time derivative of (x, v) without drive.
    pub(super) fn rate(&self, state: Vector2<f64>) -> Vector2<f64> {
        Vector2::new(state[1], self.free_acceleration(state[0], state[1]))
    }
}

/// The harmonic `a x + b v` of (x, v).
pub(super) fn harmonic([a, b]: [f64; 2], [x, v]: [Complex<f64>; 2]) -> Complex<f64> {
    x * a + v * b
}

/// The oscillator at one frequency and excitation.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ForcedOscillator {
    pub(super) free: Section,
    pub(super) omega: f64,
    epsilon: f64,
    pub(super) g: f64,
    /// Harmonic response of q1 to the base, per G, and its derivative by Omega.
    pub(super) unit: [Complex<f64>; 2],
}

impl ForcedOscillator {
    /// The oscillator of `scene` (except its G) at the frequency `omega` over omega0 and the excitation `g`.
    pub(crate) fn new(scene: &Dimensionless, omega: f64, g: f64) -> Self {
        let free = Section::oscillator(scene.epsilon * scene.lambda);
        let (force, compliance) = (free.drive_force(omega), free.compliance(omega));
        let unit = force * compliance * scene.epsilon;
        let stiffness_by = Complex::new(-2.0 * omega, 2.0 * free.delta);
        let unit_by = (Complex::new(0.0, free.drive[1]) * scene.epsilon - unit * stiffness_by) * compliance;
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
        let amplitude = self.free.drive_force(self.omega) * (self.epsilon * self.g);
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
mod tests {
    use super::*;

    #[test]
    fn two_half_steps_make_one_step_which_starts_along_the_equation_of_motion_at_any_damping() {
        for zeta in [0.0, 0.006, 0.3, 1.0 - 1e-9, 1.0, 1.0 + 1e-9, 2.5] {
            let oscillator = Section::oscillator(2.0 * zeta);
            let half = oscillator.propagator(1.6);
            let difference = half * half - oscillator.propagator(3.2);
            assert!(difference.norm() < 1e-14, "zeta = {zeta}: {difference}");
            let h = 1e-6;
            let slope = (oscillator.propagator(h) - oscillator.propagator(-h)) / (2.0 * h);
            let expected = Matrix2::new(0.0, 1.0, -1.0, -2.0 * zeta);
            assert!((slope - expected).norm() < 1e-9, "zeta = {zeta}");
        }
    }
}
