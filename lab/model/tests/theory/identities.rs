//! Identities that the first-order theory must satisfy, and the theory columns of the references.

use std::f64::consts::{FRAC_PI_2, PI};

use vines_model::theory::{B_SYMMETRY_BREAKING, BranchSide, Manifold, SlowFlow, impacts_stable};

use crate::reference::rows;
use crate::{DRIVES, LAMBDA, R, close, flow, half_period_map, jacobian, rates};

#[test]
fn both_branches_lie_on_the_manifold_and_have_its_slope() {
    for r in [0.3, 0.65, 0.9, 1.0] {
        let manifold = Manifold::new(r);
        for c in [0.4, 0.7, 0.99, 2.0] {
            for side in [BranchSide::Left, BranchSide::Right] {
                let Some(b) = manifold.b(c, side) else {
                    continue;
                };
                close(manifold.c(b), c, 1e-14);
                assert_eq!(manifold.side(b), side);
                let squares = manifold.c(b + 1e-6).powi(2) - manifold.c(b - 1e-6).powi(2);
                close(manifold.slope(b), 2e-6 / squares, 1e-8);
            }
        }
        close(manifold.c(manifold.b_min()), manifold.c_min(), 1e-14);
        assert_eq!(manifold.b(manifold.c_min() - 1e-9, BranchSide::Right), None);
    }
}

