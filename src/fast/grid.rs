//! Propagators over equal distances of time.
//!
//! Any instant within the grid is so near a point of it that a Taylor polynomial about that point gives the motion to rounding.
//! No sine and no exponential is left to compute, however irregular the contacts.

use super::FastPath;
use super::coefficients::{Coefficients, TERMS};
use super::propagator::{Increment, Nearby, Point, Propagator};
use super::verify::{Sample, Start};
use crate::oscillator::{self, Oscillator};

/// Points of the grid: its span is a little more than half a period of the fastest rate.
pub(super) const POINTS: usize = 36;
/// Points in a stretch of a march.
pub(super) const STRETCH: usize = 24;
/// Up to here after a mark, in distances between points, it serves as its own point.
const ITSELF: f64 = 0.65;

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
    fn free(&mut self, oscillator: &Oscillator, spacing: f64, n: usize) -> oscillator::Increment {
        let t = n as f64 * spacing;
        if self.0[n - 1].t != t {
            let increment = if n == 1 {
                oscillator.increment(t)
            } else {
                let most = 1 << (n - 1).ilog2();
                let parts = [most, n - most].map(|n| self.free(oscillator, spacing, n));
                oscillator.both(&parts[0], &parts[1])
            };
            self.0[n - 1].set(t, oscillator.split(&increment));
        }
        // The same bits whether it has just been computed or not.
        oscillator::Increment::from(&self.0[n - 1].free)
    }

    /// What the free motion adds over `t` seconds: over the nearest point, if there is one, and the rest.
    pub fn increment(&mut self, oscillator: &Oscillator, spacing: f64, t: f64) -> oscillator::Increment {
        match (t / spacing + 0.5) as usize {
            n @ 1..=POINTS => {
                let rest = oscillator.increment(t - n as f64 * spacing);
                oscillator.both(&self.free(oscillator, spacing, n), &rest)
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
    fn over(&mut self, oscillator: &Oscillator, coefficients: &Coefficients, n: usize) -> &Propagator {
        let propagator = &self.0[(n - 1) % POINTS];
        if propagator.t != n as f64 * coefficients.spacing || propagator.omega != coefficients.omega {
            self.fill(oscillator, coefficients, n);
        }
        &self.0[(n - 1) % POINTS]
    }
}

/// An instant of a flight at which the motion is known.
#[derive(Clone, Copy)]
pub(super) struct Mark {
    /// Time since the start of the flight, s: an exact multiple of the spacing.
    pub t: f64,
    pub point: Point,
    pub sample: Sample,
}

impl FastPath {
    /// The time of a point of the grid after a mark, and the motion near it: the point is the nearest one to the time `t`.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    pub(super) fn near_point(&mut self, start: &Start, from: &Mark, t: f64) -> (f64, Nearby<TERMS>) {
        self.evaluations += 1;
        let (coefficients, amplitude) = (&self.coefficients, start.base.drive.amplitude);
        // Near the mark the mark itself: it needs no propagator.
        let n = match (t - from.t) / coefficients.spacing {
            part if part < ITSELF => 0,
            part => ((part + 0.5) as usize).min(POINTS),
        };
        let increment = match n {
            0 => Increment { y: 0.0, dy: 0.0, phasor: from.point.phasor },
            _ => (self.cache.grid)
                .over(&start.rig.alone, coefficients, n)
                .increment(amplitude, &from.point),
        };
        (
            from.t + n as f64 * coefficients.spacing,
            Nearby::new(coefficients, amplitude, &from.point, &increment),
        )
    }

    /// What the motion adds in `t` seconds after the start.
    pub(super) fn after(&mut self, start: &Start, t: f64) -> Increment {
        let here = start.here.point;
        let mut mark = start.here;
        while t - mark.t > self.coefficients.span {
            mark = self.mark(start, &mark, POINTS);
        }
        let (at, nearby) = self.near_point(start, &mark, t);
        let Increment { y, dy, phasor } = nearby.at(t - at);
        Increment {
            y: (mark.point.y - here.y) + y,
            dy: (mark.point.dy - here.dy) + dy,
            phasor,
        }
    }

    /// The motion `n` points after a mark.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    pub(super) fn mark(&mut self, start: &Start, from: &Mark, n: usize) -> Mark {
        self.evaluations += 1;
        self.rotations += 1;
        let propagator = (self.cache.grid).over(&start.rig.alone, &self.coefficients, n);
        let increment = propagator.increment(start.base.drive.amplitude, &from.point);
        let t = from.t + propagator.t;
        start.mark(&self.coefficients, increment.to(&from.point), t)
    }
}
