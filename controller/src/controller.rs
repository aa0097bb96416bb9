//! The controller: one function per sample.

use crate::amplitude_loop::{AmplitudeLoop, AmplitudeState, Move};
use crate::config::{Config, ConfigError};
use crate::drive::{DriveGenerator, DriveState, PresentDrive};
use crate::loop_filter::{Frequency, LoopFilter};
use crate::oscillator::PhaseAccumulator;
use crate::real::consts::FRAC_PI_2;
use crate::real::{Real, limited};
use crate::sensing::{Channels, Measurement, Sensing};
use crate::signals::{Input, Output};
use crate::stationarity::{Dwell, LockSample, Stationarity};
use crate::supervisor::{Conditions, Fault, LoopState};

/// A checked configuration and its coefficients; only [`PhaseLock::retune`] changes it.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct PhaseLock {
    config: Config,
    sensing: Sensing,
    filter: LoopFilter,
    drive: DriveGenerator,
    amplitude_loop: AmplitudeLoop,
    stationarity: Stationarity,
}

/// The state, which changes with every sample. A copy that is restored later continues with the same bits.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct State {
    oscillator: PhaseAccumulator,
    channels: Channels,
    frequency: Frequency,
    drive: DriveState,
    /// Present while the response amplitude is controlled instead of the drive amplitude.
    amplitude_loop: Option<AmplitudeState>,
    dwell: Dwell,
    loop_state: LoopState,
    fault: Option<Fault>,
    /// Whether the last sample ended a ramp.
    ready: bool,
    /// Whether the last sample ended a period in which the lock was lost.
    lost: bool,
    /// Samples since acquiring began.
    acquiring: u64,
    /// Drive amplitude and phase target to which the dwell applies.
    tuning: (Real, Real),
}

impl Config {
    /// Checks all parameters and computes the coefficients.
    ///
    /// # Errors
    /// The first parameter with an invalid value, with its unit and the allowed values.
    pub fn build(self) -> Result<PhaseLock, ConfigError> {
        self.check()?;
        Ok(PhaseLock {
            sensing: Sensing::new(&self),
            filter: LoopFilter::new(&self),
            drive: DriveGenerator::new(&self),
            amplitude_loop: AmplitudeLoop::new(&self),
            stationarity: Stationarity::new(&self),
            config: self,
        })
    }
}

impl PhaseLock {
    /// The configuration.
    #[must_use]
    pub fn config(&self) -> &Config {
        &self.config
    }

    /// The state before the first sample.
    #[must_use]
    pub fn start(&self) -> State {
        State {
            frequency: Frequency::at(self.config.omega_start),
            tuning: self.tuning(),
            ..State::default()
        }
    }

    /// The output before the first sample: no drive, no measurements.
    #[must_use]
    pub fn idle(&self) -> Output {
        Output::idle(self.config.omega_start)
    }

    /// Changes drive amplitude (m) and phase target (rad) between samples. The state continues; `settled` becomes false. Rates and
    /// limits stay those of the configuration.
    ///
    /// # Errors
    /// A value out of range; then nothing changes.
    pub fn retune(&mut self, amplitude: Real, phase_target: Real) -> Result<(), ConfigError> {
        *self = Config { amplitude, phase_target, ..self.config }.build()?;
        Ok(())
    }

    /// Controls the response amplitude from now on and moves it to another setpoint; the drive follows within its limits.
    /// The first move starts at the present response amplitude. The control ends when `active` becomes false, or at a fault.
    ///
    /// # Errors
    /// What [`Move::check`] refuses, or an open loop; then nothing changes.
    pub fn hold_response(&self, state: &mut State, to: Move) -> Result<(), ConfigError> {
        to.check(&self.config)?;
        if !state.loop_state.is_closed() {
            return Err(ConfigError {
                name: "state",
                value: Some(Real::from(state.loop_state as u8)),
                unit: "",
                allowed: "2 (acquiring) or 3 (locked): the response amplitude can be controlled only in a closed loop",
            });
        }
        let (reading, drive) = (state.channels.response.estimate.amplitude, state.drive.amplitude);
        state
            .amplitude_loop
            .get_or_insert(AmplitudeState::constant(reading, drive))
            .start(to, self.amplitude_loop.sample_time);
        state.dwell.restart();
        Ok(())
    }

    /// Controls the drive amplitude again: the drive ramps to its setpoint.
    pub fn hold_drive(&self, state: &mut State) {
        if state.amplitude_loop.take().is_some() {
            state.dwell.restart();
        }
    }

    /// One sample: takes the sensor readings, returns the drive until the next sample.
    pub fn process(&self, state: &mut State, input: Input) -> Output {
        let drive = PresentDrive {
            rotor: state.oscillator.rotor(),
            omega: state.frequency.omega,
            amplitude: state.drive.amplitude,
        };
        let measured = self.sensing.measure(&self.config, &mut state.channels, &input, drive);
        let is_closed = state.loop_state.is_closed();
        let watched = Sensing::watch(&self.config, &mut state.channels, &measured, is_closed);
        self.change_state(state, input.active, measured.fault.or(watched));
        self.steer(state, &measured);
        let output = self.output(state, &measured, drive.rotor.im * state.drive.amplitude);
        let omega = state.frequency.omega;
        let period_ends = state.oscillator.advance(omega, self.config.sample_time);
        self.judge(state, &measured, period_ends);
        output
    }

