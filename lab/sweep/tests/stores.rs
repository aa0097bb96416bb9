//! Stores of sweeps: several writers, damage, cells without results, and folders that hold something else.

mod common;

use std::{collections::BTreeMap, fs, io::Read, path::Path, sync::atomic::Ordering::Relaxed, thread, time::Duration};

use common::{array, files, numbers, plan, refused, settings};
use vines_sweep::{ABSENT, FAILED, Monitor, Settings, Shard, Sweep, UNCOUNTED, collect, run, verify};

#[test]
fn a_folder_of_other_stores_does_not_become_a_store() {
    let folder = tempfile::tempdir().unwrap();
    let plan = plan(settings(&["plant.r=0.3,0.5"])).unwrap();
    let inner = folder.path().join("r.zarr");
    assert!(run(&plan, &inner, Shard::ALL, &Monitor::default()).unwrap());
    let before = files(folder.path());
    let error = run(&plan, folder.path(), Shard::ALL, &Monitor::default())
        .unwrap_err()
        .to_string();
    assert!(error.contains("not the store of a sweep"), "{error}");
    assert!(files(folder.path()) == before);
}

#[test]
fn a_stop_ends_a_sweep_that_still_writes_its_axes_or_counts_its_chunks() {
    let folder = tempfile::tempdir().unwrap();
    let samples = Settings {
        samples: Some(4_000_000_000),
        chunk: 1,
        ..settings(&["plant.r=random:0.3:0.9"])
    };
    let monitor = Monitor::default();
    let stopped = |plan: &_| {
        thread::scope(|scope| {
            let running = scope.spawn(|| run(plan, folder.path(), Shard::ALL, &monitor));
            thread::sleep(Duration::from_millis(100));
            monitor.stop.store(true, Relaxed);
            running.join().unwrap().unwrap()
        })
    };
    assert!(!stopped(&plan(samples).unwrap()));
    assert!(!folder.path().join("zarr.json").exists());
}

#[test]
fn a_chunk_that_does_not_fit_into_memory_is_refused() {
    let error = refused(Settings { chunk: 1 << 40, ..settings(&["plant.r=0.3:0.9:400"]) });
    assert!(error.contains("1099511627776 cells: from 1 to 1000000"), "{error}");
}

/// Three chunks: two of seven cells, and one of four.
fn three_chunks() -> Sweep {
    plan(settings(&["plant.r=0.3:0.9:18"])).unwrap()
}

fn computed(plan: &Sweep, folder: &Path) -> BTreeMap<String, Vec<u8>> {
    assert!(run(plan, folder, Shard::ALL, &Monitor::default()).unwrap());
    files(folder)
}

type Damage = fn(&Path);

/// Ways to damage a file, and what is said of it.
const DAMAGE: [(&str, Damage); 6] = [
    ("is missing", |file| fs::remove_file(file).unwrap()),
    ("is empty", |file| fs::write(file, []).unwrap()),
    ("is truncated", |file| {
        edit(file, |content| content.truncate(content.len() - 3))
    }),
    ("is truncated", |file| edit(file, |content| content.truncate(5))),
    ("damaged content or checksum", |file| {
        edit(file, |content| *content.last_mut().unwrap() ^= 1)
    }),
    ("continues after its end", |file| edit(file, |content| content.push(0))),
];

fn edit(file: &Path, change: impl FnOnce(&mut Vec<u8>)) {
    let mut content = fs::read(file).unwrap();
    change(&mut content);
    fs::write(file, content).unwrap();
}

