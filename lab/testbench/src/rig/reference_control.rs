//! Control of the reference behind a shaker: the command that gives the force, or the displacement of the table, that the controller asks for.
//!
//! Near the natural frequency a shaker makes of a command u the reference `F = K (s + d)/(s + r) u`, where `s = i (omega - omega0)` ([`ShakerPath`]):
//! at the resonance, a force collapses to d/r of K u. The command is the inverse, `u = (F + (r - d) z)/K` with the response `z' = F - (s + d) z` of the
//! structure to the force, in phasors. What is left of the error of the measured reference, which harmonics and impacts make, is integrated.
//! The open loop is `k/s` times a low pass, whatever the shaker is.

use std::f64::consts::{PI, TAU};

use num_complex::Complex64;

use super::{Drive, RigError};
use crate::plan::{Knowledge, ShakerPath, Target};

/// Bandwidth of the detector of the error, over the natural frequency.
const DETECTOR: f64 = 0.3;
/// Bandwidth of the control, a quarter of the detector's: both roots of the loop are then equal, at half of the latter.
pub(crate) const BANDWIDTH: f64 = 0.25 * DETECTOR;
/// Harmonics of the detector. Impacts of one period are alternating impulses, with odd harmonics.
const HARMONICS: [f64; 3] = [1.0, 3.0, 5.0];

/// Error of the reference, over what the command makes on a structure that does not move, that is taken for a failure, and the phase for which it
/// lasts, rad. An amplifier that clips at half of the command loses 0.39 of the fundamental; beside a force that has collapsed, transients of the
/// shaker are several times the force.
const SHARE: f64 = 0.25;
const OFF: f64 = TAU;

/// The control, and its state. Phasors are those of sines, relative to the controller's oscillator.
#[derive(Debug, Clone)]
pub(crate) struct ReferenceControl {
    path: ShakerPath,
    omega0: f64,
    damping_rate: f64,
    target: Target,
    /// Phase of the controller's oscillator, and of the rig's, rad.
    phases: [f64; 2],
    /// What was asked for in the last sample, m.
    asked: f64,
    /// The error of the reference, scaled as readings are: offset and harmonics.
    offset: f64,
    error: [Complex64; HARMONICS.len()],
    /// Correction of the reference, m, and its response of the structure, m s.
    correction: Complex64,
    response: Complex64,
    /// The last command, m.
    command: Complex64,
    /// The command that is needed, over the largest one.
    times: f64,
    /// Phase for which the reference has been off, or the command at its limit, rad.
    off: f64,
}

impl ReferenceControl {
    /// The control of a rig of which this is known; `None` without a shaker.
    pub fn new(knowledge: &Knowledge) -> Option<Self> {
        Some(Self {
            path: knowledge.shaker()?,
            omega0: knowledge.linear.omega0,
            damping_rate: knowledge.linear.damping_rate,
            target: knowledge.target,
            phases: [0.0; 2],
            asked: 0.0,
            offset: 0.0,
            error: [Complex64::ZERO; HARMONICS.len()],
            correction: Complex64::ZERO,
            response: Complex64::ZERO,
            command: Complex64::ZERO,
            times: 0.0,
            off: 0.0,
        })
    }

    /// Takes the scaled reading of the reference. Returns the command for the coming `step`, s, in which the controller asks for `drive`.
    ///
    /// # Errors
    /// A reference that has not followed for a period.
    pub fn command(&mut self, reading: f64, drive: Drive, step: f64) -> Result<Drive, RigError> {
        let Drive { omega, amplitude, .. } = drive;
        let displacement = self.target.displacement(1, omega);
        let rotor = Complex64::cis(self.phases[0]);
        let error = (self.asked / displacement * rotor).im - reading;
        // A reading that is no number is the controller's to refuse.
        if error.is_finite() {
            self.detect(error, 1.0 - (-DETECTOR * self.omega0 * step).exp());
        }
        let detuned = Complex64::new(self.damping_rate, omega - self.omega0);
        let error = self.error[0] * displacement;
        let largest = SHARE * (self.path.gain * self.command).norm();
        let is_off = self.asked > 0.0 && amplitude > 0.0 && (error.norm() > largest || self.times > 1.0);
        self.off = if is_off { self.off + omega * step } else { 0.0 };
        if self.off > OFF && self.times > 1.0 {
            return Err(RigError::AmplifierLimit { times: self.times });
        }
        if self.off > OFF {
            let unit = ["m", "N"][usize::from(self.path.by_force)];
            let [asked, error] = [self.asked, error.norm()].map(|value| value / self.path.base_per_reference);
            return Err(RigError::ReferenceOff { asked, error, unit });
        }
        if amplitude == 0.0 {
            (self.correction, self.response) = (Complex64::ZERO, Complex64::ZERO);
        } else if self.times <= 1.0 {
            self.correction += BANDWIDTH * self.omega0 * step * error;
        }
        let reference = amplitude + self.correction;
        self.response += step * (reference - detuned * self.response);
        let inverse = (reference + (self.path.pole - self.damping_rate) * self.response) / self.path.gain;
        self.times = inverse.norm() / self.path.largest;
        self.command = if amplitude == 0.0 {
            Complex64::ZERO
        } else {
            inverse / self.times.max(1.0)
        };
        self.asked = amplitude;
        Ok(self.drive(omega, step))
    }

    /// The detector: an adaptive filter for offset and harmonics, as the controller's.
    fn detect(&mut self, error: f64, share: f64) {
        let rotors = HARMONICS.map(|order| Complex64::cis(order * self.phases[0]));
        let predicted: f64 = self.error.iter().zip(rotors).map(|(of, rotor)| (of * rotor).im).sum();
        let residual = error - self.offset - predicted;
        self.offset += share * residual;
        for (of, rotor) in self.error.iter_mut().zip(rotors) {
            *of += 2.0 * share * residual * Complex64::I * rotor.conj();
        }
    }

    /// The command as a sine of the rig's oscillator, whose phase changes by its frequency only: at most to twice, at least to half of `omega`.
    fn drive(&mut self, omega: f64, step: f64) -> Drive {
        let [phase, of_rig] = self.phases;
        let angle = if self.command == Complex64::ZERO {
            -self.path.gain.arg()
        } else {
            self.command.arg()
        };
        let ahead = (phase + angle - of_rig + PI).rem_euclid(TAU) - PI;
        let turn = (omega * step + ahead).clamp(0.5 * omega * step, 2.0 * omega * step);
        let amplitude = self.command.norm();
        self.phases = [phase + omega * step, of_rig + turn].map(|phase| phase % TAU);
        Drive {
            omega: turn / step,
            amplitude,
            displacement: amplitude * of_rig.sin(),
        }
    }
}
