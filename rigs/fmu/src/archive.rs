//! The archive of an FMU: its description, and its files in a folder of their own.

use std::collections::BTreeSet;
use std::env::consts::{ARCH, DLL_SUFFIX, OS};
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

use fmi2_description::Description;
use zip::ZipArchive;

use crate::process::TemporaryFolder;

const DESCRIPTION: &str = "modelDescription.xml";

/// Folders below `binaries/`, with their system, processor and suffix of a library. FMI 2.0 names none for ARM except `darwin64`; the names
/// for ARM are from FMI 3.0.
pub const PLATFORMS: [(&str, &str, &str, &str); 8] = [
    ("linux64", "linux", "x86_64", ".so"),
    ("linux32", "linux", "x86", ".so"),
    ("aarch64-linux", "linux", "aarch64", ".so"),
    ("win64", "windows", "x86_64", ".dll"),
    ("win32", "windows", "x86", ".dll"),
    ("aarch64-windows", "windows", "aarch64", ".dll"),
    ("darwin64", "macos", "x86_64", ".dylib"),
    ("aarch64-darwin", "macos", "aarch64", ".dylib"),
];

/// The platforms of this machine. On Apple silicon, masters look into either folder.
pub fn own_platforms() -> impl Iterator<Item = (&'static str, &'static str)> {
    let own = |os, arch| os == OS && (arch == ARCH || (OS, ARCH) == ("macos", "aarch64"));
    let platforms = PLATFORMS.into_iter().filter(move |(_, os, arch, _)| own(*os, *arch));
    platforms.map(|(folder, .., suffix)| (folder, suffix))
}

/// An FMU in a folder that is removed with it.
pub(crate) struct Unpacked {
    pub description: Description,
    folder: TemporaryFolder,
}

impl Unpacked {
    /// Unpacks the FMU at `path`.
    ///
    /// # Errors
    /// The reason, as the end of a sentence.
    pub fn new(path: &Path) -> Result<Self, String> {
        let file = File::open(path).map_err(|error| error.to_string())?;
        let damaged = |error: &dyn std::error::Error| format!("it is not a zip archive, or a damaged one: {error}");
        let mut archive = ZipArchive::new(io::BufReader::new(file)).map_err(|error| damaged(&error))?;
        let folder = tempfile::Builder::new()
            .prefix("vines-fmu")
            .tempdir()
            .map_err(|error| {
                let place = std::env::temp_dir();
                format!("it cannot be unpacked to {}: {error}", place.display())
            })?;
        let folder = TemporaryFolder::new(folder);
        let mut nested = None;
        for n in 0..archive.len() {
            let mut entry = archive.by_index(n).map_err(|error| damaged(&error))?;
            let name = entry.name().map_err(|error| damaged(&error))?.replace('\\', "/");
            if name.ends_with(&format!("/{DESCRIPTION}")) && !name.starts_with("./") {
                nested = Some(name.clone());
            }
            let parts: Vec<&str> = name.split('/').filter(|part| !["", "."].contains(part)).collect();
            if parts.is_empty() || parts.iter().any(|part| *part == ".." || part.contains(':')) {
                continue;
            }
            let to = folder.path().join(parts.iter().collect::<PathBuf>());
            let unpacked = if entry.is_dir() || name.ends_with('/') {
                fs::create_dir_all(&to)
            } else {
                let parent = to.parent().unwrap_or(folder.path());
                fs::create_dir_all(parent).and_then(|()| io::copy(&mut entry, &mut File::create(&to)?).map(drop))
            };
            unpacked.map_err(|error| format!("{name} cannot be unpacked: {error}"))?;
        }
        let text = fs::read(folder.path().join(DESCRIPTION)).map_err(|_| match nested {
            Some(nested) => {
                format!("its {DESCRIPTION} is {nested}; zip the content of that folder, not the folder itself")
            }
            None => format!("its archive has no {DESCRIPTION}"),
        })?;
        let description = Description::read(&text).map_err(|error| {
            // FMI 1.0 and 3.0 have other descriptions.
            let version = version(&text).map(|version| format!("; it says FMI {version}, and FMI 2.0 is needed"));
            format!("{DESCRIPTION}: {error}{}", version.unwrap_or_default())
        })?;
        if description.fmi_version != "2.0" {
            let version = &description.fmi_version;
            return Err(format!("it has FMI version {version}; version 2.0 is needed"));
        }
        Ok(Self { description, folder })
    }

    /// The folder of the resources.
    pub fn resources(&self) -> PathBuf {
        self.folder.path().join("resources")
    }

    /// The folder with everything.
    pub fn folder(&self) -> &Path {
        self.folder.path()
    }

    /// The library for this machine.
    ///
    /// # Errors
    /// What the FMU has instead, as the end of a sentence.
    pub fn library(&self, identifier: &str) -> Result<PathBuf, String> {
        let binaries = self.folder.path().join("binaries");
        let mut folders: Vec<&str> = own_platforms().map(|(folder, _)| folder).collect();
        // FMI 2.0 has no name for ARM: exporters use that of the other processor.
        folders.extend(
            (OS == "linux")
                .then_some("linux64")
                .filter(|folder| !folders.contains(folder)),
        );
        let library = format!("{identifier}{DLL_SUFFIX}");
        let paths = folders.iter().map(|folder| binaries.join(folder).join(&library));
        if let Some(path) = paths.into_iter().find(|path| path.is_file()) {
            return Ok(path);
        }
        let needed = format!(
            "this machine needs binaries/{}/{library}",
            folders.first().unwrap_or(&OS)
        );
        let present = names(&binaries);
        if let Some(folder) = folders.iter().find(|folder| present.contains(**folder)) {
            let files = names(&binaries.join(folder)).into_iter().collect::<Vec<_>>().join(", ");
            return Err(format!("{needed}, and that folder has {files}"));
        }
        Err(match present.is_empty() {
            true if self.folder.path().join("sources").is_dir() => {
                format!("it has source code only, and {needed}: compile it, or export it with a library")
            }
            true => format!("it has no libraries, and {needed}"),
            false => {
                let platforms = present.into_iter().collect::<Vec<_>>().join(", ");
                format!("it has libraries for {platforms} only, and {needed}")
            }
        })
    }
}

/// The names in a folder.
fn names(folder: &Path) -> BTreeSet<String> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    entries
        .map(|entry| entry.file_name().to_string_lossy().into_owned())
        .collect()
}

/// The version of FMI that a text declares, if that is not 2.0.
fn version(text: &[u8]) -> Option<String> {
    let text = String::from_utf8_lossy(text);
    let version = text.split_once("fmiVersion=")?.1.get(1..)?.split(['"', '\'']).next()?;
    (version != "2.0" && version.len() < 20).then(|| version.to_owned())
}
