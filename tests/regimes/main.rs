//! Every regime of the flow between events, scanned across each degeneracy, against an integrator of its own in 32 digits.
//!
//! ```text
//! cargo test --test regimes -- --nocapture
//! ```

mod families;
mod scan;
mod truth;

use families::Family;
use scan::Worst;

/// Largest error after up to a thousand periods, relative to the motion and to what drives it.
const LIMIT: f64 = 1e-12;

#[test]
fn no_regime_loses_digits() {
    println!(
        "| family | cases | up to 1 period | 10 | 100 | 1000 | hardest |\n|---|---|---|---|---|---|---|"
    );
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
