//! `vines`: the command line of the lab.

#![forbid(unsafe_code)]

use std::process::ExitCode;

fn main() -> ExitCode {
    vines::cli::main()
}
