//! Files that are complete or absent.

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use tempfile::NamedTempFile;

/// Why a file could not be written.
#[derive(Debug, thiserror::Error)]
#[error("cannot write {}: {source}", path.display())]
#[expect(missing_docs, reason = "the message explains the fields")]
pub struct FileError {
    pub path: PathBuf,
    pub source: io::Error,
}

/// Writes (name, content) into a folder, which is created if it does not exist, and returns the paths. All files are written under
/// temporary names before any of them gets its own.
pub(crate) fn write<N: AsRef<Path>, C: AsRef<[u8]>>(
    out: &Path,
    files: impl IntoIterator<Item = (N, C)>,
) -> Result<Vec<PathBuf>, FileError> {
    let failed = |path: &Path, source| FileError { path: path.into(), source };
    std::fs::create_dir_all(out).map_err(|source| failed(out, source))?;
    let mut finished = Vec::new();
    for (name, content) in files {
        let path = out.join(name);
        let mut file = temporary(out).map_err(|source| failed(&path, source))?;
        file.write_all(content.as_ref())
            .map_err(|source| failed(&path, source))?;
        finished.push((file, path));
    }
    let keep = |(file, path): (NamedTempFile, PathBuf)| match file.persist(&path) {
        Ok(_) => Ok(path),
        Err(error) => Err(failed(&path, error.error)),
    };
    finished.into_iter().map(keep).collect()
}

/// Writes one file, complete or not at all.
///
/// # Errors
/// A file that cannot be written.
pub fn write_file(path: &Path, content: &str) -> Result<PathBuf, FileError> {
    let folder = path
        .parent()
        .filter(|folder| !folder.as_os_str().is_empty())
        .unwrap_or(Path::new("."));
    let name = path.file_name().unwrap_or_default();
    Ok(write(folder, [(name, content)])?.remove(0))
}

/// A temporary file that others may read once it is kept, as with any file made here.
fn temporary(folder: &Path) -> io::Result<NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".vines-");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(std::fs::Permissions::from_mode(0o666));
    }
    builder.tempfile_in(folder)
}
