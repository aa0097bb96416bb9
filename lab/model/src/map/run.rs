//! One point of the map: a plant is driven until its regime is decided.

use std::f64::consts::PI;

use lovines::{Drive, Event, InvalidValue, Plant, State};
use serde::Serialize;

use super::response::Response;
use crate::Dimensionless;
use crate::orbit::{Driven, Tangent};
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
const FIRST: usize = 64;
const LATER: f64 = 1.3;
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
    Run::new(scene, sigma, start)?.decided(limit)
}

/// As [`observe`], with the response of the motion found.
///
/// # Errors
/// As [`observe`].
pub fn observe_response(
    scene: &Dimensionless,
    sigma: f64,
    start: [f64; 4],
    limit: usize,
) -> Result<(Point, Response), InvalidValue> {
    let mut run = Run::new(scene, sigma, start)?;
    let point = run.decided(limit)?;
    Ok((point, run.response(&point)?))
}

/// A simulated motion, half period by half period.
pub(super) struct Run {
    pub(super) scene: Dimensionless,
    pub(super) sigma: f64,
    pub(super) plant: Plant,
    pub(super) drive: Drive,
    pub(super) driven: Driven,
    tangent: Tangent,
    /// States at the beginning of every half period and now.
    pub(super) states: Vec<[f64; 4]>,
    /// Growth of a disturbance over each, as a natural logarithm.
    pub(super) growth: Vec<f64>,
    /// Number of impacts until the end of each, and of times that the particle came to rest.
    pub(super) counts: Vec<[usize; 2]>,
    pub(super) impacts: Vec<Impact>,
}

impl Run {
    fn new(scene: &Dimensionless, sigma: f64, start: [f64; 4]) -> Result<Self, InvalidValue> {
        let drive = scene.drive(sigma);
        Ok(Self {
            scene: *scene,
            sigma,
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

    /// Follows the motion until its regime is decided.
    fn decided(&mut self, limit: usize) -> Result<Point, InvalidValue> {
        let mut next = FIRST.min(limit);
        loop {
            self.follow(next)?;
            if let Some(point) = self.without_impacts().or_else(|| self.settling()) {
                return Ok(point);
            }
            if self.repeating().is_some() {
                // Near an unstable motion, recurrence lasts a while: it must last longer, and disturbances must shrink.
                let settled = self.halves();
                self.follow(settled / 2 + EXPONENT)?;
                let (exponent, error) = self.exponent(settled);
                if let Some(point) = self.repeating().filter(|_| exponent < 0.0) {
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
            let last = if next < limit { limit } else { CONTINUED * limit };
            next = ((next as f64 * LATER) as usize).min(last);
        }
    }

    /// Half periods so far.
    pub(super) fn halves(&self) -> usize {
        self.growth.len()
    }

    pub(super) fn follow(&mut self, periods: usize) -> Result<(), InvalidValue> {
        let step = PI / self.drive.omega;
        while self.halves() < 2 * periods {
            let n = self.halves();
            let [q1, dq1, ..] = self.states[n];
            let mut sticks = self.counts[n][1];
            let (driven, tangent, impacts, omega) =
                (&self.driven, &mut self.tangent, &mut self.impacts, self.drive.omega);
            let mut flight = driven.from(PI * n as f64, [q1, dq1], self.plant.contact().is_some());
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
}
