//! The response at one point of the map, once its regime is decided.

use std::f64::consts::PI;

use lovines::InvalidValue;
use serde::Serialize;

use super::run::{Point, Run};

/// Steps per period at which the response is read.
const STEPS: usize = 64;
/// Smallest number of periods over which it is averaged.
const AVERAGED: usize = 64;
/// Natural logarithm of the factor by which the distance to a periodic motion shrinks before the response is read, and the largest
/// number of periods for that.
const SHRUNK: f64 = 14.0;
const LONGEST: f64 = 2000.0;

/// Amplitude and powers, dimensionless: lengths over b, powers over `k b^2 omega0`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Response {
    /// Amplitude of the first harmonic of v.
    pub c: f64,
    /// Mean power that the impacts dissipate.
    pub impact_power: f64,
    /// Mean power that the damper dissipates.
    pub damper_power: f64,
}

impl Run {
    /// Follows the motion further, and reads its response over whole repetitions or, if nothing repeats, over 64 periods.
    ///
    /// # Errors
    /// As [`Run::new`].
    pub fn response(&mut self, point: &Point) -> Result<Response, InvalidValue> {
        let repeats = point.periods > 0;
        if let Some(exponent) = point.exponent.filter(|exponent| repeats && *exponent < 0.0) {
            self.follow(self.halves() / 2 + (-SHRUNK / exponent).min(LONGEST) as usize + 1)?;
        }
        let unit = if repeats { point.periods as usize } else { 1 };
        let periods = unit * AVERAGED.div_ceil(unit);
        let plant = &mut self.plant;
        let (omega, e) = (self.drive.omega, self.drive.amplitude);
        let damping = plant.parameters().damping;
        let phase = |n: usize| 2.0 * PI * n as f64 / STEPS as f64;
        let energy = |plant: &lovines::Plant, n: usize| plant.energy(e * phase(n).sin());
        let before = (energy(plant, 0), plant.totals().dissipated, plant.state().q1);
        let count = periods * STEPS;
        let (mut harmonic, mut work) = ([0.0; 2], 0.0);
        for n in 0..count {
            let (sin, cos) = phase(n).sin_cos();
            let (v, q1) = (plant.centre(), plant.state().q1);
            harmonic = [harmonic[0] + v * sin, harmonic[1] + v * cos];
            // Power of the base, (k (e - q1) + c (e' - q1')) e', with the jumps of q1' integrated by parts.
            let (slope, curvature) = (e * omega * cos, -e * omega * omega * sin);
            work += (e * sin - q1) * slope + damping * (slope * slope + q1 * curvature);
            plant.advance(self.drive, 2.0 * PI / (omega * STEPS as f64))?;
        }
        let duration = periods as f64 * 2.0 * PI / omega;
        let ends = damping * (plant.state().q1 - before.2) * e * omega * phase(0).cos();
        let impacts = (plant.totals().dissipated - before.1) / duration;
        let input = work / count as f64 - (ends + energy(plant, count) - before.0) / duration;
        Ok(Response {
            c: 2.0 * harmonic[0].hypot(harmonic[1]) / count as f64,
            impact_power: impacts,
            damper_power: input - impacts,
        })
    }
}
