//! Guards the program as its users meet it: output, exit codes and messages.

use std::time::{Duration, Instant};

use serde_json::Value;

use crate::{fails, vines};

fn json(arguments: &[&str]) -> Value {
    let output = vines(arguments);
    assert!(output.status.success(), "{output:?}");
    serde_json::from_slice(&output.stdout).expect("JSON")
}

#[test]
fn orbits_come_as_a_json_array() {
    let orbits = json(&["orbit", "--json"]);
    let stable: Vec<_> = orbits
        .as_array()
        .expect("an array")
        .iter()
        .filter(|orbit| orbit["stable"] == true)
        .collect();
    assert_eq!(stable.len(), 1);
    for key in ["sigma", "C", "B", "Omega", "G", "impact_velocity"] {
        assert!(stable[0][key].is_f64(), "{key}: {}", stable[0]);
    }
    assert_eq!(stable[0]["multipliers"].as_array().map(Vec::len), Some(4));
}

#[test]
fn the_plants_own_motion_has_the_friction_that_exact_orbits_leave_out() {
    let friction = ["orbit", "--periodic", "--json", "--set=plant.mu_k=0.05"];
    let motion = json(&friction);
    assert_eq!(
        (motion["impacts"].as_u64(), motion["stable"].as_bool()),
        (Some(2), Some(true))
    );
    assert!((motion["phase_deg"].as_f64().unwrap() + 90.0).abs() < 1e-6, "{motion}");
    assert_eq!(motion["ideal"][0], "friction");
    let smaller = motion["a_m"].as_f64() < motion["ideal"][2].as_f64();
    assert!(smaller, "friction takes energy: {motion}");
    // A simulation at the same frequency leads to it.
    let sigma = format!("--sigma={}", motion["sigma"]);
    let start = "--set=start.dq2=0.5";
    let settled = json(&[&friction[..], &[&sigma, start]].concat());
    assert!(
        (settled["a_m"].as_f64().unwrap() / motion["a_m"].as_f64().unwrap() - 1.0).abs() < 1e-8,
        "{settled}"
    );
    fails(&["orbit", "--periodic", "--set=plant.r_scatter=0.1"], 1, "set it to 0");
}

#[test]
fn theory_comes_as_json_with_as_many_samples_as_asked_for() {
    let theory = json(&["theory", "--json", "--points", "50"]);
    assert_eq!(theory["backbone"].as_array().map(Vec::len), Some(50));
    assert_eq!(theory["solutions"].as_array().map(Vec::len), Some(2));
    assert!(theory["manifold"]["C_min"].as_f64().unwrap() > 0.1);
}

/// Values that are finite numbers, and with which the plant cannot compute.
#[test]
fn extreme_values_of_plant_and_drive_are_refused_at_once() {
    let commands: [&[&str]; 3] = [&["map"], &["backbone"], &["identify", "--rig", "built-in"]];
    for (value, name) in [
        ("plant.c=1e300", "c (damping) = "),
        ("plant.M=1e-300", "M (primary mass) = "),
        ("plant.k=1e101", "k (stiffness) = "),
        ("excitation.E=1e300", "E (amplitude of the base oscillator) = "),
    ] {
        for command in commands {
            let began = Instant::now();
            fails(&[command, &["--set", value]].concat(), 2, name);
            let passed = began.elapsed();
            assert!(passed < Duration::from_secs(10), "{command:?}: {passed:?}");
        }
    }
    for axes in [["--x", "sigma=0:1e300:3"], ["--y", "G=0.1:1e300:3"]] {
        fails(&[&["map"][..], &axes].concat(), 2, "is refused");
    }
}

#[test]
fn a_person_gets_tables() {
    for command in ["orbit", "theory"] {
        let output = vines(&[command]);
        let text = String::from_utf8(output.stdout).unwrap();
        assert!(text.contains("sigma") && text.contains("stable"), "{text}");
    }
    let none = vines(&["orbit", "--set=excitation.G=0"]).stdout;
    assert!(String::from_utf8(none).unwrap().contains("without excitation"));
}

#[test]
fn bad_input_ends_with_code_two_and_one_message() {
    fails(
        &["orbit", "--set=plant.r=1.5"],
        2,
        "r (coefficient of restitution) = 1.5",
    );
    fails(&["orbit", "--set=plant.rr=0.5"], 2, "`rr`");
    fails(&["orbit", "--set=nonsense"], 2, "section.key=value");
    fails(&["theory", "--scene", "no-such.toml"], 2, "no-such.toml");
    fails(&["theory", "--points", "1"], 2, "--points");
    fails(&["dance"], 2, "dance");
    fails(&["rig", "--listen", "127.0.0.1:0", "--sessions", "0"], 2, "1..");
}

#[test]
fn a_drive_without_a_stable_orbit_is_told_at_which_drives_one_is_stable() {
    let folder = tempfile::tempdir().unwrap();
    let undamped = [
        "--set=plant.c=0",
        "--set=start.dq2=0.1",
        "--set=phase_lock.acquire_timeout=57",
    ];
    let run = [
        "identify",
        "--rig",
        "built-in",
        "--out",
        folder.path().to_str().unwrap(),
    ];
    let part = "there is no stable symmetric 1:1 orbit at G = 1.1000; it is stable for G from 0.788 to 0.811";
    fails(&[&run[..], &undamped].concat(), 1, part);
}

