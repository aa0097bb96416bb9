//! Platforms: what FMI 2.0 calls them, and what a library's header says.

use std::env::consts::{ARCH, OS};

use object::{Architecture, BinaryFormat, FileKind, NameOrOrdinal, Object};

/// A platform that a library may be made for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Platform {
    /// Folder under `binaries/`.
    pub folder: &'static str,
    /// In words, with an article.
    pub name: &'static str,
    format: BinaryFormat,
    architecture: Architecture,
}

use Architecture::{Aarch64, I386, X86_64};
use BinaryFormat::{Elf, MachO, Pe};

/// FMI 2.0 names no folder for 64-bit ARM: Linux and Windows use the names of FMI 3.0, and masters on Apple silicon look
/// into `darwin64`.
const KNOWN: [Platform; 8] = [
    known(
        "linux64",
        "a 64-bit Linux library (ELF, x86-64)",
        Elf,
        X86_64,
    ),
    known("linux32", "a 32-bit Linux library (ELF, x86)", Elf, I386),
    known(
        "aarch64-linux",
        "a 64-bit Linux library (ELF, ARM)",
        Elf,
        Aarch64,
    ),
    known("win64", "a 64-bit Windows library (PE, x86-64)", Pe, X86_64),
    known("win32", "a 32-bit Windows library (PE, x86)", Pe, I386),
    known(
        "aarch64-windows",
        "a 64-bit Windows library (PE, ARM)",
        Pe,
        Aarch64,
    ),
    known(
        "darwin64",
        "a macOS library (Mach-O, x86-64)",
        MachO,
        X86_64,
    ),
    known("darwin64", "a macOS library (Mach-O, ARM)", MachO, Aarch64),
];

const fn known(
    folder: &'static str,
    name: &'static str,
    format: BinaryFormat,
    architecture: Architecture,
) -> Platform {
    Platform {
        folder,
        name,
        format,
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

    /// Checks the header of a library against this platform; the error says what the file is instead.
    pub(super) fn check(&self, file: &[u8]) -> Result<(), String> {
        if FileKind::parse(file).is_err() {
            return Err("no shared library (unknown header)".into());
        }
        let parsed = match object::File::parse(file) {
            Ok(parsed) => parsed,
            Err(error) => return Err(format!("a damaged library ({error})")),
        };
        let (format, architecture) = (parsed.format(), parsed.architecture());
        if (format, architecture) == (self.format, self.architecture) {
            return Ok(());
        }
        Err(find(format, architecture).map_or_else(
            || format!("a library for another platform ({format:?}, {architecture:?})"),
            |platform| platform.name.into(),
        ))
    }
}

fn find(format: BinaryFormat, architecture: Architecture) -> Option<Platform> {
    KNOWN
        .into_iter()
        .find(|one| (one.format, one.architecture) == (format, architecture))
}

/// Whether the library exports `function`; Mach-O puts an underscore before it.
pub(super) fn exports(file: &[u8], function: &str) -> bool {
    let Ok(parsed) = object::File::parse(file) else {
        return false;
    };
    let Ok(mut exports) = parsed.exports() else {
        return false;
    };
    exports.any(|export| match export.as_ref().map(object::Export::name) {
        Ok(NameOrOrdinal::Name(name)) => {
            name.strip_prefix(b"_").unwrap_or(name) == function.as_bytes()
        }
        _ => false,
    })
}
