//! Guards `vines sweep` as a program: kills, signals, a full disk and folders that cannot be written.

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
    process::Command,
    thread,
    time::Duration,
};

use crate::{PROGRAM, Running, text, vines, words};

const SWEEP: &str = "sweep --axis=sigma=-3:3:61 --axis=start.dq2=-0.7:0.7:50 --periods=200 --chunk=25";

/// Runs a sweep into a folder; it must end with this code and say so.
fn ends(line: &str, out: &Path, code: i32, parts: &[&str]) {
    let output = vines(&format!("{line} --out {}", out.display()));
    let text = text(&output);
    assert_eq!(output.status.code(), Some(code), "{text}");
    assert!(parts.iter().all(|part| text.contains(part)), "{parts:?}: {text}");
}

fn start(line: &str, out: &Path) -> Running {
    Running::start(&words(&format!("{line} --out {}", out.display())))
}

/// All files below a folder.
fn content(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let files = entries.flat_map(|path| {
        let name = PathBuf::from(path.file_name().unwrap());
        match path.is_dir() {
            true => content(&path)
                .into_iter()
                .map(|(file, content)| (name.join(file), content))
                .collect(),
            false => vec![(name, fs::read(&path).unwrap())],
        }
    });
    files.collect()
}

#[test]
fn after_20_kills_a_store_with_and_without_inference_is_that_of_an_undisturbed_run() {
    for further in ["", "--adaptive"] {
        let line = format!("{SWEEP} {further}");
        let folder = tempfile::tempdir().unwrap();
        let [whole, killed] = ["whole", "killed"].map(|name| folder.path().join(name));
        ends(&line, &whole, 0, &[]);
        let mut kills = 0;
        for n in 0.. {
            let mut sweep = start(&line, &killed);
            // From before the metadata is there to the middle of the chunks.
            thread::sleep(Duration::from_millis(3 + 7 * n % 60));
            sweep.signal("KILL");
            let output = sweep.output();
            if output.status.success() {
                // A fast machine is done before the last kill.
                assert!(content(&whole) == content(&killed));
                fs::remove_dir_all(&killed).unwrap();
            } else {
                assert!(output.status.code().is_none(), "{output:?}");
                kills += 1;
            }
            if kills == 20 {
                break;
            }
        }
        ends(&line, &killed, 0, &[]);
        assert!(content(&whole) == content(&killed));
    }
}

#[test]
fn damaged_and_missing_files_are_named_by_a_verification_and_replaced_by_the_same_sweep() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("store");
    let go = |further: &str, code, part: &str| {
        let line = "sweep --axis=plant.r=0.3:0.9:20 --periods=100 --chunk=8";
        ends(&format!("{line} {further}"), &out, code, &[part]);
    };
    go("--verify", 1, "is not the store of a sweep");
    assert!(!out.exists());
    go("--shard=1/2", 0, "12 computed");
    go("--verify", 1, "12 of 20 cells are complete and undamaged");
    go("--verify --shard=1/2", 0, "12 of 12 cells");
    go("", 0, "12 already complete, 8 computed");
    let whole = content(&out);
    fs::write(out.join("impacts/c/1"), "").unwrap();
    go("--verify", 1, "impacts/c/1 is truncated");
    go("", 0, "12 already complete, 8 computed");
    go("--verify", 0, "20 of 20 cells are complete and undamaged");
    assert!(content(&out) == whole);
}

#[test]
fn ctrl_c_keeps_complete_chunks_and_the_same_command_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("store");
    let mut sweep = start(&SWEEP.replace("3:61", "3:3001"), &out);
    let begun = (0..6000).any(|_| {
        thread::sleep(Duration::from_millis(10));
        out.join("failure/c").exists()
    });
    assert!(begun);
    sweep.signal("INT");
    let output = sweep.output();
    assert_eq!(output.status.code(), Some(130), "{output:?}");
    assert!(text(&output).contains("the same command continues"), "{output:?}");
    assert!(content(&out).keys().any(|key| key.starts_with("failure/c")));
}

#[test]
fn a_full_disk_a_folder_that_cannot_be_written_and_a_sweep_that_is_too_large_are_explained() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("store");
    let large = "sweep --axis=plant.r=0.3:0.9:1000000 --axis=sigma=-5:5:1000000";
    ends(large, &out, 2, &["1000000000000 cells", " h ", "GB", "--yes"]);
    assert!(!out.exists());
    let parts = ["cannot write to /proc/store"];
    ends("sweep --axis plant.r=0.3,0.4", Path::new("/proc/store"), 1, &parts);
    // No file may grow beyond one block: as on a full disk, metadata that fits is written and a larger chunk is not.
    let sweep = format!("{PROGRAM} sweep --axis plant.r=0.3:0.9:400 --periods 100 --sigma=-4");
    let script = format!("trap '' XFSZ; ulimit -f 4; exec {sweep} --out {}", out.display());
    let output = Command::new("sh").args(["-c", &script]).output().unwrap();
    assert_eq!(output.status.code(), Some(1), "{output:?}");
    for part in ["cannot write to", "continues the sweep"] {
        assert!(text(&output).contains(part), "{output:?}");
    }
}
