//! Exact orbits against independent 40-digit references, and against laws they must obey.

use vines_model::{
    Dimensionless,
    orbit::{Orbit, exact_backbone, phase_resonant},
    theory::Manifold,
};

mod reference;
use reference::rows;

/// The orbit closest to the row's sigma.
fn nearest(row: &reference::Row) -> Orbit {
    let scene = Dimensionless::new(row.epsilon, row.lambda, row.r, row.g);
    let distance = |orbit: &Orbit| (orbit.sigma - row.sigma).abs();
    phase_resonant(&scene)
        .into_iter()
        .min_by(|one, other| distance(one).total_cmp(&distance(other)))
        .expect("an orbit for every row")
}

#[test]
fn orbits_match_the_references_to_all_their_digits() {
    let (mut state, mut multipliers) = (0f64, 0f64);
    for row in rows() {
        let orbit = nearest(&row);
        for (found, expected) in [(orbit.sigma, row.sigma), (orbit.c, row.c), (orbit.b, row.b)] {
            state = state.max((found - expected).abs());
        }
        for (found, expected) in orbit.multipliers.iter().zip(row.multipliers) {
            multipliers = multipliers.max((found - expected).abs());
        }
        assert_eq!(orbit.stable, row.multipliers[3] < 1.0, "{row:?}");
    }
    println!("largest deviation: sigma, C, B {state:.2e}, multipliers {multipliers:.2e}");
    assert!(state < 1e-10, "the references have ten digits: {state:e}");
    assert!(multipliers < 6e-7, "the references have six digits: {multipliers:e}");
}

#[test]
fn what_is_found_beside_the_references_lies_on_the_unstable_left_branch() {
    let rows = rows();
    for row in &rows {
        let listed = |orbit: &Orbit| {
            rows.iter()
                .filter(|other| (other.epsilon, other.r, other.g) == (row.epsilon, row.r, row.g))
                .any(|other| (other.sigma - orbit.sigma).abs() < 1e-8)
        };
        let scene = Dimensionless::new(row.epsilon, row.lambda, row.r, row.g);
        let b_min = Manifold::new(row.r).b_min();
        for orbit in phase_resonant(&scene).iter().filter(|orbit| !listed(orbit)) {
            assert!(orbit.b < b_min && !orbit.stable, "{orbit:?}");
        }
    }
}

#[test]
fn the_backbone_at_an_orbits_frequency_needs_the_orbits_excitation() {
    let scene = Dimensionless::new(0.0084, 1.43, 0.65, 1.1);
    for orbit in phase_resonant(&scene) {
        let backbone = exact_backbone(&scene, orbit.omega);
        assert!(backbone.iter().any(|other| (other.g - 1.1).abs() < 1e-12));
    }
}

#[test]
fn without_dissipation_the_backbone_is_the_conservative_mode() {
    let scene = Dimensionless::new(0.0084, 0.0, 1.0, 0.0);
    let mut seen = 0;
    for sigma in [-2.0, -1.0, -0.5, 0.3] {
        for mode in exact_backbone(&scene, 1.0 + scene.epsilon * sigma) {
            seen += 1;
            assert!(mode.g < 1e-12, "no excitation is needed: {mode:?}");
            // Volume and time reversal: the multipliers come in pairs of product one.
            let product: f64 = mode.multipliers.iter().product();
            assert!((product - 1.0).abs() < 1e-9, "{mode:?}");
        }
    }
    assert!(seen > 0);
}

#[test]
fn damping_of_the_oscillator_is_not_needed() {
    let scene = Dimensionless::new(0.0084, 0.0, 0.65, 0.5);
    let orbits = phase_resonant(&scene);
    assert!(!orbits.is_empty());
    for orbit in &orbits {
        // Power in (per radian, over epsilon: G C/2) is the impacts' loss, two per period.
        let epsilon = scene.epsilon;
        let loss = 0.5 / (1.0 + epsilon) * (1.0 - scene.r.powi(2)) * orbit.impact_velocity.powi(2);
        let power = loss * orbit.omega / std::f64::consts::PI;
        // q1 of first order differs from v: the drive acts on q1.
        assert!((power / (orbit.g * orbit.c / 2.0) - 1.0).abs() < 0.05, "{orbit:?}");
    }
}

#[test]
fn no_orbit_is_invented_where_the_excitation_is_too_weak() {
    assert_eq!(phase_resonant(&Dimensionless::new(0.0084, 1.43, 0.65, 0.2)), []);
    assert_eq!(phase_resonant(&Dimensionless::new(0.0084, 1.43, 0.65, 0.0)), []);
}

/// One classical Runge-Kutta step of the driven oscillator, independent of the closed form.
fn step([q, dq]: [f64; 2], tau: f64, h: f64, acceleration: impl Fn(f64, f64, f64) -> f64) -> [f64; 2] {
    let slope = |q: f64, dq: f64, tau: f64| [dq, acceleration(q, dq, tau)];
    let a = slope(q, dq, tau);
    let b = slope(q + h / 2.0 * a[0], dq + h / 2.0 * a[1], tau + h / 2.0);
    let c = slope(q + h / 2.0 * b[0], dq + h / 2.0 * b[1], tau + h / 2.0);
    let d = slope(q + h * c[0], dq + h * c[1], tau + h);
    let sum = |i: usize| h / 6.0 * (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i]);
    [q + sum(0), dq + sum(1)]
}

#[test]
fn an_integrated_orbit_is_minus_itself_after_half_a_period() {
    for (lambda, r, g) in [(1.43, 0.65, 1.1), (1.43, 0.65, 1.0), (0.0, 0.65, 0.5), (1.43, 1.0, 1.1)] {
        let scene = Dimensionless::new(0.0084, lambda, r, g);
        for orbit in phase_resonant(&scene) {
            let (epsilon, start) = (scene.epsilon, orbit.start);
            let acceleration = |q: f64, dq: f64, tau: f64| {
                let angle = orbit.omega * tau + start.phase;
                let base = epsilon * g * angle.sin();
                let rate = epsilon * g * orbit.omega * angle.cos();
                base - q + epsilon * lambda * (rate - dq)
            };
            let steps = 2000;
            let h = std::f64::consts::PI / orbit.omega / f64::from(steps);
            let mut state = [start.q1, start.dq1];
            for i in 0..steps {
                state = step(state, f64::from(i) * h, h, acceleration);
                let w = state[0] - start.q2 - start.dq2 * f64::from(i + 1) * h;
                assert!(w.abs() < 1.0 + 1e-10, "outside the cavity: {orbit:?}");
            }
            let [q1, dq1] = state;
            let q2 = start.q2 + start.dq2 * f64::from(steps) * h;
            // The impact on w = -1, by momentum and restitution.
            let change = -(1.0 + r) * (dq1 - start.dq2) / (1.0 + epsilon);
            for (end, begin) in [
                (q1, start.q1),
                (dq1 + epsilon * change, start.dq1),
                (q2, start.q2),
                (start.dq2 - change, start.dq2),
            ] {
                assert!((end + begin).abs() < 1e-10, "{end} and {begin}: {orbit:?}");
            }
        }
    }
}
