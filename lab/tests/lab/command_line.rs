//! Guards the program as its users meet it: output, exit codes and messages.

use std::f64::consts::TAU;
use std::fs;
use std::path::Path;

use serde_json::Value;
use vines::orbit::backbone_at_speed;
use vines::scene::Scene;

use crate::{fails, is_failure, json, printed, text, vines};

#[test]
fn orbits_curves_and_theory_come_as_json() {
    let orbits = json("orbit --json");
    let orbits = orbits.as_array().expect("an array");
    let stable: Vec<_> = orbits.iter().filter(|orbit| orbit["stable"] == true).collect();
    assert_eq!(stable.len(), 1);
    for key in ["sigma", "C", "B", "Omega", "G", "impact_velocity"] {
        assert!(stable[0][key].is_f64(), "{key}: {}", stable[0]);
    }
    assert_eq!(stable[0]["multipliers"].as_array().map(Vec::len), Some(4));
    let mode = json("orbit --backbone --json --set=plant.c=0 --set=plant.r=1 --set=excitation.G=0");
    let points = mode[0]["points"].as_array().unwrap();
    let is_free = points.iter().all(|one| one["G"].as_f64().unwrap().abs() < 1e-9);
    assert!(points.len() > 100 && is_free);
    let response = json("orbit --response --json --set=excitation.G=1.6");
    let components = response["components"].as_array().unwrap();
    let names = || components.iter().map(|one| one["name"].as_str().unwrap());
    let named = |start: &str| names().filter(|name| name.starts_with(start)).count();
    assert!(components[0]["special"].as_array().map_or(0, Vec::len) >= 3);
    assert_eq!((named("symmetric 1:1"), named("asymmetric 1:1")), (1, 1));
    let settled = json("orbit --sigma=-0.6 --json --set excitation.G=2.2");
    assert_eq!(settled["bounces"].as_array().map(Vec::len), Some(6));
    let theory = json("theory --sigma=-1 --json");
    for (key, count) in [("backbone", 200), ("solutions", 2), ("equilibria", 2)] {
        assert_eq!(theory[key].as_array().map(Vec::len), Some(count), "{key}");
    }
    assert!(theory["manifold"]["C_min"].as_f64().unwrap() > 0.1);
}

#[test]
fn the_plants_own_motion_has_the_friction_that_exact_orbits_leave_out() {
    let friction = "orbit --periodic --json --set=plant.mu_k=0.05";
    let motion = json(friction);
    assert_eq!((motion["impacts"].as_u64(), &motion["stable"]), (Some(2), &true.into()));
    assert!((motion["phase_deg"].as_f64().unwrap() + 90.0).abs() < 1e-6, "{motion}");
    assert_eq!(motion["ideal"][0], "friction");
    let amplitude = motion["a_m"].as_f64().unwrap();
    let smaller = amplitude < motion["ideal"][2].as_f64().unwrap();
    assert!(smaller, "friction takes energy: {motion}");
    // A simulation at the same frequency leads to it.
    let settled = json(&format!("{friction} --sigma={} --set=start.dq2=0.5", motion["sigma"]));
    let is_same = (settled["a_m"].as_f64().unwrap() / amplitude - 1.0).abs() < 1e-8;
    assert!(is_same, "{settled}");
}

#[test]
fn a_person_gets_tables() {
    let free = "orbit --backbone --set=plant.c=0 --set=plant.r=1 --set=excitation.G=0";
    for (line, words) in [
        ("orbit", ["sigma", "stable"]),
        ("theory", ["sigma", "stable"]),
        ("orbit --set=excitation.G=0", ["none", "without excitation"]),
        (free, ["neutral", "-90.000000"]),
    ] {
        let text = String::from_utf8(vines(line).stdout).unwrap();
        assert!(words.iter().all(|word| text.contains(word)), "{line}: {text}");
        assert!(!text.contains("-0.000000"), "{line}: {text}");
    }
}