    fn tuning(&self) -> (Real, Real) {
        (self.config.amplitude, self.config.phase_target)
    }

    /// Advances the state machine.
    fn change_state(&self, state: &mut State, active: bool, fault: Option<Fault>) {
        let timeout = self.config.acquire_timeout;
        let elapsed = state.acquiring as Real * self.config.sample_time;
        let before = state.loop_state;
        let (next, fault) = before.next(&Conditions {
            active,
            fault,
            ready: state.ready,
            settled: state.dwell.settled,
            lost: state.lost,
            timed_out: timeout.is_some_and(|timeout| elapsed >= timeout),
        });
        state.loop_state = next;
        if next == LoopState::Locked && state.tuning.1 != self.config.phase_target {
            // A new phase target: the distance from it does not mean that the lock is lost.
            state.loop_state = LoopState::Acquiring;
            state.dwell.restart();
        }
        if fault.is_some() || (next == LoopState::Ramping && before != LoopState::Ramping) {
            state.fault = fault;
        }
        // A held response is a measurement, which takes as long as it needs.
        let is_searching = next == LoopState::Acquiring && state.amplitude_loop.is_none();
        state.acquiring = if is_searching { state.acquiring + 1 } else { 0 };
    }

    /// Sets frequency and drive amplitude according to the loop state.
    fn steer(&self, state: &mut State, measured: &Measurement) {
        let Self { filter, drive, .. } = self;
        let omega_start = self.config.omega_start;
        state.ready = false;
        if !state.loop_state.is_closed() {
            state.amplitude_loop = None;
        }
        let frequency = &mut state.frequency;
        match state.loop_state {
            LoopState::Idle => {
                filter.go_to(frequency, omega_start);
                state.drive.ramp_down(drive.ramp_step);
            }
            LoopState::Ramping => {
                filter.go_to(frequency, omega_start);
                state.ready = drive.ramp(&mut state.drive, self.config.amplitude) && frequency.omega == omega_start;
            }
            LoopState::Acquiring | LoopState::Locked => self.close_loop(state, measured),
            LoopState::LockLost | LoopState::Tripped => {
                filter.hold(frequency);
                state.drive.ramp_down(drive.ramp_step);
            }
            LoopState::ShutDown => {
                filter.hold(frequency);
                state.drive.ramp_down(drive.release_step);
            }
        }
    }

    /// One sample of the closed loop.
    fn close_loop(&self, state: &mut State, measured: &Measurement) {
        let Self { filter, drive, .. } = self;
        if measured.valid {
            filter.follow(&mut state.frequency, measured.error);
        } else {
            filter.hold(&mut state.frequency);
        }
        let reading = state.channels.response.estimate.amplitude;
        // Up to here a larger drive gives a larger response.
        let near = measured.valid && measured.error.abs() < FRAC_PI_2;
        let before = state.drive.amplitude;
        if let Some(amplitude_loop) = &mut state.amplitude_loop {
            let (amplitude, shift) = self
                .amplitude_loop
                .follow(amplitude_loop, before, near.then_some(reading));
            state.drive.amplitude = amplitude;
            filter.shift(&mut state.frequency, shift);
            state.ready = amplitude_loop.has_arrived();
        } else {
            let setpoint = self.config.amplitude;
            if measured.valid && measured.has_sensor {
                drive.control(&mut state.drive, setpoint, measured.reference_amplitude);
            }
            state.ready = drive.ramp(&mut state.drive, setpoint);
        }
    }

    /// Updates the lock criterion. It restarts while the loop is open and when the tuning has changed.
    fn judge(&self, state: &mut State, measured: &Measurement, period_ends: bool) {
        let tuning = self.tuning();
        if !state.loop_state.is_closed() || state.tuning != tuning || !state.ready {
            state.dwell.restart();
        }
        state.tuning = tuning;
        state.lost = false;
        if state.loop_state.is_closed() {
            let sample = LockSample {
                error: measured.error,
                integral: state.frequency.integral.get(),
                omega: state.frequency.omega,
                amplitude: state.channels.response.estimate.amplitude,
                residual_power: state.channels.response.estimate.residual_power,
                valid: measured.valid,
            };
            state.lost = self.stationarity.update(&mut state.dwell, &sample, period_ends);
        }
    }

    /// The output of a sample.
    fn output(&self, state: &State, measured: &Measurement, drive: Real) -> Output {
        let omega = state.frequency.omega;
        let response_amplitude = state.channels.response.estimate.amplitude;
        let means = state.dwell.means;
        let (frequency, response_mean) = means.unwrap_or((omega, response_amplitude));
        Output {
            omega,
            amplitude: state.drive.amplitude,
            drive,
            phase_error: measured.measurable.then_some(measured.error),
            response_amplitude,
            response_target: state.amplitude_loop.map(|amplitude_loop| amplitude_loop.setpoint),
            reference_amplitude: measured.reference_amplitude,
            coherence: state.channels.response.estimate.coherence(),
            // Rounding can move the mean of values at a limit beyond the limit.
            frequency: limited(frequency, self.config.omega_min, self.config.omega_max),
            response_mean,
            locked: state.loop_state == LoopState::Locked,
            settled: state.dwell.settled && state.tuning == self.tuning(),
            state: state.loop_state,
            fault: state.fault,
        }
    }
}
