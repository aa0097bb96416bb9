//! One FMU: its description and its libraries, one for each platform.

use super::archive::{self, File};
use super::library::{Fitted, fitted};
use super::{Component, Libraries, PackError, date, documentation, platform::Platform};

/// The FMUs of the components.
pub(super) fn all(components: &[Component], libraries: &Libraries) -> Result<Vec<File>, PackError> {
    let fitted = fitted(components, libraries)?;
    let date = date::generation()?;
    let fmu = |(index, component): (usize, &Component)| {
        let served: Vec<_> = fitted.iter().filter(|one| one.component == index).collect();
        match served.is_empty() {
            true => Err(PackError::Unserved { identifier: component.identifier }),
            false => one(component, &served, date.as_deref()),
        }
    };
    components.iter().enumerate().map(fmu).collect()
}

fn one(component: &Component, libraries: &[&Fitted], date: Option<&str>) -> Result<File, PackError> {
    let identifier = component.identifier;
    let description = component.dated(date);
    let names = libraries.iter().map(|library| {
        let Platform { folder, suffix, .. } = library.platform;
        format!("binaries/{folder}/{identifier}{suffix}")
    });
    let names: Vec<String> = names.collect();
    let pages = documentation(identifier, &description).map_err(PackError::Description)?;
    let mut entries = vec![("modelDescription.xml", description.as_bytes())];
    entries.extend(pages.iter().map(|(name, page)| (name.as_str(), page.as_slice())));
    let named = names.iter().zip(libraries);
    entries.extend(named.map(|(name, library)| (name.as_str(), library.content.as_slice())));
    archive::file(format!("{identifier}.fmu"), &entries)
}
