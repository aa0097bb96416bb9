//! The variable table: the description with defaults filled in and declared types looked up.

use crate::attributes::{Causality, Initial, Variability, allowed};
use crate::description::{Attributes, Description, ScalarVariable, SimpleType};

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

    /// Fills in defaults; complains about what it cannot make sense of.
    pub fn new(description: &Description, faults: &mut Vec<String>) -> Self {
        let types = &description.type_definitions.types;
        Self {
            name: description.model_name.clone(),
            identifier: description
                .co_simulation
                .as_ref()
                .map(|interface| interface.model_identifier.clone())
                .unwrap_or_default(),
            version: description.version.clone(),
            event_indicators: description.number_of_event_indicators,
            states: states(description),
            categories: (description.log_categories.categories.iter())
                .map(|category| category.name.clone())
                .collect(),
            variables: (description.model_variables.variables.iter())
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

/// What `Derivatives` lists, with the states that the derivatives are of; `check` complains about what is missing.
fn states(description: &Description) -> Vec<(usize, usize)> {
    let variables = &description.model_variables.variables;
    let unknowns = &description.model_structure.derivatives.unknowns;
    unknowns
        .iter()
        .filter_map(|unknown| {
            let derivative = unknown.index.checked_sub(1)?;
            let of = variables.get(derivative)?.real.as_ref()?.derivative?;
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

fn named<T>(
    attribute: &str,
    text: &str,
    parse: fn(&str) -> Option<T>,
    names: &[&str],
) -> Result<T, String> {
    parse(text).ok_or_else(|| {
        let names = names.join(", ");
        format!("{attribute} is {text:?}; there are {names}")
    })
}

/// What the element of the variable's type says.
struct Content {
    kind: Kind,
    unit: Option<String>,
    start: Option<Literal>,
    min: Option<Literal>,
    max: Option<Literal>,
    nominal: Option<Literal>,
}

/// A pick of one element out of a declared type.
type Pick<T> = fn(&SimpleType) -> Option<&Attributes<T>>;

fn content(v: &ScalarVariable, types: &[SimpleType]) -> Result<Content, String> {
    let contents = [
        resolve(Kind::Real, &v.real, types, |t| t.real.as_ref()),
        resolve(Kind::Integer, &v.integer, types, |t| t.integer.as_ref()),
        resolve(Kind::Boolean, &v.boolean, types, |t| t.boolean.as_ref()),
        resolve(Kind::String, &v.string, types, |t| t.string.as_ref()),
        resolve(Kind::Integer, &v.enumeration, types, |t| {
            t.enumeration.as_ref()
        }),
    ];
    let mut contents: Vec<_> = contents.into_iter().flatten().collect();
    match (contents.pop(), contents.is_empty()) {
        (Some(content), true) => content,
        _ => Err("it needs one of Real, Integer, Boolean, String, Enumeration".into()),
    }
}

fn resolve<T: std::fmt::Debug>(
    kind: Kind,
    own: &Option<Attributes<T>>,
    types: &[SimpleType],
    pick: Pick<T>,
) -> Option<Result<Content, String>> {
    let own = own.as_ref()?;
    let declared = match &own.declared_type {
        None => None,
        Some(name) => match types.iter().find(|t| t.name == *name).and_then(pick) {
            Some(declared) => Some(declared),
            None => {
                return Some(Err(format!(
                    "TypeDefinitions has no {name:?} of the variable's type"
                )));
            }
        },
    };
    let inherited = |get: fn(&Attributes<T>) -> Option<&T>| {
        get(own)
            .or_else(|| declared.and_then(get))
            .map(|value| format!("{value:?}"))
    };
    Some(Ok(Content {
        kind,
        unit: own
            .unit
            .clone()
            .or_else(|| declared.and_then(|d| d.unit.clone())),
        // A declared type has no start value.
        start: own.start.as_ref().map(|value| format!("{value:?}")),
        min: inherited(|a| a.min.as_ref()),
        max: inherited(|a| a.max.as_ref()),
        nominal: inherited(|a| a.nominal.as_ref()),
    }))
}
