//! The rules that decide the regime of a simulated motion.

use std::f64::consts::PI;

use super::run::{Point, Run};
use crate::numerics::{mean, standard_deviation};
use crate::orbit::{Periodic, Symmetric, alternates, periodic_near};
use crate::regime::{Impact, Regime, synchrony};

/// Longest repetition in the search, half periods of the base.
const LONGEST: usize = 192;
/// Smallest number of half periods over which a motion repeats itself.
pub(super) const REPEATED: usize = 64;
/// Among so many of the last impacts, the strongest is looked for in the past, and those that are at least this part as strong; another
/// one is similar within this velocity over b omega0, and as close to its wall over b at the time of that one.
const RECENT: usize = 8;
const STRONG: f64 = 0.5;
/// Largest number of repetitions that are tried: a slow modulation has very many that are nearly right.
const CANDIDATES: usize = 32;
const SIMILAR: f64 = 0.05;
/// Largest difference of states that repeat: far above rounding, far below what separates two motions.
const SAME: f64 = 1e-6;
/// Below this, differences need not shrink: they are rounding errors, or what is left out of a chatter that ends.
const ROUNDING: f64 = 1e-8;
/// Differences below which a stable periodic motion is searched for.
const SETTLING: f64 = 1e-2;
/// The same for a decision before the limit that another motion than a 1:1 one is periodic: chaos stays close to one for a while.
const SEVERAL: f64 = 5e-4;
/// Slowest approach to it, per period, that decides before the limit: a slower one is close to a bifurcation.
const SLOW: f64 = 0.004;
/// A motion that approaches the symmetric orbit is decided before the limit if its distance will be below this at the limit.
const SETTLED: f64 = 5e-3;
/// A transient ends where the state is this close to that one repetition before.
const TRANSIENT: f64 = 1e-2;
/// Share of a motion without repetition that is left out of the averages, and number of blocks that the rest is cut into.
const LEFT_OUT: f64 = 0.25;
const BLOCKS: usize = 32;
/// Standard errors by which a Lyapunov exponent differs from zero.
const SIGNIFICANT: f64 = 4.0;
/// Largest uncertainty of an exponent that is zero, per period.
const ZERO: f64 = 2e-3;
/// From this share of captured impacts on a chaotic motion is called modulated.
const CAPTURES: f64 = 0.2;

impl Run {
    /// What is common to all regimes, over the half periods from `from` on.
    fn point(&self, regime: Regime, from: usize) -> Point {
        let periods = 0.5 * (self.halves() - from) as f64;
        let [[before, rested], [all, rests]] = [self.counts(from), self.counts(self.halves())];
        Point {
            regime,
            followed: self.halves() / 2,
            transient: 0.5 * from as f64,
            recurrence: None,
            exponent: None,
            exponent_error: None,
            synchrony: synchrony(&self.impacts[before..]),
            impacts_per_period: (all - before) as f64 / periods,
            impacts: 0,
            periods: 0,
            sticks_per_period: (rests - rested) as f64 / periods,
            state: self.state(self.halves()),
        }
    }

    /// The particle rests, and the primary mass cannot reach it: the free part of its motion only decays.
    pub(super) fn without_impacts(&self) -> Option<Point> {
        let n = self.halves();
        let [q1, dq1, q2, dq2] = self.state(n);
        let reach = self.driven.reach(PI * n as f64, [q1, dq1]);
        (dq2 == 0.0 && reach + q2.abs() < 1.0).then(|| {
            let last = self.impacts.last().map_or(0.0, |one| one.time / PI);
            self.point(Regime::NoImpacts, (last.ceil() as usize).min(n - 1))
        })
    }

    /// Distance between the state at half period `n` and that `count` half periods earlier, or its mirror image.
    fn distance(&self, n: usize, count: usize) -> f64 {
        let sign = if count % 2 == 1 { -1.0 } else { 1.0 };
        let (now, then) = (self.state(n), self.state(n - count));
        let apart = now.iter().zip(then).map(|(a, b)| (sign * a - b).abs());
        // Nothing is near what cannot be computed: the steady response at an undamped resonance.
        apart.fold(0.0, |most, one| if one <= most { most } else { one })
    }

    /// The largest differences between states and those `count` half periods before, in the first and the second half of the last
    /// repetitions; None unless all are below `bound`.
    fn differences(&self, count: usize, bound: f64) -> Option<[f64; 2]> {
        let n = self.halves();
        let span = (2 * count).max(REPEATED).min(n - count);
        // From the ends: most motions that do not repeat themselves are far off there.
        let close = |one: &usize| Some(self.distance(*one, count)).filter(|apart| *apart < bound);
        [n, n - span].iter().all(|one| close(one).is_some()).then_some(())?;
        let largest = |from: usize, to: usize| (from..=to).try_fold(0.0, |most: f64, one| Some(most.max(close(&one)?)));
        Some([largest(n - span, n - span / 2)?, largest(n - span / 2, n)?])
    }

