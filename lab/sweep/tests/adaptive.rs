//! Guards adaptive maps: agreement with full ones, resumption, and what is refused.

mod common;

use std::{fs, sync::atomic::Ordering::Relaxed};

use common::{computed, counts, files, plan, refused, settings, values};
use vines_sweep::{FAILED, Monitor, Results, Settings, Shard, run};

#[test]
fn an_adaptive_map_computes_borders_infers_the_rest_and_resumes_to_the_same_bytes() {
    let [full, whole, stopped] = std::array::from_fn(|_| tempfile::tempdir().unwrap());
    let settings = Settings {
        chunk: 400,
        ..settings(&["sigma=-1.6:-0.9:40", "excitation.G=0.8:1.3:40"])
    };
    computed(&plan(settings.clone()).unwrap(), full.path());
    let plan = plan(Settings { adaptive: Some(8), ..settings }).unwrap();
    let monitor = computed(&plan, whole.path());
    let (cells, inferred) = (monitor.computed.load(Relaxed), monitor.inferred.load(Relaxed));
    assert_eq!(cells + inferred, 1600);
    let [exact, refined] = [&full, &whole].map(|folder| values::<u8>(folder.path(), "regime"));
    let differ = exact.iter().zip(refined).filter(|(one, other)| **one != *other).count();
    println!("{cells} computed, {inferred} inferred, {differ} differ");
    assert!(inferred > 600 && differ < 80, "{inferred} inferred, {differ} differ");
    // The first rounds are read again. A folder with the name of a chunk stops the first run after all rounds.
    let whole = files(whole.path());
    let chunk = stopped.path().join("inferred/c/0/0");
    fs::create_dir_all(stopped.path()).unwrap();
    let monitor = Monitor::default();
    monitor.stop.store(true, Relaxed);
    assert!(!run(&plan, stopped.path(), Shard::ALL, &monitor).unwrap());
    fs::create_dir_all(&chunk).unwrap();
    assert!(run(&plan, stopped.path(), Shard::ALL, &Monitor::default()).is_err());
    fs::remove_dir(&chunk).unwrap();
    // A damaged round and a damaged chunk are computed again.
    let round = stopped.path().join(".rounds/0-0");
    let mut content = fs::read(&round).unwrap();
    let middle = content.len() / 2;
    content[middle] ^= 4;
    fs::write(&round, content).unwrap();
    let monitor = computed(&plan, stopped.path());
    let (read, again) = counts(&monitor);
    assert!(read > 0 && again > 0 && read + again == cells, "{read} {again}");
    assert!(whole == files(stopped.path()));
    fs::remove_file(&chunk).unwrap();
    let damage = computed(&plan, stopped.path()).damage().unwrap();
    assert!(damage.contains("inferred/c/0/0 is missing"), "{damage}");
    assert!(whole == files(stopped.path()));
    let part = run(&plan, stopped.path(), Shard { number: 0, of: 2 }, &Monitor::default());
    assert!(part.unwrap_err().to_string().contains("in parts"));
}

#[test]
fn an_inferred_cell_beside_failed_ones_is_not_taken_for_one_without_a_result() {
    let folder = tempfile::tempdir().unwrap();
    // Half of the starts are outside the cavity.
    let settings = settings(&["start.q2=-0.03:0.009:40", "start.dq2=0.1:0.6:40"]);
    let plan = plan(Settings { adaptive: Some(8), chunk: 400, ..settings }).unwrap();
    computed(&plan, folder.path());
    let (codes, inferred) = (
        values::<u8>(folder.path(), "regime"),
        values::<u32>(folder.path(), "inferred"),
    );
    let reasons: Vec<String> = values(folder.path(), "failure");
    assert!((0..1600).any(|n| codes[n] == FAILED && inferred[n] == 1));
    for n in 0..1600 {
        let part = match (codes[n] == FAILED, inferred[n]) {
            (true, 0) => "from -b_minus to b_plus",
            (true, 1) => "a neighbouring cell failed",
            (_, inferred) => ["", ""][inferred as usize],
        };
        assert!(reasons[n].contains(part) && reasons[n].is_empty() == part.is_empty());
    }
}

#[test]
fn a_tiny_adaptive_map_infers_nothing_from_one_cell() {
    let folder = tempfile::tempdir().unwrap();
    let settings = settings(&["sigma=-1.6:-0.9:3", "excitation.G=0.8,1.3"]);
    let monitor = computed(
        &plan(Settings { adaptive: Some(8), ..settings }).unwrap(),
        folder.path(),
    );
    assert_eq!((monitor.computed.load(Relaxed), monitor.inferred.load(Relaxed)), (6, 0));
}

#[test]
fn adaptive_sweeps_that_make_no_sense_are_refused() {
    let adaptive = |axes: &[&str], stride| refused(Settings { adaptive: Some(stride), ..settings(axes) });
    assert!(adaptive(&["sigma=-1:1:9", "plant.r=0.5,0.6"], 3).contains("every 3-th"));
    assert!(adaptive(&["sigma=-1:1:9"], 8).contains("two axes"));
    assert!(adaptive(&["sigma=-1:1:99999", "plant.r=0.5:0.6:99999"], 8).contains("in memory"));
    let results = Results::parse(["response"]).unwrap();
    let more = settings(&["sigma=-1:1:9", "plant.r=0.5,0.6"]);
    assert!(refused(Settings { adaptive: Some(8), results, ..more }).contains("the regime only"));
}
