//! One FMU: its description and its libraries, one for each platform.

use super::{
    Component, File, Libraries, PackError, archive,
    binary::{self, Fitted},
    date, documentation, library,
    platform::Platform,
};

/// The FMUs of the components.
pub(super) fn all(components: &[Component], libraries: &Libraries) -> Result<Vec<File>, PackError> {
    let mut fitted = Vec::new();
    if libraries.own {
        own(&mut fitted, components, libraries)?;
    }
    binary::add(&mut fitted, &libraries.others, components)?;
    let date = date::generation()?;
    let mut files = Vec::new();
    for (index, component) in components.iter().enumerate() {
        let served: Vec<_> = fitted.iter().filter(|f| f.component == index).collect();
        if served.is_empty() {
            return Err(PackError::Unserved { identifier: component.identifier });
        }
        files.push(one(component, &served, date.as_deref())?);
    }
    Ok(files)
}

/// The libraries of this platform. Where masters look into two folders for them, they go into both, unless another library
/// has been given for the second.
fn own(fitted: &mut Vec<Fitted>, components: &[Component], libraries: &Libraries) -> Result<(), PackError> {
    let platform = Platform::running();
    let second = platform
        .also()
        .filter(|also| !libraries.others.iter().any(|other| other.is_for(also)));
    for (component, one) in components.iter().enumerate() {
        let content = library::read(one, &libraries.folder, &platform)?;
        fitted.extend(second.map(|platform| Fitted { component, platform, content: content.clone() }));
        fitted.push(Fitted { component, platform, content });
    }
    Ok(())
}

fn one(component: &Component, libraries: &[&Fitted], date: Option<&str>) -> Result<File, PackError> {
    let identifier = component.identifier;
    let description = component.dated(date);
    let libraries: Vec<(String, &[u8])> = libraries
        .iter()
        .map(|library| {
            let Platform { folder, suffix, .. } = library.platform;
            let name = format!("binaries/{folder}/{identifier}{suffix}");
            (name, library.content.as_slice())
        })
        .collect();
    let pages = documentation(identifier, &description).map_err(PackError::Description)?;
    let mut entries = vec![("modelDescription.xml", description.as_bytes())];
    entries.extend(pages.iter().map(|(name, page)| (name.as_str(), page.as_slice())));
    entries.extend(libraries.iter().map(|(name, content)| (name.as_str(), *content)));
    archive::file(format!("{identifier}.fmu"), &entries)
}