/// k1 to k6 of the study: `-G C sin gamma = k1 C~ ± k2 s + k3` and `G C cos gamma = k4 C~ ± k5 s + k6` at an equilibrium, with `C~ = C^2` and
/// `s = sqrt(C~ - Cmin^2)` (docs/theory.md, eq. 13).
fn published(flow: &SlowFlow, sigma: f64) -> [f64; 6] {
    let (r, b_min) = (flow.manifold.dissipation, flow.manifold.b_min());
    let fold = flow.manifold.c_min().powi(2);
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
fn equilibria_rest_on_the_manifold_satisfy_k1_to_k6_and_are_stable_as_the_linearised_rates_are() {
    let (flow, manifold) = (flow(), Manifold::new(R));
    let mut seen = 0;
    for (g, sigma) in DRIVES[..5].iter().copied() {
        let [k1, k2, k3, k4, k5, k6] = published(&flow, sigma);
        for one in flow.equilibria(g, sigma) {
            seen += 1;
            let rates = |at| rates(&flow, (g, sigma), at);
            assert!(rates([one.b, one.gamma]).iter().all(|rate| rate.abs() <= 1e-12));
            let square = one.c * one.c;
            let sign = if one.branch == BranchSide::Right { 1.0 } else { -1.0 };
            let root = sign * (square - manifold.c_min().powi(2)).max(0.0).sqrt();
            let (sine, cosine) = one.gamma.sin_cos();
            close(-g * one.c * sine, k1 * square + k2 * root + k3, 1e-9);
            close(g * one.c * cosine, k4 * square + k5 * root + k6, 1e-9);

            let [by_b, by_gamma] = jacobian([one.b, one.gamma], rates);
            let by_square = by_b.map(|rate| rate * manifold.slope(one.b));
            let determinant = by_square[0] * by_gamma[1] - by_gamma[0] * by_square[1];
            let stable = by_square[0] + by_gamma[1] < 0.0 && determinant > 0.0;
            assert_eq!(one.slow_flow_stable, stable, "{one:?}");
        }
    }
    assert!(seen >= 8, "only {seen} equilibria");
}

#[test]
fn phase_resonance_is_the_equilibrium_at_minus_a_quarter_turn_with_the_largest_amplitude() {
    for (r, above) in [0.4, R, 0.9].into_iter().flat_map(|r| [0.05, 0.2, 0.6].map(|g| (r, g))) {
        let flow = SlowFlow::new(LAMBDA, r);
        let g = flow.backbone_at(flow.manifold.b_min()).g + above;
        let points = flow.phase_resonant(g);
        for point in &points {
            close(point.g, g, 1e-12);
            let mut equilibria = flow.equilibria(g, point.sigma).into_iter();
            let same = equilibria.find(|one| (one.b - point.b).abs() < 1e-7);
            let equilibrium = same.expect("an equilibrium at the backbone's detuning");
            close(equilibrium.gamma + FRAC_PI_2, 0.0, 1e-6);
            assert_eq!(equilibrium.slow_flow_stable, point.slow_flow_stable);
        }
        // Largest among all equilibria beyond the fold, which know nothing of phase resonance.
        let highest = |sigma: f64| {
            let equilibria = flow.equilibria(g, sigma).into_iter();
            let right = equilibria.filter(|one| one.branch == BranchSide::Right);
            right.fold(0.0, |most: f64, one| most.max(one.c))
        };
        let last = points.last().unwrap();
        close(highest(last.sigma), last.c, 1e-8);
        let near = [-1e-4, 1e-4].map(|off| last.sigma + off);
        for sigma in (-400..400).map(|n| 0.01 * f64::from(n)).chain(near) {
            assert!(highest(sigma) < last.c, "r = {r}, G = {g}, sigma = {sigma}");
        }
    }
}

#[test]
fn the_slope_of_the_excitation_is_its_difference_quotient() {
    let flow = flow();
    for b in [0.3, 0.7, 1.0] {
        let [plus, minus] = [1e-6, -1e-6].map(|h| flow.backbone_at(b + h));
        close(flow.excitation_slope(b), (plus.g - minus.g) / (plus.c - minus.c), 1e-7);
    }
}

#[test]
fn the_fast_map_is_stable_exactly_between_fold_and_symmetry_breaking() {
    for manifold in [0.3, 0.65, 0.9].map(Manifold::new) {
        let r = (1.0 - manifold.dissipation) / (1.0 + manifold.dissipation);
        for b in [manifold.b_min(), B_SYMMETRY_BREAKING]
            .into_iter()
            .flat_map(|b| [b - 1e-6, b + 1e-6])
        {
            let [trace, determinant] = half_period_map(r, b);
            let stable = trace.abs() < 1.0 + determinant && determinant < 1.0;
            assert_eq!(impacts_stable(&manifold, b), stable, "r = {r}, B = {b}");
        }
    }
}

#[test]
fn the_decay_in_closed_form_follows_the_slow_flow_to_the_fold() {
    for (lambda, r) in [(LAMBDA, R), (0.0, R), (LAMBDA, 1.0), (1e-9, R), (LAMBDA, 0.2)] {
        let flow = SlowFlow::new(lambda, r);
        let decay = flow.decay(1.0, 20_001).expect("it dissipates");
        assert_eq!(decay[0].0, 0.0);
        close(decay[20_000].1.c, flow.manifold.c_min(), 1e-14);
        // D1 C~ by differences between neighbours, away from the fold.
        for around in decay[..15_000].windows(3).step_by(1999) {
            let [before, at, after] = [0, 1, 2].map(|n| around[n]);
            let rate = (after.1.c.powi(2) - before.1.c.powi(2)) / (after.0 - before.0);
            close(rate, -flow.loss(at.1.b), 1e-7);
            close(at.1.sigma, flow.free_detuning(at.1.b), 1e-15);
        }
    }
    assert!(SlowFlow::new(0.0, 1.0).decay(0.9, 2).is_none());
    assert!(flow().decay(flow().manifold.b_min() - 1e-3, 2).is_none());
}

#[test]
fn the_theory_columns_of_the_references_are_reproduced() {
    for row in rows() {
        let [sigma, c, b] = row.theory;
        let points = SlowFlow::new(row.lambda, row.r).phase_resonant(row.g).into_iter();
        let mut apart = points.map(|one| (one.sigma - sigma).abs().max((one.c - c).abs()).max((one.b - b).abs()));
        assert!(apart.any(|apart| apart < 1e-10), "{row:?}");
    }
}

#[test]
fn elastic_impacts_have_no_solution_without_amplitude() {
    for lambda in [LAMBDA, 0.0] {
        let points = SlowFlow::new(lambda, 1.0).phase_resonant(1.1);
        assert!(points.iter().all(|point| point.c > 0.1), "{points:?}");
    }
}
