//! The plant against trajectories computed in 40-digit arithmetic by an independent program.

use lovines::{Drive, Parameters, Plant, State, Wall};
use serde_json::Value;

fn number(value: &Value) -> f64 {
    value.as_str().expect("a decimal string").parse().expect("a number")
}

/// Largest error of any state after any step.
fn worst_error(scene: &str) -> f64 {
    let path = format!(
        "{}/tests/reference/trajectories/{scene}.json",
        env!("CARGO_MANIFEST_DIR")
    );
    let text = std::fs::read_to_string(path).expect("reference data");
    let reference: Value = serde_json::from_str(&text).expect("JSON");
    let at = |key: &str| number(&reference[key]);
    let x0: Vec<f64> = reference["x0"].as_array().unwrap().iter().map(number).collect();
    let parameters = Parameters::dimensionless(at("eps"), at("lam"), at("r"));
    let start = State { q1: x0[0], dq1: x0[1], q2: x0[2], dq2: x0[3] };
    let drive = Drive::harmonic(at("eps") * at("G"), at("Om"));
    let mut plant = Plant::new(parameters, start).unwrap();
    let mut worst = 0.0f64;
    for row in reference["rows"].as_array().unwrap() {
        plant.advance(drive, at("step")).unwrap();
        let s = plant.state();
        let mut error = 0.0f64;
        for (got, want) in [s.q1, s.dq1, s.q2, s.dq2].iter().zip(&row.as_array().unwrap()[1..5]) {
            error = error.max((got - number(want)).abs());
        }
        let stuck = plant.contact().map_or(0.0, Wall::sign);
        assert_eq!(stuck, row[6].as_f64().unwrap(), "{scene}: contact");
        if scene != "chatter" {
            assert_eq!(plant.totals().impacts, row[5].as_u64().unwrap(), "{scene}: impacts");
        }
        worst = worst.max(error);
    }
    println!("{scene}: worst error of any state after any step {worst:.2e}");
    worst
}

#[test]
fn the_locked_scene_is_followed_to_1e_11() {
    assert!(worst_error("lock") < 1e-11);
}

#[test]
fn secular_growth_at_an_undamped_resonance_is_followed_to_1e_11() {
    assert!(worst_error("resonance") < 1e-11);
}

#[test]
fn a_chatter_into_sticking_and_out_of_it_is_followed_to_1e_11() {
    assert!(worst_error("chatter") < 1e-11);
}
