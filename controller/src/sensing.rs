//! The measurements of a sample: phase error, amplitudes, and whether they are valid.

use crate::balance::Powers;
use crate::config::Config;
use crate::detector::{Estimate, PhaseDetector};
use crate::drive::PresentDrive;
use crate::oscillator::Complex;
use crate::plausibility::{Differences, PAUSE, Plausibility};
use crate::real::{self, Real};
use crate::signals::Input;
use crate::supervisor::Fault;

/// Coefficients of the measurement.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Sensing {
    detector: PhaseDetector,
    /// `exp(-i phase_target)`
    target: Complex,
    /// s
    delay: Real,
    /// m
    response_max: Option<Real>,
    /// Smallest valid response amplitude, m.
    response_min: Real,
    coherence_min: Real,
    /// Whether a sensor measures the base.
    has_reference: bool,
    /// s
    sample_time: Real,
    /// Longest time without a valid response, s.
    signal_timeout: Option<Real>,
    plausibility: Plausibility,
    /// Share of its error that the detector corrects per sample.
    detector_step: Real,
}

/// State of both channels.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Channels {
    /// Estimate of the response.
    pub response: Estimate,
    reference: Estimate,
    /// The drive with the lag of the detector, m.
    drive: Real,
    differences: Differences,
    /// The last reading of each channel, m, and the time for which it has not changed, s.
    last: [Real; 2],
    unchanged: [Real; 2],
    /// Time in the closed loop, s.
    closed: Real,
    /// Time since the loop was closed or the measurement was last valid, s.
    invalid: Real,
    /// Whether the measurement has been valid since the loop was closed.
    seen: bool,
}

/// Measurements of a sample.
#[derive(Clone, Copy, Debug)]
pub struct Measurement {
    /// Fault of the readings.
    pub fault: Option<Fault>,
    /// Phase error, rad, in [-pi, pi]; 0 if it cannot be measured.
    pub error: Real,
    /// Whether both amplitudes are above 0.
    pub measurable: bool,
    /// m
    pub reference_amplitude: Real,
    /// Whether the error is valid.
    pub valid: bool,
    /// Whether the reference is a sensor.
    pub has_sensor: bool,
}

/// The reference of the phase.
struct Reference {
    /// Coefficient of its fundamental, m.
    fundamental: Complex,
    /// m
    amplitude: Real,
    valid: bool,
}

impl Sensing {
    /// The coefficients of a configuration.
    pub fn new(config: &Config) -> Self {
        Self {
            detector: PhaseDetector::new(config),
            target: Complex::unit(-config.phase_target),
            delay: config.delay,
            response_max: config.response_max,
            response_min: config.lock.response_min * config.amplitude,
            coherence_min: config.lock.coherence_min,
            has_reference: config.reference_connected,
            sample_time: config.sample_time,
            signal_timeout: config.signal_timeout,
            plausibility: Plausibility::new(config),
            detector_step: config.step(config.bandwidth),
        }
    }

    /// Updates both channels with a sample.
    pub fn measure(&self, state: &mut Channels, input: &Input, drive: PresentDrive) -> Measurement {
        let channel = input.reference.filter(|_| self.has_reference);
        let fault = self.fault(input.response, channel);
        // Without a sensor on the base nothing is expected to change.
        let readings = [input.response, channel.unwrap_or(Real::NAN)];
        for (n, reading) in readings.into_iter().enumerate() {
            state.unchanged[n] = self.longer(state.unchanged[n], reading == state.last[n]);
        }
        state.last = readings;
        // The detectors ignore an invalid reading and keep their estimates.
        if fault != Some(Fault::Sensor) {
            self.predict(state, input.response, channel, drive);
        }
        let reference = if channel.is_some() {
            self.measured_reference(&state.reference)
        } else {
            self.internal_reference(drive)
        };
        let response = &state.response;
        let amplitude = response.amplitude;
        // One function of an angle instead of three: the response in the frame of the reference, turned back by the target.
        let size = amplitude * reference.amplitude;
        let measurable = size >= Real::MIN_POSITIVE;
        let relative = (response.fundamental())
            .times(reference.fundamental.conjugate())
            .times(self.target);
        let (error, cosine) = if measurable {
            (relative.argument(), relative.re / size)
        } else {
            (0.0, 1.0)
        };
        let valid = measurable && reference.valid && amplitude >= self.response_min && self.is_coherent(response);
        let seen = Powers {
            reading: if fault == Some(Fault::Sensor) {
                0.0
            } else {
                input.response
            },
            turn: drive.omega * self.sample_time,
            drive: drive.amplitude,
            lagging: state.drive,
            base: if channel.is_some() {
                reference.amplitude
            } else {
                state.drive
            },
            response: amplitude,
            cosine: if amplitude >= self.response_min { cosine } else { 1.0 },
        };
        let contradicts = self.plausibility.contradicts(&mut state.differences, &seen);
        let reason = if state.seen {
            Fault::Implausible
        } else {
            Fault::NoSignal
        };
        Measurement {
            fault: fault.or(contradicts.then_some(reason)),
            error,
            measurable,
            reference_amplitude: reference.amplitude,
            valid,
            has_sensor: channel.is_some(),
        }
    }

