//! An unpacked FMU.

use std::env::consts::{ARCH, DLL_SUFFIX, OS};
use std::fs::{self, File};
use std::path::{Path, PathBuf};

use fmi2_description::Description;
use tempfile::TempDir;
use zip::ZipArchive;

use crate::error::LoadError;

/// An FMU, unpacked into a temporary folder, which exists as long as this value.
#[derive(Debug)]
pub struct Fmu {
    folder: TempDir,
    description: Description,
}

impl Fmu {
    /// Unpacks the FMU at `path` and reads its description.
    ///
    /// # Errors
    /// A file that is not an FMU of FMI 2.0 for co-simulation.
    pub fn open(path: &Path) -> Result<Self, LoadError> {
        let mut archive = ZipArchive::new(File::open(path)?)?;
        let folder = tempfile::tempdir()?;
        archive.extract(folder.path())?;
        let xml = fs::read_to_string(folder.path().join("modelDescription.xml"))?;
        let description = Description::parse(&xml)?;
        if description.fmi_version != "2.0" {
            return Err(LoadError::Version(description.fmi_version));
        }
        Ok(Self { folder, description })
    }

    /// The description.
    #[must_use]
    pub fn description(&self) -> &Description {
        &self.description
    }

    /// Path of the library for this platform.
    pub(crate) fn library(&self) -> Result<PathBuf, LoadError> {
        let identifier = self.description.co_simulation.as_ref();
        let identifier = identifier.ok_or(LoadError::NoCoSimulation)?;
        let platform = platform(OS, ARCH).ok_or(LoadError::Platform {
            os: OS,
            architecture: ARCH,
        })?;
        let inside = Path::new("binaries")
            .join(platform)
            .join(format!("{identifier}{DLL_SUFFIX}"));
        let library = self.folder.path().join(&inside);
        if library.is_file() {
            Ok(library)
        } else {
            Err(LoadError::NoLibrary(inside))
        }
    }

    /// `fmuResourceLocation`: URI of the folder `resources`.
    pub(crate) fn resources(&self) -> String {
        uri(&self.folder.path().join("resources"))
    }
}

/// Folder of the libraries. FMI 2.0 defines none for ARM; exporters use that of the 64-bit Intel platform.
fn platform(os: &str, architecture: &str) -> Option<&'static str> {
    match (os, architecture) {
        ("linux", "x86_64" | "aarch64") => Some("linux64"),
        ("linux", "x86") => Some("linux32"),
        ("windows", "x86_64") => Some("win64"),
        ("windows", "x86") => Some("win32"),
        ("macos", "x86_64" | "aarch64") => Some("darwin64"),
        _ => None,
    }
}

/// A `file:` URI, with all bytes escaped that RFC 3986 does not allow in a path.
fn uri(path: &Path) -> String {
    let text = path.to_string_lossy().replace('\\', "/");
    let mut uri = String::from("file://");
    if !text.starts_with('/') {
        uri.push('/');
    }
    for byte in text.bytes() {
        if byte.is_ascii_alphanumeric() || b"/-._~:".contains(&byte) {
            uri.push(char::from(byte));
        } else {
            uri += &format!("%{byte:02X}");
        }
    }
    uri
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_uri_escapes_spaces_and_letters_outside_ascii() {
        assert_eq!(uri(Path::new("/tmp/a b/ü")), "file:///tmp/a%20b/%C3%BC");
    }

    #[test]
    fn a_file_that_is_not_an_archive_is_refused() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let error = Fmu::open(file.path()).unwrap_err();
        assert!(matches!(error, LoadError::Archive(_)), "{error}");
    }
}
