//! Hard scenes by the thousand, as a table: `scripts/stress --plant` runs the long form (`SCENES=100000`), the test suite a short one.

mod common;

use common::{Scene, scene};
use lovines::{Drive, Event, Parameters, Plant, State};
use proptest::strategy::{Strategy, ValueTree};
use proptest::test_runner::{Config, RngAlgorithm, TestRng, TestRunner};
use std::f64::consts::TAU;

/// Periods' worth of steps that each scene is followed for.
const STEPS: usize = 30;
/// No scene may meet more impacts than this per period of its fastest rate; the hops of a lively particle are the most.
const MOST_IMPACTS_PER_PERIOD: f64 = 1e7;

fn scenes(driven: bool, n: usize) -> impl Iterator<Item = Scene> {
    let rng = TestRng::from_seed(RngAlgorithm::ChaCha, &[7; 32]);
    let mut runner = TestRunner::new_with_rng(Config::default(), rng);
    let strategy = scene(driven);
    (0..n).map(move |_| strategy.new_tree(&mut runner).unwrap().current())
}

/// The worst that any scene showed.
#[derive(Debug, Default)]
struct Worst {
    /// `|w|/b - 1`.
    outside: f64,
    /// Growth of the energy without excitation, relative to that at the start.
    growth: f64,
    /// What energy and dissipated energy miss of that at the start, without damping.
    missing: f64,
    impacts_per_period: f64,
    impacts: u64,
}

fn follow(s: &Scene, driven: bool, worst: &mut Worst) -> [u64; 4] {
    let mut plant = Plant::new(s.parameters, s.start).unwrap();
    let at_start = plant.energy(0.0);
    let mut before = at_start;
    for _ in 0..STEPS {
        let mut count = 0u64;
        let outcome = plant.advance_with(s.drive, s.step, |event| {
            if let Event::Impact { wall, velocity, .. } = event {
                assert!(
                    wall.sign() * velocity > 0.0,
                    "an impact from behind the wall"
                );
                count += 1;
            }
        });
        assert_eq!(outcome.impacts, count);
        assert!(!outcome.cut_short, "{s:?}");
        let state = plant.state();
        assert!(
            [state.q1, state.dq1, state.q2, state.dq2]
                .iter()
                .all(|x| x.is_finite()),
            "{s:?}: {state:?}"
        );
        let w = plant.relative_displacement().abs() / s.parameters.half_width;
        worst.outside = worst.outside.max(w - 1.0);
        let fastest = s.parameters.fastest_rate().max(s.drive.omega.abs());
        let periods = (s.step * fastest / TAU).max(1.0);
        worst.impacts_per_period = worst.impacts_per_period.max(count as f64 / periods);
        worst.impacts += count;
        if !driven {
            let (now, dissipated) = (plant.energy(0.0), plant.tally().dissipated);
            worst.growth = worst.growth.max((now - before) / at_start);
            if s.parameters.damping == 0.0 {
                let missing = (now + dissipated - at_start).abs() / at_start;
                worst.missing = worst.missing.max(missing);
            }
            before = now;
        }
    }
    let x = plant.state();
    [x.q1, x.dq1, x.q2, x.dq2].map(f64::to_bits)
}

fn random_scenes(n: usize) {
    for driven in [false, true] {
        let mut worst = Worst::default();
        for s in scenes(driven, n) {
            let bits = follow(&s, driven, &mut worst);
            assert_eq!(bits, follow(&s, driven, &mut Worst::default()), "{s:?}");
        }
        let kind = if driven { "driven" } else { "free" };
        println!(
            "| {n} {kind} scenes, {} impacts | \\|w\\|/b - 1 at most {:.0e}; energy grows by at most {:.1e}, accounts miss at most \
             {:.1e}; at most {:.0} impacts a period; the same bits twice |",
            worst.impacts, worst.outside, worst.growth, worst.missing, worst.impacts_per_period
        );
        assert!(worst.outside <= 1e-12);
        assert!(worst.growth <= 1e-12);
        assert!(worst.missing <= 1e-12);
        assert!(worst.impacts_per_period <= MOST_IMPACTS_PER_PERIOD);
    }
}

