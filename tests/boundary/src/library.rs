//! Where the libraries are, and what belongs to them.

use std::env::consts::{DLL_PREFIX, DLL_SUFFIX};
use std::path::{Path, PathBuf};

use libloading::Library;

use crate::functions::Functions;

/// The plant's description.
pub const PLANT: &str = include_str!("../../../modelDescription.xml");
/// The controller's description.
pub const CONTROLLER: &str = include_str!("../../../controller/fmu/modelDescription.xml");
const TANK: &str = include_str!("../../../fmi2-component/example/modelDescription.xml");

/// A loaded library. It is never unloaded, so that its functions can be copied about.
#[derive(Clone, Copy, Debug)]
pub struct Fmu {
    /// `modelIdentifier`.
    pub name: &'static str,
    /// The library's functions.
    pub functions: Functions,
    /// What the description says.
    pub description: &'static str,
}

impl Fmu {
    /// `LoViNes`, built as this program is.
    ///
    /// # Panics
    /// If it cannot be built or loaded.
    #[must_use]
    pub fn plant() -> Self {
        Self::load("LoViNes", PLANT, &Self::path("LoViNes"))
    }

    /// `PhaseLock`, built as this program is.
    ///
    /// # Panics
    /// If it cannot be built or loaded.
    #[must_use]
    pub fn controller() -> Self {
        Self::load("PhaseLock", CONTROLLER, &Self::path("PhaseLock"))
    }

    /// `Tank`, the example of the shell, built as this program is.
    ///
    /// # Panics
    /// If it cannot be built or loaded.
    #[must_use]
    pub fn tank() -> Self {
        Self::load("Tank", TANK, &Self::path("Tank"))
    }

    /// Where cargo puts the library of that name.
    #[must_use]
    pub fn path(name: &str) -> PathBuf {
        let library = match name {
            "LoViNes" => "lovines_fmu",
            "Tank" => "fmi2_example_tank",
            _ => "phase_lock_fmu",
        };
        folder().join(format!("{DLL_PREFIX}{library}{DLL_SUFFIX}"))
    }

    /// Both libraries as an FMU holds them, `LoViNes` and `PhaseLock` with the platform's suffix, from one folder.
    ///
    /// # Panics
    /// If they cannot be loaded.
    #[must_use]
    pub fn packed(folder: &Path) -> [Self; 2] {
        let load = |name, description| {
            // An absolute path: a loader looks for a bare name elsewhere.
            let path = std::path::absolute(folder.join(format!("{name}{DLL_SUFFIX}")));
            Self::load(name, description, &path.expect("a folder has a path"))
        };
        [load("LoViNes", PLANT), load("PhaseLock", CONTROLLER)]
    }

    fn load(name: &'static str, description: &'static str, path: &Path) -> Self {
        // SAFETY: it is ours, and loading it runs no code of its own.
        let library = unsafe { Library::new(path) };
        let library = library.unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        // SAFETY: an FMI 2.0 library, which stays loaded since nobody drops it.
        let functions = unsafe { Functions::load(&library) };
        std::mem::forget(library);
        Self {
            name,
            functions: functions.unwrap_or_else(|error| panic!("{}: {error}", path.display())),
            description,
        }
    }

    /// The GUID that the library was built with.
    ///
    /// # Panics
    /// If the description is refused, which its own build would have been, too.
    #[must_use]
    pub fn guid(&self) -> String {
        fmi2_component_build::guid_of(self.description).expect("the library was built from it")
    }
}

/// The folder of the shared libraries of this profile's dependencies, for instance `target/debug/deps`. Cargo builds the two libraries
/// there because this package depends on them.
fn folder() -> PathBuf {
    let program = std::env::current_exe().expect("a program knows where it is");
    let folder = program.parent().expect("it is in a folder");
    if folder.ends_with("deps") {
        return folder.to_owned();
    }
    let profile = if folder.ends_with("examples") {
        folder.parent()
    } else {
        None
    };
    profile.unwrap_or(folder).join("deps")
}
