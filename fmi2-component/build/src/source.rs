//! The Rust source of a table.

use std::fmt::Write;

use crate::guid;
use crate::table::{Kind, Literal, Table, Variable};

/// The contents of `variables.rs`.
pub(crate) fn source(table: &Table) -> String {
    let mut out = String::new();
    // Writing to a string cannot fail.
    let _ = identity(&mut out, table);
    for kind in Kind::ALL {
        let variables: Vec<_> = table.of(kind).collect();
        let _ = key(&mut out, kind, &variables);
    }
    let _ = categories(&mut out, &table.categories);
    out
}

fn identity(out: &mut String, table: &Table) -> std::fmt::Result {
    let guid = guid(table);
    let Table {
        name,
        identifier: model,
        version,
        event_indicators,
        categories,
        ..
    } = table;
    let keys = |pick: fn(&(usize, usize)) -> usize| {
        let names = table.states.iter().map(pick).map(|place| {
            let name = table.variables.get(place).map_or("", |v| v.name.as_str());
            format!("Real::{}", identifier(name))
        });
        names.collect::<Vec<_>>().join(", ")
    };
    let (states, derivatives) = (keys(|pair| pair.0), keys(|pair| pair.1));
    writeln!(
        out,
        "/// `modelName`.
#[allow(dead_code)]
pub const MODEL_NAME: &str = {name:?};
/// `modelIdentifier`.
#[allow(dead_code)]
pub const MODEL_IDENTIFIER: &str = {model:?};
/// Derived from the variable table.
#[allow(dead_code)]
pub const GUID: &str = {guid:?};

/// The model's identity and the types of its variables.
#[derive(Clone, Copy, Debug)]
pub enum Model {{}}

impl ::fmi2_component::Model for Model {{
    const NAME: &'static str = MODEL_NAME;
    const IDENTIFIER: &'static str = MODEL_IDENTIFIER;
    const GUID: &'static str = GUID;
    const VERSION: &'static str = {version:?};
    const STATES: &'static [Real] = &[{states}];
    const DERIVATIVES: &'static [Real] = &[{derivatives}];
    const EVENT_INDICATORS: usize = {event_indicators};
    const CATEGORIES: &'static [&'static str] = &{categories:?};
    type Real = Real;
    type Integer = Integer;
    type Boolean = Boolean;
    type String = String;
}}
"
    )
}

fn key(out: &mut String, kind: Kind, variables: &[&Variable]) -> std::fmt::Result {
    let value = match kind {
        Kind::Real => "f64",
        Kind::Integer => "i32",
        Kind::Boolean => "bool",
        Kind::String => "&'static str",
    };
    let variants: Vec<_> = variables.iter().map(|v| identifier(&v.name)).collect();

    writeln!(
        out,
        "/// The variables of type {kind:?}.
#[allow(non_camel_case_types, clippy::upper_case_acronyms, dead_code)]
#[allow(rustdoc::broken_intra_doc_links, rustdoc::invalid_html_tags, rustdoc::bare_urls)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum {kind:?} {{"
    )?;
    for (variable, variant) in variables.iter().zip(&variants) {
        writeln!(out, "    #[doc = {:?}]\n    {variant},", doc(variable))?;
    }
    writeln!(
        out,
        "}}

#[allow(clippy::approx_constant, clippy::match_single_binding)]
impl ::fmi2_component::Key for {kind:?} {{
    type Value = {value};
    const VARIABLES: &'static [::fmi2_component::Variable<{value}>] = &["
    )?;
    for variable in variables {
        entry(out, variable)?;
    }
    let all: Vec<_> = variants.iter().map(|v| format!("Self::{v}")).collect();
    writeln!(
        out,
        "    ];
    const ALL: &'static [Self] = &[{}];
",
        all.join(", ")
    )?;
    find(out, kind, variables, &variants)?;
    // An enum without variants has no number.
    let index = if variables.is_empty() {
        "match self {}"
    } else {
        "self as usize"
    };
    writeln!(
        out,
        "
    #[inline]
    fn index(self) -> usize {{
        {index}
    }}
}}
"
    )
}

