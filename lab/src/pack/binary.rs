//! Libraries for other platforms, so that one FMU serves several.

use std::{path::PathBuf, str::FromStr};

use super::{
    Component, PackError,
    platform::Platform,
    symbols::{exports, mentions},
};

/// A library for the platform of a folder under `binaries/`; parse it from `win64=PATH`.
#[derive(Debug, Clone)]
pub struct Binary {
    platform: Platform,
    path: PathBuf,
}

impl FromStr for Binary {
    type Err = String;

    fn from_str(argument: &str) -> Result<Self, String> {
        let (folder, path) = argument
            .split_once('=')
            .ok_or("expected PLATFORM=PATH, for instance win64=lovines_fmu.dll")?;
        let platform = Platform::of_folder(folder).ok_or_else(|| {
            let known = Platform::folders();
            format!("`{folder}` is not a platform; known are {known}")
        })?;
        Ok(Self { platform, path: path.into() })
    }
}

/// A library that has its place.
pub(super) struct Fitted {
    /// Index of the component that it belongs to.
    pub component: usize,
    pub platform: Platform,
    pub content: Vec<u8>,
}

/// Finds the places of the others.
pub(super) fn add(fitted: &mut Vec<Fitted>, others: &[Binary], components: &[Component]) -> Result<(), PackError> {
    for other in others {
        let new = fit(other, components)?;
        let place = |one: &Fitted| (one.component, one.platform.folder);
        if fitted.iter().any(|one| place(one) == place(&new)) {
            let identifier = components[new.component].identifier;
            let folder = other.platform.folder;
            return Err(other.refused(format!("would be the second {folder} library of {identifier}")));
        }
        fitted.push(new);
    }
    Ok(())
}

/// The GUID in a library determines its component.
fn fit(binary: &Binary, components: &[Component]) -> Result<Fitted, PackError> {
    let content =
        std::fs::read(&binary.path).map_err(|source| PackError::Read { path: binary.path.clone(), source })?;
    let platform = binary.platform;
    if let Err(found) = platform.check(&content) {
        return Err(binary.refused(format!("is {found}, but {} needs {}", platform.folder, platform.name)));
    }
    if !exports(&content, "fmi2Instantiate") {
        return Err(binary.refused("has no function fmi2Instantiate, so it is not an FMI 2.0 component"));
    }
    let belongs = |component: &Component| {
        let guid = component.guid();
        guid.is_some_and(|guid| mentions(&content, guid))
    };
    let Some(component) = components.iter().position(belongs) else {
        let names: Vec<_> = components.iter().map(|one| one.identifier).collect();
        return Err(binary.refused(format!(
            "belongs to none of {}: it contains the GUID of none of them, because it was built from other variables; build it again",
            names.join(", ")
        )));
    };
    Ok(Fitted { component, platform, content })
}

impl Binary {
    /// Whether it is meant for the folder of that platform.
    pub(super) fn is_for(&self, platform: &Platform) -> bool {
        self.platform.folder == platform.folder
    }

    fn refused(&self, problem: impl Into<String>) -> PackError {
        PackError::Binary { path: self.path.clone(), problem: problem.into() }
    }
}
