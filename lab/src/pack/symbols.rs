//! The symbols of a library.

use object::{
    FileKind, NameOrOrdinal, Object,
    read::macho::{FatArch, MachOFatFile32, MachOFatFile64},
};

/// The library itself, or those in a universal library for macOS.
pub(super) fn images(file: &[u8]) -> Vec<&[u8]> {
    fn of<'a>(arches: &[impl FatArch], file: &'a [u8]) -> Vec<&'a [u8]> {
        let data = arches.iter().map(|arch| arch.data(file));
        data.filter_map(Result::ok).collect()
    }
    match FileKind::parse(file) {
        Ok(FileKind::MachOFat32) => {
            MachOFatFile32::parse(file).map_or_else(|_| Vec::new(), |fat| of(fat.arches(), file))
        }
        Ok(FileKind::MachOFat64) => {
            MachOFatFile64::parse(file).map_or_else(|_| Vec::new(), |fat| of(fat.arches(), file))
        }
        _ => vec![file],
    }
}

/// Whether the library exports `function`, for every processor that it serves; Mach-O puts an underscore before it.
pub(super) fn exports(file: &[u8], function: &str) -> bool {
    let images = images(file);
    !images.is_empty() && images.iter().all(|image| one_exports(image, function))
}

fn one_exports(image: &[u8], function: &str) -> bool {
    let Ok(parsed) = object::File::parse(image) else {
        return false;
    };
    let Ok(mut exports) = parsed.exports() else {
        return false;
    };
    exports.any(|export| match export.as_ref().map(object::Export::name) {
        Ok(NameOrOrdinal::Name(name)) => name.strip_prefix(b"_").unwrap_or(name) == function.as_bytes(),
        _ => false,
    })
}

/// Whether `text` stands anywhere in the library.
pub(super) fn mentions(file: &[u8], text: &str) -> bool {
    file.windows(text.len()).any(|part| part == text.as_bytes())
}