/// Elastic impacts, no damping, nothing drives: the energy is to stay.
fn conservative(epsilon: f64, impacts: u64) -> f64 {
    let parameters = Parameters {
        damping: 0.0,
        ..Parameters::dimensionless(epsilon, 0.0, 1.0)
    };
    let start = State {
        q1: 0.4,
        dq1: 0.1,
        q2: 0.2,
        dq2: -1.1,
    };
    let mut plant = Plant::new(parameters, start).unwrap();
    let at_start = plant.energy(0.0);
    let mut worst = 0.0f64;
    while plant.tally().impacts < impacts {
        plant.advance(Drive::default(), 100.0);
        let energy = plant.energy(0.0) + plant.tally().dissipated;
        worst = worst.max((energy - at_start).abs() / at_start);
    }
    worst
}

fn elastic(impacts: u64) {
    for epsilon in [1e-6, 1e-4, 0.0084, 0.1, 0.3, 1.0] {
        let drift = conservative(epsilon, impacts);
        println!(
            "| r = 1, c = 0, mass ratio {epsilon}, {impacts} impacts | energy drifts by {drift:.1e} |"
        );
        // The bound is per 10^5 impacts: what an anchor's own rounding brings in grows with their number.
        assert!(drift <= 1e-12 * (impacts as f64 / 1e5));
    }
}

fn gaps() {
    let (amplitude, omega) = (0.0084 * 1.1, 0.990_417);
    for gap in [1e-6, 1e-4, 1e-2, 1.0, 1e2, 1e3] {
        let parameters = Parameters {
            half_width: gap * 0.77,
            ..Parameters::dimensionless(0.0084, 1.43, 0.65)
        };
        for q2 in [0.0, parameters.half_width, -parameters.half_width] {
            let start = State {
                q2,
                ..State::default()
            };
            let mut plant = Plant::new(parameters, start).unwrap();
            for _ in 0..100 {
                plant.advance(Drive::harmonic(amplitude, omega), TAU / omega);
                let w = plant.relative_displacement().abs();
                assert!(w <= parameters.half_width * (1.0 + 1e-12));
                assert!(plant.state().q1.abs() < 1.0);
            }
            if q2 == 0.0 {
                println!(
                    "| gap of {gap:.0e} amplitudes, 100 periods from rest | {} impacts |",
                    plant.tally().impacts
                );
            }
        }
    }
}

fn steps() {
    let parameters = Parameters::dimensionless(0.0084, 1.43, 0.65);
    let start = State {
        q1: -0.42,
        dq1: 0.01,
        q2: -0.99,
        dq2: -0.86,
    };
    let omega = 0.990_417;
    let (drive, period) = (Drive::harmonic(0.0084 * 1.1, omega), TAU / omega);
    let mut plant = Plant::new(parameters, start).unwrap();
    let outcome = plant.advance(drive, 1e6 * period);
    println!("| one step of 10^6 periods | {} impacts |", outcome.impacts);
    assert!(outcome.impacts.abs_diff(2_000_000) <= 2 && !outcome.cut_short);

    let (step, n) = (2f64.powi(-30), 100_000);
    let (mut tiny, mut one) = (
        Plant::new(parameters, start).unwrap(),
        Plant::new(parameters, start).unwrap(),
    );
    for _ in 0..n {
        tiny.advance(drive, step);
    }
    one.advance(drive, step * f64::from(n));
    let (a, b) = (tiny.state(), one.state());
    let difference = [a.q1 - b.q1, a.dq1 - b.dq1, a.q2 - b.q2, a.dq2 - b.dq2]
        .iter()
        .fold(0.0f64, |worst, x| worst.max(x.abs()));
    println!("| {n} steps of 10^-9 rad against one | {difference:.1e} |");
    assert!(difference <= 1e-12);
}

#[test]
fn hard_scenes_are_survived() {
    let n = std::env::var("SCENES").map_or(2000, |n| n.parse().expect("a number of scenes"));
    println!("| scene | what came of it |\n|---|---|");
    random_scenes(n);
    elastic(1_000_000);
    gaps();
    steps();
}
