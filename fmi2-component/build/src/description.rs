//! `modelDescription.xml` as it stands (FMI 2.0, clause 2.2).
//!
//! serde takes an attribute whose `@` was forgotten here, or whose name is misspelt in the XML, for one that is absent.
//! So unknown names are refused in every element that variables are made of.

use serde::Deserialize;
use serde::de::IgnoredAny;

/// The root element.
#[derive(Debug, Deserialize)]
pub(crate) struct Description {
    #[serde(rename = "@fmiVersion")]
    pub fmi_version: String,
    #[serde(rename = "@modelName")]
    pub model_name: String,
    #[serde(rename = "@version", default)]
    pub version: String,
    #[serde(rename = "@numberOfEventIndicators", default)]
    pub number_of_event_indicators: usize,
    #[serde(rename = "ModelExchange")]
    pub model_exchange: Option<Interface>,
    #[serde(rename = "CoSimulation")]
    pub co_simulation: Option<Interface>,
    #[serde(rename = "UnitDefinitions", default)]
    pub unit_definitions: UnitDefinitions,
    #[serde(rename = "TypeDefinitions", default)]
    pub type_definitions: TypeDefinitions,
    #[serde(rename = "LogCategories", default)]
    pub log_categories: LogCategories,
    #[serde(rename = "ModelVariables")]
    pub model_variables: ModelVariables,
    #[serde(rename = "ModelStructure")]
    pub model_structure: ModelStructure,
}

/// An interface. Its capability flags are for the master.
#[derive(Debug, Deserialize)]
pub(crate) struct Interface {
    #[serde(rename = "@modelIdentifier")]
    pub model_identifier: String,
}

/// The units that variables may have.
#[derive(Debug, Default, Deserialize)]
pub(crate) struct UnitDefinitions {
    #[serde(rename = "Unit", default)]
    pub units: Vec<Named>,
}

/// An element of which the name matters here, and nothing else.
#[derive(Debug, Deserialize)]
pub(crate) struct Named {
    #[serde(rename = "@name")]
    pub name: String,
}

/// The declared types.
#[derive(Debug, Default, Deserialize)]
pub(crate) struct TypeDefinitions {
    #[serde(rename = "SimpleType", default)]
    pub types: Vec<SimpleType>,
}

/// A declared type: what a variable of it does not say itself, this says.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct SimpleType {
    #[serde(rename = "@name")]
    pub name: String,
    #[serde(rename = "@description")]
    pub _description: Option<IgnoredAny>,
    #[serde(rename = "Real")]
    pub real: Option<Attributes<f64>>,
    #[serde(rename = "Integer")]
    pub integer: Option<Attributes<i32>>,
    #[serde(rename = "Boolean")]
    pub boolean: Option<Attributes<bool>>,
    #[serde(rename = "String")]
    pub string: Option<Attributes<String>>,
    #[serde(rename = "Enumeration")]
    pub enumeration: Option<Attributes<i32>>,
}

/// The log categories.
#[derive(Debug, Default, Deserialize)]
pub(crate) struct LogCategories {
    #[serde(rename = "Category", default)]
    pub categories: Vec<Named>,
}

/// The variables, in the order that the model structure counts them in.
#[derive(Debug, Deserialize)]
pub(crate) struct ModelVariables {
    #[serde(rename = "ScalarVariable", default)]
    pub variables: Vec<ScalarVariable>,
}

/// A variable.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct ScalarVariable {
    #[serde(rename = "@name")]
    pub name: String,
    #[serde(rename = "@valueReference")]
    pub value_reference: u32,
    #[serde(rename = "@description", default)]
    pub description: String,
    #[serde(rename = "@causality")]
    pub causality: Option<String>,
    #[serde(rename = "@variability")]
    pub variability: Option<String>,
    #[serde(rename = "@initial")]
    pub initial: Option<String>,
    #[serde(rename = "@canHandleMultipleSetPerTimeInstant")]
    pub _can_handle_multiple_set: Option<IgnoredAny>,
    #[serde(rename = "Real")]
    pub real: Option<Attributes<f64>>,
    #[serde(rename = "Integer")]
    pub integer: Option<Attributes<i32>>,
    #[serde(rename = "Boolean")]
    pub boolean: Option<Attributes<bool>>,
    #[serde(rename = "String")]
    pub string: Option<Attributes<String>>,
    #[serde(rename = "Enumeration")]
    pub enumeration: Option<Attributes<i32>>,
    #[serde(rename = "Annotations")]
    pub _annotations: Option<IgnoredAny>,
}

/// What the element `Real`, `Integer`, `Boolean`, `String` or `Enumeration` says.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Attributes<T> {
    #[serde(rename = "@declaredType")]
    pub declared_type: Option<String>,
    #[serde(rename = "@unit")]
    pub unit: Option<String>,
    #[serde(rename = "@start")]
    pub start: Option<T>,
    #[serde(rename = "@min")]
    pub min: Option<T>,
    #[serde(rename = "@max")]
    pub max: Option<T>,
    #[serde(rename = "@derivative")]
    pub derivative: Option<usize>,
    #[serde(rename = "@quantity")]
    pub _quantity: Option<IgnoredAny>,
    #[serde(rename = "@displayUnit")]
    pub _display_unit: Option<IgnoredAny>,
    #[serde(rename = "@relativeQuantity")]
    pub _relative_quantity: Option<IgnoredAny>,
    #[serde(rename = "@nominal")]
    pub nominal: Option<T>,
    #[serde(rename = "@unbounded")]
    pub _unbounded: Option<IgnoredAny>,
    #[serde(rename = "@reinit")]
    pub _reinit: Option<IgnoredAny>,
    #[serde(rename = "Item", default)]
    pub _items: Vec<IgnoredAny>,
}

/// Which variables depend on which.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct ModelStructure {
    #[serde(rename = "Outputs", default)]
    pub outputs: Unknowns,
    #[serde(rename = "Derivatives", default)]
    pub derivatives: Unknowns,
    #[serde(rename = "InitialUnknowns", default)]
    pub initial_unknowns: Unknowns,
}

/// A list of unknowns.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Unknowns {
    #[serde(rename = "Unknown", default)]
    pub unknowns: Vec<Unknown>,
}

/// A variable, by its place in the list counted from 1, and what it depends on.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Unknown {
    #[serde(rename = "@index")]
    pub index: usize,
    #[serde(rename = "@dependencies")]
    pub dependencies: Option<String>,
    #[serde(rename = "@dependenciesKind")]
    pub dependencies_kind: Option<String>,
}
