//! The variable table: the description with defaults filled in and declared types looked up.

use std::fmt::Debug;

use fmi2_description as xml;
use fmi2_description::{Causality, Content, Description, Initial, ScalarVariable, SimpleType, Variability};

use crate::check::allowed;

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
        let identifier = description.co_simulation.as_ref().map(|i| i.model_identifier.clone());
        let mut table = Self {
            name: description.model_name.clone(),
            identifier: identifier.unwrap_or_default(),
            version: description.version.clone(),
            event_indicators: description.number_of_event_indicators,
            states: Vec::new(),
            categories: description
                .categories
                .iter()
                .map(|category| category.name.clone())
                .collect(),
            variables: Vec::new(),
        };
        for variable in &description.variables {
            match read(variable, &description.types) {
                Ok(variable) => table.variables.push(variable),
                Err(fault) => faults.push(format!("{}: {fault}", variable.name)),
            }
        }
        for unknown in &description.structure.derivatives {
            match state(unknown.index, description) {
                Some(pair) => table.states.push(pair),
                None => faults.push(format!(
                    "Derivatives lists index {}, which is not a variable with the index of a state as `derivative`",
                    unknown.index
                )),
            }
        }
        table
    }
}

/// The place of the state whose derivative has that index, and the place of the derivative.
fn state(index: usize, description: &Description) -> Option<(usize, usize)> {
    let derivative = index.checked_sub(1)?;
    let (_, content) = description.variables.get(derivative)?.content()?;
    let state = content.derivative?.checked_sub(1)?;
    (state < description.variables.len()).then_some((state, derivative))
}

fn read(v: &ScalarVariable, types: &[SimpleType]) -> Result<Variable, String> {
    let (kind, own) = v
        .content()
        .ok_or("it needs one of Real, Integer, Boolean, String, Enumeration")?;
    let declared = match &own.declared_type {
        None => None,
        Some(name) => {
            let mut declared = types.iter().filter(|t| t.name == *name).filter_map(SimpleType::content);
            let found = declared.find(|(other, _)| *other == kind);
            Some(
                found
                    .ok_or_else(|| format!("TypeDefinitions has no {name:?} of the variable's type"))?
                    .1,
            )
        }
    };
    let (kind, literal): (_, fn(&str) -> Option<Literal>) = match kind {
        xml::Kind::Real => (Kind::Real, |text| {
            literal(text.parse().ok().filter(|x: &f64| x.is_finite()))
        }),
        xml::Kind::Integer | xml::Kind::Enumeration => (Kind::Integer, |text| literal(text.parse::<i32>().ok())),
        xml::Kind::Boolean => (Kind::Boolean, |text| literal(truth(text))),
        xml::Kind::String => (Kind::String, |text| literal(Some(text))),
    };
    let attribute = |attribute: &str, text: Option<&String>| {
        let value = text.map(|text| {
            literal(text).ok_or_else(|| format!("{attribute} = {text:?} is not a finite value of type {kind:?}"))
        });
        value.transpose()
    };
    let inherited = |get: fn(&Content) -> Option<&String>| get(own).or_else(|| declared.and_then(get));
    Ok(Variable {
        name: v.name.clone(),
        value_reference: v.value_reference,
        description: v.description.clone(),
        causality: v.causality,
        variability: v.variability,
        initial: (v.initial).or_else(|| allowed(v.causality, v.variability).first().copied().flatten()),
        kind,
        unit: inherited(|c| c.unit.as_ref()).cloned(),
        // A declared type has no start value.
        start: attribute("start", own.start.as_ref())?,
        min: attribute("min", inherited(|c| c.min.as_ref()))?,
        max: attribute("max", inherited(|c| c.max.as_ref()))?,
        nominal: attribute("nominal", inherited(|c| c.nominal.as_ref()))?,
    })
}

/// The value as a Rust literal.
fn literal(value: Option<impl Debug>) -> Option<Literal> {
    value.map(|value| format!("{value:?}"))
}

/// `xs:boolean`: true, false, 1 or 0.
fn truth(text: &str) -> Option<bool> {
    match text {
        "true" | "1" => Some(true),
        "false" | "0" => Some(false),
        _ => None,
    }
}
