//! Finding and checking the shared library of a component.

use std::{
    env::consts::{DLL_PREFIX, DLL_SUFFIX},
    io::ErrorKind,
    path::Path,
};

use super::{
    Component, PackError,
    platform::Platform,
    symbols::{exports, mentions},
};

/// The bytes of the component's library in `folder`, if it is one for `platform` and belongs to the description.
pub(super) fn read(component: &Component, folder: &Path, platform: &Platform) -> Result<Vec<u8>, PackError> {
    let build_options = component.build_options();
    let path = folder.join(format!("{DLL_PREFIX}{}{DLL_SUFFIX}", component.library));
    let bytes = std::fs::read(&path).map_err(|source| match source.kind() {
        ErrorKind::NotFound => PackError::Missing {
            identifier: component.identifier,
            path: path.clone(),
            build_options: build_options.clone(),
        },
        _ => PackError::Read { path: path.clone(), source },
    })?;
    if let Err(found) = platform.check(&bytes) {
        return Err(PackError::Platform { path, found, needed: platform.name, build_options });
    }
    if !exports(&bytes, "fmi2Instantiate") {
        return Err(PackError::NotAComponent { path, build_options });
    }
    if component.guid().is_some_and(|guid| !mentions(&bytes, guid)) {
        let identifier = component.identifier;
        return Err(PackError::Stale { path, identifier, build_options });
    }
    Ok(bytes)
}