#[test]
fn shells_and_readers_get_all_commands_from_the_command_line_itself() {
    for shell in ["bash", "elvish", "fish", "powershell", "zsh"] {
        let script = printed(&format!("completions {shell}"));
        assert!(script.contains("backbone") && script.contains("no-check"), "{shell}");
    }
    assert!(printed("man").starts_with(".ie") && printed("man").contains("Exit codes"));
    assert!(printed("man identify").contains(".TH vines-identify 1"));
}

/// Command lines, the codes that they end with, and a part of the message. Some numbers are finite, and the plant cannot compute with them; some phase
/// targets are in rad.
const SENSELESS: &str = "
orbit --set=plant.r=1.5 => 2 r (coefficient of restitution) = 1.5
orbit --set=plant.rr=0.5 => 2 `rr`
orbit --set=nonsense => 2 section.key=value
theory --scene no-such.toml => 2 no-such.toml
theory --sigma=nan => 2 finite
dance => 2 commands are identify, backbone, fit
help dance => 2 commands are identify, backbone, fit
man dance => 2 commands are identify, backbone, fit
check rig.toml => 2 --scene rig.toml
rig --listen 127.0.0.1:0 --sessions 0 => 2 1..
orbit --sigma=-1000 => 2 above -1/epsilon = -118.9
theory --sigma=-200 => 2 above -1/epsilon = -118.9
orbit --sigma=-1 --set=excitation.G=0.6 => 1 vines map
orbit --response --set=excitation.G=0 => 1 G = 0
identify --rig built-in --set=excitation.G=0 => 2 no drive
orbit --response --set=excitation.G=0 --set=plant.k=0.1168 --set=plant.m=32 --set=plant.b=10 => 2 epsilon = m/M = 8.406, b = 10.000 m, the natural frequency = 0.028 Hz: is this meant?
orbit --response --range=2:-2 => 2 first below the last
orbit --periodic --set=plant.r_scatter=0.1 => 1 set it to 0
identify --set=phase_lock.amplitude_max=8e-5 => 2 phase_lock.amplitude_max
map --set plant.c=1e300 => 2 c (damping) = 
backbone --set plant.M=1e-300 => 2 M (primary mass) = 
identify --rig built-in --set plant.k=1e101 => 2 k (stiffness) = 
identify --set excitation.E=1e300 => 2 E (amplitude of the base oscillator) = 
map --x sigma=0:1e300:3 => 2 is refused
map --y G=0.1:1e300:3 => 2 is refused
backbone --set controller.phase_target=-1.5708 => 2 phase_target = -1.5708 degrees
identify --set controller.phase_target=-1.5708 => 2 write -90.0002
orbit --set controller.phase_target=3.1415 => 2 above pi in magnitude and below 180
orbit --set controller.phase_target=180 => 2 above pi in magnitude and below 180
orbit --set controller.phase_target=-200 => 2 above pi in magnitude and below 180
report --x r=0.5:1:3 --y r=0.5:1:3 => 2 plant.r is on two axes
pack --out FOLDER/no-such --binary win64 => 2 PLATFORM=PATH
pack --out FOLDER/no-such --binary amiga=x.so => 2 linux64, linux32
pack --out FOLDER/no-such --set=plant.r=2 => 2 r (coefficient of restitution) = 2
";

#[test]
fn input_without_sense_ends_with_one_message_and_code_two_and_without_a_result_with_one() {
    let folder = tempfile::tempdir().unwrap();
    let text = SENSELESS.replace("FOLDER", &folder.path().display().to_string());
    for line in text.trim().lines() {
        let (line, case) = line.split_once(" => ").unwrap();
        let (code, part) = case.split_once(' ').unwrap();
        fails(line, code.parse().unwrap(), part);
    }
    // Refused before anything is written.
    assert!(!folder.path().join("no-such").exists());
}

