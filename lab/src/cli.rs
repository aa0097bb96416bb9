//! The command line of the lab, one file per command: that of the program `vines`, and `vines fit` for the Python package.

mod backbone;
mod check;
mod experiment;
mod failure;
mod fit;
mod identify;
mod map;
mod options;
mod orbit;
mod output;
mod pack;
mod points;
mod recording;
mod report;
mod serve;
mod shell;
mod signals;
mod structure;
mod summary;
mod tap;
mod theory;
mod watch;

use std::ffi::OsString;
use std::fmt::Display;
use std::io::{self, Write};
use std::path::Path;
use std::process::ExitCode;

use clap::{Parser, Subcommand};

use crate::ArgumentError;
use crate::fmu::process::Signal;
use failure::Failure;
use output::Results;
pub use points::{Source, truth};

const EXAMPLES: &str = "\
Examples:
  vines identify                               the whole experiment on the default scene, results in out/
  vines backbone                               the backbone level by level, with the loop closed
  vines fit out/tracked.csv                    the parameters of the rig from its backbone
  vines orbit                                  exact orbits of the default scene
  vines orbit --set excitation.G=1.0 --json    the same at another excitation, for programs
  vines orbit --response                       the exact frequency response, stable and unstable
  vines theory --scene scenes/dimensionless.toml --set plant.epsilon=0.0042
  vines map                                    the regimes over sigma and G
  vines report --out report                    everything on one page, with figures
  vines pack --out fmus                        write LoViNes.fmu and PhaseLock.fmu
  vines rig --listen 127.0.0.1:5510            serve the plant in real time, for identify --rig udp://127.0.0.1:5510

Without --scene, the default scene built into the program is used; it is lab/scene/paper.toml.

Exit codes:
    0  success
    1  no result, a result that is not what was asked for, or a file that could not be written
    2  wrong usage, a value that is not allowed, or a target that cannot be written: nothing has moved
    3  results of a rig in real time that are doubtful, because too many samples were late
  130  ended by Ctrl-C (SIGINT) within two seconds; 143 by SIGTERM, 129 by SIGHUP. The message says whether the drive is zero

`vines completions SHELL` prints completions for bash, elvish, fish, powershell or zsh, and `vines man [COMMAND]` a manual page:
  vines completions bash > ~/.local/share/bash-completion/completions/vines
  vines man identify | man -l -";

/// A virtual test bench for a linear oscillator with a vibro-impact nonlinear energy sink
#[derive(Debug, Parser)]
#[command(name = "vines", version, after_help = EXAMPLES)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Identify(identify::Arguments),
    Backbone(backbone::Arguments),
    Fit(fit::Arguments),
    Check(check::Arguments),
    Orbit(orbit::Arguments),
    Structure(structure::Arguments),
    Theory(theory::Arguments),
    Map(map::Arguments),
    Report(report::Arguments),
    Pack(pack::Arguments),
    Rig(serve::RigArguments),
    Controller(serve::ControllerArguments),
    #[command(hide = true)]
    Completions(shell::CompletionsArguments),
    #[command(hide = true)]
    Man(shell::ManArguments),
}

/// Prints a line of a message. That nobody reads messages any longer ends nothing: not a signal's orderly end, which would panic with `eprintln`.
fn say(line: impl Display) {
    let _ = writeln!(io::stderr(), "{line}");
}

/// Runs the command of the program's arguments, prints its results, and returns the exit code.
#[must_use]
pub fn main() -> ExitCode {
    let cli = Cli::try_parse().unwrap_or_else(|error| shell::with_advice(error).exit());
    signals::start();
    if let Err(error) = output::keep_stdout() {
        say(format_args!("error: cannot keep stdout for the results: {error}"));
        return ExitCode::FAILURE;
    }
    let outcome = dispatch(cli.command).and_then(Results::show);
    let signal = signals::arrived();
    let code = match outcome {
        Ok(()) => 0,
        Err(failure) => {
            say(format_args!("error: {}", failure.message));
            if let Some(signal) = signal.filter(|_| failure.code != failure::INTERRUPTED) {
                say(format_args!("error: {}", signals::ended(signal)));
            }
            failure.code
        }
    };
    signal.map_or(code, Signal::exit_code).into()
}

/// The command line of the Python package: `vines fit`, for the files that `vines` does not read.
#[derive(Debug, Parser)]
#[command(name = "vines", bin_name = "python -m vines", version)]
struct FitCli {
    #[command(subcommand)]
    command: FitCommand,
}

#[derive(Debug, Subcommand)]
enum FitCommand {
    Fit(fit::Arguments),
}

/// What a command has printed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Printed {
    /// Exit code.
    pub code: u8,
    /// Text on the standard output.
    pub out: String,
    /// Text on the standard error.
    pub err: String,
}

/// Runs `vines fit` with the words of a command line, the first of which is `fit`; `read` reads the files. Files are written, and nothing is printed.
pub fn fit(words: &[OsString], read: &dyn Fn(&Path) -> Result<Source, ArgumentError>) -> Printed {
    let program = std::iter::once(OsString::from("vines"));
    let arguments = match FitCli::try_parse_from(program.chain(words.iter().cloned())) {
        Ok(FitCli { command: FitCommand::Fit(arguments) }) => arguments,
        Err(error) => {
            let (code, text) = (error.exit_code(), error.render().to_string());
            let [out, err] = match error.use_stderr() {
                true => [String::new(), text],
                false => [text, String::new()],
            };
            return Printed { code: u8::try_from(code).unwrap_or(2), out, err };
        }
    };
    let (out, failure) = match fit::run(&arguments, read) {
        Ok(results) => results.texts(),
        Err(failure) => (String::new(), Some(failure)),
    };
    Printed {
        code: failure.as_ref().map_or(0, |failure| failure.code),
        out,
        err: failure.map_or_else(String::new, |failure| format!("error: {}\n", failure.message)),
    }
}

/// Runs a command.
fn dispatch(command: Command) -> Result<Results, Failure> {
    match command {
        Command::Identify(arguments) => identify::run(&arguments),
        Command::Backbone(arguments) => backbone::run(&arguments),
        Command::Fit(arguments) => fit::run(&arguments, &points::plain),
        Command::Check(arguments) => check::run(&arguments).map(Results::from),
        Command::Orbit(arguments) => orbit::run(&arguments),
        Command::Structure(arguments) => structure::run(&arguments),
        Command::Theory(arguments) => theory::run(&arguments),
        Command::Map(arguments) => map::run(&arguments),
        Command::Report(arguments) => report::run(&arguments).map(Results::from),
        Command::Pack(arguments) => pack::run(&arguments).map(Results::from),
        Command::Rig(arguments) => serve::rig(&arguments).map(Results::from),
        Command::Controller(arguments) => serve::controller(&arguments).map(Results::from),
        Command::Completions(arguments) => Ok(shell::completions(&arguments).into()),
        Command::Man(arguments) => shell::man(&arguments).map(Results::from),
    }
}
