//! Zip archives that come out the same, byte for byte, whenever the same goes in.

use std::io::{self, Cursor, Write};

use zip::{CompressionMethod, ZipWriter, write::SimpleFileOptions};

use super::{File, PackError};
use crate::files::FileError;

/// The archive of `entries`, (name inside, content), as a file.
pub(super) fn file(name: String, entries: &[(&str, &[u8])]) -> Result<File, PackError> {
    match zip(entries) {
        Ok(content) => Ok(File { name, content }),
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
mod tests {
    use std::io::Read;

    use super::*;

    #[test]
    fn what_goes_in_comes_out_again() {
        let entries: [(&str, &[u8]); 3] = [
            ("a.xml", b"<a/>"),
            ("binaries/x/a.so", &[7; 5000]),
            ("resources/a.fmu", &[8; 50]),
        ];
        let bytes = zip(&entries).unwrap();
        let mut archive = zip::ZipArchive::new(Cursor::new(bytes)).unwrap();
        for (name, content) in entries {
            let mut read = Vec::new();
            archive.by_name(name).unwrap().read_to_end(&mut read).unwrap();
            assert_eq!(read, content);
        }
    }

    #[test]
    fn the_same_entries_give_the_same_bytes() {
        let bytes = || zip(&[("a", b"content")]).unwrap();
        assert_eq!(bytes(), bytes());
    }
}
