//! Guards the stores of sweeps: several writers, stops, damage, cells without results, and folders that hold something else.

mod common;

use std::{fs, io::Read, path::Path, sync::atomic::Ordering::Relaxed, thread, time::Duration};

use common::{array, computed, computed_part, counts, files, numbers, plan, refused_in, settings, values};
use vines_sweep::{ABSENT, Axis, FAILED, Monitor, Settings, Shard, Sweep, UNCOUNTED, Values, collect, run, verify};
use vines_testbench::scene::Family;
use zarrs::storage::ReadableStorageTraits;

/// Three chunks: two of seven cells, and one of four.
fn three_chunks() -> Sweep {
    plan(settings(&["plant.r=0.3:0.9:18"])).unwrap()
}

type Damage = fn(&Path);

/// Ways to damage a file, and what is said of it.
const DAMAGE: [(&str, Damage); 5] = [
    ("is missing", |file| fs::remove_file(file).unwrap()),
    ("is truncated", |file| fs::write(file, []).unwrap()),
    ("is truncated", |file| {
        edit(file, |content| content.truncate(content.len() - 3))
    }),
    ("is damaged", |file| {
        edit(file, |content| *content.last_mut().unwrap() ^= 1)
    }),
    ("is damaged (it continues after its end)", |file| {
        edit(file, |content| content.push(0))
    }),
];

fn edit(file: &Path, change: impl FnOnce(&mut Vec<u8>)) {
    let mut content = fs::read(file).unwrap();
    change(&mut content);
    fs::write(file, content).unwrap();
}

/// Verifies a store, and returns what is damaged and the number of its cells.
fn verified(plan: &Sweep, folder: &Path) -> (Option<String>, u64) {
    let (before, monitor) = (files(folder), Monitor::default());
    assert!(verify(plan, folder, Shard::ALL, &monitor).unwrap());
    assert!(before == files(folder));
    (monitor.damage(), counts(&monitor).0)
}

#[test]
fn shards_stops_and_resumptions_give_the_same_bytes() {
    let [whole, parts] = std::array::from_fn(|_| tempfile::tempdir().unwrap());
    let axes = [
        "start.dq2=random:-1:1",
        "plant.r=0.4,0.65,0.8",
        "excitation.G=random:0.5:1.5",
    ];
    let plan = plan(Settings { samples: Some(20), ..settings(&axes) }).unwrap();
    computed(&plan, whole.path());
    let stopped = Monitor::default();
    stopped.stop.store(true, Relaxed);
    assert!(!run(&plan, parts.path(), Shard::ALL, &stopped).unwrap());
    for number in [1, 0] {
        computed_part(&plan, parts.path(), number, 2);
    }
    assert_eq!(counts(&computed(&plan, parts.path())), (60, 0));
    assert!(files(whole.path()) == files(parts.path()));
}

#[test]
fn a_store_has_the_bytes_that_zarrs_writes() {
    let folder = tempfile::tempdir().unwrap();
    // Values for which a compressor that is called in another way gives other bytes. The starts are outside the cavity: no cell takes time.
    let mut noise = 4_u64;
    let mut next = || {
        noise ^= noise << 13;
        noise ^= noise >> 7;
        noise ^= noise << 17;
        noise
    };
    let mut value = || match next() % 4 {
        0 => 1.0 + (next() >> 11) as f64 / 2_f64.powi(53),
        _ => 1.0,
    };
    let values = Values::Paired((0..12_000).map(|_| value()).collect());
    let axes = vec![Axis::new("start.q2", values).unwrap()];
    computed(
        &plan(Settings { axes, chunk: 12_000, ..settings(&[]) }).unwrap(),
        folder.path(),
    );
    let (memory, array) = array(folder.path(), "start.q2");
    let values: Vec<f64> = array.retrieve_chunk(&[0]).unwrap();
    array.store_chunk(&[0], values).unwrap();
    let written = memory.get(&"a/c/0".try_into().unwrap()).unwrap().unwrap();
    assert!(written == fs::read(folder.path().join("start.q2/c/0")).unwrap());
}

#[test]
fn a_stop_ends_a_sweep_that_still_writes_its_axes() {
    let folder = tempfile::tempdir().unwrap();
    let random = settings(&["plant.r=random:0.3:0.9"]);
    let plan = plan(Settings { samples: Some(4_000_000_000), chunk: 1, ..random }).unwrap();
    let monitor = Monitor::default();
    thread::scope(|scope| {
        let running = scope.spawn(|| run(&plan, folder.path(), Shard::ALL, &monitor));
        thread::sleep(Duration::from_millis(100));
        monitor.stop.store(true, Relaxed);
        assert!(!running.join().unwrap().unwrap());
    });
    assert_eq!(counts(&monitor), (0, 0));
}

