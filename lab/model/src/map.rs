//! The regime of one cell of a regime map, from a simulated sequence of impacts.
//!
//! A plant is driven at a fixed frequency from a start until its regime is decided: by a motion that repeats itself or, after the largest
//! number of periods, by its largest Lyapunov exponent. Where several regimes are stable, another start may lead to another regime.
//!
//! States are compared at the beginning of every period of the base. A motion repeats if all states of a window at its end agree with the states
//! one repetition before.

use std::f64::consts::TAU;
use std::ops::ControlFlow;
use std::sync::{
    Arc,
    atomic::{AtomicBool, Ordering::Relaxed},
};

use lovines::{Drive, Event, InvalidValue, Plant, State};
use serde::Serialize;

use crate::Dimensionless;
use crate::numerics::{SIGNIFICANT, mean, standard_deviation};
use crate::orbit::{Periodic, SETTLING_DISTANCE, periodic_near};
use crate::oscillator::response;
use crate::regime::{Impact, Regime, synchrony};

/// Default of the largest number of periods that a cell is followed.
pub const LIMIT: usize = 20_000;
/// Default of the number of further motions that must agree where chance decides when chaos ends. docs/regimes.md
/// says how often chaos that passes for lasting ends later.
pub const CONFIRMATIONS: usize = 6;

/// Periods after which the motion is examined for the first time; from then on whenever their number has grown by a quarter.
const FIRST_EXAMINED: usize = 16;

/// Drives the dimensionless plant of `scene` at the detuning `sigma` from `start` = (q1, q1', q2, q2') until its regime is decided, for
/// at most `limit` periods. A motion that settles on a periodic one, or cannot reach a wall, is decided earlier.
pub fn observe(scene: &Dimensionless, sigma: f64, start: [f64; 4], limit: usize) -> Result<RegimeResult, InvalidValue> {
    CellRun::new(scene, sigma, start)?.decided(0, limit)
}

/// Distance between the starts of motions that must agree: far above rounding, and magnified by chaos to order one in ln(1e9) = 21 Lyapunov
/// times.
const START_DISTANCE: f64 = 1e-9;
/// Transient, periods, from which on it may be chaos that ends at random: on the default scene,
/// the free motion of the primary mass decays by exp(pi epsilon lambda 500) = e^19 within it.
const LATE: f64 = 500.0;

/// The regime as by [`observe`], and the regime of a motion from another start, 1e-9 and more apart, if it differs. `others` such motions
/// are followed where chance decides when chaos ends: the regime is irregular, or it began late.
pub fn observe_confirmed(
    scene: &Dimensionless,
    sigma: f64,
    start: [f64; 4],
    limit: usize,
    others: usize,
) -> Result<(RegimeResult, Option<Regime>), InvalidValue> {
    let result = observe(scene, sigma, start, limit)?;
    let irregular = result.impacts == 0 && ![Regime::NoImpacts, Regime::Undecided].contains(&result.regime);
    let count = if irregular || result.transient > LATE {
        others
    } else {
        0
    };
    for n in 1..=count {
        let [q1, dq1, q2, dq2] = start;
        let regime = observe(scene, sigma, [q1, dq1 + n as f64 * START_DISTANCE, q2, dq2], limit)?.regime;
        if regime != result.regime {
            return Ok((result, Some(regime)));
        }
    }
    Ok((result, None))
}

/// The regime of a motion, and how it was decided.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct RegimeResult {
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
    /// Periods of the base that one repetition takes; 0 if nothing repeats.
    pub periods: u32,
    /// How often the particle comes to rest on a wall, per period of the base.
    pub sticks_per_period: f64,
    /// (q1, q1', q2, q2') at the end, at phase 0 of the base.
    #[serde(skip)]
    pub state: [f64; 4],
}

/// Longest step of the plant, over 1/omega0: bounds the time until a stop is noticed to some ten milliseconds where there is no impact.
const STRETCH: f64 = 1e4;

/// A simulated motion.
pub struct CellRun {
    scene: Dimensionless,
    sigma: f64,
    /// Its caches are large.
    plant: Box<Plant>,
    drive: Drive,
    /// (q1, q1', q2, q2') at the beginning of every period, and now.
    states: Vec<[f64; 4]>,
    impacts: Vec<Impact>,
    /// Phases of the base at which the particle came to rest, rad.
    sticks: Vec<f64>,
    stop: Arc<AtomicBool>,
}