#[test]
fn a_drive_without_a_stable_orbit_is_told_at_which_drives_one_is_stable() {
    let folder = tempfile::tempdir().unwrap();
    let undamped = "--set=plant.c=0 --set=start.dq2=0.1 --set=phase_lock.acquire_timeout=57";
    let part = "there is no stable symmetric 1:1 orbit at G = 1.1000; it is stable for G from 0.788 to 0.811";
    let out = folder.path().display();
    fails(&format!("identify --rig built-in --out {out} {undamped}"), 1, part);
    // The irregular motion at this drive resembles a failed sensor.
    let irregular = "--set=plant.r=0.85 --set=excitation.G=1.016 --set=plant.m=0.052537 --set=plant.c=3.4047";
    let part = "there is no stable symmetric 1:1 orbit at G = 1.0160; it is stable for G from 0.504 to 0.933";
    fails(&format!("identify --rig built-in --out {out} {irregular}"), 1, part);
}

#[test]
fn points_whose_impacts_are_asymmetric_though_noise_hides_it_in_their_response_are_counted() {
    let folder = tempfile::tempdir().unwrap();
    let tracked = |noise: &str| {
        let levels = "--set=backbone.C_from=0.8 --set=backbone.C_to=0.66 --set=backbone.points=15";
        let line = format!("backbone {levels} --set=resonance.sensor=q1 --set=chain.snr={noise}");
        let text = text(&vines(&format!("{line} --out {}", folder.path().display())));
        let is_hidden = |row: &&str| row.ends_with("  symmetric 1:1 / asymmetric 1:1");
        (text.lines().filter(is_hidden).count(), text)
    };
    // Noise hides an asymmetry.
    let (count, text) = tracked("26");
    let line = format!("but whose impacts are asymmetric (not the symmetric backbone): {count}\n");
    assert!(count > 0 && text.contains(&line), "{text}");
    let (count, text) = tracked("80");
    assert_eq!(count, 0, "{text}");
}

#[test]
fn a_map_is_written_as_table_and_figures() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().display();
    let text = printed(&format!(
        "map --x=sigma=-2:1:4 --y=G=1:1.4:3 --periods=2000 --out {out}"
    ));
    assert!(text.contains("symmetric 1:1") && text.contains("map.svg"), "{text}");
    let read = |name: &str| std::fs::read_to_string(folder.path().join(name)).unwrap();
    let rows = read("map.csv");
    assert_eq!(rows.lines().count(), 1 + 12);
    assert!(rows.starts_with("sigma,G,r,regime,followed,transient,recurrence,exponent,exponent_error,synchrony,"));
    let curves = read("bifurcations.csv");
    assert!(curves.starts_with("curve,bifurcation,sigma,G,C,B,bounds_stability\n") && curves.lines().count() > 20);
}

#[test]
fn a_check_states_nothing_more_certain_than_a_point() {
    let checked = json("check --json");
    let linear = &checked["linear"];
    let number = |key: &str| linear[key].as_f64().unwrap();
    // 1e-4 of the half-power bandwidth.
    let least = 2e-4 * number("zeta");
    for (u, of) in [("u_f0_Hz", number("f0_Hz")), ("u_zeta", 1.0)] {
        assert!((0.99..1.1).contains(&(number(u) / of / least)), "{u}: {linear}");
    }
    for quantity in checked["quantities"].as_array().unwrap() {
        assert!(quantity["uncertainty"].as_f64().unwrap() > 1e-6, "{quantity}");
    }
}

#[test]
fn a_backbone_that_a_limit_cuts_off_is_said_to_be_cut_off() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().display();
    let low = "backbone --set phase_lock.response_max=0.003 --set backbone.C_from=0.2";
    let part = "the limit cut the motion off before it settled; at this G, the stable symmetric 1:1 motion is at sigma";
    fails(&format!("{low} --out {out}"), 1, part);
}

