//! Driven motions at any detuning: frequency responses and activation.

use vines_model::{
    Dimensionless,
    theory::{B_SYMMETRY_BREAKING, Manifold, SlowFlow},
};

use crate::{LAMBDA, R, close, flow};

#[test]
fn every_point_of_a_frequency_response_is_an_equilibrium() {
    let flow = flow();
    for g in [0.9, 1.1, 1.6] {
        let curves = flow.frequency_responses(g, 81);
        assert!(!curves.is_empty());
        for point in curves.iter().flatten() {
            let [amplitude, phase] = flow.rates(g, point.sigma, point.motion.b, point.motion.gamma);
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
        let activation = flow.activation(sigma);
        let h = 1e-6;
        assert!(flow.equilibria(activation.existence - h, sigma).is_empty());
        assert!(!flow.equilibria(activation.existence + h, sigma).is_empty());
        let stable = activation.stable.expect("a stable motion at some G");
        assert!(!flow.has_stable_motion(stable - 1e-4, sigma), "sigma = {sigma}");
        assert!(flow.has_stable_motion(stable + 1e-4, sigma), "sigma = {sigma}");
        assert!(activation.existence <= stable);
    }
    // From rest the linear resonance must reach the wall: C = G/lambda = 1.
    close(flow.activation(0.0).steady_linear, LAMBDA, 1e-15);
    close(flow.activation(0.0).from_rest, LAMBDA, 1e-15);
}

#[test]
fn elastic_undamped_motion_needs_no_excitation_on_its_backbone() {
    let flow = SlowFlow::new(0.0, 1.0);
    for b in [0.7, 0.9, 1.2] {
        close(flow.backbone_at(b).g, 0.0, 1e-15);
        close(flow.excitation_at(flow.free_detuning(b), b), 0.0, 1e-15);
    }
}

#[test]
fn the_stable_island_lies_between_fold_and_symmetry_breaking() {
    let flow = flow();
    let (b_min, sigma) = (Manifold::new(R).b_min(), -1.0);
    let within = flow.stable_at(sigma, 0.5 * (b_min + B_SYMMETRY_BREAKING));
    assert!(within && !flow.stable_at(sigma, b_min - 0.01) && !flow.stable_at(sigma, B_SYMMETRY_BREAKING + 0.01));
}

/// The smallest G at which the plant, at rest until the drive is switched on, has an impact.
fn first_impact(epsilon: f64, lambda: f64, sigma: f64) -> f64 {
    let hits = |g: f64| {
        let scene = Dimensionless::new(epsilon, lambda, 0.65, g);
        let mut plant = scene.plant([0.0; 4]).unwrap();
        let drive = scene.drive(sigma);
        let periods = 6.0 / (epsilon * lambda);
        plant.advance(drive, periods).unwrap().impacts > 0
    };
    vines_model::numerics::try_bisection(0.0, 40.0, 1e-6, |g| Ok::<_, ()>(!hits(g)))
        .unwrap()
        .1
}

#[test]
fn impacts_begin_from_rest_where_the_beat_reaches_the_wall() {
    for (sigma, known) in [(-1.18, 2.322), (-2.0, 3.122), (-5.0, 6.10)] {
        let flow = SlowFlow::new(1.43, 0.65);
        let found = flow.activation(sigma);
        let [plant, half] = [0.0084, 0.0042].map(|epsilon| first_impact(epsilon, 1.43, sigma));
        println!(
            "sigma = {sigma}: from rest {:.4}, plant {plant:.4} and {half:.4} at half epsilon, steady {:.4}",
            found.from_rest, found.steady_linear
        );
        assert!((plant - known).abs() < 0.006 * known, "{plant}");
        assert!((found.from_rest - plant).abs() < 0.03 * plant, "{found:?}");
        assert!(
            (found.from_rest - half).abs() < 0.7 * (found.from_rest - plant).abs() + 1e-3,
            "{found:?}"
        );
        assert!(found.steady_linear > 1.1 * found.from_rest);
    }
}
