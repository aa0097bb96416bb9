//! The symbols of a library.

use object::read::macho::{FatArch, MachOFatFile32, MachOFatFile64};
use object::{Export, FileKind, NameOrOrdinal, Object};

/// The library itself, or those in a universal library for macOS.
pub(super) fn images(file: &[u8]) -> Vec<&[u8]> {
    fn of<'a>(arches: &[impl FatArch], file: &'a [u8]) -> Vec<&'a [u8]> {
        let data = arches.iter().map(|arch| arch.data(file));
        data.filter_map(Result::ok).collect()
    }
    let images = match FileKind::parse(file) {
        Ok(FileKind::MachOFat32) => MachOFatFile32::parse(file).map(|fat| of(fat.arches(), file)),
        Ok(FileKind::MachOFat64) => MachOFatFile64::parse(file).map(|fat| of(fat.arches(), file)),
        _ => Ok(vec![file]),
    };
    images.unwrap_or_default()
}

/// Whether the library exports `function`, for every processor that it serves; Mach-O puts an underscore before it.
pub(super) fn exports(file: &[u8], function: &str) -> bool {
    let is_function = |export: Export| match export.name() {
        NameOrOrdinal::Name(name) => name.strip_prefix(b"_").unwrap_or(name) == function.as_bytes(),
        NameOrOrdinal::Ordinal(_) => false,
    };
    let has_function = |image: &&[u8]| -> object::Result<bool> {
        let parsed = object::File::parse(*image)?;
        Ok(parsed.exports()?.any(|export| export.is_ok_and(is_function)))
    };
    let images = images(file);
    !images.is_empty() && images.iter().all(|image| has_function(image).unwrap_or(false))
}

/// Whether `text` stands anywhere in the library.
pub(super) fn mentions(file: &[u8], text: &str) -> bool {
    file.windows(text.len()).any(|part| part == text.as_bytes())
}