#[test]
fn units_that_no_rig_has_are_named_with_the_values_and_what_is_plausible() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().display();
    printed(&format!("backbone --set backbone.points=8 --out {out}"));
    let cm = "--column E=E_m:cm --column u_E=u_E_m:cm";
    let mm = "--column E=E_m:mm --column u_E=u_E_m:mm";
    for (option, code, part) in [
        (mm, 1, "point 1: at phase resonance a response of 6.999"),
        (mm, 1, "and this one is 1.1812e-7 m: give the units of both"),
        ("--column A=A_m:km", 2, "the unit km is unknown"),
        (cm, 1, "are the units right? Point 1 was read as 8.7489 Hz"),
        ("--known b=10", 1, "b = 10.000 m: is this meant? --known has"),
        ("--known m=32", 1, "epsilon = m/M = 8.406: is this meant? --known has"),
        ("--known q=1", 2, "theta, k_r, v_y, h, g\n"),
    ] {
        let output = vines(&format!("fit {out}/tracked.csv {option} {ONLY_IDEAL}"));
        assert_eq!(output.status.code(), Some(code), "{output:?}");
        assert!(text(&output).contains(part), "{option}: {}", text(&output));
        assert!(!text(&output).contains("NaN"), "{option}: {}", text(&output));
    }
}

/// Numbers of a JSON object.
fn numbers<const N: usize>(of: &Value, names: [&str; N]) -> [f64; N] {
    names.map(|name| of[name].as_f64().unwrap())
}

/// What excludes all hypotheses but an ideal cavity.
const ONLY_IDEAL: &str = "--known=mu=0 --known=theta=0 --known=k_r=0 --known=v_y=0 --known=h=0 --known=g=0";

#[test]
fn a_fit_of_tracked_points_corrects_a_wrong_scene_and_writes_it() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().display();
    let tracked = printed(&format!("backbone --set backbone.points=8 --out {out}"));
    assert!(!tracked.contains("do not belong"));
    let fit = format!("fit {out}/tracked.csv --out {out}/rig.toml --figure {out}/fit.svg");
    let fit = printed(&format!("{fit} --set=plant.r=0.75 --known=m=0.032±0.0003 {ONLY_IDEAL}"));
    assert!(fit.contains("what is possible: ideal cavity\n"), "{fit}");
    let scene = json(&format!("theory --scene {out}/rig.toml --json"))["scene"].clone();
    assert!((scene["r"].as_f64().unwrap() - 0.65).abs() < 2e-3, "{scene}");
    let written = std::fs::read_to_string(folder.path().join("rig.toml")).unwrap();
    assert!(written.starts_with("# Fitted by vines") && !written.contains("published"));
    let fit = json(&format!(
        "fit {out}/tracked.csv --known=m=0.032±0.0003 {ONLY_IDEAL} --json"
    ));
    let parameters = fit["parameters"].as_array().unwrap();
    for key in ["M", "k", "c"] {
        let mut lines = written.lines();
        let line = lines.find(|line| line.starts_with(&format!("{key} = "))).unwrap();
        let value: f64 = line.split_whitespace().nth(2).unwrap().parse().unwrap();
        let fitted = parameters.iter().find(|one| one["symbol"] == key).unwrap();
        let [fitted, u] = numbers(fitted, ["value", "uncertainty"]);
        let is_same = (value - fitted).abs() < 0.05 * u;
        assert!(is_same && line.contains("# ± "), "{line} {fitted}");
    }
    let exact = text(&vines(&format!("fit {out}/tracked.csv --known=m=0.032")));
    assert!(exact.contains("m = 0.032 has no uncertainty and counts as exact"));
    let drawn = std::fs::read_to_string(folder.path().join("fit.svg")).unwrap();
    for label in ["measured", "scene", "fit", "±1.96 u", ", possible"] {
        assert!(drawn.contains(&format!("{label}<")), "{label}");
    }
    let missing = "has no column `amplitude`";
    fails(&format!("fit {out}/tracked.csv --column A=amplitude:mm"), 2, missing);
    for (column, words) in [
        ("A=A_m:s", "A in s is not possible; allowed is a length"),
        ("A=A_m:N", "A in N is not possible"),
        ("E=E_m:N", "motion of a base, whose amplitude E is in no N"),
        ("f=f_Hz:mm", "allowed is Hz, rad/s or 1/min"),
    ] {
        fails(&format!("fit {out}/tracked.csv --column {column}"), 2, words);
    }
    // The same points, with the response as an acceleration in g.
    let table = std::fs::read_to_string(format!("{out}/tracked.csv")).unwrap();
    let names: Vec<&str> = table.lines().next().unwrap().split(',').collect();
    let place = |name: &str| names.iter().position(|one| *one == name).unwrap();
    let in_g = |row: &str| {
        let mut cells: Vec<String> = row.split(',').map(String::from).collect();
        let number = |cells: &[String], name| cells[place(name)].parse::<f64>().unwrap();
        let omega = TAU * number(&cells, "f_Hz");
        for name in ["A_m", "u_A_m"] {
            cells[place(name)] = (number(&cells, name) * omega * omega / 9.806_65).to_string();
        }
        cells.join(",")
    };
    for (heading, columns) in [("A_m", " --column A=A_m:g --column u_A=u_A_m:g"), ("A_m [g]", "")] {
        let head = table.lines().next().unwrap().replace("A_m", heading);
        let rows: Vec<String> = table.lines().skip(1).map(in_g).collect();
        let file = format!("{out}/accelerations.csv");
        std::fs::write(&file, format!("{head}\n{}\n", rows.join("\n"))).unwrap();
        let r = |line: &str| json(line)["parameters"][2]["value"].as_f64().unwrap();
        let one = r(&format!("fit {out}/tracked.csv --json"));
        let other = r(&format!("fit {file}{columns} --json"));
        assert!((one / other - 1.0).abs() < 1e-7, "{one} {other}");
    }
}

