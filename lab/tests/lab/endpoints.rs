//! Guards rigs and controllers behind every endpoint (built in, FMU, network), as users of the program meet them: identified numbers agree,
//! refusals name their reason, the loop check stops a rig that is wired wrongly, and servers end in order.

use std::env::consts::DLL_SUFFIX;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::LazyLock;

use serde_json::Value;
use tempfile::TempDir;

use crate::{PROGRAM, fails, vines};

/// The two FMUs, packed once, with the libraries that cargo builds because this package depends on them.
static FMUS: LazyLock<TempDir> = LazyLock::new(|| {
    let libraries = Path::new(PROGRAM).with_file_name("deps");
    let folder = tempfile::tempdir().unwrap();
    let (out, libraries) = (folder.path().to_str().unwrap(), libraries.to_str().unwrap());
    let packed = vines(&["pack", "--out", out, "--libraries", libraries]);
    assert!(packed.status.success(), "{DLL_SUFFIX}: {packed:?}");
    folder
});

fn fmu(name: &str) -> PathBuf {
    FMUS.path().join(name)
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

fn with_settings<'a>(arguments: &[&'a str]) -> Vec<&'a str> {
    let settings = QUICK.iter().flat_map(|setting| ["--set", setting]);
    arguments.iter().copied().chain(settings).collect()
}

fn identified(endpoints: &[&str]) -> Value {
    let folder = tempfile::tempdir().unwrap();
    let out = ["identify", "--json", "--out", folder.path().to_str().unwrap()];
    let done = vines(&with_settings(&[&out, endpoints].concat()));
    assert!(done.status.success(), "{endpoints:?}: {done:?}");
    let found: Value = serde_json::from_slice(&done.stdout).unwrap();
    println!("sigma = {} with {endpoints:?}", found["lock"]["sigma"]);
    found
}

fn sigma(found: &Value) -> f64 {
    found["lock"]["sigma"].as_f64().unwrap()
}

/// A server in a process of its own, with its address; it ends by itself, or where this is dropped.
struct Server(Child, String);

impl Server {
    fn start(arguments: &[&str]) -> Self {
        let listen = ["--listen", "127.0.0.1:0", "--sessions", "1", "--duration", "60"];
        let mut child = Command::new(PROGRAM)
            .args(with_settings(&[arguments, &listen].concat()))
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut line = String::new();
        BufReader::with_capacity(1, child.stdout.as_mut().unwrap())
            .read_line(&mut line)
            .unwrap();
        let address = line.trim().rsplit(' ').next().unwrap().to_string();
        assert!(address.contains("://127.0.0.1:"), "{line}");
        Self(child, address)
    }

