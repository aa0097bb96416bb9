//! From XML to a [`Description`].

use std::str::FromStr;

use roxmltree::{Document, Node};

use crate::error::Error;
use crate::{Content, DefaultExperiment, Description, Kind, ModelStructure, ScalarVariable, SimpleType, Unknown};

pub(crate) fn description(text: &str) -> Result<Description, Error> {
    let document = Document::parse(text)?;
    let root = document.root_element();
    if !root.has_tag_name("fmiModelDescription") {
        return Err(Error::Root(root.tag_name().name().to_owned()));
    }
    let name = |element: Node| required(element, "name");
    let interface = |tag: &str| {
        let element = child(root, tag);
        element.map(|element| required(element, "modelIdentifier")).transpose()
    };
    let experiment = |key: &str| text_of(child(root, "DefaultExperiment")?, key);
    let structure = child(root, "ModelStructure");
    let unknowns = |tag: &str| match structure.and_then(|structure| child(structure, tag)) {
        Some(list) => each(list, "Unknown", unknown),
        None => Ok(Vec::new()),
    };
    Ok(Description {
        fmi_version: required(root, "fmiVersion")?,
        model_name: required(root, "modelName")?,
        guid: text_of(root, "guid").unwrap_or_default(),
        description: text_of(root, "description").unwrap_or_default(),
        version: text_of(root, "version").unwrap_or_default(),
        number_of_event_indicators: number(root, "numberOfEventIndicators")?.unwrap_or(0),
        model_exchange: interface("ModelExchange")?,
        co_simulation: interface("CoSimulation")?,
        default_experiment: DefaultExperiment {
            start_time: experiment("startTime"),
            stop_time: experiment("stopTime"),
            step_size: experiment("stepSize"),
        },
        units: listed(root, "UnitDefinitions", "Unit", name)?,
        types: listed(root, "TypeDefinitions", "SimpleType", simple_type)?,
        categories: listed(root, "LogCategories", "Category", name)?,
        variables: listed(root, "ModelVariables", "ScalarVariable", variable)?,
        structure: ModelStructure {
            outputs: unknowns("Outputs")?,
            derivatives: unknowns("Derivatives")?,
            initial_unknowns: unknowns("InitialUnknowns")?,
        },
    })
}

pub(crate) fn elements<'a, 'i>(node: Node<'a, 'i>) -> impl Iterator<Item = Node<'a, 'i>> + use<'a, 'i> {
    node.children().filter(Node::is_element)
}

pub(crate) fn child<'a, 'i>(node: Node<'a, 'i>, tag: &str) -> Option<Node<'a, 'i>> {
    elements(node).find(|element| element.has_tag_name(tag))
}

/// The elements `tag` of `parent`.
fn each<T>(parent: Node, tag: &str, read: impl Fn(Node) -> Result<T, Error>) -> Result<Vec<T>, Error> {
    let found = elements(parent).filter(|element| element.has_tag_name(tag));
    found.map(read).collect()
}

/// The elements `tag` of the element `list` of `root`.
fn listed<T>(root: Node, list: &str, tag: &str, read: impl Fn(Node) -> Result<T, Error>) -> Result<Vec<T>, Error> {
    child(root, list).map_or(Ok(Vec::new()), |list| each(list, tag, read))
}

fn simple_type(element: Node) -> Result<SimpleType, Error> {
    Ok(SimpleType {
        name: required(element, "name")?,
        content: contents(element)?,
    })
}

fn variable(element: Node) -> Result<ScalarVariable, Error> {
    let reference = number(element, "valueReference")?;
    Ok(ScalarVariable {
        name: required(element, "name")?,
        value_reference: reference.ok_or_else(|| missing(element, "valueReference"))?,
        description: text_of(element, "description").unwrap_or_default(),
        causality: text_of(element, "causality"),
        variability: text_of(element, "variability"),
        initial: text_of(element, "initial"),
        content: contents(element)?,
    })
}

/// The elements of each type inside a variable or a declared type.
fn contents(parent: Node) -> Result<Vec<Content>, Error> {
    let kind = |element: Node| match element.tag_name().name() {
        "Real" => Some(Kind::Real),
        "Integer" => Some(Kind::Integer),
        "Boolean" => Some(Kind::Boolean),
        "String" => Some(Kind::String),
        "Enumeration" => Some(Kind::Enumeration),
        _ => None,
    };
    let typed = elements(parent).filter_map(|element| Some((kind(element)?, element)));
    typed
        .map(|(kind, element)| {
            let derivative = element.attribute("derivative");
            Ok(Content {
                kind,
                declared_type: text_of(element, "declaredType"),
                unit: text_of(element, "unit"),
                start: text_of(element, "start"),
                min: text_of(element, "min"),
                max: text_of(element, "max"),
                nominal: text_of(element, "nominal"),
                // A message names the variable.
                derivative: parsed(derivative, parent, "derivative")?,
            })
        })
        .collect()
}

fn unknown(element: Node) -> Result<Unknown, Error> {
    Ok(Unknown {
        index: number(element, "index")?.ok_or_else(|| missing(element, "index"))?,
        dependencies: text_of(element, "dependencies"),
        dependencies_kind: text_of(element, "dependenciesKind"),
    })
}

/// The element and its name, for messages.
pub(crate) fn label(element: Node) -> String {
    let tag = element.tag_name().name();
    let name = element.attribute("name");
    name.map_or_else(|| tag.to_owned(), |name| format!("{tag} {name}"))
}

fn missing(element: Node, attribute: &'static str) -> Error {
    Error::Missing { element: label(element), attribute }
}

fn text_of(element: Node, attribute: &str) -> Option<String> {
    element.attribute(attribute).map(str::to_owned)
}

fn required(element: Node, attribute: &'static str) -> Result<String, Error> {
    text_of(element, attribute).ok_or_else(|| missing(element, attribute))
}

fn number<T: FromStr>(element: Node, attribute: &'static str) -> Result<Option<T>, Error> {
    parsed(element.attribute(attribute), element, attribute)
}

fn parsed<T: FromStr>(value: Option<&str>, element: Node, attribute: &'static str) -> Result<Option<T>, Error> {
    let parsed = value.map(|value| value.trim().parse());
    parsed.transpose().map_err(|_| Error::Number {
        element: label(element),
        attribute,
        value: value.unwrap_or_default().to_owned(),
    })
}
