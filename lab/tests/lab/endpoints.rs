//! Guards rigs and controllers behind every endpoint (built in, FMU, network), as users of the program meet them: identified numbers agree,
//! refusals name their reason, the loop check stops a rig that is wired wrongly, and servers end in order.

use std::path::Path;
use std::process::Output;
use std::sync::LazyLock;

use serde_json::Value;
use tempfile::TempDir;

use crate::{PROGRAM, Running, fails, is_failure, text, vines, wait_for_rows, words};

/// The two FMUs, packed once, with the libraries that cargo builds because this package depends on them.
static FMUS: LazyLock<TempDir> = LazyLock::new(|| {
    let libraries = Path::new(PROGRAM).with_file_name("deps");
    let folder = tempfile::tempdir().unwrap();
    let (out, libraries) = (folder.path().to_str().unwrap(), libraries.to_str().unwrap());
    let packed = vines(&format!("pack --out {out} --libraries {libraries}"));
    assert!(packed.status.success(), "{packed:?}");
    folder
});

/// The paths of plant and controller as FMUs.
pub fn fmus() -> [String; 2] {
    ["LoViNes.fmu", "PhaseLock.fmu"].map(|name| FMUS.path().join(name).display().to_string())
}

/// The default scene at twice its frequency, which locks and decays in a few seconds of real time.
const QUICK: [&str; 8] = [
    "plant.k=46720",
    "plant.c=5.06",
    "start.dq2=1.0",
    "controller.samples_per_period=50",
    "controller.bandwidth=0.3",
    "phase_lock.lock.amplitude_drift=1.5e-4",
    "record.hold_periods=10",
    "record.decay_periods=25",
];

/// The quickest backbone.
const FEW: &str = "--set=backbone.points=3 --set=backbone.C_to=0.6";

/// The words of a command line, with the quick settings before its own.
fn quick(line: &str) -> Vec<&str> {
    let mut words = words(line);
    words.splice(1..1, QUICK.iter().flat_map(|setting| ["--set", setting]));
    words
}

/// Runs an experiment, with its results in a folder that is removed.
fn run(line: &str) -> Output {
    let folder = tempfile::tempdir().unwrap();
    let line = format!("{line} --out {}", folder.path().display());
    Running::start(&quick(&line)).output()
}

fn json(done: &Output) -> Value {
    serde_json::from_slice(&done.stdout).unwrap_or_else(|error| panic!("{error}: {done:?}"))
}

/// What is identified with some endpoints.
fn identified(endpoints: &str) -> Value {
    let done = run(&format!("identify --json {endpoints}"));
    assert!(done.status.success(), "{endpoints}: {done:?}");
    let found = json(&done);
    println!("sigma = {} with {endpoints}", found["lock"]["sigma"]);
    found
}

fn sigma(found: &Value) -> f64 {
    found["lock"]["sigma"].as_f64().unwrap()
}

/// A server, with its address.
struct Server(Running, String);

impl Server {
    fn start(line: &str) -> Self {
        Self::with_fault(line, None)
    }

    fn with_fault(line: &str, fault: Option<&str>) -> Self {
        let line = format!("{line} --listen 127.0.0.1:0 --sessions 1 --duration 60");
        let mut words = quick(&line);
        words.extend(fault.iter().flat_map(|fault| ["--fault", fault]));
        let mut server = Running::start(&words);
        let address = server.word();
        assert!(address.contains("://127.0.0.1:"), "{address}");
        Self(server, address)
    }

    /// What it has printed since, once it has ended.
    fn report(self) -> String {
        let output = self.0.output();
        assert!(output.status.success(), "{output:?}");
        String::from_utf8(output.stdout).unwrap()
    }
}

#[test]
fn built_in_fmu_and_lock_step_network_give_the_same_bits() {
    let [plant, controller] = fmus();
    // From rest, the response is held and moved until the motion impacts.
    let sensors = "--set=resonance.sensor='q1' --set=resonance.sensor_quantity='acceleration' --set=resonance.reference='force' --set=start.dq2=0";
    let sensors = format!("{sensors} --set=phase_lock.harmonics=4 --set=phase_lock.base_bandwidth=0.5");
    let results = ["", &sensors].map(|settings| {
        let with = |endpoints: &str| identified(&format!("{endpoints} {settings}"));
        let direct = with("--rig built-in");
        assert_eq!(with(&format!("--rig {plant}")), direct);
        assert_eq!(with(&format!("--rig built-in --controller {controller}")), direct);
        let rig = Server::start(&format!("rig --lock-step {settings}"));
        let peer = Server::start(&format!("controller {settings}"));
        assert_eq!(with(&format!("--rig {} --controller {}", rig.1, peer.1)), direct);
        for server in [rig, peer] {
            let report = server.report();
            assert!(report.contains("ended by the client"), "{report}");
        }
        sigma(&direct)
    });
    assert_ne!(results[0], results[1]);
}

