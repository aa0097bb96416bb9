//! Hard scenes by the thousand, as a table: `scripts/stress --plant` runs the long form (`SCENES=100000`), the test suite a
//! short one. validation/stress.csv keeps the table of the long form. `SCENE=free:17` follows one scene only.
//!
//! Guards: no panic, no NaN, no particle outside its cavity at and inside steps, energy and its balance, momentum and
//! Newton's law, no impact twice or too soon, grazes of 1e-13, the same bits without the workspace, steps from 1e-9 to 1e6 periods, a new
//! drive at every sample against an independent simulation, bounded work; all that with the ideal and, but for the last, a real cavity.

mod balance;
mod cavity;
#[path = "../common/mod.rs"]
mod common;
mod drives;
mod elastic;
mod follow;
mod graze;
mod random;
mod simulation;
mod spacing;
mod steps;
mod table;
mod work;

use table::Table;

#[test]
fn hard_scenes_are_survived() {
    if let Ok(name) = std::env::var("SCENE") {
        return random::one(&name);
    }
    let n = std::env::var("SCENES").map_or(1500, |n| n.parse().expect("a number of scenes"));
    let mut table = Table::begin();
    random::scenes(n, &mut table);
    random::balance(n / 10, &mut table);
    drives::compare(n / 5, &mut table);
    elastic::one_by_one(n, &mut table);
    elastic::drift(1_000_000, &mut table);
    graze::both_ways(n / 10, &mut table);
    steps::long(&mut table);
    if n > 10_000 {
        steps::chatter(&mut table);
        steps::endless(&mut table);
    }
    steps::short(&mut table);
    work::sweep(n > 10_000, &mut table);
    table.end();
}

/// `scripts/stress --cavity` runs the long form (`SCENES=50000`). `SCENE=cavity:17` follows one scene only.
#[test]
fn random_cavities_are_survived() {
    let n = std::env::var("SCENES").map_or(1500, |n| n.parse().expect("a number of scenes"));
    let mut table = Table::begin();
    cavity::scenes(n, &mut table);
    table.end();
}
