//! The elements of `modelDescription.xml` as serde-xml-rs reads them. Values are text, so that an invalid one can be named.
//!
//! An attribute whose `@` is missing here would count as absent: the tests read every attribute.

use serde::Deserialize;

#[derive(Deserialize)]
pub(crate) struct Description {
    #[serde(rename = "@fmiVersion")]
    pub fmi_version: Option<String>,
    #[serde(rename = "@modelName")]
    pub model_name: Option<String>,
    #[serde(rename = "@guid")]
    pub guid: Option<String>,
    #[serde(rename = "@description")]
    pub description: Option<String>,
    #[serde(rename = "@version")]
    pub version: Option<String>,
    #[serde(rename = "@numberOfEventIndicators")]
    pub number_of_event_indicators: Option<String>,
    #[serde(rename = "ModelExchange")]
    pub model_exchange: Option<Interface>,
    #[serde(rename = "CoSimulation")]
    pub co_simulation: Option<Interface>,
    #[serde(rename = "DefaultExperiment", default)]
    pub default_experiment: DefaultExperiment,
    #[serde(rename = "UnitDefinitions", default)]
    pub unit_definitions: UnitDefinitions,
    #[serde(rename = "TypeDefinitions", default)]
    pub type_definitions: TypeDefinitions,
    #[serde(rename = "LogCategories", default)]
    pub log_categories: LogCategories,
    #[serde(rename = "ModelVariables", default)]
    pub model_variables: ModelVariables,
    #[serde(rename = "ModelStructure", default)]
    pub model_structure: ModelStructure,
}

#[derive(Deserialize)]
pub(crate) struct Interface {
    #[serde(rename = "@modelIdentifier")]
    pub model_identifier: Option<String>,
}

#[derive(Default, Deserialize)]
pub(crate) struct DefaultExperiment {
    #[serde(rename = "@startTime")]
    pub start_time: Option<String>,
    #[serde(rename = "@stopTime")]
    pub stop_time: Option<String>,
    #[serde(rename = "@stepSize")]
    pub step_size: Option<String>,
}

#[derive(Deserialize)]
pub(crate) struct Named {
    #[serde(rename = "@name")]
    pub name: Option<String>,
}

#[derive(Default, Deserialize)]
pub(crate) struct UnitDefinitions {
    #[serde(rename = "Unit", default)]
    pub units: Vec<Named>,
}

#[derive(Default, Deserialize)]
pub(crate) struct TypeDefinitions {
    #[serde(rename = "SimpleType", default)]
    pub types: Vec<SimpleType>,
}

#[derive(Default, Deserialize)]
pub(crate) struct LogCategories {
    #[serde(rename = "Category", default)]
    pub categories: Vec<Named>,
}

#[derive(Default, Deserialize)]
pub(crate) struct ModelVariables {
    #[serde(rename = "ScalarVariable", default)]
    pub variables: Vec<ScalarVariable>,
}

#[derive(Deserialize)]
pub(crate) struct SimpleType {
    #[serde(rename = "@name")]
    pub name: Option<String>,
    #[serde(rename = "Real", default)]
    pub real: Vec<Content>,
    #[serde(rename = "Integer", default)]
    pub integer: Vec<Content>,
    #[serde(rename = "Boolean", default)]
    pub boolean: Vec<Content>,
    #[serde(rename = "String", default)]
    pub string: Vec<Content>,
    #[serde(rename = "Enumeration", default)]
    pub enumeration: Vec<Content>,
}

#[derive(Deserialize)]
pub(crate) struct ScalarVariable {
    #[serde(rename = "@name")]
    pub name: Option<String>,
    #[serde(rename = "@valueReference")]
    pub value_reference: Option<String>,
    #[serde(rename = "@description")]
    pub description: Option<String>,
    #[serde(rename = "@causality")]
    pub causality: Option<String>,
    #[serde(rename = "@variability")]
    pub variability: Option<String>,
    #[serde(rename = "@initial")]
    pub initial: Option<String>,
    #[serde(rename = "Real", default)]
    pub real: Vec<Content>,
    #[serde(rename = "Integer", default)]
    pub integer: Vec<Content>,
    #[serde(rename = "Boolean", default)]
    pub boolean: Vec<Content>,
    #[serde(rename = "String", default)]
    pub string: Vec<Content>,
    #[serde(rename = "Enumeration", default)]
    pub enumeration: Vec<Content>,
}

#[derive(Deserialize)]
pub(crate) struct Content {
    #[serde(rename = "@declaredType")]
    pub declared_type: Option<String>,
    #[serde(rename = "@unit")]
    pub unit: Option<String>,
    #[serde(rename = "@start")]
    pub start: Option<String>,
    #[serde(rename = "@min")]
    pub min: Option<String>,
    #[serde(rename = "@max")]
    pub max: Option<String>,
    #[serde(rename = "@nominal")]
    pub nominal: Option<String>,
    #[serde(rename = "@derivative")]
    pub derivative: Option<String>,
}

#[derive(Default, Deserialize)]
pub(crate) struct ModelStructure {
    #[serde(rename = "Outputs", default)]
    pub outputs: Unknowns,
    #[serde(rename = "Derivatives", default)]
    pub derivatives: Unknowns,
    #[serde(rename = "InitialUnknowns", default)]
    pub initial_unknowns: Unknowns,
}

#[derive(Default, Deserialize)]
pub(crate) struct Unknowns {
    #[serde(rename = "Unknown", default)]
    pub unknowns: Vec<Unknown>,
}

#[derive(Deserialize)]
pub(crate) struct Unknown {
    #[serde(rename = "@index")]
    pub index: Option<String>,
    #[serde(rename = "@dependencies")]
    pub dependencies: Option<String>,
    #[serde(rename = "@dependenciesKind")]
    pub dependencies_kind: Option<String>,
}
