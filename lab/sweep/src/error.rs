//! Errors of a store.

use std::{error::Error, io, path::PathBuf};

use zarrs::{
    array::{ArrayCreateError, ArrayError},
    storage::StorageError,
};

/// Why a store cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum StoreError {
    /// The store belongs to another sweep.
    #[error(
        "{} belongs to another sweep, with another {differs}. It stays as it is; write to another folder, or delete it",
        folder.display()
    )]
    Other {
        /// The folder.
        folder: PathBuf,
        /// What differs.
        differs: String,
    },
    /// The store is of the same sweep, computed by another program.
    #[error(
        "{} was computed by another version of vines ({found}, here {here}), and results of both must not be mixed. \
         It stays as it is; continue it with the version that began it, or write to another folder",
        folder.display()
    )]
    Build {
        /// The folder.
        folder: PathBuf,
        /// Version of the store.
        found: String,
        /// Version of this program.
        here: String,
    },
    /// Chunks without the file that says to which sweep they belong.
    #[error(
        "{} has chunks, but its zarr.json, which says to which sweep they belong, is missing or damaged. \
         The store stays as it is; restore that file, delete the folder, or name another one",
        .0.display()
    )]
    Group(PathBuf),
    /// The folder holds something else.
    #[error("{} is not the store of a sweep; name another folder", .0.display())]
    NotAStore(PathBuf),
    /// An adaptive sweep in parts.
    #[error(
        "an adaptive sweep cannot be computed in parts: what is computed next depends on all cells. Leave out the part"
    )]
    Part,
    /// Reading or writing failed.
    #[error("cannot write to {}: {source}. Complete chunks stay; the same command continues the sweep", folder.display())]
    Write {
        /// The folder.
        folder: PathBuf,
        /// Error of the system or of the format.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
}

impl StoreError {
    /// Number of the system's error, if it is one.
    #[must_use]
    pub fn os_error(&self) -> Option<i32> {
        let mut cause: Option<&(dyn Error + 'static)> = Some(self);
        while let Some(one) = cause {
            // Those of zarrs hide their cause.
            let storage = match (one.downcast_ref(), one.downcast_ref()) {
                (Some(ArrayError::StorageError(storage)), _) => Some(storage),
                (_, Some(ArrayCreateError::StorageError(storage))) => Some(storage),
                _ => one.downcast_ref(),
            };
            let system = match storage {
                Some(StorageError::IOError(error)) => Some(&**error),
                _ => one.downcast_ref::<io::Error>(),
            };
            if let Some(number) = system.and_then(io::Error::raw_os_error) {
                return Some(number);
            }
            cause = one.source();
        }
        None
    }
}
