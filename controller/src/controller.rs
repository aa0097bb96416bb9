//! The controller: one function per sample.

mod sense;

use crate::config::Config;
use crate::detector::{Detector, Estimate};
use crate::drive::{Drive, Level};
use crate::error::{ConfigError, Quantity};
use crate::gains::Gains;
use crate::loop_filter::{Frequency, LoopFilter};
use crate::oscillator::Oscillator;
use crate::response_loop::{Hold, Move, ResponseLoop};
use crate::signals::{Input, Output};
use crate::stationarity::{Dwell, Reading, Stationarity};
use crate::supervisor::{Fault, Phase, Signs};
use sense::Sense;

/// Phase error, rad, up to which more drive reliably means more response.
const PHASE_RANGE: f64 = core::f64::consts::FRAC_PI_3;

/// A checked configuration and its coefficients; immutable but for [`PhaseLock::retune`].
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct PhaseLock {
    config: Config,
    detector: Detector,
    filter: LoopFilter,
    drive: Drive,
    response_loop: ResponseLoop,
    stationarity: Stationarity,
}

/// Everything that changes from sample to sample. A copy of it, put back later, continues with the same bits.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct State {
    oscillator: Oscillator,
    response: Estimate,
    reference: Estimate,
    /// Whether the reference channel has ever read other than exactly zero.
    connected: bool,
    frequency: Frequency,
    level: Level,
    /// Where the response amplitude is held rather than the drive's.
    hold: Option<Hold>,
    dwell: Dwell,
    phase: Phase,
    fault: Option<Fault>,
    /// Whether the last sample ended a ramp.
    ready: bool,
    /// Whether the last sample ended a period in which the phase escaped.
    escaped: bool,
    /// Samples since acquiring began.
    acquiring: u64,
    /// Amplitude and phase target that the dwell is about.
    tuning: (f64, f64),
}

impl PhaseLock {
    pub(crate) fn new(config: Config) -> Self {
        let per_sample = |range: f64, time: f64| {
            if time > 0.0 {
                range * (config.sample_time / time)
            } else {
                f64::INFINITY
            }
        };
        let gains = Gains::from_bandwidth(config.bandwidth, config.damping_rate);
        let drive = Drive {
            amplitude_max: config.amplitude_limit(),
            ramp_step: per_sample(config.amplitude, config.ramp_time),
            release_step: per_sample(config.amplitude, config.release_time),
            control_step: -libm::expm1(-config.base_bandwidth * config.sample_time),
        };
        Self {
            detector: Detector::new(config.detector, config.bandwidth, config.sample_time),
            filter: LoopFilter {
                gains,
                omega_min: config.omega_min,
                omega_max: config.omega_max,
                max_change: if config.omega_rate > 0.0 {
                    config.omega_rate * config.sample_time
                } else {
                    f64::INFINITY
                },
                sample_time: config.sample_time,
            },
            drive,
            response_loop: ResponseLoop::new(&config, gains, &drive),
            stationarity: Stationarity {
                phase_tolerance: config.lock.phase_tolerance,
                unlock_tolerance: config.lock.unlock_tolerance,
                frequency_drift: config.lock.frequency_drift,
                amplitude_drift: config.lock.amplitude_drift,
                block: config.lock.dwell.div_ceil(4),
            },
            config,
        }
    }

    /// The configuration in use.
    #[must_use]
    pub fn config(&self) -> &Config {
        &self.config
    }

    /// The gains in use.
    #[must_use]
    pub fn gains(&self) -> Gains {
        self.filter.gains
    }

    /// The state before the first sample.
    #[must_use]
    pub fn start(&self) -> State {
        State {
            oscillator: Oscillator::default(),
            response: Estimate::default(),
            reference: Estimate::default(),
            connected: false,
            frequency: Frequency::at(self.config.omega_start),
            level: Level::default(),
            hold: None,
            dwell: Dwell::default(),
            phase: Phase::Idle,
            fault: None,
            ready: false,
            escaped: false,
            acquiring: 0,
            tuning: self.tuning(),
        }
    }

