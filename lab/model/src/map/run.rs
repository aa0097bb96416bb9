//! One point of the map: a plant is driven until its regime is decided.

use std::cell::OnceCell;
use std::f64::consts::{PI, TAU};

use lovines::{Drive, Event, InvalidValue, Plant, State};
use serde::Serialize;

use crate::Dimensionless;
use crate::orbit::{Driven, Moment};
use crate::regime::{Impact, Regime};

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
    pub periods: u32,
    /// How often the particle comes to rest on a wall, per period of the base.
    pub sticks_per_period: f64,
    /// (q1, q1', q2, q2') at the end, at phase 0 of the base.
    #[serde(skip)]
    pub state: [f64; 4],
}

/// Periods after which the motion is examined for the first time; from then on whenever their number has grown by [`LATER`].
const FIRST: usize = 32;
const LATER: f64 = 1.15;
/// Periods over which the exponent of a repeating motion is measured.
const EXPONENT: usize = 256;

/// Cells that are undecided after the limit are continued to so many times its number of periods.
const CONTINUED: usize = 4;

/// Drives the dimensionless plant of `scene` at the detuning `sigma` from `start` = (q1, q1', q2, q2') until its regime is decided, for
/// at most `limit` periods. Only a motion that settles on a periodic one, or cannot reach a wall, is decided earlier, and only an
/// undecided one is continued.
///
/// # Errors
/// Invalid parameters or an invalid start.
pub fn observe(scene: &Dimensionless, sigma: f64, start: [f64; 4], limit: usize) -> Result<Point, InvalidValue> {
    Run::new(scene, sigma, start)?.decided(0, limit)
}

/// Difference of the starts of motions that must agree, and periods from which on a transient may be chaos that ends at random.
const APART: f64 = 1e-9;
const LATE: f64 = 500.0;

/// As [`observe`], with the regime of a motion from another start, 1e-9 and more apart, that differs. `others` such motions are followed
/// where chance decides when chaos ends: the regime is irregular, or it began late.
///
/// # Errors
/// As [`observe`].
pub fn observe_confirmed(
    scene: &Dimensionless,
    sigma: f64,
    start: [f64; 4],
    limit: usize,
    others: usize,
) -> Result<(Point, Option<Regime>), InvalidValue> {
    let point = observe(scene, sigma, start, limit)?;
    let irregular = point.impacts == 0 && ![Regime::NoImpacts, Regime::Undecided].contains(&point.regime);
    let count = if irregular || point.transient > LATE { others } else { 0 };
    for n in 1..=count {
        let [q1, dq1, q2, dq2] = start;
        let regime = observe(scene, sigma, [q1, dq1 + n as f64 * APART, q2, dq2], limit)?.regime;
        if regime != point.regime {
            return Ok((point, Some(regime)));
        }
    }
    Ok((point, None))
}

/// Number of periods at the next examination.
fn later(periods: usize, last: usize) -> usize {
    ((periods as f64 * LATER) as usize).min(last)
}

/// A simulated motion.
pub struct Run {
    pub(super) scene: Dimensionless,
    pub(super) sigma: f64,
    pub(super) plant: Plant,
    pub(super) drive: Drive,
    pub(super) driven: Driven,
    /// Periods so far.
    periods: usize,
    /// The motion after every event.
    moments: Vec<Moment>,
    /// States at the beginning of every half period and now, as far as they were needed.
    states: Vec<OnceCell<[f64; 4]>>,
    /// Growth of a disturbance over each period, as a natural logarithm; a period without impacts may belong to the next one.
    pub(super) growth: Vec<f64>,
    pub(super) impacts: Vec<Impact>,
    /// Phases of the base at which the particle came to rest, rad.
    sticks: Vec<f64>,
}

