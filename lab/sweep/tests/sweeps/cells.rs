//! Guards the cells of sweeps and of the regime map against each other, theory and orbits, and what is refused.

use std::sync::atomic::AtomicBool;

use vines_model::regime::Regime;
use vines_sweep::{Axis, Map, Results, Settings, estimate};
use vines_testbench::scene::{Family, Scene};

use crate::{Store, refused, settings, sweep};

/// A map of the default scene.
fn map(x: &str, y: &str, periods: usize) -> Result<Map, String> {
    let [x, y] = [x, y].map(|axis| axis.parse::<Axis>().map_err(|error| error.to_string()));
    let map = Map::new(Family::parse("", None, &[]).unwrap(), &x?, &y?, None, periods);
    map.map_err(|error| error.to_string())
}

fn mapped(x: &str, y: &str, periods: usize) -> Map {
    let mut map = map(x, y, periods).unwrap();
    map.run(0, || {}).unwrap();
    map
}

#[test]
fn the_map_shows_the_island_of_the_theory() {
    let map = mapped("sigma=-2:1:7", "G=0.7:1.9:7", 2000);
    let (symmetric, inside) = map.count(Regime::Symmetric);
    let island = map.cells.iter().filter(|cell| cell.theory_stable).count();
    println!("{inside} of {island} cells inside the island are symmetric 1:1, {symmetric} in all");
    assert!(island >= 10 && 10 * inside >= 8 * island);
}

#[test]
fn the_axes_of_a_map_may_be_any_two_numbers_of_a_scene() {
    let map = mapped("r=0.5:0.8:3", "plant.b=0.01:0.02:2", 2000);
    assert_eq!(map.names(), ["r", "plant.b"]);
    assert!(map.cells.len() == 6 && map.curves.is_empty());
    // G = E/(b epsilon), and the scene states G.
    let [second, last] = [1, 5].map(|n| &map.cells[n]);
    assert_eq!((second.r, second.g, Some(second.sigma)), (0.65, 1.1, map.sweep.sigma()));
    assert!((last.r - 0.8).abs() < 1e-12);
}

#[test]
fn maps_that_make_no_sense_are_refused() {
    for (x, y, periods, part) in [
        ("sigma=1:0:5", "G=0:1:3", 400, "below the last"),
        ("sigma=0:1:3", "G=-1:2:5", 400, "G"),
        ("sigma=0:1:3", "r=0.2:1.2:5", 400, "restitution"),
        ("sigma=0:1:1", "G=0:1:3", 400, "at least 2"),
        ("sigma=0:1:2001", "G=0:1:3", 400, "2 to 2000"),
        ("sigma=0,1,2", "G=0:1:3", 400, "FIRST:LAST:POINTS"),
        ("x=0:1:5", "G=0:1:3", 400, "section.key"),
        ("sigma=0:1:3", "G=0:nan:5", 400, "finite"),
        ("G=0:1:3", "G=0:1:3", 400, "again"),
        ("sigma=0:1:3", "G=0:1:3", 3, "from 100"),
        ("sigma=-200:1:3", "G=0:1:3", 400, "above 0"),
    ] {
        let message = map(x, y, periods).unwrap_err();
        assert!(message.contains(part), "{x} {y}: {message}");
    }
}

#[test]
fn every_axis_has_a_unit() {
    for (name, unit) in [
        ("sigma", "1"),
        ("plant.c", "N s/m"),
        ("start.dq2", "m/s"),
        ("controller.phase_target", "degree"),
        ("controller.bandwidth", "1"),
        ("chain.snr", "dB"),
        ("phase_lock.harmonics", "1"),
        ("phase_lock.base_bandwidth", "rad/s"),
    ] {
        assert_eq!(format!("{name}=1,2").parse::<Axis>().unwrap().unit(), unit, "{name}");
    }
}

#[test]
fn a_sweep_over_sigma_and_g_has_the_bits_of_the_map() {
    let axes = settings("sigma=-3:3:7 excitation.G=0.4:2.4:6");
    let store = Store::computed_new(Settings { chunk: 1000, periods: 400, ..axes });
    let map = mapped("G=0.4:2.4:6", "sigma=-3:3:7", 400);
    let results = || map.cells.iter().map(|cell| &cell.result);
    let settling: Vec<f64> = results().map(|result| result.transient).collect();
    assert_eq!(store.numbers("settling"), settling);
    let exponents = results().map(|result| result.exponent.unwrap_or(f64::NAN).to_bits());
    let stored = store.numbers("exponent").into_iter().map(f64::to_bits);
    assert!(exponents.eq(stored));
}

