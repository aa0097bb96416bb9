//! The phase-lock controller as an FMI 2.0 component: which variable is which number of the core.
#![forbid(unsafe_code)]

use fmi2_component::{Archive, Component, Key, Log, Refusal};
use phase_lock::{Config, Detector, Fault, Input, Output, Phase, PhaseLock, SampleClock, State};
use variables::{Boolean, Integer, Model, Real, category};

mod signal;

use signal::{DERIVATIVES, Signal};

mod variables {
    include!(concat!(env!("OUT_DIR"), "/variables.rs"));
}

fmi2_component::export!(Controller);

/// What a master has set, and the controller that came of it.
#[derive(Clone, serde::Serialize, serde::Deserialize)]
struct Controller {
    config: Config,
    /// The FMU's three detector parameters: 1 adaptive or 2 demodulator, harmonics, odd ones only.
    detector: (i32, i32, bool),
    dwell: i32,
    response: Signal,
    reference: Signal,
    active: bool,
    running: Option<Running>,
}

/// The controller at work.
#[derive(Clone, Copy, serde::Serialize, serde::Deserialize)]
struct Running {
    start_time: f64,
    clock: SampleClock,
    lock: PhaseLock,
    state: State,
    output: Output,
}

const ADAPTIVE: i32 = 1;
const DEMODULATOR: i32 = 2;

/// So many sample times ahead of a communication point a sample counts as being there: clocks round.
const EARLY: f64 = 1e-3;

/// The longest steps, in sample times, in which a channel is extrapolated.
const LONGEST_STEP: f64 = 2.0;

/// The most samples that one step may hold: some seconds of work.
const MOST_SAMPLES: f64 = 1e7;

impl Controller {
    /// The configuration that the values set make.
    fn configuration(&self) -> Result<Config, Refusal> {
        let (kind, harmonics, odd_only) = self.detector;
        let detector = match kind {
            ADAPTIVE => Detector::Adaptive {
                // Out of range stays out of range, and is refused by its name.
                harmonics: u8::try_from(harmonics).unwrap_or(0),
                odd_only,
            },
            DEMODULATOR => Detector::Demodulator,
            other => {
                return Err(Refusal::error(format!(
                    "detector = {other} is refused; allowed is 1 (adaptive) or 2 (demodulator)"
                )));
            }
        };
        let mut config = Config {
            detector,
            ..self.config
        };
        config.lock.dwell = u32::try_from(self.dwell).unwrap_or(0);
        Ok(config)
    }

    /// Whether the first sample has been taken; until then parameters may still change together.
    fn is_stepping(&self) -> bool {
        self.running
            .as_ref()
            .is_some_and(|running| running.clock.taken() > 0)
    }

    fn output(&self) -> Option<&Output> {
        self.running.as_ref().map(|running| &running.output)
    }
}

impl Component for Controller {
    type Model = Model;

    fn new() -> Self {
        // The shell overwrites all of this with the start values of the table.
        Self {
            config: Config::for_resonance(1.0, 1.0),
            detector: (ADAPTIVE, 1, true),
            dwell: 1,
            response: Signal::default(),
            reference: Signal::default(),
            active: false,
            running: None,
        }
    }

