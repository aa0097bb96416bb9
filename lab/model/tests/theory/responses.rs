//! Driven motions at any detuning: frequency responses and activation.

use std::f64::consts::{PI, TAU};

use lovines::Drive;
use vines_model::{Dimensionless, numerics::try_bisection, theory::SlowFlow};

use crate::{EPSILON, LAMBDA, R, close, flow};

#[test]
fn every_point_of_a_frequency_response_is_an_equilibrium() {
    let flow = flow();
    for g in [0.9, 1.1, 1.6] {
        let curves = flow.frequency_responses(g, 81);
        assert!(!curves.is_empty());
        for point in curves.iter().flatten() {
            let [amplitude, phase] = crate::rates(&flow, (g, point.sigma), point.motion.b, point.motion.gamma);
            close(amplitude, 0.0, 1e-7);
            close(phase, 0.0, 1e-7);
        }
    }
}

#[test]
fn at_one_detuning_the_responses_cross_as_often_as_there_are_equilibria() {
    let flow = flow();
    for (g, sigma) in [(1.1, -1.0), (1.3, 0.2), (1.6, -0.8), (1.1, 3.0), (0.9, -1.2)] {
        let crossings: usize = flow
            .frequency_responses(g, 4_001)
            .iter()
            .map(|curve| {
                let sides = curve.windows(2);
                sides
                    .filter(|pair| (pair[0].sigma > sigma) != (pair[1].sigma > sigma))
                    .count()
            })
            .sum();
        assert_eq!(crossings, flow.equilibria(g, sigma).len(), "G = {g}, sigma = {sigma}");
    }
}

#[test]
fn the_backbone_passes_through_the_maxima_of_the_frequency_responses() {
    for r in [0.4, 0.65, 0.9] {
        let flow = SlowFlow::new(LAMBDA, r);
        for above in [0.05, 0.2, 0.6] {
            let fold = flow.backbone_at(flow.manifold.b_min());
            let g = fold.g + above;
            // The maximum over sigma by a search among all equilibria, which knows nothing of phase resonance.
            let highest = |sigma: f64| {
                flow.equilibria(g, sigma).iter().fold(0.0, |most: f64, one| {
                    if one.b > flow.manifold.b_min() {
                        most.max(one.c)
                    } else {
                        most
                    }
                })
            };
            let mut best = (-400..400)
                .map(|n| f64::from(n) * 0.01)
                .max_by(|a, b| highest(*a).total_cmp(&highest(*b)))
                .unwrap();
            let mut step = 0.01;
            while step > 1e-10 {
                match [best - step, best + step]
                    .into_iter()
                    .find(|one| highest(*one) > highest(best))
                {
                    Some(one) => best = one,
                    None => step /= 2.0,
                }
            }
            let point = flow.phase_resonant(g).into_iter().next_back().unwrap();
            close(best, point.sigma, 1e-4);
            close(highest(best), point.c, 1e-8);
        }
    }
}

#[test]
fn the_activation_thresholds_are_where_equilibria_begin() {
    let flow = flow();
    for sigma in [-2.0, -1.2, -0.5, 0.4] {
        let activation = flow.activation(EPSILON, sigma);
        let h = 1e-6;
        assert!(flow.equilibria(activation.existence - h, sigma).is_empty());
        assert!(!flow.equilibria(activation.existence + h, sigma).is_empty());
        let stable = activation.stable.expect("a stable motion at some G");
        assert!(!flow.has_stable_motion(stable - 1e-4, sigma), "sigma = {sigma}");
        assert!(flow.has_stable_motion(stable + 1e-4, sigma), "sigma = {sigma}");
        assert!(activation.existence <= stable);
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
    // The default scene; its stable solution of the theory is at sigma = -1.1817.
    let scene = Dimensionless::new(0.032 / 3.807, 1.427_381, R, 0.0);
    // What an independent simulation found, and its last digit.
    for (sigma, known, digit) in [(-1.1817, 2.322, 0.001), (-2.0, 3.122, 0.001), (-5.0, 6.10, 0.01)] {
        let found = SlowFlow::new(scene.lambda, R).activation(scene.epsilon, sigma);
        let beat = 1.0 / (scene.epsilon * sigma.abs());
        let after = [beat, 2.0 * beat, 20_000.0].map(|periods| first_impact(&scene, sigma, 0.0, periods));
        let phases = (0..8).map(|n| first_impact(&scene, sigma, f64::from(n) * PI / 8.0, 2.0 * beat));
        let phases: Vec<f64> = phases.collect();
        assert!((found.from_rest - known).abs() <= digit, "{found:?}");
        assert!(
            after.iter().all(|one| (one - found.from_rest).abs() < 1e-6),
            "{after:?}"
        );
        let least = phases.iter().copied().fold(f64::MAX, f64::min);
        assert!(
            found.from_rest_any_phase <= least + 1e-6 && least < 1.005 * found.from_rest_any_phase,
            "{least}"
        );
        assert!(found.steady_linear > 1.1 * found.from_rest);
    }
}

#[test]
fn the_thresholds_from_rest_are_those_of_the_plant_for_any_rig() {
    for (epsilon, lambda, sigma) in [
        (0.001, 0.3, 0.4),
        (0.05, 0.2, -3.0),
        (0.02, 2.0, 0.0),
        (0.1, 0.7, 4.0),
        (0.03, 1.0, -0.3),
    ] {
        let scene = Dimensionless::new(epsilon, lambda, R, 0.0);
        let found = SlowFlow::new(lambda, R).activation(epsilon, sigma);
        let plant = first_impact(&scene, sigma, 0.0, 12.0 / (epsilon * lambda));
        assert!((plant - found.from_rest).abs() < 1e-6 * plant, "{plant} {found:?}");
    }
    // Without damping, at resonance, any drive suffices.
    assert_eq!(SlowFlow::new(0.0, R).activation(EPSILON, 0.0).from_rest, 0.0);
}
