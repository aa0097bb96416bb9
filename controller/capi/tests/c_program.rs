//! Guards the static library in a C program, bit by bit against the Rust core.

use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::Command;

use phase_lock::{Config, Input, Move, Output};

/// Runs a command; its output.
fn run(command: &mut Command) -> String {
    let output = command.output().unwrap_or_else(|error| panic!("{command:?}: {error}"));
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{command:?}: {said}");
    String::from_utf8(output.stdout).unwrap()
}

/// Builds the static library as firmware takes it, without the standard library, in a folder of its own.
fn static_library(folder: &Path, features: &str) -> PathBuf {
    let options = [
        "rustc",
        "--locked",
        "--quiet",
        "--release",
        "--lib",
        "--no-default-features",
        "--features",
        features,
    ];
    let firmware = [
        "--config",
        "profile.release.panic=\"abort\"",
        "--config",
        "profile.release.lto=false",
    ];
    let mut cargo = Command::new(env!("CARGO"));
    cargo.args(options).args(["--crate-type", "staticlib", "--target-dir"]);
    run(cargo.arg(folder).args(firmware).current_dir(env!("CARGO_MANIFEST_DIR")));
    folder.join("release/libphase_lock_c.a")
}

/// What tests/resonator.c prints, from the Rust core.
fn by_the_core() -> String {
    let (omega_0, zeta, amplitude) = (55.39, 0.005, 1e-4);
    let config = Config {
        amplitude_max: Some(4.0 * amplitude),
        response_max: Some(0.1),
        omega_start: 0.98 * omega_0,
        ..Config::for_resonance(omega_0, amplitude)
    };
    let controller = config.build().unwrap();
    let mut state = controller.start();
    let mut text = String::new();
    let (mut q, mut v, mut drive, mut response) = (0.0_f64, 0.0_f64, 0.0, 0.0);
    for n in 0..60_000 {
        if n == 50_000 {
            let (response, amplitude) = (0.5 * response, -0.5 * amplitude);
            let to = Move { response, duration: 1.0, amplitude, ..Move::default() };
            controller.hold_response(&mut state, to).unwrap();
        }
        let input = Input { response: q, reference: Some(drive), active: true };
        let output: Output = controller.process(&mut state, input);
        (drive, response) = (output.drive, output.response_amplitude);
        let h = config.sample_time;
        v += h * (omega_0 * omega_0 * (drive - q) - 2.0 * zeta * omega_0 * v);
        q += h * v;
        if n % 500 == 499 {
            let numbers = [output.omega, output.amplitude, output.phase_error.unwrap_or(0.0)];
            let [omega, amplitude, error] = numbers.map(f64::to_bits);
            writeln!(
                text,
                "{n} {omega:016x} {amplitude:016x} {error:016x} {}",
                output.state as u8
            )
            .unwrap();
        }
    }
    text + "5 1\n" + "1 omega_max = 66.468 rad/s is refused; allowed is a finite number above omega_min\n" + "-1\n"
}

/// What tests/resonator.c prints with a library of these features.
fn by_the_library(features: &str, define: &str) -> String {
    let folder = tempfile::tempdir().unwrap();
    let library = static_library(&folder.path().join("target"), features);
    let program = folder.path().join("resonator");
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut cc = Command::new("cc");
    cc.args([
        "-std=c99",
        "-Wall",
        "-Wextra",
        "-Werror",
        "-O2",
        "-ffp-contract=off",
        define,
        "-I",
    ]);
    cc.arg(here.join("include"))
        .arg(here.join("tests/resonator.c"))
        .arg(library);
    run(cc.args(["-lm", "-Wl,--gc-sections", "-o"]).arg(&program));
    run(&mut Command::new(program))
}

#[test]
fn a_c_program_locks_a_resonator_with_the_bits_of_the_core() {
    let printed = by_the_library("", "-DDOUBLE");
    let expected = by_the_core();
    assert_eq!(
        printed.lines().collect::<Vec<_>>(),
        expected.lines().collect::<Vec<_>>()
    );
    // It did lock, and held its response at half.
    let locked = printed.lines().filter(|line| line.ends_with(" 3")).count();
    assert!(locked > 40, "{locked}");
}

#[test]
fn a_c_program_in_single_precision_locks_the_resonator_at_the_same_frequency() {
    let omegas = |printed: &str| -> Vec<f64> {
        let lines = printed.lines().filter(|line| line.ends_with(" 3"));
        let bits = lines.map(|line| u64::from_str_radix(line.split(' ').nth(1).unwrap(), 16).unwrap());
        bits.map(f64::from_bits).collect()
    };
    let (single, double) = (
        omegas(&by_the_library("f32", "-DPHASE_LOCK_F32")),
        omegas(&by_the_core()),
    );
    assert_eq!(single.len(), double.len());
    assert!(
        single
            .iter()
            .zip(&double)
            .all(|(single, double)| (single / double - 1.0).abs() < 1e-6)
    );
}