    /// Numbers of half periods after which the motion may repeat itself: the strongest of the last impacts came at the same phase with
    /// about the same velocity, and so did all others of them that were strong.
    fn repetitions(&self) -> &[usize] {
        self.repetitions.get_or_init(|| {
            let most = LONGEST.min(self.halves() / 4);
            let recent = &self.impacts[self.impacts.len().saturating_sub(RECENT)..];
            let speed = |one: &Impact| one.velocity.abs();
            let Some(last) = recent.iter().max_by(|one, other| speed(one).total_cmp(&speed(other))) else {
                return Vec::new();
            };
            let from = last.time - PI * (most as f64 + 0.5);
            let earlier = self.impacts.iter().rev().take_while(|one| one.time > from);
            let mut found = 0;
            let as_strong = |one: &&Impact| (speed(one) - speed(last)).abs() < SIMILAR;
            let counts = earlier.filter(as_strong).filter_map(|one| {
                let count = ((last.time - one.time) / PI).round() as usize;
                (count > 0 && similar(last, one, count)).then_some(count)
            });
            let candidates = counts.filter(|count| {
                let new = *count > found && *count <= most;
                found = found.max(*count);
                let mut strong = recent.iter().filter(|one| speed(one) >= STRONG * speed(last));
                new && strong.all(|one| self.has_similar(one, *count))
            });
            candidates.take(CANDIDATES).collect()
        })
    }

    /// Whether there was an impact like this one, or its mirror image, so many half periods before.
    fn has_similar(&self, one: &Impact, count: usize) -> bool {
        let (time, apart) = (one.time - PI * count as f64, SIMILAR / one.velocity.abs());
        let from = self.impacts.partition_point(|other| other.time <= time - apart);
        let mut near = self.impacts[from..]
            .iter()
            .take_while(|other| other.time < time + apart);
        near.any(|other| similar(one, other, count))
    }

    /// An exact periodic motion close to the present state.
    fn periodic(&self) -> Option<&Periodic> {
        let found = self
            .periodic
            .get_or_init(|| periodic_near(&self.scene, self.sigma, 0.0, self.state(self.halves())));
        found.as_ref()
    }

    /// The motion certainly approaches the stable symmetric 1:1 orbit, and will have settled there at the limit.
    pub(super) fn approaching(&self, limit: usize) -> Option<Point> {
        let n = self.halves();
        let stable = || Symmetric::stable(&self.scene, self.sigma);
        let found = alternates(&self.moments).then(|| self.symmetric.get_or_init(stable))?;
        let symmetric = found.as_ref()?;
        let approach = symmetric.approach(&self.moments, TRANSIENT)?;
        let rate = symmetric.orbit.multipliers[3].ln();
        let left = (2 * limit).saturating_sub(n + REPEATED) as f64;
        (approach.distance * (rate * left).exp() < SETTLED).then(|| Point {
            transient: 0.5 * (n as i64 + approach.left).max(0) as f64,
            recurrence: Some(approach.recurrence),
            exponent: Some(2.0 * rate),
            exponent_error: Some(0.0),
            synchrony: 1.0,
            impacts_per_period: 2.0,
            impacts: 2,
            periods: 1,
            ..self.point(Regime::Symmetric, n - 2)
        })
    }

    /// Number of half periods after which repetitions approach each other.
    pub(super) fn approached(&self) -> Option<usize> {
        let approach = |[first, second]: [f64; 2]| second <= first.max(ROUNDING);
        let mut counts = self.repetitions().iter().copied();
        counts.find(|count| self.differences(*count, SETTLING).is_some_and(approach))
    }

    /// A periodic motion was found close by that is unstable, or attracts slowly.
    pub(super) fn lingers(&self) -> bool {
        let found = self.periodic.get().and_then(Option::as_ref);
        found.is_some_and(|motion| !motion.stable || motion.exponent() >= -SLOW)
    }

