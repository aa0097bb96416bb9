//! The command line: one file per command.

mod backbone;
mod calibrate;
mod chain;
mod controller;
mod decay;
mod endpoint;
mod failure;
mod identify;
mod map;
mod orbit;
mod pack;
mod report;
mod rig;
mod scene_arguments;
mod serving;
mod theory;

use std::{
    io::{self, Write},
    path::PathBuf,
    process::ExitCode,
};

use clap::{Parser, Subcommand};
use serde::Serialize;

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
    Decay(decay::Arguments),
    Orbit(orbit::Arguments),
    Theory(theory::Arguments),
    Map(map::Arguments),
    Report(report::Arguments),
    Pack(pack::Arguments),
    Rig(rig::Arguments),
    Controller(controller::Arguments),
}

/// Runs the program: exit code 0, 1 for a failure, 2 for bad usage or input.
pub fn run() -> ExitCode {
    let output = match Cli::parse().command {
        Command::Identify(arguments) => identify::run(&arguments),
        Command::Backbone(arguments) => backbone::run(&arguments),
        Command::Calibrate(arguments) => calibrate::run(&arguments),
        Command::Chain(arguments) => chain::run(&arguments),
        Command::Decay(arguments) => decay::run(&arguments),
        Command::Orbit(arguments) => orbit::run(&arguments),
        Command::Theory(arguments) => theory::run(&arguments),
        Command::Map(arguments) => map::run(&arguments),
        Command::Report(arguments) => report::run(&arguments),
        Command::Pack(arguments) => pack::run(&arguments),
        Command::Rig(arguments) => rig::run(&arguments),
        Command::Controller(arguments) => controller::run(&arguments),
    };
    match output.and_then(|text| print(&text)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            eprintln!("error: {failure}");
            ExitCode::from(failure.code())
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

fn json(found: &impl Serialize) -> Result<String, Failure> {
    Ok(serde_json::to_string_pretty(found)? + "\n")
}
