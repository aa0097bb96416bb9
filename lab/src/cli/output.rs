//! What all commands print and write.

use std::fs::File;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::thread;
use std::time::Duration;

use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;
use vines::ResultFolder;
use vines::fmu::process;

use super::failure::Failure;
use super::signals::Orderly;

/// The program's own stdout: what FMUs print goes to stderr.
static STDOUT: OnceLock<File> = OnceLock::new();

/// Keeps stdout for [`print`], before any FMU is loaded.
pub(super) fn keep_stdout() -> io::Result<()> {
    let own = process::keep_stdout()?;
    STDOUT.get_or_init(|| own);
    Ok(())
}

/// Prints; a reader that closes early, such as `head`, is not a failure.
pub(super) fn print(text: &str) -> Result<(), Failure> {
    let Some(mut out) = STDOUT.get() else { return Ok(()) };
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

/// Stability in a column `stable`.
pub(super) fn stability(stable: bool, neutral: bool) -> &'static str {
    match (stable, neutral) {
        (true, _) => "yes",
        (_, true) => "neutral",
        _ => "no",
    }
}

/// What a command has found, and what is left to do once that has been printed: a full disk hides no result.
pub(super) struct Results {
    text: String,
    /// The text is for programs, and says nothing of the files.
    json: bool,
    write: Box<dyn FnOnce() -> Written>,
}

/// What was written, and what has failed.
#[derive(Default)]
pub(super) struct Written {
    pub paths: Vec<PathBuf>,
    pub failures: Vec<Failure>,
}

impl Written {
    pub(super) fn add<E: Into<Failure>>(&mut self, written: Result<impl IntoIterator<Item = PathBuf>, E>) {
        match written {
            Ok(paths) => self.paths.extend(paths),
            Err(failure) => self.failures.push(failure.into()),
        }
    }
}

impl From<String> for Results {
    fn from(text: String) -> Self {
        Self::new(text, false, Written::default)
    }
}

impl Results {
    pub(super) fn new(text: String, json: bool, write: impl FnOnce() -> Written + 'static) -> Self {
        Self { text, json, write: Box::new(write) }
    }

    /// With a figure, if there is a file for it.
    pub(super) fn with_figure(
        text: String,
        json: bool,
        file: Option<PathBuf>,
        draw: impl FnOnce() -> String + 'static,
    ) -> Self {
        Self::new(text, json, move || {
            let mut written = Written::default();
            written.add(file.map(|file| vines::write_file(&file, &draw())).transpose());
            written
        })
    }

    /// Prints the text and the paths of the files, and returns the failures of all steps.
    pub(super) fn show(self) -> Result<(), Failure> {
        // The files of a result are replaced together.
        let _orderly = Orderly::new();
        let printed = print(&self.text);
        let (files, mut failures) = Self::written(self.json, self.write);
        failures.extend(print(&files).err());
        failures.extend(printed.err());
        Failure::first_of(failures).map_or(Ok(()), Err)
    }

    /// What [`Self::show`] prints, and the failures of writing the files.
    pub(super) fn texts(self) -> (String, Option<Failure>) {
        let (files, failures) = Self::written(self.json, self.write);
        (self.text + &files, Failure::first_of(failures))
    }

    /// Writes the files. Returns what to print of them, and what has failed.
    fn written(json: bool, write: Box<dyn FnOnce() -> Written>) -> (String, Vec<Failure>) {
        let Written { paths, failures } = write();
        let text = if json || paths.is_empty() {
            String::new()
        } else {
            written(&paths)
        };
        (text, failures)
    }
}

/// The paths that were written, in one line.
pub(super) fn written(paths: &[PathBuf]) -> String {
    let files: Vec<String> = paths.iter().map(|path| path.display().to_string()).collect();
    format!("Written: {}\n", files.join(", "))
}

/// Refuses files that cannot be written, before anything runs.
pub(super) fn writable<'a>(files: impl IntoIterator<Item = &'a PathBuf>) -> Result<(), Failure> {
    files
        .into_iter()
        .try_for_each(|file| vines::writable(file).map_err(Failure::input))
}

/// Opens the folder of results before anything runs; `names` are the files that the command may write.
pub(super) fn results(folder: &Path, names: &[&'static str]) -> Result<ResultFolder, Failure> {
    ResultFolder::open(folder, names).map_err(|error| {
        let advice = match error.source.kind() {
            io::ErrorKind::ResourceBusy => "; wait for its end, or choose another folder with --out",
            _ => "",
        };
        Failure::input(format!("{error}{advice}"))
    })
}

/// Warnings on stderr.
struct Warnings;

impl log::Log for Warnings {
    fn enabled(&self, metadata: &log::Metadata<'_>) -> bool {
        metadata.level() <= log::Level::Warn
    }

    fn log(&self, record: &log::Record<'_>) {
        if self.enabled(record.metadata()) {
            // A warning is no result: a closed stderr does not matter.
            let _ = writeln!(
                io::stderr(),
                "[{:<5} {}] {}",
                record.level(),
                record.target(),
                record.args()
            );
        }
    }

    fn flush(&self) {}
}

/// Warnings go to stderr: warnings of connections, and what an FMU logs.
pub(super) fn log_warnings() {
    log::set_max_level(log::LevelFilter::Warn);
    // A report runs several commands.
    let _ = log::set_logger(&Warnings);
}

/// Time between two lines of progress where stderr is no terminal.
const PROGRESS: Duration = Duration::from_secs(10);

/// Progress on stderr: a bar in a terminal, else a line every ten seconds in which there is some.
pub(super) fn progress_bar(length: u64, message: &'static str, unit: &'static str) -> ProgressBar {
    let template = format!("{{msg}} [{{wide_bar}}] {{pos}}/{{len}} {unit}");
    let style = ProgressStyle::with_template(&template).unwrap_or_else(|_| ProgressStyle::default_bar());
    let bar = ProgressBar::new(length).with_style(style).with_message(message);
    if bar.is_hidden() {
        let watched = bar.downgrade();
        thread::spawn(move || {
            let mut before = None;
            loop {
                thread::sleep(PROGRESS);
                let Some(bar) = watched.upgrade().filter(|bar| !bar.is_finished()) else {
                    return;
                };
                let (done, of) = (bar.position(), bar.length().unwrap_or_default());
                if before.replace(done) != Some(done) {
                    // Progress is no result: a closed stderr does not matter.
                    let _ = writeln!(io::stderr(), "{}: {done} of {of} {unit}", bar.message());
                }
            }
        });
    }
    bar
}
