//! `--set section.key=value`: one value of a scene replaced from the command line, written as in TOML; text needs no quotes.

use std::str::FromStr;

use serde::Deserialize;
use toml::{Table, Value};

use super::{DIMENSIONLESS_KEYS, PAPER, SI_KEYS, Scene, SceneError, Sections, SyntaxError, plain};

/// Keys of a section that say the same thing, dimensionless and in m.
const PAIRS: [(&str, [&str; 2]); 5] = [
    ("excitation", ["G", "E"]),
    ("controller", ["G_max", "E_max"]),
    ("backbone", ["G_max", "E_max"]),
    ("backbone", ["C_from", "A_from"]),
    ("backbone", ["C_to", "A_to"]),
];

/// One replaced value.
#[derive(Debug, Clone)]
pub struct Override {
    argument: String,
    section: String,
    key: String,
    value: Value,
}

impl FromStr for Override {
    type Err = SyntaxError;

    fn from_str(argument: &str) -> Result<Self, SyntaxError> {
        // What is not TOML is text: the shell takes quotes away.
        let text = || {
            let (key, word) = argument.split_once('=')?;
            format!("{key}={:?}", word.trim()).parse().ok()
        };
        let table: Table = argument.parse().or_else(|error| text().ok_or(error))?;
        let single = |table: Table| {
            let mut entries = table.into_iter();
            entries.next().filter(|_| entries.next().is_none())
        };
        let (section, keys) = match single(table) {
            Some((section, Value::Table(keys))) => (section, single(keys)),
            _ => (String::new(), None),
        };
        let (key, value) = keys.ok_or(SyntaxError::NotOneKey)?;
        Ok(Self { argument: argument.into(), section, key, value })
    }
}

impl Override {
    /// A refusal of this setting.
    fn error(&self, message: impl Into<String>) -> SceneError {
        SceneError::Override { argument: self.argument.clone(), message: message.into() }
    }

    fn is(&self, section: &str, key: &str) -> bool {
        self.section == section && self.key == key
    }

    /// A plant is given in one set of units; a key of the other would silently mean something else.
    fn check_units(&self, plant: &Table) -> Result<(), SceneError> {
        let is_in = |keys: &[&str]| keys.contains(&self.key.as_str());
        let has = |keys: &[&str]| keys.iter().any(|key| plant.contains_key(*key));
        if is_in(&DIMENSIONLESS_KEYS) && has(&SI_KEYS) {
            return Err(self.error(
                "this scene gives its plant in SI units; set plant.m and plant.c instead \
                 (epsilon = m/M, lambda = c/(m omega0)), or use a scene with epsilon and lambda",
            ));
        }
        if is_in(&SI_KEYS) && has(&DIMENSIONLESS_KEYS) {
            return Err(self.error(
                "this scene gives its plant in dimensionless form; set plant.epsilon, plant.lambda or plant.r",
            ));
        }
        Ok(())
    }

    fn merge_into(&self, scene: &mut Table) -> Result<(), SceneError> {
        let section = scene.entry(&self.section).or_insert_with(|| Value::Table(Table::new()));
        let Value::Table(section) = section else {
            return Err(self.error(format!("`{}` is not a section", self.section)));
        };
        if self.section == "plant" {
            self.check_units(section)?;
        }
        // The one that is set replaces the other.
        for (of, keys) in PAIRS {
            for (set, other) in [(0, 1), (1, 0)] {
                if self.is(of, keys[set]) {
                    section.remove(keys[other]);
                }
            }
        }
        match (section.get_mut(&self.key), &self.value) {
            (Some(Value::Table(group)), Value::Table(set)) => group.extend(set.clone()),
            _ => _ = section.insert(self.key.clone(), self.value.clone()),
        }
        Ok(())
    }
}

/// `table` with the overrides applied one by one, so that an error names the
/// argument that caused it.
pub(super) fn merge(mut table: Table, overrides: &[Override]) -> Result<Table, SceneError> {
    for (section, [one, other]) in PAIRS {
        let sets = |key| overrides.iter().find(|one| one.is(section, key));
        if let (Some(_), Some(second)) = (sets(one), sets(other)) {
            return Err(second.error(format!("{section}.{one} is set as well: set one of them")));
        }
    }
    for one in overrides {
        one.merge_into(&mut table)?;
        if let Err(error) = Sections::deserialize(table.clone()) {
            // What is refused for a word that is not known lists those that are.
            let text = one.argument.split_once('=').map_or("", |(_, text)| text.trim());
            let word = Override { value: text.into(), ..one.clone() };
            let listed = error.message().contains("unit variant") && word.merge_into(&mut table).is_ok();
            let error = Sections::deserialize(table).err().filter(|_| listed).unwrap_or(error);
            return Err(one.error(plain(error.message())));
        }
    }
    Ok(table)
}

/// The message of an error in `text`; for a number in the place of a word, with the words that are allowed.
fn message(error: &toml::de::Error, text: &str) -> String {
    let no_word = "wanted string or table";
    let quoted = error
        .span()
        .filter(|_| error.message().contains(no_word))
        .and_then(|place| {
            let mut text = text.to_string();
            text.replace_range(place.clone(), &format!("{:?}", &text[place]));
            toml::from_str::<Sections>(&text).err()
        });
    let listed = quoted.map_or(no_word.into(), |error| error.message().to_string());
    plain(&error.to_string().replace(no_word, &listed))
}

/// Reads `text` and merges the overrides into it; with the merged table. `origin` names the text in messages.
pub(super) fn read(origin: &str, text: &str, overrides: &[Override]) -> Result<(Sections, Table), SceneError> {
    let syntax = |error: toml::de::Error| SceneError::Syntax { origin: origin.into(), message: message(&error, text) };
    // The file is checked on its own first, so that an error can name the line.
    toml::from_str::<Sections>(text).map_err(syntax)?;
    let table = merge(toml::from_str(text).map_err(syntax)?, overrides)?;
    Ok((Sections::deserialize(table.clone()).map_err(syntax)?, table))
}

// A scene some of whose numbers vary.

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
        let (sections, table) = read(origin, text, overrides)?;
        sections.clone().resolve(origin)?.controller_config().build()?;
        Ok(Self { origin: origin.into(), sections, table, keys: Vec::new() })
    }

    /// Lets the number under `section.key` vary too.
    pub fn vary(&mut self, key: &str) -> Result<(), SceneError> {
        let refused = |message: &str| SceneError::Keys { origin: format!("axis {key}"), message: message.into() };
        let form = || refused("expected sigma or section.key, for instance plant.r");
        let one: Override = format!("{key} = 1").parse().map_err(|_| form())?;
        let table = merge(self.table.clone(), &[one]).map_err(|error| match error {
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
