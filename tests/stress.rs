//! Scenes drawn by lot.
mod common;
use common::{Scene, scene};
use lovines::*;
use proptest::strategy::{Strategy, ValueTree};
use proptest::test_runner::{Config, RngAlgorithm, TestRng, TestRunner};

fn scenes(seed: u8, driven: bool, n: usize) -> impl Iterator<Item = Scene> {
    let rng = TestRng::from_seed(RngAlgorithm::ChaCha, &[seed; 32]);
    let mut runner = TestRunner::new_with_rng(Config::default(), rng);
    let strategy = scene(driven);
    (0..n).map(move |_| strategy.new_tree(&mut runner).unwrap().current())
}

#[test]
#[ignore]
fn slow() {
    let n: usize = std::env::var("CASES").unwrap().parse().unwrap();
    for driven in [false, true] {
        for (k, s) in scenes(7, driven, n).enumerate() {
            let mut plant = Plant::new(s.parameters, s.start).unwrap();
            let e0 = plant.energy(0.0);
            let t = std::time::Instant::now();
            let mut cut = false;
            let mut worst = 0.0f64;
            let mut i = 0;
            for _ in 0..30 {
                let o = plant.advance(s.drive, s.step);
                cut |= o.cut_short;
                if !driven && s.parameters.damping == 0.0 {
                    worst =
                        worst.max((plant.energy(0.0) + plant.tally().dissipated - e0).abs() / e0);
                }
                i += 1;
                if t.elapsed().as_secs_f64() > 0.3 {
                    break;
                }
            }
            if t.elapsed().as_secs_f64() > 0.1 || cut || worst > 1e-13 {
                println!(
                    "{driven} {k}: {:.3} s, {i} steps, {} impacts, cut {cut}, energy {worst:.1e} {s:?}",
                    t.elapsed().as_secs_f64(),
                    plant.tally().impacts
                );
            }
        }
    }
}
