//! What all commands print and write.

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;

use super::failure::Failure;

/// Prints; a reader that closes early, such as `head`, is not a failure.
pub(super) fn print(text: &str) -> Result<(), Failure> {
    let mut out = io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => {
            Err(Failure::run(format!("cannot write the result: {error}")))
        }
        _ => Ok(()),
    }
}

/// A result as JSON, or as text.
pub(super) fn output(as_json: bool, result: &impl Serialize, text: impl FnOnce() -> String) -> Result<String, Failure> {
    match as_json {
        true => serde_json::to_string_pretty(result)
            .map(|json| json + "\n")
            .map_err(|error| Failure::run(format!("cannot write JSON: {error}"))),
        false => Ok(text()),
    }
}

pub(super) fn yes_no(value: bool) -> String {
    if value { "yes" } else { "no" }.into()
}

/// The paths that were written, in one line.
pub(super) fn written(paths: &[PathBuf]) -> String {
    let files: Vec<String> = paths.iter().map(|path| path.display().to_string()).collect();
    format!("Written: {}\n", files.join(", "))
}

/// Checks that files can be written to a folder before anything runs. A folder that does not exist is not created yet: that its parent
/// can be written to is enough.
pub(super) fn writable(folder: &Path) -> Result<(), Failure> {
    let existing = folder.ancestors().find(|path| path.exists());
    tempfile::tempfile_in(existing.unwrap_or(Path::new(".")))
        .map(drop)
        .map_err(|error| Failure::input(format!("cannot write to {}: {error}", folder.display())))
}

/// Warnings go to stderr: warnings of connections, and what an FMU logs.
pub(super) fn log_warnings() {
    // A report runs several commands.
    let _ = env_logger::Builder::new()
        .filter_level(log::LevelFilter::Warn)
        .format_timestamp(None)
        .try_init();
}

/// A progress bar on stderr; indicatif hides it if that is not a terminal.
pub(super) fn progress_bar(length: u64, template: &str) -> ProgressBar {
    let style = ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar());
    ProgressBar::new(length).with_style(style)
}
