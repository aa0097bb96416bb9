//! Control of the reference behind a shaker: the command that gives the force, or the displacement of the table, that the controller asks for.
//!
//! Near the natural frequency a structure with the impact force I has the response `z' = F + I - (s + d) z` in phasors, where `s = i (omega - omega0)`,
//! and a shaker makes of a command u the reference `F = K u - (r - d) z` ([`ShakerPath`]): the moving structure takes the force away. The command is
//! the inverse, `u = (F + (r - d) z)/K`, with the *measured* response z: an observer predicts z and I from the command, `z' = K u + I - (s + r) z` and
//! `I' = 0`, and corrects both by the reading. What is left of the error of the measured reference, by errors of K and r, is integrated.
//!
//! The reference that is read contradicts command and response where it differs from the one that they make by the path, `K u - (r - d) z`.

use std::f64::consts::{LN_2, PI, TAU};

use num_complex::Complex64;

use super::{Drive, RigError};
use vines_scene::knowledge::{Knowledge, Target};
use vines_scene::linear::LinearResponse;
use vines_scene::shaker_path::{BANDWIDTH, DETECTOR, OBSERVER, ODD_HARMONICS, SECOND, ShakerPath, rate_of};

/// Largest difference between both, as a share of what the command makes of a structure that does not move: of the reference, this share over the
/// drop-out, and at most all of it. An amplifier that clips at half of the command loses 0.39 of it, a broken stinger all.
const LOST_SHARE: f64 = 0.25;
/// Phase for which such a difference lasts, rad: in this time the control halves an error. Impacts and drive change the reference all the time while the
/// controller searches, where little of it is left.
pub(crate) const OFF: f64 = LN_2 / BANDWIDTH;

/// Offset and harmonics of a signal: an adaptive filter, as the controller's.
#[derive(Debug, Clone, Default)]
struct Detector {
    offset: f64,
    phasors: [Complex64; ODD_HARMONICS],
}

impl Detector {
    /// Takes a reading at a phase of the oscillator, which turns by `turn` from sample to sample, rad.
    fn take(&mut self, reading: f64, phase: f64, turn: f64, share: f64) {
        let sampled = (0.5 * (PI / turn + 1.0)) as usize;
        let (first, mut rotors) = (Complex64::cis(phase), [Complex64::ZERO; ODD_HARMONICS]);
        (0..sampled.min(ODD_HARMONICS)).fold(first, |rotor, n| {
            rotors[n] = rotor;
            rotor * first * first
        });
        let predicted: f64 = self.phasors.iter().zip(rotors).map(|(of, rotor)| (of * rotor).im).sum();
        let residual = reading - self.offset - predicted;
        self.offset += share * residual;
        for (n, (of, rotor)) in self.phasors.iter_mut().zip(rotors).enumerate() {
            let rate = rate_of(n);
            *of += 2.0 * rate * share * residual * Complex64::I * rotor.conj();
        }
    }
}

/// The control, and its state. Phasors are those of sines, relative to the controller's oscillator.
#[derive(Debug, Clone)]
pub(crate) struct ReferenceControl {
    path: ShakerPath,
    /// Its gain is the response over `z`, 1/s.
    linear: LinearResponse,
    target: Target,
    /// Time by which the readings are late, s.
    delay: f64,
    /// Phase of the controller's oscillator, and of the rig's, rad.
    phases: [f64; 2],
    /// What was asked for in the last sample, m.
    asked: f64,
    /// The error of the reference, and the response, scaled as readings are.
    error: Detector,
    response: Detector,
    /// What impacts add to the rate of the response, scaled as readings are, 1/s.
    impacts: Complex64,
    /// Correction of the reference, m.
    correction: Complex64,
    /// The last command, m.
    command: Complex64,
    /// The command that is needed, over the largest one.
    times: f64,
    /// Samples so far with the command at its limit.
    pub clipped: usize,
    /// Phase for which the command has been at its limit, and for which the reference has contradicted command and response, rad.
    limited: f64,
    contradicted: f64,
}

impl ReferenceControl {
    /// The control of a rig of which this is known, with readings that are late by `delay` seconds; `None` without a shaker.
    pub fn new(knowledge: &Knowledge, delay: f64) -> Option<Self> {
        Some(Self {
            path: knowledge.shaker?,
            linear: knowledge.linear,
            target: knowledge.target,
            delay,
            phases: [0.0; 2],
            asked: 0.0,
            error: Detector::default(),
            response: Detector::default(),
            impacts: Complex64::ZERO,
            correction: Complex64::ZERO,
            command: Complex64::ZERO,
            times: 0.0,
            clipped: 0,
            limited: 0.0,
            contradicted: 0.0,
        })
    }

