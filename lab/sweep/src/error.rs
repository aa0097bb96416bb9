//! Errors of a store.

use std::path::PathBuf;

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
        "{} was computed by another build of vines (version and engine {found}, here {here}), and results of both must not be mixed. \
         It stays as it is; continue it with the build that began it, or write to another folder",
        folder.display()
    )]
    Build {
        /// The folder.
        folder: PathBuf,
        /// Version and engine of the store.
        found: String,
        /// Those of this program.
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
