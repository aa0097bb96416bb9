//! Resonance by the scene's definition: the first-order motion read by a sensor, its phase relative to a reference, or its peak.
//!
//! Sensor and reference change phase and amplitude by terms of first order in epsilon, which is also the order of the theory's own error
//! (`vines orbit --definitions`).

use std::f64::consts::{FRAC_2_PI, FRAC_PI_2};

use nalgebra::Complex;

use super::{backbone::BackbonePoint, manifold::BranchSide, slow_flow::SlowFlow};
use crate::numerics::golden_section;
use crate::{Dimensionless, Resonance, Sensor};

/// All solutions of first-order theory that are resonant by the scene's definition, at its G, by increasing B. `C` is the amplitude that
/// the sensor reads.
#[must_use]
pub fn resonant(scene: &Dimensionless) -> Vec<BackbonePoint> {
    let theory = Reading { scene, flow: SlowFlow::new(scene.lambda, scene.r) };
    let points = theory.flow.phase_resonant(scene.g).into_iter();
    points
        .filter_map(|point| match scene.definition.resonance {
            Resonance::Phase => theory.at_phase(&point),
            Resonance::Peak => theory.at_peak(&point),
        })
        .collect()
}

/// The detuning of the free decay at the amplitude `c` that the scene's sensor reads, on the right branch; None below the fold.
#[must_use]
pub fn free_sigma(scene: &Dimensionless, c: f64) -> Option<f64> {
    let theory = Reading { scene, flow: SlowFlow::new(scene.lambda, scene.r) };
    let mut amplitude = c;
    // Sensors differ from v by a factor of 1 + O(epsilon): each round gains as much.
    for _ in 0..ROUNDS {
        let b = theory.flow.manifold.b(amplitude, BranchSide::Right)?;
        amplitude = c / theory.seen(b, theory.flow.free_detuning(b)).norm();
    }
    theory.flow.backbone_sigma(amplitude, BranchSide::Right)
}

/// Rounds of a fixed-point iteration.
const ROUNDS: usize = 12;
/// Phases beside phase resonance at which a peak is searched for, rad.
const ASIDE: f64 = 0.3;

struct Reading<'a> {
    scene: &'a Dimensionless,
    flow: SlowFlow,
}

impl Reading<'_> {
    /// The harmonic that the sensor reads over that of v, at the particle speed `b` and the detuning `sigma`.
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

    /// The speed near `from` at which the excitation for the phase `gamma(b)` is that of the scene, by the secant method.
    fn speed(&self, from: f64, gamma: impl Fn(f64) -> f64) -> Option<f64> {
        let excess = |b: f64| self.driven(b, gamma(b))[0] - self.scene.g;
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

    fn at_phase(&self, point: &BackbonePoint) -> Option<BackbonePoint> {
        let Dimensionless { epsilon, lambda, definition, .. } = *self.scene;
        let reference = definition.reference.phase(epsilon * lambda, 1.0);
        let gamma = |b: f64| -FRAC_PI_2 + reference - self.seen(b, 0.0).arg();
        let b = self.speed(point.b, gamma)?;
        Some(self.point(b, gamma(b)))
    }

    fn at_peak(&self, point: &BackbonePoint) -> Option<BackbonePoint> {
        if self.scene.definition.sensor != Sensor::Acceleration {
            // The amplitude is a function of B alone, which is extreme at phase resonance of v (eq. 15).
            return Some(self.point(point.b, -FRAC_PI_2));
        }
        let speed = |aside: f64| self.speed(point.b, |_| -FRAC_PI_2 + aside);
        let smallness = |aside: f64| speed(aside).map_or(0.0, |b| -self.point(b, -FRAC_PI_2 + aside).c);
        let aside = golden_section(-ASIDE, ASIDE, smallness);
        Some(self.point(speed(aside)?, -FRAC_PI_2 + aside))
    }

    fn point(&self, b: f64, gamma: f64) -> BackbonePoint {
        let [g, sigma] = self.driven(b, gamma);
        let point = self.flow.backbone_at(b);
        BackbonePoint { c: point.c * self.seen(b, sigma).norm(), sigma, g, ..point }
    }
}
