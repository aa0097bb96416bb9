//! The command line: one file per command.

mod backbone;
mod calibrate;
mod chain;
mod check;
mod controller;
mod decay;
mod endpoint;
mod experiment;
mod failure;
mod faults;
mod identify;
mod interrupt;
mod map;
mod orbit;
mod pack;
mod real_time;
mod report;
mod rig;
mod rigs;
mod scene_arguments;
mod serving;
#[cfg(feature = "sweep")]
mod sweep;
#[cfg(not(feature = "sweep"))]
#[path = "cli/without_sweep.rs"]
mod sweep;
mod theory;

use std::{
    io::{self, Write},
    path::{Path, PathBuf},
    process::ExitCode,
};

use clap::{Parser, Subcommand};
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;
use vines::net::Timing;

use failure::Failure;

const EXAMPLES: &str = "\
Examples:
  vines identify                               the whole experiment on the default scene, results in out/
  vines backbone                               the backbone level by level, with the loop closed
  vines calibrate                              the coverage of the uncertainties over 504 noisy runs
  vines orbit                                  exact orbits of the default scene
  vines orbit --set excitation.G=1.0 --json    the same at another excitation, for programs
  vines orbit --response                       the exact frequency response, stable and unstable
  vines theory --scene scenes/dimensionless.toml --set plant.epsilon=0.0042
  vines map                                    the regimes over sigma and G
  vines sweep --axis plant.r=0.3:1:71 --axis start.dq2=-1:1:81 --out r.zarr
  vines report --out report                    everything on one page, with figures
  vines pack --out fmus                        write LoViNes.fmu and PhaseLock.fmu
  vines rig --listen 127.0.0.1:5510            serve the plant in real time, for identify --rig udp://127.0.0.1:5510

Without --scene, the default scene built into the program is used; it is scenes/paper.toml.";

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
    Calibrate(calibrate::Arguments),
    Chain(chain::Arguments),
    Check(check::Arguments),
    Decay(decay::Arguments),
    Faults(faults::Arguments),
    Orbit(orbit::Arguments),
    Theory(theory::Arguments),
    Map(map::Arguments),
    Sweep(sweep::Arguments),
    Report(report::Arguments),
    Pack(pack::Arguments),
    Rig(rig::Arguments),
    Rigs(rigs::Arguments),
    Controller(controller::Arguments),
}

/// Share of late samples of a rig in real time above which its results are doubtful, and the exit code that says so.
const TOLERATED: f64 = 0.01;
const LATE: u8 = 3;

/// Runs the program: exit code 0, 1 for a failure, 2 for bad usage or input, 3 for results of a rig that missed deadlines,
/// 130 after Ctrl-C.
pub fn run() -> ExitCode {
    let output = match Cli::parse().command {
        Command::Identify(arguments) => identify::run(&arguments),
        Command::Backbone(arguments) => backbone::run(&arguments),
        Command::Calibrate(arguments) => calibrate::run(&arguments),
        Command::Chain(arguments) => chain::run(&arguments),
        Command::Check(arguments) => check::run(&arguments),
        Command::Decay(arguments) => decay::run(&arguments),
        Command::Faults(arguments) => faults::run(&arguments),
        Command::Orbit(arguments) => orbit::run(&arguments),
        Command::Theory(arguments) => theory::run(&arguments),
        Command::Map(arguments) => map::run(&arguments),
        Command::Sweep(arguments) => sweep::run(&arguments),
        Command::Report(arguments) => report::run(&arguments),
        Command::Pack(arguments) => pack::run(&arguments),
        Command::Rig(arguments) => rig::run(&arguments),
        Command::Rigs(arguments) => rigs::run(&arguments),
        Command::Controller(arguments) => controller::run(&arguments),
    };
    match output.and_then(|text| print(&text)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            eprintln!("error: {}", failure.message);
            failure.code.into()
        }
    }
}

/// Prints; a reader that closes early, such as `head`, is not a failure.
fn print(text: &str) -> Result<(), Failure> {
    let mut out = io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => {
            Err(Failure::run(format!("cannot write the result: {error}")))
        }
        _ => Ok(()),
    }
}

fn yes_no(value: bool) -> String {
    if value { "yes" } else { "no" }.into()
}

/// The paths that were written, in one line.
fn written(paths: &[PathBuf]) -> String {
    let files: Vec<String> = paths.iter().map(|path| path.display().to_string()).collect();
    format!("Written: {}\n", files.join(", "))
}

/// Creates a folder for results, and checks that files can be written to it before anything is driven.
fn writable(folder: &Path) -> Result<(), Failure> {
    std::fs::create_dir_all(folder)
        .and_then(|()| tempfile::tempfile_in(folder))
        .map_err(|error| Failure::input(format!("cannot write to {}: {error}", folder.display())))?;
    Ok(())
}

/// Warnings go to stderr: those of connections, and what an FMU logs.
fn log_warnings() {
    env_logger::Builder::new()
        .filter_level(log::LevelFilter::Warn)
        .format_timestamp(None)
        .init();
}

/// The result of an experiment, as JSON or as a summary with the paths that were written. If a rig in real time was late, stderr
/// says so; a rig that missed too many deadlines is a failure.
fn result(
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
fn output(as_json: bool, found: &impl Serialize, text: impl FnOnce() -> String) -> Result<String, Failure> {
    if as_json {
        return Ok(serde_json::to_string_pretty(found)? + "\n");
    }
    Ok(text())
}

/// A progress bar on stderr; indicatif hides it if that is not a terminal.
fn progress_bar(length: u64, template: &str) -> ProgressBar {
    let style = ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar());
    ProgressBar::new(length).with_style(style)
}
