//! `vines pack`: the two FMUs, and the two of them coupled.

use std::path::PathBuf;

use clap::Args;
use vines::pack::{Binary, File, components, components_of, own_libraries, pack, pack_bench};
use vines::rig::BuiltIn;

use super::{failure::Failure, options::SceneArguments, output::results};

const HELP: &str = "\
Examples:
  scripts/pack --out fmus                                      builds the libraries first
  scripts/pack --out fmus --portable                           for older Linux (glibc 2.17)
  vines pack --libraries target/debug --out fmus               libraries of `cargo build`
  vines pack --out fmus --scene scenes/dimensionless.toml      bench.ssp with other parameters
  vines pack --out fmus --scene scenes/cantilever.toml         Structure.fmu in place of LoViNes.fmu and bench.ssp
  vines pack --out fmus --binary win64=lovines_fmu.dll --binary win64=phase_lock_fmu.dll";

/// Write LoViNes.fmu (the plant), PhaseLock.fmu (the controller) and bench.ssp (the two coupled)
#[derive(Debug, Args)]
#[command(after_help = HELP)]
pub(super) struct Arguments {
    #[command(flatten)]
    scene: SceneArguments,

    /// Folder for the files; created if it does not exist
    #[arg(long, value_name = "DIR")]
    out: PathBuf,

    /// Folder of the shared libraries; without it, the one that holds this program
    #[arg(long, value_name = "DIR")]
    libraries: Option<PathBuf>,

    /// Add a library for another platform, such as win64 or aarch64-linux; may be repeated. The GUID in
    /// the library determines its FMU
    #[arg(long = "binary", value_name = "PLATFORM=FILE")]
    binaries: Vec<Binary>,

    /// Pack the libraries given by --binary, and none of this platform
    #[arg(long, requires = "binaries", conflicts_with = "libraries")]
    only_binaries: bool,
}

/// What is written, `bench.ssp` and `LoViNes.fmu` for an oscillator and `Structure.fmu` for a structure.
const FILES: [&str; 4] = ["LoViNes.fmu", "PhaseLock.fmu", "bench.ssp", "Structure.fmu"];

pub(super) fn run(arguments: &Arguments) -> Result<String, Failure> {
    let scene = arguments.scene.load()?;
    BuiltIn::new(&scene.plan().lock)?;
    let folder = results(&arguments.out, &FILES)?;
    let mut binaries = Vec::new();
    if !arguments.only_binaries {
        let libraries = arguments.libraries.clone().map_or_else(beside_this_program, Ok)?;
        binaries = own_libraries(&components_of(&scene)?, &libraries)?;
    }
    binaries.extend(arguments.binaries.iter().cloned());
    let written = folder.replace(pack_bench(&scene, &binaries)?)?;
    Ok(written.iter().map(|path| format!("{}\n", path.display())).collect())
}

/// This program's FMUs of one oscillator; the plant is the first.
pub(super) fn fmus() -> Result<Vec<File>, Failure> {
    let components = components();
    let libraries = own_libraries(&components, &beside_this_program()?)?;
    Ok(pack(&components, &libraries)?)
}

fn beside_this_program() -> Result<PathBuf, Failure> {
    let program =
        std::env::current_exe().map_err(|error| Failure::run(format!("cannot tell where this program is: {error}")))?;
    Ok(program.parent().map(PathBuf::from).unwrap_or_default())
}
