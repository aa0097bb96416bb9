//! From XML to a [`Description`].

use std::str::FromStr;

use roxmltree::{Document, Node};

use crate::error::Error;
use crate::{Content, DefaultExperiment, Description, Kind, ModelStructure, ScalarVariable, SimpleType, Unknown};

pub(crate) fn description(xml: &str) -> Result<Description, Error> {
    let document = Document::parse(xml)?;
    let root = document.root_element();
    if !root.has_tag_name("fmiModelDescription") {
        return Err(Error::Root(root.tag_name().name().to_owned()));
    }
    let list = |name| {
        let list = child(root, name);
        list.into_iter().flat_map(|list| elements(list))
    };
    let identifier = |name| {
        child(root, name)
            .map(|interface| required(interface, "modelIdentifier"))
            .transpose()
    };
    let names = |name| list(name).map(|element| required(element, "name"));
    Ok(Description {
        fmi_version: required(root, "fmiVersion")?,
        model_name: required(root, "modelName")?,
        guid: text(root, "guid").unwrap_or_default(),
        description: text(root, "description").unwrap_or_default(),
        version: text(root, "version").unwrap_or_default(),
        number_of_event_indicators: number(root, "numberOfEventIndicators")?.unwrap_or(0),
        model_exchange: identifier("ModelExchange")?,
        co_simulation: identifier("CoSimulation")?,
        default_experiment: child(root, "DefaultExperiment").map_or_else(DefaultExperiment::default, |experiment| {
            DefaultExperiment {
                start_time: text(experiment, "startTime"),
                stop_time: text(experiment, "stopTime"),
                step_size: text(experiment, "stepSize"),
            }
        }),
        units: names("UnitDefinitions").collect::<Result<_, _>>()?,
        types: list("TypeDefinitions").map(simple_type).collect::<Result<_, _>>()?,
        categories: names("LogCategories").collect::<Result<_, _>>()?,
        variables: list("ModelVariables")
            .filter(|element| element.has_tag_name("ScalarVariable"))
            .map(variable)
            .collect::<Result<_, _>>()?,
        structure: child(root, "ModelStructure")
            .map(structure)
            .transpose()?
            .unwrap_or_default(),
    })
}

fn simple_type(element: Node) -> Result<SimpleType, Error> {
    Ok(SimpleType {
        name: required(element, "name")?,
        content: contents(element)?,
    })
}

fn variable(element: Node) -> Result<ScalarVariable, Error> {
    Ok(ScalarVariable {
        name: required(element, "name")?,
        value_reference: number(element, "valueReference")?.ok_or_else(|| Error::Missing {
            element: label(element),
            attribute: "valueReference",
        })?,
        description: text(element, "description").unwrap_or_default(),
        causality: text(element, "causality"),
        variability: text(element, "variability"),
        initial: text(element, "initial"),
        content: contents(element)?,
    })
}

fn contents(element: Node) -> Result<Vec<Content>, Error> {
    elements(element)
        .filter_map(|inner| Some((kind(inner.tag_name().name())?, inner)))
        .map(|(kind, inner)| {
            Ok(Content {
                kind,
                declared_type: text(inner, "declaredType"),
                unit: text(inner, "unit"),
                start: text(inner, "start"),
                min: text(inner, "min"),
                max: text(inner, "max"),
                nominal: text(inner, "nominal"),
                derivative: number(inner, "derivative")?,
            })
        })
        .collect()
}

fn kind(element: &str) -> Option<Kind> {
    Some(match element {
        "Real" => Kind::Real,
        "Integer" => Kind::Integer,
        "Boolean" => Kind::Boolean,
        "String" => Kind::String,
        "Enumeration" => Kind::Enumeration,
        _ => return None,
    })
}

fn structure(element: Node) -> Result<ModelStructure, Error> {
    let unknowns = |name| {
        let list = child(element, name).into_iter();
        let unknowns = list.flat_map(|list| elements(list)).map(|unknown| {
            Ok(Unknown {
                index: number(unknown, "index")?.ok_or_else(|| Error::Missing {
                    element: label(unknown),
                    attribute: "index",
                })?,
                dependencies: text(unknown, "dependencies"),
                dependencies_kind: text(unknown, "dependenciesKind"),
            })
        });
        unknowns.collect::<Result<_, Error>>()
    };
    Ok(ModelStructure {
        outputs: unknowns("Outputs")?,
        derivatives: unknowns("Derivatives")?,
        initial_unknowns: unknowns("InitialUnknowns")?,
    })
}

pub(crate) fn elements<'a, 'i>(node: Node<'a, 'i>) -> impl Iterator<Item = Node<'a, 'i>> + use<'a, 'i> {
    node.children().filter(Node::is_element)
}

pub(crate) fn child<'a, 'i>(node: Node<'a, 'i>, name: &str) -> Option<Node<'a, 'i>> {
    elements(node).find(|element| element.has_tag_name(name))
}

/// The element and its name, for messages.
pub(crate) fn label(element: Node) -> String {
    let tag = element.tag_name().name();
    match element.attribute("name") {
        Some(name) => format!("{tag} {name}"),
        None => tag.to_owned(),
    }
}

fn text(element: Node, attribute: &str) -> Option<String> {
    element.attribute(attribute).map(str::to_owned)
}

fn required(element: Node, attribute: &'static str) -> Result<String, Error> {
    text(element, attribute).ok_or_else(|| Error::Missing {
        element: label(element),
        attribute,
    })
}

fn number<T: FromStr>(element: Node, attribute: &'static str) -> Result<Option<T>, Error> {
    let Some(value) = element.attribute(attribute) else {
        return Ok(None);
    };
    value.trim().parse().map(Some).map_err(|_| Error::Number {
        element: label(element),
        attribute,
        value: value.to_owned(),
    })
}
