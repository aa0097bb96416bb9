//! Libraries for older Linux: built against an old C library with `cargo zigbuild`.

use std::{
    env::consts::{ARCH, OS},
    io::{IsTerminal, stderr},
    path::{Path, PathBuf},
    process::{Command, Stdio},
};

use serde::Deserialize;

use super::{Component, PackError, library, platform::Platform, symbols::glibc};

/// The newest version of the GNU C library that a portable library may ask for: every glibc Linux since 2014 has it.
pub const GLIBC: (u32, u32) = (2, 17);

/// Builds the libraries of the components for older Linux, from the sources in the working folder, and returns the
/// folder that they are in.
///
/// # Errors
/// Another system than Linux, no sources in the working folder, no `cargo zigbuild`, a build that fails, or a library that
/// asks for a newer C library all the same.
pub fn portable(components: &[Component]) -> Result<PathBuf, PackError> {
    if OS != "linux" {
        return Err(failed(format!("it makes libraries for older Linux, and this is {OS}")));
    }
    let target = target_folder(components)?;
    if !succeeds(cargo().args(["zigbuild", "--help"])) {
        return Err(failed(
            "`cargo zigbuild` was not found; `pip install cargo-zigbuild ziglang` brings it, and \
             `scripts/pack --portable` does that by itself",
        ));
    }
    let (major, minor) = GLIBC;
    let triple = format!("{ARCH}-unknown-linux-gnu");
    let mut build = cargo();
    build.args(["zigbuild", "--release", "--locked", "--target"]);
    build.arg(format!("{triple}.{major}.{minor}"));
    for component in components {
        build.args(["--package", component.package]);
        if let Some(feature) = component.feature {
            build.args(["--features", feature]);
        }
    }
    if !stderr().is_terminal() {
        build.arg("--quiet");
    }
    match build.stdout(Stdio::null()).status() {
        Ok(status) if status.success() => {}
        _ => return Err(failed("`cargo zigbuild` failed; its own words stand above")),
    }
    let folder = target.join(triple).join("release");
    for component in components {
        check(component, &folder)?;
    }
    Ok(folder)
}

fn check(component: &Component, folder: &Path) -> Result<(), PackError> {
    let bytes = library::read(component, folder, &Platform::running())?;
    match glibc(&bytes) {
        Some(needed) if needed > GLIBC => Err(failed(format!(
            "the library of {} asks for glibc {}.{}, newer than {}.{}",
            component.identifier, needed.0, needed.1, GLIBC.0, GLIBC.1
        ))),
        _ => Ok(()),
    }
}

/// What `cargo metadata` tells.
#[derive(Deserialize)]
struct Workspace {
    packages: Vec<Package>,
    target_directory: PathBuf,
}

#[derive(Deserialize)]
struct Package {
    name: String,
}

/// Cargo's target folder for the sources of the components.
fn target_folder(components: &[Component]) -> Result<PathBuf, PackError> {
    let output = cargo()
        .args(["metadata", "--no-deps", "--format-version", "1"])
        .output()
        .map_err(|error| failed(format!("cargo cannot be run: {error}")))?;
    let workspace: Option<Workspace> = serde_json::from_slice(&output.stdout).ok();
    let complete = |workspace: &Workspace| {
        let packages = &workspace.packages;
        components
            .iter()
            .all(|component| packages.iter().any(|one| one.name == component.package))
    };
    workspace
        .filter(complete)
        .map(|workspace| workspace.target_directory)
        .ok_or_else(|| failed("it builds from the sources: run it in their folder"))
}

/// The cargo that runs this program, or the one on the path.
fn cargo() -> Command {
    Command::new(std::env::var_os("CARGO").unwrap_or("cargo".into()))
}

fn succeeds(command: &mut Command) -> bool {
    command
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .status()
        .is_ok_and(|status| status.success())
}

fn failed(message: impl Into<String>) -> PackError {
    PackError::Portable(message.into())
}
