//! Files of results: checked before the work, complete or as they were.

use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, ErrorKind, Write};
use std::path::{Path, PathBuf};

use same_file::Handle;
use tempfile::NamedTempFile;
use vines_fmu::process::Cleanup;

/// Why a file could not be written.
#[derive(Debug, thiserror::Error)]
#[error("cannot write {}: {source}", path.display())]
pub struct FileError {
    pub path: PathBuf,
    pub source: io::Error,
}

impl FileError {
    /// For `map_err`.
    pub fn at(path: &Path) -> impl FnOnce(io::Error) -> Self {
        |source| Self { path: path.into(), source }
    }
}

/// Checks that a file can be written, and leaves it as it is.
///
/// # Errors
/// A folder in its place, a file without permission, or a folder that cannot be written to.
pub fn writable(path: &Path) -> Result<(), FileError> {
    let try_to = || -> io::Result<()> {
        match fs::metadata(path) {
            Ok(there) if there.is_dir() => return Err(ErrorKind::IsADirectory.into()),
            Ok(there) if !there.is_file() => return Ok(()),
            Ok(_) => drop(OpenOptions::new().append(true).open(path)?),
            Err(error) if error.kind() != ErrorKind::NotFound => return Err(error),
            Err(_) => {}
        }
        let existing = folder_of(path).ancestors().find(|folder| folder.exists());
        tempfile::tempfile_in(existing.unwrap_or(Path::new("."))).map(drop)
    };
    try_to().map_err(FileError::at(path))
}

/// Writes one file, complete or not at all; its folder is created if it does not exist. A device or a pipe is written to directly.
pub fn write_file(path: &Path, content: &str) -> Result<PathBuf, FileError> {
    let write = || -> io::Result<()> {
        if fs::metadata(path).is_ok_and(|there| !there.is_file()) {
            return OpenOptions::new().write(true).open(path)?.write_all(content.as_bytes());
        }
        // The file behind a symbolic link is replaced, not the link.
        let path = fs::canonicalize(path).unwrap_or(path.into());
        create_folder_of(&path)?;
        let mut file = temporary(folder_of(&path))?;
        file.write_all(content.as_bytes())?;
        file.persist(path)?;
        Ok(())
    };
    write().map_err(FileError::at(path))?;
    Ok(path.into())
}

/// Creates the folder of a file, if it does not exist.
pub fn create_folder_of(path: &Path) -> io::Result<()> {
    fs::create_dir_all(folder_of(path))
}

/// The folder of a file.
fn folder_of(path: &Path) -> &Path {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    folder.unwrap_or(Path::new("."))
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

/// The file whose lock a run holds in the folder of its results.
const LOCK: &str = ".vines.lock";
/// The folder, in that of the results, for those of an earlier run that a run without results finds.
const PREVIOUS: &str = "previous";

/// The folder of the results of one run. No other run can open it meanwhile; the system releases it however the process ends.
#[derive(Debug)]
pub struct ResultFolder {
    path: PathBuf,
    /// What the command may write.
    names: Vec<&'static str>,
    /// Removes the lock's file, and the folders that were created, if they are empty.
    _cleanup: Cleanup,
    /// Holds the lock, if the file system has locks.
    _lock: File,
}

impl ResultFolder {
    /// Creates the folder if it does not exist, locks it, and checks that the files `names` can be written. They stay as they are.
    ///
    /// # Errors
    /// A folder that another run holds, or that cannot be written to; a file that cannot be replaced.
    pub fn open(path: &Path, names: &[&'static str]) -> Result<Self, FileError> {
        // Absolute: an FMU may change the working folder.
        let absolute = std::path::absolute(path).map_err(FileError::at(path))?;
        // The deepest first.
        let missing = absolute.ancestors().take_while(|folder| !folder.exists());
        let created: Vec<PathBuf> = missing.map(PathBuf::from).collect();
        fs::create_dir_all(path).map_err(FileError::at(path))?;
        let file = absolute.join(LOCK);
        let _lock = lock(&file).map_err(FileError::at(path))?;
        let _cleanup = Cleanup::new(move || {
            // Both are best effort: an old lock file locks nothing, and a folder with files in it stays.
            let _ = fs::remove_file(file);
            for folder in created {
                let _ = fs::remove_dir(folder);
            }
        });
        let names = names.into();
        let folder = Self { path: path.into(), names, _cleanup, _lock };
        for name in &folder.names {
            writable(&path.join(name))?;
        }
        Ok(folder)
    }

    /// Replaces the files of an earlier run by these. All are written under temporary names before the first old one goes.
    pub fn replace<N: AsRef<Path>, C: AsRef<[u8]>>(
        &self,
        files: impl IntoIterator<Item = (N, C)>,
    ) -> Result<Vec<PathBuf>, FileError> {
        let mut finished = Vec::new();
        for (name, content) in files {
            let path = self.path.join(name);
            let mut file = temporary(&self.path).map_err(FileError::at(&path))?;
            file.write_all(content.as_ref()).map_err(FileError::at(&path))?;
            finished.push((file, path));
        }
        for name in &self.names {
            let path = self.path.join(name);
            absent(fs::remove_file(&path)).map_err(FileError::at(&path))?;
        }
        let keep = |(file, path): (NamedTempFile, PathBuf)| match file.persist(&path) {
            Ok(_) => Ok(path),
            Err(error) => Err(FileError { path, source: error.error }),
        };
        finished.into_iter().map(keep).collect()
    }

    /// Writes `name`, all that a run without results leaves. Results of an earlier run move to a folder, which is returned if there are any.
    pub fn interrupt(&self, name: &str, content: &str) -> Result<(PathBuf, Option<PathBuf>), FileError> {
        let names = || self.names.iter().filter(|result| **result != name);
        let previous = names().any(|name| self.path.join(name).exists());
        let previous = previous.then(|| self.path.join(PREVIOUS));
        if let Some(previous) = &previous {
            fs::create_dir_all(previous).map_err(FileError::at(previous))?;
            for name in names() {
                let [from, to] = [&self.path, previous].map(|folder| folder.join(name));
                // The run before may have written fewer files than the one before it.
                absent(fs::remove_file(&to)).map_err(FileError::at(&to))?;
                absent(fs::rename(from, &to)).map_err(FileError::at(&to))?;
            }
        }
        Ok((write_file(&self.path.join(name), content)?, previous))
    }
}

/// Success, if a file does not exist.
fn absent(result: io::Result<()>) -> io::Result<()> {
    result.or_else(|error| match error.kind() {
        ErrorKind::NotFound => Ok(()),
        _ => Err(error),
    })
}

/// Creates a file and locks it.
fn lock(path: &Path) -> io::Result<File> {
    loop {
        let file = OpenOptions::new().create(true).append(true).open(path)?;
        match file.try_lock() {
            Err(TryLockError::WouldBlock) => {
                let message = "another run of this program writes there";
                return Err(io::Error::new(ErrorKind::ResourceBusy, message));
            }
            // Some network file systems have no locks.
            Err(TryLockError::Error(_)) => return Ok(file),
            Ok(()) => {}
        }
        // A run that has just ended may have removed the file after it was opened here.
        if Handle::from_path(path).ok() == Some(Handle::from_file(file.try_clone()?)?) {
            return Ok(file);
        }
    }
}
