//! The measurements of a sample: phase error, amplitudes, and whether they are valid and plausible. A reading that differs from the detector's
//! prediction by far more than the readings of the last periods shows that a sensor, the drive or the clock has failed, often within a few
//! samples.

use crate::balance::{Balance, GROWING, Powers};
use crate::config::Config;
use crate::detector::{PhaseDetector, Rotors, Signal};
use crate::drive::PresentDrive;
use crate::oscillator::Complex;
use crate::real::consts::TAU;
use crate::real::{self, Real, larger, smaller};
use crate::signals::Input;
use crate::supervisor::Fault;

/// Phase, rad, after which a reading that has not changed is no gap of a connection, and within which a second implausible reading is no glitch.
/// In twice this phase, a signal of more than eight steps of its converter changes.
const PAUSE: Real = TAU / 12.0;
/// Differences that count as normal, in units of the largest one of a period: noise of twice the size is too rare.
const NORMAL: Real = 2.0;
/// Sum of the amplitudes of all harmonics above the fundamental, as a share of the limit, above which a sensor saturates: clipping at half of
/// the amplitude makes 0.27 of the fundamental.
const DISTORTION: Real = 0.5;
/// Phase, rad, for which this distortion must last: the first impacts and a change of the drive disturb the harmonics for two or three periods.
const LASTS: Real = 5.0 * TAU;

/// A channel: the estimate of its signal, and the differences between its readings and their predictions.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Channel {
    /// The signal, as estimated.
    pub estimate: Signal,
    /// Whether the last reading is one of several implausible ones.
    is_implausible: bool,
    /// The last reading, m, and the phase for which it has not changed, rad.
    last: Real,
    unchanged: Real,
    /// Largest differences between readings and predictions in this period and in the two before it, m.
    largest: [Real; 3],
    /// Phase since the start of the period, since the last implausible reading, and for which the signal has been distorted, rad.
    phase: Real,
    since: Real,
    distorted: Real,
}

impl Channel {
    /// Whether the sensor has stopped.
    fn has_stopped(&self) -> bool {
        self.unchanged > 2.0 * PAUSE
    }

    /// Takes a reading, m, after a turn of the oscillator, rad. `limits`: `residual_max`; the largest difference that the signal may make, m; and the
    /// largest that a derivative shows of a change of the drive, m: such a reading says nothing of the signal. `change`: factor by which the drive
    /// has changed and the detector has still to learn; `None`: the signal is not known yet.
    fn take(
        &mut self,
        detector: &PhaseDetector,
        limits: Option<[Real; 3]>,
        reading: Real,
        rotors: &Rotors,
        turn: Real,
        change: Option<Real>,
    ) {
        let before = self.estimate;
        let residual = detector.update(&mut self.estimate, reading, rotors);
        let factor = change.unwrap_or(1.0);
        let difference = (reading - factor * (reading - residual)).abs();
        self.unchanged = longer(self.unchanged, turn, reading == self.last);
        self.last = reading;
        self.phase += turn;
        if self.phase >= TAU {
            self.phase = 0.0;
            self.largest.rotate_right(1);
            self.largest[0] = 0.0;
        }
        self.since += turn;
        self.is_implausible = false;
        let [now, last, earlier] = self.largest;
        if let Some([limit, own, shown]) = limits {
            let (amplitude, lag) = (self.estimate.amplitude, (factor - 1.0).abs());
            let is_alive = self.unchanged <= PAUSE;
            let moves = if is_alive {
                limit * factor * amplitude + own
            } else {
                0.0
            };
            // A fault may have begun at the end of the last period.
            let expected = moves + lag * amplitude + NORMAL * smaller(last, earlier);
            let is_clear = detector.harmonics_within(&self.estimate, (DISTORTION * limit + lag) * amplitude);
            self.distorted = longer(self.distorted, turn, !is_clear);
            if is_alive && difference > expected && difference <= expected + shown {
                self.estimate = before;
                return;
            }
            if change.is_some() && (difference > expected || self.distorted > LASTS) {
                self.is_implausible = self.since <= PAUSE;
                self.since = 0.0;
                if !self.is_implausible {
                    // The detector ignores a glitch.
                    self.estimate = before;
                    return;
                }
            }
        }
        self.largest[0] = larger(now, difference);
    }
}

