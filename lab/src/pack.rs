//! Packing: a description and shared libraries become an FMU, two FMUs and a scene a coupled system.

mod archive;
mod components;
mod date;
mod documentation;
mod error;
mod fmu;
mod library;
mod platform;
mod symbols;
mod system;

use std::path::{Path, PathBuf};

pub use components::{Component, components};
pub use documentation::documentation;
pub use error::PackError;
pub use library::{Binary, Libraries};
pub use platform::Platform;

use crate::{files, scene::Scene};

/// Packs the components into `out`, one `<identifier>.fmu` each, and returns their paths.
///
/// Nothing is written unless all of them can be; a file is complete or absent.
pub fn pack(components: &[Component], libraries: &Libraries, out: &Path) -> Result<Vec<PathBuf>, PackError> {
    Ok(files::write(out, fmu::all(components, libraries)?)?)
}

/// Packs plant and controller into `out`, and the two of them coupled as `bench.ssp` with the parameters of the scene.
pub fn pack_bench(scene: &Scene, libraries: &Libraries, out: &Path) -> Result<Vec<PathBuf>, PackError> {
    let mut files = fmu::all(&components(), libraries)?;
    files.push(system::file(scene, &files)?);
    Ok(files::write(out, files)?)
}
