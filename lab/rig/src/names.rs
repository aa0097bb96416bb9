//! `[rig.names]` and `[controller_names]`: the user's names for the variables of a rig or a controller, with their units.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use vines_model::ArgumentError;

use crate::unit::UNITS;

/// A variable of a rig or a controller.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "NameSection", into = "NameSection")]
pub struct Name {
    /// Its name there.
    pub name: String,
    /// SI units per unit of the variable; negative for the opposite sign.
    pub factor: f64,
    /// The SI unit, if the scene gives a unit.
    #[serde(skip)]
    pub si: Option<&'static str>,
    /// Whether the scene gives its unit or factor, against what a variable may declare itself.
    pub is_explicit: bool,
}

/// As written: `"name"`, or a table with `name` and one of `unit` and `factor`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged, deny_unknown_fields)]
enum NameSection {
    Plain(String),
    Full {
        name: String,
        #[serde(skip_serializing_if = "Option::is_none")]
        unit: Option<String>,
        #[serde(skip_serializing_if = "Option::is_none")]
        factor: Option<f64>,
    },
}

impl Name {
    /// A variable in a unit.
    ///
    /// # Errors
    /// An unknown unit.
    pub fn with_unit(name: &str, unit: &str) -> Result<Self, ArgumentError> {
        let Some((_, factor, si)) = UNITS.into_iter().find(|(symbol, ..)| *symbol == unit) else {
            let symbols = UNITS.map(|(symbol, ..)| symbol).join(", ");
            return Err(format!("{name}: the unit {unit} is unknown; known are {symbols}, or give a factor").into());
        };
        Ok(Self { name: name.into(), factor, si: Some(si), is_explicit: true })
    }
}

impl TryFrom<NameSection> for Name {
    type Error = ArgumentError;

    fn try_from(written: NameSection) -> Result<Self, ArgumentError> {
        let (name, unit, factor) = match written {
            NameSection::Plain(name) => (name, None, None),
            NameSection::Full { name, unit, factor } => (name, unit, factor),
        };
        let is_explicit = factor.is_some();
        let factor = match (unit, factor) {
            (Some(_), Some(_)) => return Err(format!("{name}: give a unit or a factor, not both").into()),
            (Some(unit), None) => return Self::with_unit(&name, &unit),
            (None, factor) => factor.unwrap_or(1.0),
        };
        if !factor.is_finite() || factor == 0.0 {
            return Err(format!("{name}: the factor {factor} must be a finite number other than 0").into());
        }
        Ok(Self { name, factor, si: None, is_explicit })
    }
}

impl From<Name> for NameSection {
    fn from(Name { name, factor, is_explicit, .. }: Name) -> Self {
        match is_explicit {
            true => Self::Full { name, unit: None, factor: Some(factor) },
            false => Self::Plain(name),
        }
    }
}

/// The names that differ, by the names of this bench.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Names(BTreeMap<String, Name>);

impl Names {
    /// The variable for `ours`; if it is not mapped, it has the same name, in SI units.
    pub fn of(&self, ours: &str) -> Name {
        let same = || Name { name: ours.into(), factor: 1.0, si: None, is_explicit: false };
        self.mapped(ours).cloned().unwrap_or_else(same)
    }

    /// The variable for `ours`, if it is mapped.
    pub fn mapped(&self, ours: &str) -> Option<&Name> {
        self.0.get(ours)
    }

    /// Whether nothing is mapped.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// A name that is mapped and not among `known`.
    pub fn unknown(&self, known: &[&str]) -> Option<&str> {
        self.0.keys().map(String::as_str).find(|name| !known.contains(name))
    }
}
