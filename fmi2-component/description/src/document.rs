//! The elements of a description, to make another description of it: the one writer of descriptions.

use std::fmt::Display;

use xml::reader::{EventReader, XmlEvent};
use xml::writer::{EmitterConfig, EventWriter, XmlEvent as Written};

use crate::Error;

/// An element of a description.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Element {
    pub name: String,
    /// Names and values, in their order.
    pub attributes: Vec<(String, String)>,
    pub children: Vec<Element>,
}

impl Element {
    #[must_use]
    pub fn new(name: &str, attributes: &[(&str, &dyn Display)], children: Vec<Self>) -> Self {
        let attributes = attributes
            .iter()
            .map(|(name, value)| ((*name).into(), value.to_string()));
        Self {
            name: name.into(),
            attributes: attributes.collect(),
            children,
        }
    }

    /// The root of a document. Comments, and texts in elements, which descriptions do not have, are left out.
    ///
    /// # Errors
    /// A text that is not XML.
    pub fn parse(xml: &str) -> Result<Self, Error> {
        let mut open = vec![Self::default()];
        for event in EventReader::new(xml.as_bytes()) {
            match event.map_err(|error| Error(error.to_string()))? {
                XmlEvent::StartElement { name, attributes, .. } => {
                    let attributes = attributes.into_iter().map(|one| (one.name.local_name, one.value));
                    let (name, attributes) = (name.local_name, attributes.collect());
                    open.push(Self { name, attributes, children: Vec::new() });
                }
                XmlEvent::EndElement { .. } => {
                    if let (Some(done), Some(parent)) = (open.pop(), open.last_mut()) {
                        parent.children.push(done);
                    }
                }
                _ => {}
            }
        }
        Ok(open.swap_remove(0).children.pop().unwrap_or_default())
    }

    /// The document of which this is the root, in UTF-8.
    ///
    /// # Panics
    /// If a name is not one of XML: never for what was parsed.
    #[must_use]
    pub fn document(&self) -> String {
        let mut written = Vec::new();
        let config = EmitterConfig::new().perform_indent(true).line_separator("\n");
        // A vector takes every byte.
        self.write(&mut config.create_writer(&mut written))
            .expect("a document in memory");
        String::from_utf8_lossy(&written).into_owned() + "\n"
    }

    fn write(&self, writer: &mut EventWriter<&mut Vec<u8>>) -> xml::writer::Result<()> {
        let start = Written::start_element(self.name.as_str());
        let attributes = self.attributes.iter();
        writer.write(attributes.fold(start, |start, (name, value)| start.attr(name.as_str(), value)))?;
        self.children.iter().try_for_each(|child| child.write(writer))?;
        writer.write(Written::end_element())
    }

    /// The value of an attribute; empty without one.
    #[must_use]
    pub fn get(&self, name: &str) -> &str {
        let found = self.attributes.iter().find(|(other, _)| other == name);
        found.map_or("", |(_, value)| value)
    }

    pub fn set(&mut self, name: &str, value: impl Display) {
        match self.attributes.iter_mut().find(|(other, _)| other == name) {
            Some((_, old)) => *old = value.to_string(),
            None => self.attributes.push((name.into(), value.to_string())),
        }
    }

    pub fn remove(&mut self, name: &str) {
        self.attributes.retain(|(other, _)| other != name);
    }

    /// The first child of this name, which is added without one.
    pub fn child(&mut self, name: &str) -> &mut Self {
        let found = self.children.iter().position(|child| child.name == name);
        let place = found.unwrap_or_else(|| {
            self.children.push(Self::new(name, &[], Vec::new()));
            self.children.len() - 1
        });
        &mut self.children[place]
    }
}
