//! Tests of `model_exchange/rates`.

use super::*;
use lovines::{Drive, State};

#[test]
fn each_derivative_is_the_difference_quotient_of_the_one_before() {
    let p = Parameters::dimensionless(0.1, 1.0, 0.65);
    let start = State { q1: 0.2, dq1: -0.5, q2: 0.1, dq2: 0.3 };
    let drive = Drive { signal: [0.1, -0.2, 0.3, 0.05], ..Drive::harmonic(0.2, 1.3) };
    let mut plant = Plant::new(p, start).unwrap();
    plant.begin(drive).unwrap();
    let ahead = |t: f64| {
        let mut ahead = plant;
        ahead.advance(drive, t).unwrap();
        Movement::of(&ahead)
    };
    let (h, at) = (1e-4, 0.2);
    let (before, now, after) = (ahead(at - h), ahead(at), ahead(at + h));
    assert_eq!(plant.totals().impacts, 0);
    let close = |a: f64, b: f64, n: usize| assert!((a - b).abs() < 1e-7, "{n}: {a} {b}");
    for n in 0..4 {
        let slope = |of: fn(&Movement) -> &Rates| (of(&after)[n] - of(&before)[n]) / (2.0 * h);
        close(slope(|m| &m.base), now.base[n + 1], n);
        close(slope(|m| &m.primary), now.primary[n + 1], n);
        close(slope(|m| &m.particle), now.particle[n + 1], n);
    }
    for n in 0..3 {
        let slope = (after.energy(&p, n) - before.energy(&p, n)) / (2.0 * h);
        close(slope, now.energy(&p, n + 1), n);
    }
}