#[test]
fn points_of_a_force_test_have_newtons_and_metres_at_the_sensor_in_their_file_from_which_a_fit_finds_the_scene() {
    let folder = tempfile::tempdir().unwrap();
    let (out, scene) = (folder.path().display(), preset("frame"));
    let levels = "--set backbone.C_to=0.4 --set backbone.points=6 --set resonance.sensor_quantity=acceleration";
    printed(&format!("backbone {scene} {levels} --out {out}"));
    let table = fs::read_to_string(folder.path().join("tracked.csv")).unwrap();
    assert!(table.starts_with("f_Hz,A_m,F_N,u_f_Hz,u_A_m,u_F_N,sigma,"), "{table}");
    let fitted = json(&format!("fit {out}/tracked.csv {scene} --json"));
    assert_eq!(fitted["describes"], true, "{fitted}");
    for parameter in fitted["parameters"].as_array().unwrap() {
        let [value, u, expected] = numbers(parameter, ["value", "uncertainty", "expected"]);
        assert!((value - expected).abs() < u, "{parameter}");
    }
    let column = format!("fit {out}/tracked.csv {scene} --column E=F_N:mm");
    fails(&column, 2, "the scene is driven by a force, whose amplitude E is in N");
}

#[test]
fn a_backbone_at_another_phase_target_agrees_with_its_scene_and_gives_its_parameters() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().display();
    for phase in ["-80", "-105"] {
        let settings = format!("--set controller.phase_target={phase} --set backbone.points=8");
        let tracked = printed(&format!("backbone {settings} --out {out}"));
        assert!(!tracked.contains("do not belong"), "{tracked}");
        let table = fs::read_to_string(folder.path().join("tracked.csv")).unwrap();
        let mut rows = table.lines().map(|row| row.split(','));
        let place = rows.next().unwrap().position(|name| name == "phase_target_deg");
        for mut row in rows {
            let value: f64 = row.nth(place.unwrap()).unwrap().parse().unwrap();
            assert_eq!(value, phase.parse::<f64>().unwrap());
        }
        for file in ["tracked.csv", "tracked.json"] {
            let fit = json(&format!("fit {out}/{file} --set plant.r=0.75 {ONLY_IDEAL} --json"));
            assert_eq!(fit["describes"], true, "{phase}, {file}");
            let truth = Scene::load(None, &[]).unwrap().dimensionless();
            for (n, value) in [(2, 0.65), (3, truth.b), (4, truth.epsilon)] {
                let [found, u] = numbers(&fit["parameters"][n], ["value", "uncertainty"]);
                let is_right = (found - value).abs() < 3.0 * u;
                assert!(is_right && u < 0.05 * value, "{phase}, {n}: {found} ± {u}");
            }
        }
    }
}