impl CellRun {
    /// The dimensionless plant of `scene` at the detuning `sigma`, from `start` = (q1, q1', q2, q2').
    pub fn new(scene: &Dimensionless, sigma: f64, start: [f64; 4]) -> Result<Self, InvalidValue> {
        Ok(Self {
            scene: *scene,
            sigma,
            plant: Box::new(scene.plant(start)?),
            drive: scene.drive(sigma),
            states: vec![start],
            impacts: Vec::new(),
            sticks: Vec::new(),
            stop: Arc::default(),
        })
    }

    /// Ends the motion soon after `stop` was set, with an undecided regime: one period of a slow base has millions of events.
    #[must_use]
    pub fn stopped_by(self, stop: Arc<AtomicBool>) -> Self {
        Self { stop, ..self }
    }

    /// Follows the motion until its regime is decided, for at most `limit` periods; it is not examined before `first` periods.
    pub fn decided(&mut self, first: usize, limit: usize) -> Result<RegimeResult, InvalidValue> {
        let mut periods = first.max(FIRST_EXAMINED).min(limit);
        loop {
            if self.follow(periods)?.is_break() {
                return Ok(self.result(Regime::Undecided, 0));
            }
            // The regime, if the motion so far shows one that lasts: no impacts, or a stable periodic motion.
            let lasting = self
                .without_impacts()
                .map_or_else(|| self.periodic(), |result| Ok(Some(result)))?;
            if let Some(result) = lasting {
                return Ok(result);
            }
            if periods >= limit {
                return self.irregular();
            }
            periods = (periods + periods / 4).min(limit);
        }
    }

    /// Periods so far.
    fn periods(&self) -> usize {
        self.states.len() - 1
    }

    /// Number of impacts before period `n`, and of times that the particle came to rest.
    fn counts(&self, n: usize) -> [usize; 2] {
        let phase = TAU * n as f64;
        [
            self.impacts.partition_point(|impact| impact.time < phase),
            self.sticks.partition_point(|time| *time < phase),
        ]
    }

    /// Follows the motion to the end of period `periods`.
    fn follow(&mut self, periods: usize) -> Result<ControlFlow<()>, InvalidValue> {
        let omega = self.drive.omega;
        let Self { plant, states, impacts, sticks, stop, .. } = self;
        let going = || match stop.load(Relaxed) {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        };
        let steps = (TAU / (omega * STRETCH)).ceil() as u64;
        while states.len() <= periods {
            for step in 0..steps {
                let from = TAU * ((states.len() - 1) as f64 + step as f64 / steps as f64);
                plant.advance_until(self.drive, TAU / (omega * steps as f64), |event| {
                    let time = from + omega * event.time();
                    match event {
                        Event::Impact { velocity, .. } => impacts.push(Impact { time, velocity }),
                        Event::Stuck { .. } => sticks.push(time),
                        _ => {}
                    }
                    going()
                })?;
                if going().is_break() {
                    return Ok(ControlFlow::Break(()));
                }
            }
            states.push(plant.state().into());
        }
        Ok(ControlFlow::Continue(()))
    }

    /// Distance between the state at the beginning of period `n` and the one `count` periods earlier.
    fn distance(&self, n: usize, count: usize) -> f64 {
        let differences = self.states[n]
            .iter()
            .zip(&self.states[n - count])
            .map(|(a, b)| (a - b).abs());
        differences.fold(0.0, f64::max)
    }

    /// Number of the last periods that show whether disturbances grow: all but the first third, as far as they are needed.
    fn observed(&self) -> usize {
        (self.periods() - self.periods() / 3).min(OBSERVED)
    }

    /// Largest Lyapunov exponent per period, and its standard error by batch means: as many batches as each has periods. A second plant begins
    /// every period next to the first one, in the direction in which the last period has left it.
    fn exponent(&self) -> Result<(f64, f64), InvalidValue> {
        let states = &self.states[self.periods() - self.observed()..];
        let (mut plant, mut apart) = (self.scene.plant(states[0])?, [0.5 * SEPARATION; 4]);
        plant.begin(self.drive)?;
        let mut growth = Vec::with_capacity(states.len());
        for pair in states.windows(2) {
            // Next to a wall, one side is outside the cavity.
            let beside = |sign: f64| State::from(std::array::from_fn(|n| pair[0][n] + sign * apart[n]));
            if plant.set_state(beside(1.0)).is_err() {
                plant.set_state(beside(-1.0))?;
            }
            plant.advance(self.drive, TAU / self.drive.omega)?;
            let there: [f64; 4] = plant.state().into();
            let after: [f64; 4] = std::array::from_fn(|n| there[n] - pair[1][n]);
            let size = after.iter().map(|x| x * x).sum::<f64>().sqrt().max(f64::EPSILON);
            growth.push((size / SEPARATION).ln());
            apart = after.map(|x| x * (SEPARATION / size));
        }
        let length = ((growth.len() as f64).sqrt() as usize).max(1);
        let batches: Vec<f64> = growth
            .chunks_exact(length)
            .map(|batch| mean(batch.iter().copied()))
            .collect();
        let error = standard_deviation(&batches) / (batches.len() as f64).sqrt();
        Ok((mean(batches.iter().copied()), error))
    }

