//! One point of the map: a plant is driven until its regime is decided.

use std::f64::consts::PI;

use lovines::{Drive, Event, InvalidValue, Plant, State};
use serde::Serialize;

use crate::Dimensionless;
use crate::numerics::{mean, standard_deviation};
use crate::orbit::{Driven, Tangent};
use crate::regime::{Impact, Regime, synchrony};

/// Result at one point.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Point {
    /// Regime of the response.
    pub regime: Regime,
    /// Periods of the base that were simulated.
    pub followed: usize,
    /// Periods of the base before the regime began; without a repeating motion, those left out of the averages.
    pub transient: f64,
    /// Largest difference between the state and that one repetition before, over the last repetitions; absent if nothing repeats.
    pub recurrence: Option<f64>,
    /// Largest Lyapunov exponent per period of the base; absent without impacts.
    pub exponent: Option<f64>,
    /// Its standard error.
    pub exponent_error: Option<f64>,
    /// Share of the impacts that belong to captures into 1:1 resonance.
    pub synchrony: f64,
    /// Impacts per period of the base.
    pub impacts_per_period: f64,
    /// Impacts of one repetition; 0 if nothing repeats.
    pub impacts: usize,
    /// Periods of the base that it takes; 0 likewise.
    pub periods: f64,
    /// How often the particle comes to rest on a wall, per period of the base.
    pub sticks_per_period: f64,
}

/// Periods after which the motion is examined for the first time; from then on whenever their number has grown by [`LATER`].
const FIRST: usize = 64;
const LATER: f64 = 1.3;
/// Longest repetition in the search, half periods of the base.
const LONGEST: usize = 192;
/// Smallest number of half periods over which a motion repeats itself.
const REPEATED: usize = 64;
/// Largest difference of states that repeat: far above rounding, far below what separates two motions.
const SAME: f64 = 1e-6;
/// Below this, differences are rounding errors, which need not shrink.
const ROUNDING: f64 = 1e-11;
/// A transient ends where the state is this close to that one repetition later.
const NEAR: f64 = 1e-2;
/// Periods over which the exponent of a repeating motion is measured.
const EXPONENT: usize = 256;
/// Share of a motion without repetition that is left out of the averages, and number of blocks that the rest is cut into.
const LEFT_OUT: f64 = 0.25;
const BLOCKS: usize = 32;
/// Standard errors by which a Lyapunov exponent differs from zero.
const SIGNIFICANT: f64 = 4.0;
/// From this share of captured impacts on a chaotic motion is called modulated.
const CAPTURES: f64 = 0.2;

/// Drives the dimensionless plant of `scene` at the detuning `sigma` from `start` = (q1, q1', q2, q2') until its regime is decided, for
/// at most `limit` periods. Only a motion that repeats itself, or cannot reach a wall, is decided earlier.
///
/// # Errors
/// Invalid parameters or an invalid start.
pub fn observe(scene: &Dimensionless, sigma: f64, start: [f64; 4], limit: usize) -> Result<Point, InvalidValue> {
    let mut run = Run::new(scene, sigma, start)?;
    let mut next = FIRST;
    loop {
        run.follow(next.min(limit))?;
        if let Some(point) = run.without_impacts() {
            return Ok(point);
        }
        if let Some(point) = run.repeating() {
            let settled = run.halves();
            run.follow(point.followed + EXPONENT)?;
            let (exponent, error) = run.exponent(settled);
            return Ok(Point {
                exponent: Some(exponent),
                exponent_error: Some(error),
                ..point
            });
        }
        if next >= limit {
            return Ok(run.irregular());
        }
        next = (next as f64 * LATER) as usize;
    }
}

/// A simulated motion, half period by half period.
struct Run {
    plant: Plant,
    drive: Drive,
    driven: Driven,
    tangent: Tangent,
    /// States at the beginning of every half period and now.
    states: Vec<[f64; 4]>,
    /// Growth of a disturbance over each, as a natural logarithm.
    growth: Vec<f64>,
    /// Number of impacts until the end of each, and of times that the particle came to rest.
    counts: Vec<[usize; 2]>,
    impacts: Vec<Impact>,
}

impl Run {
    fn new(scene: &Dimensionless, sigma: f64, start: [f64; 4]) -> Result<Self, InvalidValue> {
        let drive = scene.drive(sigma);
        Ok(Self {
            plant: scene.plant(start)?,
            drive,
            driven: Driven::new(scene, drive.omega),
            tangent: Tangent::new(scene),
            states: vec![start],
            growth: Vec::new(),
            counts: vec![[0, 0]],
            impacts: Vec::new(),
        })
    }

    /// Half periods so far.
    fn halves(&self) -> usize {
        self.growth.len()
    }

