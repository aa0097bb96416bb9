//! An instance as safe Rust sees it: what each call means, once its pointers have been checked.

use std::ffi::CString;

use crate::component::{Component, RealOf};
use crate::life_cycle::{Interface, State};
use crate::log::Log;
use crate::model::Key;
use crate::refusal::{Refusal, Severity};
use crate::session::{Select, Session};
use crate::snapshots::Snapshots;
use crate::variable::Variable;

/// How far, relatively, a master's clock may be from ours: both round.
const CLOCK_TOLERANCE: f64 = 1e-9;

/// A component, its log and its FMU states.
pub(crate) struct Instance<C> {
    pub session: Session<C>,
    pub select: Select<C>,
    pub log: Log,
    pub snapshots: Snapshots<C>,
    /// What the last `fmi2GetString` has pointed at.
    pub strings: Vec<CString>,
}

impl<C: Component> Instance<C> {
    pub fn new(log: Log, select: Select<C>) -> Result<Self, Refusal> {
        Ok(Self {
            session: Session::new(select)?,
            select,
            log,
            snapshots: Snapshots::new(),
            strings: Vec::new(),
        })
    }

    pub fn set_up(&mut self, start_time: f64, stop_time: Option<f64>) -> Result<(), Refusal> {
        if !start_time.is_finite() {
            return Err(Refusal::error(format!(
                "startTime = {start_time} s is refused; allowed is a finite number"
            )));
        }
        if let Some(stop) = stop_time
            && (stop.is_nan() || stop < start_time)
        {
            return Err(Refusal::error(format!(
                "stopTime = {stop} s is refused; allowed is a number of at least startTime = {start_time} s"
            )));
        }
        self.session.start_time = start_time;
        self.session.time = start_time;
        self.session.stop_time = stop_time.unwrap_or(f64::INFINITY);
        self.session.stale = true;
        Ok(())
    }

    pub fn leave_initialization(&mut self) -> Result<(), Refusal> {
        self.refresh()?;
        self.session.state = match self.session.interface {
            Interface::CoSimulation => State::StepComplete,
            Interface::ModelExchange => State::EventMode,
        };
        Ok(())
    }

    /// Initialises the component anew, if something was set since it was last.
    pub fn refresh(&mut self) -> Result<(), Refusal> {
        let session = &mut self.session;
        if session.stale {
            session
                .component
                .initialise(session.start_time, &self.log)?;
            session.stale = false;
        }
        Ok(())
    }

    pub fn reset(&mut self) -> Result<(), Refusal> {
        self.session = Session::new(self.select)?;
        Ok(())
    }

    /// Whether a variable may be set now, in a state where setting is legal at all.
    pub fn check_settable<K: Key>(&self, key: K) -> Result<(), Refusal> {
        let variable = key.variable();
        let settable = match self.session.state {
            State::Instantiated => variable.settable_at_start(false),
            State::InitializationMode => variable.settable_at_start(true),
            State::ContinuousTimeMode => variable.settable_in_continuous_time(),
            _ => variable.settable_between_steps(),
        };
        if settable {
            return Ok(());
        }
        Err(not_settable(variable, self.session.state))
    }

    /// Says that values are about to be set: what was initialised from the old ones is out of date.
    pub fn values_change(&mut self) {
        let start = [State::Instantiated, State::InitializationMode];
        self.session.stale |= start.contains(&self.session.state);
    }

    pub fn check_finite(key: RealOf<C>, value: f64) -> Result<(), Refusal> {
        if value.is_finite() {
            Ok(())
        } else {
            Err(key.variable().refuse(value, "a finite number"))
        }
    }

    pub fn do_step(&mut self, time: f64, step: f64) -> Result<(), Refusal> {
        self.check_step(time, step)?;
        let session = &mut self.session;
        // A step of length zero has nothing to do; some masters make one to update their own bookkeeping.
        if step > 0.0
            && let Err(refusal) = session.component.step(time, step, &self.log)
        {
            session.state = match refusal.severity() {
                Severity::Discard => State::StepFailed,
                Severity::Error => State::Error,
                Severity::Fatal => State::Fatal,
            };
            return Err(refusal);
        }
        session.time = time + step;
        Ok(())
    }

    fn check_step(&self, time: f64, step: f64) -> Result<(), Refusal> {
        let &Session {
            time: own,
            stop_time,
            ..
        } = &self.session;
        if !(step.is_finite() && step >= 0.0) {
            return Err(Refusal::error(format!(
                "communicationStepSize = {step} s is refused; allowed is a finite number of at least 0"
            )));
        }
        let tolerance = CLOCK_TOLERANCE * own.abs().max(step);
        if !(time + step).is_finite() || (time - own).abs() > tolerance {
            return Err(Refusal::error(format!(
                "currentCommunicationPoint = {time} s is refused; the last step has ended at {own} s"
            )));
        }
        if time > stop_time + tolerance {
            return Err(Refusal::error(format!(
                "a step at {time} s is refused; the experiment was set up to end at stopTime = {stop_time} s"
            )));
        }
        self.session.component.accept_step(step)
    }
}

#[cold]
fn not_settable<T>(variable: &Variable<T>, state: State) -> Refusal {
    let initial = match variable.initial {
        Some(initial) => format!(", initial {initial:?}"),
        None => String::new(),
    };
    Refusal::error(format!(
        "{} cannot be set in state {}: it has causality {:?}, variability {:?}{initial}",
        variable.name,
        state.name(),
        variable.causality,
        variable.variability,
    ))
}
