//! All symmetric motions at one frequency: at phase resonance or under a given excitation, the particle's speed is the root of a
//! quadratic.
//!
//! Time starts at an impact on the wall w = +1; complex amplitudes Z stand for `Im(Z exp(i Omega tau))`.
//!
//! - The particle turns from -B to +B, so `w'- = 2 B (1 + epsilon)/(1 + r)` and the oscillator's velocity jumps by -2 epsilon B.
//! - `q2 = -pi B/(2 Omega)` at the impact, because half a period later it is at the opposite point.
//! - `q1 = y - 2 epsilon B p`, with the harmonic y of amplitude Y and p the periodic response to impulses of alternating sign.
//! - `w = 1` and `w' = w'-` at the impact then give `Im Y = 1 + alpha B` and `Re Y = beta B`.
//! - Phase resonance, `Re(V conj(F)) = 0` for the harmonic V of v and the base's harmonic F, is quadratic in B and free of G;
//!   `G = |F|/epsilon` follows. The exact backbone is therefore parametrised by its frequency.

use std::f64::consts::{FRAC_PI_2, PI};

use nalgebra::{Complex, Matrix2, Vector2};

use super::{AfterImpact, oscillator::Oscillator};
use crate::numerics::quadratic;
use crate::{Definition, Dimensionless, Sensor};

/// A symmetric motion that satisfies the impact law and the phase resonance, not yet checked for `|w| <= 1` in flight.
#[derive(Debug, Clone, Copy)]
pub(super) struct Candidate {
    /// Angular frequency over omega0.
    pub omega: f64,
    /// Speed of the particle; not physical unless positive.
    pub b: f64,
    /// Amplitude of the first harmonic of the response.
    pub c: f64,
    /// Base amplitude over `b epsilon`.
    pub g: f64,
    /// The state just after the impact on the wall w = +1.
    pub start: AfterImpact,
    /// Phase of the first harmonic of the response relative to the reference, rad.
    pub gamma: f64,
    /// The first harmonic of the response lags the reference by pi/2, rather than leading it.
    pub(super) lags: bool,
}

/// All symmetric motions at one frequency, whatever drives them: everything is linear in B.
pub(super) struct Family {
    omega: f64,
    epsilon: f64,
    alpha: f64,
    beta: f64,
    /// First harmonic of v or q1, as the sensor says, less that of y, over B.
    kappa: Complex<f64>,
    /// Factor of the sensor, and direction of the reference in the complex plane.
    scale: f64,
    reference: Complex<f64>,
    base_over_y: Complex<f64>,
    p: Vector2<f64>,
}

impl Family {
    pub(super) fn new(scene: &Dimensionless, omega: f64) -> Option<Self> {
        let Dimensionless { epsilon, r, .. } = *scene;
        let oscillator = Oscillator::new(epsilon * scene.lambda / 2.0);

        // Unit impulses at tau = 0, -T, -2T…, alternating: half a period later the state is minus the one before.
        let flight = oscillator.propagator(PI / omega);
        let p = (Matrix2::identity() + flight).try_inverse()? * Vector2::new(0.0, 1.0);
        let p_before = p - Vector2::new(0.0, 1.0);

        // v = y + B kappa in the first harmonic: impulses through the oscillator, and the particle's triangle wave.
        let impulse = Complex::new(0.0, 2.0 * omega / PI);
        let Definition { sensor, reference, .. } = scene.definition;
        let triangle = match sensor {
            Sensor::V => Complex::new(0.0, -4.0 / (PI * omega)),
            Sensor::Q1 | Sensor::Acceleration => Complex::new(0.0, 0.0),
        };
        Some(Self {
            omega,
            epsilon,
            alpha: 2.0 * epsilon * p_before[0] - FRAC_PI_2 / omega,
            beta: (2.0 * (1.0 + epsilon) / (1.0 + r) - 1.0 + 2.0 * epsilon * p_before[1]) / omega,
            kappa: (oscillator.compliance(omega) * impulse * -2.0 + triangle) * epsilon,
            scale: if sensor == Sensor::Acceleration {
                omega * omega
            } else {
                1.0
            },
            reference: Complex::from_polar(1.0, reference.phase(epsilon * scene.lambda, omega)),
            base_over_y: oscillator.stiffness(omega) / oscillator.base_force(omega),
            p,
        })
    }

    /// Coefficients of B², B and 1 in `Re(V conj(F))`, up to a factor: zero at phase resonance.
    fn resonance(&self) -> [f64; 3] {
        let Self { alpha, beta, .. } = *self;
        // Only the direction of the base's harmonic matters for the phase.
        let d = (self.base_over_y * self.reference).conj();
        let u = d * self.kappa;
        [
            d.re * (alpha * alpha + beta * beta) + u.re * beta + u.im * alpha,
            2.0 * alpha * d.re + u.im,
            d.re,
        ]
    }

    /// How far the motion with the speed `b` is from phase resonance, in the units of the coefficients.
    pub(super) fn off_resonance(&self, b: f64) -> f64 {
        let [square, linear, constant] = self.resonance();
        (square * b + linear) * b + constant
    }

    /// The two motions at phase resonance, each a continuous branch where it exists.
    pub(super) fn phase_resonant(&self) -> Option<[Candidate; 2]> {
        let [square, linear, constant] = self.resonance();
        let speeds = quadratic(square, linear, constant)?;
        Some(speeds.map(|b| self.at(b)))
    }

    /// The two motions under the excitation `g`: `|y|^2` is quadratic in B.
    pub(super) fn driven(&self, g: f64) -> Option<[Candidate; 2]> {
        let Self { alpha, beta, .. } = *self;
        let y = self.epsilon * g / self.base_over_y.norm();
        let speeds = quadratic(alpha * alpha + beta * beta, 2.0 * alpha, 1.0 - y * y)?;
        Some(speeds.map(|b| self.at(b)))
    }

    /// The smallest excitation under which there is a motion: the discriminant of the quadratic is zero.
    pub(super) fn least_excitation(&self) -> f64 {
        self.base_over_y.norm() / self.epsilon * self.beta.abs() / self.alpha.hypot(self.beta)
    }

    /// The motion with the particle speed `b`, whatever drives it.
    pub(super) fn at(&self, b: f64) -> Candidate {
        let y = Complex::new(self.beta * b, 1.0 + self.alpha * b);
        let v = y + self.kappa * b;
        let base = y * self.base_over_y;
        let p_before = self.p - Vector2::new(0.0, 1.0);
        let [q1, before] = (Vector2::new(y.im, self.omega * y.re) - p_before * (2.0 * self.epsilon * b)).into();
        let start = AfterImpact {
            phase: base.arg(),
            q1,
            dq1: before - 2.0 * self.epsilon * b,
            q2: q1 - 1.0,
            dq2: b,
        };
        Candidate {
            omega: self.omega,
            b,
            c: v.norm() * self.scale,
            gamma: (v * (base * self.reference).conj()).arg(),
            g: base.norm() / self.epsilon,
            start,
            lags: (v * (base * self.reference).conj()).im < -1e-12 * v.norm() * base.norm(),
        }
    }
}
