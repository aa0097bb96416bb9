//! Guards sweeps: their cells and the regime map (`cells`), stores with several writers, stops and damage (`stores`), and adaptive refinement
//! (`adaptive`). What several of them need is here.

mod adaptive;
mod cells;
mod stores;

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
    sync::{Arc, atomic::Ordering::Relaxed},
};

use tempfile::TempDir;
use vines_sweep::{Monitor, Settings, Shard, Sweep, run, verify};
use vines_testbench::scene::Family;
use zarrs::{
    array::{Array, ElementOwned},
    storage::{WritableStorageTraits, store::MemoryStore},
};

/// Settings with these axes, separated by spaces.
fn settings(axes: &str) -> Settings {
    Settings {
        axes: axes.split_whitespace().map(|axis| axis.parse().unwrap()).collect(),
        periods: 200,
        chunk: 7,
        ..Settings::default()
    }
}

fn sweep(settings: Settings) -> Result<Sweep, String> {
    Sweep::new(Family::parse("", None, &[]).unwrap(), settings).map_err(|error| error.to_string())
}

fn refused(settings: Settings) -> String {
    sweep(settings).unwrap_err()
}

/// A sweep with a store in a folder of its own.
struct Store {
    sweep: Sweep,
    folder: TempDir,
}

impl Store {
    fn new(settings: Settings) -> Self {
        let folder = tempfile::tempdir().unwrap();
        Self { sweep: sweep(settings).unwrap(), folder }
    }

    fn computed_new(settings: Settings) -> Self {
        let store = Self::new(settings);
        store.computed();
        store
    }

    /// Runs the sweep. False if the monitor stopped it; the message where it is refused.
    fn run(&self, shard: Shard, monitor: &Monitor) -> Result<bool, String> {
        run(&self.sweep, self.folder.path(), shard, monitor).map_err(|error| error.to_string())
    }

    /// Computes a part of the sweep to its end.
    fn part(&self, number: u64, of: u64) -> Monitor {
        let monitor = Monitor::default();
        assert!(self.run(Shard { number, of }, &monitor).unwrap());
        monitor
    }

    /// Computes the sweep to its end.
    fn computed(&self) -> Monitor {
        self.part(0, 1)
    }

    /// Verifies the store, and returns what is damaged and the number of its cells.
    fn verified(&self) -> (Option<String>, u64) {
        let (before, monitor) = (self.files(), Monitor::default());
        assert!(verify(&self.sweep, self.folder.path(), Shard::ALL, &monitor).unwrap());
        assert!(before == self.files());
        (monitor.damage(), counts(&monitor).0)
    }

    fn file(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn files(&self) -> BTreeMap<String, Vec<u8>> {
        files(self.folder.path())
    }

    /// A variable as zarrs reads it.
    fn array(&self, name: &str) -> (Arc<MemoryStore>, Array<MemoryStore>) {
        let memory = Arc::new(MemoryStore::new());
        for (key, value) in files(&self.file(name)) {
            let key = format!("a/{key}").as_str().try_into().unwrap();
            memory.set(&key, value.into()).unwrap();
        }
        let array = Array::open(Arc::clone(&memory), "/a").unwrap();
        (memory, array)
    }

    fn values<T: ElementOwned>(&self, name: &str) -> Vec<T> {
        let (_, array) = self.array(name);
        array.retrieve_array_subset(&array.subset_all()).unwrap()
    }

    fn numbers(&self, name: &str) -> Vec<f64> {
        self.values(name)
    }
}

/// Cells that were in the store, and that were computed.
fn counts(monitor: &Monitor) -> (u64, u64) {
    (monitor.found.load(Relaxed), monitor.computed.load(Relaxed))
}

/// All files below a folder.
fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap());
    let files = entries.flat_map(|entry| {
        let (name, path) = (entry.file_name().into_string().unwrap(), entry.path());
        match path.is_dir() {
            true => files(&path)
                .into_iter()
                .map(|(file, content)| (format!("{name}/{file}"), content))
                .collect(),
            false => vec![(name, fs::read(path).unwrap())],
        }
    });
    files.collect()
}