/// A table of twelve points of the default rig with these columns beside them, in a layout. The drive of the last four is twice the right one.
fn table_of_points(head: &str, cells: impl Fn(usize) -> String, [delimiter, mark]: [&str; 2]) -> String {
    let d = Scene::load(None, &[]).unwrap().dimensionless();
    let names = ["f_Hz", "A_m", "E_m", "u_f_Hz", "u_A_m", "u_E_m"];
    let head = [names.join(delimiter), head.replace(',', delimiter)].join(delimiter);
    let rows = (0..12).map(|n| {
        let [omega, c, g] = backbone_at_speed(&d, 0.75 + 0.025 * n as f64).unwrap();
        let drive = d.amplitude(g) * if n < 8 { 1.0 } else { 2.0 };
        let (f, a) = (omega * d.omega0 / TAU, c * d.b);
        let numbers = [f, a, drive, 1e-5 * f, 1e-3 * a, 1e-3 * drive];
        let numbers = numbers.map(|one| format!("{one:.12}").replace('.', mark));
        [numbers.join(delimiter), cells(n)].join(delimiter)
    });
    format!("{head}\n{}\n", rows.collect::<Vec<String>>().join("\n"))
}

#[test]
fn a_file_of_another_program_is_refused_until_the_scene_says_what_its_sensor_reads() {
    let folder = tempfile::tempdir().unwrap();
    let [table, recording] = ["table.csv", "recording.csv"].map(|name| folder.path().join(name));
    fs::write(&table, table_of_points("settled", |n| (n < 8).to_string(), [",", "."])).unwrap();
    let rows = (0..4000).map(|n| {
        let turn = 0.11 * n as f64;
        format!("{},{},{}\n", 0.002 * n as f64, 3.0 * turn.sin(), 20.0 * turn.cos())
    });
    fs::write(&recording, format!("time,y,x\n{}", rows.collect::<String>())).unwrap();
    let scene = folder.path().join("scene.toml");
    let plant = "[plant]\nM = 3.807\nk = 11680\nc = 2.53\nm = 0.032\nb = 0.01\nr = 0.65\n";
    fs::write(&scene, format!("{plant}[excitation]\nG = 1.1\n")).unwrap();
    for file in [
        table.display().to_string(),
        format!("{} --response y:mm --drive x:um", recording.display()),
    ] {
        for scene in [String::new(), format!(" --scene {}", scene.display())] {
            fails(&format!("fit {file}{scene}"), 2, "set resonance.sensor = \"q1\"");
        }
    }
    let fit = json(&format!("fit {} --set resonance.sensor=v --json", table.display()));
    assert_eq!(fit["describes"], true);
}

