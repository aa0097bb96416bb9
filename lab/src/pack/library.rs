//! Libraries: found, checked, and given to the components that they belong to.

use std::env::consts::{DLL_PREFIX, DLL_SUFFIX};
use std::path::{Path, PathBuf};
use std::{io::ErrorKind, str::FromStr};

use vines_model::ArgumentError;

use super::symbols::{exports, mentions};
use super::{Component, PackError, platform::Platform};

/// A library for the platform of a folder under `binaries/`; parse it from `win64=PATH`.
#[derive(Debug, Clone)]
pub struct Binary {
    platform: Platform,
    path: PathBuf,
}

impl FromStr for Binary {
    type Err = ArgumentError;

    fn from_str(argument: &str) -> Result<Self, ArgumentError> {
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

/// Where the libraries come from.
#[derive(Debug, Clone)]
pub struct Libraries {
    /// Folder with those for this platform, under the names that cargo gives them.
    pub folder: PathBuf,
    /// Whether those for this platform are packed at all.
    pub own: bool,
    /// Those for other platforms.
    pub others: Vec<Binary>,
}

impl From<&Path> for Libraries {
    fn from(folder: &Path) -> Self {
        Self { folder: folder.into(), own: true, others: Vec::new() }
    }
}

/// A library that has its place.
pub(super) struct Fitted {
    /// Index of the component that it belongs to.
    pub component: usize,
    pub platform: Platform,
    pub content: Vec<u8>,
}

/// The libraries of the components, each with its place.
pub(super) fn fitted(components: &[Component], libraries: &Libraries) -> Result<Vec<Fitted>, PackError> {
    let mut fitted: Vec<Fitted> = Vec::new();
    if libraries.own {
        let platform = Platform::running();
        // Where masters look into two folders for them, they go into both, unless another library is given for the second.
        let given = |folder| libraries.others.iter().any(|other| other.platform.folder == folder);
        let second = platform.also().filter(|also| !given(also.folder));
        for (component, one) in components.iter().enumerate() {
            let content = own(one, &libraries.folder, &platform)?;
            fitted.extend(second.map(|platform| Fitted { component, platform, content: content.clone() }));
            fitted.push(Fitted { component, platform, content });
        }
    }
    for other in &libraries.others {
        let new = fit(other, components)?;
        let place = |one: &Fitted| (one.component, one.platform.folder);
        if fitted.iter().any(|one| place(one) == place(&new)) {
            let identifier = components[new.component].identifier;
            let problem = format!("would be the second {} library of {identifier}", new.platform.folder);
            return Err(PackError::Library { path: other.path.clone(), problem });
        }
        fitted.push(new);
    }
    Ok(fitted)
}

/// The component's library for this platform, from `folder`.
fn own(component: &Component, folder: &Path, platform: &Platform) -> Result<Vec<u8>, PackError> {
    let identifier = component.identifier;
    let build = format!("`cargo build --release -p {}`", component.package);
    let path = folder.join(format!("{DLL_PREFIX}{}{DLL_SUFFIX}", component.library));
    let content = match read(
        &path,
        platform,
        "this platform",
        &format!("; build it here with {build}"),
    ) {
        Err(PackError::Read { source, .. }) if source.kind() == ErrorKind::NotFound => {
            return Err(PackError::Missing { identifier, path, build });
        }
        read => read?,
    };
    if component.guid().is_some_and(|guid| !mentions(&content, guid)) {
        let problem = format!("was built from other variables than {identifier} has now: build it anew with {build}");
        return Err(PackError::Library { path, problem });
    }
    Ok(content)
}

/// The GUID in a library determines its component.
fn fit(Binary { platform, path }: &Binary, components: &[Component]) -> Result<Fitted, PackError> {
    let content = read(path, platform, platform.folder, "")?;
    let belongs = |component: &Component| component.guid().is_some_and(|guid| mentions(&content, guid));
    let Some(component) = components.iter().position(belongs) else {
        let names: Vec<_> = components.iter().map(|one| one.identifier).collect();
        let problem = format!(
            "belongs to none of {}: it contains the GUID of none of them, because it was built from other variables; build it again",
            names.join(", ")
        );
        return Err(PackError::Library { path: path.clone(), problem });
    };
    Ok(Fitted { component, platform: *platform, content })
}

/// Reads an FMI 2.0 component for `platform`; `place` and `advice` are for the message.
fn read(path: &Path, platform: &Platform, place: &str, advice: &str) -> Result<Vec<u8>, PackError> {
    let content = std::fs::read(path).map_err(|source| PackError::Read { path: path.into(), source })?;
    let problem = match platform.mismatch(&content) {
        Some(found) => format!("is {found}, but {place} needs {}{advice}", platform.name),
        None if !exports(&content, "fmi2Instantiate") => {
            format!("has no function fmi2Instantiate, so it is not an FMI 2.0 component{advice}")
        }
        None => return Ok(content),
    };
    Err(PackError::Library { path: path.into(), problem })
}
