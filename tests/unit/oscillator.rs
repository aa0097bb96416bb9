//! Tests of `oscillator`.

use super::*;

/// The Taylor series of the matrix exponential, in steps short enough to converge at once: an independent way.
fn by_series(o: &Oscillator, t: f64) -> [f64; 4] {
    let steps = (o.fastest * t * 4.0).ceil().max(1.0);
    let h = t / steps;
    let column = |mut x: f64, mut v: f64| {
        for _ in 0..steps as usize {
            let mut c = [0.0; 24];
            (c[0], c[1]) = (x, v);
            for n in 0..22 {
                let (n1, n2) = (n as f64 + 1.0, n as f64 + 2.0);
                c[n + 2] = (-2.0 * o.delta * n1 * c[n + 1] - o.omega0_squared * c[n]) / (n1 * n2);
            }
            x = c.iter().rev().fold(0.0, |sum, c| sum * h + c);
            v = (1..24).rev().fold(0.0, |sum, n| sum * h + n as f64 * c[n]);
        }
        (x, v)
    };
    let ((xx, vx), (xv, vv)) = (column(1.0, 0.0), column(0.0, 1.0));
    [xx, xv, vx, vv]
}

#[test]
fn no_entry_loses_digits_across_critical_damping() {
    let around_critical = [-1e-3, -1e-8, -1e-12, -1e-15, 0.0, 1e-15, 1e-12, 1e-8, 1e-3];
    let ratios = [0.0, 1e-9, 0.006, 0.5, 0.9, 1.1, 1.5, 5.0, 40.0];
    for zeta in around_critical.iter().map(|d| 1.0 + d).chain(ratios) {
        let o = Oscillator::new(1.0, 1.0, 2.0 * zeta);
        for t in [1e-6, 0.01, 0.3, 1.0, 3.0, 10.0] {
            let m = o.flow(t).0;
            let reference = by_series(&o, t);
            let scale = [1.0, o.reach.min(t), o.fastest.min(1.0 / t), 1.0];
            for (got, (want, scale)) in [m.xx, m.xv, m.vx, m.vv].iter().zip(reference.iter().zip(scale)) {
                let error = (got - want).abs() / scale;
                assert!(error < 2e-14, "zeta {zeta}, t {t}: {got} {want} {error:e}");
            }
        }
    }
}

#[test]
fn far_above_critical_nothing_overflows() {
    let o = Oscillator::new(1.0, 1.0, 2e8);
    let m = o.flow(1e6).0;
    assert!((m.xx - (-1e6f64 / 2e8).exp()).abs() < 1e-12);
    assert!(m.vv.abs() < 1e-12 && m.xv.is_finite() && m.vx.is_finite());
}

#[test]
fn the_series_meets_the_quotient_where_they_change_over() {
    let (below, above) = (integrals(-0.5 + 1e-15, 1.0), integrals(-0.5 - 1e-15, 1.0));
    assert!((below.0 - above.0).abs() < 4e-15 && (below.1 - above.1).abs() < 4e-15);
}

#[test]
fn a_push_from_rest_obeys_the_equation_of_motion() {
    let oscillator = Oscillator::new(1.0, 1.0, 6.0);
    assert!(is_apart(&oscillator));
    for t in [0.01, 0.3, 2.0, 30.0] {
        let ((once, twice), m) = (pushed(&oscillator, t), oscillator.flow(t).0);
        // The integral of the equation of the velocity, once and twice.
        assert!((m.vv + 6.0 * m.xv + once - 1.0).abs() < 1e-14);
        assert!((m.xv + 6.0 * once + twice - t).abs() < 1e-14 * t.max(1.0));
    }
}
