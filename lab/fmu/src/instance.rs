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

impl From<Value> for FmiType {
    fn from(value: Value) -> Self {
        match value {
            Value::Real(_) => Self::Real,
            Value::Integer(_) => Self::Integer,
            Value::Boolean(_) => Self::Boolean,
        }
    }
}

/// A variable, and SI units per unit of it.
pub(super) type Named = (Reference, f64);

/// Value reference of a variable.
pub(super) type Reference = <Fmi2Import as FmiImport>::ValueRef;

/// A loaded FMU at its simulated time.
pub(super) struct Fmu {
    // Dropped before the unpacked library.
    instance: InstanceCS,
    /// The description, and the folder with the unpacked FMU.
    import: Fmi2Import,
    path: PathBuf,
    time: f64,
}

impl Fmu {
    /// Loads the FMU at `path`; `name` is its name in log messages.
    pub fn load(path: &Path, name: &str) -> Result<Self, FmuError> {
        let (import, instance) = open(path, name).map_err(|reason| FmuError::Load { path: path.into(), reason })?;
        Ok(Self { instance, import, path: path.into(), time: 0.0 })
    }

    /// The variable of this type that `names` has for `ours`, and its factor. A name that the user gave must exist.
    pub fn named(&self, kind: FmiType, names: &Names, ours: &str) -> Result<Option<Named>, FmuError> {
        let Name { name, factor } = names.of(ours);
        let variables = &self.import.model_description().model_variables.variables;
        let variable = variables
            .iter()
            .find(|variable| variable.name == name && FmiType::of(&variable.elem) == Some(kind));
        match variable {
            None if names.mapped(ours).is_some() => Err(self.missing(kind, &name)),
            variable => Ok(variable.map(|variable| (variable.value_reference, factor))),
        }
    }

    /// The reference of a variable without a unit, if there is one.
    pub fn switch(&self, kind: FmiType, names: &Names, ours: &str) -> Result<Option<Reference>, FmuError> {
        Ok(self.named(kind, names, ours)?.map(|(reference, _)| reference))
    }

    /// A variable that the bench needs.
    pub fn need(&self, kind: FmiType, names: &Names, ours: &str) -> Result<Named, FmuError> {
        self.named(kind, names, ours)?.ok_or_else(|| self.missing(kind, ours))
    }

    fn missing(&self, kind: FmiType, name: &str) -> FmuError {
        FmuError::Variable { path: self.path.clone(), kind, name: name.into() }
    }

    /// Sets the values that the FMU has variables for, and initialises it at time 0. A warning in the log names the
    /// others; the FMU keeps its own values for these.
    pub fn start(&mut self, names: &Names, values: &[(&str, Value)]) -> Result<(), FmuError> {
        let mut missing = Vec::new();
        for &(name, value) in values {
            let Some((reference, factor)) = self.named(value.into(), names, name)? else {
                missing.push(format!("`{name}`"));
                continue;
            };
            let reference = [reference];
            self.ask("take its parameters", |i| match value {
                Value::Real(x) => i.set_real(&reference, &[x / factor]),
                Value::Integer(n) => i.set_integer(&reference, &[n]),
                Value::Boolean(b) => i.set_boolean(&reference, &[b.into()]),
            })?;
        }
        if !missing.is_empty() {
            let path = self.path.display();
            log::warn!("{path} has no {}; it uses its own values instead", missing.join(", "));
        }
        self.ask("start", |i| {
            i.setup_experiment(None, 0.0, None)?;
            i.enter_initialization_mode()?;
            i.exit_initialization_mode()?;
            Ok(())
        })
    }

    /// One step of `step` seconds.
    pub fn step(&mut self, step: f64) -> Result<(), FmuError> {
        let time = self.time;
        self.ask("advance", |i| i.do_step(time, step, true))?;
        self.time += step;
        Ok(())
    }

    /// Values of real variables, SI units.
    pub fn read<const N: usize>(&mut self, action: &'static str, variables: [Named; N]) -> Result<[f64; N], FmuError> {
        let (references, mut values) = (variables.map(|(reference, _)| reference), [0.0; N]);
        self.ask(action, |i| i.get_real(&references, &mut values))?;
        Ok(std::array::from_fn(|n| values[n] * variables[n].1))
    }

    /// Sets real variables, SI units.
    pub fn write(&mut self, action: &'static str, variables: &[Named], values: &[f64]) -> Result<(), FmuError> {
        let (references, factors): (Vec<_>, Vec<_>) = variables.iter().copied().unzip();
        let values: Vec<f64> = values
            .iter()
            .zip(factors)
            .map(|(value, factor)| value / factor)
            .collect();
        self.ask(action, |i| i.set_real(&references, &values)).map(drop)
    }

    /// Value of an integer variable.
    pub fn integer(&mut self, action: &'static str, reference: Reference) -> Result<i32, FmuError> {
        let mut value = [0];
        self.ask(action, |i| i.get_integer(&[reference], &mut value))?;
        Ok(value[0])
    }

    /// Calls the FMU; `action` completes the message "refused to …".
    pub fn ask<T>(
        &mut self,
        action: &'static str,
        call: impl FnOnce(&mut InstanceCS) -> Result<T, Fmi2Error>,
    ) -> Result<T, FmuError> {
        call(&mut self.instance).map_err(|status| FmuError::Refused {
            path: self.path.clone(),
            action,
            time: self.time,
            status,
        })
    }
}

/// Refuses names in the scene that are not among `names`, separated by commas.
pub(super) fn names_exist(mapped: &Names, names: &str) -> Result<(), FmuError> {
    let list: Vec<&str> = names.split(", ").collect();
    mapped.unknown(&list).map_or(Ok(()), |name| {
        Err(FmuError::Name { name: name.into(), names: names.into() })
    })
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
        let message = Fmu::load(path, "rig").err().unwrap().to_string();
        assert!(
            message.contains("Cargo.toml") && message.contains("Zip archive"),
            "{message}"
        );
    }
}
