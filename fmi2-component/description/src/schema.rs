//! The names that the schema of FMI 2.0.5 has, and the pass over a description that keeps these and no others.

use std::borrow::Cow;
use std::collections::BTreeSet;
use std::fmt::Display;

use encoding_rs::{Encoding, UTF_8, UTF_16BE, UTF_16LE};
use xml::reader::XmlEvent;
use xml::writer::{EmitterConfig, XmlEvent as Written};
use xml::{EventReader, ParserConfig};

use crate::Error;

/// An element of the schema.
struct Element {
    name: &'static str,
    /// The elements in it; `*`: any number of them.
    elements: &'static str,
    /// Attributes that are text.
    texts: &'static str,
    /// Attributes that are numbers or Booleans: white space around them has no meaning.
    values: &'static str,
}

const fn element(name: &'static str, elements: &'static str, texts: &'static str, values: &'static str) -> Element {
    Element { name, elements, texts, values }
}

/// All elements but those of tools: annotations may contain anything.
const ELEMENTS: [Element; 27] = [
    element(
        ROOT,
        "ModelExchange CoSimulation UnitDefinitions TypeDefinitions LogCategories DefaultExperiment VendorAnnotations \
         ModelVariables ModelStructure",
        "fmiVersion modelName guid description author version copyright license generationTool generationDateAndTime \
         variableNamingConvention",
        "numberOfEventIndicators",
    ),
    element(
        "ModelExchange",
        "SourceFiles",
        "modelIdentifier",
        "needsExecutionTool completedIntegratorStepNotNeeded canBeInstantiatedOnlyOncePerProcess \
         canNotUseMemoryManagementFunctions canGetAndSetFMUstate canSerializeFMUstate providesDirectionalDerivative",
    ),
    element(
        "CoSimulation",
        "SourceFiles",
        "modelIdentifier",
        "needsExecutionTool canHandleVariableCommunicationStepSize canInterpolateInputs maxOutputDerivativeOrder \
         canRunAsynchronuously canBeInstantiatedOnlyOncePerProcess canNotUseMemoryManagementFunctions \
         canGetAndSetFMUstate canSerializeFMUstate providesDirectionalDerivative",
    ),
    element("SourceFiles", "File*", "", ""),
    element("File", "", "name", ""),
    element("UnitDefinitions", "Unit*", "", ""),
    element("Unit", "BaseUnit DisplayUnit*", "name", ""),
    element("BaseUnit", "", "", "kg m s A K mol cd rad factor offset"),
    element("DisplayUnit", "", "name", "factor offset"),
    element("TypeDefinitions", "SimpleType*", "", ""),
    element(
        "SimpleType",
        "Real Integer Boolean String Enumeration",
        "name description",
        "",
    ),
    element("LogCategories", "Category*", "", ""),
    element("Category", "", "name description", ""),
    element("DefaultExperiment", "", "", "startTime stopTime tolerance stepSize"),
    element("ModelVariables", "ScalarVariable*", "", ""),
    element(
        "ScalarVariable",
        "Real Integer Boolean String Enumeration Annotations",
        "name description causality variability initial",
        "valueReference canHandleMultipleSetPerTimeInstant",
    ),
    element(
        "Real",
        "",
        "declaredType quantity unit displayUnit",
        "relativeQuantity min max nominal unbounded start derivative reinit",
    ),
    element("Integer", "", "declaredType quantity", "min max start"),
    element("Boolean", "", "declaredType", "start"),
    element("String", "", "declaredType start", ""),
    element("Enumeration", "Item*", "declaredType quantity", "min max start"),
    element("Item", "", "name description", "value"),
    element("ModelStructure", "Outputs Derivatives InitialUnknowns", "", ""),
    element("Outputs", "Unknown*", "", ""),
    element("Derivatives", "Unknown*", "", ""),
    element("InitialUnknowns", "Unknown*", "", ""),
    element("Unknown", "", "dependencies dependenciesKind", "index"),
];
const ROOT: &str = "fmiModelDescription";
/// The document itself.
const DOCUMENT: Element = element("the document", ROOT, "", "");
/// Namespace of the attributes that say where the schema is.
const INSTANCE: &str = "http://www.w3.org/2001/XMLSchema-instance";

