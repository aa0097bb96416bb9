//! Zip archives that come out the same, byte for byte, whenever the same goes in.

use std::io::{self, Cursor, Write};

use zip::{CompressionMethod, ZipWriter, write::SimpleFileOptions};

use super::PackError;
use crate::files::FileError;

/// Name and content of a file to be.
pub(super) type File = (String, Vec<u8>);

/// The archive of `entries`, (name inside, content), as a file.
pub(super) fn file(name: String, entries: &[(&str, &[u8])]) -> Result<File, PackError> {
    match zip(entries) {
        Ok(content) => Ok((name, content)),
        Err(source) => Err(FileError { path: name.into(), source }.into()),
    }
}

fn zip(entries: &[(&str, &[u8])]) -> io::Result<Vec<u8>> {
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    for (name, content) in entries {
        // Without a time of day, and with nothing compressed twice.
        let method = if name.ends_with(".fmu") {
            CompressionMethod::Stored
        } else {
            CompressionMethod::Deflated
        };
        let options = SimpleFileOptions::DEFAULT
            .compression_method(method)
            .unix_permissions(0o644);
        zip.start_file(*name, options)?;
        zip.write_all(content)?;
    }
    Ok(zip.finish()?.into_inner())
}

#[cfg(test)]
#[path = "../../tests/unit/pack_archive.rs"]
mod tests;