/// How a variable is found by its value reference: by its index in a table, unless most entries would be empty.
fn find(out: &mut String, kind: Kind, variables: &[&Variable], variants: &[String]) -> std::fmt::Result {
    let named = || variables.iter().map(|v| v.value_reference as usize).zip(variants);
    let places = named().map(|(reference, _)| reference + 1).max().unwrap_or(0);
    let body = if places <= 4 * variables.len() + 64 {
        let mut table = vec!["::core::option::Option::None".to_owned(); places];
        for (reference, variant) in named() {
            table[reference] = format!("::core::option::Option::Some({kind:?}::{variant})");
        }
        let entries = table.join(", ");
        format!(
            "const TABLE: [::core::option::Option<{kind:?}>; {places}] = [{entries}];
        TABLE.get(value_reference as usize).copied().flatten()"
        )
    } else {
        let arm = |(reference, variant)| format!("{reference} => ::core::option::Option::Some(Self::{variant}), ");
        let arms: String = named().map(arm).collect();
        format!("match value_reference {{ {arms}_ => ::core::option::Option::None }}")
    };
    writeln!(
        out,
        "    #[inline]
    fn find(value_reference: u32) -> ::core::option::Option<Self> {{
        {body}
    }}"
    )
}

fn doc(v: &Variable) -> String {
    let unit = v.unit.as_ref().map(|unit| format!(", {unit}"));
    let description = match v.description.as_str() {
        "" => String::new(),
        text => format!(": {text}"),
    };
    format!("`{}`{}{description}", v.name, unit.unwrap_or_default())
}

fn entry(out: &mut String, v: &Variable) -> std::fmt::Result {
    let option = |literal: &Option<Literal>| match literal {
        Some(literal) => format!("::core::option::Option::Some({literal})"),
        None => "::core::option::Option::None".into(),
    };
    let initial = (v.initial).map(|initial| format!("::fmi2_component::Initial::{initial:?}"));
    let unit = v.unit.as_ref().map(|unit| format!("{unit:?}"));
    writeln!(
        out,
        "        ::fmi2_component::Variable {{
            name: {:?},
            value_reference: {},
            causality: ::fmi2_component::Causality::{:?},
            variability: ::fmi2_component::Variability::{:?},
            initial: {},
            start: {},
            min: {},
            max: {},
            nominal: {},
            unit: {},
            description: {:?},
        }},",
        v.name,
        v.value_reference,
        v.causality,
        v.variability,
        option(&initial),
        option(&v.start),
        option(&v.min),
        option(&v.max),
        option(&v.nominal),
        option(&unit),
        v.description,
    )
}

fn categories(out: &mut String, categories: &[String]) -> std::fmt::Result {
    writeln!(
        out,
        "/// The log categories.
#[allow(non_upper_case_globals, dead_code)]
pub mod category {{"
    )?;
    for (index, name) in categories.iter().enumerate() {
        writeln!(
            out,
            "    #[doc = \"`{name}`.\"]
    pub const {name}: ::fmi2_component::Category = ::fmi2_component::Category::new({index}, {name:?});"
        )?;
    }
    writeln!(out, "}}")
}

/// The Rust identifier of a structured name (FMI 2.0, clause 2.2.9): the name itself, with every run of other characters
/// than letters, digits and `_` made one `_`, and none at the end:
/// `der(q1)` becomes `der_q1`. `M` and `m` remain two. A keyword gets a trailing `_`.
pub(crate) fn identifier(name: &str) -> String {
    let parts = name.split(|c: char| !(c.is_ascii_alphanumeric() || c == '_'));
    let parts: Vec<_> = parts.filter(|part| !part.is_empty()).collect();
    let mut identifier = parts.join("_");
    if !identifier.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_') {
        identifier.insert(0, '_');
    }
    if identifier == "_" || KEYWORDS.contains(&identifier.as_str()) {
        identifier.push('_');
    }
    identifier
}

const KEYWORDS: &[&str] = &[
    "Self", "abstract", "as", "async", "await", "become", "box", "break", "const", "continue", "crate", "do", "dyn",
    "else", "enum", "extern", "false", "final", "fn", "for", "gen", "if", "impl", "in", "let", "loop", "macro",
    "match", "mod", "move", "mut", "override", "priv", "pub", "ref", "return", "self", "static", "struct", "super",
    "trait", "true", "try", "type", "typeof", "unsafe", "unsized", "use", "virtual", "where", "while", "yield",
];

#[cfg(test)]
mod tests {
    use super::identifier;

    #[test]
    fn a_variant_is_named_as_its_variable() {
        for (name, expected) in [
            ("M", "M"),
            ("m", "m"),
            ("impact_time", "impact_time"),
            ("der(q1)", "der_q1"),
            ("der(x[2],3)", "der_x_2_3"),
            ("rig.motor.speed", "rig_motor_speed"),
            ("loop", "loop_"),
            ("2nd", "_2nd"),
            ("_", "__"),
            ("'+'", "__"),
        ] {
            assert_eq!(identifier(name), expected);
        }
    }
}
