//! The variable table: the description with defaults filled in and declared types looked up.

use std::fmt::Debug;
use std::str::FromStr;

use fmi2_description as xml;
use fmi2_description::{Content, Description, ScalarVariable, SimpleType};

use crate::attributes::{Causality, Initial, Variability, allowed};

/// A model's identity and its variables.
#[derive(Debug)]
pub(crate) struct Table {
    pub name: String,
    pub identifier: String,
    pub version: String,
    pub event_indicators: usize,
    /// Places in `variables` of the continuous states and of their derivatives.
    pub states: Vec<(usize, usize)>,
    pub categories: Vec<String>,
    pub variables: Vec<Variable>,
}

/// The four types of the C interface; an enumeration is an integer there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    Real,
    Integer,
    Boolean,
    String,
}

impl Kind {
    pub const ALL: [Self; 4] = [Self::Real, Self::Integer, Self::Boolean, Self::String];
}

/// A value as the text of a Rust literal.
pub(crate) type Literal = String;

/// A variable.
#[derive(Debug)]
pub(crate) struct Variable {
    pub name: String,
    pub value_reference: u32,
    pub description: String,
    pub causality: Causality,
    pub variability: Variability,
    pub initial: Option<Initial>,
    pub kind: Kind,
    pub unit: Option<String>,
    pub start: Option<Literal>,
    pub min: Option<Literal>,
    pub max: Option<Literal>,
    pub nominal: Option<Literal>,
}

impl Table {
    /// The variables of one type, in order.
    pub fn of(&self, kind: Kind) -> impl Iterator<Item = &Variable> {
        self.variables.iter().filter(move |v| v.kind == kind)
    }

    /// Fills in defaults; reports what it cannot interpret.
    pub fn new(description: &Description, faults: &mut Vec<String>) -> Self {
        let types = &description.types;
        Self {
            name: description.model_name.clone(),
            identifier: description.co_simulation.clone().unwrap_or_default(),
            version: description.version.clone(),
            event_indicators: description.number_of_event_indicators,
            states: states(description),
            categories: description.categories.clone(),
            variables: (description.variables.iter())
                .filter_map(|variable| match read(variable, types) {
                    Ok(variable) => Some(variable),
                    Err(fault) => {
                        faults.push(format!("{}: {fault}", variable.name));
                        None
                    }
                })
                .collect(),
        }
    }
}

/// What `Derivatives` lists, with the states of the derivatives; `check` reports what is missing.
fn states(description: &Description) -> Vec<(usize, usize)> {
    let variables = &description.variables;
    let unknowns = &description.structure.derivatives;
    unknowns
        .iter()
        .filter_map(|unknown| {
            let derivative = unknown.index.checked_sub(1)?;
            let of = variables.get(derivative)?.content.first()?.derivative?;
            Some((of.checked_sub(1)?, derivative))
        })
        .collect()
}

fn read(v: &ScalarVariable, types: &[SimpleType]) -> Result<Variable, String> {
    let content = content(v, types)?;
    let causality = (v.causality.as_deref())
        .map(|text| named("causality", text, Causality::parse, Causality::NAMES))
        .transpose()?
        .unwrap_or(Causality::Local);
    let variability = (v.variability.as_deref())
        .map(|text| named("variability", text, Variability::parse, Variability::NAMES))
        .transpose()?
        .unwrap_or(Variability::Continuous);
    let initial = (v.initial.as_deref())
        .map(|text| named("initial", text, Initial::parse, Initial::NAMES))
        .transpose()?
        .or_else(|| allowed(causality, variability).first().copied().flatten());
    Ok(Variable {
        name: v.name.clone(),
        value_reference: v.value_reference,
        description: v.description.clone(),
        causality,
        variability,
        initial,
        kind: content.kind,
        unit: content.unit,
        start: content.start,
        min: content.min,
        max: content.max,
        nominal: content.nominal,
    })
}

fn named<T>(attribute: &str, text: &str, parse: fn(&str) -> Option<T>, names: &[&str]) -> Result<T, String> {
    parse(text).ok_or_else(|| {
        let names = names.join(", ");
        format!("{attribute} is {text:?}; there are {names}")
    })
}

/// Attributes of the element of the variable's type, including those of the declared type.
struct Resolved {
    kind: Kind,
    unit: Option<String>,
    start: Option<Literal>,
    min: Option<Literal>,
    max: Option<Literal>,
    nominal: Option<Literal>,
}

fn content(v: &ScalarVariable, types: &[SimpleType]) -> Result<Resolved, String> {
    let [own] = &v.content[..] else {
        return Err("it needs one of Real, Integer, Boolean, String, Enumeration".into());
    };
    match own.kind {
        xml::Kind::Real => resolve::<f64>(Kind::Real, own, types),
        xml::Kind::Integer | xml::Kind::Enumeration => resolve::<i32>(Kind::Integer, own, types),
        xml::Kind::Boolean => resolve::<Truth>(Kind::Boolean, own, types),
        xml::Kind::String => resolve::<String>(Kind::String, own, types),
    }
}

fn resolve<T: FromStr + Debug>(kind: Kind, own: &Content, types: &[SimpleType]) -> Result<Resolved, String> {
    let declared = match &own.declared_type {
        None => None,
        Some(name) => {
            let declared = types.iter().find(|t| t.name == *name);
            let declared = declared.and_then(|t| t.content.iter().find(|c| c.kind == own.kind));
            Some(declared.ok_or_else(|| format!("TypeDefinitions has no {name:?} of the variable's type"))?)
        }
    };
    let inherited = |attribute: &str, get: fn(&Content) -> Option<&String>| {
        get(own)
            .or_else(|| declared.and_then(get))
            .map(|text| literal::<T>(kind, attribute, text))
            .transpose()
    };
    Ok(Resolved {
        kind,
        unit: own.unit.clone().or_else(|| declared.and_then(|d| d.unit.clone())),
        // A declared type has no start value.
        start: own
            .start
            .as_ref()
            .map(|text| literal::<T>(kind, "start", text))
            .transpose()?,
        min: inherited("min", |c| c.min.as_ref())?,
        max: inherited("max", |c| c.max.as_ref())?,
        nominal: inherited("nominal", |c| c.nominal.as_ref())?,
    })
}

/// The value as a Rust literal.
fn literal<T: FromStr + Debug>(kind: Kind, attribute: &str, text: &str) -> Result<Literal, String> {
    text.parse::<T>()
        .map(|value| format!("{value:?}"))
        .map_err(|_| format!("{attribute} = {text:?} is not a value of type {kind:?}"))
}

/// `xs:boolean`: true, false, 1 or 0.
struct Truth(bool);

impl FromStr for Truth {
    type Err = ();

    fn from_str(text: &str) -> Result<Self, ()> {
        match text {
            "true" | "1" => Ok(Self(true)),
            "false" | "0" => Ok(Self(false)),
            _ => Err(()),
        }
    }
}

impl Debug for Truth {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        Debug::fmt(&self.0, f)
    }
}
