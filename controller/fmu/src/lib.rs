//! The phase-lock controller as an FMI 2.0 component: maps the variables of the FMU to the core.
//!
//! Parameters and outputs come from the core's tables. The parameters in `modelDescription.xml` are generated, and a test compares the outputs.
#![forbid(unsafe_code)]

use fmi2_component::{Archive, Component, Key, Log, Refusal};
use phase_lock::{Config, Input, LoopState, Move, OUTPUTS, Output, Parameter, PhaseLock, State, Value};
use variables::{Boolean, Integer, Model, Real, category};

mod sample_clock;
mod signal;

use sample_clock::SampleClock;
use signal::{INPUT_ORDER, InputSignal};

mod variables {
    include!(concat!(env!("OUT_DIR"), "/variables.rs"));
}

fmi2_component::export!(SampledController);

/// Values set by the master, and the controller made from them.
#[derive(Clone, serde::Serialize, serde::Deserialize)]
struct SampledController {
    config: Config,
    response: InputSignal,
    reference: InputSignal,
    active: bool,
    hold_response: bool,
    to: Move,
    /// Whether Initialization Mode has been left. Until then parameters may change together; a later change is checked at once.
    initialised: bool,
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
    /// The last move of the response amplitude, while it is controlled.
    moved: Option<Move>,
}

impl Running {
    /// Whether the response amplitude can be controlled.
    fn is_closed(&self) -> bool {
        matches!(self.output.state, LoopState::Acquiring | LoopState::Locked)
    }

    /// Controls the response amplitude as the master asks, as soon as the loop is closed; `None`: the drive amplitude.
    fn hold_response(&mut self, to: Option<Move>) -> Result<(), Refusal> {
        let to = to.filter(|_| self.is_closed());
        if to != self.moved {
            match to {
                Some(to) => self.lock.hold_response(&mut self.state, to)?,
                None => self.lock.hold_drive(&mut self.state),
            }
            self.moved = to;
        }
        Ok(())
    }
}

/// Tolerance of the sample grid, in sample times: a sample so little after a communication point counts as on it.
const EARLY: f64 = 1e-3;

/// The longest steps, in sample times, in which a channel is extrapolated.
const LONGEST_STEP: f64 = 2.0;

/// Largest number of samples per step: a few seconds of computing time.
const MAX_SAMPLES: f64 = 1e7;

impl SampledController {
    /// The value of a parameter or of an output; 0 for an output without a value.
    fn value(&self, variable: impl Key) -> Value {
        let name = variable.variable().name;
        let idle = Output::idle(self.config.omega_start);
        let output = self.running.as_ref().map_or(&idle, |running| &running.output);
        if let Some(signal) = OUTPUTS.iter().find(|signal| signal.name == name) {
            return signal.get(output).unwrap_or(Value::Real(0.0));
        }
        if let Some(signal) = OUTPUTS.iter().find(|signal| signal.present == Some(name)) {
            return Value::Boolean(signal.get(output).is_some());
        }
        match Parameter::find(name) {
            Some(parameter) => parameter.get(&self.config),
            None => unreachable!("{name} is a parameter or an output of the core"),
        }
    }

    fn set_parameter(&mut self, variable: impl Key, value: Value) -> Result<(), Refusal> {
        let parameter = Parameter::find(variable.variable().name)
            .ok_or_else(|| Refusal::error("this variable is computed, not set"))?;
        let mut config = self.config;
        parameter.set(&mut config, value)?;
        if self.initialised {
            // A tunable parameter: an invalid value is refused now, a valid one takes effect at the next step.
            config.build()?;
        }
        self.config = config;
        Ok(())
    }
}

impl Component for SampledController {
    type Model = Model;

    fn new() -> Self {
        // The shell overwrites all values with the start values of the model description.
        Self {
            config: Config::for_resonance(1.0, 1.0),
            response: InputSignal::default(),
            reference: InputSignal::default(),
            active: false,
            hold_response: false,
            to: Move::default(),
            initialised: false,
            running: None,
        }
    }

