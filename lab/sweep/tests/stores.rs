//! Stores of sweeps: several writers, and folders that hold something else.

mod common;

use std::{sync::atomic::Ordering::Relaxed, thread, time::Duration};

use common::{files, plan, refused, settings};
use vines_sweep::{Monitor, Settings, Shard, run};

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
