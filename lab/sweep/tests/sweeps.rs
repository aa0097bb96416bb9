//! Guards the cells of sweeps and of the regime map against each other, theory and orbits, and what is refused.

mod common;

use std::sync::atomic::AtomicBool;

use common::{computed, numbers, plan, refused, settings};

use vines_model::{map::LIMIT, regime::Regime};
use vines_sweep::{Axis, Map, Results, Settings, estimate};
use vines_testbench::scene::Family;

/// A map of the default scene.
fn map(x: &str, y: &str, periods: usize) -> Result<Map, String> {
    let [x, y] = [x, y].map(|axis| axis.parse::<Axis>().map_err(|error| error.to_string()));
    Map::new(Family::parse("", None, &[]).unwrap(), &x?, &y?, None, periods).map_err(|error| error.to_string())
}

#[test]
fn the_map_shows_the_island_of_the_theory() {
    let map = map("sigma=-2:1:7", "G=0.7:1.9:7", 2000).unwrap().run(0, || {}).unwrap();
    let (symmetric, inside) = map.count(Regime::Symmetric);
    let island = map.cells.iter().filter(|cell| cell.theory_stable).count();
    println!("{inside} of {island} cells inside the island are symmetric 1:1, {symmetric} in all");
    assert!(island >= 10 && 10 * inside >= 8 * island);
}

#[test]
fn the_axes_of_a_map_may_be_any_two_numbers_of_a_scene() {
    let map = map("r=0.5:0.8:3", "plant.b=0.01:0.02:2", 2000)
        .unwrap()
        .run(0, || {})
        .unwrap();
    assert_eq!(map.names(), ["r", "plant.b"]);
    // G = E/(b epsilon), and the scene states G.
    let places: Vec<_> = map
        .cells
        .iter()
        .map(|cell| (cell.r, cell.g, Some(cell.sigma)))
        .collect();
    assert_eq!(places.len(), 6);
    assert_eq!(places[1], (0.65, 1.1, map.sweep.sigma()));
    assert!((places[5].0 - 0.8).abs() < 1e-12);
    assert!(map.curves.is_empty());
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
    let folder = tempfile::tempdir().unwrap();
    let plan = plan(Settings {
        chunk: 1000,
        periods: 400,
        ..settings(&["sigma=-3:3:7", "excitation.G=0.4:2.4:6"])
    })
    .unwrap();
    computed(&plan, folder.path());
    let map = map("G=0.4:2.4:6", "sigma=-3:3:7", 400).unwrap().run(0, || {}).unwrap();
    let settling: Vec<f64> = map.cells.iter().map(|cell| cell.result.transient).collect();
    assert_eq!(numbers(folder.path(), "settling"), settling);
    let bits = |values: Vec<f64>| values.into_iter().map(f64::to_bits).collect::<Vec<_>>();
    let exponents = map
        .cells
        .iter()
        .map(|cell| cell.result.exponent.unwrap_or(f64::NAN))
        .collect();
    assert_eq!(bits(numbers(folder.path(), "exponent")), bits(exponents));
}

#[test]
fn on_a_symmetric_motion_the_response_is_that_of_the_exact_orbit() {
    let folder = tempfile::tempdir().unwrap();
    let results = Results::parse(["response", "orbits"]).unwrap();
    let plan = plan(Settings {
        results,
        chunk: 100,
        ..settings(&["sigma=-1.2:-1.05:2", "excitation.G=1.05:1.25:3"])
    })
    .unwrap();
    computed(&plan, folder.path());
    let [found, exact] = ["C", "orbit_C"].map(|name| numbers(folder.path(), name));
    // At an impact on the orbit, m M/(M + m) (1 - r^2) w'^2/2; two per period. Base amplitude and C give the damper's part to first order.
    let [impact, damper] = ["impact_power", "damper_power"].map(|name| numbers(folder.path(), name));
    for n in 0..found.len() {
        assert!((found[n] / exact[n] - 1.0).abs() < 1e-5, "{found:?} {exact:?}");
        assert!(impact[n] > 0.0 && damper[n] > 0.0);
    }
    let scene = vines_testbench::scene::Scene::load(None, &[]).unwrap();
    let (d, p) = (scene.dimensionless(), scene.plant);
    let omega = d.omega(-1.2);
    let velocity = d.b * omega * exact[0];
    // The relative velocity of damper and base is that of v within epsilon, and of the base.
    assert!(
        (damper[0] / (0.5 * p.damping * velocity * velocity) - 1.0).abs() < 0.05,
        "{}",
        damper[0]
    );
}

