//! Identities that the first-order theory must satisfy, and the theory columns of the references.

use std::f64::consts::{FRAC_PI_2, PI};

use vines_model::theory::{B_SYMMETRY_BREAKING, BranchSide, Manifold, SlowFlow};

use crate::reference::rows;
use crate::{LAMBDA, R, close, flow, half_period_map, rates};

#[test]
fn both_branches_lie_on_the_manifold() {
    for r in [0.3, 0.65, 0.9, 1.0] {
        let manifold = Manifold::new(r);
        for c in [0.4, 0.7, 0.99, 2.0] {
            for side in [BranchSide::Left, BranchSide::Right] {
                let Some(b) = manifold.b(c, side) else {
                    continue;
                };
                close(manifold.c(b), c, 1e-14);
                assert_eq!(manifold.side(b), side);
            }
        }
        close(manifold.c(manifold.b_min()), manifold.c_min(), 1e-14);
        assert_eq!(manifold.b(manifold.c_min() - 1e-9, BranchSide::Right), None);
    }
}

#[test]
fn the_slope_of_the_manifold_is_its_difference_quotient() {
    let manifold = Manifold::new(R);
    let (b, h) = (0.9, 1e-6);
    let squares = manifold.c(b + h).powi(2) - manifold.c(b - h).powi(2);
    close(manifold.slope(b), 2.0 * h / squares, 1e-8);
}

/// k1 to k6 of the study: `-G C sin gamma = k1 C~ ± k2 s + k3` and `G C cos gamma = k4 C~ ± k5 s + k6` at an equilibrium, with `C~ = C^2` and
/// `s = sqrt(C~ - Cmin^2)` (docs/theory.md, eq. 13).
fn published(flow: &SlowFlow, sigma: f64) -> [f64; 6] {
    let (r, b_min, fold) = (
        flow.manifold.dissipation,
        flow.manifold.b_min(),
        flow.manifold.c_min().powi(2),
    );
    let root = (2.0 / PI * b_min).sqrt();
    [
        flow.lambda + 8.0 / (PI * PI) * r * b_min,
        8.0 / PI * r * b_min * root,
        4.0 / PI * r * b_min * (b_min - 2.0 / PI * fold),
        -4.0 / PI * b_min - 2.0 * sigma,
        4.0 / PI * root * (1.0 - PI * b_min),
        4.0 / PI * b_min * (1.0 - PI / 2.0 * b_min + fold),
    ]
}

#[test]
fn equilibria_rest_on_the_manifold_and_satisfy_k1_to_k6() {
    let (flow, manifold) = (flow(), Manifold::new(R));
    let mut seen = 0;
    for (g, sigma) in [(1.1, -1.0), (1.1, -1.5), (1.3, 0.2), (1.6, -0.8), (0.9, -1.2)] {
        let [k1, k2, k3, k4, k5, k6] = published(&flow, sigma);
        for one in flow.equilibria(g, sigma) {
            seen += 1;
            let [amplitude, phase] = rates(&flow, (g, sigma), one.b, one.gamma);
            close(amplitude, 0.0, 1e-12);
            close(phase, 0.0, 1e-12);
            let square = one.c * one.c;
            let sign = if one.branch == BranchSide::Right { 1.0 } else { -1.0 };
            let root = sign * (square - manifold.c_min().powi(2)).max(0.0).sqrt();
            let (sine, cosine) = one.gamma.sin_cos();
            close(-g * one.c * sine, k1 * square + k2 * root + k3, 1e-9);
            close(g * one.c * cosine, k4 * square + k5 * root + k6, 1e-9);
        }
    }
    assert!(seen >= 8, "only {seen} equilibria");
}

#[test]
fn slow_flow_stability_is_that_of_the_linearised_rates() {
    let flow = flow();
    for (g, sigma) in [(1.1, -1.0), (1.3, 0.2), (0.9, -1.2), (1.6, -0.8)] {
        for one in flow.equilibria(g, sigma) {
            let h = 1e-6;
            let rates = |db: f64, dgamma: f64| rates(&flow, (g, sigma), one.b + db, one.gamma + dgamma);
            let squares = Manifold::new(R).slope(one.b);
            let by = |plus: [f64; 2], minus: [f64; 2], i: usize| (plus[i] - minus[i]) / (2.0 * h);
            let (b_plus, b_minus) = (rates(h, 0.0), rates(-h, 0.0));
            let (p_plus, p_minus) = (rates(0.0, h), rates(0.0, -h));
            let j11 = by(b_plus, b_minus, 0) * squares;
            let j21 = by(b_plus, b_minus, 1) * squares;
            let (j12, j22) = (by(p_plus, p_minus, 0), by(p_plus, p_minus, 1));
            let stable = j11 + j22 < 0.0 && j11 * j22 - j12 * j21 > 0.0;
            assert_eq!(one.slow_flow_stable, stable, "{one:?}");
        }
    }
}

