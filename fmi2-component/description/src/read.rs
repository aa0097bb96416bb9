//! From XML to a [`Description`].

use std::str::FromStr;

use roxmltree::Document;

use crate::error::Error;
use crate::xml;
use crate::{Content, DefaultExperiment, Description, Kind, ModelStructure, ScalarVariable, SimpleType, Unknown};

impl Description {
    /// Reads a description. Names that FMI 2.0 does not know are ignored; [`unknown_names`](crate::unknown_names) lists them.
    ///
    /// # Errors
    /// Text that is not XML, and a missing or invalid attribute.
    pub fn parse(xml: &str) -> Result<Self, Error> {
        description(xml)
    }
}

fn description(text: &str) -> Result<Description, Error> {
    let document = Document::parse(text)?;
    let name = document.root_element().tag_name().name();
    if name != "fmiModelDescription" {
        return Err(Error::Root(name.to_owned()));
    }
    let root: xml::Description = serde_xml_rs::from_str(text)?;
    let whole = "fmiModelDescription";
    let identifier = |interface: Option<xml::Interface>, element: &str| {
        interface
            .map(|i| required(i.model_identifier, element, "modelIdentifier"))
            .transpose()
    };
    let names = |list: Vec<xml::Named>, element: &'static str| {
        let names = list.into_iter().map(|named| required(named.name, element, "name"));
        names.collect::<Result<Vec<_>, _>>()
    };
    let events = root.number_of_event_indicators;
    Ok(Description {
        fmi_version: required(root.fmi_version, whole, "fmiVersion")?,
        model_name: required(root.model_name, whole, "modelName")?,
        guid: root.guid.unwrap_or_default(),
        description: root.description.unwrap_or_default(),
        version: root.version.unwrap_or_default(),
        number_of_event_indicators: number(events, whole, "numberOfEventIndicators")?.unwrap_or(0),
        model_exchange: identifier(root.model_exchange, "ModelExchange")?,
        co_simulation: identifier(root.co_simulation, "CoSimulation")?,
        default_experiment: DefaultExperiment {
            start_time: root.default_experiment.start_time,
            stop_time: root.default_experiment.stop_time,
            step_size: root.default_experiment.step_size,
        },
        units: names(root.unit_definitions.units, "Unit")?,
        types: each(root.type_definitions.types, simple_type)?,
        categories: names(root.log_categories.categories, "Category")?,
        variables: each(root.model_variables.variables, variable)?,
        structure: ModelStructure {
            outputs: each(root.model_structure.outputs.unknowns, unknown)?,
            derivatives: each(root.model_structure.derivatives.unknowns, unknown)?,
            initial_unknowns: each(root.model_structure.initial_unknowns.unknowns, unknown)?,
        },
    })
}

fn each<T, U>(list: Vec<T>, read: fn(T) -> Result<U, Error>) -> Result<Vec<U>, Error> {
    list.into_iter().map(read).collect()
}

/// The lists of an element that has them. serde-xml-rs cannot flatten them into a struct of their own, and a list of variants (`#content`) fails
/// beside other elements, such as annotations.
macro_rules! lists {
    ($element:ident) => {
        [
            (Kind::Real, $element.real),
            (Kind::Integer, $element.integer),
            (Kind::Boolean, $element.boolean),
            (Kind::String, $element.string),
            (Kind::Enumeration, $element.enumeration),
        ]
    };
}

fn simple_type(element: xml::SimpleType) -> Result<SimpleType, Error> {
    let label = label("SimpleType", element.name.as_deref());
    let lists = lists!(element);
    Ok(SimpleType {
        name: required(element.name, &label, "name")?,
        content: contents(lists, &label)?,
    })
}

fn variable(element: xml::ScalarVariable) -> Result<ScalarVariable, Error> {
    let label = label("ScalarVariable", element.name.as_deref());
    let lists = lists!(element);
    let reference = number(element.value_reference, &label, "valueReference")?;
    Ok(ScalarVariable {
        name: required(element.name, &label, "name")?,
        value_reference: reference.ok_or_else(|| missing(&label, "valueReference"))?,
        description: element.description.unwrap_or_default(),
        causality: element.causality,
        variability: element.variability,
        initial: element.initial,
        content: contents(lists, &label)?,
    })
}

/// The elements of each type inside a variable or a declared type.
type Lists = [(Kind, Vec<xml::Content>); 5];

fn contents(lists: Lists, label: &str) -> Result<Vec<Content>, Error> {
    let all = lists
        .into_iter()
        .flat_map(|(kind, list)| list.into_iter().map(move |c| (kind, c)));
    all.map(|(kind, content)| {
        Ok(Content {
            kind,
            declared_type: content.declared_type,
            unit: content.unit,
            start: content.start,
            min: content.min,
            max: content.max,
            nominal: content.nominal,
            derivative: number(content.derivative, label, "derivative")?,
        })
    })
    .collect()
}

fn unknown(element: xml::Unknown) -> Result<Unknown, Error> {
    let index = number(element.index, "Unknown", "index")?;
    Ok(Unknown {
        index: index.ok_or_else(|| missing("Unknown", "index"))?,
        dependencies: element.dependencies,
        dependencies_kind: element.dependencies_kind,
    })
}

/// The element and its name, for messages.
pub(crate) fn label(tag: &str, name: Option<&str>) -> String {
    name.map_or_else(|| tag.to_owned(), |name| format!("{tag} {name}"))
}

fn missing(element: &str, attribute: &'static str) -> Error {
    Error::Missing { element: element.to_owned(), attribute }
}

fn required(value: Option<String>, element: &str, attribute: &'static str) -> Result<String, Error> {
    value.ok_or_else(|| missing(element, attribute))
}

fn number<T: FromStr>(value: Option<String>, element: &str, attribute: &'static str) -> Result<Option<T>, Error> {
    let parsed = value.as_deref().map(|value| value.trim().parse());
    parsed.transpose().map_err(|_| Error::Number {
        element: element.to_owned(),
        attribute,
        value: value.clone().unwrap_or_default(),
    })
}