    fn get_real(&self, variable: Real) -> f64 {
        match variable {
            Real::response => self.response.value,
            Real::reference => self.reference.value,
            Real::move_response => self.to.response,
            Real::move_duration => self.to.duration,
            Real::move_amplitude => self.to.amplitude,
            Real::move_omega => self.to.omega,
            Real::move_growth => self.to.growth,
            computed => match self.value(computed) {
                Value::Real(value) => value,
                other => unreachable!("{computed:?} = {other:?} is a real number"),
            },
        }
    }

    fn set_real(&mut self, variable: Real, value: f64) -> Result<(), Refusal> {
        match variable {
            Real::response => self.response.value = value,
            Real::reference => self.reference.value = value,
            Real::move_response => self.to.response = value,
            Real::move_duration => self.to.duration = value,
            Real::move_amplitude => self.to.amplitude = value,
            Real::move_omega => self.to.omega = value,
            Real::move_growth => self.to.growth = value,
            parameter => return self.set_parameter(parameter, Value::Real(value)),
        }
        Ok(())
    }

    fn get_integer(&self, variable: Integer) -> i32 {
        match self.value(variable) {
            Value::Integer(value) => value,
            other => unreachable!("{variable:?} = {other:?} is a whole number"),
        }
    }

    fn set_integer(&mut self, variable: Integer, value: i32) -> Result<(), Refusal> {
        self.set_parameter(variable, Value::Integer(value))
    }

    fn get_boolean(&self, variable: Boolean) -> bool {
        match variable {
            Boolean::active => self.active,
            Boolean::hold_response => self.hold_response,
            computed => self.value(computed) == Value::Boolean(true),
        }
    }

    fn set_boolean(&mut self, variable: Boolean, value: bool) -> Result<(), Refusal> {
        match variable {
            Boolean::active => self.active = value,
            Boolean::hold_response => self.hold_response = value,
            parameter => return self.set_parameter(parameter, Value::Boolean(value)),
        }
        Ok(())
    }

    fn initialise(&mut self, start_time: f64, _log: &Log) -> Result<(), Refusal> {
        let lock = self.config.build()?;
        self.running = Some(Running {
            start_time,
            clock: SampleClock::new(self.config.sample_time),
            output: lock.idle(),
            moved: None,
            state: lock.start(),
            lock,
        });
        Ok(())
    }

    fn leave_initialization(&mut self) {
        self.initialised = true;
    }

    fn accept_step(&self, step: f64) -> Result<(), Refusal> {
        if self.hold_response
            && let Some(running) = self.running.as_ref().filter(|running| running.is_closed())
        {
            // Refused before the step, an invalid move can be corrected.
            self.to.check(running.lock.config())?;
        }
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
        running.hold_response(self.hold_response.then_some(self.to))?;
        let sample_time = self.config.sample_time;
        let begin = time - running.start_time;
        for (name, signal) in [("response", &mut self.response), ("reference", &mut self.reference)] {
            signal.begin(begin, step, LONGEST_STEP * sample_time);
            if step > sample_time * (1.0 + EARLY) && !signal.is_given() {
                log.warn_once(
                    "step",
                    format_args!(
                        "a step of {step} s holds more samples than {name} has values: sample_time = {sample_time} s; \
                         expected steps of at most sample_time, or input derivatives"
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
                let reason = fault.filter(|_| state.is_latched()).map_or("", |fault| fault.text());
                let colon = if reason.is_empty() { "" } else { ": " };
                log.tell(
                    category::logEvents,
                    format_args!("{before} -> {state} at t = {t} s{colon}{reason}"),
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
        if order > INPUT_ORDER {
            let name = variable.variable().name;
            return Err(Refusal::error(format!(
                "derivative {order} of {name} is refused; allowed are orders 1 to {INPUT_ORDER}"
            )));
        }
        signal.set_derivative(order, value);
        Ok(())
    }

    fn archive(&mut self, archive: &mut Archive<'_>) -> Result<(), Refusal> {
        archive.whole(self)
    }
}
