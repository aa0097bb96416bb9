//! What can go wrong while packing.

use std::path::PathBuf;

/// A failure that names the file and what to do; `build_options` are those of `cargo build --release`.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages explain the variants")]
pub enum PackError {
    #[error(
        "the library of {identifier} was not found: {} does not exist; build it with \
         `cargo build --release {build_options}`, or name its folder with --libraries", path.display()
    )]
    Missing {
        identifier: &'static str,
        path: PathBuf,
        build_options: String,
    },
    #[error("cannot read {}: {source}", path.display())]
    Read { path: PathBuf, source: std::io::Error },
    #[error(
        "{} is {found}, but this platform needs {needed}; build it here with `cargo build --release {build_options}`",
        path.display()
    )]
    Platform {
        path: PathBuf,
        found: String,
        needed: &'static str,
        build_options: String,
    },
    #[error(
        "{} has no function fmi2Instantiate, so it is not an FMI 2.0 component; \
         build it with `cargo build --release {build_options}`", path.display()
    )]
    NotAComponent { path: PathBuf, build_options: String },
    #[error(
        "{} was built from other variables than {identifier} has now: build it anew with \
         `cargo build --release {build_options}`", path.display()
    )]
    Stale {
        path: PathBuf,
        identifier: &'static str,
        build_options: String,
    },
    #[error("{} {problem}", path.display())]
    Binary { path: PathBuf, problem: String },
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
