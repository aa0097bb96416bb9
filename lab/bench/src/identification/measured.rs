//! A measured point of phase resonance.

use std::f64::consts::TAU;

use serde::Serialize;
use vines_model::numerics::Estimate;

use crate::scene::Dimensionless;

/// A point of phase resonance as measured, in hertz and metres, and dimensionless with the parameters of the scene.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Measured {
    /// Frequency, Hz.
    #[serde(rename = "f_Hz")]
    pub f_hz: f64,
    /// Amplitude of the fundamental of the response, m.
    #[serde(rename = "A_m")]
    pub a_m: f64,
    /// Base amplitude, m, measured if a sensor reads the base, otherwise commanded.
    #[serde(rename = "E_m")]
    pub e_m: f64,
    /// Standard uncertainty of the frequency, Hz.
    #[serde(rename = "u_f_Hz")]
    pub u_f_hz: f64,
    /// Standard uncertainty of the response, m.
    #[serde(rename = "u_A_m")]
    pub u_a_m: f64,
    /// Standard uncertainty of the base amplitude, m.
    #[serde(rename = "u_E_m")]
    pub u_e_m: f64,
    /// Detuning.
    pub sigma: f64,
    /// Amplitude of the fundamental of the response over b.
    #[serde(rename = "C")]
    pub c: f64,
    /// Base amplitude over `b epsilon`.
    #[serde(rename = "G")]
    pub g: f64,
    /// Phase of the response relative to the base, minus the target, degrees.
    pub phase_error_deg: f64,
    /// Standard uncertainty of sigma.
    pub u_sigma: f64,
    /// Standard uncertainty of C.
    #[serde(rename = "u_C")]
    pub u_c: f64,
    /// Standard uncertainty of G.
    #[serde(rename = "u_G")]
    pub u_g: f64,
    /// Standard uncertainty of the phase error, degrees.
    pub u_phase_deg: f64,
}

impl Measured {
    /// From the amplitude of the response, m, that of the base, m, the frequency, rad/s, and the phase error, rad.
    pub(crate) fn new([response, base, omega, phase_error]: [Estimate; 4], d: &Dimensionless) -> Self {
        Self {
            f_hz: omega.value / TAU,
            a_m: response.value,
            e_m: base.value,
            u_f_hz: omega.uncertainty / TAU,
            u_a_m: response.uncertainty,
            u_e_m: base.uncertainty,
            sigma: d.sigma(omega.value),
            c: response.value / d.b,
            g: d.excitation(base.value),
            phase_error_deg: phase_error.value.to_degrees(),
            u_sigma: omega.uncertainty / d.omega_change(1.0),
            u_c: response.uncertainty / d.b,
            u_g: d.excitation(base.uncertainty),
            u_phase_deg: phase_error.uncertainty.to_degrees(),
        }
    }
}
