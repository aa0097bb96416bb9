//! Resonance by the scene's definition: the first-order motion read by a sensor, its phase relative to a reference, or its peak.
//!
//! Sensor and reference change phase and amplitude by terms of first order in epsilon, which is also the order of the theory's own error
//! (validation/convergence.csv).

use std::f64::consts::{FRAC_2_PI, FRAC_PI_2};

use nalgebra::Complex;

use super::slow_flow::{BackbonePoint, BranchSide, SlowFlow};
use crate::numerics::equally_spaced;
use crate::{Dimensionless, Resonance, Sensor};

/// All solutions of first-order theory that are resonant by the scene's definition, at its G, by increasing B. `C` is the amplitude that
/// the sensor reads.
pub fn resonant(scene: &Dimensionless) -> Vec<BackbonePoint> {
    let theory = Reading::of(scene);
    let points = theory.flow.phase_resonant(scene.g).into_iter();
    points
        .filter_map(|point| theory.speed(point.b).map(|b| theory.resonance(b)))
        .collect()
}

/// `points` samples of the backbone by the scene's definition at equal steps of B, from `from` to `to`. `C` as in [`resonant`].
pub fn backbone(scene: &Dimensionless, from: f64, to: f64, points: usize) -> Vec<BackbonePoint> {
    let theory = Reading::of(scene);
    equally_spaced(from, to, points).map(|b| theory.resonance(b)).collect()
}

/// The backbone by the scene's definition where its sensor reads the amplitude `c`, on the right branch; None below the fold.
pub fn backbone_at_level(scene: &Dimensionless, c: f64) -> Option<BackbonePoint> {
    let theory = Reading::of(scene);
    theory.speed_at_level(c).map(|b| theory.resonance(b))
}

/// The detuning of the free decay at the amplitude `c` that the scene's sensor reads, on the right branch; None below the fold.
pub fn free_sigma(scene: &Dimensionless, c: f64) -> Option<f64> {
    let theory = Reading::of(scene);
    theory.speed_at_level(c).map(|b| theory.flow.free_detuning(b))
}

/// The amplitude that the scene's sensor reads over the amplitude of v, at the particle speed `b` and the detuning `sigma`.
pub fn reading(scene: &Dimensionless, b: f64, sigma: f64) -> f64 {
    Reading::of(scene).seen(b, sigma).norm()
}

/// Rounds of a fixed-point iteration.
const ROUNDS: usize = 12;
/// Largest distance of a peak from phase resonance of v, rad.
const ASIDE: f64 = 0.3;
/// Relative step of a difference quotient.
const STEP: f64 = 1e-5;

struct Reading<'a> {
    scene: &'a Dimensionless,
    flow: SlowFlow,
}

impl<'a> Reading<'a> {
    fn of(scene: &'a Dimensionless) -> Self {
        Self { scene, flow: SlowFlow::new(scene.lambda, scene.r) }
    }

    /// The harmonic that the sensor reads over the harmonic of v, at the particle speed `b` and the detuning `sigma`.
    fn seen(&self, b: f64, sigma: f64) -> Complex<f64> {
        let Dimensionless { epsilon, definition, .. } = *self.scene;
        if definition.sensor == Sensor::V {
            return Complex::new(1.0, 0.0);
        }
        // q1 = (v + epsilon w)/(1 + epsilon), and w is v with a triangle wave, whose first harmonic is (4/pi) B (eqs. 3 and 4).
        let manifold = &self.flow.manifold;
        let c = manifold.c(b);
        let triangle = Complex::new(1.0 - FRAC_PI_2 * b, manifold.dissipation * b) * (2.0 * FRAC_2_PI * b / (c * c));
        let q1 = (triangle * epsilon + 1.0 + epsilon) / (1.0 + epsilon);
        match definition.sensor {
            Sensor::Acceleration => q1 * (1.0 + epsilon * sigma).powi(2),
            _ => q1,
        }
    }

