//! An instance in safe Rust: what each call does after its pointers have been checked.

use std::ffi::CString;

use crate::component::{Component, RealOf};
use crate::life_cycle::{Interface, State};
use crate::log::Log;
use crate::model::Key;
use crate::refusal::{Refusal, Severity};
use crate::session::{Select, Session, Snapshots};
use crate::variable::{Occasions, Variable};

/// How far, relatively, a master's clock may be from ours, and a step may lead past the stop time: both round.
const CLOCK_TOLERANCE: f64 = 1e-9;

/// A component, its log and its FMU states.
pub(crate) struct Instance<C> {
    pub session: Session<C>,
    /// End of the experiment, s. It belongs to the instance, so that a state continues in an experiment that ends later.
    stop_time: f64,
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
            stop_time: f64::INFINITY,
            select,
            log,
            snapshots: Snapshots::new(),
            strings: Vec::new(),
        })
    }

    pub fn set_up(&mut self, tolerance: Option<f64>, start_time: f64, stop_time: Option<f64>) -> Result<(), Refusal> {
        if let Some(tolerance) = tolerance
            && !(0.0..=1.0).contains(&tolerance)
        {
            return Err(Refusal::error(format!(
                "tolerance = {tolerance:e} is refused; allowed is a relative tolerance from 0 to 1"
            )));
        }
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
        self.stop_time = stop_time.unwrap_or(f64::INFINITY);
        self.session.stale = true;
        Ok(())
    }

    pub fn leave_initialization(&mut self) -> Result<(), Refusal> {
        self.refresh()?;
        self.session.component.leave_initialization();
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
            session.component.initialise(session.start_time, &self.log)?;
            session.stale = false;
        }
        Ok(())
    }

    pub fn reset(&mut self) -> Result<(), Refusal> {
        self.session = Session::new(self.select)?;
        self.stop_time = f64::INFINITY;
        Ok(())
    }

    /// Whether a variable may be set now, in a state where setting is legal at all; answers when else.
    #[inline]
    pub fn check_settable<K: Key>(&self, key: K) -> Result<Occasions, Refusal> {
        let occasions = K::OCCASIONS[key.index()];
        if occasions.meets(Occasions::now(self.session.state)) {
            return Ok(occasions);
        }
        Err(not_settable(key.variable(), self.session.state))
    }

    /// Announces that values will be set: what was initialised from the old ones is then invalid.
    #[inline]
    pub fn values_change(&mut self) {
        let start = State::InitializationMode as u8;
        self.session.stale |= self.session.state as u8 <= start;
    }

    /// Sets values, all or none: where `set` is refused, the component is what it was before.
    #[cold]
    #[inline(never)]
    pub fn change(&mut self, set: impl FnOnce(&mut C) -> Result<(), Refusal>) -> Result<(), Refusal> {
        let mut changed = self.session.component.clone();
        set(&mut changed)?;
        self.session.component = changed;
        Ok(())
    }

    #[inline]
    pub fn check_finite(key: RealOf<C>, value: f64) -> Result<(), Refusal> {
        if value.is_finite() {
            Ok(())
        } else {
            Err(not_finite(key.variable(), value))
        }
    }

    #[inline]
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

    #[inline]
    fn check_step(&self, time: f64, step: f64) -> Result<(), Refusal> {
        let (own, stop_time) = (self.session.time, self.stop_time);
        let size = if own.abs() > step { own.abs() } else { step };
        let tolerance = CLOCK_TOLERANCE * size;
        let end = time + step;
        let in_order = (time - own).abs() <= tolerance && end - stop_time <= tolerance + CLOCK_TOLERANCE * end.abs();
        // NaN compares false, and an infinite step makes an infinite end.
        let sane = step >= 0.0 && end <= f64::MAX;
        if !(sane && in_order) {
            return Err(out_of_order((time, step), own, stop_time));
        }
        self.session.component.accept_step(step)
    }
}

/// Why a step cannot be made.
#[cold]
fn out_of_order((time, step): (f64, f64), own: f64, stop_time: f64) -> Refusal {
    let tolerance = CLOCK_TOLERANCE * own.abs().max(step);
    Refusal::error(if !(0.0..=f64::MAX).contains(&step) {
        format!("communicationStepSize = {step} s is refused; allowed is a finite number of at least 0")
    } else if (time - own).abs() <= tolerance {
        format!(
            "a step from {time} s to {} s is refused; the experiment was set up to end at stopTime = {stop_time} s",
            time + step
        )
    } else {
        format!("currentCommunicationPoint = {time} s is refused; the last step has ended at {own} s")
    })
}

#[cold]
fn not_finite(variable: &Variable<f64>, value: f64) -> Refusal {
    variable.refuse(value, "a finite number")
}

#[cold]
fn not_settable<T>(variable: &Variable<T>, state: State) -> Refusal {
    let initial = match variable.initial {
        Some(initial) => format!(", initial {initial}"),
        None => String::new(),
    };
    Refusal::error(format!(
        "{} cannot be set in state {}: it has causality {}, variability {}{initial}",
        variable.name,
        state.name(),
        variable.causality,
        variable.variability,
    ))
}
