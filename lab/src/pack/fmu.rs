//! One FMU: its description and its libraries, one for each platform.

use super::{
    Component, File, Libraries, PackError, archive,
    binary::{self, Fitted},
    documentation, library,
    platform::Platform,
};

/// The FMUs of the components.
pub(super) fn all(components: &[Component], libraries: &Libraries) -> Result<Vec<File>, PackError> {
    let platform = Platform::running();
    let mut fitted = Vec::new();
    for (index, component) in components.iter().enumerate() {
        fitted.push(Fitted {
            component: index,
            platform,
            content: library::read(component, &libraries.folder, &platform)?,
        });
    }
    binary::add(&mut fitted, &libraries.others, components)?;
    components
        .iter()
        .enumerate()
        .map(|(index, component)| one(component, fitted.iter().filter(|f| f.component == index)))
        .collect()
}

fn one<'a>(
    component: &Component,
    libraries: impl Iterator<Item = &'a Fitted>,
) -> Result<File, PackError> {
    let identifier = component.identifier;
    let libraries: Vec<(String, &[u8])> = libraries
        .map(|library| {
            let Platform { folder, suffix, .. } = library.platform;
            let name = format!("binaries/{folder}/{identifier}{suffix}");
            (name, library.content.as_slice())
        })
        .collect();
    let pages =
        documentation(identifier, &component.description).map_err(PackError::Description)?;
    let mut entries = vec![("modelDescription.xml", component.description.as_bytes())];
    entries.extend(
        pages
            .iter()
            .map(|(name, page)| (name.as_str(), page.as_slice())),
    );
    entries.extend(
        libraries
            .iter()
            .map(|(name, content)| (name.as_str(), *content)),
    );
    let name = format!("{identifier}.fmu");
    match archive::zip(&entries) {
        Ok(content) => Ok(File { name, content }),
        Err(source) => Err(PackError::Write {
            path: name.into(),
            source,
        }),
    }
}
