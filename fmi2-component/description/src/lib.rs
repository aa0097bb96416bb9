//! Reader of `modelDescription.xml` (FMI 2.0, clause 2.2).
//!
//! Elements and attributes that are not fields here are ignored. Whether a description is valid is for a validator to
//! decide, such as FMPy's.
#![forbid(unsafe_code)]
#![allow(missing_docs)] // the names are those of the standard

use serde::{Deserialize, Deserializer};

/// A model description.
#[derive(Clone, Debug, Deserialize, PartialEq)]
pub struct Description {
    #[serde(rename = "@fmiVersion")]
    pub fmi_version: String,
    #[serde(rename = "@modelName")]
    pub model_name: String,
    #[serde(rename = "@guid")]
    pub guid: String,
    /// `description`; empty if absent.
    #[serde(rename = "@description", default)]
    pub description: String,
    /// `version`; empty if absent.
    #[serde(rename = "@version", default)]
    pub version: String,
    #[serde(rename = "@numberOfEventIndicators", default)]
    pub number_of_event_indicators: usize,
    #[serde(rename = "ModelExchange")]
    pub model_exchange: Option<Interface>,
    #[serde(rename = "CoSimulation")]
    pub co_simulation: Option<Interface>,
    #[serde(rename = "DefaultExperiment", default)]
    pub default_experiment: DefaultExperiment,
    #[serde(rename = "TypeDefinitions", default, deserialize_with = "list")]
    pub types: Vec<SimpleType>,
    #[serde(rename = "LogCategories", default, deserialize_with = "list")]
    pub categories: Vec<Category>,
    /// `ModelVariables`, in the order to which indices of the model structure refer.
    #[serde(rename = "ModelVariables", deserialize_with = "list")]
    pub variables: Vec<ScalarVariable>,
    #[serde(rename = "ModelStructure", default)]
    pub structure: ModelStructure,
}

/// `ModelExchange` or `CoSimulation`.
#[derive(Clone, Debug, Deserialize, PartialEq)]
pub struct Interface {
    #[serde(rename = "@modelIdentifier")]
    pub model_identifier: String,
}

/// `DefaultExperiment`, values as text, s.
#[derive(Clone, Debug, Default, Deserialize, PartialEq)]
pub struct DefaultExperiment {
    #[serde(rename = "@startTime")]
    pub start_time: Option<String>,
    #[serde(rename = "@stopTime")]
    pub stop_time: Option<String>,
    #[serde(rename = "@stepSize")]
    pub step_size: Option<String>,
}

#[derive(Clone, Debug, Deserialize, PartialEq)]
pub struct Category {
    #[serde(rename = "@name")]
    pub name: String,
}

/// `SimpleType`: gives its attributes to variables that lack them.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(rename_all = "PascalCase")]
pub struct SimpleType {
    #[serde(rename = "@name")]
    pub name: String,
    real: Option<Content>,
    integer: Option<Content>,
    boolean: Option<Content>,
    string: Option<Content>,
    enumeration: Option<Content>,
}

#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(rename_all = "PascalCase")]
pub struct ScalarVariable {
    #[serde(rename = "@name")]
    pub name: String,
    #[serde(rename = "@valueReference")]
    pub value_reference: u32,
    /// `description`; empty if absent.
    #[serde(rename = "@description", default)]
    pub description: String,
    #[serde(rename = "@causality", default)]
    pub causality: Causality,
    #[serde(rename = "@variability", default)]
    pub variability: Variability,
    #[serde(rename = "@initial")]
    pub initial: Option<Initial>,
    real: Option<Content>,
    integer: Option<Content>,
    boolean: Option<Content>,
    string: Option<Content>,
    enumeration: Option<Content>,
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

/// The element that gives a variable or a declared type its type.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    Real,
    Integer,
    Boolean,
    String,
    /// Its values are integers in the C interface.
    Enumeration,
}

/// An element `Real`, `Integer`, `Boolean`, `String` or `Enumeration`. Values are text: their type follows from the
/// element.
#[derive(Clone, Debug, Default, Deserialize, PartialEq)]
pub struct Content {
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
    /// `derivative`: index of the state, counted from 1.
    #[serde(rename = "@derivative")]
    pub derivative: Option<usize>,
}

/// `ModelStructure`: dependencies between variables.
#[derive(Clone, Debug, Default, Deserialize, PartialEq)]
#[serde(rename_all = "PascalCase", default)]
pub struct ModelStructure {
    #[serde(deserialize_with = "list")]
    pub outputs: Vec<Unknown>,
    #[serde(deserialize_with = "list")]
    pub derivatives: Vec<Unknown>,
    #[serde(deserialize_with = "list")]
    pub initial_unknowns: Vec<Unknown>,
}