#[test]
fn curves_and_settled_orbits_come_as_json_too() {
    let backbone = json(&["orbit", "--backbone", "--json"]);
    assert!(backbone["points"].as_array().map_or(0, Vec::len) > 100);
    let mode = ["--set=plant.c=0", "--set=plant.r=1", "--set=excitation.G=0"];
    let mode = [&["orbit", "--backbone", "--json"], &mode[..]].concat();
    let mode = json(&mode);
    let points = mode["points"].as_array().unwrap();
    assert!(points.len() > 100 && points.iter().all(|one| one["G"].as_f64().unwrap().abs() < 1e-9));
    let response = json(&["orbit", "--response", "--json", "--set=excitation.G=1.6"]);
    let components = response["components"].as_array().unwrap();
    let named = |name: &str| {
        components
            .iter()
            .filter(|one| one["name"].as_str().unwrap().starts_with(name))
            .count()
    };
    assert!(components[0]["special"].as_array().map_or(0, Vec::len) >= 3);
    assert_eq!((named("symmetric 1:1"), named("asymmetric 1:1")), (1, 1));
    let settled = json(&["orbit", "--sigma=-0.6", "--json", "--set", "excitation.G=2.2"]);
    assert_eq!(settled["bounces"].as_array().map(Vec::len), Some(6));
    let theory = json(&["theory", "--sigma=-1", "--json"]);
    assert_eq!(theory["equilibria"].as_array().map(Vec::len), Some(2));
}

#[test]
fn a_map_is_written_as_table_and_figures() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().to_str().unwrap();
    let output = vines(&[
        "map",
        "--x=sigma=-2:1:4",
        "--y=G=1:1.4:3",
        "--periods=2000",
        "--out",
        out,
    ]);
    assert!(output.status.success(), "{output:?}");
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(
        text.contains("symmetric 1:1") && text.contains("map-dark.svg"),
        "{text}"
    );
    let rows = std::fs::read_to_string(folder.path().join("map.csv")).unwrap();
    assert_eq!(rows.lines().count(), 1 + 12);
    assert!(rows.starts_with("sigma,G,r,regime,followed,transient,recurrence,exponent,exponent_error,synchrony,"));
    let curves = std::fs::read_to_string(folder.path().join("bifurcations.csv")).unwrap();
    assert!(curves.starts_with("curve,bifurcation,sigma,G,C,B,bounds_stability\n") && curves.lines().count() > 20);
}

#[test]
fn absurd_curves_and_maps_are_refused() {
    fails(&["orbit", "--sigma=-1000"], 2, "above 0");
    fails(&["orbit", "--sigma=-1", "--set=excitation.G=0.6"], 1, "vines map");
    fails(&["orbit", "--response", "--set=excitation.G=0"], 1, "G = 0");
    fails(&["orbit", "--response", "--range=2:-2"], 2, "first below the last");
    fails(&["theory", "--sigma=nan"], 2, "finite");
    let refused = ["identify", "--set=phase_lock.amplitude_max=8e-5"];
    fails(&refused, 2, "amplitude_max is phase_lock.amplitude_max");
    fails(
        &["map", "--x", "G=1:2:3", "--y", "G=1:2:3"],
        2,
        "axis 2 is excitation.G again",
    );
    fails(&["map", "--sigma=-1.1"], 2, "sigma is an axis and a constant");
    fails(
        &["report", "--x", "r=0.5:1:3", "--y", "r=0.5:1:3"],
        2,
        "axis 2 is plant.r again",
    );
}

#[test]
fn a_folder_that_is_a_file_is_refused_as_wrong_usage_before_anything_runs() {
    let file = tempfile::NamedTempFile::new().unwrap();
    let path = file.path().to_str().unwrap();
    let nobody = ["--rig", "udp://127.0.0.1:9"];
    for (command, rig) in [
        ("identify", &nobody[..]),
        ("backbone", &nobody),
        ("map", &[]),
        ("report", &[]),
    ] {
        let start = Instant::now();
        fails(&[&[command, "--out", path], rig].concat(), 2, path);
        assert!(start.elapsed() < Duration::from_secs(5), "{command}");
    }
}

#[test]
fn packing_refuses_what_it_cannot_pack_before_it_writes() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let out = out.to_str().unwrap();
    let pack = |option: &[&'static str]| [&["pack", "--out", out], option].concat();
    fails(&pack(&["--binary", "win64"]), 2, "PLATFORM=PATH");
    fails(&pack(&["--binary", "amiga=x.so"]), 2, "linux64, linux32");
    fails(&pack(&["--set=plant.r=2"]), 2, "r (coefficient of restitution) = 2");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}

#[test]
fn a_fit_of_tracked_points_corrects_a_wrong_scene_and_writes_it() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().to_str().unwrap();
    let tracked = vines(&["backbone", "--set", "backbone.points=8", "--out", out]);
    assert!(tracked.status.success(), "{tracked:?}");
    assert!(!String::from_utf8_lossy(&tracked.stdout).contains("do not belong"));
    let [points, rig, figure] = ["tracked.csv", "rig.toml", "fit.svg"].map(|name| format!("{out}/{name}"));
    let known = ["--set=plant.r=0.75", "--known=m=0.032±0.0003"];
    let fit = vines(&[&["fit", &points, "--out", &rig, "--figure", &figure], &known[..]].concat());
    let text = String::from_utf8_lossy(&fit.stdout).into_owned();
    assert!(
        fit.status.success() && text.contains("the model describes them"),
        "{fit:?}"
    );
    let scene = json(&["theory", "--scene", &rig, "--json"])["scene"].clone();
    assert!((scene["r"].as_f64().unwrap() - 0.65).abs() < 2e-3, "{scene}");
    let drawn = std::fs::read_to_string(figure).unwrap();
    for label in ["measured", "scene", "fit", "±1.96 u", ": not rejected"] {
        assert!(drawn.contains(&format!("{label}<")), "{label}");
    }
    let refused = vines(&["fit", &points, "--column", "A=amplitude:mm"]);
    assert!(
        String::from_utf8_lossy(&refused.stderr).contains("has no column `amplitude`"),
        "{refused:?}"
    );
}
