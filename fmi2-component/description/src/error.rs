//! Errors of a description.

use std::fmt;

/// Reason why a text is not a model description.
#[derive(Clone, Debug, PartialEq)]
pub enum Error {
    /// The text is not XML.
    Xml(String),
    /// The root element is not `fmiModelDescription`.
    Root(String),
    /// An element lacks an attribute.
    Missing {
        /// The element.
        element: String,
        /// The attribute.
        attribute: &'static str,
    },
    /// The value of an attribute is not a number.
    Number {
        /// The element.
        element: String,
        /// The attribute.
        attribute: &'static str,
        /// Its value.
        value: String,
    },
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Xml(error) => write!(f, "the text is not XML: {error}"),
            Self::Root(name) => {
                write!(f, "the root element is {name}, not fmiModelDescription")
            }
            Self::Missing { element, attribute } => {
                write!(f, "{element} has no attribute {attribute}")
            }
            Self::Number { element, attribute, value } => write!(
                f,
                "{element}: {attribute} = {value:?} is not a whole number, 0 or above"
            ),
        }
    }
}

impl std::error::Error for Error {}

impl From<roxmltree::Error> for Error {
    fn from(error: roxmltree::Error) -> Self {
        Self::Xml(error.to_string())
    }
}

impl From<serde_xml_rs::Error> for Error {
    fn from(error: serde_xml_rs::Error) -> Self {
        Self::Xml(error.to_string())
    }
}
