//! The flight of the particle between two impacts, and the first contact that ends it.
//!
//! The contact is found by steps that a bound of `|w''|` proves free of contact. They become Newton steps near the wall, so no
//! contact is missed and the last is accurate to the last bits.

use nalgebra::{Matrix2, Vector2};

use super::bounce::{Bounce, State};
use super::forced_oscillator::ForcedOscillator;

/// A contact slower than this is a graze, where the map has no derivative.
const GRAZING: f64 = 1e-9;
/// Longest flight, periods.
const LONGEST: f64 = 64.0;
/// Most steps of a flight: far more than any flight needs, except in chatter.
const STEPS: usize = 4000;

pub(super) struct ParticleFlight<'a> {
    oscillator: &'a ForcedOscillator,
    /// Where it begins: phase of the base, particle, and relative displacement and velocity.
    pub(super) phase: f64,
    q2: f64,
    pub(super) dq2: f64,
    w: f64,
    dw: f64,
    /// State of the free part of the oscillator's motion at the start.
    free: Vector2<f64>,
    /// Bound of `|w''|`.
    curvature: f64,
}

impl<'a> ParticleFlight<'a> {
    /// The flight after a bounce.
    pub(super) fn new(oscillator: &'a ForcedOscillator, from: &Bounce) -> Self {
        let state = [from.q1, from.dq1, from.q2(), from.dq2];
        Self::between(oscillator, from.phase, state, from.wall)
    }

    /// The flight from a state with the relative displacement `w`.
    pub(super) fn between(oscillator: &'a ForcedOscillator, phase: f64, [q1, dq1, q2, dq2]: State, w: f64) -> Self {
        let free = Vector2::new(q1, dq1) - oscillator.harmonic(phase);
        // Of the free motion q^2 + q'^2 never grows.
        Self {
            oscillator,
            phase,
            q2,
            dq2,
            w,
            dw: dq1 - dq2,
            free,
            curvature: oscillator.acceleration() + free.norm() * (1.0 + 2.0 * oscillator.zeta),
        }
    }

    /// (q1, q1') at the time `t`.
    pub(super) fn primary(&self, t: f64) -> Vector2<f64> {
        let propagator: Matrix2<f64> = self.oscillator.free.propagator(t);
        propagator * self.free + self.oscillator.harmonic(self.phase + self.oscillator.omega * t)
    }

    /// Time and wall of the first contact.
    pub(super) fn contact(&self) -> Option<(f64, f64)> {
        let horizon = LONGEST * std::f64::consts::TAU / self.oscillator.omega;
        let k = self.curvature;
        if !k.is_finite() || k <= 0.0 {
            return None;
        }
        // Time before which the wall at the distance `gap`, approached at `speed`, cannot be reached.
        let free_for = |gap: f64, speed: f64| {
            let root = (speed * speed + 2.0 * k * gap).sqrt();
            if speed > 0.0 {
                2.0 * gap / (speed + root)
            } else {
                (root - speed) / k
            }
        };
        let (mut t, mut w, mut dw) = (0.0, self.w, self.dw);
        if w.abs() >= 1.0 && w * dw >= 0.0 {
            return None;
        }
        for _ in 0..STEPS {
            let step = free_for(1.0 - w, dw).min(free_for(1.0 + w, -dw));
            t += step;
            if t > horizon {
                return None;
            }
            let primary = self.primary(t);
            w = primary[0] - self.q2 - self.dq2 * t;
            dw = primary[1] - self.dq2;
            let side = dw.signum();
            let gap = 1.0 - side * w;
            if gap <= 1e-15 || step <= 1e-16 * (1.0 + t) {
                let fast = dw.abs() > GRAZING;
                // A wall is reached in its own direction; the step over the remaining gap corrects the rounding.
                return fast.then(|| (t + gap / dw.abs(), side));
            }
            // Rounding may place w just beyond the wall behind.
            w = w.clamp(-1.0, 1.0);
        }
        None
    }
}