#[test]
fn on_a_symmetric_motion_the_response_is_that_of_the_exact_orbit() {
    let results = Results::parse(["response", "orbits"]).unwrap();
    let axes = settings("sigma=-1.2:-1.05:2 excitation.G=1.05:1.25:3");
    let store = Store::computed_new(Settings { results, chunk: 100, ..axes });
    let names = ["C", "orbit_C", "impact_power", "damper_power"];
    let [found, exact, impact, damper] = names.map(|name| store.numbers(name));
    for n in 0..found.len() {
        assert!((found[n] / exact[n] - 1.0).abs() < 1e-5, "{found:?} {exact:?}");
        assert!(impact[n] > 0.0 && damper[n] > 0.0);
    }
    let scene = Scene::load(None, &[]).unwrap();
    let d = scene.dimensionless();
    // The relative velocity of damper and base is that of v within epsilon, and of the base.
    let velocity = d.b * d.omega(-1.2) * exact[0];
    let expected = 0.5 * scene.plant.damping * velocity * velocity;
    assert!((damper[0] / expected - 1.0).abs() < 0.05, "{}", damper[0]);
}

#[test]
fn the_locked_point_of_a_cell_is_that_of_the_experiment() {
    let results = Results::parse(["lock"]).unwrap();
    let axes = settings("excitation.G=0.1,1.1");
    let store = Store::computed_new(Settings { results, chunk: 100, ..axes });
    // As the README shows for the default scene; at G = 0.1, nothing is hit.
    let sigma = store.numbers("lock_sigma");
    assert!(sigma[0].is_nan() && (sigma[1] + 1.139_376).abs() < 4e-6, "{sigma:?}");
    assert!((store.numbers("lock_C")[1] - 0.448_018).abs() < 4e-6);
}

#[test]
fn axes_and_settings_that_make_no_sense_are_refused_with_their_name_and_value() {
    for (axis, part) in [
        ("plant.r=0.7", "a setting of the scene: --set plant.r=0.7"),
        ("sigma=-1", "--sigma=-1"),
        ("plant.r=0.5,0.5", "0.5 twice"),
        ("plant.r=0.9:0.3:5", "from 0.9 to 0.3"),
        ("plant.r=random:1:1", "below"),
        ("plant.r", "expected KEY="),
    ] {
        let message = axis.parse::<Axis>().unwrap_err().to_string();
        assert!(message.contains(part), "{axis}: {message}");
    }
    let r = || settings("plant.r=0.3:0.5:3");
    for (settings, parts) in [
        (settings("detuning=0.3:0.5:3"), ["axis detuning", "sigma"]),
        (
            settings("plant.epsilon=0.001:0.01:3"),
            ["axis plant.epsilon:", "mixes SI keys"],
        ),
        (settings("resonance.sensor=1:2:2"), ["resonance.sensor", ""]),
        (settings("plant.r=0.3:0.5:3 plant.r=0.3:0.5:3"), ["plant.r again", ""]),
        (settings("plant.r=random:0.3:0.5"), ["--samples", ""]),
        (Settings { periods: 99, ..r() }, ["99 periods", ""]),
        (
            Settings { chunk: 1 << 40, ..r() },
            ["1099511627776 cells: ", "from 1 to 1000000"],
        ),
        (
            settings("plant.r=0.3:0.5:9999999999 plant.b=1:2:9999999999"),
            ["2^53", ""],
        ),
    ] {
        let message = refused(settings);
        assert!(parts.iter().all(|part| message.contains(part)), "{parts:?}: {message}");
    }
    let none = estimate(&sweep(settings("plant.r=1.2:1.4:3")).unwrap(), &AtomicBool::new(false));
    let none = none.unwrap_err().to_string();
    assert!(
        none.contains("all of") && none.contains("above 0 and at most 1"),
        "{none}"
    );
}