    /// What it has printed since, once it has ended.
    fn report(mut self) -> String {
        let stdout = self.0.stdout.take().unwrap();
        let report = std::io::read_to_string(stdout).unwrap();
        assert!(self.0.wait().unwrap().success());
        report
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[test]
fn built_in_fmu_and_lock_step_network_give_the_same_bits() {
    let (plant, controller) = (fmu("LoViNes.fmu"), fmu("PhaseLock.fmu"));
    let (plant, controller) = (plant.to_str().unwrap(), controller.to_str().unwrap());
    let sensors = [
        "--set=resonance.sensor='acceleration'",
        "--set=resonance.reference='force'",
    ];
    let mut results = Vec::new();
    for settings in [&[][..], &sensors] {
        let with = |endpoints: &[&str]| identified(&[endpoints, settings].concat());
        let direct = with(&["--rig", "built-in"]);
        assert_eq!(with(&["--rig", plant]), direct);
        assert_eq!(with(&["--rig", "built-in", "--controller", controller]), direct);
        let rig = Server::start(&[&["rig", "--lock-step"], settings].concat());
        let peer = Server::start(&["controller"]);
        assert_eq!(with(&["--rig", &rig.1, "--controller", &peer.1]), direct);
        for server in [rig, peer] {
            let report = server.report();
            assert!(report.contains("ended by the client"), "{report}");
        }
        results.push(sigma(&direct));
    }
    assert_ne!(results[0], results[1]);
}

#[test]
fn a_rig_in_real_time_gives_the_same_sigma_within_5e_3() {
    let direct = identified(&["--rig", "built-in"]);
    let rig = Server::start(&["rig", "--json", "--silence", "5"]);
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().to_str().unwrap();
    let arguments = ["identify", "--json", "--out", out, "--rig", &rig.1];
    let done = vines(&with_settings(&arguments));
    let found: Value = serde_json::from_slice(&done.stdout).unwrap();
    assert!((sigma(&found) - sigma(&direct)).abs() < 5e-3);
    let report: Value = serde_json::from_str(&rig.report()).unwrap();
    println!("{report}");
    assert_eq!(report["ended"], "farewell");
    let classes = report["histogram"].as_array().unwrap();
    let counted: u64 = classes.iter().map(|class| class[1].as_u64().unwrap()).sum();
    assert_eq!(report["samples"].as_u64(), Some(counted));
    // The client prints what its rig missed, and its exit code depends on it.
    let late = report["timing"]["missed"]
        .as_u64()
        .max(report["counters"]["held"].as_u64())
        .unwrap();
    let (message, code) = (String::from_utf8_lossy(&done.stderr), done.status.code());
    assert!([Some(0), Some(3)].contains(&code), "{message}");
    assert!(late > 0 || code == Some(0), "{message}");
    assert!(
        late * 90 < counted || code == Some(3),
        "{late} of {counted}, {code:?}: {message}"
    );
    assert_eq!(
        code == Some(3),
        message.contains("these results are doubtful"),
        "{message}"
    );
}

#[test]
fn from_a_rig_that_shows_its_sensors_only_and_is_at_rest_lock_and_backbone_are_the_exact_ones() {
    let direct = identified(&["--rig", "built-in"]);
    let rig = || Server::start(&["rig", "--lock-step", "--sensors-only"]);
    let first = rig();
    assert!((sigma(&identified(&["--rig", &first.1])) - sigma(&direct)).abs() < 2e-3);
    // A controller at a network address learns that the rig is at rest.
    let (again, peer) = (rig(), Server::start(&["controller"]));
    let far = identified(&["--rig", &again.1, "--controller", &peer.1]);
    assert!((sigma(&far) - sigma(&direct)).abs() < 2e-3);
    let (second, folder) = (rig(), tempfile::tempdir().unwrap());
    let few = ["--set=backbone.points=3", "--set=backbone.C_to=0.6"];
    let arguments = ["backbone", "--json", "--out", folder.path().to_str().unwrap()];
    let done = vines(&with_settings(&[&arguments[..], &few, &["--rig", &second.1]].concat()));
    let found: Value = serde_json::from_slice(&done.stdout).unwrap();
    assert_eq!(done.status.code(), Some(0));
    let error = |point: &Value| point["exact"]["sigma"].as_f64().unwrap().abs();
    let errors: Vec<f64> = found["points"].as_array().unwrap().iter().map(error).collect();
    assert!(
        errors.len() == 3 && errors.iter().all(|error| *error < 2e-3),
        "{errors:?}"
    );
}

#[test]
fn measured_points_of_another_rig_end_with_the_parameters_that_fit_instead() {
    let folder = tempfile::tempdir().unwrap();
    let out = ["--out", folder.path().to_str().unwrap()];
    let few = ["--set=backbone.points=6", "--set=backbone.C_to=0.4"];
    for (arguments, line) in [
        (&["identify"][..], "the locked point does not belong to this scene"),
        (
            &[&["backbone"][..], &few].concat(),
            "the points do not belong to this scene: ",
        ),
    ] {
        let other = Server::start(&["rig", "--lock-step", "--sensors-only", "--set=plant.r=0.58"]);
        let done = vines(&with_settings(&[arguments, &["--rig", &other.1], &out].concat()));
        let text = String::from_utf8_lossy(&done.stdout).into_owned();
        let last = text.lines().last().unwrap_or_default();
        assert!(last.starts_with(line) && last.ends_with("`vines fit`"), "{text}");
    }
}

#[test]
fn a_backbone_without_a_single_impact_is_a_failure() {
    // The cavity is too wide for the particle to reach its walls.
    let wide = ["--set=plant.b=1"];
    for (check, part) in [(&[][..], "without impacts"), (&["--no-check"], "is not established")] {
        let rig = Server::start(&[&["rig", "--lock-step", "--sensors-only"], &wide[..]].concat());
        let out = tempfile::tempdir().unwrap();
        let few = ["--set=backbone.points=3", "--set=backbone.C_to=0.6"];
        let arguments = ["backbone", "--out", out.path().to_str().unwrap(), "--rig", &rig.1];
        let done = vines(&with_settings(&[&arguments[..], &few, check].concat()));
        let [table, message] = [&done.stdout, &done.stderr].map(|text| String::from_utf8_lossy(text).into_owned());
        assert_eq!(done.status.code(), Some(1), "{message}");
        assert!(message.contains(part), "{message}");
        assert!(table.contains("3 points") && !table.contains("1:1"), "{table}");
    }
}

#[test]
fn an_address_without_sense_is_refused_with_the_form_that_is_needed() {
    fails(&["identify", "--rig", "no-such.fmu"], 2, "udp://HOST:PORT");
    let controller = |address| ["identify", "--rig", "built-in", "--controller", address];
    fails(&controller("http://127.0.0.1:1"), 2, "tcp://HOST:PORT");
    fails(&controller("udp://127.0.0.1:1"), 2, "tcp://HOST:PORT");
    fails(&["identify", "--rig", "udp://127.0.0.1"], 2, "HOST:PORT");
}

#[test]
fn an_fmu_of_the_other_side_lacks_a_variable_which_is_named() {
    let (plant, controller) = (fmu("LoViNes.fmu"), fmu("PhaseLock.fmu"));
    fails(&["identify", "--rig", controller.to_str().unwrap()], 1, "`v`");
    let arguments = ["identify", "--rig", "built-in", "--controller", plant.to_str().unwrap()];
    fails(&arguments, 1, "`response`");
}

#[test]
fn nothing_leaves_this_machine_without_permission() {
    for arguments in [
        ["rig", "--listen", "0.0.0.0:0"],
        ["controller", "--listen", "[::]:0"],
        ["identify", "--rig", "udp://192.0.2.1:5510"],
    ] {
        fails(&arguments, 2, "--allow-remote");
    }
}

#[test]
fn combinations_that_do_not_exist_say_why() {
    let folder = tempfile::tempdir().unwrap();
    let [short, key] = ["short", "key"].map(|name| folder.path().join(name).to_str().unwrap().to_owned());
    std::fs::write(&short, "secret\n").unwrap();
    std::fs::write(&key, "0123456789abcdef\n").unwrap();
    let rig = ["rig", "--listen", "127.0.0.1:0"];
    for (options, reason) in [
        (&["--protocol", "helic", "--lock-step"][..], "its own clock"),
        (&["--protocol", "helic", "--key", &key], "no authentication"),
        (&["--key", &short], "16 bytes"),
        (&["--key", "no-such-file"], "no-such-file"),
        (&["--rig", "udp://127.0.0.1:1"], "can be served"),
    ] {
        fails(&[&rig[..], options].concat(), 2, reason);
    }
    fails(
        &["identify", "--rig", "helic://127.0.0.1", "--key", &key],
        2,
        "no authentication",
    );
    fails(&["identify", "--rig", "helic://192.0.2.1"], 2, "--allow-remote");
    fails(
        &["identify", "--rig", "helic://127.0.0.1:1"],
        1,
        "vines rig --protocol helic",
    );
}

#[cfg(unix)]
#[test]
fn a_server_ends_in_order_on_a_signal() {
    let server = Server::start(&["controller"]);
    let pid = server.0.id().to_string();
    assert!(Command::new("kill").args(["-INT", &pid]).status().unwrap().success());
    assert_eq!(server.report(), "");
}

/// Sends a signal to an experiment on that rig after some seconds. Returns its messages.
#[cfg(unix)]
fn interrupted(rig: &Server, command: &str, out: &str, settings: &[&str], signal: &str, seconds: u64) -> String {
    let client = Command::new(PROGRAM)
        .args(with_settings(&[command, "--out", out, "--rig", &rig.1]))
        .args(settings)
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    std::thread::sleep(std::time::Duration::from_secs(seconds));
    let pid = client.id().to_string();
    assert!(Command::new("kill").args([signal, &pid]).status().unwrap().success());
    let output = client.wait_with_output().unwrap();
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(130), "{message}");
    message
}

#[cfg(unix)]
#[test]
fn a_signal_during_an_experiment_zeroes_the_drive_and_keeps_what_was_measured() {
    for (signal, mode) in [
        ("-INT", &["rig", "--json", "--silence", "5"][..]),
        ("-TERM", &["rig", "--json", "--lock-step"]),
    ] {
        let rig = Server::start(mode);
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().to_str().unwrap();
        // A signal that comes later finds the rig still driven.
        let long = ["--set=record.hold_periods=20000"];
        let message = interrupted(&rig, "identify", out, &long, signal, 3);
        assert!(message.contains("interrupted"), "{message}");
        // What was measured is kept; the temporary folder of the FMUs is not.
        let left = std::fs::read_dir(out).unwrap().map(|entry| entry.unwrap().file_name());
        assert_eq!(left.collect::<Vec<_>>(), ["interrupted.csv"]);
        let report: Value = serde_json::from_str(&rig.report()).unwrap();
        assert_eq!(report["ended"], "farewell");
    }
    // Between two points of a backbone, the points are kept.
    let rig = Server::start(&["rig", "--lock-step", "--silence", "30"]);
    let folder = tempfile::tempdir().unwrap();
    let long = [
        "--set=backbone.C_from=0.6",
        "--set=backbone.C_to=0.58",
        "--set=backbone.points=2000",
    ];
    let message = interrupted(&rig, "backbone", folder.path().to_str().unwrap(), &long, "-INT", 5);
    assert!(message.contains("points were measured before. Written: "), "{message}");
}

#[test]
fn a_rig_with_a_fault_ends_identify_and_backbone_with_its_reason() {
    // The first faults are there at the loop check, which drives a hundredth of the drive.
    for (command, fault, part) in [
        ("identify", "sensors swapped@0.001", "response and base are exchanged"),
        (
            "backbone",
            "response sensor reversed@0.001",
            "the response has the opposite sign",
        ),
        (
            "identify",
            "response sensor × 3@0.001",
            "the amplitude of the response is not as expected",
        ),
        (
            "identify",
            "response sensor dead@0.001",
            "the response does not answer the drive",
        ),
        (
            "backbone",
            "base sensor dead@0.001",
            "the base sensor does not answer the drive",
        ),
        ("backbone", "response sensor dead@6", "a sensor, the drive"),
    ] {
        let rig = Server::start(&["rig", "--lock-step", "--sensors-only", "--fault", fault]);
        let out = tempfile::tempdir().unwrap();
        let arguments = [command, "--out", out.path().to_str().unwrap(), "--rig", &rig.1];
        fails(&with_settings(&arguments), 1, part);
        assert!(rig.report().contains("ended by the client"));
    }
}
