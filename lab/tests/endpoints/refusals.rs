//! Endpoints that are refused, and servers that end.

use std::process::{Command, Stdio};

use serde_json::Value;

use crate::{PROGRAM, Server, fmu, vines, with_settings};

/// The error must be one message on stderr that names the part, with nothing on stdout.
fn fails(arguments: &[&str], code: i32, part: &str) {
    let output = vines(arguments);
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(code), "{arguments:?}: {message}");
    assert!(message.contains("error: "), "{message}");
    assert!(message.contains(part), "`{part}` is not in: {message}");
    assert!(output.stdout.is_empty());
}

#[test]
fn an_address_without_a_server_is_named() {
    fails(&["identify", "--rig", "no-such.fmu"], 2, "udp://HOST:PORT");
    let controller = |address| ["identify", "--rig", "built-in", "--controller", address];
    fails(&controller("http://127.0.0.1:1"), 2, "tcp://HOST:PORT");
    fails(&controller("udp://127.0.0.1:1"), 2, "tcp://HOST:PORT");
    fails(&["identify", "--rig", "udp://127.0.0.1"], 2, "HOST:PORT");
    let nobody = std::net::UdpSocket::bind("127.0.0.1:0").unwrap();
    let address = format!("udp://{}", nobody.local_addr().unwrap());
    fails(&["identify", "--rig", &address], 1, "vines rig --listen");
    let address = address.replace("udp", "tcp");
    fails(
        &["identify", "--rig", "built-in", "--controller", &address],
        1,
        "vines controller --listen",
    );
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
    for (options, code, reason) in [
        (&["--protocol", "helic", "--lock-step"][..], 2, "its own clock"),
        (&["--protocol", "helic", "--key", &key], 2, "no authentication"),
        (&["--key", &short], 2, "16 bytes"),
        (&["--key", "no-such-file"], 2, "no-such-file"),
        (&["--rig", "udp://127.0.0.1:1"], 2, "can be served"),
        (&["--cpu", "5000"], 1, "--cpu 5000"),
    ] {
        fails(&[&rig[..], options].concat(), code, reason);
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

#[test]
fn a_port_in_use_is_named() {
    let taken = std::net::UdpSocket::bind("127.0.0.1:0").unwrap();
    let address = taken.local_addr().unwrap().to_string();
    fails(&["rig", "--listen", &address], 1, &address);
    let taken = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let address = taken.local_addr().unwrap().to_string();
    fails(&["rig", "--lock-step", "--listen", &address], 1, &address);
    fails(&["controller", "--listen", &address], 1, &address);
}

#[test]
fn a_rig_of_another_scene_is_refused() {
    let rig = Server::start(&["rig"]);
    let coarser = ["--set", "controller.samples_per_period=40"];
    fails(
        &[&["identify", "--rig", &rig.1], &coarser[..]].concat(),
        1,
        "same scene",
    );
    let other = Server::start(&["rig", "--lock-step", "--set", "resonance.sensor='q1'"]);
    fails(&["identify", "--rig", &other.1], 1, "measures q1 and e");
}

#[test]
fn a_server_ends_after_its_duration() {
    let served = vines(&["rig", "--listen", "127.0.0.1:0", "--duration", "0.1"]);
    assert!(served.status.success());
    assert!(String::from_utf8_lossy(&served.stdout).contains("in real time"));
}

#[cfg(unix)]
#[test]
fn a_server_ends_in_order_on_a_signal() {
    let server = Server::start(&["controller"]);
    let pid = server.0.id().to_string();
    assert!(Command::new("kill").args(["-INT", &pid]).status().unwrap().success());
    assert_eq!(server.report(), "");
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
        let arguments = ["identify", "--out", out, "--rig", &rig.1];
        // A signal that comes later finds the rig still driven.
        let long = ["--set", "record.hold_periods=20000"];
        let client = Command::new(PROGRAM)
            .args([&with_settings(&arguments)[..], &long].concat())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        std::thread::sleep(std::time::Duration::from_secs(3));
        let pid = client.id().to_string();
        assert!(Command::new("kill").args([signal, &pid]).status().unwrap().success());
        let output = client.wait_with_output().unwrap();
        let message = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(130), "{message}");
        assert!(message.contains("interrupted"), "{message}");
        // What was measured is kept; the temporary folder of the FMUs is not.
        let left = std::fs::read_dir(out).unwrap().map(|entry| entry.unwrap().file_name());
        assert_eq!(left.collect::<Vec<_>>(), ["interrupted.csv"]);
        let report: Value = serde_json::from_str(&rig.report()).unwrap();
        assert_eq!(report["ended"], "farewell");
    }
}

#[cfg(unix)]
#[test]
fn a_signal_between_two_points_of_a_backbone_keeps_the_points_and_ends_with_the_code_of_a_signal() {
    let rig = Server::start(&["rig", "--lock-step", "--silence", "30"]);
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().to_str().unwrap();
    let long = [
        "--set",
        "backbone.C_from=0.6",
        "--set",
        "backbone.C_to=0.58",
        "--set",
        "backbone.points=2000",
    ];
    let client = Command::new(PROGRAM)
        .args(with_settings(
            &[&["backbone", "--out", out, "--rig", &rig.1], &long[..]].concat(),
        ))
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    std::thread::sleep(std::time::Duration::from_secs(5));
    let pid = client.id().to_string();
    assert!(Command::new("kill").args(["-INT", &pid]).status().unwrap().success());
    let output = client.wait_with_output().unwrap();
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(130), "{message}");
    assert!(message.contains("points were measured before. Written: "), "{message}");
}

#[test]
fn backbone_finds_that_it_cannot_write_before_it_drives_the_rig() {
    let file = tempfile::NamedTempFile::new().unwrap();
    let path = file.path().to_str().unwrap();
    fails(
        &["backbone", "--out", path, "--rig", "udp://127.0.0.1:9"],
        2,
        "cannot write to",
    );
}

#[test]
fn a_sensor_that_is_unplugged_ends_identify_and_backbone_with_its_reason() {
    let name = "response sensor dead@";
    for (command, seconds, part) in [
        ("identify", 0.01, "does not answer"),
        ("backbone", 6.0, "a sensor, the drive"),
    ] {
        let fault = format!("{name}{seconds}");
        let rig = Server::start(&["rig", "--lock-step", "--sensors-only", "--fault", &fault]);
        let out = tempfile::tempdir().unwrap();
        let arguments = [command, "--out", out.path().to_str().unwrap(), "--rig", &rig.1];
        fails(&with_settings(&arguments), 1, part);
        assert!(rig.report().contains("ended by the client"));
    }
}
