//! What first-order theory knows of the backbone about a point.

use nalgebra::Complex;
use vines_model::Dimensionless;
use vines_model::theory::{SlowFlow, backbone_at_level};

/// What is known of the backbone about a point in advance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Slopes {
    /// Slope of the drive `E_R` over the amplitude, dimensionless: value and standard uncertainty.
    pub base: [f64; 2],
    /// The same of the frequency `omega_R`, rad/(s m).
    pub omega: [f64; 2],
    /// Changes of `E_R` and `omega_R` per rate of change of the amplitude, because the impacts follow it late: s and rad/m.
    pub drift: [f64; 2],
    /// Relative uncertainty of these.
    pub late: f64,
    /// Phase error that is held, rad, and the relative change of `E_R` per rad beyond it, with the opposite sign.
    pub phase: [f64; 2],
    /// Second derivatives of `E_R`, 1/m, and `omega_R`, rad/(s m²), over the amplitude; 0 where they are not known.
    pub curvature: [f64; 2],
    /// Second derivatives of `drift` over the amplitude: s/m² and rad/m³.
    pub bending: [f64; 2],
}

/// Relative standard uncertainty of the slopes of a rig whose parameters are known as well as they are measured.
const SLOPE: f64 = 0.05;
/// Relative uncertainty of the effect of a drift of the amplitude.
pub const LATE: f64 = 0.15;

impl Slopes {
    /// About the amplitude `c`, for the phase error `held`, rad.
    #[must_use]
    pub fn by_theory(d: &Dimensionless, c: f64, held: f64) -> Self {
        let step = 1e-3 * c;
        let at = |c: f64| backbone_at_level(d, c).map(|point| [point.g, point.sigma]);
        let around = at(c - step).zip(at(c)).zip(at(c + step));
        let flow = SlowFlow::new(d.lambda, d.r);
        let late = |c: f64| flow.drift(c).map(|drift| [drift.g, drift.sigma]);
        let known = around.zip(late(c - step).zip(late(c)).zip(late(c + step)));
        let bent = |low: [f64; 2], middle: [f64; 2], high: [f64; 2]| {
            [0, 1].map(|i| (low[i] - 2.0 * middle[i] + high[i]) / (step * step))
        };
        let ([g, sigma], bend, drift, bending) = match known {
            Some((((low, middle), high), ((earlier, drift), later))) => (
                [0, 1].map(|i| (high[i] - low[i]) / (2.0 * step)),
                bent(low, middle, high),
                drift,
                bent(earlier, drift, later),
            ),
            None => ([d.lambda, 0.0], [0.0; 2], [0.0; 2], [0.0; 2]),
        };
        let of_drift = |[g, sigma]: [f64; 2]| [g * d.epsilon / d.omega0, sigma * d.epsilon / d.b];
        // Terms of the second order change the drive by about epsilon lambda sigma.
        let second = d.epsilon * d.lambda * (2.0 + sigma.abs());
        let base = [g, SLOPE * g.abs() + second];
        let omega = [sigma, SLOPE * sigma.abs() + d.epsilon];
        Self {
            base: base.map(|g| d.amplitude(g) / d.b),
            omega: omega.map(|sigma| d.omega_change(sigma) / d.b),
            late: LATE,
            // The damper's force on the base leads it by 2 zeta.
            phase: [held, d.epsilon * d.lambda],
            drift: of_drift(drift),
            bending: of_drift(bending).map(|bend| bend / (d.b * d.b)),
            curvature: [d.amplitude(bend[0]), d.omega_change(bend[1])].map(|bend| bend / (d.b * d.b)),
        }
    }

    /// The part of a drive, or of its integral, that a phase beyond the one that is held adds to the balance of the amplitude.
    pub(super) fn beyond(&self, drive: Complex<f64>) -> f64 {
        let [held, by_phase] = self.phase;
        by_phase * (drive * Complex::from_polar(1.0, -held)).im
    }
}
