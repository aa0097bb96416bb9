//! The tracked backbone and its points.

use serde::Serialize;

use super::level::Found;
use crate::experiment::ExperimentError;
use crate::identification::{Regime, Tone};
use vines_model::Dimensionless;

/// A working point: response amplitude, drive amplitude, detuning; dimensionless.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Known {
    pub c: f64,
    pub g: f64,
    pub sigma: f64,
}

/// One point of the backbone; dimensionless.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Point {
    /// Target level.
    pub level: f64,
    /// Amplitude of the fundamental of the response.
    #[serde(rename = "C")]
    pub c: f64,
    /// Detuning.
    pub sigma: f64,
    /// Base amplitude over `b epsilon`.
    #[serde(rename = "G")]
    pub g: f64,
    /// Mean phase error, degrees; of a peak, its phase less the phase target.
    pub phase_error_deg: f64,
    /// Standard uncertainties of C, and of sigma and G at this C.
    #[serde(rename = "u_C")]
    pub u_c: f64,
    /// See above.
    pub u_sigma: f64,
    /// See above.
    #[serde(rename = "u_G")]
    pub u_g: f64,
    /// Standard uncertainty of the phase error, degrees.
    pub u_phase_deg: f64,
    /// Periods of the move to this level and at this level.
    pub periods: f64,
    /// Periods averaged.
    pub averaged: usize,
    /// The motion was steady within these uncertainties, on the level, and neither irregular nor asymmetric; otherwise the point was taken at the
    /// time limit.
    pub settled: bool,
    /// The response reached the level; otherwise the drive was at a limit, or the time too short.
    pub reached: bool,
    /// The regime determined from the response alone, as on a real rig.
    pub regime: Regime,
    /// The regime determined from the impacts, if the rig is a simulation.
    pub regime_by_impacts: Option<Regime>,
    /// A tone in the response that is not part of the motion.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tone: Option<Tone>,
}

impl Point {
    /// Where it is, if it has values.
    pub(super) fn known(&self) -> Option<Known> {
        let is_known = self.g.is_finite() && self.sigma.is_finite();
        is_known.then_some(Known { c: self.c, g: self.g, sigma: self.sigma })
    }

    /// A level by an estimate, of which nothing else is known yet.
    pub(super) fn new(level: f64, found: &Found, d: &Dimensionless) -> Self {
        let [base, omega] = found.at;
        Self {
            level,
            c: found.response.value / d.b,
            sigma: d.sigma(omega.value),
            g: d.excitation(base.value),
            phase_error_deg: found.phase_error.value.to_degrees(),
            u_c: found.response.uncertainty / d.b,
            u_sigma: omega.uncertainty / d.omega_change(1.0),
            u_g: d.excitation(base.uncertainty),
            u_phase_deg: found.phase_error.uncertainty.to_degrees(),
            periods: 0.0,
            averaged: found.periods,
            settled: false,
            reached: false,
            regime: Regime::Unknown,
            regime_by_impacts: None,
            tone: None,
        }
    }
}

/// The tracked backbone.
#[derive(Debug)]
pub struct Tracked {
    /// The points, in the order in which they were taken.
    pub points: Vec<Point>,
    /// Periods from the start to the closed loop.
    pub periods_to_lock: f64,
    /// All periods, from the start to the last point.
    pub periods: f64,
    /// Why tracking ended before the last level; absent if it did not.
    pub ended: Option<ExperimentError>,
}
