//! One step of a million periods, and steps of a billionth of one.

use crate::table::Table;
use lovines::plant::{MOST_EVALUATIONS, MOST_IMPACTS};
use lovines::{Drive, Parameters, Plant, State};
use std::f64::consts::TAU;

const OMEGA: f64 = 0.990_417;

/// The default rig near its steady 1:1 motion.
fn steady() -> (Plant, Drive) {
    let start = State { q1: -0.42, dq1: 0.01, q2: -0.99, dq2: -0.86 };
    let plant = Plant::new(Parameters::dimensionless(0.0084, 1.43, 0.65), start).unwrap();
    (plant, Drive::harmonic(0.0084 * 1.1, OMEGA))
}

pub fn long(table: &mut Table) {
    let (mut plant, drive) = steady();
    let outcome = plant.advance(drive, 1e6 * TAU / OMEGA).unwrap();
    assert!(!outcome.cut_short);
    table.row(
        "one step of 10^6 periods: impacts more or less than 2 a period",
        &format!("{} impacts", outcome.impacts),
        outcome.impacts.abs_diff(2_000_000) as f64,
        2.0,
    );
}

/// The same with a chatter in every period: it ends before its time, and says so.
pub fn chatter(table: &mut Table) {
    let start = State { q1: 0.1, q2: 0.1, dq2: 0.3, ..State::default() };
    let mut plant = Plant::new(Parameters::dimensionless(0.05, 1.0, 0.4), start).unwrap();
    let outcome = plant.advance(Drive::harmonic(1.5, 0.6), 1e6 * TAU / 0.6).unwrap();
    table.row(
        "one step of 10^6 periods with chatter and rest: impacts, at most",
        if outcome.cut_short {
            "cut short, and says so"
        } else {
            "to its end"
        },
        outcome.impacts as f64,
        MOST_IMPACTS as f64,
    );
    table.progress("a million periods with chatter");
}

/// A primary mass that never quite reaches the particle: it would be searched for contacts without end.
pub fn endless(table: &mut Table) {
    let (g, sigma) = (1.64, 0.715);
    let mut plant = Plant::new(Parameters::dimensionless(0.0084, 1.43, 0.65), State::default()).unwrap();
    let drive = Drive::harmonic(0.0084 * g, 1.0 + 0.0084 * sigma);
    let outcome = plant.advance(drive, 1e100).unwrap();
    assert!(outcome.cut_short && outcome.elapsed > 1e6 && outcome.elapsed == plant.time());
    table.row(
        "one step of 10^100 s without contact: evaluations, at most",
        "cut short, and says so",
        outcome.evaluations as f64,
        MOST_EVALUATIONS as f64 + 1e3,
    );
    table.progress("a step without end");
}

/// Short steps against one long one: rounding errors do not add up.
pub fn short(table: &mut Table) {
    // Powers of two: both runs mean the same instants. The last is 78 periods in steps of 5e-4 rad.
    for (what, exponent, n) in [
        ("steps of 1.5e-10 periods", -30, 100_000),
        ("steps of 1e-6 rad", -20, 1_000_000),
        ("steps of 5e-4 rad", -11, 1_000_000),
    ] {
        let step = 2f64.powi(exponent);
        let (mut tiny, drive) = steady();
        let mut one = tiny;
        for _ in 0..n {
            tiny.advance(drive, step).unwrap();
        }
        one.advance(drive, step * f64::from(n)).unwrap();
        assert_eq!(tiny.totals().impacts, one.totals().impacts);
        table.row(
            &format!("{what} against one: states differ by"),
            &format!("{n} steps, {} impacts", one.totals().impacts),
            distance(&tiny, &one),
            1e-12,
        );
    }
}

fn distance(a: &Plant, b: &Plant) -> f64 {
    let (a, b) = (a.state(), b.state());
    [a.q1 - b.q1, a.dq1 - b.dq1, a.q2 - b.q2, a.dq2 - b.dq2]
        .iter()
        .fold(0.0f64, |worst, x| worst.max(x.abs()))
}
