//! What the check of a loop measures, beside what the scene says.

use std::f64::consts::TAU;

use num_complex::Complex64;
use serde::Serialize;
use vines_model::numerics::SIGNIFICANT;

use super::{Linear, Verdict};
use crate::scene::{LinearResponse, Scene};

/// Largest relative error of a factor: amplitudes and drives that are measured later have the same.
const FACTOR: f64 = 0.05;
/// Largest phase of the response relative to the base that is not explained, degrees. On the default scene 1 degree shifts sigma by 0.026.
const PHASE: f64 = 1.0;
/// Largest relative difference of the clocks: frequencies in hertz that are measured later have the same.
const CLOCK: f64 = 1e-3;
/// Relative differences of natural frequency and damping below which nothing is said, whatever the uncertainty.
const NOTED: [f64; 2] = [1e-4, 0.02];

/// A measured quantity.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Quantity {
    /// What it is.
    pub name: &'static str,
    /// Its unit; empty for a pure number.
    pub unit: &'static str,
    /// As measured.
    pub measured: f64,
    /// Standard uncertainty.
    pub uncertainty: f64,
    /// As the scene says.
    pub expected: f64,
    /// Largest difference beyond the uncertainty.
    pub tolerance: f64,
    /// What a larger difference means; absent where the measured value replaces the scene's.
    pub verdict: Option<Verdict>,
}

impl Quantity {
    /// Whether it differs from the scene.
    pub fn differs(&self) -> bool {
        let difference = (self.measured - self.expected).abs();
        difference > self.tolerance + SIGNIFICANT * self.uncertainty
    }

    /// What its difference means, where a measurement after it would be wrong.
    pub(super) fn refusal(&self) -> Option<Verdict> {
        self.verdict.filter(|_| self.differs())
    }
}

/// Natural frequency, damping, and the response relative to that of such an oscillator (`ratio`).
pub(super) fn measured(linear: &Linear, ratio: Complex64, scene: &Scene) -> Vec<Quantity> {
    let stated = LinearResponse::of(scene);
    let u = linear.u_damping_rate;
    let replaced = |name, unit, [measured, uncertainty, expected]: [f64; 3], noted: f64| Quantity {
        name,
        unit,
        measured,
        uncertainty,
        expected,
        tolerance: noted * expected,
        verdict: None,
    };
    let hertz = [linear.omega_0, u, stated.omega0].map(|omega| omega / TAU);
    let late = if ratio.arg() > 0.0 {
        Verdict::BaseLate
    } else {
        Verdict::ResponseLate
    };
    vec![
        replaced("natural frequency", "Hz", hertz, NOTED[0]),
        replaced(
            "damping rate",
            "1/s",
            [linear.damping_rate, u, stated.damping_rate],
            NOTED[1],
        ),
        Quantity {
            name: "phase of the response to the base, less the expected one",
            unit: "degrees",
            measured: ratio.arg().to_degrees(),
            uncertainty: linear.u_gain.to_degrees(),
            expected: 0.0,
            tolerance: PHASE,
            verdict: Some(late),
        },
        factor(
            "response over base, over the expected one",
            ratio.norm(),
            linear.u_gain,
            Verdict::ResponseGain,
            FACTOR,
        ),
    ]
}

/// Amplitude of the base, whose phasor, m, and its relative uncertainty are given, over that of the drive, and its frequency from its
/// phasors, period by period.
pub(super) fn of_base(
    (phasor, u): (Complex64, f64),
    drive: f64,
    periods: &[Complex64],
    scene: &Scene,
) -> [Quantity; 2] {
    // A delay may shift the beginning by some periods.
    let last = &periods[periods.len() / 2..];
    let turned: Complex64 = last.windows(2).map(|pair| pair[0].conj() * pair[1]).sum();
    let ratio = phasor.norm() / drive;
    // A controlled base needs no known shaker.
    let controlled = scene.controller_config().base_bandwidth.is_some();
    let tolerance = if controlled { super::verdict::GAIN - 1.0 } else { FACTOR };
    // The phases of a window's ends.
    let u_clock = u * (periods.len() as f64).sqrt() / (TAU * (last.len() as f64 - 1.0));
    [
        factor(
            "frequency of the base over that of the drive",
            1.0 + turned.arg() / TAU,
            u_clock,
            Verdict::Clock,
            CLOCK,
        ),
        factor("base over drive", ratio, u * ratio, Verdict::BaseGain, tolerance),
    ]
}

fn factor(name: &'static str, measured: f64, uncertainty: f64, verdict: Verdict, tolerance: f64) -> Quantity {
    Quantity {
        name,
        unit: "",
        measured,
        uncertainty,
        expected: 1.0,
        tolerance,
        verdict: Some(verdict),
    }
}
