//! Reader of `modelDescription.xml` (FMI 2.0, clause 2.2).
//!
//! The build step checks descriptions with it, and the lab writes the documentation of an FMU. Values are kept as text,
//! because their types follow from the element.
#![forbid(unsafe_code)]

mod error;
mod names;
mod read;
mod xml;

pub use error::Error;
pub use names::unknown_names;

/// A model description.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Description {
    /// `fmiVersion`.
    pub fmi_version: String,
    /// `modelName`.
    pub model_name: String,
    /// `guid`.
    pub guid: String,
    /// `description`; empty if absent.
    pub description: String,
    /// `version`; empty if absent.
    pub version: String,
    /// `numberOfEventIndicators`.
    pub number_of_event_indicators: usize,
    /// `modelIdentifier` of `ModelExchange`.
    pub model_exchange: Option<String>,
    /// `modelIdentifier` of `CoSimulation`.
    pub co_simulation: Option<String>,
    /// `DefaultExperiment`.
    pub default_experiment: DefaultExperiment,
    /// Names of the units.
    pub units: Vec<String>,
    /// Declared types.
    pub types: Vec<SimpleType>,
    /// Names of the log categories.
    pub categories: Vec<String>,
    /// Variables, in the order to which indices of the model structure refer.
    pub variables: Vec<ScalarVariable>,
    /// `ModelStructure`.
    pub structure: ModelStructure,
}

/// `DefaultExperiment`, values as text, s.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DefaultExperiment {
    /// `startTime`.
    pub start_time: Option<String>,
    /// `stopTime`.
    pub stop_time: Option<String>,
    /// `stepSize`.
    pub step_size: Option<String>,
}

/// The element that gives a variable or a declared type its type.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// `Real`.
    Real,
    /// `Integer`.
    Integer,
    /// `Boolean`.
    Boolean,
    /// `String`.
    String,
    /// `Enumeration`; its values are integers in the C interface.
    Enumeration,
}

/// `SimpleType`: gives its attributes to variables that lack them.
#[derive(Clone, Debug, PartialEq)]
pub struct SimpleType {
    /// `name`.
    pub name: String,
    /// The element inside.
    pub content: Vec<Content>,
}

/// `ScalarVariable`.
#[derive(Clone, Debug, PartialEq)]
pub struct ScalarVariable {
    /// `name`.
    pub name: String,
    /// `valueReference`.
    pub value_reference: u32,
    /// `description`; empty if absent.
    pub description: String,
    /// `causality`.
    pub causality: Option<String>,
    /// `variability`.
    pub variability: Option<String>,
    /// `initial`.
    pub initial: Option<String>,
    /// The elements `Real`, `Integer`, … inside; a valid variable has one.
    pub content: Vec<Content>,
}

/// An element `Real`, `Integer`, `Boolean`, `String` or `Enumeration`. Values are text.
#[derive(Clone, Debug, PartialEq)]
pub struct Content {
    /// Name of the element.
    pub kind: Kind,
    /// `declaredType`.
    pub declared_type: Option<String>,
    /// `unit`.
    pub unit: Option<String>,
    /// `start`.
    pub start: Option<String>,
    /// `min`.
    pub min: Option<String>,
    /// `max`.
    pub max: Option<String>,
    /// `nominal`.
    pub nominal: Option<String>,
    /// `derivative`: index of the state, counted from 1.
    pub derivative: Option<usize>,
}

/// `ModelStructure`: dependencies between variables.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ModelStructure {
    /// `Outputs`.
    pub outputs: Vec<Unknown>,
    /// `Derivatives`.
    pub derivatives: Vec<Unknown>,
    /// `InitialUnknowns`.
    pub initial_unknowns: Vec<Unknown>,
}

/// `Unknown`.
#[derive(Clone, Debug, PartialEq)]
pub struct Unknown {
    /// Index of the variable, counted from 1.
    pub index: usize,
    /// `dependencies`.
    pub dependencies: Option<String>,
    /// `dependenciesKind`.
    pub dependencies_kind: Option<String>,
}

impl Description {
    /// The variable of that name.
    #[must_use]
    pub fn variable(&self, name: &str) -> Option<&ScalarVariable> {
        self.variables.iter().find(|variable| variable.name == name)
    }
}

impl ScalarVariable {
    /// The type, if there is exactly one.
    #[must_use]
    pub fn kind(&self) -> Option<Kind> {
        match self.content[..] {
            [Content { kind, .. }] => Some(kind),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TANK: &str = include_str!("../../example/modelDescription.xml");

    #[test]
    fn variables_are_found_by_name_with_their_type_and_attributes() {
        let description = Description::parse(TANK).unwrap();
        let level = description.variable("level").expect("a variable");
        assert_eq!(level.kind(), Some(Kind::Real));
        assert_eq!(level.content[0].declared_type.as_deref(), Some("Length"));
        let area = description.variable("area").expect("a variable");
        assert_eq!((area.value_reference, area.content[0].start.as_deref()), (0, Some("2")));
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
            variability="continuous" initial="exact"><Real declaredType="L" unit="m" start="4" min="5" max="6"
            nominal="8" derivative="1"/></ScalarVariable></ModelVariables>
            <ModelStructure><Outputs><Unknown index="1" dependencies="2" dependenciesKind="fixed"/></Outputs>
            <Derivatives><Unknown index="1"/></Derivatives><InitialUnknowns><Unknown index="1"/></InitialUnknowns>
            </ModelStructure></fmiModelDescription>"#;
        let read = format!("{:?}", Description::parse(xml).unwrap());
        // What is absent would be None, 0 or empty.
        let optional = read.replace("dependencies: None, dependencies_kind: None", "");
        for absent in ["None", "\"\"", "[]", ": 0,"] {
            let of_type = optional.replacen("declared_type: None, unit: Some(\"m\"), start: None, min: None, max: None, nominal: None, derivative: None", "", 1);
            assert!(!of_type.contains(absent), "{absent}: {read}");
        }
    }

    #[test]
    fn a_description_of_another_tool_may_contain_unknown_names() {
        let xml = TANK.replacen("name=\"area\"", "name=\"area\" vendor=\"x\"", 1);
        assert!(Description::parse(&xml).is_ok());
        let unknown = unknown_names(&xml).unwrap();
        assert_eq!(unknown.len(), 1);
        assert!(unknown[0].contains("area") && unknown[0].contains("vendor"));
        // Elements with elements of their own, before and after that of the type.
        let other = "<Annotations><Tool name=\"t\"><a b=\"1\">text</a></Tool></Annotations>";
        let plain = Description::parse(TANK).unwrap();
        for (from, to) in [
            ("<Real", format!("{other}<Real")),
            ("</ScalarVariable>", format!("{other}</ScalarVariable>")),
        ] {
            let parsed = Description::parse(&TANK.replace(from, &to)).unwrap();
            assert_eq!(parsed, plain);
        }
    }

    #[test]
    fn an_invalid_value_reference_is_refused_with_the_variable_and_the_value() {
        let xml = TANK.replacen("valueReference=\"0\"", "valueReference=\"-1\"", 1);
        let error = Description::parse(&xml).unwrap_err().to_string();
        assert!(error.contains("area") && error.contains("-1"), "{error}");
    }

    #[test]
    fn text_that_is_not_a_description_is_refused() {
        assert!(matches!(Description::parse("level"), Err(Error::Xml(_))));
        assert!(matches!(Description::parse("<a/>"), Err(Error::Root(_))));
    }
}
