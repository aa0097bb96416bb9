//! A simulated motion of one point of the map, and the result of the point.

use std::cell::OnceCell;
use std::f64::consts::{PI, TAU};
use std::sync::{
    Arc,
    atomic::{AtomicBool, Ordering::Relaxed},
};

use lovines::{Drive, Event, InvalidValue, Plant, State};
use serde::Serialize;

use crate::Dimensionless;
use crate::numerics::{mean, standard_deviation};
use crate::orbit::{Disturbance, Driven, Moment};
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
    pub periods: u32,
    /// How often the particle comes to rest on a wall, per period of the base.
    pub sticks_per_period: f64,
    /// (q1, q1', q2, q2') at the end, at phase 0 of the base.
    #[serde(skip)]
    pub state: [f64; 4],
}

/// Number of events for which there is room at first.
const EXPECTED: usize = 1024;

/// Longest step of the plant, in times of the oscillator: some ten milliseconds where there is no impact.
const STRETCH: f64 = 1e4;

/// A simulated motion.
pub struct Run {
    pub(super) scene: Dimensionless,
    pub(super) sigma: f64,
    /// Its caches are large.
    pub(super) plant: Box<Plant>,
    pub(super) drive: Drive,
    pub(super) driven: Driven,
    /// Periods so far.
    pub(super) periods: usize,
    /// The motion at the start, after every event, and wherever it was examined.
    pub(super) moments: Vec<Moment>,
    /// States at the beginning of every half period and now, as far as they were needed.
    states: Vec<OnceCell<[f64; 4]>>,
    /// A disturbance, the period in which it begins, the number of moments that it has passed, and its growth over each period, as a
    /// natural logarithm; a period without impacts may belong to the next one.
    disturbance: Disturbance,
    begun: usize,
    passed: usize,
    growth: Vec<f64>,
    pub(super) impacts: Vec<Impact>,
    /// Phases of the base at which the particle came to rest, rad.
    sticks: Vec<f64>,
    stop: Arc<AtomicBool>,
}

impl Run {
    /// The dimensionless plant of `scene` at the detuning `sigma`, from `start` = (q1, q1', q2, q2').
    ///
    /// # Errors
    /// Invalid parameters or an invalid start.
    pub fn new(scene: &Dimensionless, sigma: f64, start: [f64; 4]) -> Result<Self, InvalidValue> {
        let drive = scene.drive(sigma);
        let plant = Box::new(scene.plant(start)?);
        let driven = Driven::new(scene, drive.omega);
        let mut moments = Vec::with_capacity(EXPECTED);
        moments.push(driven.moment(0.0, plant.state(), plant.contact()));
        Ok(Self {
            scene: *scene,
            sigma,
            plant,
            drive,
            driven,
            periods: 0,
            moments,
            states: vec![OnceCell::from(start)],
            disturbance: Disturbance::default(),
            begun: usize::MAX,
            passed: 0,
            growth: Vec::new(),
            impacts: Vec::with_capacity(EXPECTED),
            sticks: Vec::new(),
            stop: Arc::default(),
        })
    }

    /// Ends the thread that follows the motion, by unwinding, soon after `stop` was set: one period of a slow base has millions of events.
    #[must_use]
    pub fn stopped_by(self, stop: Arc<AtomicBool>) -> Self {
        Self { stop, ..self }
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

    /// Follows the motion to the end of so many periods, in steps of the plant of at most [`STRETCH`].
    pub(super) fn follow(&mut self, periods: usize) -> Result<(), InvalidValue> {
        if periods <= self.periods {
            return Ok(());
        }
        let (start, end) = (TAU * self.periods as f64, TAU * periods as f64);
        let omega = self.drive.omega;
        let Self { driven, moments, impacts, sticks, stop, .. } = self;
        let stopped = || {
            if stop.load(Relaxed) {
                std::panic::resume_unwind(Box::new("the motion was stopped"));
            }
        };
        let mut now = moments[moments.len() - 1];
        let duration = (end - start) / omega;
        let stretches = (duration / STRETCH).ceil().max(1.0);
        for stretch in 0..stretches as u64 {
            stopped();
            let from = start + (end - start) * (stretch as f64 / stretches);
            self.plant.advance_with(self.drive, duration / stretches, |event| {
                stopped();
                let phase = from + omega * event.time();
                now = driven.after(&now, phase, &event);
                moments.push(now);
                match event {
                    Event::Impact { velocity, .. } => impacts.push(Impact { time: phase, velocity }),
                    Event::Stuck { .. } => sticks.push(phase),
                    _ => {}
                }
            })?;
        }
        moments.push(driven.moment(end, self.plant.state(), self.plant.contact()));
        let State { q1, dq1, q2, dq2 } = self.plant.state();
        self.periods = periods;
        self.states.resize_with(2 * periods, OnceCell::new);
        self.states.push(OnceCell::from([q1, dq1, q2, dq2]));
        Ok(())
    }

    /// Growth of the disturbance over each period from the period `from` on. It begins before that, to find its direction.
    pub(super) fn growth(&mut self, from: usize) -> &[f64] {
        if from < self.begun {
            let phase = TAU * (0.75 * from as f64);
            self.passed = self.moments.partition_point(|one| one.phase < phase);
            (self.begun, self.disturbance) = (from, Disturbance::default());
        }
        self.growth.resize(self.periods, 0.0);
        let mut period = ((self.moments[self.passed].phase / TAU) as usize).min(self.periods - 1);
        for pair in self.moments[self.passed..].windows(2) {
            self.disturbance.flow(&self.driven, &pair[0], &pair[1]);
            let now = ((pair[1].phase / TAU) as usize).min(self.periods);
            if now > period {
                self.growth[period] = self.disturbance.growth();
                period = now;
            }
            self.disturbance.jump(&self.driven, &pair[1]);
        }
        self.passed = self.moments.len() - 1;
        &self.growth[from..]
    }

    /// Distance between the state at half period `n` and the one `count` half periods earlier, or its mirror image.
    pub(super) fn distance(&self, n: usize, count: usize) -> f64 {
        let sign = if count % 2 == 1 { -1.0 } else { 1.0 };
        let (now, then) = (self.state(n), self.state(n - count));
        let differences = now.iter().zip(then).map(|(a, b)| (sign * a - b).abs());
        // Nothing is near a value that cannot be computed: the steady response at an undamped resonance.
        differences.fold(0.0, |largest, one| if one <= largest { largest } else { one })
    }

    /// Largest Lyapunov exponent per period from half period `from` on, and its standard error by batch means: as many batches as each
    /// has periods.
    pub(super) fn exponent(&mut self, from: usize) -> (f64, f64) {
        let growth = self.growth(from / 2);
        let length = ((growth.len() as f64).sqrt() as usize).max(1);
        let batches: Vec<f64> = growth
            .chunks_exact(length)
            .map(|batch| mean(batch.iter().copied()))
            .collect();
        let error = standard_deviation(&batches) / (batches.len() as f64).sqrt();
        (mean(batches.iter().copied()), error)
    }

    /// What all regimes have, over the half periods from `from` on.
    pub(super) fn point(&self, regime: Regime, from: usize) -> Point {
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
}
