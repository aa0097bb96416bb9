//! Driven motions at any detuning: frequency responses and activation.

use std::f64::consts::{PI, TAU};

use lovines::Drive;
use vines_model::{Dimensionless, numerics::try_bisection, theory::SlowFlow};

use crate::{DRIVES, EPSILON, LAMBDA, R, close, flow, rates};

#[test]
fn responses_consist_of_equilibria_and_cross_a_detuning_as_often_as_there_are_equilibria() {
    let flow = flow();
    for (g, sigma) in DRIVES {
        let curves = flow.frequency_responses(g, 4_001);
        for point in curves.iter().flatten() {
            let rates = rates(&flow, (g, point.sigma), [point.b, point.gamma]);
            assert!(rates.iter().all(|rate| rate.abs() <= 1e-7), "{point:?}");
        }
        let crossings = curves.iter().map(|curve| {
            let sigmas: Vec<f64> = curve.iter().map(|one| one.sigma).collect();
            let sides = sigmas.windows(2);
            sides.filter(|pair| (pair[0] > sigma) != (pair[1] > sigma)).count()
        });
        let (crossings, equilibria) = (crossings.sum::<usize>(), flow.equilibria(g, sigma).len());
        assert_eq!(crossings, equilibria, "G = {g}, sigma = {sigma}");
    }
}

#[test]
fn the_activation_thresholds_are_where_equilibria_begin() {
    let flow = flow();
    for sigma in [-2.0, -1.2, -0.5, 0.4] {
        let activation = flow.activation(EPSILON, sigma);
        let stable = activation.stable.expect("a stable motion at some G");
        assert!(activation.existence <= stable);
        for (off, exists) in [(-1.0, false), (1.0, true)] {
            let beside = flow.equilibria(activation.existence + 1e-6 * off, sigma);
            let is_stable = flow.has_stable_motion(stable + 1e-4 * off, sigma);
            assert_eq!([!beside.is_empty(), is_stable], [exists; 2], "sigma = {sigma}");
        }
    }
    // From rest the linear resonance must reach the wall: C = G/lambda = 1.
    close(flow.activation(EPSILON, 0.0).steady_linear, LAMBDA, 1e-15);
    close(flow.activation(EPSILON, 0.0).from_rest, LAMBDA, 1e-4);
}

/// The smallest G at which the plant, at rest until the drive is switched on at a phase of the base, has an impact within `periods`.
fn first_impact(scene: &Dimensionless, sigma: f64, phase: f64, periods: f64) -> f64 {
    let hits = |g: f64| {
        let drive = Dimensionless { g, ..*scene }.drive(sigma);
        let mut plant = scene.plant([0.0; 4]).unwrap();
        let still = Drive { amplitude: 0.0, ..drive };
        plant.advance(still, phase / drive.omega).unwrap();
        plant.advance(drive, periods * TAU / drive.omega).unwrap().impacts > 0
    };
    try_bisection(0.0, 60.0, 1e-9, |g| Ok::<_, ()>(!hits(g))).unwrap().1
}

#[test]
fn impacts_begin_from_rest_where_the_program_says() {
    // The default scene, with what an independent simulation found and its last digit; and other rigs.
    let default = [0.032 / 3.807, 1.427_381];
    for ([epsilon, lambda], sigma, known) in [
        // The stable solution of the theory.
        (default, -1.1817, Some((2.322, 0.001))),
        (default, -2.0, Some((3.122, 0.001))),
        (default, -5.0, Some((6.10, 0.01))),
        ([0.001, 0.3], 0.4, None),
        ([0.05, 0.2], -3.0, None),
        ([0.02, 2.0], 0.0, None),
        ([0.1, 0.7], 4.0, None),
        ([0.03, 1.0], -0.3, None),
    ] {
        let scene = Dimensionless::new(epsilon, lambda, R, 0.0);
        let found = SlowFlow::new(lambda, R).activation(epsilon, sigma);
        let plant = first_impact(&scene, sigma, 0.0, 12.0 / (epsilon * lambda));
        assert!((plant - found.from_rest).abs() < 1e-6 * plant, "{plant} {found:?}");
        let Some((known, digit)) = known else { continue };
        assert!((found.from_rest - known).abs() <= digit, "{found:?}");
        let beat = 1.0 / (epsilon * sigma.abs());
        let after = [beat, 2.0 * beat, 20_000.0].map(|periods| first_impact(&scene, sigma, 0.0, periods));
        let is_same = |one: &f64| (one - found.from_rest).abs() < 1e-6;
        assert!(after.iter().all(is_same), "{after:?}");
        let phases = (0..8).map(|n| first_impact(&scene, sigma, f64::from(n) * PI / 8.0, 2.0 * beat));
        let (least, any) = (phases.fold(f64::MAX, f64::min), found.from_rest_any_phase);
        assert!(any <= least + 1e-6 && least < 1.005 * any, "{least}");
        assert!(found.steady_linear > 1.1 * found.from_rest);
    }
    // Without damping, at resonance, any drive suffices.
    assert_eq!(SlowFlow::new(0.0, R).activation(EPSILON, 0.0).from_rest, 0.0);
}
