//! The `[controller]` section: the phase-locked loop.

use std::f64::consts::TAU;

use phase_lock::Config;
use serde::{Deserialize, Serialize};

use super::option::option;
use super::{SceneError, validate::Quantity};

/// Settings of the phase-locked loop, relative to the natural frequency so that they suit any plant.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Controller {
    /// Samples per natural period `2 pi/omega0`.
    pub samples_per_period: f64,
    /// Bandwidth of the phase detector, in units of omega0: the only tuning parameter; the gains of the loop follow from it.
    pub bandwidth: f64,
    /// Frequency at the start, in units of omega0.
    pub omega_start: f64,
    /// Lowest frequency allowed, in units of omega0.
    pub omega_min: f64,
    /// Highest frequency allowed, in units of omega0.
    pub omega_max: f64,
    /// Phase of the response relative to the base, degrees.
    pub phase_target: f64,
    /// Largest phase error that counts as locked, degrees.
    pub phase_tolerance: f64,
    /// Distance from the steady state that counts as settled: of the frequency, over the half-power bandwidth of the linear response, and of
    /// the response amplitude, relative. Judged by the drift and the rate at which the steady state is approached; noise widens it.
    pub frequency_tolerance: f64,
    /// As `frequency_tolerance`, for the amplitude.
    pub amplitude_tolerance: f64,
    /// How long all of this must hold, periods.
    pub dwell_periods: u32,
    /// Largest drive allowed, base amplitude over `b epsilon`; by default four times the larger of the requested drive and that at which
    /// impacts begin.
    #[serde(rename = "G_max")]
    pub g_max: Option<f64>,
    /// The same in m.
    #[serde(rename = "E_max", skip_serializing_if = "Option::is_none")]
    pub e_max: Option<f64>,
    /// Response above which the drive is shut down, over b.
    #[serde(rename = "C_max", deserialize_with = "option")]
    pub c_max: Option<f64>,
    /// Duration of the ramp of the drive to its amplitude, and to zero after a fault, natural periods; 0 to jump. By default the
    /// amplitude changes as fast as a base with the largest one moves.
    pub ramp_periods: Option<f64>,
    /// Duration of the ramp of the drive to zero at the release, natural periods; 0 to switch off at once.
    pub release_periods: f64,
    /// Delay of the rig from the drive to the sensors, samples, in addition to that of `[chain]`; used where no sensor reads the base.
    pub delay: f64,
}

impl Default for Controller {
    fn default() -> Self {
        Self {
            samples_per_period: 100.0,
            bandwidth: 0.1,
            omega_start: 1.0,
            omega_min: 0.9,
            omega_max: 1.1,
            phase_target: -90.0,
            phase_tolerance: 0.3,
            frequency_tolerance: 2e-4,
            amplitude_tolerance: 8e-5,
            dwell_periods: 20,
            g_max: None,
            e_max: None,
            c_max: Some(4.0),
            ramp_periods: None,
            release_periods: 0.0,
            delay: 0.0,
        }
    }
}

impl Controller {
    /// The phase target in radians.
    pub fn phase_target_radians(&self) -> f64 {
        self.phase_target.to_radians()
    }

    /// Whether the target is phase resonance, for which theory and exact orbits hold.
    pub fn is_at_phase_resonance(&self) -> bool {
        self.phase_target == -90.0
    }

    /// The detector at the natural frequency omega0 = 1.
    fn detector(&self) -> Config {
        Config {
            sample_time: TAU / self.samples_per_period,
            ..Config::for_resonance(1.0, 0.0)
        }
    }

    /// Largest bandwidth of the detector at this number of samples per period, in units of omega0.
    pub(super) fn bandwidth_max(&self) -> f64 {
        self.detector().bandwidth_max()
    }

    pub(super) fn check(&self) -> Result<(), SceneError> {
        self.check_limits()?;
        let samples = self.samples_per_period;
        let highest = self.detector().highest_harmonic();
        let fewest = (2.0 * highest as f64 * self.omega_max).floor() + 1.0;
        Quantity::new("controller.samples_per_period", samples, "(samples)").check(
            (fewest..=1e5).contains(&samples),
            format!("must be from {fewest} (two per period of harmonic {highest} at omega_max) to 100000"),
        )?;
        let widest = self.bandwidth_max();
        Quantity::new("controller.bandwidth", self.bandwidth, "(omega0)").check(
            self.bandwidth > 0.0 && self.bandwidth <= widest,
            format!("must be above 0 and at most {widest:.3} with {samples} samples per period"),
        )?;
        let (low, high, start) = (self.omega_min, self.omega_max, self.omega_start);
        Quantity::new("controller.omega_min", low, "(omega0)").positive()?;
        Quantity::new("controller.omega_max", high, "(omega0)")
            .check(high > low, format!("must be above omega_min = {low}"))?;
        Quantity::new("controller.omega_start", start, "(omega0)").check(
            (low..=high).contains(&start),
            format!("must lie between omega_min = {low} and omega_max = {high}"),
        )?;
        let target = self.phase_target;
        Quantity::new("controller.phase_target", target, "degrees")
            .check(target.abs() <= 180.0, "must lie between -180 and 180 degrees")?;
        for (key, value, unit) in [
            ("controller.phase_tolerance", self.phase_tolerance, "degrees"),
            (
                "controller.frequency_tolerance",
                self.frequency_tolerance,
                "(bandwidths)",
            ),
            ("controller.amplitude_tolerance", self.amplitude_tolerance, "(relative)"),
        ] {
            Quantity::new(key, value, unit).positive()?;
        }
        let dwell = self.dwell_periods;
        Quantity::new("controller.dwell_periods", dwell.into(), "(periods)")
            .check((4..=400).contains(&dwell), "must be from 4 to 400")
    }

    fn check_limits(&self) -> Result<(), SceneError> {
        let periods = "(natural periods)";
        let ramp = self.ramp_periods.unwrap_or(0.0);
        for (key, value, unit) in [
            ("controller.ramp_periods", ramp, periods),
            ("controller.release_periods", self.release_periods, periods),
            ("controller.delay", self.delay, "samples"),
        ] {
            Quantity::new(key, value, unit).not_negative()?;
        }
        let given = |option: Option<f64>| option.unwrap_or(1.0);
        for (key, value, unit) in [
            ("controller.G_max", given(self.g_max), "(over b epsilon)"),
            ("controller.E_max", given(self.e_max), "m"),
            ("controller.C_max", given(self.c_max), "(over b)"),
        ] {
            Quantity::new(key, value, unit).positive()?;
        }
        Ok(())
    }
}