#[test]
fn a_damaged_chunk_is_reported_by_a_verification_and_computed_again_by_the_same_sweep() {
    let folder = tempfile::tempdir().unwrap();
    let plan = three_chunks();
    let whole = computed(&plan, folder.path());
    let counts = |monitor: &Monitor| (monitor.found.load(Relaxed), monitor.computed.load(Relaxed));
    for (fault, damage) in DAMAGE {
        for name in ["regime/c/1", "settling/c/1", "failure/c/1"] {
            let file = folder.path().join(name);
            damage(&file);
            let before = files(folder.path());
            let monitor = Monitor::default();
            assert!(verify(&plan, folder.path(), Shard::ALL, &monitor).unwrap());
            let text = monitor.damage().unwrap();
            assert!(
                text.contains(&format!("{} ", file.display())) && text.contains(fault),
                "{text}"
            );
            assert_eq!(counts(&monitor), (11, 0), "{name} {fault}");
            assert!(before == files(folder.path()));
            let monitor = Monitor::default();
            assert!(run(&plan, folder.path(), Shard::ALL, &monitor).unwrap());
            assert_eq!((monitor.damage(), counts(&monitor)), (Some(text), (11, 7)));
            assert!(whole == files(folder.path()), "{name} {fault}");
        }
    }
    // Nothing says of a chunk without any file that it has been there.
    for name in whole
        .keys()
        .filter(|name| name.ends_with("/c/1") && !name.starts_with("plant.r"))
    {
        fs::remove_file(folder.path().join(name)).unwrap();
    }
    let monitor = Monitor::default();
    assert!(verify(&plan, folder.path(), Shard::ALL, &monitor).unwrap());
    assert_eq!((monitor.damage(), counts(&monitor)), (None, (11, 0)));
    assert!(computed(&plan, folder.path()) == whole);
}

#[test]
fn a_flipped_bit_is_found_or_changes_no_value() {
    let folder = tempfile::tempdir().unwrap();
    let plan = plan(settings(&["plant.r=0.3:0.9:5"])).unwrap();
    let whole = computed(&plan, folder.path());
    for name in ["followed/c/0", "settling/c/0", "failure/c/0"] {
        let file = folder.path().join(name);
        let values = content(&whole[name]);
        for bit in 0..8 * whole[name].len() {
            edit(&file, |content| content[bit / 8] ^= 1 << (bit % 8));
            let monitor = Monitor::default();
            assert!(verify(&plan, folder.path(), Shard::ALL, &monitor).unwrap());
            // Bits that fill up a byte, and unused codes.
            let same = || content(&fs::read(&file).unwrap()) == values;
            assert!(monitor.damage().is_some() || same(), "{name}: bit {bit}");
            fs::write(&file, &whole[name]).unwrap();
        }
    }
}

/// The content of a compressed file.
fn content(file: &[u8]) -> Vec<u8> {
    let mut content = Vec::new();
    flate2::read::GzDecoder::new(file).read_to_end(&mut content).unwrap();
    content
}

#[test]
fn a_damaged_chunk_is_not_collected_but_taken_from_elsewhere_or_computed() {
    let [one, other, merged] = std::array::from_fn(|_| tempfile::tempdir().unwrap());
    let plan = three_chunks();
    let whole = computed(&plan, one.path());
    assert!(run(&plan, other.path(), Shard { number: 0, of: 2 }, &Monitor::default()).unwrap());
    let sources = [one.path().to_path_buf(), other.path().to_path_buf()];
    let collected = |count: u64| {
        let monitor = Monitor::default();
        collect(&plan, merged.path(), &sources, &monitor).unwrap();
        assert!(run(&plan, merged.path(), Shard::ALL, &monitor).unwrap());
        assert_eq!(monitor.computed.load(Relaxed), count);
        assert!(whole == files(merged.path()));
        monitor.damage().unwrap()
    };
    for (fault, damage) in DAMAGE {
        // The first chunk is in the other store, too; the second is not.
        for (name, count) in [("regime/c/0", 0), ("regime/c/1", 7)] {
            let file = one.path().join(name);
            damage(&file);
            let text = collected(count);
            assert!(text.contains(fault), "{text}");
            fs::write(&file, &whole[name]).unwrap();
            // What is damaged in the merged store comes from the sources again.
            damage(&merged.path().join(name));
            collected(0);
            fs::remove_dir_all(merged.path()).unwrap();
        }
    }
}

