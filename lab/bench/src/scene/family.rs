//! A scene some of whose numbers vary.

use serde::Deserialize;
use toml::{Table, Value};

use super::{Override, PAPER, Scene, SceneError, error::plain, overrides, sections::Sections};

/// A scene in which the numbers under some keys vary; the other values are read once.
#[derive(Debug, Clone)]
pub struct Family {
    origin: String,
    sections: Sections,
    /// The file with its overrides.
    table: Table,
    /// Section and key of every number that varies.
    keys: Vec<[String; 2]>,
}

impl Family {
    /// Reads a scene from `text`, or the default scene without one; nothing varies yet.
    pub fn parse(origin: &str, text: Option<&str>, overrides: &[Override]) -> Result<Self, SceneError> {
        let (origin, text) = text.map_or(("paper.toml (the default scene)", PAPER), |text| (origin, text));
        let (sections, table) = overrides::read(origin, text, overrides)?;
        sections.clone().resolve(origin)?.controller_config().build()?;
        Ok(Self { origin: origin.into(), sections, table, keys: Vec::new() })
    }

    /// Lets the number under `section.key` vary too.
    pub fn vary(&mut self, key: &str) -> Result<(), SceneError> {
        let refused = |message: &str| SceneError::Keys { origin: format!("axis {key}"), message: message.into() };
        let form = || refused("expected sigma or section.key, for instance plant.r");
        let one: Override = format!("{key} = 1").parse().map_err(|_| form())?;
        let table = overrides::merge(self.table.clone(), &[one]).map_err(|error| match error {
            SceneError::Override { message, .. } => refused(&message),
            error => error,
        })?;
        self.sections = Sections::deserialize(table.clone()).map_err(|error| refused(&plain(error.message())))?;
        let (section, key) = key.split_once('.').ok_or_else(form)?;
        self.keys.push([section.trim().into(), key.trim().into()]);
        self.table = table;
        Ok(())
    }

    /// The scene with these values under the keys that vary, in the order in which the keys were given.
    pub fn scene(&self, values: &[f64]) -> Result<Scene, SceneError> {
        let mut sections = self.sections.clone();
        let mut changed: Vec<&str> = self.keys.iter().map(|[section, _]| section.as_str()).collect();
        changed.sort_unstable();
        changed.dedup();
        for section in changed {
            let mut table = match self.table.get(section) {
                Some(Value::Table(table)) => table.clone(),
                _ => Table::new(),
            };
            for ([_, key], value) in self.keys.iter().zip(values).filter(|([one, _], _)| one == section) {
                table.insert(key.clone(), number(*value));
            }
            sections.replace(section, table).map_err(|error| SceneError::Keys {
                origin: self.origin.clone(),
                message: format!("[{section}] {}", plain(error.message())),
            })?;
        }
        sections.resolve(&self.origin)
    }
}

/// A whole number as an integer: some keys are counts.
fn number(value: f64) -> Value {
    if value.fract() == 0.0 && value.abs() < 2_f64.powi(53) {
        Value::Integer(value as i64)
    } else {
        Value::Float(value)
    }
}
