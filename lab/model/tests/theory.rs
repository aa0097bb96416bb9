//! Guards first-order theory: its identities, frequency responses and activation.

mod common;

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use lovines::Drive;
use vines_model::theory::{
    B_SYMMETRY_BREAKING, BackbonePoint, BranchSide, Manifold, SlowFlow, impacts_stable, resonant,
};
use vines_model::{Dimensionless, numerics::try_bisection};

use common::{close, rows};

const EPSILON: f64 = 0.0084;
const LAMBDA: f64 = 1.43;
const R: f64 = 0.65;
/// Excitations and detunings with one to four equilibria.
const DRIVES: [(f64, f64); 6] = [
    (1.1, -1.0),
    (1.1, -1.5),
    (1.3, 0.2),
    (1.6, -0.8),
    (0.9, -1.2),
    (1.1, 3.0),
];

/// The phase-resonant motions of an oscillator under the excitation `g`.
fn phase_resonant(lambda: f64, r: f64, g: f64) -> Vec<BackbonePoint> {
    resonant(&Dimensionless::new(EPSILON, lambda, r, g))
}

fn flow() -> SlowFlow {
    SlowFlow::new(LAMBDA, R)
}

/// `(D1 C~, D1 gamma)` at the particle speed `b` and the phase `gamma`, rad (docs/theory.md, eq. 11).
fn rates(flow: &SlowFlow, (g, sigma): (f64, f64), [b, gamma]: [f64; 2]) -> [f64; 2] {
    let c = flow.manifold.c(b);
    [
        -flow.loss(b) - g * c * gamma.sin(),
        flow.free_detuning(b) - g * gamma.cos() / (2.0 * c) - sigma,
    ]
}

/// Trace and determinant of the fast half-period map at the particle speed `b`:
/// `2 r + (1 + r)^2 (pi/(2 B) - pi^2/4)` and `r^2` (docs/theory.md, eq. 9).
fn half_period_map(r: f64, b: f64) -> [f64; 2] {
    let trace = 2.0 * r + (1.0 + r).powi(2) * (PI / (2.0 * b) - PI * PI / 4.0);
    [trace, r * r]
}

/// Columns of the Jacobian of a map of the plane, by central differences.
fn jacobian(at: [f64; 2], map: impl Fn([f64; 2]) -> [f64; 2]) -> [[f64; 2]; 2] {
    const H: f64 = 1e-6;
    [[H, 0.0], [0.0, H]].map(|h| {
        let [plus, minus] = [1.0, -1.0].map(|sign| map([0, 1].map(|i| at[i] + sign * h[i])));
        [0, 1].map(|i| (plus[i] - minus[i]) / (2.0 * H))
    })
}

// Identities of the theory, and the theory columns of the references.

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
        let points = phase_resonant(LAMBDA, r, g);
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
        let points = phase_resonant(row.lambda, row.r, row.g).into_iter();
        let mut apart = points.map(|one| (one.sigma - sigma).abs().max((one.c - c).abs()).max((one.b - b).abs()));
        assert!(apart.any(|apart| apart < 1e-10), "{row:?}");
    }
}

#[test]
fn elastic_impacts_have_no_solution_without_amplitude() {
    for lambda in [LAMBDA, 0.0] {
        let points = phase_resonant(lambda, 1.0, 1.1);
        assert!(points.iter().all(|point| point.c > 0.1), "{points:?}");
    }
}

// Driven motions at any detuning: frequency responses and activation.

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
    try_bisection(0.0, 60.0, 1e-9, |g| Some(!hits(g))).unwrap().1
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
