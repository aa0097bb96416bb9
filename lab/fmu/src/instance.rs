//! An FMU on the bench: loaded through the `fmi` crate, its variables found by name, stepped on one clock.

use std::path::{Path, PathBuf};

use fmi::fmi2::Fmi2Error;
use fmi::fmi2::import::Fmi2Import;
use fmi::fmi2::instance::{CoSimulation, Common, InstanceCS};
use fmi::schema::fmi2::ScalarVariableElement;
use fmi::traits::FmiImport;
use thiserror::Error;
use vines_testbench::rig::{ControllerError, RigError};

/// Why an FMU cannot take its side of the bench, or cannot go on.
#[derive(Debug, Error)]
pub enum FmuError {
    /// The file is not an FMU that can be loaded here.
    #[error("cannot load {}: {source}", path.display())]
    Load {
        /// The FMU.
        path: PathBuf,
        /// What the loader said.
        source: fmi::Error,
    },
    /// The FMU lacks a variable that the bench needs.
    #[error("{} has no {kind} variable `{name}`, which the bench needs", path.display())]
    Variable {
        /// The FMU.
        path: PathBuf,
        /// Its type in FMI.
        kind: Kind,
        /// What was looked for.
        name: &'static str,
    },
    /// The FMU refused a call; its own message has been logged.
    #[error("{} refused to {action} at t = {time} s: {source}", path.display())]
    Refused {
        /// The FMU.
        path: PathBuf,
        /// What was asked of it.
        action: &'static str,
        /// Simulated time, s.
        time: f64,
        /// The status it returned.
        source: Fmi2Error,
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

/// Type of a variable, as FMI has it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// A number.
    Real,
    /// A whole number.
    Integer,
    /// True or false.
    Boolean,
}

impl std::fmt::Display for Kind {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        std::fmt::Debug::fmt(self, f)
    }
}

/// A value to start with.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Value {
    Real(f64),
    Integer(i32),
    Boolean(bool),
}

impl Value {
    fn kind(self) -> Kind {
        match self {
            Self::Real(_) => Kind::Real,
            Self::Integer(_) => Kind::Integer,
            Self::Boolean(_) => Kind::Boolean,
        }
    }
}

/// Names a variable in calls.
pub(super) type Reference = <Fmi2Import as FmiImport>::ValueRef;

/// A loaded FMU at its simulated time.
pub(super) struct Fmu {
    instance: InstanceCS,
    /// Describes the FMU, and keeps it unpacked on disk while the instance lives.
    import: Fmi2Import,
    path: PathBuf,
    time: f64,
}

impl Fmu {
    /// Loads the FMU at `path`; `name` is the one it logs under.
    pub fn load(path: &Path, name: &str) -> Result<Self, FmuError> {
        let failed = |source| FmuError::Load {
            path: path.into(),
            source,
        };
        let import: Fmi2Import = fmi::import::from_path(path).map_err(failed)?;
        Ok(Self {
            instance: import.instantiate_cs(name, false, true).map_err(failed)?,
            import,
            path: path.into(),
            time: 0.0,
        })
    }

    /// The variable of that name and kind, if there is one.
    pub fn find(&self, kind: Kind, name: &str) -> Option<Reference> {
        let variables = &self.import.model_description().model_variables.variables;
        let found = variables.iter().find(|variable| variable.name == name)?;
        let is = match found.elem {
            ScalarVariableElement::Real(_) => Some(Kind::Real),
            ScalarVariableElement::Integer(_) => Some(Kind::Integer),
            ScalarVariableElement::Boolean(_) => Some(Kind::Boolean),
            _ => None,
        };
        (is == Some(kind)).then_some(found.value_reference)
    }

    /// The variable of that name and kind.
    pub fn need(&self, kind: Kind, name: &'static str) -> Result<Reference, FmuError> {
        self.find(kind, name).ok_or_else(|| FmuError::Variable {
            path: self.path.clone(),
            kind,
            name,
        })
    }

    /// Sets what the FMU has of `values` and initialises it at time 0. What it does not have is said in the log: such
    /// an FMU keeps its own.
    pub fn start(&mut self, values: &[(&str, Value)]) -> Result<(), FmuError> {
        let mut missing = Vec::new();
        for &(name, value) in values {
            let Some(reference) = self.find(value.kind(), name) else {
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
            log::warn!(
                "{path} has no {}; it works with what it has instead",
                missing.join(", ")
            );
        }
        self.ask("start", |i| i.setup_experiment(None, 0.0, None))?;
        self.ask("start", Common::enter_initialization_mode)?;
        self.ask("start", Common::exit_initialization_mode)?;
        Ok(())
    }

    /// One step of `step` seconds.
    pub fn step(&mut self, step: f64) -> Result<(), FmuError> {
        let time = self.time;
        self.ask("advance", |i| i.do_step(time, step, true))?;
        self.time += step;
        Ok(())
    }

    /// Real numbers.
    pub fn reals<const N: usize>(
        &mut self,
        action: &'static str,
        references: [Reference; N],
    ) -> Result<[f64; N], FmuError> {
        let mut values = [0.0; N];
        self.ask(action, |i| i.get_real(&references, &mut values))?;
        Ok(values)
    }

    /// Asks the FMU for something; `action` completes "refused to".
    pub fn ask<T>(
        &mut self,
        action: &'static str,
        call: impl FnOnce(&mut InstanceCS) -> Result<T, Fmi2Error>,
    ) -> Result<T, FmuError> {
        call(&mut self.instance).map_err(|source| FmuError::Refused {
            path: self.path.clone(),
            action,
            time: self.time,
            source,
        })
    }
}