/// The entry of a name in a list of names.
fn entry(names: &'static str, name: &str) -> Option<&'static str> {
    names
        .split_whitespace()
        .find(|listed| listed.trim_end_matches('*') == name)
}

/// The description in UTF-8 with what the schema has, without annotations. The list names what is left out beside these.
pub(crate) fn known(description: &[u8]) -> Result<(Vec<u8>, Vec<String>), Error> {
    let fault = |error: &dyn Display| Error(error.to_string());
    let mut left_out = BTreeSet::new();
    let text = decoded(description, &mut left_out)?;
    let reader = EventReader::new_with_config(text.as_bytes(), ParserConfig::new().ignore_comments(true));
    let mut writer = EmitterConfig::new()
        .write_document_declaration(false)
        .create_writer(Vec::new());
    // The open elements, and which of the elements that may occur once they have had.
    let mut open = vec![(&DOCUMENT, BTreeSet::new())];
    // Depth below an element that is left out.
    let mut skipped = 0_usize;
    for event in reader {
        match event.map_err(|error| fault(&error))? {
            XmlEvent::StartElement { .. } if skipped > 0 => skipped += 1,
            XmlEvent::StartElement { name, attributes, .. } => {
                let (own, (parent, before)) = (&*name.local_name, open.last_mut().expect("the document"));
                let listed = entry(parent.elements, own).filter(|_| name.prefix.is_none());
                let element = ELEMENTS.iter().find(|element| element.name == own);
                let unwanted = match listed {
                    None if parent.name == DOCUMENT.name => {
                        return Err(Error(format!("its first element is {name}; expected {ROOT}")));
                    }
                    None => Some("the element"),
                    Some(once) if !once.ends_with('*') && !before.insert(once) => Some("a second element"),
                    Some(_) => None,
                };
                if let Some(unwanted) = unwanted {
                    left_out.insert(format!("{unwanted} {name} in {}", parent.name));
                }
                // The content of annotations is a tool's own: they have no row.
                let (None, Some(element)) = (unwanted, element) else {
                    skipped = 1;
                    continue;
                };
                let mut start = Written::start_element(own);
                for attribute in &attributes {
                    let (key, value) = (&*attribute.name.local_name, &*attribute.value);
                    let unqualified = attribute.name.prefix.is_none();
                    if unqualified && entry(element.values, key).is_some() {
                        // -0 is a count, too.
                        let value = value.trim();
                        let zero = value
                            .strip_prefix('-')
                            .filter(|digits| digits.bytes().all(|digit| digit == b'0'));
                        start = start.attr(key, zero.unwrap_or(value));
                    } else if unqualified && entry(element.texts, key).is_some() {
                        start = start.attr(key, value);
                    } else if attribute.name.namespace.as_deref() != Some(INSTANCE) {
                        left_out.insert(format!("the attribute {} of {own}", attribute.name));
                    }
                }
                writer.write(start).map_err(|error| fault(&error))?;
                open.push((element, BTreeSet::new()));
            }
            XmlEvent::EndElement { .. } if skipped > 0 => skipped -= 1,
            XmlEvent::EndElement { .. } => {
                open.pop();
                writer.write(Written::end_element()).map_err(|error| fault(&error))?;
            }
            _ => {}
        }
    }
    Ok((writer.into_inner(), left_out.into_iter().collect()))
}

/// The text without its XML declaration, in the encoding that a byte order mark or the declaration names; otherwise UTF-8.
fn decoded<'a>(description: &'a [u8], left_out: &mut BTreeSet<String>) -> Result<Cow<'a, str>, Error> {
    let start = description[..description.len().min(300)]
        .iter()
        .map(|byte| char::from(*byte));
    let start: String = start.filter(|character| *character != '\0').collect();
    let declaration = start
        .find("<?xml")
        .and_then(|from| Some(&start[from..from + start[from..].find("?>")?]));
    let quoted = |text: &str| text.split(['"', '\'']).nth(1).map(str::to_owned);
    let label = declaration.and_then(|text| quoted(text.split_once("encoding")?.1));
    let declared = match &label {
        None => UTF_8,
        Some(label) => Encoding::for_label(label.as_bytes())
            .ok_or_else(|| Error(format!("its encoding {label} is unknown; write it in UTF-8")))?,
    };
    // What can be read so far is no UTF-16, whatever it declares; UTF-16 without a mark begins with < and a NUL.
    let encoding = match description {
        [b'<', 0, ..] => UTF_16LE,
        [0, b'<', ..] => UTF_16BE,
        _ if declared.is_ascii_compatible() => declared,
        _ => UTF_8,
    };
    let (text, encoding, malformed) = encoding.decode(description);
    if malformed {
        left_out.insert(format!("bytes that are not {}", encoding.name()));
    }
    Ok(match text.split_once("?>") {
        Some((_, rest)) if declaration.is_some() => rest.to_owned().into(),
        _ => text,
    })
}
