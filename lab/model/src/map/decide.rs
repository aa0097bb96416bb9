//! The regime of a simulated motion: recurrence of the period map, exact orbits, Lyapunov exponent.
//!
//! States are compared at half periods of the base, because a symmetric motion is its own mirror image half a period later. A motion
//! repeats if all states of a window at its end agree with those of one repetition before.

use std::f64::consts::PI;

use super::run::{Point, Run};
use crate::numerics::SIGNIFICANT;
use crate::orbit::{Periodic, periodic_near};
use crate::regime::Regime;

/// Differences of states (q1/b, q1'/(b omega0), ...) below which a motion may be on its way to a periodic one.
const NEAR: f64 = 1e-2;
/// Differences below which it repeats: far above rounding, far below what separates two motions.
const SAME: f64 = 1e-6;
/// Longest repetition in the search, half periods. The window is a third of that, and at least two repetitions.
const LONGEST: usize = 192;
/// Largest uncertainty of an exponent that is called zero, per period.
const ZERO: f64 = 2e-3;
/// Share of captured impacts from which a chaotic motion is called modulated.
const CAPTURES: f64 = 0.2;

impl Run {
    /// The regime, if the motion so far shows one that lasts: no impacts, or a stable periodic motion.
    pub(super) fn lasting(&mut self) -> Option<Point> {
        self.without_impacts().or_else(|| self.periodic())
    }

    /// The particle rests, and the primary mass cannot reach it: the free part of its motion only decays.
    fn without_impacts(&self) -> Option<Point> {
        let n = self.halves();
        let [q1, dq1, q2, dq2] = self.state(n);
        let reach = self.driven.reach(PI * n as f64, [q1, dq1]);
        (dq2 == 0.0 && reach + q2.abs() < 1.0).then(|| {
            let last = self.impacts.last().map_or(0.0, |impact| impact.time / PI);
            self.point(Regime::NoImpacts, (last.ceil() as usize).min(n - 1))
        })
    }

    /// The motion repeats and its exponent is negative. The multipliers of an exact orbit close by give the exponent before the motion
    /// has settled; without such an orbit (the particle sticks, or there are very many impacts), the linearised disturbance gives it.
    fn periodic(&mut self) -> Option<Point> {
        let n = self.halves();
        let (count, recurrence) = self.recurrence()?;
        let orbit = periodic_near(&self.scene, self.sigma, 0.0, self.state(n));
        let (regime, impacts, periods, exponent) = if let Some(orbit) = &orbit {
            let pattern = &orbit.pattern;
            let exponent = (orbit.exponent(), 0.0);
            (regime(orbit), pattern.impacts(), pattern.periods(), exponent)
        } else if recurrence < SAME {
            // A repetition of an odd number of half periods is followed by its mirror image.
            let whole = 1 + count % 2;
            let impacts = whole * (self.counts(n)[0] - self.counts(n - count)[0]);
            let exponent = self.exponent(n / 3);
            (Regime::Several, impacts, (whole * count / 2) as u32, exponent)
        } else {
            return None;
        };
        let stable = impacts > 0 && exponent.0 < 0.0;
        let begun = |half: &usize| self.distance(*half, count) > NEAR;
        stable.then(|| {
            let transient = (count..=n).rev().find(begun).unwrap_or(0);
            Point {
                transient: 0.5 * transient as f64,
                recurrence: Some(recurrence),
                exponent: Some(exponent.0),
                exponent_error: Some(exponent.1),
                impacts,
                periods,
                ..self.point(regime, transient.min(n - count))
            }
        })
    }

    /// Nothing repeats: the Lyapunov exponent decides, over all but the first third.
    pub(super) fn irregular(&mut self) -> Point {
        let n = self.halves();
        let (exponent, error) = self.exponent(n / 3);
        let periods = n as f64 / 3.0;
        // A disturbance that grows as its time, as on a torus, has this exponent.
        let linear = periods.ln() / periods;
        let zero = linear.max(SIGNIFICANT * error);
        let mut point = self.point(Regime::Undecided, n / 3);
        // With less than one impact per block of periods, the exponent is not measured: a particle that is almost at rest.
        let measured = point.impacts_per_period * periods > 2.0 * periods.sqrt();
        point.regime = match exponent {
            _ if !measured => Regime::Undecided,
            exponent if exponent > zero && point.synchrony < CAPTURES => Regime::Chaotic,
            exponent if exponent > zero => Regime::Modulated,
            exponent if exponent > -zero && zero < ZERO => Regime::QuasiPeriodic,
            _ => Regime::Undecided,
        };
        Point {
            exponent: Some(exponent),
            exponent_error: Some(error),
            ..point
        }
    }

    /// Shortest repetition, half periods, and the largest difference between the states of the window and those one repetition before.
    /// They do not grow from one half of the window to the other.
    fn recurrence(&self) -> Option<(usize, f64)> {
        let n = self.halves();
        // From the end: most motions that do not repeat are far off there.
        let largest = |count: usize, from: usize, to: usize| {
            (from..=to).rev().try_fold(0.0_f64, |largest, half| {
                let distance = self.distance(half, count);
                (distance < NEAR).then(|| largest.max(distance))
            })
        };
        (1..=LONGEST.min(n / 4)).find_map(|count| {
            let window = (2 * count).max(LONGEST / 3).min(n - count);
            let late = largest(count, n - window / 2, n)?;
            let early = largest(count, n - window, n - window / 2)?;
            (late <= early.max(SAME)).then_some((count, late))
        })
    }
}

/// The regime of an exact orbit.
fn regime(orbit: &Periodic) -> Regime {
    let pattern = &orbit.pattern;
    match (pattern.impacts(), pattern.periods(), pattern.mirrored) {
        (2, 1, true) => Regime::Symmetric,
        (2, 1, false) if pattern.walls[0] != pattern.walls[1] => Regime::Asymmetric,
        _ => Regime::Several,
    }
}