#[derive(Clone, Debug, Deserialize, PartialEq)]
pub struct Unknown {
    /// Index of the variable, counted from 1.
    #[serde(rename = "@index")]
    pub index: usize,
    /// `dependencies`, separated by spaces.
    #[serde(rename = "@dependencies")]
    pub dependencies: Option<String>,
    /// `dependenciesKind`, separated by spaces.
    #[serde(rename = "@dependenciesKind")]
    pub dependencies_kind: Option<String>,
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
        #[serde(
            rename = "ScalarVariable",
            alias = "SimpleType",
            alias = "Category",
            alias = "Unknown"
        )]
        #[serde(default = "Vec::new")]
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
            pub fn content(&self) -> Option<(Kind, &Content)> {
                let all = [
                    (Kind::Real, &self.real),
                    (Kind::Integer, &self.integer),
                    (Kind::Boolean, &self.boolean),
                    (Kind::String, &self.string),
                    (Kind::Enumeration, &self.enumeration),
                ];
                let mut present = all
                    .into_iter()
                    .filter_map(|(kind, content)| Some((kind, content.as_ref()?)));
                present.next().filter(|_| present.next().is_none())
            }
        }
    };
}

content!(SimpleType);
content!(ScalarVariable);

#[cfg(test)]
mod tests {
    use super::*;

    const TANK: &str = include_str!("../../example/modelDescription.xml");

    #[test]
    fn variables_are_found_by_name_with_their_type_and_attributes() {
        let description = Description::parse(TANK).unwrap();
        let (kind, level) = description.variable("level").and_then(ScalarVariable::content).unwrap();
        assert_eq!((kind, level.declared_type.as_deref()), (Kind::Real, Some("Length")));
        let area = description.variable("area").expect("a variable");
        assert_eq!(
            (area.value_reference, area.content().unwrap().1.start.as_deref()),
            (0, Some("2"))
        );
        assert!(description.variable("depth").is_none());
    }

    #[test]
    fn every_attribute_is_read() {
        let xml = r#"<fmiModelDescription fmiVersion="2.0" modelName="n" guid="g" description="d" version="v"
            numberOfEventIndicators="3"><ModelExchange modelIdentifier="me"/><CoSimulation modelIdentifier="cs"/>
            <UnitDefinitions><Unit name="m"/></UnitDefinitions>
            <TypeDefinitions><SimpleType name="L"><Real unit="m"/></SimpleType></TypeDefinitions>
            <LogCategories><Category name="c"/></LogCategories>
            <DefaultExperiment startTime="1" stopTime="2" stepSize="3"/>
            <ModelVariables><ScalarVariable name="x" valueReference="7" description="t" causality="output"
            variability="discrete" initial="exact"><Real declaredType="L" unit="m" start="4" min="5" max="6"
            nominal="8" derivative="1"/></ScalarVariable></ModelVariables>
            <ModelStructure><Outputs><Unknown index="1" dependencies="2" dependenciesKind="fixed"/></Outputs>
            <Derivatives><Unknown index="1"/></Derivatives><InitialUnknowns><Unknown index="1"/></InitialUnknowns>
            </ModelStructure></fmiModelDescription>"#;
        let read = format!("{:?}", Description::parse(xml).unwrap());
        // What is absent would be None, 0 or empty.
        let none = [
            "declared_type",
            "start",
            "min",
            "max",
            "nominal",
            "derivative",
            "dependencies",
            "dependencies_kind",
        ];
        let mut rest = read.clone();
        for field in none {
            rest = rest.replacen(
                &format!(" {field}: None"),
                "",
                if field.starts_with("dep") { 2 } else { 1 },
            );
        }
        for kind in ["integer", "boolean", "string", "enumeration"] {
            rest = rest.replacen(&format!(" {kind}: None"), "", 2);
        }
        for absent in ["None", "\"\"", "[]", ": 0,", "Local", "Continuous"] {
            assert!(!rest.contains(absent), "{absent}: {rest}");
        }
    }

    #[test]
    fn elements_of_other_tools_are_ignored() {
        let other = "<Annotations><Tool name=\"t\"><a b=\"1\">text</a></Tool></Annotations>";
        let plain = Description::parse(TANK).unwrap();
        for (from, to) in [
            ("name=\"area\"", "name=\"area\" vendor=\"x\"".to_owned()),
            ("<Real", format!("{other}<Real")),
            ("</ScalarVariable>", format!("{other}</ScalarVariable>")),
            (
                "<ModelVariables>",
                format!("<VendorAnnotations>{other}</VendorAnnotations><ModelVariables>"),
            ),
        ] {
            let parsed = Description::parse(&TANK.replace(from, &to)).unwrap();
            assert_eq!(parsed, plain);
        }
    }

    #[test]
    fn the_element_and_the_problem_of_an_invalid_attribute_are_named() {
        for (from, to, parts) in [
            (
                "valueReference=\"0\"",
                "valueReference=\"-1\"",
                ["ScalarVariable[0].@valueReference", "invalid digit"],
            ),
            (
                "causality=\"input\"",
                "causality=\"inputs\"",
                ["ScalarVariable[2].@causality", "`calculatedParameter`"],
            ),
        ] {
            let error = Description::parse(&TANK.replacen(from, to, 1)).unwrap_err().to_string();
            assert!(parts.iter().all(|part| error.contains(part)), "{error}");
        }
    }

    #[test]
    fn text_that_is_not_a_description_is_refused() {
        for text in ["level", "<a/>"] {
            assert!(Description::parse(text).is_err());
        }
    }
}