    /// What is put out before the first sample: no drive, nothing measured.
    #[must_use]
    pub fn idle(&self) -> Output {
        let omega = self.config.omega_start;
        Output {
            omega,
            amplitude: 0.0,
            drive: 0.0,
            phase_error: 0.0,
            response_amplitude: 0.0,
            response_target: 0.0,
            reference_amplitude: 0.0,
            coherence: 0.0,
            frequency: omega,
            response_mean: 0.0,
            locked: false,
            settled: false,
            state: Phase::Idle,
            fault: None,
        }
    }

    /// Changes drive amplitude (m) and phase target (rad) between samples. The state goes on; `settled` starts anew.
    ///
    /// # Errors
    /// A value out of range; then nothing is changed.
    pub fn retune(&mut self, amplitude: f64, phase_target: f64) -> Result<(), ConfigError> {
        let tuned = Config {
            amplitude,
            phase_target,
            ..self.config
        };
        let before = self.drive;
        *self = tuned.build()?;
        // A ramp keeps its rate: down to a small amplitude, or to none, it would otherwise take for ever.
        self.drive.ramp_step = self.drive.ramp_step.max(before.ramp_step);
        self.drive.release_step = self.drive.release_step.max(before.release_step);
        self.response_loop = ResponseLoop::new(&self.config, self.filter.gains, &self.drive);
        Ok(())
    }

    /// Holds the amplitude of the response from now on and moves it as stated; the drive does what it must, within its limits.
    /// The first move sets out from the amplitude that the response has. Taking `active` away, or a fault, ends it.
    ///
    /// # Errors
    /// A move that makes no sense, a drive without a limit (`amplitude_max`), or a loop that is not closed; then nothing
    /// is changed.
    pub fn hold_response(&self, state: &mut State, to: Move) -> Result<(), ConfigError> {
        Quantity::new("response", to.response, "m").positive()?;
        Quantity::new("duration", to.duration, "s").not_negative()?;
        Quantity::new("amplitude", to.amplitude, "m").check(true, "a finite number")?;
        Quantity::new("omega", to.omega, "rad/s").check(true, "a finite number")?;
        Quantity::new("amplitude_max", self.config.amplitude_max, "m").check(
            self.config.amplitude_max > 0.0,
            "above 0 where the response is to be held: the drive needs a limit",
        )?;
        Quantity::new("state", state.phase as u8 as f64, "").check(
            state.phase.is_closed(),
            "2 (acquiring) or 3 (locked): the response can be held only in a closed loop",
        )?;
        let (read, drive) = (state.response.amplitude(), state.level.amplitude);
        let hold = state.hold.get_or_insert(Hold::at(read, drive));
        hold.set_out(to, self.response_loop.sample_time());
        state.dwell = Dwell::default();
        Ok(())
    }

    /// One sample: takes what the sensors read now, returns what the drive shall be until the next sample.
    pub fn process(&self, state: &mut State, input: Input) -> Output {
        let rotor = state.oscillator.rotor();
        let sense = self.sense(state, &input, rotor);
        self.sequence(state, input.active, &sense);
        self.steer(state, &sense);
        let output = self.output(state, &sense, rotor.im * state.level.amplitude);
        let omega = state.frequency.omega;
        let period_ends = state.oscillator.advance(omega, self.config.sample_time);
        self.judge(state, &sense, period_ends);
        output
    }

    fn tuning(&self) -> (f64, f64) {
        (self.config.amplitude, self.config.phase_target)
    }

