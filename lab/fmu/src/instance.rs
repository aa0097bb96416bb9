//! An FMU as part of the bench: the `fmi` crate loads it; its variables are found by name, and its time is kept.

use std::path::{Path, PathBuf};

use fmi::fmi2::Fmi2Error;
use fmi::fmi2::import::Fmi2Import;
use fmi::fmi2::instance::{CoSimulation, Common, InstanceCS};
use fmi::schema::fmi2::ScalarVariableElement;
use fmi::traits::FmiImport;
use libloading::Library;
use phase_lock::Value;
use thiserror::Error;
use vines_testbench::rig::{ControllerError, RigError};
use vines_testbench::scene::{Name, Names};

/// Reason why an FMU cannot be used, or cannot continue.
#[derive(Debug, Error)]
#[expect(missing_docs, reason = "the messages explain the variants")]
pub enum FmuError {
    #[error("cannot load {} as an FMU: {reason}", path.display())]
    Load { path: PathBuf, reason: String },
    #[error("{} has no {kind:?} variable `{name}`, which the bench needs; [rig.names] and [controller_names] of the scene map names", path.display())]
    Variable { path: PathBuf, kind: FmiType, name: String },
    #[error(
        "[rig.names] or [controller_names] of the scene maps `{name}`, which this bench does not have; it has: {names}"
    )]
    Name { name: String, names: String },
    #[error("{} refused to {action} at t = {time} s: it returned {status:?}", path.display())]
    Refused {
        path: PathBuf,
        action: &'static str,
        time: f64,
        status: Fmi2Error,
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
#[expect(missing_docs, reason = "the names are those of the standard")]
pub enum FmiType {
    Real,
    Integer,
    Boolean,
}

impl FmiType {
    /// The type of a variable, if it is one of the three.
    fn of(element: &ScalarVariableElement) -> Option<Self> {
        match element {
            ScalarVariableElement::Real(_) => Some(Self::Real),
            ScalarVariableElement::Integer(_) => Some(Self::Integer),
            ScalarVariableElement::Boolean(_) => Some(Self::Boolean),
            _ => None,
        }
    }
}

/// A variable: its type, its value reference, and SI units per unit of it.
#[derive(Clone, Copy)]
pub(super) struct Variable {
    kind: FmiType,
    reference: [<Fmi2Import as FmiImport>::ValueRef; 1],
    factor: f64,
}

/// A loaded FMU at its simulated time.
pub(super) struct Fmu {
    // Dropped before the unpacked library.
    instance: InstanceCS,
    /// The description, and the folder with the unpacked FMU.
    import: Fmi2Import,
    path: PathBuf,
    /// What the scene calls its variables.
    names: Names,
    time: f64,
}

impl Fmu {
    /// Loads the FMU at `path`; `name` is its name in log messages. Of the names of this bench, `names` may map those in `known`, separated by
    /// commas.
    pub fn load(path: &Path, name: &str, names: &Names, known: &str) -> Result<Self, FmuError> {
        let list: Vec<&str> = known.split(", ").collect();
        if let Some(name) = names.unknown(&list) {
            return Err(FmuError::Name { name: name.into(), names: known.into() });
        }
        let (import, instance) = open(path, name).map_err(|reason| FmuError::Load { path: path.into(), reason })?;
        let (path, names) = (path.into(), names.clone());
        Ok(Self { instance, import, path, names, time: 0.0 })
    }

    /// The variable of this type for `ours`. A name that the user gave must exist.
    pub fn find(&self, kind: FmiType, ours: &str) -> Result<Option<Variable>, FmuError> {
        let Name { name, factor } = self.names.of(ours);
        let variables = &self.import.model_description().model_variables.variables;
        let variable = variables
            .iter()
            .find(|variable| variable.name == name && FmiType::of(&variable.elem) == Some(kind));
        match variable {
            None if self.names.mapped(ours).is_some() => Err(self.missing(kind, &name)),
            variable => Ok(variable.map(|variable| Variable { kind, reference: [variable.value_reference], factor })),
        }
    }

    /// A variable that the bench needs.
    pub fn need(&self, kind: FmiType, ours: &str) -> Result<Variable, FmuError> {
        self.find(kind, ours)?.ok_or_else(|| self.missing(kind, ours))
    }

    fn missing(&self, kind: FmiType, name: &str) -> FmuError {
        FmuError::Variable { path: self.path.clone(), kind, name: name.into() }
    }

    /// Sets the values that the FMU has variables for, and initialises it at time 0. A warning in the log names the
    /// others; the FMU keeps its own values for these.
    pub fn start(&mut self, values: &[(&str, Value)]) -> Result<(), FmuError> {
        let mut missing = Vec::new();
        for &(name, value) in values {
            let (kind, value) = match value {
                Value::Real(value) => (FmiType::Real, value),
                Value::Integer(value) => (FmiType::Integer, value.into()),
                Value::Boolean(value) => (FmiType::Boolean, f64::from(u8::from(value))),
            };
            match self.find(kind, name)? {
                Some(variable) => self.set(variable, value)?,
                None => missing.push(format!("`{name}`")),
            }
        }
        if !missing.is_empty() {
            let path = self.path.display();
            log::warn!("{path} has no {}; it uses its own values instead", missing.join(", "));
        }
        self.ask("start", |i| {
            i.setup_experiment(None, 0.0, None)?;
            i.enter_initialization_mode()?;
            i.exit_initialization_mode()
        })
    }

    /// One step of `step` seconds.
    pub fn step(&mut self, step: f64) -> Result<(), FmuError> {
        let time = self.time;
        self.ask("advance", |i| i.do_step(time, step, true))?;
        self.time += step;
        Ok(())
    }

    /// Value of a variable, SI units; of a boolean one 0 or 1.
    pub fn get(&mut self, variable: Variable) -> Result<f64, FmuError> {
        let Variable { kind, reference, factor } = variable;
        let (mut real, mut whole) = ([0.0], [0]);
        self.ask("give a value", |i| match kind {
            FmiType::Real => i.get_real(&reference, &mut real),
            FmiType::Integer => i.get_integer(&reference, &mut whole),
            FmiType::Boolean => i.get_boolean(&reference, &mut whole),
        })?;
        Ok(match kind {
            FmiType::Real => real[0] * factor,
            FmiType::Integer | FmiType::Boolean => whole[0].into(),
        })
    }

    /// Value of a variable that the FMU may lack.
    pub fn get_if(&mut self, variable: Option<Variable>) -> Result<Option<f64>, FmuError> {
        variable.map(|variable| self.get(variable)).transpose()
    }

    /// Sets a variable, SI units.
    pub fn set(&mut self, variable: Variable, value: f64) -> Result<(), FmuError> {
        let Variable { kind, reference, factor } = variable;
        self.ask("take a value", |i| match kind {
            FmiType::Real => i.set_real(&reference, &[value / factor]),
            FmiType::Integer => i.set_integer(&reference, &[value as i32]),
            FmiType::Boolean => i.set_boolean(&reference, &[i32::from(value != 0.0)]),
        })
    }

    /// Calls the FMU; `action` completes the message "refused to …".
    fn ask<T>(
        &mut self,
        action: &'static str,
        call: impl FnOnce(&mut InstanceCS) -> Result<T, Fmi2Error>,
    ) -> Result<(), FmuError> {
        let (path, time) = (&self.path, self.time);
        let refused = |status| FmuError::Refused { path: path.clone(), action, time, status };
        call(&mut self.instance).map(drop).map_err(refused)
    }
}

/// Unpacks the FMU at `path` and instantiates it for co-simulation, with logging on.
fn open(path: &Path, name: &str) -> Result<(Fmi2Import, InstanceCS), String> {
    let reason = |error: fmi::Error| error.to_string();
    // The crate would report another version as an error of the XML.
    let version = fmi::import::peek_descr_path(path).map_err(reason)?.fmi_version;
    if version != "2.0" {
        return Err(format!("it has FMI version {version}; version 2.0 is needed"));
    }
    let import: Fmi2Import = fmi::import::from_path(path).map_err(reason)?;
    let instance = import.instantiate_cs(name, false, true).map_err(reason)?;
    Ok((import, instance))
}

/// Loads the library, and looks for the function that makes instances.
///
/// # Errors
/// What the system's loader says.
pub fn check(path: &Path) -> Result<(), String> {
    // The loader looks for a bare name elsewhere.
    let path = std::path::absolute(path).unwrap_or_else(|_| path.into());
    let reason =
        |error: libloading::Error| std::error::Error::source(&error).map_or(error.to_string(), ToString::to_string);
    // SAFETY: a library of FMI 2.0 runs nothing of its own when it is loaded.
    let library = unsafe { Library::new(path) }.map_err(reason)?;
    // SAFETY: the function is not called.
    let function = unsafe { library.get::<unsafe extern "C" fn()>(b"fmi2Instantiate") };
    function.map(drop).map_err(reason)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_that_is_not_an_archive_is_refused() {
        let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/Cargo.toml"));
        let message = Fmu::load(path, "rig", &Names::default(), "").err().unwrap().to_string();
        assert!(
            message.contains("Cargo.toml") && message.contains("Zip archive"),
            "{message}"
        );
    }
}
