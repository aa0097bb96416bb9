//! Frequency responses: all equilibria at one excitation, as closed curves.
//!
//! The two detunings at which a particle speed B occurs have a closed form, so B parametrises each curve. Its turning points are at
//! `loss = G C`, the points of the backbone.

use std::f64::consts::{PI, TAU};

use serde::Serialize;

use super::{equilibrium::Equilibrium, slow_flow::SlowFlow};

/// One point of a frequency response.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ResponsePoint {
    /// Detuning.
    pub sigma: f64,
    /// The steady motion there.
    #[serde(flatten)]
    pub motion: Equilibrium,
}

impl SlowFlow {
    /// The detunings at which the excitation `g` holds the particle speed `b`, and the phase of v there, rad:
    /// `sigma = sigma_R ± sqrt(G^2 C^2 - loss^2)/(2 C^2)` (docs/theory.md, eq. 15); None if `g` is too small.
    pub fn detunings(&self, g: f64, b: f64) -> Option<[(f64, f64); 2]> {
        let c = self.manifold.c(b);
        let loss = self.loss(b);
        let square = (g * c - loss) * (g * c + loss);
        (square >= 0.0).then(|| {
            let spring = square.sqrt();
            let shift = spring / (2.0 * c * c);
            let free = self.free_detuning(b);
            [
                (free - shift, (-loss).atan2(spring)),
                (free + shift, (-loss).atan2(-spring)),
            ]
        })
    }

    /// The frequency responses at the excitation `g`: closed curves over all B > 0, each of `points` points from its
    /// smallest C on one side to its largest and back. A curve that reaches B = 0 starts there, at C = 1.
    pub fn frequency_responses(&self, g: f64, points: usize) -> Vec<Vec<ResponsePoint>> {
        let mut ends: Vec<f64> = self.equilibrium_speeds(g, None);
        // At B = 0 the loss is lambda and C is 1.
        if g > self.lambda {
            ends.insert(0, 0.0);
        }
        ends.chunks_exact(2)
            .map(|pair| self.loop_between(g, [pair[0], pair[1]], points))
            .collect()
    }

    /// The loop of a response between the two speeds at which it turns.
    fn loop_between(&self, g: f64, [low, high]: [f64; 2], points: usize) -> Vec<ResponsePoint> {
        let steps = points.saturating_sub(1).max(1) as f64;
        (0..points)
            .filter_map(|n| {
                let turn = TAU * n as f64 / steps;
                let b = low + (high - low) * 0.5 * (1.0 - turn.cos());
                let b = b.clamp(low, high).max(1e-9);
                // Rounding may make the square root imaginary at the ends, which are phase-resonant.
                let [left, right] = self
                    .detunings(g, b)
                    .unwrap_or_else(|| [(self.free_detuning(b), -PI / 2.0); 2]);
                let (sigma, gamma) = if turn < PI { left } else { right };
                let motion = self.equilibrium(g, b, gamma);
                sigma.is_finite().then_some(ResponsePoint { sigma, motion })
            })
            .collect()
    }
}
