//! From readings to a phase error, and how far to believe it.

use super::{PhaseLock, State};
use crate::angle::{Complex, wrap};
use crate::detector::Estimate;
use crate::signals::Input;
use crate::supervisor::Fault;

/// Larger readings are no displacements; below, nothing overflows.
const READING_MAX: f64 = 1e100;
/// A reference weaker than this share of the drive is not the base.
const REFERENCE_SHARE: f64 = 0.1;

/// What the detectors make of a sample.
pub(super) struct Sense {
    /// What is wrong with the readings.
    pub fault: Option<Fault>,
    /// Phase error, rad.
    pub error: f64,
    /// m
    pub reference_amplitude: f64,
    /// Whether the error can be believed.
    pub qualified: bool,
    /// Whether the reference is a sensor.
    pub measured: bool,
}

/// Where the phase is measured from.
struct Reference {
    phase: f64,
    amplitude: f64,
    qualified: bool,
}

impl PhaseLock {
    pub(super) fn sense(&self, state: &mut State, input: &Input, rotor: Complex) -> Sense {
        state.connected |= input.reference.is_some_and(|reading| reading != 0.0);
        let channel = input.reference.filter(|_| state.connected);
        let fault = self.fault(input.response, channel);
        // What cannot be believed does not reach the detectors: they keep what they knew.
        if fault != Some(Fault::Sensor) {
            self.detector
                .update(&mut state.response, input.response, rotor);
            if let Some(reading) = channel {
                self.detector.update(&mut state.reference, reading, rotor);
            }
        }
        let reference = if channel.is_some() {
            self.measured_reference(state)
        } else {
            self.own_reference(state)
        };
        let response = &state.response;
        let amplitude = response.amplitude();
        let measurable = amplitude > 0.0 && reference.amplitude > 0.0;
        let error = response.argument() - reference.phase - self.config.phase_target;
        Sense {
            fault,
            error: if measurable { wrap(error) } else { 0.0 },
            reference_amplitude: reference.amplitude,
            qualified: measurable
                && reference.qualified
                && amplitude >= self.config.lock.response_min * self.config.amplitude
                && self.is_coherent(response),
            measured: channel.is_some(),
        }
    }

    fn fault(&self, response: f64, reference: Option<f64>) -> Option<Fault> {
        let believable = |reading: f64| reading.abs() <= READING_MAX;
        let limit = self.config.response_max;
        if !believable(response) || !reference.is_none_or(believable) {
            Some(Fault::Sensor)
        } else if limit > 0.0 && response.abs() > limit {
            Some(Fault::ResponseTooLarge)
        } else {
            None
        }
    }

    fn measured_reference(&self, state: &State) -> Reference {
        let amplitude = state.reference.amplitude();
        Reference {
            phase: state.reference.argument(),
            amplitude,
            qualified: amplitude >= REFERENCE_SHARE * state.level.amplitude
                && self.is_coherent(&state.reference),
        }
    }

    /// The own oscillator as the sensor would see it, late by the stated delay.
    fn own_reference(&self, state: &State) -> Reference {
        Reference {
            phase: -state.frequency.omega * self.config.delay,
            amplitude: state.level.amplitude,
            qualified: true,
        }
    }

    fn is_coherent(&self, estimate: &Estimate) -> bool {
        estimate.coherence() >= self.config.lock.coherence_min
    }
}