#[test]
fn truth_values_of_tables_are_read_in_every_dialect_and_unknown_words_are_refused_with_their_row() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("table.csv");
    let out = format!("{} --set resonance.sensor=v", file.display());
    for (words, layout) in [
        (["true", "false"], [",", "."]),
        (["True", "False"], [",", "."]),
        (["TRUE", "FALSE"], ["\t", "."]),
        (["WAHR", "FALSCH"], [";", ","]),
        (["wahr", "falsch"], [",", "."]),
        (["1", "0"], [",", "."]),
        (["1.0", "0.0"], [",", "."]),
        (["1,0", "0,0"], [";", ","]),
    ] {
        for column in ["settled", "reached"] {
            let cell = |n: usize| words[usize::from(n >= 8)].to_string();
            fs::write(&file, table_of_points(column, cell, layout)).unwrap();
            let fit = json(&format!("fit {out} --json"));
            let count = fit["residuals"].as_array().unwrap().len();
            assert!(count == 8 && fit["describes"] == true, "{words:?} {column}: {fit}");
        }
    }
    let refused = |column: &str, cell: &dyn Fn(usize) -> String, delimiter: &str, part: &str| {
        fs::write(&file, table_of_points(column, cell, [delimiter, "."])).unwrap();
        fails(&format!("fit {out}"), 2, part);
    };
    for column in ["settled", "reached"] {
        for word in ["ja", "yes", "2", "", "nan"] {
            let cell = |n: usize| if n == 2 { word.to_string() } else { "true".into() };
            let part = format!("row 3: {column} = `{word}` is not known; allowed is true or false");
            refused(column, &cell, ",", &part);
        }
    }
    for (column, right, word) in [
        ("motion", "nonlinear, symmetric", "symmetric"),
        ("regime", "symmetric 1:1", "1:1"),
    ] {
        let cell = |n: usize| if n == 4 { word.to_string() } else { right.into() };
        refused(column, &cell, ";", &format!("row 5: {column} = `{word}` is not known"));
    }
    let part = "row 1: phase_target_deg = -1.5708 degrees";
    refused("phase_target_deg", &|_| "-1.5708".into(), ",", part);
}

#[test]
fn a_particle_that_hits_before_the_signal_is_known_is_named_beside_the_fault() {
    let settings = "--set start.dq2=3 --set resonance.sensor=q1 --set resonance.sensor_quantity=acceleration";
    let folder = tempfile::tempdir().unwrap();
    let failed = vines(&format!(
        "identify --rig built-in {settings} --out {}",
        folder.path().display()
    ));
    is_failure(&failed, 1, "set start.dq2 = 0");
    assert!(!text(&failed).contains("signal_timeout"), "{failed:?}");
}

#[test]
fn theory_and_response_are_drawn_for_a_file() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().display();
    for (line, labels) in [
        ("theory", ["manifold, unstable", "backbone, r = 0.65"]),
        ("orbit --response", ["exact orbits", "exact backbone"]),
    ] {
        printed(&format!("{line} --figure {out}/figure.svg"));
        let drawn = fs::read_to_string(folder.path().join("figure.svg")).unwrap();
        let is_there = |label: &&str| drawn.contains(&format!("{label}<"));
        assert!(labels.iter().all(is_there), "{line}");
    }
    fails("orbit --figure figure.svg", 2, "--response");
}

/// A scene whose other mode leaves no orbit stable, in a folder.
fn nowhere_stable(folder: &Path) -> String {
    let modes = "
        { frequency = 93.7622, damping = 0.00107488, shape = { cavity = 1.20929 } },
        { frequency = 3703.54, damping = 0.00399092, shape = { cavity = 1.70028 } },
    ";
    let scene = format!(
        "[plant]\nm = 0.0121282\nb = 0.00906816\nr = 0.5215\n[start]\ndq2 = 5\n[excitation]\nG = 0.86\n[backbone]\nC_from = 0.5\nC_to = 0.46\npoints = 3\n\
         [structure]\nexcitation = \"force\"\ncavity = \"cavity\"\ndrive = \"cavity\"\nmodes = [{modes}]\n"
    );
    let path = folder.join("scene.toml");
    fs::write(&path, scene).unwrap();
    path.display().to_string()
}

/// What `vines identify` says of a scene without a lock.
fn refusal(line: &str) -> String {
    let folder = tempfile::tempdir().unwrap();
    let done = vines(&format!(
        "identify --rig built-in {line} --out {}",
        folder.path().display()
    ));
    assert_eq!(done.status.code(), Some(1), "{done:?}");
    String::from_utf8(done.stderr).unwrap()
}

#[test]
fn a_refusal_gives_one_advice_and_it_follows_from_the_exact_orbits() {
    // No time makes an orbit stable: they are stable for G from 0.959 to 1.423.
    for drive in ["0.03", "0.3"] {
        let settings = "--set start.dq2=0 --set phase_lock.acquire_timeout=30";
        let said = refusal(&format!("{settings} --set excitation.G={drive}"));
        assert!(said.contains("it is stable for G from 0.959 to 1.423"), "{said}");
    }
}

