//! Reader and writer of `modelDescription.xml` (FMI 2.0, clause 2.2), for the build step, the lab and the tests.
//!
//! Every description that the schema accepts is read, in any encoding that it declares. [`Description::left_out`] lists what the schema
//! does not have. Whether a description is valid is for a validator to decide, such as FMPy's.
#![forbid(unsafe_code)]
#![allow(missing_docs)] // the names are those of the standard

mod document;
mod schema;

use serde::{Deserialize, Deserializer, de};

pub use document::Element;

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
        generation_tool: String = "@generationTool",
        #[serde(default)]
        number_of_event_indicators: usize = "@numberOfEventIndicators",
        model_exchange: Option<Interface> = "ModelExchange",
        co_simulation: Option<Interface> = "CoSimulation",
        #[serde(default)]
        default_experiment: DefaultExperiment = "DefaultExperiment",
        #[serde(default, deserialize_with = "list")]
        units: Vec<Unit> = "UnitDefinitions",
        #[serde(default, deserialize_with = "list")]
        types: Vec<SimpleType> = "TypeDefinitions",
        #[serde(default, deserialize_with = "list")]
        categories: Vec<Category> = "LogCategories",
        /// In the order to which indices of the model structure refer.
        #[serde(deserialize_with = "list")]
        variables: Vec<ScalarVariable> = "ModelVariables",
        #[serde(default)]
        structure: ModelStructure = "ModelStructure",
        /// Attributes, elements and bytes that the schema does not have, and that were not read.
        #[serde(skip)]
        left_out: Vec<String> = "-",
    }

    /// `ModelExchange` or `CoSimulation`.
    Interface {
        model_identifier: String = "@modelIdentifier",
        #[serde(default, deserialize_with = "truth")]
        can_handle_variable_communication_step_size: bool = "@canHandleVariableCommunicationStepSize",
        #[serde(default, deserialize_with = "truth")]
        needs_execution_tool: bool = "@needsExecutionTool",
    }

    Unit {
        name: String = "@name",
        base: Option<BaseUnit> = "BaseUnit",
    }

    /// A unit in SI units: exponents, and value in SI units = factor times value + offset.
    #[serde(default)]
    BaseUnit {
        kg: i32 = "@kg",
        m: i32 = "@m",
        s: i32 = "@s",
        ampere: i32 = "@A",
        kelvin: i32 = "@K",
        mol: i32 = "@mol",
        cd: i32 = "@cd",
        rad: i32 = "@rad",
        factor: f64 = "@factor",
        offset: f64 = "@offset",
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
        Self::read(xml.as_bytes())
    }

    /// Reads a description in the encoding that it declares.
    ///
    /// # Errors
    /// Text that is not XML, an unknown encoding, and a missing or invalid attribute.
    pub fn read(xml: &[u8]) -> Result<Self, Error> {
        let (known, left_out) = schema::known(xml)?;
        let reader = &mut serde_xml_rs::Deserializer::new_from_reader(&*known);
        let read: Result<Self, _> = serde_path_to_error::deserialize(reader);
        let description = read.map_err(|error| Error(error.to_string()))?;
        Ok(Self { left_out, ..description })
    }

    /// The unit that a variable declares, itself or by its type.
    #[must_use]
    pub fn unit_of<'a>(&'a self, variable: &'a ScalarVariable) -> Option<&'a str> {
        let (kind, own) = variable.content()?;
        let declared = || {
            let name = own.declared_type.as_ref()?;
            let mut types = self.types.iter().filter(|declared| declared.name == *name);
            types.find_map(|declared| declared.content().filter(|(other, _)| *other == kind)?.1.unit.as_ref())
        };
        own.unit.as_ref().or_else(declared).map(String::as_str)
    }

    /// A defined unit in SI units.
    #[must_use]
    pub fn base_unit(&self, name: &str) -> Option<&BaseUnit> {
        self.units.iter().find(|unit| unit.name == name)?.base.as_ref()
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
        #[serde(alias = "Unknown", alias = "Unit", default = "Vec::new")]
        elements: Vec<T>,
    }
    List::deserialize(element).map(|list| list.elements)
}

/// `xs:boolean`.
fn truth<'de, D: Deserializer<'de>>(attribute: D) -> Result<bool, D::Error> {
    match &*String::deserialize(attribute)? {
        "true" | "1" => Ok(true),
        "false" | "0" => Ok(false),
        other => Err(de::Error::custom(format!("{other:?} is not true or false"))),
    }
}

impl Default for BaseUnit {
    fn default() -> Self {
        Self {
            kg: 0,
            m: 0,
            s: 0,
            ampere: 0,
            kelvin: 0,
            mol: 0,
            cd: 0,
            rad: 0,
            factor: 1.0,
            offset: 0.0,
        }
    }
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
