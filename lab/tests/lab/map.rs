//! Guards `vines map`: the map against the theory, its axes, and what is refused.

use vines::regime::Regime;
use vines::regime_map::{Axis, Map};
use vines::scene::Family;

use crate::fails;

/// A map of the default scene.
fn map(x: &str, y: &str) -> Map {
    let [x, y] = [x, y].map(|axis| axis.parse::<Axis>().unwrap());
    let mut map = Map::new(Family::parse("", None, &[]).unwrap(), &x, &y, None, 2000).unwrap();
    map.run(0, || {}).unwrap();
    map
}

#[test]
fn the_map_shows_the_island_of_the_theory() {
    let map = map("sigma=-2:1:7", "G=0.7:1.9:7");
    let (symmetric, inside) = map.count(Regime::Symmetric);
    let island = map.cells.iter().filter(|cell| cell.theory_stable).count();
    println!("{inside} of {island} cells inside the island are symmetric 1:1, {symmetric} in all");
    assert!(island >= 10 && 10 * inside >= 8 * island);
}

#[test]
fn the_axes_of_a_map_may_be_any_two_numbers_of_a_scene() {
    let map = map("r=0.5:0.8:3", "plant.b=0.01:0.02:2");
    assert_eq!(map.names(), ["r", "plant.b"]);
    assert!(map.cells.len() == 6 && map.curves.is_empty());
    // G = E/(b epsilon), and the scene states G.
    let [second, last] = [1, 5].map(|n| &map.cells[n]);
    assert_eq!(
        (second.r, second.g, Some(second.sigma)),
        (0.65, 1.1, map.common.sigma())
    );
    assert!((last.r - 0.8).abs() < 1e-12);
}

#[test]
fn a_map_that_makes_no_sense_is_refused_with_the_value_that_is_wrong() {
    for (options, part) in [
        ("--x sigma=-3:1:0", "`0` points: a whole number from 2 to 2000"),
        ("--x sigma=-3:1:0.1", "`0.1` points: a whole number"),
        ("--x sigma=0:1:2001", "`2001` points"),
        ("--x sigma=0,1,2", "FIRST:LAST:POINTS"),
        ("--x sigma=1:0:5", "sigma from 1 to 0: the first must be below the last"),
        ("--y G=0:nan:5", "`nan` is not a finite number"),
        ("--y G=-1:2:5", "G"),
        ("--y r=0.2:1.2:5", "restitution"),
        ("--y x=0:1:5", "section.key"),
        ("--x G=0:1:3 --y excitation.G=0:1:3", "excitation.G is on two axes"),
        ("--sigma=1", "sigma is an axis and a constant"),
        ("--y plant.epsilon=0.001:0.01:3", "mixes SI keys"),
        ("--periods 3", "3 periods: from 100 to"),
        ("--x sigma=-200:1:3", "above 0"),
        ("--x chain.snr=20:60:3", "chain.snr: a regime map does not depend on it"),
        ("--y plant.mu_k=0:0.1:3", "may be sigma, G or excitation.E, r"),
    ] {
        fails(&format!("map --out /proc/map {options}"), 2, part);
    }
}
