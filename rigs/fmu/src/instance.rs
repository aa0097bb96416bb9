//! An FMU as part of the bench: its variables are found by name and converted to SI units, and its time is kept.

use std::path::{Path, PathBuf};

use fmi2_description::{Causality, Description, FmiType, Initial, ScalarVariable, Variability};
use phase_lock::Value;
use thiserror::Error;
use vines_rig::{Clock, ControllerError, RigError};
use vines_rig::{Name, Names};

use crate::archive::Unpacked;
use crate::library::Instance;
use crate::units::{Scale, is_unit_of, scale};

/// Reason why an FMU cannot be used, or cannot continue.
#[derive(Debug, Error)]
#[expect(missing_docs, reason = "the messages explain the variants")]
pub enum FmuError {
    #[error("cannot load {} as an FMU: {reason}", path.display())]
    Load {
        path: PathBuf,
        reason: String,
        obstacle: Option<Obstacle>,
    },
    #[error("{} has no variable `{name}` that is a number or a Boolean, which the bench needs; [rig.names] and [controller_names] of \
             the scene map names", path.display())]
    Variable { path: PathBuf, name: String },
    #[error(
        "[rig.names] or [controller_names] of the scene maps `{name}`, which this bench does not have; it has: {names}"
    )]
    Name { name: String, names: String },
    #[error("{} declares `{name}` in {unit}, {} {}; correct its unit, or map it with one in [rig.names] or \
             [controller_names] of the scene, such as {name} = {{ name = \"{name}\", factor = 1.0 }}",
            path.display(),
            if *defined { "which is not converted to" } else { "a unit that its description does not define, and that is not known to be one of" },
            if ours.is_empty() { "a pure number" } else { ours })]
    Unit {
        path: PathBuf,
        name: String,
        unit: String,
        ours: &'static str,
        /// Whether the description defines the unit.
        defined: bool,
    },
    #[error("{} declares `{name}` as {}, and the bench {}; FMI 2.0 (section 2.2.7) allows that for {} only. Correct its causality, or map \
             another variable in [rig.names] or [controller_names] of the scene", path.display(), causality_in_words(*causality),
            of.in_words()[0], of.in_words()[1])]
    Causality {
        path: PathBuf,
        name: String,
        causality: Causality,
        of: Use,
    },
    #[error(
        "[rig.names] or [controller_names] of the scene gives `{name}` a unit of {unit}, and the bench needs one of {ours}; velocities and \
             accelerations of response and base are named by resonance.sensor_quantity and resonance.reference_quantity"
    )]
    Quantity {
        name: String,
        unit: String,
        ours: &'static str,
    },
    #[error("{} makes fixed steps of {fixed} s, and the bench samples every {sample} s, which is not a multiple: multiply \
             controller.samples_per_period by {} to sample at each of its steps", path.display(), sample / fixed)]
    Step { path: PathBuf, fixed: f64, sample: f64 },
    #[error("{file} refused to {action} at t = {time} s: {reason}")]
    Refused {
        file: String,
        action: &'static str,
        time: f64,
        reason: String,
    },
}

/// What keeps this computer from loading an FMU, and can be changed there.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Obstacle {
    /// Nothing can be written to the temporary folder.
    NoFolder,
    /// The file system of the temporary folder may be mounted noexec.
    NoExecution,
    /// The library needs Python in this program.
    Python,
    /// The library needs another one.
    Library,
}

impl FmuError {
    /// An FMU that cannot be loaded for a reason that this crate or the loader of the system gives.
    pub(crate) fn load(path: &Path, reason: String) -> Self {
        let obstacle = [
            ("it cannot be unpacked to", Obstacle::NoFolder),
            ("failed to map segment", Obstacle::NoExecution),
            ("undefined symbol: Py", Obstacle::Python),
            ("undefined symbol: _Py", Obstacle::Python),
            ("cannot open shared object file", Obstacle::Library),
        ];
        let obstacle = obstacle.into_iter().find(|(part, _)| reason.contains(part));
        Self::Load {
            path: path.into(),
            reason,
            obstacle: obstacle.map(|(_, obstacle)| obstacle),
        }
    }
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

/// What the bench does with a variable.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Use {
    /// Sets it before the start: a parameter or a start value.
    Start,
    /// Sets it at samples.
    Set,
    /// Reads it.
    Get,
}

