//! What the tests of sweeps share.

#![allow(dead_code, reason = "every test program uses a part of it")]

use std::{
    collections::BTreeMap,
    fs,
    path::Path,
    sync::{Arc, atomic::Ordering::Relaxed},
};

use vines_sweep::{Monitor, Settings, Shard, Sweep, run};
use vines_testbench::scene::Family;
use zarrs::{
    array::{Array, ElementOwned},
    storage::{WritableStorageTraits, store::MemoryStore},
};

pub fn settings(axes: &[&str]) -> Settings {
    Settings {
        axes: axes.iter().map(|axis| axis.parse().unwrap()).collect(),
        periods: 200,
        chunk: 7,
        ..Settings::default()
    }
}

pub fn plan(settings: Settings) -> Result<Sweep, String> {
    Sweep::new(Family::parse("", None, &[]).unwrap(), settings).map_err(|error| error.to_string())
}

pub fn refused(settings: Settings) -> String {
    plan(settings).unwrap_err()
}

/// Computes a part of a sweep to its end.
pub fn computed_part(plan: &Sweep, folder: &Path, number: u64, of: u64) -> Monitor {
    let monitor = Monitor::default();
    assert!(run(plan, folder, Shard { number, of }, &monitor).unwrap());
    monitor
}

/// Computes a sweep to its end.
pub fn computed(plan: &Sweep, folder: &Path) -> Monitor {
    computed_part(plan, folder, 0, 1)
}

/// Cells that were in the store, and that were computed.
pub fn counts(monitor: &Monitor) -> (u64, u64) {
    (monitor.found.load(Relaxed), monitor.computed.load(Relaxed))
}

/// The message of a run that is refused, and that leaves a folder as it is.
pub fn refused_in(plan: &Sweep, folder: &Path) -> String {
    let before = files(folder);
    let error = run(plan, folder, Shard::ALL, &Monitor::default()).unwrap_err();
    assert!(before == files(folder), "{error}");
    error.to_string()
}

/// All files of a store.
pub fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut all = BTreeMap::new();
    let mut folders = vec![folder.to_path_buf()];
    while let Some(one) = folders.pop() {
        for path in fs::read_dir(&one).unwrap().map(|entry| entry.unwrap().path()) {
            if path.is_dir() {
                folders.push(path);
            } else {
                let name = path.strip_prefix(folder).unwrap().display().to_string();
                all.insert(name, fs::read(&path).unwrap());
            }
        }
    }
    all
}

/// A variable as zarrs reads it.
pub fn array(folder: &Path, name: &str) -> (Arc<MemoryStore>, Array<MemoryStore>) {
    let memory = Arc::new(MemoryStore::new());
    for (key, value) in files(&folder.join(name)) {
        let key = format!("a/{key}").as_str().try_into().unwrap();
        memory.set(&key, value.into()).unwrap();
    }
    let array = Array::open(Arc::clone(&memory), "/a").unwrap();
    (memory, array)
}

pub fn values<T: ElementOwned>(folder: &Path, name: &str) -> Vec<T> {
    let (_, array) = array(folder, name);
    array.retrieve_array_subset(&array.subset_all()).unwrap()
}

pub fn numbers(folder: &Path, name: &str) -> Vec<f64> {
    values(folder, name)
}