impl Run {
    /// The dimensionless plant of `scene` at the detuning `sigma`, from `start` = (q1, q1', q2, q2').
    ///
    /// # Errors
    /// Invalid parameters or an invalid start.
    pub fn new(scene: &Dimensionless, sigma: f64, start: [f64; 4]) -> Result<Self, InvalidValue> {
        let drive = scene.drive(sigma);
        Ok(Self {
            scene: *scene,
            sigma,
            plant: scene.plant(start)?,
            drive,
            driven: Driven::new(scene, drive.omega),
            periods: 0,
            moments: Vec::new(),
            states: vec![OnceCell::from(start)],
            growth: Vec::new(),
            impacts: Vec::new(),
            sticks: Vec::new(),
        })
    }

    /// Follows the motion until its regime is decided, for at most `limit` periods; it is not examined before `first` periods.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn decided(&mut self, first: usize, limit: usize) -> Result<Point, InvalidValue> {
        let mut next = FIRST.min(limit);
        loop {
            self.follow(next)?;
            if next < first.min(limit) {
                next = later(next, limit);
                continue;
            }
            let early = next < limit;
            if let Some(point) = self.without_impacts().or_else(|| self.settling(early)) {
                return Ok(point);
            }
            if self.repeating(early).is_some() {
                // Near an unstable motion, recurrence lasts a while: it must last longer, and disturbances must shrink.
                let settled = self.periods;
                self.follow(settled + EXPONENT)?;
                let (exponent, error) = self.exponent(settled);
                if let Some(point) = self.repeating(early).filter(|_| exponent < 0.0) {
                    return Ok(Point {
                        exponent: Some(exponent),
                        exponent_error: Some(error),
                        ..point
                    });
                }
            }
            if next >= limit {
                let point = self.irregular();
                if point.regime != Regime::Undecided || next >= CONTINUED * limit {
                    return Ok(point);
                }
            }
            next = later(next, if early { limit } else { CONTINUED * limit });
        }
    }

    /// Half periods so far.
    pub(super) fn halves(&self) -> usize {
        2 * self.periods
    }

    /// (q1, q1', q2, q2') at the beginning of half period `n`.
    pub(super) fn state(&self, n: usize) -> [f64; 4] {
        *self.states[n].get_or_init(|| {
            let phase = PI * n as f64;
            let after = self.moments.partition_point(|one| one.phase <= phase);
            self.driven.state(&self.moments[after - 1], phase)
        })
    }

    /// Number of impacts before half period `n`, and of times that the particle came to rest.
    pub(super) fn counts(&self, n: usize) -> [usize; 2] {
        let phase = PI * n as f64;
        [
            self.impacts.partition_point(|one| one.time < phase),
            self.sticks.partition_point(|one| *one < phase),
        ]
    }

    /// Follows the motion to the end of so many periods, in one step of the plant.
    pub(super) fn follow(&mut self, periods: usize) -> Result<(), InvalidValue> {
        if periods <= self.periods {
            return Ok(());
        }
        let (start, end) = (TAU * self.periods as f64, TAU * periods as f64);
        let omega = self.drive.omega;
        self.growth.resize(periods, 0.0);
        let Self { driven, moments, growth, impacts, sticks, .. } = self;
        moments.push(driven.begin(start, self.plant.state(), self.plant.contact()));
        let mut period = self.periods;
        self.plant.advance_with(self.drive, (end - start) / omega, |event| {
            let (Event::Impact { t, .. } | Event::Stuck { t, .. } | Event::Released { t, .. }) = event;
            let phase = start + omega * t;
            let now = ((phase / TAU) as usize).min(periods - 1);
            if now > period {
                growth[period] = driven.growth(phase);
                period = now;
            }
            moments.push(driven.pass(phase, &event));
            match event {
                Event::Impact { velocity, .. } => impacts.push(Impact { time: phase, velocity }),
                Event::Stuck { .. } => sticks.push(phase),
                Event::Released { .. } => {}
            }
        })?;
        growth[period] = driven.growth(end);
        let State { q1, dq1, q2, dq2 } = self.plant.state();
        self.periods = periods;
        self.states.resize_with(2 * periods, OnceCell::new);
        self.states.push(OnceCell::from([q1, dq1, q2, dq2]));
        Ok(())
    }
}
