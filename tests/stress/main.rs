//! Hard scenes by the thousand, as a table: `scripts/stress --plant` runs the long form (`SCENES=100000`), the test suite a
//! short one. docs/stress.md keeps the table of the long form. `SCENE=free:17` follows one scene only.

#[path = "../common/balance.rs"]
mod balance;
mod cavity;
#[path = "../common/mod.rs"]
mod common;
mod drives;
mod elastic;
mod follow;
mod graze;
mod random;
mod simple;
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
    simple::steps(&mut table);
    work::sweep(n > 10_000, &mut table);
    table.end();
}

/// `scripts/stress --cavity` runs the long form (`SCENES=50000`). `CAVITY=17` follows one scene only.
#[test]
fn random_cavities_are_survived() {
    if let Ok(number) = std::env::var("CAVITY") {
        return cavity::one(number.parse().expect("a number"));
    }
    let n = std::env::var("SCENES").map_or(1500, |n| n.parse().expect("a number of scenes"));
    let mut table = Table::begin();
    cavity::scenes(n, &mut table);
    table.end();
}
