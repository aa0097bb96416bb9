//! Names that FMI 2.0 does not know. A misspelt optional attribute would otherwise count as absent.

use roxmltree::{Document, Node};

use crate::error::Error;
use crate::read;

/// Attributes and elements that an element may have.
struct Known {
    attributes: &'static [&'static str],
    elements: &'static [&'static str],
}

const VARIABLE: Known = Known {
    attributes: &[
        "name",
        "valueReference",
        "description",
        "causality",
        "variability",
        "initial",
        "canHandleMultipleSetPerTimeInstant",
    ],
    elements: &["Real", "Integer", "Boolean", "String", "Enumeration", "Annotations"],
};

const TYPE: Known = Known {
    attributes: &["name", "description"],
    elements: &["Real", "Integer", "Boolean", "String", "Enumeration"],
};

const CONTENT: Known = Known {
    attributes: &[
        "declaredType",
        "quantity",
        "unit",
        "displayUnit",
        "relativeQuantity",
        "min",
        "max",
        "nominal",
        "unbounded",
        "start",
        "derivative",
        "reinit",
    ],
    elements: &["Item"],
};

const STRUCTURE: Known = Known {
    attributes: &[],
    elements: &["Outputs", "Derivatives", "InitialUnknowns"],
};

const UNKNOWNS: Known = Known { attributes: &[], elements: &["Unknown"] };

const UNKNOWN: Known = Known {
    attributes: &["index", "dependencies", "dependenciesKind"],
    elements: &[],
};

/// Lists unknown names in variables, declared types and the model structure, one line each.
///
/// # Errors
/// Text that is not XML.
pub fn unknown_names(xml: &str) -> Result<Vec<String>, Error> {
    let document = Document::parse(xml)?;
    let root = document.root_element();
    let mut faults = Vec::new();
    for (list, known) in [("ModelVariables", &VARIABLE), ("TypeDefinitions", &TYPE)] {
        for element in child(root, list).into_iter().flat_map(elements) {
            check(element, known, &mut faults);
            let contents = elements(element).filter(|e| !e.has_tag_name("Annotations"));
            contents.for_each(|content| check(content, &CONTENT, &mut faults));
        }
    }
    if let Some(structure) = child(root, "ModelStructure") {
        check(structure, &STRUCTURE, &mut faults);
        for list in elements(structure) {
            check(list, &UNKNOWNS, &mut faults);
            elements(list).for_each(|unknown| check(unknown, &UNKNOWN, &mut faults));
        }
    }
    Ok(faults)
}

fn elements<'a, 'i>(node: Node<'a, 'i>) -> impl Iterator<Item = Node<'a, 'i>> + use<'a, 'i> {
    node.children().filter(Node::is_element)
}

fn child<'a, 'i>(node: Node<'a, 'i>, name: &str) -> Option<Node<'a, 'i>> {
    elements(node).find(|element| element.has_tag_name(name))
}

fn label(element: Node) -> String {
    read::label(element.tag_name().name(), element.attribute("name"))
}

fn check(element: Node, known: &Known, faults: &mut Vec<String>) {
    for attribute in element.attributes() {
        if !known.attributes.contains(&attribute.name()) {
            let names = known.attributes.join(", ");
            faults.push(format!(
                "{} has the unknown attribute {}; there are {names}",
                label(element),
                attribute.name()
            ));
        }
    }
    for inner in elements(element) {
        let name = inner.tag_name().name();
        if !known.elements.contains(&name) {
            let names = known.elements.join(", ");
            faults.push(format!(
                "{} has the unknown element {name}; there are {names}",
                label(element)
            ));
        }
    }
}
