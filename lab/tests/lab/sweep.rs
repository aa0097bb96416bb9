//! Guards `vines sweep` as a program: kills, signals, a full disk and folders that cannot be written.

use std::{
    collections::BTreeMap,
    fs,
    path::Path,
    process::{Child, Command, Output, Stdio},
    thread,
    time::Duration,
};

use crate::PROGRAM;

const ARGUMENTS: [&str; 5] = [
    "sweep",
    "--axis=sigma=-3:3:61",
    "--axis=start.dq2=-0.7:0.7:50",
    "--periods=200",
    "--chunk=25",
];

fn vines(arguments: &[&str], out: &Path) -> Command {
    let mut command = Command::new(PROGRAM);
    command.args(arguments).arg("--out").arg(out);
    command.stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

fn text(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr)
}

fn files(folder: &Path, below: &str, all: &mut BTreeMap<String, Vec<u8>>) {
    for entry in fs::read_dir(folder.join(below)).unwrap().flatten() {
        let name = format!("{below}/{}", entry.file_name().display());
        if entry.path().is_dir() {
            files(folder, name.trim_start_matches('/'), all);
        } else {
            all.insert(name, fs::read(entry.path()).unwrap());
        }
    }
}

fn content(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut all = BTreeMap::new();
    files(folder, "", &mut all);
    all
}

/// Sends a signal to a program that a test started, if it is still running.
fn signalled(mut child: Child, signal: &str) -> Option<Output> {
    if child.try_wait().unwrap().is_none() {
        let id = child.id().to_string();
        Command::new("kill").args(["-s", signal, &id]).status().unwrap();
    }
    child.wait_with_output().ok()
}

#[test]
fn after_20_kills_a_store_with_and_without_inference_is_that_of_an_undisturbed_run() {
    for further in [&[][..], &["--adaptive"]] {
        let arguments = [&ARGUMENTS[..], further].concat();
        let folder = tempfile::tempdir().unwrap();
        let [whole, killed] = ["whole", "killed"].map(|name| folder.path().join(name));
        let complete = |out: &Path| {
            let output = vines(&arguments, out).output().unwrap();
            assert!(output.status.success(), "{}", text(&output));
        };
        complete(&whole);
        let mut kills = 0;
        for n in 0.. {
            // From before the metadata is there to the middle of the chunks.
            let after = Duration::from_millis(3 + 7 * n % 60);
            let child = vines(&arguments, &killed).spawn().unwrap();
            thread::sleep(after);
            let output = signalled(child, "KILL").unwrap();
            if output.status.success() {
                // A fast machine is done before the last kill.
                assert!(content(&whole) == content(&killed));
                fs::remove_dir_all(&killed).unwrap();
            } else {
                assert!(output.status.code().is_none(), "{}", text(&output));
                kills += 1;
            }
            if kills == 20 {
                break;
            }
        }
        complete(&killed);
        assert!(content(&whole) == content(&killed));
    }
}

#[test]
fn damaged_and_missing_files_are_named_by_a_verification_and_replaced_by_the_same_sweep() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("store");
    let go = |further: &[&str], code, part: &str| {
        let base = ["sweep", "--axis=plant.r=0.3:0.9:20", "--periods=100", "--chunk=8"];
        let output = vines(&[&base, further].concat(), &out).output().unwrap();
        assert_eq!(output.status.code(), Some(code), "{}", text(&output));
        assert!(text(&output).contains(part), "{part}: {}", text(&output));
    };
    go(&["--verify"], 1, "is not the store of a sweep");
    assert!(!out.exists());
    go(&["--shard=1/2"], 0, "12 computed");
    go(&["--verify"], 1, "12 of 20 cells are complete and undamaged");
    go(&["--verify", "--shard=1/2"], 0, "12 of 12 cells");
    go(&[], 0, "12 already complete, 8 computed");
    let whole = content(&out);
    fs::write(out.join("impacts/c/1"), "").unwrap();
    go(&["--verify"], 1, "impacts/c/1 is truncated");
    go(&[], 0, "12 already complete, 8 computed");
    go(&["--verify"], 0, "20 of 20 cells are complete and undamaged");
    assert!(content(&out) == whole);
}

#[test]
fn ctrl_c_keeps_complete_chunks_and_the_same_command_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("store");
    let mut arguments = ARGUMENTS.map(String::from);
    arguments[1] = "--axis=sigma=-3:3:3001".into();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let child = vines(&arguments, &out).spawn().unwrap();
    let begun = (0..6000).any(|_| {
        thread::sleep(Duration::from_millis(10));
        out.join("failure/c").exists()
    });
    assert!(begun);
    let output = signalled(child, "INT").unwrap();
    assert_eq!(output.status.code(), Some(130), "{}", text(&output));
    assert!(
        text(&output).contains("the same command continues"),
        "{}",
        text(&output)
    );
    let chunks = content(&out).keys().filter(|key| key.starts_with("failure/c/")).count();
    println!("{chunks} chunks");
    assert!(chunks > 0);
}

#[test]
fn a_full_disk_and_a_folder_that_cannot_be_written_are_explained() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("store");
    // No file may grow beyond one block: as on a full disk, metadata that fits is written and a larger chunk is not.
    let arguments = "sweep --axis plant.r=0.3:0.9:400 --periods 100 --sigma=-4";
    let script = format!(
        "trap '' XFSZ; ulimit -f 4; exec {} {arguments} --out {}",
        PROGRAM,
        out.display()
    );
    let output = Command::new("sh").args(["-c", &script]).output().unwrap();
    assert_eq!(output.status.code(), Some(1), "{}", text(&output));
    assert!(
        text(&output).contains("cannot write to") && text(&output).contains("continues the sweep"),
        "{}",
        text(&output)
    );
    let output = vines(&["sweep", "--axis", "plant.r=0.3,0.4"], Path::new("/proc/store"))
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(1), "{}", text(&output));
    assert!(
        text(&output).contains("cannot write to /proc/store"),
        "{}",
        text(&output)
    );
}

#[test]
fn a_large_sweep_needs_a_confirmation() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("store");
    let arguments = ["sweep", "--axis=plant.r=0.3:0.9:1000000", "--axis=sigma=-5:5:1000000"];
    let output = vines(&arguments, &out).output().unwrap();
    assert_eq!(output.status.code(), Some(2), "{}", text(&output));
    let text = text(&output);
    assert!(
        text.contains("1000000000000 cells") && text.contains(" h ") && text.contains("GB") && text.contains("--yes"),
        "{text}"
    );
    assert!(!out.exists());
}