    /// The result without recurrence and exponent, averaged over the periods from `from` on.
    fn result(&self, regime: Regime, from: usize) -> RegimeResult {
        let periods = (self.periods() - from) as f64;
        let [[before, rested], [all, rests]] = [self.counts(from), self.counts(self.periods())];
        RegimeResult {
            regime,
            followed: self.periods(),
            transient: from as f64,
            recurrence: None,
            exponent: None,
            exponent_error: None,
            synchrony: synchrony(&self.impacts[before..]),
            impacts_per_period: (all - before) as f64 / periods,
            impacts: 0,
            periods: 0,
            sticks_per_period: (rests - rested) as f64 / periods,
            state: self.states[self.periods()],
        }
    }
}

/// Distance of the second plant that shows the Lyapunov exponent: far above rounding, far below what separates two motions.
const SEPARATION: f64 = 1e-8;
/// Largest number of periods over which it is followed: an exponent of zero is then known to [`ZERO`].
const OBSERVED: usize = 5000;
/// Differences below which it repeats: far above rounding, far below what separates two motions.
const REPEAT_DIFFERENCE: f64 = 1e-6;
/// Longest repetition in the search, periods. The window is a third of it, and at least two repetitions.
const REPETITION: usize = 96;
/// Largest uncertainty of an exponent that is called zero, per period.
const ZERO: f64 = 2e-3;
/// Share of captured impacts from which a chaotic motion is called modulated.
const CAPTURES: f64 = 0.2;

impl CellRun {
    /// The particle rests, and the primary mass cannot reach it: the free part of its motion only decays.
    fn without_impacts(&self) -> Option<RegimeResult> {
        let n = self.periods();
        let [q1, dq1, q2, dq2] = self.states[n];
        let omega = self.drive.omega;
        let steady = response(&self.scene, omega);
        let reach = (q1 - steady.im).hypot(dq1 - omega * steady.re) + steady.norm();
        (dq2 == 0.0 && reach + q2.abs() < 1.0).then(|| {
            let last = self.impacts.last().map_or(0.0, |impact| impact.time / TAU);
            self.result(Regime::NoImpacts, (last.ceil() as usize).min(n - 1))
        })
    }

    /// The motion repeats and its exponent is negative. The multipliers of an exact orbit close by give the exponent before the motion
    /// has settled; without such an orbit (the particle sticks, or there are very many impacts), a second plant gives it.
    fn periodic(&self) -> Result<Option<RegimeResult>, InvalidValue> {
        let n = self.periods();
        let Some((count, recurrence)) = self.recurrence() else {
            return Ok(None);
        };
        let orbit = periodic_near(&self.scene, self.sigma, self.states[n]);
        let (regime, impacts, periods, exponent) = if let Some(orbit) = &orbit {
            let pattern = &orbit.pattern;
            let exponent = (orbit.exponent(), 0.0);
            (regime(orbit), pattern.impacts(), pattern.periods(), exponent)
        } else if recurrence < REPEAT_DIFFERENCE {
            let impacts = self.counts(n)[0] - self.counts(n - count)[0];
            (Regime::Several, impacts, count as u32, self.exponent()?)
        } else {
            return Ok(None);
        };
        let begun = |n: &usize| self.distance(*n, count) > SETTLING_DISTANCE;
        Ok((impacts > 0 && exponent.0 < 0.0).then(|| {
            let transient = (count..=n).rev().find(begun).unwrap_or(0);
            RegimeResult {
                transient: transient as f64,
                recurrence: Some(recurrence),
                exponent: Some(exponent.0),
                exponent_error: Some(exponent.1),
                impacts,
                periods,
                ..self.result(regime, transient.min(n - count))
            }
        }))
    }