    /// Base amplitude and detuning at which v has the phase `gamma` at the particle speed `b` (eq. 12).
    fn driven(&self, b: f64, gamma: f64) -> [f64; 2] {
        let c = self.flow.manifold.c(b);
        let g = self.flow.loss(b) / (-c * gamma.sin());
        [g, self.flow.free_detuning(b) - g * gamma.cos() / (2.0 * c)]
    }

    /// The speed near `from` that is resonant under the scene's excitation, by the secant method.
    fn speed(&self, from: f64) -> Option<f64> {
        let excess = |b: f64| self.driven(b, self.phase(b))[0] - self.scene.g;
        let (mut last, mut b) = (from * (1.0 + 1e-4), from);
        let mut at_last = excess(last);
        for _ in 0..50 {
            let at = excess(b);
            if at.abs() < 1e-13 * self.scene.g {
                return Some(b);
            }
            if at == at_last {
                break;
            }
            let next = b - at * (b - last) / (at - at_last);
            (last, at_last, b) = (b, at, next);
        }
        (excess(b).abs() < 1e-10 * self.scene.g && (b - from).abs() < 0.3 * from).then_some(b)
    }

    /// The speed on the right branch at which the sensor reads the amplitude `c`.
    fn speed_at_level(&self, c: f64) -> Option<f64> {
        let mut amplitude = c;
        // Sensors differ from v by a factor of 1 + O(epsilon): each round gains as much.
        for _ in 0..ROUNDS {
            let b = self.flow.manifold.b(amplitude, BranchSide::Right)?;
            amplitude = c / self.seen(b, self.flow.free_detuning(b)).norm();
        }
        self.flow.manifold.b(amplitude, BranchSide::Right)
    }

    /// Phase of v, rad, at which the motion of the particle speed `b` is resonant.
    fn phase(&self, b: f64) -> f64 {
        let Dimensionless { epsilon, lambda, definition, .. } = *self.scene;
        match (definition.resonance, definition.sensor) {
            (Resonance::Phase, _) => {
                definition.reference.phase(epsilon * lambda, 1.0) - FRAC_PI_2 - self.seen(b, 0.0).arg()
            }
            // The amplitude is a function of B alone, which is extreme at phase resonance of v (eq. 15).
            (Resonance::Peak, Sensor::V | Sensor::Q1) => -FRAC_PI_2,
            (Resonance::Peak, Sensor::Acceleration) => self.aside(b) - FRAC_PI_2,
        }
    }

    /// Distance x of the peak of the acceleration from phase resonance of v, rad. The amplitude is `f(B) (1 + epsilon sigma)^2`, with
    /// `sigma = sigma_R - (L/2C) tan x`, and the excitation `L(B)/cos x`, with `L = loss/C`. Along a response the excitation is constant,
    /// and at the peak the amplitude is, too.
    fn aside(&self, b: f64) -> f64 {
        let epsilon = self.scene.epsilon;
        let c = self.flow.manifold.c(b);
        let mut tangent = 0.0_f64;
        for _ in 0..ROUNDS {
            let excitation = |b: f64| self.flow.loss(b) / self.flow.manifold.c(b);
            let sigma = |b: f64| self.flow.free_detuning(b) - excitation(b) * tangent / (2.0 * self.flow.manifold.c(b));
            let amplitude = |b: f64| (self.flow.manifold.c(b) * self.seen(b, sigma(b)).norm()).ln();
            let slope = |f: &dyn Fn(f64) -> f64| (f(b * (1.0 + STEP)) - f(b * (1.0 - STEP))) / (2.0 * STEP * b);
            let omega = 1.0 + epsilon * sigma(b);
            let ratio = -epsilon * slope(&excitation) / (c * omega * slope(&amplitude));
            tangent = ratio * (1.0 + tangent * tangent);
        }
        // At the fold, where B is no function of the amplitude, there is no peak.
        tangent.atan().clamp(-ASIDE, ASIDE)
    }

    fn resonance(&self, b: f64) -> BackbonePoint {
        let [g, sigma] = self.driven(b, self.phase(b));
        let point = self.flow.backbone_at(b);
        BackbonePoint { c: point.c * self.seen(b, sigma).norm(), sigma, g, ..point }
    }
}