    fn get_real(&self, variable: Real) -> f64 {
        let config = &self.config;
        let put_out = |value: fn(&Output) -> f64| self.output().map_or(0.0, value);
        match variable {
            Real::sample_time => config.sample_time,
            Real::omega_start => config.omega_start,
            Real::omega_min => config.omega_min,
            Real::omega_max => config.omega_max,
            Real::omega_rate => config.omega_rate,
            Real::amplitude => config.amplitude,
            Real::amplitude_max => config.amplitude_max,
            Real::ramp_time => config.ramp_time,
            Real::release_time => config.release_time,
            Real::base_bandwidth => config.base_bandwidth,
            Real::phase_target => config.phase_target,
            Real::bandwidth => config.bandwidth,
            Real::damping_rate => config.damping_rate,
            Real::delay => config.delay,
            Real::lock_phase_tolerance => config.lock.phase_tolerance,
            Real::lock_unlock_tolerance => config.lock.unlock_tolerance,
            Real::lock_frequency_drift => config.lock.frequency_drift,
            Real::lock_amplitude_drift => config.lock.amplitude_drift,
            Real::lock_coherence_min => config.lock.coherence_min,
            Real::lock_response_min => config.lock.response_min,
            Real::response_max => config.response_max,
            Real::acquire_timeout => config.acquire_timeout,
            Real::response => self.response.value,
            Real::reference => self.reference.value,
            Real::omega => self.output().map_or(config.omega_start, |o| o.omega),
            Real::frequency => self.output().map_or(config.omega_start, |o| o.frequency),
            Real::E => put_out(|o| o.amplitude),
            Real::drive => put_out(|o| o.drive),
            Real::phase_error => put_out(|o| o.phase_error),
            Real::response_amplitude => put_out(|o| o.response_amplitude),
            Real::reference_amplitude => put_out(|o| o.reference_amplitude),
            Real::coherence => put_out(|o| o.coherence),
            Real::response_mean => put_out(|o| o.response_mean),
        }
    }

    fn set_real(&mut self, variable: Real, value: f64) -> Result<(), Refusal> {
        if matches!(variable, Real::amplitude | Real::phase_target) && self.is_stepping() {
            // A tunable one: refused at once where it makes no sense, taken over with the next step.
            let mut tuned = self.configuration()?;
            if matches!(variable, Real::amplitude) {
                tuned.amplitude = value;
            } else {
                tuned.phase_target = value;
            }
            tuned.build()?;
        }
        let config = &mut self.config;
        let slot = match variable {
            Real::sample_time => &mut config.sample_time,
            Real::omega_start => &mut config.omega_start,
            Real::omega_min => &mut config.omega_min,
            Real::omega_max => &mut config.omega_max,
            Real::omega_rate => &mut config.omega_rate,
            Real::amplitude => &mut config.amplitude,
            Real::amplitude_max => &mut config.amplitude_max,
            Real::ramp_time => &mut config.ramp_time,
            Real::release_time => &mut config.release_time,
            Real::base_bandwidth => &mut config.base_bandwidth,
            Real::phase_target => &mut config.phase_target,
            Real::bandwidth => &mut config.bandwidth,
            Real::damping_rate => &mut config.damping_rate,
            Real::delay => &mut config.delay,
            Real::lock_phase_tolerance => &mut config.lock.phase_tolerance,
            Real::lock_unlock_tolerance => &mut config.lock.unlock_tolerance,
            Real::lock_frequency_drift => &mut config.lock.frequency_drift,
            Real::lock_amplitude_drift => &mut config.lock.amplitude_drift,
            Real::lock_coherence_min => &mut config.lock.coherence_min,
            Real::lock_response_min => &mut config.lock.response_min,
            Real::response_max => &mut config.response_max,
            Real::acquire_timeout => &mut config.acquire_timeout,
            Real::response => &mut self.response.value,
            Real::reference => &mut self.reference.value,
            _ => return Err(Refusal::error("this variable is computed, not set")),
        };
        *slot = value;
        Ok(())
    }

    fn get_integer(&self, variable: Integer) -> i32 {
        match variable {
            Integer::detector => self.detector.0,
            Integer::harmonics => self.detector.1,
            Integer::lock_dwell => self.dwell,
            Integer::state => self.output().map_or(Phase::Idle, |o| o.state) as i32,
            Integer::fault => self
                .output()
                .and_then(|o| o.fault)
                .map_or(0, |fault: Fault| fault as i32),
        }
    }

    fn set_integer(&mut self, variable: Integer, value: i32) -> Result<(), Refusal> {
        let slot = match variable {
            Integer::detector => &mut self.detector.0,
            Integer::harmonics => &mut self.detector.1,
            Integer::lock_dwell => &mut self.dwell,
            _ => return Err(Refusal::error("this variable is computed, not set")),
        };
        *slot = value;
        Ok(())
    }