    /// Takes the scaled readings of response and reference. Returns the command for the coming `step`, s, in which the controller asks for `drive`.
    ///
    /// # Errors
    /// A command at its limit, or a reference that contradicts command and response, for [`OFF`], or for longer under a slow control.
    pub fn command(&mut self, [response, reading]: [f64; 2], drive: Drive, step: f64) -> Result<Drive, RigError> {
        let Drive { omega, amplitude, .. } = drive;
        let [of_response, displacement] = [0, 1].map(|channel| self.target.displacement(channel, omega));
        let phase = self.phases[0] - self.delay * omega;
        let error = (self.asked / displacement * Complex64::cis(phase)).im - reading;
        // A reading that is no number is the controller's to refuse.
        if error.is_finite() && response.is_finite() {
            let rate = self.path.pole + Complex64::new(0.0, omega - self.linear.omega0);
            let driven = self.linear.gain * self.path.gain * self.command / of_response;
            self.response.phasors[0] += step * (driven + self.impacts - rate * self.response.phasors[0]);
            let predicted = self.response.phasors[0];
            let share = |bandwidth: f64| 1.0 - (-bandwidth * self.path.speed * self.linear.omega0 * step).exp();
            self.error.take(error, phase, omega * step, share(DETECTOR));
            self.response.take(response, phase, omega * step, share(OBSERVER));
            self.impacts +=
                SECOND * OBSERVER * self.path.speed * self.linear.omega0 * (self.response.phasors[0] - predicted);
        }
        let error = self.error.phasors[0] * displacement;
        let moved =
            (self.path.pole - self.linear.damping_rate) / self.linear.gain * self.response.phasors[0] * of_response;
        let [expected, read] = [self.path.gain * self.command - moved, self.asked - error];
        let largest = self.asked * (LOST_SHARE / self.path.drop_out()).min(1.0);
        let is_driven = self.asked > 0.0 && amplitude > 0.0;
        let longer = |phase: f64, is: bool| if is && is_driven { phase + omega * step } else { 0.0 };
        self.limited = longer(self.limited, self.times > 1.0);
        self.contradicted = longer(self.contradicted, (expected - read).norm() > largest);
        let longest = OFF / self.path.speed;
        if self.limited > longest {
            return Err(RigError::AmplifierLimit { times: self.times });
        }
        if self.contradicted > longest {
            let unit = self.target.unit(1);
            let [expected, read] =
                [expected, read].map(|value| self.target.quantity(1, (value / displacement).norm()).value);
            return Err(RigError::PathContradicted { expected, read, periods: longest / TAU, unit });
        }
        if amplitude == 0.0 {
            self.correction = Complex64::ZERO;
        } else if self.times <= 1.0 {
            self.correction += BANDWIDTH * self.path.speed * self.linear.omega0 * step * error;
        }
        let inverse = (amplitude + self.correction + moved) / self.path.gain;
        self.times = inverse.norm() / self.path.largest;
        self.command = if amplitude == 0.0 {
            Complex64::ZERO
        } else {
            inverse / self.times.max(1.0)
        };
        self.clipped += usize::from(amplitude > 0.0 && self.times > 1.0);
        self.asked = amplitude;
        Ok(self.drive(omega, step))
    }

    /// Amplitude of the last command, m.
    pub fn amplitude(&self) -> f64 {
        self.command.norm()
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
            is_held: false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn harmonics_ten_times_the_fundamental_are_not_in_what_a_detector_reads_of_it() {
        for (order, in_period) in [(7.0, 100.4), (21.0, 100.4), (29.0, 100.4), (7.0, 16.2)] {
            let (turn, mut detector) = (TAU / in_period, Detector::default());
            for n in 0..10_000 {
                let phase = f64::from(n) * turn;
                let reading = phase.sin() + 10.0 * (order * phase + 0.3).sin();
                detector.take(reading, phase, turn, DETECTOR * turn);
                // Until the slow ones have settled.
                let error = (detector.phasors[0] - 1.0).norm();
                assert!(n < 8_000 || error < 1e-3, "{order} of {in_period}: {error}");
            }
        }
    }
}
