//! Guards the plant in random and extreme scenes: no panic, no NaN, no particle outside its cavity at and inside steps, energy and its balance,
//! momentum and Newton's law, grazes of 1e-13, the same bits without the workspace, steps from 1e-9 to 1e6 periods, a new drive at every
//! sample against an independent simulation, the fast path against the plain solver, bounded work.
//!
//! Prints a table. `scripts/stress --plant` runs the long form (`SCENES=100000`), the test suite a short one; validation/stress.csv keeps a
//! table of 10,000 scenes. `SCENE=hard:17` follows scene 17 of the kind `hard` only.

#[macro_use]
mod figures;
mod drives;
mod follow;
mod scenes;
mod simulation;
mod single;
mod structures;

use figures::Figures;

/// Number of scenes.
fn number_of_scenes() -> usize {
    std::env::var("SCENES").map_or(1500, |n| n.parse().expect("a number of scenes"))
}

#[test]
fn hard_scenes_are_survived() {
    let n = number_of_scenes();
    let mut figures = Figures::default();
    figures.run("hard", n, scenes::hard, follow::follow);
    figures.run("fast path", 2 * n, follow::changing, follow::agree);
    figures.run("damped", n / 10, scenes::damped, follow::balance);
    figures.run("new drives", n / 5, drives::scenes, drives::follow);
    figures.run("impact", n, single::impacts, single::impact);
    figures.run("graze", n / 10, single::grazes, single::graze);
    figures.run("no loss", 7, single::lossless, single::conserves);
    figures.run("extreme", n / 10, single::extremes, single::work);
    single::long_steps(n > 10_000);
    single::short_steps(&mut figures);
    figures.end();
}

/// `scripts/stress --cavity` runs the long form (`SCENES=50000`).
#[test]
fn random_cavities_are_survived() {
    let n = number_of_scenes();
    let mut figures = Figures::default();
    figures.run("cavity", n, scenes::cavity, follow::follow);
    figures.run("balance in a cavity", n / 10, scenes::cavity, follow::balance);
    figures.end();
}

/// `scripts/stress --structures` runs the long form (`SCENES=10000`).
#[test]
fn random_structures_are_survived() {
    let mut figures = Figures::default();
    figures.run(
        "structure",
        number_of_scenes() / if number_of_scenes() > 1500 { 1 } else { 5 },
        structures::scenes,
        structures::follow,
    );
    figures.end();
}