impl Use {
    /// What the bench does, and for which variables FMI allows it.
    fn in_words(self) -> [&'static str; 2] {
        match self {
            Self::Start => [
                "sets it before the start",
                "inputs, parameters and start values that are not calculated",
            ],
            Self::Set => ["sets it at samples", "inputs and tunable parameters"],
            Self::Get => ["reads it", "variables other than inputs"],
        }
    }

    /// Whether FMI 2.0 allows it (sections 2.2.7 and 4.2.4). Reading an input is allowed, and says nothing of the FMU.
    fn is_allowed(self, variable: &ScalarVariable) -> bool {
        let ScalarVariable { causality, variability, initial, .. } = variable;
        match (self, causality) {
            (Self::Get, causality) => *causality != Causality::Input,
            (_, Causality::Input) => true,
            (Self::Start, Causality::Parameter) => true,
            (Self::Start, Causality::Independent) => false,
            (Self::Start, _) => {
                matches!(initial, Some(Initial::Exact | Initial::Approx)) && *variability != Variability::Constant
            }
            (Self::Set, Causality::Parameter) => *variability == Variability::Tunable,
            (Self::Set, _) => false,
        }
    }
}

fn causality_in_words(causality: Causality) -> &'static str {
    match causality {
        Causality::Parameter => "a parameter that is not tunable",
        Causality::CalculatedParameter => "a calculated parameter",
        Causality::Input => "an input",
        Causality::Output => "an output",
        Causality::Local => "a local variable",
        Causality::Independent => "the independent variable",
    }
}

/// A variable that the bench uses where an FMU has it: its name, its SI unit, and the FMU's variable.
#[derive(Clone, Debug)]
pub struct Connection {
    /// The name on the bench.
    pub ours: String,
    /// The SI unit; empty: a number without a unit.
    pub si: &'static str,
    /// The name in the FMU, and the unit that it declares; `None`: the FMU lacks the variable.
    pub theirs: Option<(String, Option<String>)>,
    /// SI units per unit of the FMU's variable.
    pub factor: f64,
    /// Whether the bench would set it before the start, and its causality does not allow that.
    pub keeps_its_start: bool,
    pub(super) variable: Option<Variable>,
}

/// A variable: its type, its value reference, and what its values mean.
#[derive(Clone, Copy, Debug)]
pub(super) struct Variable {
    kind: FmiType,
    reference: u32,
    scale: Scale,
    causality: Causality,
    /// Whether it can be used as [`Use`] says, in this order.
    allows: [bool; 3],
}

impl Variable {
    fn allows(&self, of: Use) -> bool {
        self.allows[of as usize]
    }
}

/// A loaded FMU at its simulated time.
pub(super) struct Fmu {
    // Dropped before the unpacked library.
    instance: Instance,
    _unpacked: Unpacked,
    path: PathBuf,
    connections: Vec<Connection>,
    /// Length of its steps, if that is fixed, s.
    fixed: Option<f64>,
    clock: Clock,
}