    /// Repetitions approach each other, and there is a stable periodic motion close by: its multipliers decide.
    pub(super) fn settling(&self, early: bool) -> Option<Point> {
        let n = self.halves();
        let count = self.approached()?;
        let one_to_one = count <= 2 && self.counts(n)[0] - self.counts(n - count)[0] == count;
        if early && !one_to_one && self.distance(n, count) > SEVERAL {
            return None;
        }
        let motion = self.periodic().filter(|motion| motion.stable)?;
        let pattern = &motion.pattern;
        let exponent = motion.exponent();
        let regime = match (pattern.impacts(), pattern.periods(), pattern.mirrored) {
            (2, 1, true) => Regime::Symmetric,
            (2, 1, false) if pattern.walls[0] != pattern.walls[1] => Regime::Asymmetric,
            _ => Regime::Several,
        };
        let count = pattern.half_periods as usize;
        let recurrence = self.distance(n, count);
        let surely = exponent < -SLOW && (regime != Regime::Several || recurrence < SEVERAL);
        (surely || !early).then(|| Point {
            recurrence: Some(recurrence),
            exponent: Some(exponent),
            exponent_error: Some(0.0),
            impacts: pattern.impacts(),
            periods: pattern.periods(),
            ..self.begun(regime, count)
        })
    }

    /// The motion repeats itself after the same number of half periods again and again, and the differences do not grow. This finds
    /// what has no exact orbit, patterns with sticking or very many impacts, and what Newton's method misses close to a bifurcation. Near
    /// an unstable exact orbit, a motion may repeat itself for more than a thousand periods.
    pub(super) fn repeating(&self, early: bool) -> Option<Point> {
        let n = self.halves();
        let (count, [first, second]) = self
            .repetitions()
            .iter()
            .find_map(|count| Some((*count, self.differences(*count, SAME)?)))?;
        let impacts = self.counts(n)[0] - self.counts(n - count)[0];
        let other = || self.periodic().is_some_and(|motion| early || !motion.stable);
        if impacts == 0 || second > first.max(ROUNDING) || other() {
            return None;
        }
        // A repetition of an odd number of half periods is followed by its mirror image.
        let whole = 1 + count % 2;
        let walls = self.impacts.iter().rev().take(2).map(|one| one.velocity.signum());
        let regime = match (count, impacts) {
            (1, 1) => Regime::Symmetric,
            (2, 2) if walls.sum::<f64>() == 0.0 => Regime::Asymmetric,
            _ => Regime::Several,
        };
        Some(Point {
            recurrence: Some(second),
            impacts: whole * impacts,
            periods: (whole * count / 2) as u32,
            ..self.begun(regime, count)
        })
    }

    /// A regime that repeats itself after `count` half periods, from where its transient ended.
    fn begun(&self, regime: Regime, count: usize) -> Point {
        let n = self.halves();
        let began = (count..=n)
            .rev()
            .find(|one| self.distance(*one, count) > TRANSIENT)
            .unwrap_or(0);
        Point {
            transient: 0.5 * began as f64,
            ..self.point(regime, began.min(n - count))
        }
    }

    /// Largest Lyapunov exponent per period over the periods from `from` on, and its standard error from the scatter of blocks.
    pub(super) fn exponent(&mut self, from: usize) -> (f64, f64) {
        let growth = self.growth(from);
        let length = (growth.len() / BLOCKS).max(1);
        let blocks: Vec<f64> = growth
            .chunks_exact(length)
            .map(|block| mean(block.iter().copied()))
            .collect();
        (
            mean(blocks.iter().copied()),
            standard_deviation(&blocks) / (blocks.len() as f64).sqrt(),
        )
    }

    /// Nothing repeats: the Lyapunov exponent decides.
    pub(super) fn irregular(&mut self) -> Point {
        let n = self.halves();
        let from = (LEFT_OUT * n as f64) as usize;
        let (exponent, error) = self.exponent(from / 2);
        // The uncertainty; a growth that is only linear in time, as on a torus, gives the first number.
        let linear = 2.0 * (0.5 * n as f64).ln() / (0.5 * n as f64);
        let zero = linear.max(SIGNIFICANT * error);
        let mut point = self.point(Regime::Undecided, from);
        // With less than an impact per block, the exponent is not measured: a particle that is almost at rest.
        let impacts = self.counts(n)[0] - self.counts(from)[0];
        point.regime = if impacts < BLOCKS {
            Regime::Undecided
        } else if exponent > zero && point.synchrony < CAPTURES {
            Regime::Chaotic
        } else if exponent > zero {
            Regime::Modulated
        } else if exponent > -zero && zero < ZERO {
            Regime::QuasiPeriodic
        } else {
            Regime::Undecided
        };
        Point {
            exponent: Some(exponent),
            exponent_error: Some(error),
            ..point
        }
    }
}

/// Whether an impact is like `other` or its mirror image so many half periods before; at its time, the other is as close to its wall.
fn similar(one: &Impact, other: &Impact, count: usize) -> bool {
    let sign = if count % 2 == 1 { -1.0 } else { 1.0 };
    let shift = one.time - PI * count as f64 - other.time;
    (other.velocity - sign * one.velocity).abs() < SIMILAR && shift.abs() * one.velocity.abs() < SIMILAR
}
