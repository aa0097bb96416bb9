//! Whether a candidate stays inside its cavity between impacts.

use std::f64::consts::{FRAC_PI_2, PI};

use nalgebra::Complex;

use super::{candidate::Candidate, oscillator::Oscillator};
use crate::Dimensionless;

/// Narrower intervals that are neither proven inside nor found outside count as grazing the wall.
const GRAZING: f64 = 1e-9;

/// Half a period of relative motion w, from the impact at w = +1 to the one at w = -1.
pub(super) struct Flight<'a> {
    candidate: &'a Candidate,
    oscillator: Oscillator,
    epsilon: f64,
    /// Speeds `|w'|` just after the first and just before the second impact.
    ends: [f64; 2],
    /// Bound of `|w''|`.
    curvature: f64,
}

impl<'a> Flight<'a> {
    pub(super) fn new(scene: &Dimensionless, candidate: &'a Candidate) -> Self {
        let Dimensionless { epsilon, r, .. } = *scene;
        let zeta = epsilon * scene.lambda / 2.0;
        let Candidate { omega, b, y, p, .. } = *candidate;
        let approach = 2.0 * b * (1.0 + epsilon) / (1.0 + r);
        // The free oscillator's p^2 + p'^2 never grows, which bounds p''.
        let impulse_response = p.norm() * (1.0 + 2.0 * zeta);
        Self {
            candidate,
            oscillator: Oscillator::new(zeta),
            epsilon,
            ends: [r * approach, approach],
            curvature: y.norm() * omega * omega + 2.0 * epsilon * b * impulse_response,
        }
    }

    /// w at the time `t` after the impact on the wall w = +1.
    fn w(&self, t: f64) -> f64 {
        let Candidate { omega, b, y, p, .. } = *self.candidate;
        let harmonic = (y * Complex::from_polar(1.0, omega * t)).im;
        let impulses = (self.oscillator.propagator(t) * p)[0];
        harmonic - 2.0 * self.epsilon * b * impulses - b * (t - FRAC_PI_2 / omega)
    }

    /// Whether `|w| <= 1`, proven from the bound of `|w''|`.
    pub(super) fn stays_inside(&self) -> bool {
        let duration = PI / self.candidate.omega;
        // w moves away from the walls at both ends, for at least these times.
        let [start, end] = self
            .ends
            .map(|speed| (speed / self.curvature).min(1.0 / speed).min(duration / 2.0));
        self.inside(start, duration - end)
    }

    fn inside(&self, from: f64, to: f64) -> bool {
        let width = to - from;
        if width <= 0.0 {
            return true;
        }
        let highest = self.w(from).abs().max(self.w(to).abs());
        if highest + self.curvature * width * width / 8.0 <= 1.0 {
            return true;
        }
        if highest > 1.0 || width < GRAZING {
            return false;
        }
        let middle = from + width / 2.0;
        self.inside(from, middle) && self.inside(middle, to)
    }
}