impl Fmu {
    /// Loads the FMU at `path`; `role` is its name in log messages, and `bench` has the names and SI units of what the bench uses. It is
    /// stepped by `sample` s.
    pub fn load(
        path: &Path,
        role: &str,
        names: &Names,
        bench: &[(String, &'static str)],
        sample: f64,
    ) -> Result<Self, FmuError> {
        let (unpacked, connections) = unpack(path, names, bench)?;
        let description = &unpacked.description;
        if !description.left_out.is_empty() {
            let left_out = description.left_out.join(", ");
            log::warn!("{}: its description has, beyond FMI 2.0, {left_out}", path.display());
        }
        let fixed = fixed_step(description);
        let instance =
            Instance::new(&unpacked, role, &file_name(path)).map_err(|reason| FmuError::load(path, reason))?;
        let (path, clock) = (path.into(), Clock::default());
        let fmu = Self {
            instance,
            _unpacked: unpacked,
            path,
            connections,
            fixed,
            clock,
        };
        fmu.steps(sample)?;
        Ok(fmu)
    }

    /// The variable for `ours`.
    pub fn find(&self, ours: &str, of: Use) -> Option<Variable> {
        let connection = self.connections.iter().find(|one| one.ours == ours)?;
        let variable = connection.variable?;
        if !variable.allows(of) && of != Use::Start {
            log::warn!("{}; it is not used", self.unusable(connection, variable, of));
        }
        Some(variable).filter(|variable| variable.allows(of))
    }

    /// A variable that the bench needs.
    pub fn need(&self, ours: &str, of: Use) -> Result<Variable, FmuError> {
        let connection = self.connections.iter().find(|one| one.ours == ours);
        let missing = || FmuError::Variable { path: self.path.clone(), name: ours.into() };
        let found = connection.and_then(|one| Some((one, one.variable?)));
        let (connection, variable) = found.ok_or_else(missing)?;
        match variable.allows(of) {
            true => Ok(variable),
            false => Err(self.unusable(connection, variable, of)),
        }
    }

    fn unusable(&self, Connection { ours, theirs, .. }: &Connection, variable: Variable, of: Use) -> FmuError {
        FmuError::Causality {
            path: self.path.clone(),
            name: theirs.as_ref().map_or(ours, |(name, _)| name).clone(),
            causality: variable.causality,
            of,
        }
    }

    /// Sets the values that the FMU has variables for, and initialises it at time 0. It keeps its own values for the others.
    pub fn start(&mut self, values: &[(&str, Value)]) -> Result<(), FmuError> {
        for &(name, value) in values {
            let value = match value {
                Value::Real(value) => value,
                Value::Integer(value) => value.into(),
                Value::Boolean(value) => f64::from(u8::from(value)),
            };
            if let Some(variable) = self.find(name, Use::Start) {
                self.set(variable, value)?;
            }
        }
        let started = self.instance.start();
        self.refused("start", started)
    }

    /// Steps by `step` seconds: at once, or in its own fixed steps.
    pub fn step(&mut self, step: f64) -> Result<(), FmuError> {
        let (count, length) = self.steps(step)?;
        for _ in 0..count {
            let stepped = self.instance.step(self.clock.time(), length);
            self.refused("advance", stepped)?;
            self.clock.advance(length);
        }
        Ok(())
    }

    /// Number and length of its steps in `step` seconds.
    fn steps(&self, step: f64) -> Result<(u32, f64), FmuError> {
        let Some(fixed) = self.fixed else {
            return Ok((1, step));
        };
        let count = (step / fixed).round();
        // The digits in which a description gives its step.
        if !(1.0..=1e6).contains(&count) || (count * fixed - step).abs() > 1e-9 * step {
            return Err(FmuError::Step { path: self.path.clone(), fixed, sample: step });
        }
        Ok((count as u32, fixed))
    }

    /// Value of a variable, SI units; of a boolean one 0 or 1.
    pub fn get(&mut self, variable: Variable) -> Result<f64, FmuError> {
        let Variable { kind, reference, scale, .. } = variable;
        let value = self.instance.get(kind, reference);
        let value = self.refused("give a value", value)?;
        Ok(scale.factor * value + scale.offset)
    }

    /// Value of a variable that the FMU may lack.
    pub fn get_if(&mut self, variable: Option<Variable>) -> Result<Option<f64>, FmuError> {
        variable.map(|variable| self.get(variable)).transpose()
    }

    /// Sets a variable, SI units.
    pub fn set(&mut self, variable: Variable, value: f64) -> Result<(), FmuError> {
        let Variable { kind, reference, scale, .. } = variable;
        let set = self
            .instance
            .set(kind, reference, (value - scale.offset) / scale.factor);
        self.refused("take a value", set)
    }

    /// The error of a call; `action` completes the message "refused to …".
    fn refused<T>(&self, action: &'static str, done: Result<T, String>) -> Result<T, FmuError> {
        let (file, time) = (file_name(&self.path), self.clock.time());
        done.map_err(|reason| FmuError::Refused { file, action, time, reason })
    }
}

/// The name of a file: the plant's own FMU lies in a temporary folder, whose path says nothing.
fn file_name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// What of `bench` the FMU at `path` has; `starts`: what the bench sets before the start.
pub(super) fn connections(
    path: &Path,
    names: &Names,
    bench: &[(String, &'static str)],
    starts: &[&str],
) -> Result<Vec<Connection>, FmuError> {
    let mut connections = unpack(path, names, bench)?.1;
    for one in &mut connections {
        let keeps = one.variable.is_some_and(|variable| !variable.allows(Use::Start));
        one.keeps_its_start = keeps && starts.contains(&one.ours.as_str());
    }
    Ok(connections)
}

/// Unpacks an FMU, and finds what of `bench` it has.
pub(super) fn unpack(
    path: &Path,
    names: &Names,
    bench: &[(String, &'static str)],
) -> Result<(Unpacked, Vec<Connection>), FmuError> {
    let list: Vec<&str> = bench.iter().map(|(name, _)| name.as_str()).collect();
    if let Some(name) = names.unknown(&list) {
        return Err(FmuError::Name { name: name.into(), names: list.join(", ") });
    }
    let unpacked = Unpacked::new(path).map_err(|reason| FmuError::load(path, reason))?;
    let connections = bench
        .iter()
        .map(|(ours, si)| connect(ours, si, names, &unpacked.description, path));
    let connections = connections.collect::<Result<_, _>>()?;
    Ok((unpacked, connections))
}

/// The variable for `ours`. A name that the user gave must exist.
fn connect(
    ours: &str,
    si: &'static str,
    names: &Names,
    description: &Description,
    path: &Path,
) -> Result<Connection, FmuError> {
    let Name { name, factor, si: given, is_explicit } = names.of(ours);
    if let Some(unit) = given.filter(|given| !is_unit_of(given, si)) {
        let unit = unit.into();
        return Err(FmuError::Quantity { name: ours.into(), unit, ours: si });
    }
    let is_number = |variable: &&ScalarVariable| {
        let kind = variable.content().map(|(kind, _)| kind);
        variable.name == name && kind.is_some_and(|kind| kind != FmiType::String)
    };
    let Some((variable, (kind, _))) = description
        .variables
        .iter()
        .find(is_number)
        .and_then(|variable| Some((variable, variable.content()?)))
    else {
        return match names.mapped(ours) {
            Some(_) => Err(FmuError::Variable { path: path.into(), name }),
            None => Ok(Connection {
                ours: ours.into(),
                si,
                theirs: None,
                factor,
                keeps_its_start: false,
                variable: None,
            }),
        };
    };
    let unit = description.unit_of(variable);
    let scale = match unit {
        Some(unit) if !is_explicit => {
            let base = description.base_unit(unit);
            let (scale, unit) = (scale(unit, base, si), unit.to_owned());
            let (path, name, defined) = (path.into(), ours.into(), base.is_some());
            scale.ok_or(FmuError::Unit { path, name, unit, ours: si, defined })?
        }
        _ => Scale { factor, offset: 0.0 },
    };
    Ok(Connection {
        ours: ours.into(),
        si,
        factor: scale.factor,
        keeps_its_start: false,
        variable: Some(Variable {
            kind,
            reference: variable.value_reference,
            scale,
            causality: variable.causality,
            allows: [Use::Start, Use::Set, Use::Get].map(|of| of.is_allowed(variable)),
        }),
        theirs: Some((name, unit.map(str::to_owned))),
    })
}

/// The length of its steps, s, if it can make no others. Where the description does not give it, any constant step will do.
fn fixed_step(description: &Description) -> Option<f64> {
    let interface = description.co_simulation.as_ref()?;
    let step = description.default_experiment.step_size.as_ref()?.trim().parse().ok()?;
    (!interface.can_handle_variable_communication_step_size && step > 0.0 && f64::is_finite(step)).then_some(step)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_that_is_not_an_archive_is_refused() {
        let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/Cargo.toml"));
        let message = Fmu::load(path, "rig", &Names::default(), &[], 1.0)
            .err()
            .unwrap()
            .to_string();
        assert!(
            message.contains("Cargo.toml") && message.contains("zip archive"),
            "{message}"
        );
    }
}
