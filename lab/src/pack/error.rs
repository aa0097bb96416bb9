//! What can go wrong while packing.

use std::path::PathBuf;

/// A failure that names the file and what to do; `build` is the command that builds it.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages explain the variants")]
pub enum PackError {
    #[error(
        "the library of {identifier} was not found: {} does not exist; build it with {build}, or name its folder with --libraries",
        path.display()
    )]
    Missing {
        identifier: &'static str,
        path: PathBuf,
        build: String,
    },
    #[error("cannot read {}: {source}", path.display())]
    Read { path: PathBuf, source: std::io::Error },
    #[error("{} {problem}", path.display())]
    Library { path: PathBuf, problem: String },
    #[error(
        "there is no library of {identifier} for any platform: give one by --binary PLATFORM=FILE, or leave out \
         --only-binaries"
    )]
    Unserved { identifier: &'static str },
    #[error(
        "SOURCE_DATE_EPOCH = {0:?} is refused; allowed are seconds since 1970, for instance {example}",
        example = 1_700_000_000
    )]
    Date(String),
    #[error("the scene's controller: {0}")]
    Controller(#[from] phase_lock::ConfigError),
    #[error("the description cannot be read: {0}")]
    Description(fmi2_description::Error),
    #[error(transparent)]
    Write(#[from] crate::files::FileError),
}
