//! The variable table: the description with defaults filled in and declared types looked up. Only faults that would break the generated
//! code are found here; whether a description follows FMI 2.0 is for a validator to check, such as FMPy's.

use std::collections::HashMap;
use std::fmt::Debug;

use fmi2_description as xml;
use fmi2_description::{Causality, Content, Description, Initial, ScalarVariable, SimpleType, Variability};

use crate::source::identifier;

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
pub(crate) enum CType {
    Real,
    Integer,
    Boolean,
    String,
}

impl CType {
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
    pub kind: CType,
    pub unit: Option<String>,
    pub start: Option<Literal>,
    pub min: Option<Literal>,
    pub max: Option<Literal>,
    pub nominal: Option<Literal>,
}

impl Table {
    /// The variables of one type, in order.
    pub fn of(&self, kind: CType) -> impl Iterator<Item = &Variable> {
        self.variables.iter().filter(move |v| v.kind == kind)
    }

    /// Fills in defaults.
    ///
    /// # Errors
    /// What it cannot interpret.
    pub fn new(description: &Description) -> Result<Self, String> {
        if description.fmi_version != "2.0" {
            return Err(format!("fmiVersion is {:?}; expected \"2.0\"", description.fmi_version));
        }
        let co_simulation = description.co_simulation.as_ref().ok_or("CoSimulation is missing")?;
        let categories = description.categories.iter().map(|category| category.name.clone());
        let read_one = |v: &ScalarVariable| read(v, &description.types).map_err(|fault| format!("{}: {fault}", v.name));
        let derivatives = description.structure.derivatives.iter();
        let table = Self {
            name: description.model_name.clone(),
            identifier: co_simulation.model_identifier.clone(),
            version: description.version.clone(),
            event_indicators: description.number_of_event_indicators,
            states: derivatives
                .map(|unknown| state(unknown.index, description))
                .collect::<Result<_, _>>()?,
            categories: categories.collect(),
            variables: description.variables.iter().map(read_one).collect::<Result<_, _>>()?,
        };
        table.check_names()?;
        Ok(table)
    }

    /// Checks that names and value references are unique where the generated code needs it.
    fn check_names(&self) -> Result<(), String> {
        // The shell keeps the categories that are on as bits of a word.
        if self.categories.len() > 64 {
            return Err("LogCategories has more than 64 categories".into());
        }
        let mut names = self.categories.iter().chain([&self.identifier]);
        if let Some(name) = names.find(|name| identifier(name) != **name) {
            return Err(format!("{name:?} is not a C identifier"));
        }
        for kind in CType::ALL {
            let (mut references, mut variants) = (HashMap::new(), HashMap::new());
            for Variable { name, value_reference, .. } in self.of(kind) {
                if let Some(other) = references.insert(value_reference, name) {
                    return Err(format!(
                        "{other} and {name} have the same valueReference {value_reference}"
                    ));
                }
                let variant = identifier(name);
                if let Some(other) = variants.insert(variant.clone(), name) {
                    return Err(format!("{other} and {name} would both be the Rust variant {variant}"));
                }
            }
        }
        Ok(())
    }
}

/// The place of the state whose derivative has that index, and the place of the derivative.
fn state(index: usize, description: &Description) -> Result<(usize, usize), String> {
    let places = || {
        let derivative = index.checked_sub(1)?;
        let (_, content) = description.variables.get(derivative)?.content()?;
        let state = content.derivative?.checked_sub(1)?;
        (state < description.variables.len()).then_some((state, derivative))
    };
    places().ok_or_else(|| {
        format!("Derivatives lists index {index}, which is not a variable with the index of a state as `derivative`")
    })
}

fn read(v: &ScalarVariable, types: &[SimpleType]) -> Result<Variable, String> {
    let (kind, own) = v
        .content()
        .ok_or("it needs one of Real, Integer, Boolean, String, Enumeration")?;
    let declared = match &own.declared_type {
        None => None,
        Some(name) => {
            let mut types = types.iter().filter(|t| t.name == *name).filter_map(SimpleType::content);
            let declared = types.find(|(other, _)| *other == kind);
            Some(
                declared
                    .ok_or_else(|| format!("TypeDefinitions has no {name:?} of the variable's type"))?
                    .1,
            )
        }
    };
    let (kind, literal): (_, fn(&str) -> Option<Literal>) = match kind {
        xml::FmiType::Real => (CType::Real, |text| {
            literal(text.parse().ok().filter(|x: &f64| x.is_finite()))
        }),
        xml::FmiType::Integer | xml::FmiType::Enumeration => (CType::Integer, |text| literal(text.parse::<i32>().ok())),
        xml::FmiType::Boolean => (CType::Boolean, |text| literal(truth(text))),
        xml::FmiType::String => (CType::String, |text| literal(Some(text))),
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
        initial: v.initial.or_else(|| default_initial(v.causality, v.variability)),
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

/// The default of `initial` (FMI 2.0, clause 2.2.7).
fn default_initial(causality: Causality, variability: Variability) -> Option<Initial> {
    match (causality, variability) {
        (Causality::Input | Causality::Independent, _) => None,
        (Causality::Parameter, _) | (_, Variability::Constant) => Some(Initial::Exact),
        _ => Some(Initial::Calculated),
    }
}

/// `xs:boolean`: true, false, 1 or 0.
fn truth(text: &str) -> Option<bool> {
    match text {
        "true" | "1" => Some(true),
        "false" | "0" => Some(false),
        _ => None,
    }
}
