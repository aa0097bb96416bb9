//! Where the libraries are, and what belongs to them.

use std::env::consts::{DLL_PREFIX, DLL_SUFFIX};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::LazyLock;

use libloading::Library;

use crate::functions::Functions;

/// The plant's description.
pub const PLANT: &str = include_str!("../../../modelDescription.xml");
/// The controller's description.
pub const CONTROLLER: &str = include_str!("../../../controller/fmu/modelDescription.xml");

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

    /// Where cargo puts the library of that name.
    ///
    /// # Panics
    /// If it cannot be built.
    #[must_use]
    pub fn path(name: &str) -> PathBuf {
        let folder = build();
        let library = match name {
            "LoViNes" => "lovines",
            _ => "phase_lock_fmu",
        };
        folder.join(format!("{DLL_PREFIX}{library}{DLL_SUFFIX}"))
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

/// The folder of this profile, for instance `target/debug`: two above a test in `deps`, one above a program.
fn folder() -> PathBuf {
    let program = std::env::current_exe().expect("a program knows where it is");
    let inside = |path: &Path| path.ends_with("deps") || path.ends_with("examples");
    let folder = program.parent().expect("it is in a folder");
    let above = folder.parent().filter(|_| inside(folder));
    above.unwrap_or(folder).to_owned()
}

/// Cargo builds no shared library for the sake of a test of another package: so it is asked to. It builds in a folder of its own,
/// `target/libraries`: with the features of these two packages alone it would replace the plant that other tests are linked
/// with.
fn build() -> PathBuf {
    static FOLDER: LazyLock<PathBuf> = LazyLock::new(|| {
        let profile = folder();
        let target = profile.parent().expect("a profile is in a folder");
        let libraries = target.join("libraries");
        let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
        let mut command = Command::new(cargo);
        command.args(["build", "--quiet", "-p", "lovines", "-p", "phase-lock-fmu"]);
        command.args(["--features", "lovines/fmu"]);
        command.arg("--manifest-path");
        command.arg(concat!(env!("CARGO_MANIFEST_DIR"), "/../../Cargo.toml"));
        command.arg("--target-dir").arg(&libraries);
        let name = if profile.ends_with("release") {
            command.arg("--release");
            "release"
        } else {
            "debug"
        };
        let status = command.status().expect("cargo runs");
        assert!(status.success(), "the libraries could not be built");
        libraries.join(name)
    });
    FOLDER.clone()
}
