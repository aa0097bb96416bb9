//! Measured points of a backbone.

use std::f64::consts::FRAC_PI_2;

use vines_model::Definition;
use vines_model::numerics::Estimate;
use vines_scene::scene::{Unit, Units};

/// A measured point of the backbone: of phase resonance, or at another phase target.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeasuredPoint {
    /// Amplitude of the fundamental of the response, metres of the oscillator.
    pub response: Estimate,
    /// Angular frequency, rad/s.
    pub omega: Estimate,
    /// Amplitude of the base, metres of the oscillator.
    pub drive: Estimate,
    /// Phase of the response relative to the base at which it was measured, rad.
    pub phase: f64,
}

impl MeasuredPoint {
    /// This point with response and drive, which are in these units, in metres of the oscillator.
    #[must_use]
    pub fn in_metres(self, units: &Units) -> Self {
        let converted = |unit: Unit, Estimate { value, uncertainty }| Estimate {
            value: unit.in_metres(value),
            uncertainty: unit.in_metres(uncertainty),
        };
        Self {
            response: converted(units.response, self.response),
            drive: converted(units.reference, self.drive),
            ..self
        }
    }

    /// The point of phase resonance with this response, to first order: `E_R = E cos p` and `omega_R = omega + (omega/2) (E/A) sin p` for a phase of p
    /// beyond phase resonance.
    pub(crate) fn at_resonance(&self, definition: Definition) -> Self {
        let (sine, cosine) = definition.at_phase(self.phase).off_resonance().sin_cos();
        let turned = 0.5 * sine * self.drive.value / self.response.value * self.omega.value;
        let omega = Estimate { value: self.omega.value + turned, ..self.omega };
        Self {
            omega,
            drive: self.drive.scaled(cosine),
            phase: -FRAC_PI_2,
            ..*self
        }
    }
}
