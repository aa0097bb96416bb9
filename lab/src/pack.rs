//! Packing: a description and a shared library become an FMU.

mod archive;
mod components;
mod documentation;
mod error;
mod library;
mod platform;

use std::path::{Path, PathBuf};

pub use components::{Component, components};
pub use documentation::documentation;
pub use error::PackError;
pub use platform::Platform;

/// Packs the components into `out`, one `<identifier>.fmu` each, and returns their paths.
///
/// The libraries are looked for in the folder `libraries` under the names that cargo gives them. Nothing is written
/// unless all of them can be; an FMU is complete or absent.
///
/// # Errors
/// A library that is missing, for another platform or not an FMI 2.0 component, and failures of the file system.
pub fn pack(
    components: &[Component],
    libraries: &Path,
    out: &Path,
) -> Result<Vec<PathBuf>, PackError> {
    let platform = Platform::running();
    let binaries = components
        .iter()
        .map(|component| library::read(component, libraries, &platform))
        .collect::<Result<Vec<_>, _>>()?;

    std::fs::create_dir_all(out).map_err(|source| PackError::Write {
        path: out.into(),
        source,
    })?;
    let mut finished = Vec::new();
    for (component, binary) in components.iter().zip(&binaries) {
        let name = component.identifier;
        let inside = format!(
            "binaries/{}/{name}{}",
            platform.folder,
            std::env::consts::DLL_SUFFIX
        );
        let pages = documentation(name, &component.description).map_err(PackError::Description)?;
        let mut entries = vec![
            ("modelDescription.xml", component.description.as_bytes()),
            (inside.as_str(), binary.as_slice()),
        ];
        entries.extend(
            pages
                .iter()
                .map(|(name, page)| (name.as_str(), page.as_slice())),
        );
        let path = out.join(format!("{name}.fmu"));
        finished.push((archive::write(out, &entries)?, path));
    }
    let mut written = Vec::new();
    for (file, path) in finished {
        file.persist(&path).map_err(|error| PackError::Write {
            path: path.clone(),
            source: error.error,
        })?;
        written.push(path);
    }
    Ok(written)
}
