//! Platforms: what FMI 2.0 calls them, and what a library's header says.

use std::env::consts::{ARCH, OS};

use object::{Architecture, BinaryFormat, FileKind, Object};

use super::symbols::image;

/// A platform that a library may be made for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Platform {
    /// Folder under `binaries/`.
    pub folder: &'static str,
    /// In words, with an article.
    pub name: &'static str,
    /// How names of shared libraries end.
    pub suffix: &'static str,
    format: BinaryFormat,
    architecture: Architecture,
}

use Architecture::{Aarch64, I386, X86_64};
use BinaryFormat::{Elf, MachO, Pe};

/// FMI 2.0 names no folder for 64-bit ARM: Linux and Windows use the names of FMI 3.0, and masters on Apple silicon look
/// into `darwin64`.
const KNOWN: [Platform; 8] = [
    linux("linux64", "a 64-bit Linux library (ELF, x86-64)", X86_64),
    linux("linux32", "a 32-bit Linux library (ELF, x86)", I386),
    linux(
        "aarch64-linux",
        "a 64-bit Linux library (ELF, ARM)",
        Aarch64,
    ),
    windows("win64", "a 64-bit Windows library (PE, x86-64)", X86_64),
    windows("win32", "a 32-bit Windows library (PE, x86)", I386),
    windows(
        "aarch64-windows",
        "a 64-bit Windows library (PE, ARM)",
        Aarch64,
    ),
    macos("a macOS library (Mach-O, x86-64)", X86_64),
    macos("a macOS library (Mach-O, ARM)", Aarch64),
];

const fn linux(folder: &'static str, name: &'static str, architecture: Architecture) -> Platform {
    Platform {
        folder,
        name,
        suffix: ".so",
        format: Elf,
        architecture,
    }
}

const fn windows(folder: &'static str, name: &'static str, architecture: Architecture) -> Platform {
    Platform {
        folder,
        name,
        suffix: ".dll",
        format: Pe,
        architecture,
    }
}

const fn macos(name: &'static str, architecture: Architecture) -> Platform {
    Platform {
        folder: "darwin64",
        name,
        suffix: ".dylib",
        format: MachO,
        architecture,
    }
}

impl Platform {
    /// The platform that this program runs on; 64-bit Linux where it is none of those known.
    #[must_use]
    pub fn running() -> Self {
        let format = match OS {
            "windows" => Pe,
            "macos" => MachO,
            _ => Elf,
        };
        let architecture = match ARCH {
            "aarch64" => Aarch64,
            "x86" => I386,
            _ => X86_64,
        };
        find(format, architecture).unwrap_or(KNOWN[0])
    }

    /// The names of the folders, for messages.
    pub(super) fn folders() -> String {
        let mut names = KNOWN.map(|platform| platform.folder).to_vec();
        names.dedup();
        names.join(", ")
    }

    /// A platform with this folder: two share `darwin64`.
    pub(super) fn of_folder(folder: &str) -> Option<Self> {
        KNOWN.into_iter().find(|platform| platform.folder == folder)
    }

    /// The platform that a library is made for; the error says what the file is instead.
    pub(super) fn recognise(file: &[u8]) -> Result<Self, String> {
        if FileKind::parse(file).is_err() {
            return Err("no shared library (unknown header)".into());
        }
        let parsed = match object::File::parse(image(file)) {
            Ok(parsed) => parsed,
            Err(error) => return Err(format!("a damaged library ({error})")),
        };
        let (format, architecture) = (parsed.format(), parsed.architecture());
        find(format, architecture)
            .ok_or_else(|| format!("a library for another platform ({format:?}, {architecture:?})"))
    }

    /// Checks the header of a library against this platform; the error says what the file is instead.
    pub(super) fn check(&self, file: &[u8]) -> Result<(), String> {
        match Self::recognise(file)? {
            // A universal library for macOS serves both architectures from one folder.
            found if found.folder == self.folder => Ok(()),
            found => Err(found.name.into()),
        }
    }
}

fn find(format: BinaryFormat, architecture: Architecture) -> Option<Platform> {
    KNOWN
        .into_iter()
        .find(|one| (one.format, one.architecture) == (format, architecture))
}
