//! Guards the stores of sweeps: several writers, stops, damage, cells without results, and folders that hold something else.

use std::{fs, io::Read, path::Path, sync::atomic::Ordering::Relaxed, thread, time::Duration};

use vines_sweep::{Axis, FAILED, Monitor, Settings, Shard, Sweep, UNCOUNTED, Values, collect, run};
use vines_testbench::scene::Family;
use zarrs::storage::ReadableStorageTraits;

use crate::{Store, counts, files, settings, sweep};

/// Three chunks: two of seven cells, and one of four.
fn three_chunks() -> Store {
    Store::new(settings("plant.r=0.3:0.9:18"))
}

type Damage = fn(&Path);

/// Ways to damage a file, and what is said of it.
const DAMAGE: [(&str, Damage); 3] = [
    ("is missing", |file| fs::remove_file(file).unwrap()),
    ("is truncated", |file| {
        edit(file, |content| content.truncate(content.len() - 3))
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

#[test]
fn shards_stops_and_resumptions_give_the_same_bytes() {
    let axes = settings("start.dq2=random:-1:1 plant.r=0.4,0.65,0.8 excitation.G=random:0.5:1.5");
    let settings = Settings { samples: Some(20), ..axes };
    let [whole, parts] = [settings.clone(), settings].map(Store::new);
    whole.computed();
    // What a kill leaves before the metadata is no other file.
    fs::create_dir(parts.file(".partial")).unwrap();
    fs::write(parts.file(".partial/0"), "{").unwrap();
    let stopped = Monitor::default();
    stopped.stop.store(true, Relaxed);
    assert!(!parts.run(Shard::ALL, &stopped).unwrap());
    for number in [1, 0] {
        parts.part(number, 2);
    }
    assert_eq!(counts(&parts.computed()), (60, 0));
    assert!(whole.files() == parts.files());
}

#[test]
fn a_store_has_the_bytes_that_zarrs_writes() {
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
    let store = Store::computed_new(Settings { axes, chunk: 12_000, ..settings("") });
    let (memory, array) = store.array("start.q2");
    let values: Vec<f64> = array.retrieve_chunk(&[0]).unwrap();
    array.store_chunk(&[0], values).unwrap();
    let written = memory.get(&"a/c/0".try_into().unwrap()).unwrap().unwrap();
    assert!(written == fs::read(store.file("start.q2/c/0")).unwrap());
}

#[test]
fn a_stop_ends_a_sweep_that_still_writes_its_axes() {
    let random = settings("plant.r=random:0.3:0.9");
    let store = Store::new(Settings { samples: Some(4_000_000_000), chunk: 1, ..random });
    let monitor = Monitor::default();
    thread::scope(|scope| {
        let running = scope.spawn(|| store.run(Shard::ALL, &monitor));
        thread::sleep(Duration::from_millis(100));
        monitor.stop.store(true, Relaxed);
        assert!(!running.join().unwrap().unwrap());
    });
    assert_eq!(counts(&monitor), (0, 0));
}

#[test]
fn damaged_files_are_named_by_a_verification_and_written_again_by_the_same_sweep_and_attributes_of_users_stay() {
    let store = three_chunks();
    store.computed();
    let whole = store.files();
    for (fault, damage) in DAMAGE {
        for (name, complete) in [
            ("regime/c/1", 11),
            ("settling/c/1", 11),
            ("failure/c/1", 11),
            ("plant.r/c/1", 18),
        ] {
            let file = store.file(name);
            damage(&file);
            let (text, found) = store.verified();
            let named = text.as_ref().unwrap().contains(&format!("{} {fault}", file.display()));
            assert!(named && found == complete, "{name} {fault}: {text:?}");
            let monitor = store.computed();
            assert_eq!(counts(&monitor), (complete, 18 - complete), "{name} {fault}");
            // An axis that is missing may not have been written yet.
            let is_new = name.starts_with("plant.r") && fault == "is missing";
            assert_eq!(monitor.damage(), text.filter(|_| !is_new));
            assert!(whole == store.files(), "{name} {fault}");
        }
    }
    fs::remove_file(store.file("failure/zarr.json")).unwrap();
    assert!(store.verified().0.unwrap().contains("failure/zarr.json is missing"));
    // Nothing says of a chunk without any file that it has been there.
    let is_of_chunk = |name: &&String| name.ends_with("/c/1") && !name.starts_with("plant.r");
    for name in whole.keys().filter(is_of_chunk) {
        fs::remove_file(store.file(name)).unwrap();
    }
    assert_eq!(store.verified().1, 11);
    assert_eq!(store.computed().damage(), None);
    assert!(whole == store.files());
    for (name, here) in [("zarr.json", "\"title\""), ("regime/zarr.json", "\"long_name\"")] {
        edit(&store.file(name), |content| {
            let text = String::from_utf8(content.clone()).unwrap();
            *content = text.replacen(here, &format!("\"note\": \"mine\", {here}"), 1).into();
        });
    }
    let mine = store.files();
    store.computed();
    assert!(mine != whole && mine == store.files());
}

#[test]
fn a_flipped_bit_is_found_or_changes_no_value() {
    let store = Store::computed_new(settings("plant.r=0.3:0.9:5"));
    let content = |file: &[u8]| {
        let mut content = Vec::new();
        flate2::read::GzDecoder::new(file).read_to_end(&mut content).unwrap();
        content
    };
    for name in ["followed/c/0", "settling/c/0", "failure/c/0"] {
        let file = store.file(name);
        let whole = fs::read(&file).unwrap();
        for bit in 0..8 * whole.len() {
            edit(&file, |content| content[bit / 8] ^= 1 << (bit % 8));
            // Bits that fill up a byte, unused codes, and the time in the header.
            let same = || content(&fs::read(&file).unwrap()) == content(&whole);
            assert!(store.verified().0.is_some() || same(), "{name}: bit {bit}");
            fs::write(&file, &whole).unwrap();
        }
    }
}

#[test]
fn stores_of_parts_are_collected_to_the_same_bytes_and_damaged_chunks_are_taken_from_elsewhere_or_computed() {
    let [whole, one, other, merged] = std::array::from_fn(|_| three_chunks());
    whole.computed();
    let whole = whole.files();
    one.part(0, 2);
    other.part(1, 2);
    let collect = |sources: &[&Path], monitor: &Monitor| {
        let sources: Vec<_> = sources.iter().map(|source| source.to_path_buf()).collect();
        collect(&merged.sweep, merged.folder.path(), &sources, monitor).map_err(|error| error.to_string())
    };
    let collected = |count: u64| {
        let monitor = Monitor::default();
        collect(&[one.folder.path(), other.folder.path()], &monitor).unwrap();
        assert!(merged.run(Shard::ALL, &monitor).unwrap());
        assert_eq!(counts(&monitor), (18 - count, count));
        assert!(whole == merged.files());
        monitor.damage()
    };
    assert_eq!(collected(0), None);
    for (fault, damage) in DAMAGE {
        // What is damaged in the merged store comes from the sources again.
        damage(&merged.file("regime/c/1"));
        assert!(collected(0).unwrap().contains(fault));
        damage(&other.file("regime/c/1"));
        fs::remove_dir_all(merged.folder.path()).unwrap();
        assert!(collected(7).unwrap().contains(fault));
        fs::write(other.file("regime/c/1"), &whole["regime/c/1"]).unwrap();
    }
    let error = collect(&["missing".as_ref()], &Monitor::default()).unwrap_err();
    assert!(error.contains("missing is not the store"), "{error}");
}

#[test]
fn a_store_of_another_sweep_and_other_files_stay_as_they_are() {
    let folder = tempfile::tempdir().unwrap();
    let inner = folder.path().join("r.zarr");
    let own = || sweep(settings("plant.r=0.3,0.5")).unwrap();
    assert!(run(&own(), &inner, Shard::ALL, &Monitor::default()).unwrap());
    let refused = |sweep: &Sweep, folder: &Path, part: &str| {
        let before = files(folder);
        let error = run(sweep, folder, Shard::ALL, &Monitor::default()).unwrap_err();
        assert!(error.to_string().contains(part) && before == files(folder), "{error}");
    };
    refused(&sweep(settings("plant.r=0.3,0.6")).unwrap(), &inner, "another `axes`");
    let family = Family::parse("", None, &["plant.b=0.02".parse().unwrap()]).unwrap();
    let other = Sweep::new(family, settings("plant.r=0.3,0.5")).unwrap();
    refused(&other, &inner, "another `scene`");
    // Another version does not continue the store.
    let group = inner.join("zarr.json");
    let text = fs::read_to_string(&group).unwrap();
    fs::write(&group, text.replace(env!("CARGO_PKG_VERSION"), "0.0.9")).unwrap();
    refused(&own(), &inner, "another `version`");
    // Chunks without the file that says to which sweep they belong, a folder of stores, and one of other files.
    let no_store = |folder| refused(&own(), folder, "is not the store of a sweep");
    fs::write(&group, &text[..text.len() - 3]).unwrap();
    no_store(&inner);
    fs::remove_file(&group).unwrap();
    no_store(&inner);
    no_store(folder.path());
    fs::write(folder.path().join("notes.txt"), "mine").unwrap();
    no_store(folder.path());
}

#[test]
fn failed_cells_have_their_reason_and_no_numbers() {
    // The last chunk is not full, and the start of the first cell is outside the cavity.
    let store = Store::new(Settings { chunk: 2, ..settings("start.q2=-0.011,-0.005,0.002") });
    let monitor = store.computed();
    assert_eq!((counts(&monitor), monitor.failed.load(Relaxed)), ((0, 3), 1));
    let codes: Vec<u8> = store.values("regime");
    assert!(codes[0] == FAILED && codes[1] < 8 && codes[2] < 8, "{codes:?}");
    for name in ["followed", "impacts", "periods"] {
        let counts: Vec<u32> = store.values(name);
        assert!(counts[0] == UNCOUNTED && !counts[1..].contains(&UNCOUNTED), "{name}");
    }
    let settling = store.numbers("settling");
    assert!(settling[0].is_nan() && !settling[1].is_nan());
    let reasons: Vec<String> = store.values("failure");
    assert_eq!(monitor.reason.get(), Some(&reasons[0]));
    assert_eq!(reasons[1..], ["", ""]);
    for part in ["0.011 m", "from -b_minus to b_plus"] {
        assert!(reasons[0].contains(part), "{reasons:?}");
    }
}