#[test]
fn a_structure_with_a_shaker_gives_the_same_bits_across_the_network() {
    let scene = concat!(
        "--scene ",
        env!("CARGO_MANIFEST_DIR"),
        "/../scenes/shaker-cantilever.toml"
    );
    let identified = |rig: &str| {
        let folder = tempfile::tempdir().unwrap();
        let line = format!("identify --json {scene} --rig {rig}");
        let done = vines(&format!("{line} --out {}", folder.path().display()));
        assert!(done.status.success(), "{done:?}");
        json(&done)
    };
    let serve = format!("rig {scene} --lock-step --listen 127.0.0.1:0 --sessions 1 --duration 120");
    let mut server = Running::start(&words(&serve));
    let address = server.word();
    assert_eq!(identified(&address), identified("built-in"));
    assert!(server.output().status.success());
}

#[test]
fn a_rig_in_real_time_gives_the_same_sigma_within_5e_3() {
    let direct = identified("--rig built-in");
    let rig = Server::start("rig --json --silence 5");
    let done = run(&format!("identify --json --rig {}", rig.1));
    let report: Value = serde_json::from_str(&rig.report()).unwrap();
    println!("{report}");
    assert_eq!(report["ended"], "farewell");
    let classes = report["histogram"].as_array().unwrap();
    let counted: u64 = classes.iter().map(|class| class[1].as_u64().unwrap()).sum();
    assert_eq!(report["samples"].as_u64(), Some(counted));
    // The client prints what its rig missed, and its exit code depends on it.
    let [missed, held] = [&report["timing"]["missed"], &report["counters"]["held"]];
    let late = missed.as_u64().max(held.as_u64()).unwrap();
    let (message, code) = (text(&done), done.status.code());
    assert!([Some(0), Some(3)].contains(&code), "{message}");
    // On a machine that is too busy for it, the results are doubtful.
    assert!(
        code == Some(3) || (sigma(&json(&done)) - sigma(&direct)).abs() < 5e-3,
        "{message}"
    );
    assert!(late > 0 || code == Some(0), "{message}");
    let few = late * 90 < counted;
    assert!(few || code == Some(3), "{late} of {counted}, {code:?}: {message}");
    let is_doubtful = message.contains("these results are doubtful");
    assert_eq!(code == Some(3), is_doubtful, "{message}");
}

#[test]
#[ignore = "open: at a cut-off of 5 G is 6e-4 low (on the default scene 8.0e-4, and 2.0e-3 at 4)"]
fn the_gain_of_an_anti_alias_filter_is_corrected_across_the_network_as_built_in() {
    // The drive is G = 1.1. Clients whose scene does not have the filter, and clients whose scene has it.
    for (cut_off, is_known) in [("5", false), ("5", true), ("4", false), ("4", true)] {
        let filter = format!("--set=chain.filter={cut_off}");
        let own = if is_known { &*filter } else { "" };
        let rig = Server::start(&format!("rig --lock-step --sensors-only {filter}"));
        let far = identified(&format!("--rig {} {own}", rig.1));
        let direct = identified(&format!("--rig built-in {filter}"));
        let [far, direct] = [far, direct].map(|found| ["G", "C"].map(|key| found["lock"][key].as_f64().unwrap()));
        println!("cut-off {cut_off}, {own}: G and C are {far:?}, built-in {direct:?}");
        assert!(
            (far[0] - 1.1).abs() < 2e-4 && (far[1] - direct[1]).abs() < 2e-4,
            "{far:?}, {direct:?}"
        );
    }
}

#[test]
fn measured_points_of_another_rig_end_with_the_parameters_that_fit_instead() {
    let few = "backbone --set=backbone.points=6 --set=backbone.C_to=0.4";
    for (command, line) in [
        ("identify", "the locked point does not belong to this scene"),
        (few, "the points do not belong to this scene: "),
    ] {
        let other = Server::start("rig --lock-step --sensors-only --set=plant.r=0.58");
        let done = run(&format!("{command} --rig {}", other.1));
        let text = String::from_utf8_lossy(&done.stdout);
        let mut lines = text.lines();
        let has_advice = lines.any(|printed| printed.starts_with(line) && printed.ends_with("`vines fit`"));
        assert!(has_advice, "{text}");
    }
}

#[test]
fn a_backbone_without_a_single_nonlinear_point_is_a_failure_and_is_told_without_a_particle() {
    for (check, part) in [("", "near the linear response"), ("--no-check", "is not established")] {
        // The cavity is too wide for the particle to reach its walls.
        let rig = Server::start("rig --lock-step --sensors-only --set=plant.b=1");
        let done = run(&format!("backbone --rig {} {FEW} {check}", rig.1));
        let table = String::from_utf8_lossy(&done.stdout);
        assert_eq!(done.status.code(), Some(1), "{done:?}");
        assert!(String::from_utf8_lossy(&done.stderr).contains(part), "{done:?}");
        let told = table.to_string() + &String::from_utf8_lossy(&done.stderr);
        assert!(table.contains("3 points"), "{table}");
        for word in ["1:1", "impact", "particle", "sigma", "regime", "theory", "exact"] {
            assert!(!told.contains(word), "{word}: {told}");
        }
    }
}

