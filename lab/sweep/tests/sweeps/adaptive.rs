//! Guards adaptive maps: agreement with full ones, resumption, and what is refused.

use std::{fs, sync::atomic::Ordering::Relaxed};

use vines_sweep::{FAILED, Monitor, Results, Settings, Shard};

use crate::{Store, counts, refused, settings};

fn adaptive(axes: &str) -> Settings {
    Settings { adaptive: Some(8), chunk: 400, ..settings(axes) }
}

#[test]
fn an_adaptive_map_computes_borders_infers_the_rest_and_resumes_to_the_same_bytes() {
    let settings = adaptive("sigma=-1.6:-0.9:40 excitation.G=0.8:1.3:40");
    let full = Store::computed_new(Settings { adaptive: None, ..settings.clone() });
    let [whole, stopped] = [settings.clone(), settings].map(Store::new);
    let monitor = whole.computed();
    let (cells, inferred) = (monitor.computed.load(Relaxed), monitor.inferred.load(Relaxed));
    assert_eq!(cells + inferred, 1600);
    let [exact, refined] = [&full, &whole].map(|store| store.values::<u8>("regime"));
    let differ = exact.iter().zip(refined).filter(|(one, other)| **one != *other).count();
    println!("{cells} computed, {inferred} inferred, {differ} differ");
    assert!(inferred > 600 && differ < 80, "{inferred} inferred, {differ} differ");
    // The first rounds are read again. A folder with the name of a chunk stops the first run after all rounds.
    let whole = whole.files();
    let chunk = stopped.file("inferred/c/0/0");
    let monitor = Monitor::default();
    monitor.stop.store(true, Relaxed);
    assert!(!stopped.run(Shard::ALL, &monitor).unwrap());
    fs::create_dir_all(&chunk).unwrap();
    assert!(stopped.run(Shard::ALL, &Monitor::default()).is_err());
    fs::remove_dir(&chunk).unwrap();
    // A damaged round and a damaged chunk are computed again.
    let round = stopped.file(".rounds/0-0");
    let mut content = fs::read(&round).unwrap();
    let middle = content.len() / 2;
    content[middle] ^= 4;
    fs::write(&round, content).unwrap();
    let (read, again) = counts(&stopped.computed());
    assert!(read > 0 && again > 0 && read + again == cells, "{read} {again}");
    assert!(whole == stopped.files());
    fs::remove_file(&chunk).unwrap();
    let damage = stopped.computed().damage().unwrap();
    assert!(damage.contains("inferred/c/0/0 is missing"), "{damage}");
    assert!(whole == stopped.files());
    let part = stopped.run(Shard { number: 0, of: 2 }, &Monitor::default());
    assert!(part.unwrap_err().contains("in parts"));
}

#[test]
fn an_inferred_cell_beside_failed_ones_is_not_taken_for_one_without_a_result() {
    // Half of the starts are outside the cavity.
    let store = Store::computed_new(adaptive("start.q2=-0.03:0.009:40 start.dq2=0.1:0.6:40"));
    let (codes, inferred) = (store.values::<u8>("regime"), store.values::<u32>("inferred"));
    let reasons: Vec<String> = store.values("failure");
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
fn a_tiny_adaptive_map_infers_nothing_from_one_cell_and_one_without_sense_is_refused() {
    let monitor = Store::new(adaptive("sigma=-1.6:-0.9:3 excitation.G=0.8,1.3")).computed();
    assert_eq!((monitor.computed.load(Relaxed), monitor.inferred.load(Relaxed)), (6, 0));
    let more = Results::parse(["response"]).unwrap();
    let two = || adaptive("sigma=-1:1:9 plant.r=0.5,0.6");
    for (settings, part) in [
        (Settings { adaptive: Some(3), ..two() }, "every 3-th"),
        (Settings { results: more, ..two() }, "the regime only"),
        (adaptive("sigma=-1:1:9"), "two axes"),
        (adaptive("sigma=-1:1:99999 plant.r=0.5:0.6:99999"), "in memory"),
    ] {
        assert!(refused(settings).contains(part), "{part}");
    }
}
