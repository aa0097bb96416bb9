//! The Rust source of a table.

use crate::guid;
use crate::table::{CType, Literal, Table, Variable};

/// The contents of `variables.rs`.
pub(crate) fn source(table: &Table) -> String {
    let keys = CType::ALL.map(|kind| key(kind, &table.of(kind).collect::<Vec<_>>()));
    identity(table) + &keys.concat() + &categories(&table.categories)
}

fn identity(table: &Table) -> String {
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
    format!(
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

fn key(kind: CType, variables: &[&Variable]) -> String {
    let value = match kind {
        CType::Real => "f64",
        CType::Integer => "i32",
        CType::Boolean => "bool",
        CType::String => "&'static str",
    };
    let names: Vec<_> = variables.iter().map(|v| identifier(&v.name)).collect();
    let documented = variables.iter().zip(&names);
    let variants: String = documented
        .map(|(v, name)| format!("    #[doc = {:?}]\n    {name},\n", doc(v)))
        .collect();
    let entries: String = variables.iter().map(|v| entry(v)).collect();
    let all: String = names.iter().map(|name| format!("Self::{name}, ")).collect();
    let find = find(kind, variables, &names);
    // An enum without variants has no number.
    let index = if variables.is_empty() {
        "match self {}"
    } else {
        "self as usize"
    };
    format!(
        "/// The variables of type {kind:?}.
#[allow(non_camel_case_types, clippy::upper_case_acronyms, dead_code)]
#[allow(rustdoc::broken_intra_doc_links, rustdoc::invalid_html_tags, rustdoc::bare_urls)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum {kind:?} {{
{variants}}}

#[allow(clippy::approx_constant, clippy::match_single_binding)]
impl ::fmi2_component::Key for {kind:?} {{
    type Value = {value};
    const VARIABLES: &'static [::fmi2_component::Variable<{value}>] = &[
{entries}    ];
    const ALL: &'static [Self] = &[{all}];

    #[inline]
    fn find(value_reference: u32) -> ::core::option::Option<Self> {{
        {find}
    }}

    #[inline]
    fn index(self) -> usize {{
        {index}
    }}
}}

"
    )
}

/// How a variable is found by its value reference: by its index in a table, unless most entries would be empty.
fn find(kind: CType, variables: &[&Variable], names: &[String]) -> String {
    let named = || variables.iter().map(|v| v.value_reference as usize).zip(names);
    let places = named().map(|(reference, _)| reference + 1).max().unwrap_or(0);
    if places > 4 * variables.len() + 64 {
        let arm = |(reference, name)| format!("{reference} => ::core::option::Option::Some(Self::{name}), ");
        let arms: String = named().map(arm).collect();
        return format!("match value_reference {{ {arms}_ => ::core::option::Option::None }}");
    }
    let mut table = vec!["::core::option::Option::None".to_owned(); places];
    for (reference, name) in named() {
        table[reference] = format!("::core::option::Option::Some({kind:?}::{name})");
    }
    let entries = table.join(", ");
    format!(
        "const TABLE: [::core::option::Option<{kind:?}>; {places}] = [{entries}];
        TABLE.get(value_reference as usize).copied().flatten()"
    )
}

fn doc(v: &Variable) -> String {
    let unit: String = v.unit.iter().map(|unit| format!(", {unit}")).collect();
    let separator = if v.description.is_empty() { "" } else { ": " };
    format!("`{}`{unit}{separator}{}", v.name, v.description)
}

fn entry(v: &Variable) -> String {
    let option = |literal: &Option<Literal>| match literal {
        Some(literal) => format!("::core::option::Option::Some({literal})"),
        None => "::core::option::Option::None".into(),
    };
    let initial = (v.initial).map(|initial| format!("::fmi2_component::Initial::{initial:?}"));
    let unit = v.unit.as_ref().map(|unit| format!("{unit:?}"));
    format!(
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
        }},
",
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

fn categories(categories: &[String]) -> String {
    let constant = |(index, name): (usize, &String)| {
        format!(
            "    #[doc = \"`{name}`.\"]
    pub const {name}: ::fmi2_component::Category = ::fmi2_component::Category::new({index}, {name:?});
"
        )
    };
    let constants: String = categories.iter().enumerate().map(constant).collect();
    format!(
        "/// The log categories.
#[allow(non_upper_case_globals, dead_code)]
pub mod category {{
{constants}}}
"
    )
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