/// A time or phase after one more step of a condition.
fn longer(before: Real, step: Real, condition: bool) -> Real {
    if condition { before + step } else { 0.0 }
}

/// Coefficients of the measurement.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Sensing {
    detector: PhaseDetector,
    /// `exp(-i phase_target)`
    target: Complex,
    /// Time in the closed loop before the response can be predicted, s.
    warm_up: Real,
}

/// State of the measurement.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Channels {
    /// Channel of the response.
    pub response: Channel,
    base: Channel,
    balance: Balance,
    /// The drive with the lag of the detector, m.
    drive: Real,
    /// The drive at the last sample, and its change since the one before, m; what derivatives of the base still show of changes, m; and for how
    /// long, rad.
    last: Real,
    rise: Real,
    shown: Real,
    showing: Real,
    /// Time in the closed loop, s.
    closed: Real,
    /// Time since the loop was closed or the measurement was last valid, s.
    invalid: Real,
    /// Whether the measurement has been valid since the loop was closed.
    measured: bool,
}

impl Channels {
    /// What velocity and acceleration of the base show of a change of the drive, the delay later, m.
    fn shown_by_base(&mut self, config: &Config, drive: PresentDrive, turn: Real) -> Real {
        let rise = drive.amplitude - self.last;
        self.showing += turn;
        if self.showing > drive.omega * config.delay {
            self.shown *= larger(1.0 - turn / PAUSE, 0.0);
        }
        if rise != 0.0 || self.rise != 0.0 {
            let shown = (2.0 * rise.abs() + (rise - self.rise).abs() / turn) / turn;
            if shown > self.shown {
                (self.shown, self.showing) = (shown, 0.0);
            }
        }
        (self.last, self.rise) = (drive.amplitude, rise);
        self.shown
    }
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
            detector: PhaseDetector::new(config),
            target: Complex::unit(-config.phase_target),
            // A transient of the detector has decayed to exp(-2 pi), 0.2 %.
            warm_up: config.delay + larger(TAU / config.bandwidth, GROWING * TAU / config.omega_start),
        }
    }

    /// Updates both channels with a sample.
    pub fn measure(&self, config: &Config, state: &mut Channels, input: &Input, drive: PresentDrive) -> Measurement {
        let base = input.reference.filter(|_| config.reference_connected);
        let fault = Self::fault(config, input.response, base);
        // The detectors ignore an invalid reading and keep their estimates.
        let is_read = fault != Some(Fault::Sensor);
        if is_read {
            self.read(config, state, input.response, base, drive);
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
            reading: if is_read { input.response } else { 0.0 },
            turn: drive.omega * config.sample_time,
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

    /// Gives valid readings of response and base, m, to the detectors.
    fn read(&self, config: &Config, state: &mut Channels, response: Real, base: Option<Real>, drive: PresentDrive) {
        let turn = drive.omega * config.sample_time;
        let rotors = self.detector.rotors(drive.rotor);
        let take = |channel: &mut Channel, reading: Real, change: Option<Real>, [own, shown]: [Real; 2]| {
            let limits = config.residual_max.map(|share| [share, own, shown]);
            channel.take(&self.detector, limits, reading, &rotors, turn, change);
        };
        // The base follows the drive at once; the response grows, and its detector lags.
        let is_known = state.closed > self.warm_up;
        let change = if state.drive > 0.0 {
            drive.amplitude / state.drive
        } else {
            1.0
        };
        let impact = state.balance.impact();
        take(&mut state.response, response, is_known.then_some(1.0), [impact, 0.0]);
        if let Some(reading) = base {
            let shown = state.shown_by_base(config, drive, turn);
            let limits = if is_known { [0.0, shown] } else { [shown, 0.0] };
            take(&mut state.base, reading, Some(change), limits);
            if drive.amplitude == 0.0 {
                // A base without a drive rests.
                state.base.unchanged = 0.0;
            }
        }
        state.drive += self.detector.step * (drive.amplitude - state.drive);
    }

    /// Watches the signals while the loop is closed: a sensor that has stopped, or a response that cannot be measured.
    pub fn watch(config: &Config, state: &mut Channels, measured: &Measurement, is_closed: bool) -> Option<Fault> {
        if !is_closed {
            (state.invalid, state.closed, state.measured) = (0.0, 0.0, false);
            return None;
        }
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
