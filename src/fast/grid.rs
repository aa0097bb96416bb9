//! Propagators over equal distances of time.
//!
//! Any instant within the grid is so near a point of it that a Taylor polynomial about that point gives the motion to rounding.
//! No sine and no exponential is left to compute, however irregular the contacts.

use super::coefficients::{Coefficients, POINTS};
use super::free_increment::FreeIncrement;
use super::propagator::Propagator;
use crate::oscillator::Oscillator;

/// The propagators over 1 to [`POINTS`] times the spacing, as far as they have been needed: of a regular motion, few are.
#[derive(Clone, Copy, Debug)]
pub(super) struct Grid([Propagator; POINTS]);

impl Default for Grid {
    fn default() -> Self {
        Self([Propagator::default(); POINTS])
    }
}

impl Grid {
    /// What the free motion adds over `n` times the spacing: what two shorter times add.
    fn free(&mut self, oscillator: &Oscillator, spacing: f64, n: usize) -> FreeIncrement {
        let t = n as f64 * spacing;
        if self.0[n - 1].t != t {
            let increment = if n == 1 {
                oscillator.increment(t)
            } else {
                let most = 1 << (n - 1).ilog2();
                let parts = [most, n - most].map(|n| self.free(oscillator, spacing, n));
                oscillator.composed(&parts[0], &parts[1])
            };
            self.0[n - 1].set(t, oscillator.split(&increment));
        }
        // The same bits whether it has just been computed or not.
        FreeIncrement::from(&self.0[n - 1].free)
    }

    /// What the free motion adds over `t` seconds: over the nearest point, if there is one, and the rest.
    pub fn increment(&mut self, oscillator: &Oscillator, spacing: f64, t: f64) -> FreeIncrement {
        match (t / spacing + 0.5) as usize {
            n @ 1..=POINTS => {
                let rest = oscillator.increment(t - n as f64 * spacing);
                oscillator.composed(&self.free(oscillator, spacing, n), &rest)
            }
            _ => oscillator.increment(t),
        }
    }

    #[inline(never)]
    fn fill(&mut self, oscillator: &Oscillator, coefficients: &Coefficients, n: usize) {
        self.free(oscillator, coefficients.spacing, n);
        self.0[n - 1].respond(oscillator, coefficients);
    }

    /// The propagator over `n` times the spacing, n from 1 to [`POINTS`].
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    pub fn over(&mut self, oscillator: &Oscillator, coefficients: &Coefficients, n: usize) -> &Propagator {
        let propagator = &self.0[(n - 1) % POINTS];
        if propagator.t != n as f64 * coefficients.spacing || propagator.omega != coefficients.omega {
            self.fill(oscillator, coefficients, n);
        }
        &self.0[(n - 1) % POINTS]
    }
}