#[test]
fn endpoints_addresses_and_options_without_sense_are_refused_with_the_reason() {
    let folder = tempfile::tempdir().unwrap();
    let [short, key] = ["short", "key"].map(|name| folder.path().join(name).display().to_string());
    std::fs::write(&short, "secret\n").unwrap();
    std::fs::write(&key, "0123456789abcdef\n").unwrap();
    let [plant, controller] = fmus();
    // An FMU of the other side lacks a variable, which is named. Nothing leaves this machine without permission.
    for (line, code, reason) in [
        ("identify --rig no-such.fmu", 2, "udp://HOST:PORT"),
        ("identify --rig udp://127.0.0.1", 2, "HOST:PORT"),
        ("identify --rig built-in --controller http://127.0.0.1:1", 2, "tcp://"),
        ("identify --rig built-in --controller udp://127.0.0.1:1", 2, "tcp://"),
        ("identify --rig CONTROLLER", 1, "no variable `e`"),
        ("identify --rig built-in --controller PLANT", 1, "`response`"),
        ("identify --rig helic://127.0.0.1 --key KEY", 2, "no authentication"),
        ("identify --rig helic://127.0.0.1:1", 1, "vines rig --protocol helic"),
        ("identify --rig helic://192.0.2.1", 2, "--allow-remote"),
        ("identify --rig udp://192.0.2.1:5510", 2, "--allow-remote"),
        ("rig --listen 0.0.0.0:0", 2, "--allow-remote"),
        ("controller --listen [::]:0", 2, "--allow-remote"),
        ("rig LOCAL --protocol helic --lock-step", 2, "its own clock"),
        ("rig LOCAL --protocol helic --key KEY", 2, "no authentication"),
        ("rig LOCAL --key SHORT", 2, "16 bytes"),
        ("rig LOCAL --key no-such-file", 2, "no-such-file"),
        ("rig LOCAL --rig udp://127.0.0.1:1", 2, "can be served"),
    ] {
        let line = line.replace("LOCAL", "--listen 127.0.0.1:0");
        let line = line.replace("PLANT", &plant).replace("CONTROLLER", &controller);
        fails(&line.replace("SHORT", &short).replace("KEY", &key), code, reason);
    }
}

#[cfg(unix)]
#[test]
fn a_signal_during_an_experiment_zeroes_the_drive_and_keeps_what_was_measured() {
    // Recorded samples tell that the rig is driven, or that points of the backbone are measured. A later signal finds it so, too.
    let long = "identify --set=record.hold_periods=20000";
    let many = "backbone --set=backbone.C_from=0.6 --set=backbone.C_to=0.58 --set=backbone.points=2000";
    let (zero, kept, step) = (
        "interrupted by a signal; the drive is zero",
        "points were measured before",
        "--lock-step --silence 30",
    );
    for (mode, command, (signal, code), samples, part) in [
        ("--silence 5", long, ("INT", 130), 1000, zero),
        (step, long, ("TERM", 143), 1000, "interrupted"),
        // Between two points of a backbone, the points are kept.
        (step, many, ("INT", 130), 20_000, kept),
    ] {
        let rig = Server::start(&format!("rig --json {mode}"));
        let [folder, other] = [(); 2].map(|()| tempfile::tempdir().unwrap());
        let (out, record) = (folder.path().display(), other.path().join("run.csv"));
        let line = format!("{command} --out {out} --rig {} --record {}", rig.1, record.display());
        let mut client = Running::start(&quick(&line));
        wait_for_rows(&record, samples);
        client.signal(signal);
        let output = client.output();
        assert_eq!(output.status.code(), Some(code), "{output:?}");
        assert!(text(&output).contains(part), "{output:?}");
        if command == long {
            // What was measured is kept; the temporary folder of the FMUs is not.
            let left = std::fs::read_dir(folder.path()).unwrap();
            let left: Vec<_> = left.map(|entry| entry.unwrap().file_name()).collect();
            assert_eq!(left, ["interrupted.csv"]);
        }
        let report: Value = serde_json::from_str(&rig.report()).unwrap();
        assert_eq!(report["ended"], "farewell");
    }
}

#[test]
fn a_rig_with_a_fault_ends_identify_and_backbone_with_its_reason() {
    let [exchanged, reversed] = ["response and base are exchanged", "has the opposite sign"];
    let unexpected = "the amplitude of the response is not as expected";
    // The first faults are there at the loop check, which drives a hundredth of the drive.
    for (command, fault, part) in [
        ("identify", "sensors swapped@0.001", exchanged),
        ("backbone", "response sensor reversed@0.001", reversed),
        ("identify", "response sensor x 3@0.001", unexpected),
        ("identify", "response sensor dead@0.001", "the response does not answer"),
        ("backbone", "base sensor dead@0.001", "the base sensor does not answer"),
        ("backbone", "response sensor dead@6", "a sensor, the drive"),
    ] {
        let rig = Server::with_fault("rig --lock-step --sensors-only", Some(fault));
        is_failure(&run(&format!("{command} --rig {}", rig.1)), 1, part);
        assert!(rig.report().contains("ended by the client"));
    }
}
