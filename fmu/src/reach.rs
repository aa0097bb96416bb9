//! Limits of displacements: where the rounding error is as wide as the cavity, contacts cannot be found, and the search for them would
//! take seconds.

use lovines::{Drive, InvalidValue, Parameters, State};

/// Limit in half-widths: there the spacing of doubles is one half-width.
const RESOLUTION: f64 = 1.0 / f64::EPSILON;

/// The largest displacements and velocities allowed for a cavity.
#[derive(Clone, Copy, Default)]
pub(super) struct Reach {
    /// m.
    displacement: f64,
    /// m/s: it leads to that displacement at most.
    velocity: f64,
    /// Displacement of the cavity that a constant drive gives, m per unit: 1 for a base.
    per_drive: f64,
    /// The middle between the walls and half their distance, m.
    cavity: (f64, f64),
}

impl Reach {
    pub fn of(parameters: &Parameters, fastest: f64, per_drive: f64) -> Self {
        let displacement = parameters.half_width * RESOLUTION;
        let [plus, minus] = parameters.gaps();
        Self {
            // The position on a wall has a rounding error if the gaps differ.
            cavity: (0.5 * (plus - minus), 0.5 * (plus + minus) * (1.0 + 1e-12)),
            displacement,
            velocity: displacement * fastest,
            per_drive,
        }
    }

    /// Whether a state is within; one that is not a number is not.
    #[inline]
    pub fn holds(&self, state: &State) -> bool {
        state.q1.abs() <= self.displacement && state.dq1.abs() + state.dq2.abs() <= self.velocity
    }

    /// Whether the particle is in its cavity.
    #[inline]
    pub fn holds_particle(&self, w: f64) -> bool {
        (w - self.cavity.0).abs() <= self.cavity.1
    }

    /// Whether the base stays within for `span` seconds under `drive`.
    #[inline]
    pub fn holds_base(&self, drive: &Drive, span: f64) -> bool {
        let [u0, derivatives @ ..] = drive.signal;
        let moved = if derivatives == [0.0; 3] {
            0.0
        } else {
            let [u1, u2, u3] = derivatives.map(f64::abs);
            span * (u1 + span * (u2 + span * u3))
        };
        (u0.abs() + drive.amplitude.abs() + moved) * self.per_drive <= self.displacement
    }

    /// Refuses a start that is not within.
    pub fn check(&self, start: &State) -> Result<(), InvalidValue> {
        let (far, fast) = (self.displacement, self.velocity);
        let near = "at most 2^52 half-widths: beyond, the rounding of displacements is wider than the cavity";
        let slow = "a velocity that leads no further than 2^52 half-widths: beyond, the rounding of displacements is wider \
                    than the cavity";
        let name = "q1 (displacement of the primary mass)";
        InvalidValue::unless(start.q1.abs() <= far, name, start.q1, "m", near)?;
        let name = "der(q1) (velocity of the primary mass)";
        InvalidValue::unless(start.dq1.abs() <= fast, name, start.dq1, "m/s", slow)?;
        let name = "der(q2) (velocity of the particle)";
        InvalidValue::unless(start.dq2.abs() <= fast, name, start.dq2, "m/s", slow)
    }
}
