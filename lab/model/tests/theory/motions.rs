//! Motions off the manifold, impact by impact.

use std::f64::consts::PI;

use vines_model::theory::SlowFlow;

use crate::walk::modulation;
use crate::{LAMBDA, close, flow, half_period_map, jacobian};

#[test]
fn the_jumps_linearised_are_the_half_period_map() {
    for (r, b) in [(0.65, 0.7), (0.65, 0.9), (0.65, 1.2), (0.9, 0.8), (0.3, 0.5)] {
        let flow = SlowFlow::new(LAMBDA, r);
        let gamma = 0.3;
        // (B, psi) one impact later at frozen C and gamma: the fast map.
        let map = |[speed, psi]: [f64; 2]| {
            let mut walk = modulation(&flow, 0.0, (0.0, 0.0), (flow.manifold.c(b), gamma), (speed, psi));
            let next = walk.next().expect("an impact");
            [next.b, next.psi]
        };
        let [by_b, by_psi] = jacobian([b, flow.psi(b, gamma)], map);
        let [trace, determinant] = half_period_map(r, b);
        close(by_b[0] + by_psi[1], trace, 1e-7);
        close(by_b[0] * by_psi[1] - by_b[1] * by_psi[0], determinant, 1e-7);
    }
}

/// Largest distance of the walk's C from the decay on the slow flow, from B 5 % off the manifold, over tau1 from 0.05 to 0.5.
fn distance_from_slow_flow(epsilon: f64) -> f64 {
    let flow = flow();
    let walk = modulation(
        &flow,
        epsilon,
        (0.0, 0.0),
        (flow.manifold.c(1.0), 0.0),
        (1.05, flow.psi(1.0, 0.0)),
    );
    let decay = flow.decay(1.0, 20_001).unwrap();
    let walk = walk
        .skip_while(|one| epsilon * one.tau < 0.05)
        .take_while(|one| epsilon * one.tau < 0.5);
    let distance = |(tau1, c): (f64, f64)| (c - decay[decay.partition_point(|one| one.0 < tau1)].1.c).abs();
    let walked: Vec<f64> = walk.map(|one| distance((epsilon * one.tau, one.c))).collect();
    assert!(walked.len() as f64 > 0.4 / (epsilon * PI), "the walk ended early");
    walked.into_iter().fold(0.0, f64::max)
}

#[test]
fn past_the_fast_approach_the_impacts_follow_the_slow_flow_to_first_order_down_to_the_fold() {
    let (coarse, fine) = (distance_from_slow_flow(4e-3), distance_from_slow_flow(5e-4));
    let order = (coarse / fine).ln() / 8f64.ln();
    assert!((0.85..1.2).contains(&order), "{order}");

    let flow = flow();
    let b = flow.manifold.b_min() + 0.02;
    let walk = modulation(
        &flow,
        1e-3,
        (0.0, 0.0),
        (flow.manifold.c(b), 0.0),
        (b, flow.psi(b, 0.0)),
    );
    let last = walk.take(100_000).last().unwrap();
    assert!(last.tau < 50_000.0 * PI, "it never ends");
    assert!(last.c < flow.manifold.c_min(), "{last:?}");
}

#[test]
fn a_walk_beside_an_equilibrium_leads_to_it() {
    let (flow, drive, epsilon) = (flow(), (1.1, -1.2), 1e-3);
    let mut equilibria = flow.equilibria(drive.0, drive.1).into_iter();
    let one = equilibria
        .find(|one| one.impacts_stable && one.slow_flow_stable)
        .unwrap();
    let beside = (one.b, flow.psi(one.b, one.gamma));
    for start in [(one.c, one.gamma), (1.02 * one.c, one.gamma + 0.05)] {
        let last = modulation(&flow, epsilon, drive, start, beside)
            .take(4_000)
            .last()
            .unwrap();
        for (found, expected) in [(last.c, one.c), (last.b, one.b), (last.gamma, one.gamma)] {
            close(found, expected, 5.0 * epsilon);
        }
    }
}
