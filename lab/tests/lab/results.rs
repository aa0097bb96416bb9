//! Guards the files of a run: targets are opened before anything moves, results are printed before they are written, a recording grows while it
//! runs, and the files in a folder are of one run.

use std::fs;
use std::path::Path;
use std::process::Output;

use crate::{Running, fails, is_failure, text, vines, wait_for_rows, words};

/// A backbone of one level, within seconds.
const SHORT: &str = "backbone --set=backbone.points=2 --set=backbone.C_to=0.6";

/// The names in a folder, in order.
fn names(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).unwrap();
    let names = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let mut names: Vec<_> = names.collect();
    names.sort();
    names
}

#[test]
fn a_target_that_cannot_be_written_is_refused_as_wrong_usage_before_anything_moves() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).display().to_string();
    let [a_file, a_folder, taken] = ["file", "folder", "taken"].map(at);
    fs::write(&a_file, "").unwrap();
    fs::create_dir(&a_folder).unwrap();
    for name in ["backbone.csv", "tracked.json", "map.svg", "report.html", "LoViNes.fmu"] {
        fs::create_dir_all(format!("{taken}/{name}")).unwrap();
    }
    let below = format!("{a_file}/below");
    let silent = "--rig udp://127.0.0.1:9";
    let [identify, backbone] = ["identify", "backbone"].map(|command| format!("{command} {silent}"));
    for command in [&identify, &backbone, "map", "report", "pack"] {
        for out in [&a_file, &below, &taken] {
            fails(&format!("{command} --out {out}"), 2, out);
        }
    }
    for command in ["identify --record", "fit x.csv --out", "fit x.csv --figure"] {
        for target in [&a_folder, &below] {
            fails(&format!("{command} {target}"), 2, &format!("cannot write {target}"));
        }
    }
    assert_eq!(names(folder.path()), ["file", "folder", "taken"], "nothing is left");
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_costs_the_recording_but_not_the_result() {
    let folder = tempfile::tempdir().unwrap();
    let full = vines(&format!("{SHORT} --record /dev/full --out {}", folder.path().display()));
    let printed = String::from_utf8(full.stdout.clone()).unwrap();
    let is_printed = printed.contains("2 points in ") && printed.contains("tracked.csv");
    assert!(is_printed, "{printed}");
    let error = Output { stdout: Vec::new(), ..full };
    is_failure(&error, 1, "cannot write /dev/full: No space left");
}

#[cfg(unix)]
#[test]
fn a_killed_run_leaves_a_valid_recording_and_a_folder_that_the_next_run_can_use() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).display().to_string();
    let [out, other, file] = ["out", "other", "run.csv"].map(at);
    let endless = format!("identify --rig built-in --set=record.hold_periods=190000 --out {out} --record {file}");
    let mut endless = Running::start(&words(&endless));
    wait_for_rows(Path::new(&file), 1000);
    let busy = "another run of this program writes there";
    fails(&format!("{SHORT} --out {out}"), 2, busy);
    let twice = format!("{SHORT} --out {other} --record {file}");
    fails(&twice, 2, "another run is recording to it");
    endless.signal("KILL");
    drop(endless);
    let recorded = fs::read_to_string(&file).unwrap();
    let mut rows = recorded.lines();
    let head = "time,response,reference,omega,E,phase_error,state,fault";
    assert_eq!(rows.next(), Some(head));
    // The system may cut the last write at the end of a page.
    let whole: Vec<&str> = rows.collect();
    let (_, whole) = whole.split_last().unwrap();
    assert!(whole.len() > 500 && whole.iter().all(|row| row.split(',').count() == 8));
    let next = vines(&format!("{SHORT} --out {out} --record {file}"));
    assert!(next.status.success(), "{next:?}");
    assert_eq!(names(Path::new(&out)), ["tracked.csv", "tracked.json", "tracked.svg"]);
    assert!(!Path::new(&other).exists());
}

#[test]
fn the_files_in_a_folder_are_of_one_run() {
    let folder = tempfile::tempdir().unwrap();
    let results = ["tracked.csv", "tracked.json", "tracked.svg"];
    let run = |settings: &str| vines(&format!("{SHORT} {settings} --out {}", folder.path().display()));
    assert!(run("").status.success());
    let limited = run("--set=phase_lock.response_max=0.001");
    is_failure(&limited, 1, "results of an earlier run are in");
    assert_eq!(names(folder.path()), ["interrupted.csv", "previous"]);
    assert_eq!(names(&folder.path().join("previous")), results);
    assert!(run("").status.success());
    assert_eq!(names(folder.path()), [&["previous"], &results[..]].concat());
}

#[test]
fn a_backbone_of_motions_that_never_settle_is_a_failure_with_the_levels_at_which_they_would() {
    let folder = tempfile::tempdir().unwrap();
    let levels = "--set=backbone.points=2 --set=backbone.C_from=0.1 --set=backbone.C_to=0.103";
    let below = vines(&format!("backbone {levels} --out {}", folder.path().display()));
    assert!(text(&below).contains("0 of 2 points"), "{below:?}");
    let error = Output { stdout: Vec::new(), ..below };
    is_failure(&error, 1, "in the ideal cavity it is stable for C from 0.13");
}
