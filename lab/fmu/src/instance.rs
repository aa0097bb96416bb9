//! An FMU as part of the bench: its variables are found by name, and its time is kept.

use std::ffi::CString;
use std::fs::File;
use std::path::{Path, PathBuf};

use fmi2_component::Status;
use fmi2_description::Description;
use libloading::Library;
use percent_encoding::{AsciiSet, NON_ALPHANUMERIC, utf8_percent_encode};
use phase_lock::Value;
use tempfile::TempDir;
use thiserror::Error;
use vines_testbench::rig::{ControllerError, RigError};
use vines_testbench::scene::{Name, Names};
use zip::ZipArchive;

use crate::error::{CallError, LoadError, done};
use crate::functions::{Answer, Functions};
use crate::library;
use crate::master::{Interface, Line, Master};

/// Reason why an FMU cannot be used, or cannot continue.
#[derive(Debug, Error)]
#[expect(missing_docs, reason = "the messages explain the variants")]
pub enum FmuError {
    #[error("cannot load {}: {source}", path.display())]
    Load { path: PathBuf, source: LoadError },
    #[error("{} has no {kind:?} variable `{name}`, which the bench needs; [rig.names] and [controller_names] of the scene map names", path.display())]
    Variable { path: PathBuf, kind: Kind, name: String },
    #[error(
        "[rig.names] or [controller_names] of the scene maps `{name}`, which this bench does not have; it has: {known}"
    )]
    Name { name: String, known: String },
    #[error("{} refused to {action} at t = {time} s: {source}", path.display())]
    Refused {
        path: PathBuf,
        action: &'static str,
        time: f64,
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
#[expect(missing_docs, reason = "the names are those of the standard")]
pub enum Kind {
    Real,
    Integer,
    Boolean,
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

/// A variable, and SI units per unit of it.
pub(super) type Named = (Reference, f64);

/// Value reference of a variable.
pub(super) type Reference = u32;

/// A loaded FMU at its simulated time.
pub(super) struct Fmu {
    // Dropped in this order.
    master: Master,
    _library: Library,
    _unpacked: TempDir,
    description: Description,
    path: PathBuf,
    time: f64,
}

impl Fmu {
    /// Loads the FMU at `path`; `name` is its name in log messages.
    pub fn load(path: &Path, name: &str) -> Result<Self, FmuError> {
        Self::open(path, name).map_err(|source| FmuError::Load { path: path.into(), source })
    }

    /// Unpacks the FMU and instantiates it for co-simulation, with logging on.
    fn open(path: &Path, name: &str) -> Result<Self, LoadError> {
        let archive = |error: zip::result::ZipError| LoadError::Archive(error.to_string());
        let unpacked = tempfile::tempdir()?;
        let mut zip = ZipArchive::new(File::open(path)?).map_err(archive)?;
        zip.extract(&unpacked).map_err(archive)?;
        let inside = |name: &str| unpacked.path().join(name);
        let description = Description::parse(&std::fs::read_to_string(inside("modelDescription.xml"))?)?;
        if description.fmi_version != "2.0" {
            return Err(LoadError::Version(description.fmi_version));
        }
        let interface = description.co_simulation.as_ref().ok_or(LoadError::NoCoSimulation)?;
        let library = format!("{}{}", interface.model_identifier, std::env::consts::DLL_SUFFIX);
        let libraries = library::folders()
            .iter()
            .map(|folder| format!("binaries/{folder}/{library}"));
        let libraries: Vec<String> = libraries.collect();
        let library = libraries.iter().map(|name| inside(name)).find(|path| path.is_file());
        let library = library.ok_or_else(|| LoadError::NoLibrary(libraries.join(", ")))?;
        let library = library::load(&library).map_err(LoadError::Library)?;
        let master = {
            let target = name.to_owned();
            let hear = move |Line { status, text, .. }| {
                let level = match status {
                    Status::Ok => log::Level::Info,
                    Status::Warning => log::Level::Warn,
                    Status::Discard => log::Level::Trace,
                    _ => log::Level::Error,
                };
                log::log!(target: &target, level, "{text}");
            };
            let [name, guid, resources] = [name, &description.guid, &uri(&inside("resources"))].map(c_string);
            let kind = Interface::CoSimulation as _;
            // SAFETY: the library is one of FMI 2.0, and is unloaded after the instance.
            unsafe {
                let functions = Functions::of(&library);
                let hear = Box::new(hear);
                Master::new(
                    functions,
                    name.as_ptr(),
                    kind,
                    guid.as_ptr(),
                    resources.as_ptr(),
                    true,
                    hear,
                )
            }
        };
        if master.c.is_null() {
            return Err(LoadError::Instantiate);
        }
        Ok(Self {
            master,
            _library: library,
            _unpacked: unpacked,
            description,
            path: path.into(),
            time: 0.0,
        })
    }

    /// The variable of that name and kind, if there is one.
    pub fn find(&self, kind: Kind, name: &str) -> Option<Reference> {
        let variable = self.description.variable(name)?;
        let found = match variable.content()?.0 {
            fmi2_description::Kind::Real => Kind::Real,
            fmi2_description::Kind::Integer => Kind::Integer,
            fmi2_description::Kind::Boolean => Kind::Boolean,
            _ => return None,
        };
        (found == kind).then_some(variable.value_reference)
    }

    /// The variable of that name and kind.
    pub fn need(&self, kind: Kind, name: &str) -> Result<Reference, FmuError> {
        self.find(kind, name)
            .ok_or_else(|| FmuError::Variable { path: self.path.clone(), kind, name: name.into() })
    }

    /// The variable that `names` has for `ours`, and its factor. A name that the user gave must exist.
    pub fn named(&self, kind: Kind, names: &Names, ours: &str) -> Result<Option<Named>, FmuError> {
        let Name { name, factor } = names.of(ours);
        match names.mapped(ours) {
            Some(_) => self.need(kind, &name).map(|reference| Some((reference, factor))),
            None => Ok(self.find(kind, &name).map(|reference| (reference, factor))),
        }
    }

    /// The same for a variable without a unit.
    pub fn switch(&self, kind: Kind, names: &Names, ours: &str) -> Result<Option<Reference>, FmuError> {
        Ok(self.named(kind, names, ours)?.map(|(reference, _)| reference))
    }

    /// The same for a variable that the bench needs.
    pub fn need_named(&self, kind: Kind, names: &Names, ours: &str) -> Result<Named, FmuError> {
        let missing = || FmuError::Variable { path: self.path.clone(), kind, name: ours.into() };
        self.named(kind, names, ours)?.ok_or_else(missing)
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
            self.ask("take its parameters", |m| match value {
                Value::Real(x) => m.set_reals(&reference, &[x / factor]),
                Value::Integer(n) => m.set_integers(&reference, &[n]),
                Value::Boolean(b) => m.set_booleans(&reference, &[b.into()]),
            })?;
        }
        if !missing.is_empty() {
            let path = self.path.display();
            log::warn!("{path} has no {}; it uses its own values instead", missing.join(", "));
        }
        self.ask("start", Master::start)
    }

    /// One step of `step` seconds.
    pub fn step(&mut self, step: f64) -> Result<(), FmuError> {
        let time = self.time;
        self.ask("advance", |m| m.step(time, step))?;
        self.time += step;
        Ok(())
    }

    /// Values of real variables, SI units.
    pub fn read<const N: usize>(&mut self, action: &'static str, variables: [Named; N]) -> Result<[f64; N], FmuError> {
        let (references, mut values) = (variables.map(|(reference, _)| reference), [0.0; N]);
        self.ask(action, |m| m.get_reals(&references, &mut values))?;
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
        self.ask(action, |m| m.set_reals(&references, &values))
    }

    /// Value of an integer variable.
    pub fn integer(&mut self, action: &'static str, reference: Reference) -> Result<i32, FmuError> {
        let mut value = [0];
        self.ask(action, |m| m.get_integers(&[reference], &mut value))?;
        Ok(value[0])
    }

    /// Calls the FMU; `action` completes the message "refused to …".
    pub fn ask(&mut self, action: &'static str, call: impl FnOnce(&Master) -> Answer) -> Result<(), FmuError> {
        done(call(&self.master)).map_err(|source| FmuError::Refused {
            path: self.path.clone(),
            action,
            time: self.time,
            source,
        })
    }
}

/// Refuses names in the scene that are not among `known`, separated by commas.
pub(super) fn names_are_known(names: &Names, known: &str) -> Result<(), FmuError> {
    let list: Vec<&str> = known.split(", ").collect();
    names.unknown(&list).map_or(Ok(()), |name| {
        Err(FmuError::Name { name: name.into(), known: known.into() })
    })
}

fn c_string(text: &str) -> CString {
    CString::new(text.replace('\0', "")).unwrap_or_default()
}

/// The address of a file (RFC 8089).
fn uri(path: &Path) -> String {
    const RESERVED: &AsciiSet = &NON_ALPHANUMERIC
        .remove(b'/')
        .remove(b':')
        .remove(b'.')
        .remove(b'-')
        .remove(b'_');
    let path = path.to_string_lossy().replace('\\', "/");
    let path = utf8_percent_encode(&path, RESERVED).to_string();
    format!("file:///{}", path.trim_start_matches('/'))
}

#[cfg(test)]
#[path = "../tests/unit/instance.rs"]
mod tests;
