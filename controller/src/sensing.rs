//! The measurements of a sample: phase error, amplitudes, and whether they are valid.

use crate::balance::{Balance, GROWING, Powers};
use crate::channel::{Channel, ChannelState, longer};
use crate::config::Config;
use crate::drive::PresentDrive;
use crate::oscillator::Complex;
use crate::real::consts::TAU;
use crate::real::{self, Real, larger};
use crate::signals::Input;
use crate::supervisor::Fault;

/// Coefficients of the measurement.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Sensing {
    channel: Channel,
    /// `exp(-i phase_target)`
    target: Complex,
    /// Time in the closed loop before the response can be predicted, s.
    warm_up: Real,
    /// Share of its error that the detector corrects per sample.
    detector_step: Real,
}

/// State of the measurement.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Channels {
    /// Channel of the response.
    pub response: ChannelState,
    base: ChannelState,
    balance: Balance,
    /// The drive with the lag of the detector, m.
    drive: Real,
    /// Time in the closed loop, s.
    closed: Real,
    /// Time since the loop was closed or the measurement was last valid, s.
    invalid: Real,
    /// Whether the measurement has been valid since the loop was closed.
    measured: bool,
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

impl Sensing {
    /// The coefficients of a configuration.
    pub fn new(config: &Config) -> Self {
        Self {
            channel: Channel::new(config),
            target: Complex::unit(-config.phase_target),
            // A transient of the detector has decayed to exp(-2 pi), 0.2 %.
            warm_up: larger(TAU / config.bandwidth, GROWING * TAU / config.omega_start),
            detector_step: config.step(config.bandwidth),
        }
    }

    /// Updates both channels with a sample.
    pub fn measure(&self, config: &Config, state: &mut Channels, input: &Input, drive: PresentDrive) -> Measurement {
        let base = input.reference.filter(|_| config.reference_connected);
        let fault = Self::fault(config, input.response, base);
        let turn = drive.omega * config.sample_time;
        // The detectors ignore an invalid reading and keep their estimates.
        if fault != Some(Fault::Sensor) {
            let rotors = self.channel.rotors(drive.rotor);
            // The base follows the drive at once; the response grows, and its detector lags.
            let is_known = state.closed > self.warm_up;
            let change = if state.drive > 0.0 {
                drive.amplitude / state.drive
            } else {
                1.0
            };
            (self.channel).take(
                &mut state.response,
                input.response,
                &rotors,
                turn,
                is_known.then_some(1.0),
            );
            if let Some(reading) = base {
                self.channel.take(&mut state.base, reading, &rotors, turn, Some(change));
            }
            state.drive += self.detector_step * (drive.amplitude - state.drive);
        }
        let (reference, reference_amplitude) = if base.is_some() {
            (state.base.estimate.fundamental(), state.base.estimate.amplitude)
        } else {
            // The internal oscillator as a sensor would read it, with the configured delay. A sine lags a cosine by pi/2.
            let Complex { re, im } = Complex::unit(-drive.omega * config.delay);
            (
                Complex { re: drive.amplitude * im, im: -drive.amplitude * re },
                drive.amplitude,
            )
        };
        let response = &state.response.estimate;
        let amplitude = response.amplitude;
        // One function of an angle instead of three: the response in the frame of the reference, turned back by the target.
        let size = amplitude * reference_amplitude;
        let measurable = size >= Real::MIN_POSITIVE;
        let relative = response.fundamental().times(reference.conjugate()).times(self.target);
        let (error, cosine) = if measurable {
            (relative.argument(), relative.re / size)
        } else {
            (0.0, 1.0)
        };
        let is_large = amplitude >= config.lock.response_min * config.amplitude;
        let is_coherent = response.is_coherent(config.lock.coherence_min)
            && (base.is_none() || state.base.estimate.is_coherent(config.lock.coherence_min));
        let powers = Powers {
            reading: if fault == Some(Fault::Sensor) {
                0.0
            } else {
                input.response
            },
            turn,
            drive: drive.amplitude,
            lagging: state.drive,
            base: if base.is_some() {
                reference_amplitude
            } else {
                state.drive
            },
            response: amplitude,
            cosine: if is_large { cosine } else { 1.0 },
        };
        let contradicts = state.balance.contradicts(config, &powers) && config.residual_max.is_some();
        let reason = if state.measured {
            Fault::Implausible
        } else {
            Fault::NoSignal
        };
        Measurement {
            fault: fault.or(contradicts.then_some(reason)),
            error,
            measurable,
            reference_amplitude,
            valid: measurable && is_large && is_coherent,
            has_sensor: base.is_some(),
        }
    }

    /// Watches the signals while the loop is closed: a sensor that has stopped, or a response that cannot be measured.
    pub fn watch(&self, config: &Config, state: &mut Channels, measured: &Measurement) -> Option<Fault> {
        state.measured |= measured.valid;
        state.closed += config.sample_time;
        state.invalid = longer(state.invalid, config.sample_time, !measured.valid);
        let has_sensor = measured.has_sensor;
        if state.measured && (state.response.has_stopped() || has_sensor && state.base.has_stopped()) {
            Some(Fault::Sensor)
        } else if state.measured && (state.response.is_implausible || has_sensor && state.base.is_implausible) {
            Some(Fault::Implausible)
        } else if config.signal_timeout.is_some_and(|limit| state.invalid > limit) {
            Some(Fault::NoSignal)
        } else {
            None
        }
    }

    /// Ends the watch when the loop opens.
    pub fn stop_watching(&self, state: &mut Channels) {
        (state.invalid, state.closed, state.measured) = (0.0, 0.0, false);
    }

    fn fault(config: &Config, response: Real, reference: Option<Real>) -> Option<Fault> {
        let is_valid = |reading: Real| reading.abs() <= real::READING_MAX;
        if !is_valid(response) || !reference.is_none_or(is_valid) {
            Some(Fault::Sensor)
        } else if config.response_max.is_some_and(|limit| response.abs() > limit) {
            Some(Fault::ResponseTooLarge)
        } else {
            None
        }
    }
}
