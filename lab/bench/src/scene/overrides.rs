//! `--set section.key=value`: one value of a scene replaced from the command line.

use std::str::FromStr;

use toml::{Table, Value};

use super::{
    SceneError,
    plant::{DIMENSIONLESS_KEYS, SI_KEYS},
    raw::Raw,
};

/// One replaced value; parse it from `section.key=value`, where the value is written as in TOML.
#[derive(Debug, Clone)]
pub struct Override {
    argument: String,
    section: String,
    key: String,
    value: Value,
}

impl FromStr for Override {
    type Err = String;

    fn from_str(argument: &str) -> Result<Self, String> {
        let form = "expected section.key=value, for instance plant.r=0.7";
        let (path, value) = argument.split_once('=').ok_or(form)?;
        let (section, key) = path.trim().split_once('.').ok_or(form)?;
        let value = value
            .trim()
            .parse()
            .map_err(|_| format!("`{}` is not a TOML value such as 0.7", value.trim()))?;
        Ok(Self {
            argument: argument.into(),
            section: section.trim().into(),
            key: key.trim().into(),
            value,
        })
    }
}

impl Override {
    fn error(&self, message: impl Into<String>) -> SceneError {
        SceneError::Override {
            argument: self.argument.clone(),
            message: message.into(),
        }
    }

    fn is(&self, section: &str, key: &str) -> bool {
        self.section == section && self.key == key
    }

    /// A plant is given in one set of units; a key of the other would silently mean something else.
    fn check_units(&self, plant: &Table) -> Result<(), SceneError> {
        let key = self.key.as_str();
        let has = |keys: &[&str]| keys.iter().any(|key| plant.contains_key(*key));
        if DIMENSIONLESS_KEYS.contains(&key) && has(&SI_KEYS) {
            return Err(self.error(
                "this scene gives its plant in SI units; set plant.m and plant.c instead \
                 (epsilon = m/M, lambda = c/(m omega0)), or use a scene with epsilon and lambda",
            ));
        }
        if SI_KEYS.contains(&key) && has(&DIMENSIONLESS_KEYS) {
            return Err(self.error(
                "this scene gives its plant in dimensionless form; set plant.epsilon, plant.lambda or plant.r",
            ));
        }
        Ok(())
    }

    fn insert(&self, scene: &mut Table) -> Result<(), SceneError> {
        let section = scene
            .entry(&self.section)
            .or_insert_with(|| Value::Table(Table::new()));
        let Value::Table(section) = section else {
            return Err(self.error(format!("`{}` is not a section", self.section)));
        };
        if self.section == "plant" {
            self.check_units(section)?;
        }
        // G and E say the same thing: the one that is set replaces the other.
        if self.is("excitation", "E") {
            section.remove("G");
        } else if self.is("excitation", "G") {
            section.remove("E");
        }
        section.insert(self.key.clone(), self.value.clone());
        Ok(())
    }
}

/// Applies the overrides to the scene in both of its forms, the sections read and the table they were read from;
/// one by one, so that a mistake is blamed on the argument that made it.
pub(super) fn apply(
    mut raw: Raw,
    mut table: Table,
    overrides: &[Override],
) -> Result<Raw, SceneError> {
    let sets = |key| overrides.iter().find(|one| one.is("excitation", key));
    if let (Some(_), Some(second)) = (sets("G"), sets("E")) {
        return Err(second.error("excitation.G is set as well: set one of them"));
    }
    for one in overrides {
        one.insert(&mut table)?;
        raw = Raw::from_table(table.clone()).map_err(|error| one.error(error.message().trim()))?;
    }
    Ok(raw)
}