#[test]
fn the_locked_point_of_a_cell_is_that_of_the_experiment() {
    let folder = tempfile::tempdir().unwrap();
    let results = Results::parse(["lock"]).unwrap();
    let plan = plan(Settings { results, chunk: 100, ..settings(&["excitation.G=0.1,1.1"]) }).unwrap();
    computed(&plan, folder.path());
    // As the README shows for the default scene; at G = 0.1, nothing is hit.
    let sigma = numbers(folder.path(), "lock_sigma");
    assert!(sigma[0].is_nan() && (sigma[1] + 1.139_376).abs() < 4e-6, "{sigma:?}");
    assert!((numbers(folder.path(), "lock_C")[1] - 0.448_018).abs() < 4e-6);
}

#[test]
fn axes_that_make_no_sense_are_refused_with_their_name_and_value() {
    let axis = |text: &str| text.parse::<Axis>().unwrap_err().to_string();
    assert!(axis("plant.r=0.7").contains("plant.r has one value") && axis("plant.r=0.7").contains("--set plant.r=0.7"));
    assert!(axis("plant.r=0.7").contains("Scene(plant={\"r\": 0.7})") && axis("sigma=-1").contains("--sigma=-1"));
    assert!(axis("plant.r=0.3:NaN:5").contains("NaN is not a finite number"));
    assert!(axis("plant.r=0.5,0.5").contains("0.5 twice"));
    assert!(axis("plant.r=0.9:0.3:5").contains("from 0.9 to 0.3"));
    assert!(axis("plant.r=random:1:1").contains("below"));
    assert!(axis("plant.r").contains("expected KEY="));
    let unknown = refused(settings(&["plant.rr=0.3:0.5:3"]));
    assert!(
        unknown.contains("plant.rr") && unknown.contains("unknown field"),
        "{unknown}"
    );
    assert!(unknown.starts_with("axis plant.rr:"), "{unknown}");
    let section = refused(settings(&["detuning=0.3:0.5:3"]));
    assert!(
        section.contains("axis detuning") && section.contains("sigma"),
        "{section}"
    );
    let mixed = refused(settings(&["plant.epsilon=0.001:0.01:3"]));
    assert!(
        mixed.starts_with("axis plant.epsilon:") && mixed.contains("mixes SI keys"),
        "{mixed}"
    );
    assert!(refused(settings(&["resonance.sensor=1:2:2"])).contains("resonance.sensor"));
    assert!(refused(settings(&["plant.r=0.3:0.5:3", "plant.r=0.3:0.5:3"])).contains("plant.r again"));
    assert!(refused(settings(&["plant.r=random:0.3:0.5"])).contains("--samples"));
    assert!(refused(Settings { periods: 99, ..settings(&["plant.r=0.3:0.5:3"]) }).contains("99 periods"));
    assert!(refused(Settings { sigma: Some(f64::NAN), ..settings(&["plant.r=0.3:0.5:3"]) }).contains("NaN"));
    let chunk = refused(Settings { chunk: 1 << 40, ..settings(&["plant.r=0.3:0.9:400"]) });
    assert!(chunk.contains("1099511627776 cells: from 1 to 1000000"), "{chunk}");
    assert!(refused(settings(&["plant.r=0.3:0.5:9999999999", "plant.b=1:2:9999999999"])).contains("2^53"));
    let none = estimate(
        &plan(settings(&["plant.r=1.2:1.4:3"])).unwrap(),
        &AtomicBool::new(false),
    )
    .unwrap_err()
    .to_string();
    assert!(
        none.contains("all of") && none.contains("above 0 and at most 1"),
        "{none}"
    );
}

#[test]
fn a_sweep_of_10_12_cells_is_estimated_and_found_large() {
    let plan = plan(Settings {
        periods: LIMIT,
        ..settings(&["plant.r=0.3:1:1000000", "sigma=-5:5:1000000"])
    })
    .unwrap();
    let estimate = estimate(&plan, &AtomicBool::new(false)).unwrap();
    println!("{estimate:?}");
    assert_eq!(estimate.cells, 1_000_000_000_000);
    assert!(estimate.is_large() && estimate.bytes > 1e13 && estimate.hours > 100.0);
}