#[test]
fn damaged_axes_and_metadata_are_written_again_and_attributes_of_users_stay() {
    let folder = tempfile::tempdir().unwrap();
    let plan = three_chunks();
    let whole = computed(&plan, folder.path());
    for (fault, damage) in DAMAGE {
        for name in ["plant.r/c/1", "plant.r/zarr.json", "failure/zarr.json"] {
            damage(&folder.path().join(name));
            let before = files(folder.path());
            let monitor = Monitor::default();
            assert!(verify(&plan, folder.path(), Shard::ALL, &monitor).unwrap());
            let text = monitor.damage().unwrap();
            assert!(
                text.contains(name) && (name.ends_with("json") || text.contains(fault)),
                "{text}"
            );
            assert!(before == files(folder.path()));
            assert!(computed(&plan, folder.path()) == whole, "{name} {fault}");
        }
    }
    let replace = |name: &str, here: &str, there: &str| {
        let file = folder.path().join(name);
        let text = fs::read_to_string(&file).unwrap();
        assert!(text.contains(here), "{text}");
        fs::write(file, text.replacen(here, there, 1)).unwrap();
    };
    replace("zarr.json", "uint32", "uint64");
    assert!(computed(&plan, folder.path()) == whole);
    replace("zarr.json", "\"title\"", "\"note\": \"mine\", \"title\"");
    replace("regime/zarr.json", "\"long_name\"", "\"note\": \"mine\", \"long_name\"");
    let mine = files(folder.path());
    assert!(computed(&plan, folder.path()) == mine);
}

#[test]
fn chunks_without_the_file_that_names_their_sweep_are_not_taken_for_those_of_another() {
    let folder = tempfile::tempdir().unwrap();
    let whole = computed(&three_chunks(), folder.path());
    let other = plan(settings(&["plant.r=0.3:0.8:18"])).unwrap();
    for (_, damage) in DAMAGE {
        damage(&folder.path().join("zarr.json"));
        let before = files(folder.path());
        for plan in [&other, &three_chunks()] {
            let error = run(plan, folder.path(), Shard::ALL, &Monitor::default())
                .unwrap_err()
                .to_string();
            // With a wrong last byte or one more, the file is no JSON either.
            assert!(
                error.contains("zarr.json, which says to which sweep they belong"),
                "{error}"
            );
            assert!(before == files(folder.path()));
        }
        fs::write(folder.path().join("zarr.json"), &whole["zarr.json"]).unwrap();
    }
    // Axes that a kill has left are those of another sweep.
    for name in whole
        .keys()
        .filter(|name| *name == "zarr.json" || name.contains("/c/") && !name.starts_with("plant.r"))
    {
        fs::remove_file(folder.path().join(name)).unwrap();
    }
    for entry in fs::read_dir(folder.path()).unwrap().flatten() {
        drop(fs::remove_dir(entry.path().join("c")));
    }
    assert!(run(&other, folder.path(), Shard::ALL, &Monitor::default()).unwrap());
    assert_eq!(numbers(folder.path(), "plant.r")[17], 0.8);
}

#[test]
fn cells_that_are_not_computed_differ_from_computed_and_failed_ones() {
    let folder = tempfile::tempdir().unwrap();
    // The last chunk is not full, and the starts of the first cells are outside the cavity.
    let plan = plan(Settings {
        chunk: 2,
        ..settings(&["start.q2=-0.011,-0.005,0.002,0.003,0.004"])
    })
    .unwrap();
    assert!(run(&plan, folder.path(), Shard { number: 0, of: 2 }, &Monitor::default()).unwrap());
    let regime = array(folder.path(), "regime");
    let codes: Vec<u8> = regime.retrieve_array_subset(&regime.subset_all()).unwrap();
    assert_eq!((codes[0], &codes[2..4]), (FAILED, &[ABSENT; 2][..]));
    assert!(codes[1] < 8 && codes[4] < 8, "{codes:?}");
    for name in ["followed", "impacts", "periods"] {
        let counts = array(folder.path(), name);
        let values: Vec<u32> = counts.retrieve_array_subset(&counts.subset_all()).unwrap();
        assert_eq!(
            values.iter().map(|one| *one == UNCOUNTED).collect::<Vec<_>>(),
            [true, false, true, true, false]
        );
        assert_eq!(counts.attributes()["_FillValue"], UNCOUNTED);
    }
    let failure = array(folder.path(), "failure");
    let reasons: Vec<String> = failure.retrieve_array_subset(&failure.subset_all()).unwrap();
    assert!(reasons[0].contains("from -b_minus to b_plus"), "{reasons:?}");
    assert_eq!(reasons[1..], ["", "not computed", "not computed", ""]);
}