    /// Nothing repeats: the Lyapunov exponent decides.
    fn irregular(&self) -> Result<RegimeResult, InvalidValue> {
        let (exponent, error) = self.exponent()?;
        let periods = self.observed() as f64;
        // A disturbance that grows as its time, as on a torus, has this exponent.
        let linear = periods.ln() / periods;
        let zero = linear.max(SIGNIFICANT * error);
        let result = self.result(Regime::Undecided, self.periods() / 3);
        // With less than one impact per block of periods, the exponent is not measured: a particle that is almost at rest.
        let measured = result.impacts_per_period * periods > 2.0 * periods.sqrt();
        let regime = match exponent {
            _ if !measured => Regime::Undecided,
            exponent if exponent > zero && result.synchrony < CAPTURES => Regime::Chaotic,
            exponent if exponent > zero => Regime::Modulated,
            exponent if exponent > -zero && zero < ZERO => Regime::QuasiPeriodic,
            _ => Regime::Undecided,
        };
        Ok(RegimeResult {
            regime,
            exponent: Some(exponent),
            exponent_error: Some(error),
            ..result
        })
    }

    /// Shortest repetition, periods, and the largest difference between the states of the window and those one repetition before. They do
    /// not grow from one half of the window to the other.
    fn recurrence(&self) -> Option<(usize, f64)> {
        let n = self.periods();
        // From the end: most motions that do not repeat are far off there.
        let largest = |count: usize, from: usize, to: usize| {
            (from..=to).rev().try_fold(0.0_f64, |largest, n| {
                let distance = self.distance(n, count);
                (distance < SETTLING_DISTANCE).then(|| largest.max(distance))
            })
        };
        (1..=REPETITION.min(n / 4)).find_map(|count| {
            let window = (2 * count).max(REPETITION / 3).min(n - count);
            let late = largest(count, n - window / 2, n)?;
            let early = largest(count, n - window, n - window / 2)?;
            (late <= early.max(REPEAT_DIFFERENCE)).then_some((count, late))
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

/// Steps per period at which the response is read.
const STEPS_PER_PERIOD: usize = 64;
/// Smallest number of periods over which it is averaged.
const AVERAGED: usize = 64;
/// Largest number of periods until the response is read.
const WAITED: f64 = 2000.0;

/// Amplitude and powers, dimensionless: lengths over b, powers over `k b^2 omega0`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SteadyResponse {
    /// Amplitude of the first harmonic of v.
    pub c: f64,
    /// Mean power that the impacts dissipate.
    pub impact_power: f64,
    /// Mean power that the damper dissipates.
    pub damper_power: f64,
}

impl CellRun {
    /// Follows the motion further, and reads its response over whole repetitions or, if nothing repeats, over 64 periods.
    pub fn response(&mut self, result: &RegimeResult) -> Result<SteadyResponse, InvalidValue> {
        let repeats = result.periods > 0;
        if let Some(exponent) = result.exponent.filter(|exponent| repeats && *exponent < 0.0) {
            // The distance to the periodic motion shrinks by this factor. A motion that was stopped is read where it is.
            let waited = (REPEAT_DIFFERENCE.ln() / exponent).min(WAITED);
            let _ = self.follow(self.periods() + waited as usize + 1)?;
        }
        let unit = if repeats { result.periods as usize } else { 1 };
        let periods = unit * AVERAGED.div_ceil(unit);
        let plant = &mut self.plant;
        let (omega, e) = (self.drive.omega, self.drive.amplitude);
        let damping = plant.parameters().damping;
        let phase = |n: usize| TAU * n as f64 / STEPS_PER_PERIOD as f64;
        let energy = |plant: &lovines::Plant, n: usize| plant.energy(e * phase(n).sin());
        let before = (energy(plant, 0), plant.totals().dissipated, plant.state().q1);
        let count = periods * STEPS_PER_PERIOD;
        let (mut harmonic, mut work) = ([0.0; 2], 0.0);
        for n in 0..count {
            let (sin, cos) = phase(n).sin_cos();
            let (v, q1) = (plant.centre(), plant.state().q1);
            harmonic = [harmonic[0] + v * sin, harmonic[1] + v * cos];
            // Power of the base, (k (e - q1) + c (e' - q1')) e', with the jumps of q1' integrated by parts.
            let (slope, curvature) = (e * omega * cos, -e * omega * omega * sin);
            work += (e * sin - q1) * slope + damping * (slope * slope + q1 * curvature);
            plant.advance(self.drive, TAU / (omega * STEPS_PER_PERIOD as f64))?;
        }
        let duration = periods as f64 * TAU / omega;
        let ends = damping * (plant.state().q1 - before.2) * e * omega * phase(0).cos();
        let impacts = (plant.totals().dissipated - before.1) / duration;
        let input = work / count as f64 - (ends + energy(plant, count) - before.0) / duration;
        Ok(SteadyResponse {
            c: 2.0 * harmonic[0].hypot(harmonic[1]) / count as f64,
            impact_power: impacts,
            damper_power: input - impacts,
        })
    }
}
