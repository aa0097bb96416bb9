//! Guards the regime of a cell of a map against exact orbits and simulations whose outcome is known.

use vines_model::{
    Dimensionless,
    map::{CellRun, RegimeResult, observe},
    regime::Regime,
};

const MOVING: [f64; 4] = [0.0, 0.0, 0.0, 0.9];
const REST: [f64; 4] = [0.0; 4];

fn scene(g: f64) -> Dimensionless {
    Dimensionless::new(0.0084, 1.43, 0.65, g)
}

fn at(g: f64, sigma: f64, start: [f64; 4]) -> RegimeResult {
    observe(&scene(g), sigma, start, 5000).unwrap()
}

#[test]
fn each_regime_is_found_where_it_is_known_to_be() {
    for (g, sigma, start, regime, impacts) in [
        // The exact orbit of the references is stable there; from rest nothing ever hits, as G < lambda.
        (1.1, -1.1408, MOVING, Regime::Symmetric, 2),
        (1.1, -1.1408, REST, Regime::NoImpacts, 0),
        // Beyond the exact symmetry breaking at B = 1.05, on the stable asymmetric branch.
        (1.6, -0.9, MOVING, Regime::Asymmetric, 2),
        // Far above that, more impacts per period, and in the end no order.
        (2.2, -0.6, MOVING, Regime::Several, 6),
        (2.7, -0.8, MOVING, Regime::Chaotic, 0),
        // Just below the fold resonance is captured and lost.
        (0.9, -1.1, MOVING, Regime::Modulated, 0),
    ] {
        let result = at(g, sigma, start);
        assert_eq!((result.regime, result.impacts), (regime, impacts), "G = {g}");
        assert!(regime != Regime::Modulated || result.synchrony > 0.2 && result.exponent.unwrap() > 0.0);
        assert!(regime != Regime::Chaotic || result.exponent.unwrap() > 10.0 * result.exponent_error.unwrap());
    }
}

#[test]
fn a_motion_on_its_way_to_the_symmetric_orbit_is_decided_before_it_has_settled() {
    let (scene, sigma) = (scene(1.1), -1.1408);
    let early = at(1.1, sigma, MOVING);
    let full = CellRun::new(&scene, sigma, MOVING).unwrap().decided(400, 400).unwrap();
    assert_eq!((early.regime, early.impacts, early.periods), (full.regime, 2, 1));
    assert!(early.followed < 100 && early.recurrence.unwrap() > 1e-5);
    assert!((early.transient - full.transient).abs() < 3.0);
    assert!((early.exponent.unwrap() - full.exponent.unwrap()).abs() < 1e-9);
}

#[test]
fn a_particle_that_is_pressed_to_its_wall_sticks() {
    // Slowly shaken with hardly any rebound, the particle rides on the walls.
    let scene = Dimensionless::new(0.1, 1.0, 0.05, 60.0);
    let result = observe(&scene, -6.0, MOVING, 2000).unwrap();
    assert!(result.sticks_per_period > 0.5 && result.regime != Regime::Undecided);
    // A motion that sticks and repeats itself has a negative exponent.
    let scene = Dimensionless::new(0.02, 0.8, 0.4, 0.8463);
    let result = observe(&scene, -2.8639, [0.0, 0.7, 0.4, 0.3], 4000).unwrap();
    assert!(result.sticks_per_period > 0.1 && result.regime == Regime::Several);
    assert!(result.exponent.unwrap() < 0.0 && result.recurrence.unwrap() < 1e-6);
}

#[test]
fn a_moving_particle_is_never_without_impacts() {
    // Even if it is too slow to reach a wall within the periods simulated.
    let slow = observe(&scene(0.0), 0.0, [0.0, 0.0, 0.0, 1e-5], 1000).unwrap();
    assert_eq!((slow.regime, slow.followed), (Regime::Undecided, 1000));
    assert_eq!(observe(&scene(0.0), 0.0, REST, 1000).unwrap().regime, Regime::NoImpacts);
}
