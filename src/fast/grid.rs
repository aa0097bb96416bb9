//! Propagators over equal distances of time, up to one stretch of a march.
//!
//! Any instant of a stretch is so near a point of the grid that a Taylor polynomial about that point gives the motion to rounding.
//! No sine and no exponential is left to compute, however irregular the contacts.

use super::FastPath;
use super::coefficients::{Coefficients, TERMS};
use super::propagator::{Increment, Nearby, Point, Propagator};
use super::start::Start;
use super::verify::Sample;
use crate::oscillator::Oscillator;

/// Points of the grid. Half their distance is 0.047 of the fastest rate's time; terms of degree 10 are then below 1e-19.
pub(super) const POINTS: usize = 24;
/// Farthest distance of an instant from its point, in distances between points.
const REACH: f64 = 0.75;
/// Up to here after a mark it serves as its own point.
const ITSELF: f64 = 0.7;

/// The propagators over 1 to [`POINTS`] times the spacing.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Grid {
    /// The key, s; 0 before the first use.
    spacing: f64,
    propagators: [Propagator; POINTS],
}

impl Grid {
    #[inline(never)]
    fn build(&mut self, oscillator: &Oscillator, spacing: f64) {
        self.spacing = spacing;
        let free = oscillator.exact_increments::<POINTS>(spacing);
        self.propagators = core::array::from_fn(|n| Propagator::new((n + 1) as f64 * spacing, free[n]));
    }

    /// The propagator over `n` times the spacing, n from 1 on.
    #[inline(always)]
    fn over(&mut self, oscillator: &Oscillator, coefficients: &Coefficients, n: usize) -> &Propagator {
        if self.spacing != coefficients.spacing {
            self.build(oscillator, coefficients.spacing);
        }
        let propagator = &mut self.propagators[(n - 1) % POINTS];
        propagator.prepare(oscillator, coefficients);
        propagator
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

/// The motion near a point of the grid.
pub(super) struct NearPoint {
    /// Time of that point since the start of the flight, s.
    pub t: f64,
    /// The same since the mark.
    pub since: f64,
    /// What has been added to the mark until then.
    pub increment: Increment,
    pub nearby: Nearby<TERMS>,
    /// Farthest distance, s.
    pub reach: f64,
}

impl FastPath {
    /// The motion near the time `t`, at most a stretch after a mark.
    #[inline(always)]
    pub(super) fn near_point(&mut self, start: &Start, from: &Mark, t: f64) -> NearPoint {
        self.evaluations += 1;
        let (coefficients, amplitude) = (&self.coefficients, start.base.drive.amplitude);
        // The nearest point, but near the mark the mark itself: it needs no propagator.
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
        let since = n as f64 * coefficients.spacing;
        NearPoint {
            t: from.t + since,
            since,
            increment,
            nearby: Nearby::new(coefficients, amplitude, &from.point, &increment),
            reach: REACH * coefficients.spacing,
        }
    }

    /// What the motion adds in `t` seconds after the start.
    pub(super) fn after(&mut self, start: &Start, t: f64) -> Increment {
        let mut mark = Mark { t: 0.0, point: start.point, sample: start.sample };
        while t - mark.t > self.coefficients.stretch {
            mark = self.mark(start, &mark, POINTS);
        }
        let near = self.near_point(start, &mark, t);
        let Increment { y, dy, phasor } = near.nearby.at(t - near.t);
        Increment {
            y: (mark.point.y - start.point.y) + y,
            dy: (mark.point.dy - start.point.dy) + dy,
            phasor,
        }
    }

    /// The motion `n` points after a mark.
    #[inline(always)]
    pub(super) fn mark(&mut self, start: &Start, from: &Mark, n: usize) -> Mark {
        self.evaluations += 1;
        self.rotations += 1;
        let propagator = (self.cache.grid).over(&start.rig.alone, &self.coefficients, n);
        let point = propagator.point(start.base.drive.amplitude, &from.point);
        let t = from.t + propagator.t;
        Mark {
            t,
            point,
            sample: start.sample(&self.coefficients, &point, t),
        }
    }
}
