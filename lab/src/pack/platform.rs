//! Platforms: what FMI 2.0 calls them, and what a library's header says.

use std::env::consts::{ARCH, OS};

use object::{Architecture, BinaryFormat, FileKind, Object};

use super::symbols::images;

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

/// FMI 2.0 names no folder for 64-bit ARM: its libraries go where FMI 3.0 has them. On Apple silicon some masters look there,
/// others into `darwin64`.
const KNOWN: [Platform; 9] = [
    platform("linux64", "a 64-bit Linux library (ELF, x86-64)", Elf, X86_64),
    platform("linux32", "a 32-bit Linux library (ELF, x86)", Elf, I386),
    platform("aarch64-linux", "a 64-bit Linux library (ELF, ARM)", Elf, Aarch64),
    platform("win64", "a 64-bit Windows library (PE, x86-64)", Pe, X86_64),
    platform("win32", "a 32-bit Windows library (PE, x86)", Pe, I386),
    platform("aarch64-windows", "a 64-bit Windows library (PE, ARM)", Pe, Aarch64),
    platform(DARWIN, "a macOS library (Mach-O, x86-64)", MachO, X86_64),
    platform("aarch64-darwin", "a macOS library (Mach-O, ARM)", MachO, Aarch64),
    platform(DARWIN, "a macOS library (Mach-O, ARM)", MachO, Aarch64),
];

/// The folder of FMI 2.0 for macOS, whatever the processor.
const DARWIN: &str = "darwin64";

const fn platform(
    folder: &'static str,
    name: &'static str,
    format: BinaryFormat,
    architecture: Architecture,
) -> Platform {
    let suffix = match format {
        Pe => ".dll",
        MachO => ".dylib",
        _ => ".so",
    };
    Platform { folder, name, suffix, format, architecture }
}

impl Platform {
    /// The platform that this program runs on; 64-bit Linux where it is none of those known.
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

    /// Another folder in which masters look for the library of this platform, if there is one.
    pub(super) fn also(self) -> Option<Self> {
        KNOWN.into_iter().find(|other| {
            other.folder != self.folder && (other.format, other.architecture) == (self.format, self.architecture)
        })
    }

    /// The names of the folders, for messages.
    pub(super) fn folders() -> String {
        let mut names = Vec::new();
        for platform in KNOWN {
            if !names.contains(&platform.folder) {
                names.push(platform.folder);
            }
        }
        names.join(", ")
    }

    /// A platform with this folder: two share `darwin64`.
    pub(super) fn of_folder(folder: &str) -> Option<Self> {
        KNOWN.into_iter().find(|platform| platform.folder == folder)
    }

    /// What a file is instead of a library for this platform, by its header; None for such a library.
    pub(super) fn mismatch(self, file: &[u8]) -> Option<String> {
        if FileKind::parse(file).is_err() {
            return Some("not a shared library (unknown header)".into());
        }
        // A universal library for macOS holds several.
        let mut found = Vec::new();
        for image in images(file) {
            match object::File::parse(image) {
                Ok(parsed) => found.push((parsed.format(), parsed.architecture())),
                Err(error) => return Some(format!("a damaged library ({error})")),
            }
        }
        let serves = |&(format, architecture): &(BinaryFormat, Architecture)| {
            let same = |one: &Self| one.format == format && one.architecture == architecture;
            KNOWN.iter().any(|one| one.folder == self.folder && same(one))
        };
        match found.first() {
            _ if found.iter().any(serves) => None,
            Some(&(format, architecture)) => Some(match find(format, architecture) {
                Some(known) => known.name.into(),
                None => format!("a library for another platform ({format:?}, {architecture:?})"),
            }),
            None => Some("an empty universal library".into()),
        }
    }
}

fn find(format: BinaryFormat, architecture: Architecture) -> Option<Platform> {
    KNOWN
        .into_iter()
        .find(|one| (one.format, one.architecture) == (format, architecture))
}

#[cfg(test)]
#[path = "../../tests/unit/pack_platform.rs"]
mod tests;
