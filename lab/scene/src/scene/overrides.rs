//! `--set section.key=value`: one value of a scene replaced from the command line, written as in TOML; text needs no quotes.

use std::fmt;
use std::str::FromStr;

use serde::Deserialize;
use toml::{Table, Value};
use vines_model::ArgumentError;

use super::{PAPER, Scene, SceneError, Sections, plain};

/// One replaced value.
#[derive(Debug, Clone)]
pub struct Override {
    argument: String,
    section: String,
    key: String,
    value: Value,
}

impl FromStr for Override {
    type Err = ArgumentError;

    fn from_str(argument: &str) -> Result<Self, ArgumentError> {
        // What is not TOML is text: the shell takes quotes away.
        let text = || {
            let (key, word) = argument.split_once('=')?;
            format!("{key}={:?}", word.trim()).parse().ok()
        };
        let expected = "expected section.key=value, for instance plant.r=0.7 or resonance.sensor=q1";
        let parsed: Result<Table, toml::de::Error> = argument.parse().or_else(|error| text().ok_or(error));
        let table = parsed.map_err(|error| format!("{}; {expected}", error.message()))?;
        let single = |table: Table| {
            let mut entries = table.into_iter();
            entries.next().filter(|_| entries.next().is_none())
        };
        let (section, keys) = match single(table) {
            Some((section, Value::Table(keys))) => (section, single(keys)),
            _ => (String::new(), None),
        };
        let (key, value) = keys.ok_or(expected)?;
        Ok(Self { argument: argument.into(), section, key, value })
    }
}

impl fmt::Display for Override {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(&self.argument)
    }
}

impl Override {
    /// A refusal of this setting.
    fn error(&self, message: impl Into<String>) -> SceneError {
        SceneError::Override { argument: self.argument.clone(), message: message.into() }
    }

    fn merge_into(&self, scene: &mut Table) -> Result<(), SceneError> {
        let section = scene.entry(&self.section).or_insert_with(|| Value::Table(Table::new()));
        let Value::Table(section) = section else {
            return Err(self.error(format!("`{}` is not a section", self.section)));
        };
        // Amplitude of the drive: the key that is set replaces the others.
        const DRIVE_KEYS: [&str; 3] = ["G", "E", "F"];
        if self.section == "excitation" && DRIVE_KEYS.contains(&self.key.as_str()) {
            DRIVE_KEYS.iter().for_each(|key| drop(section.remove(*key)));
        }
        match (section.get_mut(&self.key), &self.value) {
            (Some(Value::Table(group)), Value::Table(set)) => group.extend(set.clone()),
            _ => _ = section.insert(self.key.clone(), self.value.clone()),
        }
        Ok(())
    }
}

/// `table` with the overrides applied one by one, so that an error names the argument that caused it; a new section, which may need several keys, is
/// checked with the last of them.
pub(super) fn merge(mut table: Table, overrides: &[Override]) -> Result<Table, SceneError> {
    let sets = |key| {
        overrides
            .iter()
            .find(|change| change.section == "excitation" && change.key == key)
    };
    if let (Some(_), Some(second)) = (sets("G"), sets("E")) {
        return Err(second.error("excitation.G is set as well: set one of them"));
    }
    let before = table.clone();
    for (n, change) in overrides.iter().enumerate() {
        change.merge_into(&mut table)?;
        let is_of_section = |other: &Override| other.section == change.section;
        if !before.contains_key(&change.section) && overrides[n + 1..].iter().any(is_of_section) {
            continue;
        }
        let sections = Sections::deserialize(table.clone()).map_err(|error| change.error(plain(error.message())))?;
        sections.plant.is_si().map_err(|message| change.error(message))?;
    }
    Ok(table)
}

/// Reads a scene from `text` with the overrides merged into it; with the merged table. `origin` names the text in messages.
pub(super) fn read(origin: &str, text: &str, overrides: &[Override]) -> Result<(Scene, Table), SceneError> {
    let syntax = |error: toml::de::Error| SceneError::text(origin, plain(&error.to_string()));
    // The file is checked on its own first, so that an error can name the line.
    toml::from_str::<Sections>(text).map_err(syntax)?;
    let mut table: Table = toml::from_str(text).map_err(syntax)?;
    // The default scene does not say what a sensor reads: its key is there for readers, and has the default.
    if text == PAPER
        && let Some(Value::Table(resonance)) = table.get_mut("resonance")
    {
        resonance.remove("sensor");
    }
    let table = merge(table, overrides)?;
    let scene = Sections::deserialize(table.clone())
        .map_err(syntax)?
        .resolve(origin, &table)?;
    scene.check_controller()?;
    Ok((scene, table))
}

// A scene some of whose numbers vary.

/// A scene in which the numbers under some keys vary.
#[derive(Debug, Clone)]
pub struct Family {
    origin: String,
    /// The file with its overrides.
    table: Table,
    /// Section and key of every number that varies.
    keys: Vec<[String; 2]>,
}

impl Family {
    /// Reads a scene from `text`, or the default scene without one; nothing varies yet.
    pub fn parse(origin: &str, text: Option<&str>, overrides: &[Override]) -> Result<Self, SceneError> {
        let (origin, text) = text.map_or(("paper.toml (the default scene)", PAPER), |text| (origin, text));
        let (_, table) = read(origin, text, overrides)?;
        Ok(Self { origin: origin.into(), table, keys: Vec::new() })
    }

    /// Lets the number under `section.key` vary too.
    pub fn vary(&mut self, key: &str) -> Result<(), SceneError> {
        let refused = |message: &str| SceneError::text(&format!("axis {key}"), message);
        let form = || refused("expected sigma or section.key, for instance plant.r");
        let change: Override = format!("{key} = 1").parse().map_err(|_| form())?;
        self.table = merge(self.table.clone(), &[change]).map_err(|error| match error {
            SceneError::Override { message, .. } => refused(&message),
            error => error,
        })?;
        let (section, key) = key.split_once('.').ok_or_else(form)?;
        self.keys.push([section.trim().into(), key.trim().into()]);
        Ok(())
    }

    /// The scene with these values under the keys that vary, in the order in which the keys were given.
    pub fn scene(&self, values: &[f64]) -> Result<Scene, SceneError> {
        let mut table = self.table.clone();
        for ([section, key], value) in self.keys.iter().zip(values) {
            if let Some(Value::Table(section)) = table.get_mut(section) {
                section.insert(key.clone(), number(*value));
            }
        }
        let refused = |error: toml::de::Error| SceneError::text(&self.origin, plain(error.message()));
        Sections::deserialize(table.clone())
            .map_err(refused)?
            .resolve(&self.origin, &table)
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
