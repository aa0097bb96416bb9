//! The pair under a master whose steps do not meet the controller's samples.

use fmi2_boundary::{Fmu, pair};

/// Natural periods: the default scene has locked after 304.
const PERIODS: f64 = 400.0;

fn sigma(next: impl FnMut() -> f64) -> pair::Lock {
    let mut pair = pair::Pair::new(&Fmu::plant(), &Fmu::controller());
    pair::lock(&mut pair, PERIODS, next)
}

#[test]
fn irregular_steps_lock_where_regular_ones_do() {
    let regular = sigma(|| pair::SAMPLE_TIME);
    assert!(regular.locked);
    for (from, to) in [(0.99, 0.99), (0.7, 0.7), (0.2, 1.0), (0.5, 1.5), (1.1, 1.1), (1.7, 1.7)] {
        let found = sigma(pair::irregular(from, to, 1));
        let off = (found.sigma - regular.sigma).abs();
        println!("{from} to {to}: sigma {:.6}, off by {off:.1e}, locked {}", found.sigma, found.locked);
    }
}
