//! Tests of `cavity`: the laws of restitution and the random numbers.

use super::*;

#[test]
fn the_fifth_root_is_exact_to_rounding() {
    for n in -3000..3000 {
        let v = 1.07f64.powi(n);
        let x = fifth_root(v);
        assert!((x.powi(5) / v - 1.0).abs() < 1e-14, "{v:e}");
        let times_32 = fifth_root(32.0 * v) / x;
        assert!((times_32 - 2.0).abs() < 8.0 * f64::EPSILON, "{v:e}: {times_32}");
    }
}

#[test]
fn the_deviates_have_the_moments_of_a_nearly_normal_distribution() {
    for seed in [0, 1, 2, u64::MAX] {
        let n = 200_000;
        let x: Vec<f64> = (0..n).map(|k| deviate(seed, k)).collect();
        let moment = |power: i32| x.iter().map(|x| x.powi(power)).sum::<f64>() / n as f64;
        // Five standard errors.
        let error = 5.0 / (n as f64).sqrt();
        assert!(moment(1).abs() < error, "{seed}");
        assert!((moment(2) - 1.0).abs() < error * 2f64.sqrt(), "{seed}");
        assert!(moment(3).abs() < error * 15f64.sqrt(), "{seed}");
        assert!((moment(4) - 2.85).abs() < error * 96f64.sqrt(), "{seed}");
        let next = x.windows(2).map(|x| x[0] * x[1]).sum::<f64>() / n as f64;
        assert!(next.abs() < error, "{seed}");
    }
}

#[test]
fn the_deviates_are_the_same_on_every_platform() {
    let values = [(0, 0), (0, 1), (1, 0), (42, 1_000_000)].map(|(seed, n)| deviate(seed, n).to_bits());
    assert_eq!(values, VALUES);
}

/// By tests/reference/cavity.py.
const VALUES: [u64; 4] = [
    4607718464952031028,
    4607358664592858913,
    4602848668514658691,
    4611386156192265518,
];

#[test]
fn every_law_is_limited_to_the_allowed_range() {
    let cavity = Cavity {
        restitution: [Some(Restitution::Viscoelastic(0.5)), Some(Restitution::Plastic(0.1))],
        least_restitution: 0.3,
        ..Cavity::IDEAL
    };
    let rebound = Rebound::new(&Parameters { cavity, ..Parameters::dimensionless(0.01, 1.0, 0.6) });
    let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-15, "{a} {b}");
    near(rebound.mean(Wall::Plus, 1.0), 0.5);
    near(rebound.mean(Wall::Plus, 1e3), 0.3);
    near(rebound.mean(Wall::Minus, 0.05), 1.0);
    near(rebound.mean(Wall::Minus, 1.6), 0.5);
    near(rebound.mean(Wall::Minus, 1e6), 0.3);
    for scatter in [0.1, 1.0] {
        let rebound = Rebound { scatter, ..rebound };
        for n in 0..1000 {
            let r = rebound.of_impact(Wall::Plus, 0.2, n);
            assert!((0.3..=1.0).contains(&r), "{r}");
        }
    }
}
