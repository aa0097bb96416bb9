//! Adaptive maps against full ones, their resumption, and what is refused.

mod common;

use std::{fs, path::Path, sync::atomic::Ordering::Relaxed};

use common::{array, files, plan, refused, settings};
use vines_sweep::{FAILED, Monitor, Results, Settings, Shard, collect, run};

#[test]
fn an_adaptive_map_computes_borders_infers_the_rest_and_resumes_to_the_same_bytes() {
    let [full, whole, stopped] = std::array::from_fn(|_| tempfile::tempdir().unwrap());
    let settings = Settings {
        chunk: 400,
        ..settings(&["sigma=-1.6:-0.9:40", "excitation.G=0.8:1.3:40"])
    };
    assert!(
        run(
            &plan(settings.clone()).unwrap(),
            full.path(),
            Shard::ALL,
            &Monitor::default()
        )
        .unwrap()
    );
    let plan = plan(Settings { adaptive: Some(8), ..settings }).unwrap();
    let monitor = Monitor::default();
    assert!(run(&plan, whole.path(), Shard::ALL, &monitor).unwrap());
    let (computed, inferred) = (monitor.computed.load(Relaxed), monitor.inferred.load(Relaxed));
    assert_eq!(computed + inferred, 1600);
    let same = differences(full.path(), whole.path());
    println!("{computed} computed, {inferred} inferred, {same} differ");
    assert!(inferred > 600 && same < 80, "{inferred} inferred, {same} differ");
    // The first rounds are read again, whatever has been removed.
    let monitor = Monitor::default();
    monitor.stop.store(true, Relaxed);
    assert!(!run(&plan, stopped.path(), Shard::ALL, &monitor).unwrap());
    let monitor = Monitor::default();
    std::thread::scope(|scope| {
        scope.spawn(|| {
            while monitor.computed.load(Relaxed) < computed / 2 {
                std::thread::yield_now();
            }
            monitor.stop.store(true, Relaxed);
        });
        // It may end before the flag is set.
        run(&plan, stopped.path(), Shard::ALL, &monitor).unwrap();
    });
    let monitor = Monitor::default();
    assert!(run(&plan, stopped.path(), Shard::ALL, &monitor).unwrap());
    assert!(monitor.found.load(Relaxed) > 0);
    assert!(files(whole.path()) == files(stopped.path()));
    let part = run(&plan, stopped.path(), Shard { number: 0, of: 2 }, &Monitor::default());
    assert!(part.unwrap_err().to_string().contains("in parts"));
}

#[test]
fn damaged_rounds_and_chunks_of_an_adaptive_map_are_computed_again() {
    let [whole, stopped] = std::array::from_fn(|_| tempfile::tempdir().unwrap());
    let plan = plan(Settings {
        chunk: 400,
        adaptive: Some(8),
        ..settings(&["sigma=-1.6:-0.9:20", "excitation.G=0.8:1.3:20"])
    })
    .unwrap();
    assert!(run(&plan, whole.path(), Shard::ALL, &Monitor::default()).unwrap());
    let whole = files(whole.path());
    // A folder with the name of a chunk stops it, after all rounds.
    collect(&plan, stopped.path(), &[], &Monitor::default()).unwrap();
    let chunk = stopped.path().join("inferred/c/0/0");
    fs::create_dir_all(&chunk).unwrap();
    assert!(run(&plan, stopped.path(), Shard::ALL, &Monitor::default()).is_err());
    fs::remove_dir(&chunk).unwrap();
    let round = stopped.path().join(".rounds/0-0");
    let mut content = fs::read(&round).unwrap();
    let middle = content.len() / 2;
    content[middle] ^= 4;
    fs::write(&round, content).unwrap();
    for damaged in [&round, &chunk] {
        let monitor = Monitor::default();
        assert!(run(&plan, stopped.path(), Shard::ALL, &monitor).unwrap());
        let text = monitor.damage().unwrap();
        assert!(text.contains(&damaged.display().to_string()), "{text}");
        assert!(files(stopped.path()) == whole);
        fs::remove_file(&chunk).unwrap();
    }
}

#[test]
fn an_inferred_cell_beside_failed_ones_is_not_taken_for_one_without_a_result() {
    let folder = tempfile::tempdir().unwrap();
    // Half of the starts are outside the cavity.
    let settings = settings(&["start.q2=-0.03:0.009:40", "start.dq2=0.1:0.6:40"]);
    let plan = plan(Settings { adaptive: Some(8), chunk: 400, ..settings }).unwrap();
    let monitor = Monitor::default();
    assert!(run(&plan, folder.path(), Shard::ALL, &monitor).unwrap());
    assert!(monitor.inferred.load(Relaxed) > 0);
    let [regime, reason, inferred] = ["regime", "failure", "inferred"].map(|name| array(folder.path(), name));
    let codes: Vec<u8> = regime.retrieve_array_subset(&regime.subset_all()).unwrap();
    let reasons: Vec<String> = reason.retrieve_array_subset(&reason.subset_all()).unwrap();
    let inferred: Vec<u32> = inferred.retrieve_array_subset(&inferred.subset_all()).unwrap();
    assert!(inferred.iter().all(|one| *one <= 1));
    let failed = |n: &usize| codes[*n] == FAILED;
    assert!((0..1600).filter(failed).any(|n| inferred[n] == 1));
    assert!((0..1600).all(|n| reasons[n].is_empty() != failed(&n) && reasons[n] != "not computed"));
}

#[test]
fn a_tiny_adaptive_map_infers_nothing_from_one_cell() {
    let folder = tempfile::tempdir().unwrap();
    let settings = settings(&["sigma=-1.6:-0.9:3", "excitation.G=0.8,1.3"]);
    let plan = plan(Settings { adaptive: Some(8), ..settings }).unwrap();
    let monitor = Monitor::default();
    assert!(run(&plan, folder.path(), Shard::ALL, &monitor).unwrap());
    assert_eq!((monitor.computed.load(Relaxed), monitor.inferred.load(Relaxed)), (6, 0));
}

/// Number of cells whose regimes differ.
fn differences(one: &Path, other: &Path) -> usize {
    let codes = |folder: &Path| -> Vec<u8> {
        let array = array(folder, "regime");
        array.retrieve_array_subset(&array.subset_all()).unwrap()
    };
    codes(one)
        .iter()
        .zip(codes(other))
        .filter(|(one, other)| *one != other)
        .count()
}

#[test]
fn adaptive_sweeps_that_make_no_sense_are_refused() {
    let adaptive = |axes: &[&str], stride| refused(Settings { adaptive: Some(stride), ..settings(axes) });
    assert!(adaptive(&["sigma=-1:1:9", "plant.r=0.5,0.6"], 3).contains("every 3-th"));
    assert!(adaptive(&["sigma=-1:1:9"], 8).contains("two axes"));
    assert!(adaptive(&["sigma=-1:1:99999", "plant.r=0.5:0.6:99999"], 8).contains("in memory"));
    let results = Results::parse(["response"]).unwrap();
    let more = Settings {
        adaptive: Some(8),
        results,
        ..settings(&["sigma=-1:1:9", "plant.r=0.5,0.6"])
    };
    assert!(refused(more).contains("the regime only"));
}
