//! Every regime of the flow between events, scanned across each degeneracy, against an integrator of its own in 32 digits.
//!
//! ```text
//! cargo test --test regimes -- --nocapture
//! ```

mod families;
mod impacts;
mod scan;
mod truth;

use families::Family;
use scan::Worst;

/// Largest error after up to a thousand periods, relative to the motion and to what drives it.
const LIMIT: f64 = 1e-13;

#[test]
fn no_regime_loses_digits() {
    println!("| family | cases | up to 1 period | 10 | 100 | 1000 | hardest |\n|---|---|---|---|---|---|---|");
    let mut failed = Vec::new();
    for Family { name, cases } in families::all() {
        let mut worst = Worst::default();
        for case in &cases {
            worst.add(case);
        }
        println!("| {name} | {} | {worst} |", cases.len());
        if !worst.below(LIMIT) {
            failed.push(name);
        }
    }
    assert!(failed.is_empty(), "{failed:?}");
}

#[test]
fn impacts_are_met_in_every_regime() {
    let (worst, cases, impacts) = impacts::worst();
    println!("{cases} cases with {impacts} impacts: worst error of any state {worst:.1e}");
    assert!(impacts > 1000 && worst < LIMIT);
}