#[test]
fn a_damaged_chunk_is_reported_by_a_verification_and_computed_again_by_the_same_sweep() {
    let folder = tempfile::tempdir().unwrap();
    let plan = three_chunks();
    computed(&plan, folder.path());
    let whole = files(folder.path());
    for (fault, damage) in DAMAGE {
        for name in ["regime/c/1", "settling/c/1", "failure/c/1"] {
            let file = folder.path().join(name);
            damage(&file);
            let (text, found) = verified(&plan, folder.path());
            assert!(
                text.as_ref().unwrap().contains(&format!("{} {fault}", file.display())),
                "{text:?}"
            );
            assert_eq!(found, 11, "{name} {fault}");
            let monitor = computed(&plan, folder.path());
            assert_eq!((monitor.damage(), counts(&monitor)), (text, (11, 7)));
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
    assert_eq!(verified(&plan, folder.path()), (None, 11));
    computed(&plan, folder.path());
    assert!(whole == files(folder.path()));
}

#[test]
fn a_flipped_bit_is_found_or_changes_no_value() {
    let folder = tempfile::tempdir().unwrap();
    let plan = plan(settings(&["plant.r=0.3:0.9:5"])).unwrap();
    computed(&plan, folder.path());
    let content = |file: &[u8]| {
        let mut content = Vec::new();
        flate2::read::GzDecoder::new(file).read_to_end(&mut content).unwrap();
        content
    };
    for name in ["followed/c/0", "settling/c/0", "failure/c/0"] {
        let file = folder.path().join(name);
        let whole = fs::read(&file).unwrap();
        for bit in 0..8 * whole.len() {
            edit(&file, |content| content[bit / 8] ^= 1 << (bit % 8));
            let monitor = Monitor::default();
            assert!(verify(&plan, folder.path(), Shard::ALL, &monitor).unwrap());
            // Bits that fill up a byte, unused codes, and the time in the header.
            let same = || content(&fs::read(&file).unwrap()) == content(&whole);
            assert!(monitor.damage().is_some() || same(), "{name}: bit {bit}");
            fs::write(&file, &whole).unwrap();
        }
    }
}

#[test]
fn stores_of_parts_are_collected_to_the_same_bytes_and_damaged_chunks_are_taken_from_elsewhere_or_computed() {
    let [whole, one, other, merged] = std::array::from_fn(|_| tempfile::tempdir().unwrap());
    let plan = three_chunks();
    computed(&plan, whole.path());
    let whole = files(whole.path());
    computed_part(&plan, one.path(), 0, 2);
    computed_part(&plan, other.path(), 1, 2);
    let collected = |sources: &[&Path], count: u64| {
        let monitor = Monitor::default();
        let sources: Vec<_> = sources.iter().map(|source| source.to_path_buf()).collect();
        collect(&plan, merged.path(), &sources, &monitor).unwrap();
        assert!(run(&plan, merged.path(), Shard::ALL, &monitor).unwrap());
        assert_eq!(counts(&monitor), (18 - count, count));
        assert!(whole == files(merged.path()));
        monitor.damage()
    };
    let both = [one.path(), other.path()];
    assert_eq!(collected(&both, 0), None);
    for (fault, damage) in DAMAGE {
        // What is damaged in the merged store comes from the sources again.
        damage(&merged.path().join("regime/c/1"));
        assert!(collected(&both, 0).unwrap().contains(fault));
        damage(&other.path().join("regime/c/1"));
        fs::remove_dir_all(merged.path()).unwrap();
        assert!(collected(&both, 7).unwrap().contains(fault));
        fs::write(other.path().join("regime/c/1"), &whole["regime/c/1"]).unwrap();
    }
    let error = collect(&plan, merged.path(), &["missing".into()], &Monitor::default()).unwrap_err();
    assert!(error.to_string().contains("missing is not the store"), "{error}");
}

#[test]
fn axes_and_metadata_are_written_again_and_attributes_of_users_stay() {
    let folder = tempfile::tempdir().unwrap();
    let plan = three_chunks();
    computed(&plan, folder.path());
    let whole = files(folder.path());
    fs::remove_file(folder.path().join("failure/zarr.json")).unwrap();
    for (fault, damage) in DAMAGE {
        damage(&folder.path().join("plant.r/c/1"));
        let text = verified(&plan, folder.path()).0.unwrap();
        assert!(text.contains(&format!("plant.r/c/1 {fault}")), "{text}");
        assert_eq!(
            text.contains("failure/zarr.json is missing"),
            fault == "is missing",
            "{text}"
        );
        computed(&plan, folder.path());
        assert!(whole == files(folder.path()), "{fault}");
    }
    for (name, here) in [("zarr.json", "\"title\""), ("regime/zarr.json", "\"long_name\"")] {
        edit(&folder.path().join(name), |content| {
            let text = String::from_utf8(content.clone()).unwrap();
            *content = text.replacen(here, &format!("\"note\": \"mine\", {here}"), 1).into();
        });
    }
    let mine = files(folder.path());
    computed(&plan, folder.path());
    assert!(mine != whole && mine == files(folder.path()));
}

#[test]
fn a_store_of_another_sweep_and_other_files_stay_as_they_are() {
    let folder = tempfile::tempdir().unwrap();
    let inner = folder.path().join("r.zarr");
    let values = || settings(&["plant.r=0.3,0.5"]);
    computed(&plan(values()).unwrap(), &inner);
    let axes = refused_in(&plan(settings(&["plant.r=0.3,0.6"])).unwrap(), &inner);
    assert!(axes.contains("another `axes`"), "{axes}");
    let family = Family::parse("", None, &["plant.b=0.02".parse().unwrap()]).unwrap();
    let scene = refused_in(&Sweep::new(family, values()).unwrap(), &inner);
    assert!(scene.contains("another `scene`"), "{scene}");
    // Another version does not continue the store.
    let group = inner.join("zarr.json");
    let text = fs::read_to_string(&group).unwrap();
    fs::write(&group, text.replace(env!("CARGO_PKG_VERSION"), "0.0.9")).unwrap();
    let version = refused_in(&plan(values()).unwrap(), &inner);
    assert!(version.contains("another `version`"), "{version}");
    // Chunks without the file that says to which sweep they belong, a folder of stores, and one of other files.
    let no_store = |folder: &Path| {
        let error = refused_in(&plan(values()).unwrap(), folder);
        assert!(error.contains("is not the store of a sweep"), "{error}");
    };
    fs::write(&group, &text[..text.len() - 3]).unwrap();
    no_store(&inner);
    fs::remove_file(&group).unwrap();
    no_store(&inner);
    no_store(folder.path());
    fs::write(folder.path().join("notes.txt"), "mine").unwrap();
    no_store(folder.path());
}

#[test]
fn what_a_kill_leaves_before_the_metadata_is_no_other_file() {
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir(folder.path().join(".partial")).unwrap();
    fs::write(folder.path().join(".partial/0"), "{").unwrap();
    computed(&three_chunks(), folder.path());
    assert!(!folder.path().join(".partial").exists());
}

#[test]
fn cells_that_are_not_computed_differ_from_computed_and_failed_ones() {
    let folder = tempfile::tempdir().unwrap();
    // The last chunk is not full, and the starts of the first cells are outside the cavity.
    let starts = settings(&["start.q2=-0.011,-0.005,0.002,0.003,0.004"]);
    let plan = plan(Settings { chunk: 2, ..starts }).unwrap();
    let monitor = computed_part(&plan, folder.path(), 0, 2);
    assert_eq!((counts(&monitor), monitor.failed.load(Relaxed)), ((0, 3), 1));
    let codes: Vec<u8> = values(folder.path(), "regime");
    assert_eq!((codes[0], &codes[2..4]), (FAILED, &[ABSENT; 2][..]));
    assert!(codes[1] < 8 && codes[4] < 8, "{codes:?}");
    let absent = [true, false, true, true, false];
    for name in ["followed", "impacts", "periods"] {
        let counts: Vec<u32> = values(folder.path(), name);
        assert_eq!(counts.iter().map(|one| *one == UNCOUNTED).collect::<Vec<_>>(), absent);
        let metadata = fs::read_to_string(folder.path().join(name).join("zarr.json")).unwrap();
        assert!(metadata.contains("\"_FillValue\": 4294967295"), "{metadata}");
    }
    let settling = numbers(folder.path(), "settling");
    assert_eq!(settling.iter().map(|one| one.is_nan()).collect::<Vec<_>>(), absent);
    let reasons: Vec<String> = values(folder.path(), "failure");
    assert_eq!(monitor.reason.get(), Some(&reasons[0]));
    assert!(
        reasons[0].contains("0.011 m") && reasons[0].contains("from -b_minus to b_plus"),
        "{reasons:?}"
    );
    assert_eq!(reasons[1..], ["", "not computed", "not computed", ""]);
}