    fn get_boolean(&self, variable: Boolean) -> bool {
        match variable {
            Boolean::odd_only => self.detector.2,
            Boolean::active => self.active,
            Boolean::locked => self.output().is_some_and(|o| o.locked),
            Boolean::settled => self.output().is_some_and(|o| o.settled),
        }
    }

    fn set_boolean(&mut self, variable: Boolean, value: bool) -> Result<(), Refusal> {
        let slot = match variable {
            Boolean::odd_only => &mut self.detector.2,
            Boolean::active => &mut self.active,
            _ => return Err(Refusal::error("this variable is computed, not set")),
        };
        *slot = value;
        Ok(())
    }

    fn initialise(&mut self, start_time: f64, _log: &Log) -> Result<(), Refusal> {
        let lock = self.configuration()?.build()?;
        let state = lock.start();
        self.running = Some(Running {
            start_time,
            clock: SampleClock::new(self.config.sample_time),
            output: lock.idle(),
            lock,
            state,
        });
        Ok(())
    }

    fn accept_step(&self, step: f64) -> Result<(), Refusal> {
        let sample_time = self.config.sample_time;
        if step / sample_time <= MOST_SAMPLES {
            return Ok(());
        }
        let longest = MOST_SAMPLES * sample_time;
        Err(Refusal::error(format!(
            "communicationStepSize = {step} s is refused; allowed are at most {longest} s, which is {MOST_SAMPLES} samples"
        )))
    }

    fn step(&mut self, time: f64, step: f64, log: &Log) -> Result<(), Refusal> {
        let Some(running) = &mut self.running else {
            return Err(Refusal::error("a step before initialization"));
        };
        let Config {
            amplitude,
            phase_target,
            ..
        } = self.config;
        let tuned = running.lock.config();
        if (tuned.amplitude, tuned.phase_target) != (amplitude, phase_target) {
            running.lock.retune(amplitude, phase_target)?;
        }
        let sample_time = self.config.sample_time;
        let begin = time - running.start_time;
        for (name, signal) in [
            ("response", &mut self.response),
            ("reference", &mut self.reference),
        ] {
            signal.begin(begin, step, LONGEST_STEP * sample_time);
            if step > sample_time * (1.0 + EARLY) && !signal.is_given() {
                log.warn_once(
                    "step",
                    format_args!(
                        "a step of {step} s holds more samples than {name} has values: sample_time = {sample_time} s; \
                         expected are steps of at most sample_time, or input derivatives"
                    ),
                );
            }
        }
        for sample in running.clock.take(begin + step) {
            let elapsed = sample as f64 * sample_time - begin;
            // A communication point that is meant to be on the grid is: its value is taken as it is.
            let elapsed = if elapsed <= EARLY * sample_time {
                0.0
            } else {
                elapsed
            };
            let input = Input {
                response: self.response.at(elapsed),
                reference: Some(self.reference.at(elapsed)),
                active: self.active,
            };
            let before = running.output.state;
            running.output = running.lock.process(&mut running.state, input);
            if running.output.state != before {
                let t = running.start_time + sample as f64 * sample_time;
                let Output { state, fault, .. } = running.output;
                log.tell(
                    category::logEvents,
                    format_args!("{before:?} -> {state:?} at t = {t} s, fault: {fault:?}"),
                );
            }
        }
        self.response.end(begin);
        self.reference.end(begin);
        Ok(())
    }

    fn set_real_input_derivative(
        &mut self,
        variable: Real,
        order: u32,
        value: f64,
        _log: &Log,
    ) -> Result<(), Refusal> {
        let signal = match variable {
            Real::response => &mut self.response,
            Real::reference => &mut self.reference,
            _ => return Err(Refusal::error("only inputs have derivatives")),
        };
        let order = order as usize;
        if order > DERIVATIVES {
            let name = variable.variable().name;
            return Err(Refusal::error(format!(
                "derivative {order} of {name} is refused; allowed are orders 1 to {DERIVATIVES}"
            )));
        }
        signal.set_derivative(order, value);
        Ok(())
    }

    fn archive(&mut self, archive: &mut Archive<'_>) -> Result<(), Refusal> {
        archive.whole(self)
    }
}