#[test]
#[ignore = "open: after a motion that is not steady, the exact orbits are not asked for advice"]
fn where_no_orbit_is_stable_no_other_drive_is_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let path = nowhere_stable(folder.path());
    for drive in ["0.86", "0.7"] {
        let said = refusal(&format!("--scene {path} --set start.dq2=0 --set excitation.G={drive}"));
        assert!(said.contains("it is stable at no G"), "{said}");
        let advices = ["Try another G", "stable for G from"].map(|advice| said.contains(advice));
        assert_eq!(advices, [false; 2], "G = {drive}: {said}");
    }
}

#[test]
#[ignore = "open: the controller takes the response to a weak drive beside a moving particle for implausible"]
fn a_drive_that_is_weak_beside_the_start_of_the_particle_is_no_failed_sensor() {
    for drive in ["0.001", "0.02"] {
        let said = refusal(&format!("--set excitation.G={drive}"));
        assert!(!said.contains("has failed"), "G = {drive}: {said}");
    }
}

/// The option of a preset of `scenes/`.
fn preset(name: &str) -> String {
    format!("--scene {}/../scenes/{name}.toml", env!("CARGO_MANIFEST_DIR"))
}

/// Command lines, the code that each ends with, and a part of what it says: of results that are of one oscillator where the scene has a structure, of a
/// force in newtons, of a structure without a stable orbit, of a base that is held and read, and of a decay without points.
const SAID: &str = r"
map FRAME --x sigma=-1:1:2 --y G=1:1.2:2 --periods 100 --out OUT => 2 a regime map is of one oscillator: the scene has a [structure]
rig FRAME --protocol helic --listen 127.0.0.1:0 => 2 a device has one oscillator, and this scene has a [structure]
orbit TABLE --periodic => 2 --periodic and --sigma are for one oscillator, and this scene has a [shaker]
theory FRAME => 0 theory is of the ideal cavity, without the other modes of the structure
check FRAME => 0 epsilon, lambda, sigma, C and G are those of mode 1
check FRAME => 0 At F = 1.23e-2 N: signs, gains, delays and noise are as expected
check FRAME => 0 frequency of the force over that of the drive
structure NOWHERE => 0 warning: with all modes no orbit of the backbone is stable
backbone NOWHERE --out OUT => 1 it is nowhere stable\n
check --set chain.hold=true => 1 half a sample late; the lock is 1.80 degrees off
identify --rig built-in --set record.hold_periods=3 --set record.decay_periods=1 --out OUT => 0 Free decay: no points
";

#[test]
fn what_limits_a_result_is_said_beside_it() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().display();
    let unstable = format!("--scene {}", nowhere_stable(folder.path()));
    let lines = SAID
        .replace("FRAME", &preset("frame"))
        .replace("TABLE", &preset("slip-table"));
    for line in lines
        .replace("NOWHERE", &unstable)
        .replace("OUT", &out.to_string())
        .trim()
        .lines()
    {
        let (line, case) = line.split_once(" => ").unwrap();
        let (code, part) = case.split_once(' ').unwrap();
        let output = vines(line);
        assert_eq!(output.status.code(), code.parse().ok(), "{line}: {output:?}");
        assert!(text(&output).contains(&part.replace("\\n", "\n")), "{line}: {output:?}");
    }
    let without = text(&vines("check --set chain.hold=true --set chain.reference=false"));
    assert!(!without.contains("half a sample late"));
    let few = "--set backbone.C_from=0.5 --set backbone.C_to=0.46 --set backbone.points=3";
    let tracked = text(&vines(&format!("backbone {} {few} --out {out}", preset("cantilever"))));
    let count = tracked.matches("asymmetric 1:1; not settled: the motion is ").count();
    let is_counted = tracked.contains("0 of 3 points are settled points");
    assert!(is_counted && count == 3, "{tracked}");
}
