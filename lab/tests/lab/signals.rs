//! Guards the end upon a signal: of every command, with FMUs and devices that do not answer, and whether the drive is zero then.

use std::fs::{self, File};
use std::io::{self, Write};
use std::net::UdpSocket;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use zip::ZipWriter;
use zip::write::SimpleFileOptions;

use crate::{Running, text, wait_for_rows, words};

/// Waits for a condition; a generous time catches a program that hangs.
fn wait_until(what: &str, is_there: impl Fn() -> bool) {
    let began = Instant::now();
    while !is_there() {
        assert!(began.elapsed() < Duration::from_secs(120), "{what}");
        sleep(Duration::from_millis(10));
    }
}

impl Running {
    /// Waits until it catches signals.
    fn catches(&self) {
        let tasks = format!("/proc/{}/task", self.0.id());
        let is_name = |name: io::Result<String>| name.is_ok_and(|name| name.trim() == "signals");
        wait_until("no thread waits for signals", || {
            let tasks = fs::read_dir(&tasks).into_iter().flatten().flatten();
            let mut names = tasks.map(|task| fs::read_to_string(task.path().join("comm")));
            names.any(is_name)
        });
    }

    /// What is left of it after a signal.
    fn ended_by(self, signal: &str) -> Output {
        let mut running = self;
        running.signal(signal);
        running.output()
    }
}

/// An FMU of a source in tests/foreign, with options of the compiler; `variables`: name, causality and type.
fn foreign(folder: &Path, name: &str, options: &str, variables: &[(&str, &str, &str)]) -> PathBuf {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../tests/foreign/{name}.c"));
    let library = folder.join(format!("{name}.so"));
    let mut compiler = Command::new("cc");
    compiler
        .args(["-O1", "-shared", "-fPIC", "-o"])
        .args([&library, &source]);
    assert!(compiler.args(words(options)).arg("-lm").status().unwrap().success());
    let mut rows = String::new();
    for (n, (name, causality, kind)) in variables.iter().enumerate() {
        let start = match *causality {
            "input" if *kind == "Boolean" => " start=\"false\"",
            "input" => " start=\"0\"",
            _ => "",
        };
        rows += &format!(
            "<ScalarVariable name=\"{name}\" valueReference=\"{n}\" causality=\"{causality}\"><{kind}{start}/></ScalarVariable>"
        );
    }
    let description = format!(
        "<fmiModelDescription fmiVersion=\"2.0\" modelName=\"{name}\" guid=\"{name}\">\
         <CoSimulation modelIdentifier=\"{name}\" canHandleVariableCommunicationStepSize=\"true\"/>\
         <ModelVariables>{rows}</ModelVariables><ModelStructure/></fmiModelDescription>"
    );
    let path = folder.join(format!("{name}.fmu"));
    let mut archive = ZipWriter::new(File::create(&path).unwrap());
    for (file, content) in [
        ("modelDescription.xml".to_owned(), description.into_bytes()),
        (format!("binaries/linux64/{name}.so"), fs::read(library).unwrap()),
    ] {
        archive.start_file(file, SimpleFileOptions::default()).unwrap();
        archive.write_all(&content).unwrap();
    }
    archive.finish().unwrap();
    path
}

const CONTROLLER: [(&str, &str, &str); 6] = [
    ("response", "input", "Real"),
    ("reference", "input", "Real"),
    ("active", "input", "Boolean"),
    ("omega", "output", "Real"),
    ("E", "output", "Real"),
    ("phase_error", "output", "Real"),
];
const RIG: [(&str, &str, &str); 4] = [
    ("omega", "input", "Real"),
    ("E", "input", "Real"),
    ("v", "output", "Real"),
    ("base", "output", "Real"),
];

#[test]
fn every_command_that_waits_ends_with_the_code_of_the_signal() {
    let folder = tempfile::tempdir().unwrap();
    let pipe = folder.path().join("scene.toml");
    assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    // Nobody writes the scene.
    let commands = "identify, backbone, check, orbit, orbit --response, structure, theory, map, report, fit points.csv, rig --listen 127.0.0.1:0, \
                    controller --listen 127.0.0.1:0";
    for (n, command) in commands.split(", ").enumerate() {
        let (signal, name, code) = [("INT", "SIGINT", 130), ("TERM", "SIGTERM", 143), ("HUP", "SIGHUP", 129)][n % 3];
        let line = format!("{command} --scene {}", pipe.display());
        let program = Running::start_with_default_signals(&words(&line));
        program.catches();
        let ended = program.ended_by(signal);
        assert_eq!(ended.status.code(), Some(code), "{command}: {ended:?}");
        assert_eq!(text(&ended), format!("error: interrupted by {name}\n"), "{command}");
    }
}

#[test]
fn a_signal_ends_a_program_whose_messages_nobody_reads() {
    let folder = tempfile::tempdir().unwrap();
    let pipe = folder.path().join("scene.toml");
    assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    let mut program = Running::start_with_default_signals(&words(&format!("theory --scene {}", pipe.display())));
    program.catches();
    drop(program.0.stderr.take());
    program.signal("TERM");
    let began = Instant::now();
    let code = loop {
        if let Some(status) = program.0.try_wait().unwrap() {
            break status.code();
        }
        assert!(began.elapsed() < Duration::from_secs(120), "it does not end");
        sleep(Duration::from_millis(10));
    };
    assert_eq!(code, Some(143));
}

