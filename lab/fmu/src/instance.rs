//! An FMU as part of the bench: finds its variables by name, and keeps its time.

use std::path::{Path, PathBuf};

use fmi2_import::{CallError, Instance, LoadError};
use phase_lock::Value;
use thiserror::Error;
use vines_testbench::rig::{ControllerError, RigError};

/// Reason why an FMU cannot be used, or cannot continue.
#[derive(Debug, Error)]
pub enum FmuError {
    /// The file cannot be loaded as an FMU.
    #[error("cannot load {}: {source}", path.display())]
    Load {
        /// The FMU.
        path: PathBuf,
        /// Reason.
        source: LoadError,
    },
    /// The FMU lacks a variable that the bench needs.
    #[error("{} has no {kind} variable `{name}`, which the bench needs", path.display())]
    Variable {
        /// The FMU.
        path: PathBuf,
        /// Its type.
        kind: Kind,
        /// Its name.
        name: &'static str,
    },
    /// The FMU refused a call; its own message has been logged.
    #[error("{} refused to {action} at t = {time} s: {source}", path.display())]
    Refused {
        /// The FMU.
        path: PathBuf,
        /// What the FMU should have done.
        action: &'static str,
        /// Simulated time, s.
        time: f64,
        /// The status of the call.
        source: CallError,
    },
}

impl From<FmuError> for RigError {
    fn from(error: FmuError) -> Self {
        Self::Failed(error.into())
    }
}

impl From<FmuError> for ControllerError {
    fn from(error: FmuError) -> Self {
        Self::Failed(error.into())
    }
}

/// Type of a variable in FMI.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// A real number.
    Real,
    /// A whole number.
    Integer,
    /// True or false.
    Boolean,
}

impl From<Kind> for fmi2_import::Kind {
    fn from(kind: Kind) -> Self {
        match kind {
            Kind::Real => Self::Real,
            Kind::Integer => Self::Integer,
            Kind::Boolean => Self::Boolean,
        }
    }
}

impl From<Value> for Kind {
    fn from(value: Value) -> Self {
        match value {
            Value::Real(_) => Self::Real,
            Value::Integer(_) => Self::Integer,
            Value::Boolean(_) => Self::Boolean,
        }
    }
}

impl std::fmt::Display for Kind {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        std::fmt::Debug::fmt(self, f)
    }
}

/// Value reference of a variable.
pub(super) type Reference = u32;

/// A loaded FMU at its simulated time.
pub(super) struct Fmu {
    instance: Instance,
    path: PathBuf,
    time: f64,
}

impl Fmu {
    /// Loads the FMU at `path`; `name` is its name in log messages.
    pub fn load(path: &Path, name: &str) -> Result<Self, FmuError> {
        let failed = |source| FmuError::Load {
            path: path.into(),
            source,
        };
        let fmu = fmi2_import::Fmu::open(path).map_err(failed)?;
        Ok(Self {
            instance: Instance::new(fmu, name).map_err(failed)?,
            path: path.into(),
            time: 0.0,
        })
    }

    /// The variable of that name and kind, if there is one.
    pub fn find(&self, kind: Kind, name: &str) -> Option<Reference> {
        let variable = self.instance.description().variable(name)?;
        (variable.kind() == Some(kind.into())).then_some(variable.value_reference)
    }

    /// The variable of that name and kind.
    pub fn need(&self, kind: Kind, name: &'static str) -> Result<Reference, FmuError> {
        self.find(kind, name).ok_or_else(|| FmuError::Variable {
            path: self.path.clone(),
            kind,
            name,
        })
    }

    /// Sets the values that the FMU has variables for, and initialises it at time 0. A warning in the log names the
    /// others; the FMU keeps its own values for these.
    pub fn start(&mut self, values: &[(&str, Value)]) -> Result<(), FmuError> {
        let mut missing = Vec::new();
        for &(name, value) in values {
            let Some(reference) = self.find(value.into(), name) else {
                missing.push(format!("`{name}`"));
                continue;
            };
            let reference = [reference];
            self.ask("take its parameters", |i| match value {
                Value::Real(x) => i.set_real(&reference, &[x]),
                Value::Integer(n) => i.set_integer(&reference, &[n]),
                Value::Boolean(b) => i.set_boolean(&reference, &[b.into()]),
            })?;
        }
        if !missing.is_empty() {
            let path = self.path.display();
            log::warn!("{path} has no {}; it uses its own values instead", missing.join(", "));
        }
        self.ask("start", Instance::initialize)
    }

    /// One step of `step` seconds.
    pub fn step(&mut self, step: f64) -> Result<(), FmuError> {
        let time = self.time;
        self.ask("advance", |i| i.do_step(time, step))?;
        self.time += step;
        Ok(())
    }

    /// Values of real variables.
    pub fn reals<const N: usize>(
        &mut self,
        action: &'static str,
        references: [Reference; N],
    ) -> Result<[f64; N], FmuError> {
        let mut values = [0.0; N];
        self.ask(action, |i| i.get_real(&references, &mut values))?;
        Ok(values)
    }

    /// Calls the FMU; `action` completes the message "refused to …".
    pub fn ask<T>(
        &mut self,
        action: &'static str,
        call: impl FnOnce(&mut Instance) -> Result<T, CallError>,
    ) -> Result<T, FmuError> {
        call(&mut self.instance).map_err(|source| FmuError::Refused {
            path: self.path.clone(),
            action,
            time: self.time,
            source,
        })
    }
}
