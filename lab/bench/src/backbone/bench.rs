//! The bench of the tracking, which reads period by period.

use std::f64::consts::TAU;

use super::peak;
use super::point::Point;
use super::predictor::Known;
use super::settle::{Criterion, Found};
use crate::experiment::{self, ExperimentError, Stage};
use crate::identification::{Cycle, Regime, Slopes, classify, regime_by_response};
use crate::rig::{Controller, Rig};
use crate::scene::Scene;
use vines_model::numerics::Estimate;

/// A bench that reads period by period.
pub(super) struct Bench<'a, R: Rig + ?Sized, C: ?Sized> {
    pub run: experiment::Bench<'a, R, C>,
    pub scene: &'a Scene,
    pub stage: Stage,
    pub target: f64,
    /// The last period.
    pub last: Option<Cycle>,
}

/// What is to be held next.
#[derive(Clone)]
pub(super) struct Order {
    /// Response amplitude over b.
    pub level: f64,
    /// Phase error, rad.
    pub phase: f64,
    /// The points before.
    pub known: Vec<Known>,
}

/// Largest relative deviation of a held amplitude within the periods, unless it is noise.
const SPREAD: f64 = 0.01;
/// Largest relative difference of the response from its level that counts as reached.
const REACHED: f64 = 0.01;

impl Order {
    /// What theory knows of the backbone there.
    pub fn slopes(&self, scene: &Scene) -> Slopes {
        Slopes::by_theory(&scene.dimensionless(), self.level, self.phase)
    }

    /// The criterion for a settled point.
    pub fn criterion(&self, scene: &Scene) -> Criterion {
        let (settings, d) = (&scene.backbone, scene.dimensionless());
        let share = if scene.resonance.is_peak() {
            peak::share_of_drive(self.level)
        } else {
            1.0
        };
        let pair = |size: f64| [d.amplitude(size), d.omega_change(size)];
        let [base, omega] = pair(settings.tolerance);
        Criterion {
            omega0: d.omega0,
            precision: pair(settings.precision),
            tolerance: [share * base, omega],
            // Evenly distributed within the tolerance.
            least: [share * base, omega].map(|most| most / 3f64.sqrt()),
            spread: SPREAD,
            fewest: settings.dwell_min as usize,
            slopes: self.slopes(scene),
            phase: self.phase,
        }
    }

    /// Whether a response, m, is at the level.
    pub fn is_reached(&self, scene: &Scene, response: Estimate) -> bool {
        let Estimate { value, uncertainty } = response.scaled(1.0 / scene.dimensionless().b);
        (value - self.level).abs() <= (REACHED * self.level).max(4.0 * uncertainty)
    }
}

impl<R: Rig + ?Sized, C: Controller + ?Sized> Bench<'_, R, C> {
    /// One period of the drive.
    pub fn cycle(&mut self) -> Result<Cycle, ExperimentError> {
        loop {
            let begin = self.run.samples.len();
            let first = self.run.periods;
            while self.run.periods < first.floor() + 1.0 {
                self.run.sample(self.stage)?;
            }
            let samples = &self.run.samples[begin..];
            if let Some(cycle) = Cycle::of(samples, self.run.sample_time, first * TAU, self.target) {
                self.last = Some(cycle);
                return Ok(cycle);
            }
        }
    }

    /// The point of an estimate from the last of some periods, for a move that began at `start`, in periods.
    pub fn point(&self, order: &Order, start: f64, said: &Found, cycles: &[Cycle], criterion: &Criterion) -> Point {
        let samples: usize = cycles[cycles.len() - said.periods..]
            .iter()
            .map(|cycle| cycle.samples)
            .sum();
        let averaged = &self.run.samples[self.run.samples.len() - samples..];
        let [base, omega] = said.at;
        let regime = regime_by_response(averaged, self.scene, base.value, omega.value);
        Point {
            periods: self.run.periods - start,
            regime,
            regime_by_impacts: self.run.samples[0]
                .ground_truth
                .map(|_| classify(averaged, self.run.sample_time, omega.value).1),
            // An irregular motion can seem steady for a while.
            settled: regime != Regime::Other && (said.steady || criterion.is_met(said)),
            reached: order.is_reached(self.scene, said.response),
            ..Point::new(order.level, said, &self.scene.dimensionless())
        }
    }
}
