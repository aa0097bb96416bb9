//! Motions off the manifold, impact by impact.

use std::f64::consts::PI;

use vines_model::theory::SlowFlow;

use crate::{LAMBDA, close, flow, half_period_map};

/// (B, psi) one impact later at frozen C and gamma: the fast map.
fn fast_map(r: f64, (c, gamma): (f64, f64), (b, psi): (f64, f64)) -> [f64; 2] {
    let next = SlowFlow::new(LAMBDA, r)
        .modulation(0.0, (0.0, 0.0), (c, gamma), (b, psi))
        .next()
        .expect("an impact");
    [next.b, next.psi]
}

#[test]
fn the_jumps_linearised_are_the_half_period_map() {
    for (r, b) in [(0.65, 0.7), (0.65, 0.9), (0.65, 1.2), (0.9, 0.8), (0.3, 0.5)] {
        let flow = SlowFlow::new(LAMBDA, r);
        let (gamma, h) = (0.3, 1e-6);
        let (c, psi) = (flow.manifold.c(b), flow.psi(b, gamma));
        let map = |b: f64, psi: f64| fast_map(r, (c, gamma), (b, psi));
        let by = |plus: [f64; 2], minus: [f64; 2]| [0, 1].map(|i| (plus[i] - minus[i]) / (2.0 * h));
        let by_b = by(map(b + h, psi), map(b - h, psi));
        let by_psi = by(map(b, psi + h), map(b, psi - h));
        let [trace, determinant] = half_period_map(r, b);
        close(by_b[0] + by_psi[1], trace, 1e-7);
        close(by_b[0] * by_psi[1] - by_b[1] * by_psi[0], determinant, 1e-7);
    }
}

/// Largest distance of the walk's C from the slow flow's, from B 5 % off the manifold, over tau1 from 0.05 to 0.5.
fn distance_from_slow_flow(epsilon: f64) -> f64 {
    let flow = flow();
    let (g, sigma) = (1.1, -1.0);
    let (b, gamma) = (0.85, -1.3);
    let start = (flow.manifold.c(b), gamma);
    let walk = flow.modulation(epsilon, (g, sigma), start, (1.05 * b, flow.psi(b, gamma)));
    // The slow flow by small classical steps in (C^2, gamma).
    let speed = |square: f64| {
        flow.manifold
            .b(square.sqrt(), vines_model::theory::BranchSide::Right)
            .expect("above the fold")
    };
    let rates = |[square, gamma]: [f64; 2]| crate::rates(&flow, (g, sigma), speed(square), gamma);
    let mut state = [start.0 * start.0, gamma];
    let mut reached = 0.0;
    let mut largest = 0f64;
    for one in walk {
        let tau1 = epsilon * one.tau;
        if tau1 > 0.5 {
            break;
        }
        let h = tau1 - reached;
        let add = |x: [f64; 2], k: [f64; 2], h: f64| [x[0] + h * k[0], x[1] + h * k[1]];
        let k1 = rates(state);
        let k2 = rates(add(state, k1, h / 2.0));
        let k3 = rates(add(state, k2, h / 2.0));
        let k4 = rates(add(state, k3, h));
        state = [0, 1].map(|i| state[i] + h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]));
        reached = tau1;
        if tau1 > 0.05 {
            largest = largest.max((one.c - state[0].sqrt()).abs());
        }
    }
    assert!(reached > 0.45, "the walk ended at tau1 = {reached}");
    largest
}

#[test]
fn past_the_fast_approach_the_impacts_follow_the_slow_flow_to_first_order() {
    let (coarse, fine) = (distance_from_slow_flow(4e-3), distance_from_slow_flow(5e-4));
    let slope = (coarse / fine).ln() / 8f64.ln();
    assert!((0.85..1.2).contains(&slope));
}

#[test]
fn a_walk_from_an_equilibrium_rests_there() {
    let flow = flow();
    let (g, sigma) = (1.1, -1.2);
    let one = flow
        .equilibria(g, sigma)
        .into_iter()
        .find(|one| one.impacts_stable && one.slow_flow_stable)
        .unwrap();
    let epsilon = 1e-3;
    let phases = (one.b, flow.psi(one.b, one.gamma));
    let last = flow
        .modulation(epsilon, (g, sigma), (one.c, one.gamma), phases)
        .take(4_000)
        .last()
        .unwrap();
    close(last.c, one.c, 5.0 * epsilon);
    close(last.b, one.b, 5.0 * epsilon);
    close(last.gamma, one.gamma, 5.0 * epsilon);
}

#[test]
fn below_the_fold_the_walk_ends() {
    let flow = flow();
    let b = flow.manifold.b_min() + 0.02;
    let c = flow.manifold.c(b);
    let walk = flow.modulation(1e-3, (0.0, 0.0), (c, 0.0), (b, flow.psi(b, 0.0)));
    let last = walk.take(100_000).last().unwrap();
    assert!(last.tau < 50_000.0 * PI, "it never ends");
    assert!(last.c < flow.manifold.c_min(), "{last:?}");
}