#[test]
fn a_map_and_servers_end_at_the_first_signal() {
    let long = "--x sigma=-5:5:2000 --y G=0.1:3:2000";
    let folder = tempfile::tempdir().unwrap();
    let made = folder.path().join("made");
    let out = made.join("out");
    let map = Running::start(&words(&format!("map {long} --out {}", out.display())));
    wait_until("no folder for the results", || out.join(".vines.lock").exists());
    let ended = map.ended_by("TERM");
    assert_eq!(ended.status.code(), Some(143), "{ended:?}");
    assert!(!made.exists());
    for (server, signal, code) in [
        ("rig", "INT", 130),
        ("rig --lock-step", "TERM", 143),
        ("controller", "INT", 130),
    ] {
        let mut program = Running::start(&words(&format!("{server} --listen 127.0.0.1:0")));
        program.word();
        let ended = program.ended_by(signal);
        assert_eq!(ended.status.code(), Some(code), "{server}: {ended:?}");
        assert_eq!(text(&ended), "", "{server}");
    }
}

/// Runs an experiment until an FMU hangs, ends it with a signal, and returns its output and whether the drive of rig.c became zero.
fn hung(line: &str, folder: &Path, signal: &str) -> (Output, bool) {
    let [hangs, zeroed, unpacked] = ["hangs", "zeroed", "unpacked"].map(|name| folder.join(name));
    fs::create_dir(&unpacked).unwrap();
    let place = tempfile::tempdir().unwrap();
    let mut command = Command::new(crate::PROGRAM);
    command.args(words(line)).current_dir(place.path());
    command.envs([("HANGS", &hangs), ("ZEROED", &zeroed), ("TMPDIR", &unpacked)]);
    command.stdout(Stdio::piped()).stderr(Stdio::piped());
    let program = Running(command.spawn().unwrap(), place);
    wait_until("no FMU hangs", || hangs.exists());
    let ended = program.ended_by(signal);
    assert_eq!(fs::read_dir(&unpacked).unwrap().count(), 0, "temporary files are left");
    (ended, zeroed.exists())
}

#[test]
fn an_fmu_that_hangs_and_ignores_signals_does_not_keep_the_program_and_zero_is_commanded_where_the_rig_answers() {
    let no = "; zero could not be commanded, because the rig does not answer: switch the drive off at the rig";
    let deaf = Some("-DHANG=900 -DDEAF");
    for (rig, controller, signal, code, message) in [
        // The rig answers, and the controller does not.
        (Some(""), Some("-DHANG=900"), "INT", 130, "SIGINT; the drive is zero"),
        (Some(""), deaf, "TERM", 143, "SIGTERM; the drive is zero"),
        (None, deaf, "INT", 130, "SIGINT\n"),
        (Some("-DHANG=900"), None, "INT", 130, no),
        (Some("-DHANG=900"), Some("-DDEAF"), "TERM", 143, no),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let fmu = |name, options: Option<&str>, variables| match options {
            Some(options) => foreign(folder.path(), name, options, variables).display().to_string(),
            None => "built-in".into(),
        };
        let (rig, controller) = (fmu("rig", rig, &RIG), fmu("controller", controller, &CONTROLLER));
        let line = format!("identify --no-check --rig {rig} --controller {controller}");
        let (ended, zeroed) = hung(&line, folder.path(), signal);
        assert_eq!(ended.status.code(), Some(code), "{line}: {ended:?}");
        assert!(text(&ended).contains(message), "{message}: {ended:?}");
        assert_eq!(zeroed, message.contains("the drive is zero"), "{line}");
    }
}

#[test]
fn a_rig_that_falls_silent_does_not_keep_the_program_which_says_that_zero_could_not_be_commanded() {
    let folder = tempfile::tempdir().unwrap();
    let record = folder.path().join("run.csv");
    let mut rig = Running::start(&words("rig --lock-step --silence 30 --listen 127.0.0.1:0"));
    let (address, out) = (rig.word(), folder.path().join("out"));
    let line = format!(
        "identify --set=record.hold_periods=20000 --rig {address} --out {} --record {}",
        out.display(),
        record.display()
    );
    let client = Running::start(&words(&line));
    wait_for_rows(&record, 1000);
    rig.signal("STOP");
    let ended = client.ended_by("TERM");
    assert_eq!(ended.status.code(), Some(143), "{ended:?}");
    let said = "zero could not be commanded, because the rig does not answer";
    assert!(text(&ended).contains(said), "{ended:?}");
}

#[test]
fn a_rig_across_the_network_that_never_answers_does_not_keep_the_program() {
    // It never answers; the system accepts the connection.
    let tcp = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let udp = UdpSocket::bind("127.0.0.1:0").unwrap();
    for address in [
        format!("tcp://{}", tcp.local_addr().unwrap()),
        format!("udp://{}", udp.local_addr().unwrap()),
        format!("helic://{}", tcp.local_addr().unwrap()),
    ] {
        for command in ["identify", "backbone", "check"] {
            let program = Running::start(&words(&format!("{command} --rig {address}")));
            program.catches();
            let ended = program.ended_by("INT");
            assert_eq!(ended.status.code(), Some(130), "{command} {address}: {ended:?}");
        }
    }
}