    /// Watches the signals while the loop is closed: a sensor that has stopped, or a response that cannot be measured.
    pub fn watch(&self, state: &mut Channels, measured: &Measurement, omega: Real) -> Option<Fault> {
        state.seen |= measured.valid;
        state.closed += self.sample_time;
        state.invalid = self.longer(state.invalid, !measured.valid);
        if state.seen && state.unchanged.iter().any(|time| time * omega > 2.0 * PAUSE) {
            Some(Fault::Sensor)
        } else if state.seen && self.plausibility.refuses(&state.differences) {
            Some(Fault::Implausible)
        } else if self.signal_timeout.is_some_and(|limit| state.invalid > limit) {
            Some(Fault::NoSignal)
        } else {
            None
        }
    }

    /// Ends the watch when the loop opens.
    pub fn stop_watching(&self, state: &mut Channels) {
        (state.invalid, state.closed, state.seen) = (0.0, 0.0, false);
    }

    /// Updates the detectors, and compares the readings with what they predicted.
    fn predict(&self, state: &mut Channels, response: Real, reference: Option<Real>, drive: PresentDrive) {
        let rotors = self.detector.rotors(drive.rotor);
        let before = [state.response, state.reference];
        let difference = self.detector.update(&mut state.response, response, &rotors);
        let (mut differences, mut change) = ([difference, 0.0], 1.0);
        if let Some(reading) = reference {
            let predicted = reading - self.detector.update(&mut state.reference, reading, &rotors);
            // The base follows the drive at once, the detector does not.
            change = if state.drive > 0.0 {
                drive.amplitude / state.drive
            } else {
                1.0
            };
            differences[1] = reading - change * predicted;
        }
        state.drive += self.detector_step * (drive.amplitude - state.drive);
        let seen = [
            (differences[0], &state.response, 1.0),
            (differences[1], &state.reference, change),
        ];
        self.plausibility.take(
            &mut state.differences,
            seen,
            state.unchanged,
            drive,
            self.sample_time,
            state.closed,
        );
        // The detectors ignore a glitch.
        let [of_response, of_base] = self.plausibility.glitches(&state.differences);
        if of_response {
            state.response = before[0];
        }
        if of_base {
            state.reference = before[1];
        }
    }

    /// A time, s, after one more sample of a condition.
    fn longer(&self, time: Real, condition: bool) -> Real {
        if condition { time + self.sample_time } else { 0.0 }
    }

    fn fault(&self, response: Real, reference: Option<Real>) -> Option<Fault> {
        let is_valid = |reading: Real| reading.abs() <= real::READING_MAX;
        if !is_valid(response) || !reference.is_none_or(is_valid) {
            Some(Fault::Sensor)
        } else if self.response_max.is_some_and(|limit| response.abs() > limit) {
            Some(Fault::ResponseTooLarge)
        } else {
            None
        }
    }

    fn measured_reference(&self, estimate: &Estimate) -> Reference {
        let amplitude = estimate.amplitude;
        Reference {
            fundamental: estimate.fundamental(),
            amplitude,
            valid: self.is_coherent(estimate),
        }
    }

    /// The internal oscillator as a sensor would read it, with the configured delay.
    fn internal_reference(&self, drive: PresentDrive) -> Reference {
        let Complex { re, im } = Complex::unit(-drive.omega * self.delay);
        Reference {
            // A sine lags a cosine by pi/2.
            fundamental: Complex { re: drive.amplitude * im, im: -drive.amplitude * re },
            amplitude: drive.amplitude,
            valid: true,
        }
    }

    fn is_coherent(&self, estimate: &Estimate) -> bool {
        estimate.is_coherent(self.coherence_min)
    }
}
