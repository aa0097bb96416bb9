//! Writing a zip archive that is complete before it gets its name.

use std::{
    io::{self, Write},
    path::Path,
};

use tempfile::NamedTempFile;
use zip::{CompressionMethod, ZipWriter, write::SimpleFileOptions};

use super::PackError;
use crate::files::temporary;

/// Writes `entries`, (name inside, content), to a temporary file in `folder`; persist it to keep it.
///
/// The same entries give the same bytes: no time of day is stored.
pub(super) fn write(folder: &Path, entries: &[(&str, &[u8])]) -> Result<NamedTempFile, PackError> {
    fill(folder, entries).map_err(|source| PackError::Write {
        path: folder.into(),
        source,
    })
}

fn fill(folder: &Path, entries: &[(&str, &[u8])]) -> io::Result<NamedTempFile> {
    let mut file = temporary(folder)?;
    let mut zip = ZipWriter::new(file.as_file_mut());
    let options = SimpleFileOptions::DEFAULT
        .compression_method(CompressionMethod::Deflated)
        .unix_permissions(0o644);
    for (name, content) in entries {
        zip.start_file(*name, options)?;
        zip.write_all(content)?;
    }
    zip.finish()?.flush()?;
    Ok(file)
}

#[cfg(test)]
mod tests {
    use std::io::Read;

    use super::*;

    #[test]
    fn what_goes_in_comes_out_again() {
        let folder = tempfile::tempdir().unwrap();
        let entries: [(&str, &[u8]); 2] = [("a.xml", b"<a/>"), ("binaries/x/a.so", &[7; 5000])];
        let file = write(folder.path(), &entries).unwrap();
        let mut zip = zip::ZipArchive::new(file.reopen().unwrap()).unwrap();
        for (name, content) in entries {
            let mut read = Vec::new();
            zip.by_name(name).unwrap().read_to_end(&mut read).unwrap();
            assert_eq!(read, content);
        }
    }

    #[test]
    fn the_same_entries_give_the_same_bytes() {
        let folder = tempfile::tempdir().unwrap();
        let bytes = || {
            let file = write(folder.path(), &[("a", b"content")]).unwrap();
            std::fs::read(file.path()).unwrap()
        };
        assert_eq!(bytes(), bytes());
    }
}
