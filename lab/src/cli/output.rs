//! What all commands print and write.

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;
use vines::net::Timing;
use vines::report::ReportError;

use super::failure::Failure;

/// Share of late samples of a rig in real time above which its results are doubtful, and the exit code that says so.
const TOLERATED: f64 = 0.01;
const LATE: u8 = 3;

/// Prints; a reader that closes early, such as `head`, is not a failure.
pub fn print(text: &str) -> Result<(), Failure> {
    let mut out = io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => {
            Err(Failure::run(format!("cannot write the result: {error}")))
        }
        _ => Ok(()),
    }
}

pub fn yes_no(value: bool) -> String {
    if value { "yes" } else { "no" }.into()
}

/// The paths that were written, in one line.
pub fn written(paths: &[PathBuf]) -> String {
    let files: Vec<String> = paths.iter().map(|path| path.display().to_string()).collect();
    format!("Written: {}\n", files.join(", "))
}

/// The files of a result. If they cannot be written, the result is printed as `text` instead.
pub fn saved(
    files: Result<Vec<PathBuf>, ReportError>,
    text: impl FnOnce() -> Result<String, Failure>,
) -> Result<Vec<PathBuf>, Failure> {
    files.or_else(|error| {
        print(&text()?)?;
        Err(Failure::run(format!(
            "{error}; standard output has the results instead"
        )))
    })
}

/// Creates a folder for results, and checks that files can be written to it before anything is driven.
pub fn writable(folder: &Path) -> Result<(), Failure> {
    std::fs::create_dir_all(folder)
        .and_then(|()| tempfile::tempfile_in(folder))
        .map_err(|error| Failure::input(format!("cannot write to {}: {error}", folder.display())))?;
    Ok(())
}

/// Warnings go to stderr: those of connections, and what an FMU logs.
pub fn log_warnings() {
    env_logger::Builder::new()
        .filter_level(log::LevelFilter::Warn)
        .format_timestamp(None)
        .init();
}

/// The result of an experiment, as JSON or as a summary with the paths that were written. If a rig in real time was late, stderr
/// says so; a rig that missed too many deadlines is a failure.
pub fn result(
    as_json: bool,
    found: &impl Serialize,
    summary: &str,
    paths: &[PathBuf],
    timing: Option<Timing>,
) -> Result<String, Failure> {
    let text = output(as_json, found, || format!("{summary}\n{}", written(paths)))?;
    match timing {
        Some(timing) if timing.share() > TOLERATED => {
            print(&text)?;
            let message = format!("the rig missed too many deadlines, so these results are doubtful: {timing}");
            Err(Failure::new(LATE, message))
        }
        Some(timing) if timing.share() > 0.0 => {
            eprintln!("warning: the rig missed deadlines: {timing}");
            Ok(text)
        }
        _ => Ok(text),
    }
}

/// What was found as JSON, or as text.
pub fn output(as_json: bool, found: &impl Serialize, text: impl FnOnce() -> String) -> Result<String, Failure> {
    if as_json {
        return Ok(serde_json::to_string_pretty(found)? + "\n");
    }
    Ok(text())
}

/// A progress bar on stderr; indicatif hides it if that is not a terminal.
pub fn progress_bar(length: u64, template: &str) -> ProgressBar {
    let style = ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar());
    ProgressBar::new(length).with_style(style)
}
