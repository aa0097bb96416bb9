//! The phase-lock controller as an FMI 2.0 component: maps the variables of the FMU to the core.
//!
//! The parameters come from the core's table; a test compares it with `modelDescription.xml`.
#![forbid(unsafe_code)]

use fmi2_component::{Archive, Component, Key, Log, Refusal};
use phase_lock::{Config, Input, LoopState, Output, Parameter, PhaseLock, SampleClock, State, Value};
use variables::{Boolean, Integer, Model, Real, category};

mod signal;

use signal::{DERIVATIVES, Signal};

mod variables {
    include!(concat!(env!("OUT_DIR"), "/variables.rs"));
}

fmi2_component::export!(Controller);

/// Values set by the master, and the controller made from them.
#[derive(Clone, serde::Serialize, serde::Deserialize)]
struct Controller {
    config: Config,
    response: Signal,
    reference: Signal,
    active: bool,
    running: Option<Running>,
}

/// The controller after initialization.
#[derive(Clone, Copy, serde::Serialize, serde::Deserialize)]
struct Running {
    start_time: f64,
    clock: SampleClock,
    lock: PhaseLock,
    state: State,
    output: Output,
}

/// Tolerance of the sample grid, in sample times: a sample so little after a communication point counts as on it.
const EARLY: f64 = 1e-3;

/// The longest steps, in sample times, in which a channel is extrapolated.
const LONGEST_STEP: f64 = 2.0;

/// Largest number of samples per step: a few seconds of computing time.
const MAX_SAMPLES: f64 = 1e7;

impl Controller {
    /// Whether the first sample has been taken. Until then parameters may change together.
    fn is_stepping(&self) -> bool {
        self.running.as_ref().is_some_and(|running| running.clock.taken() > 0)
    }

    fn output(&self) -> Option<&Output> {
        self.running.as_ref().map(|running| &running.output)
    }

    /// The value of a parameter; none for other variables.
    fn parameter(&self, variable: impl Key) -> Option<Value> {
        Parameter::find(variable.variable().name).map(|parameter| parameter.get(&self.config))
    }

    fn set_parameter(&mut self, variable: impl Key, value: Value) -> Result<(), Refusal> {
        let parameter = Parameter::find(variable.variable().name)
            .ok_or_else(|| Refusal::error("this variable is computed, not set"))?;
        let mut config = self.config;
        parameter.set(&mut config, value)?;
        if self.is_stepping() {
            // A tunable parameter: an invalid value is refused now, a valid one takes effect at the next step.
            config.build()?;
        }
        self.config = config;
        Ok(())
    }
}

impl Component for Controller {
    type Model = Model;

    fn new() -> Self {
        // The shell overwrites all values with the start values of the model description.
        Self {
            config: Config::for_resonance(1.0, 1.0),
            response: Signal::default(),
            reference: Signal::default(),
            active: false,
            running: None,
        }
    }

    fn get_real(&self, variable: Real) -> f64 {
        let value = |get: fn(&Output) -> f64| self.output().map_or(0.0, get);
        let frequency = |get: fn(&Output) -> f64| self.output().map_or(self.config.omega_start, get);
        match variable {
            Real::response => self.response.value,
            Real::reference => self.reference.value,
            Real::omega => frequency(|o| o.omega),
            Real::frequency => frequency(|o| o.frequency),
            Real::E => value(|o| o.amplitude),
            Real::drive => value(|o| o.drive),
            Real::phase_error => value(|o| o.phase_error),
            Real::response_amplitude => value(|o| o.response_amplitude),
            Real::reference_amplitude => value(|o| o.reference_amplitude),
            Real::coherence => value(|o| o.coherence),
            Real::response_mean => value(|o| o.response_mean),
            parameter => match self.parameter(parameter) {
                Some(Value::Real(value)) => value,
                _ => unreachable!("{parameter:?} is a real parameter of the core"),
            },
        }
    }

    fn set_real(&mut self, variable: Real, value: f64) -> Result<(), Refusal> {
        match variable {
            Real::response => self.response.value = value,
            Real::reference => self.reference.value = value,
            parameter => return self.set_parameter(parameter, Value::Real(value)),
        }
        Ok(())
    }

    fn get_integer(&self, variable: Integer) -> i32 {
        match variable {
            Integer::state => self.output().map_or(LoopState::Idle, |o| o.state) as i32,
            Integer::fault => {
                let fault = self.output().and_then(|o| o.fault);
                fault.map_or(0, |fault| fault as i32)
            }
            parameter => match self.parameter(parameter) {
                Some(Value::Integer(value)) => value,
                _ => unreachable!("{parameter:?} is an integer parameter of the core"),
            },
        }
    }

    fn set_integer(&mut self, variable: Integer, value: i32) -> Result<(), Refusal> {
        self.set_parameter(variable, Value::Integer(value))
    }

    fn get_boolean(&self, variable: Boolean) -> bool {
        match variable {
            Boolean::active => self.active,
            Boolean::locked => self.output().is_some_and(|o| o.locked),
            Boolean::settled => self.output().is_some_and(|o| o.settled),
            parameter => match self.parameter(parameter) {
                Some(Value::Boolean(value)) => value,
                _ => unreachable!("{parameter:?} is a Boolean parameter of the core"),
            },
        }
    }

    fn set_boolean(&mut self, variable: Boolean, value: bool) -> Result<(), Refusal> {
        if variable == Boolean::active {
            self.active = value;
            return Ok(());
        }
        self.set_parameter(variable, Value::Boolean(value))
    }

    fn initialise(&mut self, start_time: f64, _log: &Log) -> Result<(), Refusal> {
        let lock = self.config.build()?;
        self.running = Some(Running {
            start_time,
            clock: SampleClock::new(self.config.sample_time),
            output: lock.idle(),
            state: lock.start(),
            lock,
        });
        Ok(())
    }

    fn accept_step(&self, step: f64) -> Result<(), Refusal> {
        let sample_time = self.config.sample_time;
        if step / sample_time <= MAX_SAMPLES {
            return Ok(());
        }
        let longest = MAX_SAMPLES * sample_time;
        Err(Refusal::error(format!(
            "communicationStepSize = {step} s is refused; allowed are at most {longest} s, which is {MAX_SAMPLES} samples"
        )))
    }

    fn step(&mut self, time: f64, step: f64, log: &Log) -> Result<(), Refusal> {
        let Some(running) = &mut self.running else {
            return Err(Refusal::error("a step before initialization"));
        };
        let Config { amplitude, phase_target, .. } = self.config;
        let tuned = running.lock.config();
        if (tuned.amplitude, tuned.phase_target) != (amplitude, phase_target) {
            running.lock.retune(amplitude, phase_target)?;
        }
        let sample_time = self.config.sample_time;
        let begin = time - running.start_time;
        for (name, signal) in [("response", &mut self.response), ("reference", &mut self.reference)] {
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
            // This communication point is on the sample grid up to rounding: the controller takes the value itself.
            let elapsed = if elapsed <= EARLY * sample_time { 0.0 } else { elapsed };
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

    fn set_real_input_derivative(&mut self, variable: Real, order: u32, value: f64, _log: &Log) -> Result<(), Refusal> {
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