    /// Moves the sequence on.
    fn sequence(&self, state: &mut State, active: bool, sense: &Sense) {
        let timeout = self.config.acquire_timeout;
        let elapsed = state.acquiring as f64 * self.config.sample_time;
        let before = state.phase;
        let (phase, fault) = before.next(&Signs {
            active,
            fault: sense.fault,
            ready: state.ready,
            settled: state.dwell.settled(),
            escaped: state.escaped,
            late: timeout > 0.0 && elapsed >= timeout,
        });
        state.phase = phase;
        if phase == Phase::Locked && state.tuning.1 != self.config.phase_target {
            // The new target is not held yet: being away from it is no loss of the lock.
            state.phase = Phase::Acquiring;
            state.dwell = Dwell::default();
        }
        if fault.is_some() || (phase == Phase::Ramping && before != Phase::Ramping) {
            state.fault = fault;
        }
        state.acquiring = if phase == Phase::Acquiring {
            state.acquiring + 1
        } else {
            0
        };
    }

    /// Sets frequency and drive amplitude as the state of the sequence demands.
    fn steer(&self, state: &mut State, sense: &Sense) {
        let Self { filter, drive, .. } = self;
        let State {
            frequency, level, ..
        } = state;
        let Config {
            omega_start,
            amplitude,
            ..
        } = self.config;
        state.ready = false;
        if !state.phase.is_closed() {
            state.hold = None;
        }
        match state.phase {
            Phase::Idle => {
                filter.go_to(frequency, omega_start);
                drive.ramp_down(level);
            }
            Phase::Ramping => {
                filter.go_to(frequency, omega_start);
                state.ready = drive.ramp(level, amplitude) && frequency.omega == omega_start;
            }
            Phase::Acquiring | Phase::Locked => {
                if sense.qualified {
                    filter.follow(frequency, sense.error);
                } else {
                    filter.hold(frequency);
                }
                if let Some(hold) = &mut state.hold {
                    let read = state.response.amplitude();
                    let near = sense.qualified && sense.error.abs() < PHASE_RANGE;
                    let (driven, shift) =
                        self.response_loop
                            .follow(hold, level.amplitude, near.then_some(read));
                    level.amplitude = driven;
                    filter.shift(frequency, shift);
                    state.ready = hold.arrived();
                } else {
                    if sense.qualified && sense.measured {
                        drive.control(level, amplitude, sense.reference_amplitude);
                    }
                    state.ready = drive.ramp(level, amplitude);
                }
            }
            Phase::LockLost | Phase::Tripped => {
                filter.hold(frequency);
                drive.ramp_down(level);
            }
            Phase::ShutDown => {
                filter.hold(frequency);
                drive.release(level);
            }
        }
    }

    /// Feeds the lock criterion, which starts anew where the loop is open or its aim has changed.
    fn judge(&self, state: &mut State, sense: &Sense, period_ends: bool) {
        let aim = self.tuning();
        if !state.phase.is_closed() || state.tuning != aim || !state.ready {
            state.dwell = Dwell::default();
        }
        state.tuning = aim;
        state.escaped = false;
        if state.phase.is_closed() {
            let reading = Reading {
                error: sense.error,
                integral: state.frequency.integral,
                omega: state.frequency.omega,
                amplitude: state.response.amplitude(),
                qualified: sense.qualified,
            };
            state.escaped = self
                .stationarity
                .update(&mut state.dwell, &reading, period_ends);
        }
    }

    fn output(&self, state: &State, sense: &Sense, drive: f64) -> Output {
        let omega = state.frequency.omega;
        let response_amplitude = state.response.amplitude();
        let means = state.dwell.means();
        let (frequency, response_mean) = means.unwrap_or((omega, response_amplitude));
        Output {
            omega,
            amplitude: state.level.amplitude,
            drive,
            phase_error: sense.error,
            response_amplitude,
            response_target: state.hold.map_or(0.0, |hold| hold.wanted()),
            reference_amplitude: sense.reference_amplitude,
            coherence: state.response.coherence(),
            // The mean of values at a limit may round to beyond it.
            frequency: frequency.clamp(self.config.omega_min, self.config.omega_max),
            response_mean,
            locked: state.phase == Phase::Locked,
            settled: state.dwell.settled() && state.tuning == self.tuning(),
            state: state.phase,
            fault: state.fault,
        }
    }
}
