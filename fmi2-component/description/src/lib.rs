//! Reader of `modelDescription.xml` (FMI 2.0, clause 2.2), for the build step, the lab and the tests.
//!
//! Elements and attributes that are not fields here are ignored. Whether a description is valid is for a validator to
//! decide, such as FMPy's.
#![forbid(unsafe_code)]
#![allow(missing_docs)] // the names are those of the standard

use serde::{Deserialize, Deserializer};

/// Structures of elements: `field: type = "@attribute"` or `"Element"`. What may be absent is an `Option`, or has a default.
macro_rules! elements {
    ($($(#[$of_struct:meta])* $name:ident { $($(#[$of_field:meta])* $field:ident: $type:ty = $xml:literal,)* })*) => {$(
        #[derive(Clone, Debug, Deserialize, PartialEq)]
        $(#[$of_struct])*
        pub struct $name {
            $($(#[$of_field])* #[serde(rename = $xml)] pub $field: $type,)*
        }
    )*};
}

elements! {
    /// A model description.
    Description {
        fmi_version: String = "@fmiVersion",
        model_name: String = "@modelName",
        guid: String = "@guid",
        #[serde(default)]
        description: String = "@description",
        #[serde(default)]
        version: String = "@version",
        #[serde(default)]
        number_of_event_indicators: usize = "@numberOfEventIndicators",
        model_exchange: Option<Interface> = "ModelExchange",
        co_simulation: Option<Interface> = "CoSimulation",
        #[serde(default)]
        default_experiment: DefaultExperiment = "DefaultExperiment",
        #[serde(default, deserialize_with = "list")]
        types: Vec<SimpleType> = "TypeDefinitions",
        #[serde(default, deserialize_with = "list")]
        categories: Vec<Category> = "LogCategories",
        /// In the order to which indices of the model structure refer.
        #[serde(deserialize_with = "list")]
        variables: Vec<ScalarVariable> = "ModelVariables",
        #[serde(default)]
        structure: ModelStructure = "ModelStructure",
    }

    /// `ModelExchange` or `CoSimulation`.
    Interface {
        model_identifier: String = "@modelIdentifier",
    }

    /// Values as text, s.
    #[derive(Default)]
    DefaultExperiment {
        start_time: Option<String> = "@startTime",
        stop_time: Option<String> = "@stopTime",
        step_size: Option<String> = "@stepSize",
    }

    Category {
        name: String = "@name",
    }

    /// Gives its attributes to variables that lack them.
    SimpleType {
        name: String = "@name",
        real: Option<Content> = "Real",
        integer: Option<Content> = "Integer",
        boolean: Option<Content> = "Boolean",
        string: Option<Content> = "String",
        enumeration: Option<Content> = "Enumeration",
    }

    ScalarVariable {
        name: String = "@name",
        value_reference: u32 = "@valueReference",
        #[serde(default)]
        description: String = "@description",
        #[serde(default)]
        causality: Causality = "@causality",
        #[serde(default)]
        variability: Variability = "@variability",
        initial: Option<Initial> = "@initial",
        real: Option<Content> = "Real",
        integer: Option<Content> = "Integer",
        boolean: Option<Content> = "Boolean",
        string: Option<Content> = "String",
        enumeration: Option<Content> = "Enumeration",
    }

    /// The element that gives a variable or a declared type its type. Values are text: their type follows from the element.
    #[derive(Default)]
    Content {
        declared_type: Option<String> = "@declaredType",
        unit: Option<String> = "@unit",
        start: Option<String> = "@start",
        min: Option<String> = "@min",
        max: Option<String> = "@max",
        nominal: Option<String> = "@nominal",
        /// Index of the state, counted from 1.
        derivative: Option<usize> = "@derivative",
    }

    /// Dependencies between variables.
    #[derive(Default)]
    #[serde(default)]
    ModelStructure {
        #[serde(deserialize_with = "list")]
        outputs: Vec<Unknown> = "Outputs",
        #[serde(deserialize_with = "list")]
        derivatives: Vec<Unknown> = "Derivatives",
        #[serde(deserialize_with = "list")]
        initial_unknowns: Vec<Unknown> = "InitialUnknowns",
    }

    Unknown {
        /// Index of the variable, counted from 1.
        index: usize = "@index",
        /// Indices of variables, separated by spaces.
        dependencies: Option<String> = "@dependencies",
        /// How it depends on each of them, separated by spaces.
        dependencies_kind: Option<String> = "@dependenciesKind",
    }
}

/// Who determines the value of a variable.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "camelCase")]
pub enum Causality {
    Parameter,
    CalculatedParameter,
    Input,
    Output,
    #[default]
    Local,
    Independent,
}

/// When the value of a variable may change.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "camelCase")]
pub enum Variability {
    Constant,
    Fixed,
    Tunable,
    Discrete,
    #[default]
    Continuous,
}

/// How the initial value of a variable is found.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "camelCase")]
pub enum Initial {
    Exact,
    Approx,
    Calculated,
}

/// The name of the element that gives a variable or a declared type its type.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FmiType {
    Real,
    Integer,
    Boolean,
    String,
    /// Its values are integers in the C interface.
    Enumeration,
}

/// Reason why a text is not a model description: the element, counted from 0, and the problem.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{0}")]
pub struct Error(String);

impl Description {
    /// Reads a description.
    ///
    /// # Errors
    /// Text that is not XML, and a missing or invalid attribute.
    pub fn parse(xml: &str) -> Result<Self, Error> {
        let reader = &mut serde_xml_rs::Deserializer::new_from_reader(xml.as_bytes());
        serde_path_to_error::deserialize(reader).map_err(|error| Error(error.to_string()))
    }

    /// The variable of that name.
    #[must_use]
    pub fn variable(&self, name: &str) -> Option<&ScalarVariable> {
        self.variables.iter().find(|variable| variable.name == name)
    }
}

/// The elements inside a list. They are named here because serde-xml-rs takes the first fault among elements of any
/// name (`#content`) for the end of the list.
fn list<'de, D: Deserializer<'de>, T: Deserialize<'de>>(element: D) -> Result<Vec<T>, D::Error> {
    #[derive(Deserialize)]
    struct List<T> {
        #[serde(rename = "ScalarVariable", alias = "SimpleType", alias = "Category")]
        #[serde(alias = "Unknown", default = "Vec::new")]
        elements: Vec<T>,
    }
    List::deserialize(element).map(|list| list.elements)
}

/// Gives access to the element of the type.
macro_rules! content {
    ($element:ty) => {
        impl $element {
            /// The type and the attributes of its element, if there is exactly one.
            #[must_use]
            pub fn content(&self) -> Option<(FmiType, &Content)> {
                let numbers = [(FmiType::Real, &self.real), (FmiType::Integer, &self.integer)];
                let others = [(FmiType::Boolean, &self.boolean), (FmiType::String, &self.string)];
                let elements = numbers.into_iter().chain(others);
                let mut present = elements
                    .chain([(FmiType::Enumeration, &self.enumeration)])
                    .filter_map(|(kind, content)| Some((kind, content.as_ref()?)));
                present.next().filter(|_| present.next().is_none())
            }
        }
    };
}

content!(SimpleType);
content!(ScalarVariable);