    fn follow(&mut self, periods: usize) -> Result<(), InvalidValue> {
        let step = PI / self.drive.omega;
        while self.halves() < 2 * periods {
            let n = self.halves();
            let [q1, dq1, ..] = self.states[n];
            let mut sticks = self.counts[n][1];
            let (driven, tangent, impacts, omega) =
                (&self.driven, &mut self.tangent, &mut self.impacts, self.drive.omega);
            let mut flight = driven.from(PI * n as f64, [q1, dq1]);
            self.plant.advance_with(self.drive, step, |event| match event {
                Event::Impact { t, velocity, .. } => {
                    let acceleration = flight.impact(t, velocity);
                    tangent.impact(t, velocity, acceleration);
                    impacts.push(Impact { time: PI * n as f64 + omega * t, velocity });
                }
                Event::Stuck { t, .. } => {
                    flight.stick(t);
                    tangent.stick(t);
                    sticks += 1;
                }
                Event::Released { t, .. } => {
                    flight.release(t);
                    tangent.release(t);
                }
            })?;
            self.growth.push(tangent.end(step));
            self.counts.push([self.impacts.len(), sticks]);
            let State { q1, dq1, q2, dq2 } = self.plant.state();
            self.states.push([q1, dq1, q2, dq2]);
        }
        Ok(())
    }

    /// What is common to all regimes, over the half periods from `from` on.
    fn point(&self, regime: Regime, from: usize) -> Point {
        let periods = 0.5 * (self.halves() - from) as f64;
        let [[before, rested], [all, rests]] = [self.counts[from], self.counts[self.halves()]];
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
            periods: 0.0,
            sticks_per_period: (rests - rested) as f64 / periods,
        }
    }

    /// The particle rests, and the primary mass cannot reach it: the free part of its motion only decays.
    fn without_impacts(&self) -> Option<Point> {
        let n = self.halves();
        let [q1, dq1, q2, dq2] = self.states[n];
        let reach = self.driven.reach(PI * n as f64, [q1, dq1]);
        (dq2 == 0.0 && reach + q2.abs() < 1.0).then(|| {
            let last = self.impacts.last().map_or(0.0, |one| one.time / PI);
            self.point(Regime::NoImpacts, (last.ceil() as usize).min(n - 1))
        })
    }

    /// Distance between the state at half period `n` and that `count` half periods earlier, or its mirror image.
    fn distance(&self, n: usize, count: usize) -> f64 {
        let sign = if count % 2 == 1 { -1.0 } else { 1.0 };
        let (now, then) = (&self.states[n], &self.states[n - count]);
        now.iter()
            .zip(then)
            .map(|(a, b)| (sign * a - b).abs())
            .fold(0.0, f64::max)
    }

    /// The motion repeats itself after the same number of half periods again and again, and the differences do not grow.
    fn repeating(&self) -> Option<Point> {
        let n = self.halves();
        let (count, recurrence) = (1..=LONGEST.min(n / 4)).find_map(|count| {
            let span = (2 * count).max(REPEATED).min(n - count);
            let largest = |from: usize, to: usize| (from..=to).map(|one| self.distance(one, count)).fold(0.0, f64::max);
            if self.distance(n, count) > SAME || largest(n - span, n) > SAME {
                return None;
            }
            let (first, second) = (largest(n - span, n - span / 2), largest(n - span / 2, n));
            (second <= first.max(ROUNDING)).then_some((count, second))
        })?;
        let impacts = self.counts[n][0] - self.counts[n - count][0];
        if impacts == 0 {
            return None;
        }
        let alternate = self.impacts[self.impacts.len() - 2..]
            .iter()
            .map(|one| one.velocity.signum())
            .sum::<f64>()
            == 0.0;
        let regime = match (count, impacts) {
            (1, 1) => Regime::Symmetric,
            (2, 2) if alternate => Regime::Asymmetric,
            _ => Regime::Several,
        };
        let began = (count..=n)
            .rev()
            .find(|one| self.distance(*one, count) > NEAR)
            .unwrap_or(0);
        // A repetition of an odd number of half periods is followed by its mirror image.
        let whole = 1 + count % 2;
        Some(Point {
            recurrence: Some(recurrence),
            impacts: whole * impacts,
            periods: 0.5 * (whole * count) as f64,
            transient: 0.5 * began as f64,
            ..self.point(regime, began.min(n - count))
        })
    }

    /// Largest Lyapunov exponent per period over the half periods from `from` on, and its standard error from the scatter of blocks.
    fn exponent(&self, from: usize) -> (f64, f64) {
        let growth = &self.growth[from..];
        let length = (growth.len() / BLOCKS).max(1);
        let blocks: Vec<f64> = growth
            .chunks_exact(length)
            .map(|block| 2.0 * mean(block.iter().copied()))
            .collect();
        (
            mean(blocks.iter().copied()),
            standard_deviation(&blocks) / (blocks.len() as f64).sqrt(),
        )
    }

    /// Nothing repeats: the Lyapunov exponent decides.
    fn irregular(&self) -> Point {
        let n = self.halves();
        let from = (LEFT_OUT * n as f64) as usize;
        let (exponent, error) = self.exponent(from);
        // A growth that is only linear in time, as on a torus, gives this.
        let linear = 2.0 * (0.5 * n as f64).ln() / (0.5 * n as f64);
        let mut point = self.point(Regime::Undecided, from);
        point.regime = if point.impacts_per_period == 0.0 {
            Regime::Undecided
        } else if exponent > linear.max(SIGNIFICANT * error) {
            if point.synchrony < CAPTURES {
                Regime::Chaotic
            } else {
                Regime::Modulated
            }
        } else if exponent.abs() <= linear && SIGNIFICANT * error <= linear {
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