#[test]
fn phase_resonance_is_the_equilibrium_at_minus_a_quarter_turn() {
    let flow = flow();
    for g in [0.95, 1.1, 1.3] {
        for point in flow.phase_resonant(g) {
            close(point.g, g, 1e-12);
            let equilibrium = flow
                .equilibria(g, point.sigma)
                .into_iter()
                .find(|one| (one.b - point.b).abs() < 1e-7)
                .expect("an equilibrium at the backbone's detuning");
            close(equilibrium.gamma, -FRAC_PI_2, 1e-6);
            assert_eq!(equilibrium.slow_flow_stable, point.slow_flow_stable);
        }
    }
}

#[test]
fn the_slope_of_the_excitation_is_its_difference_quotient() {
    let flow = flow();
    for b in [0.3, 0.7, 1.0] {
        let h = 1e-6;
        let (plus, minus) = (flow.backbone_at(b + h), flow.backbone_at(b - h));
        close(flow.excitation_slope(b), (plus.g - minus.g) / (plus.c - minus.c), 1e-7);
    }
}

#[test]
fn the_fast_map_is_stable_exactly_between_fold_and_symmetry_breaking() {
    for r in [0.3, 0.65, 0.9] {
        let b_min = Manifold::new(r).b_min();
        for (b, expected) in [
            (b_min - 1e-6, false),
            (b_min + 1e-6, true),
            (B_SYMMETRY_BREAKING - 1e-6, true),
            (B_SYMMETRY_BREAKING + 1e-6, false),
        ] {
            let [trace, determinant] = half_period_map(r, b);
            let stable = trace.abs() < 1.0 + determinant && determinant < 1.0;
            assert_eq!(stable, expected, "r = {r}, B = {b}");
        }
    }
}

#[test]
fn the_decay_in_closed_form_follows_the_slow_flow_to_the_fold() {
    for (lambda, r) in [(LAMBDA, R), (0.0, R), (LAMBDA, 1.0), (1e-9, R), (LAMBDA, 0.2)] {
        let flow = SlowFlow::new(lambda, r);
        let decay = flow.decay(1.0, 20_001).expect("it dissipates");
        assert_eq!(decay[0].tau1, 0.0);
        close(decay[20_000].c, flow.manifold.c_min(), 1e-14);
        // D1 C~ by differences between neighbours, away from the fold.
        for around in decay[..15_000].windows(3).step_by(1999) {
            let [before, at, after] = [&around[0], &around[1], &around[2]];
            let rate = (after.c.powi(2) - before.c.powi(2)) / (after.tau1 - before.tau1);
            close(rate, -flow.loss(at.b), 1e-7);
            close(at.sigma, flow.free_detuning(at.b), 1e-15);
        }
    }
    assert!(SlowFlow::new(0.0, 1.0).decay(0.9, 2).is_none());
    assert!(flow().decay(flow().manifold.b_min() - 1e-3, 2).is_none());
}

#[test]
fn the_theory_columns_of_the_references_are_reproduced() {
    let mut largest = 0f64;
    for row in rows() {
        let distance = |b: f64| (b - row.b_theory).abs();
        let point = SlowFlow::new(row.lambda, row.r)
            .phase_resonant(row.g)
            .into_iter()
            .min_by(|one, other| distance(one.b).total_cmp(&distance(other.b)))
            .expect("a solution for every row");
        for (found, expected) in [
            (point.sigma, row.sigma_theory),
            (point.c, row.c_theory),
            (point.b, row.b_theory),
        ] {
            largest = largest.max((found - expected).abs());
        }
    }
    assert!(largest < 1e-10, "{largest:e}");
}

#[test]
fn elastic_impacts_have_no_solution_without_amplitude() {
    for lambda in [LAMBDA, 0.0] {
        for point in SlowFlow::new(lambda, 1.0).phase_resonant(1.1) {
            assert!(point.c > 0.1, "{point:?}");
        }
    }
}
