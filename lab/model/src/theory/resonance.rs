//! Resonance by the scene's definition: the first-order motion read by a sensor, and its phase relative to a reference.
//!
//! Sensor and reference change phase and amplitude by terms of first order in epsilon, which is also the order of the theory's own error
//! (validation/convergence.csv).

use std::f64::consts::{FRAC_2_PI, FRAC_PI_2};

use nalgebra::Complex;

use super::slow_flow::{BackbonePoint, BranchSide, SlowFlow};
use crate::numerics::{MOST_STEPS, equally_spaced, secant};
use crate::{Dimensionless, Sensor};

/// All solutions of first-order theory that are resonant by the scene's definition, at its G, by increasing B. `C` is the amplitude that
/// the sensor reads.
pub fn resonant(scene: &Dimensionless) -> Vec<BackbonePoint> {
    let theory = Reading::of(scene);
    // By v and the base, the speeds are the roots of a quartic: near them, those of sensor and reference.
    let speeds = theory
        .flow
        .equilibrium_speeds(scene.g * scene.definition.off_resonance().cos(), None);
    speeds
        .into_iter()
        .filter_map(|b| theory.speed(b).map(|b| theory.resonance(b)))
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

/// The amplitude that the scene's sensor reads over the amplitude of v, at the particle speed `b`.
pub fn reading(scene: &Dimensionless, b: f64) -> f64 {
    Reading::of(scene).seen(b).norm()
}

struct Reading<'a> {
    scene: &'a Dimensionless,
    flow: SlowFlow,
}

impl<'a> Reading<'a> {
    fn of(scene: &'a Dimensionless) -> Self {
        Self { scene, flow: SlowFlow::new(scene.lambda, scene.r) }
    }

    /// The harmonic that the sensor reads over the harmonic of v, at the particle speed `b`.
    fn seen(&self, b: f64) -> Complex<f64> {
        let Dimensionless { epsilon, definition, .. } = *self.scene;
        if definition.sensor == Sensor::V {
            return Complex::new(1.0, 0.0);
        }
        // q1 = (v + epsilon w)/(1 + epsilon), and w is v with a triangle wave, whose first harmonic is (4/pi) B (eqs. 3 and 4).
        let manifold = &self.flow.manifold;
        let c = manifold.c(b);
        let triangle = Complex::new(1.0 - FRAC_PI_2 * b, manifold.dissipation * b) * (2.0 * FRAC_2_PI * b / (c * c));
        (triangle * epsilon + 1.0 + epsilon) / (1.0 + epsilon)
    }

    /// Base amplitude and detuning at which v has the phase `gamma` at the particle speed `b` (eq. 12).
    fn driven(&self, b: f64, gamma: f64) -> [f64; 2] {
        let c = self.flow.manifold.c(b);
        let g = self.flow.loss(b) / (-c * gamma.sin());
        [g, self.flow.free_detuning(b) - g * gamma.cos() / (2.0 * c)]
    }

    /// The speed near `from` that is resonant under the scene's excitation.
    fn speed(&self, from: f64) -> Option<f64> {
        let excess = |b: f64| self.driven(b, self.phase(b))[0] - self.scene.g;
        let b = secant(|b| Some(excess(b)), [from * (1.0 + 1e-4), from], 1e-12 * from)?;
        ((b - from).abs() < 0.3 * from).then_some(b)
    }

    /// The speed on the right branch at which the sensor reads the amplitude `c`.
    fn speed_at_level(&self, c: f64) -> Option<f64> {
        let mut amplitude = c;
        // Sensors differ from v by a factor of 1 + O(epsilon): each round gains as much, and near the fold less.
        for _ in 0..MOST_STEPS {
            let b = self.flow.manifold.b(amplitude, BranchSide::Right)?;
            amplitude = c / self.seen(b).norm();
        }
        self.flow.manifold.b(amplitude, BranchSide::Right)
    }

    /// Phase of v, rad, at which the motion of the particle speed `b` is resonant.
    fn phase(&self, b: f64) -> f64 {
        let Dimensionless { epsilon, lambda, definition, .. } = *self.scene;
        definition.reference.phase(epsilon * lambda, 1.0) + definition.phase - self.seen(b).arg()
    }

    fn resonance(&self, b: f64) -> BackbonePoint {
        let [g, sigma] = self.driven(b, self.phase(b));
        let point = self.flow.backbone_at(b);
        BackbonePoint { c: point.c * self.seen(b).norm(), sigma, g, ..point }
    }
}
