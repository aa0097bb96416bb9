//! The tracked backbone and its points.

use std::f64::consts::TAU;

use serde::Serialize;
use vines_model::numerics::Estimate;

use super::level::Found;
use crate::experiment::ExperimentError;
use crate::identification::{Regime, Tone};
use vines_model::Dimensionless;

/// A working point: response amplitude, m, drive amplitude, m, frequency, rad/s.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Known {
    pub response: f64,
    pub drive: f64,
    pub omega: f64,
}

/// A point as measured, in SI units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Held {
    /// Target level, m.
    pub level: f64,
    /// Amplitude of the fundamental of the response, m.
    pub response: Estimate,
    /// Base amplitude, m, and frequency, rad/s, at this response.
    pub drive: Estimate,
    pub omega: Estimate,
    /// Mean phase error, rad; of a peak, its phase less the phase target.
    pub phase_error: Estimate,
    /// As in [`Point`].
    pub periods: f64,
    pub averaged: usize,
    pub settled: bool,
    pub reached: bool,
    pub regime: Regime,
    pub regime_by_impacts: Option<Regime>,
    pub tone: Option<Tone>,
}

impl Held {
    /// Where it is, if it has values.
    pub fn known(&self) -> Option<Known> {
        let [response, drive, omega] = [self.response, self.drive, self.omega].map(|one| one.value);
        let is_known = drive.is_finite() && omega.is_finite();
        is_known.then_some(Known { response, drive, omega })
    }

    /// A level, m, by an estimate, of which nothing else is known yet.
    pub fn new(level: f64, found: &Found) -> Self {
        let [drive, omega] = found.at;
        Self {
            level,
            response: found.response,
            drive,
            omega,
            phase_error: found.phase_error,
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

/// One point of the backbone: as measured, in hertz and metres, and dimensionless with the parameters of the scene.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Point {
    /// Frequency, Hz.
    #[serde(rename = "f_Hz")]
    pub f_hz: f64,
    /// Amplitude of the fundamental of the response, m.
    #[serde(rename = "A_m")]
    pub a_m: f64,
    /// Base amplitude, m.
    #[serde(rename = "E_m")]
    pub e_m: f64,
    /// Standard uncertainty of the frequency at this amplitude, Hz.
    #[serde(rename = "u_f_Hz")]
    pub u_f_hz: f64,
    /// Standard uncertainty of the amplitude, m.
    #[serde(rename = "u_A_m")]
    pub u_a_m: f64,
    /// Standard uncertainty of the base amplitude at this amplitude, m.
    #[serde(rename = "u_E_m")]
    pub u_e_m: f64,
    /// Target level, over b.
    pub level: f64,
    /// Amplitude of the fundamental of the response, over b.
    #[serde(rename = "C")]
    pub c: f64,
    /// Detuning.
    pub sigma: f64,
    /// Base amplitude over `b epsilon`.
    #[serde(rename = "G")]
    pub g: f64,
    /// Mean phase error, degrees; of a peak, its phase less the phase target.
    pub phase_error_deg: f64,
    /// Standard uncertainty of C.
    #[serde(rename = "u_C")]
    pub u_c: f64,
    /// Standard uncertainty of sigma at this C.
    pub u_sigma: f64,
    /// Standard uncertainty of G at this C.
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
    /// The point with the parameters of a scene.
    pub(super) fn of(held: &Held, d: &Dimensionless) -> Self {
        let Held { response, drive, omega, phase_error, .. } = *held;
        Self {
            f_hz: omega.value / TAU,
            a_m: response.value,
            e_m: drive.value,
            u_f_hz: omega.uncertainty / TAU,
            u_a_m: response.uncertainty,
            u_e_m: drive.uncertainty,
            // The level as a person would write it.
            level: (1e9 * held.level / d.b).round() / 1e9,
            c: response.value / d.b,
            sigma: d.sigma(omega.value),
            g: d.excitation(drive.value),
            phase_error_deg: phase_error.value.to_degrees(),
            u_c: response.uncertainty / d.b,
            u_sigma: omega.uncertainty / d.omega_change(1.0),
            u_g: d.excitation(drive.uncertainty),
            u_phase_deg: phase_error.uncertainty.to_degrees(),
            periods: held.periods,
            averaged: held.averaged,
            settled: held.settled,
            reached: held.reached,
            regime: held.regime,
            regime_by_impacts: held.regime_by_impacts,
            tone: held.tone,
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
