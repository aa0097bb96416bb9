//! Guards both FMUs against arguments that make no sense: each is refused with one line that says why, changes nothing and takes bounded time.
//! Random sequences of calls, of which `scripts/stress` makes many more; the exported symbols. What holds for every component is tested in
//! `fmi2-component/tests/`.

use fmi2_boundary::{Fmu, Functions, Interface::CoSimulation, Master, call, fuzz::Fuzzer, refused};
use fmi2_component::Status;
use object::{Object, ObjectSymbol};

/// Value references: stiffness, damping, half-width, restitution, e, E, omega, q1, der(q1), q2, der(q2), theta, mu_k, r_law.
const K: u32 = 1;
const C: u32 = 2;
const B: u32 = 4;
const R: u32 = 5;
const SIGNAL: u32 = 6;
const E: u32 = 7;
const OMEGA: u32 = 8;
const Q1: u32 = 9;
const DQ1: u32 = 10;
const Q2: u32 = 11;
const DQ2: u32 = 12;
const THETA: u32 = 35;
const MU_K: u32 = 36;
const R_LAW: u32 = 38;

/// Asserts that a call is an error with one line that contains `reason`, and changes nothing.
#[track_caller]
fn harmless(m: &Master, reason: &str, call: impl FnOnce() -> Status) {
    let before = m.bytes();
    let _ = m.heard();
    m.expect(call(), Status::Error, &[reason]);
    assert_eq!(m.bytes(), before);
}

#[test]
fn where_one_of_several_values_is_refused_none_is_set() {
    let m = &Master::ready(&Fmu::plant());
    // Stiffness and restitution are tunable: the first values are fine, the last is refused by the component itself.
    harmless(m, "at most 1", || m.set_reals(&[K, SIGNAL, R], &[9000.0, 0.5, 1.5]));
    harmless(m, "finite", || m.set_reals(&[SIGNAL, OMEGA], &[0.5, f64::NAN]));
    harmless(m, "cannot be set", || m.set_reals(&[SIGNAL, Q1], &[0.5, 0.5]));
    harmless(m, "orders 1 to 3", || {
        let (vr, orders, values) = ([SIGNAL; 2], [1, 4], [0.5, 0.5]);
        call!(m.fmi2SetRealInputDerivatives(vr.as_ptr(), 2, orders.as_ptr(), values.as_ptr()))
    });
    let m = &Master::new(&Fmu::plant(), CoSimulation);
    harmless(m, "r_law", || m.set_integer(R_LAW, 3));
    let m = &Master::ready(&Fmu::controller());
    m.well(m.step(0.0, 1e-3));
    // amplitude is fine, phase_target is not.
    harmless(m, "between -pi and pi", || m.set_reals(&[5, 10], &[1e-5, 7.0]));
    harmless(m, "samples", || m.step(1e-3, 1e300));
    m.well(m.step(1e-3, 0.1));
}

#[test]
fn a_step_that_ends_at_its_most_reversals_says_how_many_impacts_it_had() {
    // On a tilted floor with hardly any friction, a particle that loses nothing at its wall hops and turns round without end.
    let start = [
        (B, 0.01),
        (R, 1.0),
        (THETA, 0.01),
        (MU_K, 1e-12),
        (Q2, 0.01),
        (DQ2, -1e-6),
    ];
    let m = Master::started(&Fmu::plant(), CoSimulation, &start);
    refused!(m.fmi2DoStep(0.0, 1e4, 1) => ", 2000000 releases and ");
}

#[test]
fn a_step_of_absurdly_many_impacts_ends_with_an_error_and_a_reset_helps() {
    let m = Master::started(&Fmu::plant(), CoSimulation, &[(B, 1e-9), (R, 1.0), (DQ2, 1e8)]);
    refused!(m.fmi2DoStep(0.0, 1.0, 1) => "there are 10000000 impacts, 0 releases and ");
    m.well(call!(m.fmi2Reset()));
    m.start();
    m.well(m.step(0.0, 0.1));
}

#[test]
fn a_step_that_could_not_end_or_whose_numbers_are_lost_in_rounding_is_not_begun() {
    let m = &Master::ready(&Fmu::plant());
    for step in [1e8, 1e300] {
        harmless(m, "rad of the fastest rate", || m.step(0.0, step));
    }
    let beyond_doubles = "m is refused; allowed is a finite number from -1e100 to 1e100";
    for (vr, value, step, reason) in [
        (OMEGA, -1e300, 1e-300, "rad/s is refused"),
        (SIGNAL, 1e300, 1e-3, beyond_doubles),
        (SIGNAL, -1e14, 1e-3, "2^52 half-widths"),
        (E, -1e300, 1e-3, beyond_doubles),
        (E, 5e13, 1e-3, "2^52 half-widths"),
    ] {
        m.well(m.set_real(vr, value));
        harmless(m, reason, || m.step(0.0, step));
        m.well(m.set_real(vr, 0.0));
    }
    let curve = |third: f64| call!(m.fmi2SetRealInputDerivatives(&SIGNAL, 1, &3, &third));
    m.well(curve(1e30));
    // Also by a step in which the base does not get there.
    for step in [1.0, 1e-300] {
        harmless(m, "2^52 half-widths", || m.step(0.0, step));
    }
    m.well(curve(1.0));
    m.well(m.step(0.0, 1.0));
    let m = Master::started(&Fmu::plant(), CoSimulation, &[(C, 1e12)]);
    m.well(m.step(0.0, 1e-7));
}

#[test]
fn a_start_beyond_double_precision_is_refused() {
    let far = ["from -1e100 to 1e100", "2^52 half-widths"];
    for (values, parts) in [
        // The rates that follow from the values, and the values.
        (&[(0, 1e-90), (K, 1e100)][..], &["rad/s is refused"][..]),
        (&[(C, 1e60)], &["rad/s is refused"]),
        (&[(OMEGA, -1e300)], &["rad/s is refused"]),
        (&[(DQ1, 1e300)], &["der(q1)", far[0]]),
        (&[(DQ1, -1e90)], &["der(q1)", far[1]]),
        (&[(DQ2, 1e300)], &["der(q2)", far[0]]),
        (&[(DQ2, -1e90)], &["der(q2)", far[1]]),
    ] {
        let m = Master::with(&Fmu::plant(), CoSimulation, values);
        m.enter_initialization();
        m.expect(call!(m.fmi2ExitInitializationMode()), Status::Error, parts);
    }
    // What makes no sense with any other value is refused at once.
    let m = Master::new(&Fmu::plant(), CoSimulation);
    m.expect(m.set_real(K, 1e300), Status::Error, &["N/m is refused"]);
    m.expect(m.set_real(C, 1e300), Status::Error, &["N.s/m is refused"]);
}

/// Value references of tunable parameters of the plant, each with two values; a value of one may contradict a value of another.
const TUNABLE: [(u32, [f64; 2]); 9] = [
    (K, [1e4, 2e4]),
    (C, [2.0, 3.0]),
    (R, [0.4, 0.8]),
    // theta, mu_k, mu_s, r_plus, r_minus, r_min.
    (35, [0.0, 0.1]),
    (36, [0.1, 0.2]),
    (37, [0.1, 0.2]),
    (39, [0.5, 0.6]),
    (40, [0.5, 0.6]),
    (41, [0.1, 0.9]),
];

#[test]
fn the_order_in_which_parameters_are_set_does_not_matter() {
    let fmu = Fmu::plant();
    for (n, (first, from)) in TUNABLE.into_iter().enumerate() {
        for (second, to) in TUNABLE.into_iter().skip(n + 1) {
            for (before, after) in [(0, 1), (1, 0)] {
                let parameters = [first, second];
                for order in [[0, 1], [1, 0]] {
                    let values = |which: usize| [from[which], to[which]];
                    let m = Master::new(&fmu, CoSimulation);
                    m.well(m.set_reals(&parameters, &values(before)));
                    m.start();
                    m.well(m.step(0.0, 0.01));
                    // A call each, with an output read between them, and one call for both.
                    for n in order {
                        m.well(m.set_real(parameters[n], values(after)[n]));
                        m.reals(&[23]);
                    }
                    assert_eq!(m.reals(&parameters), values(after));
                    m.well(m.step(0.01, 0.01));
                    m.well(m.set_reals(&order.map(|n| parameters[n]), &order.map(|n| values(before)[n])));
                    m.well(m.step(0.02, 0.01));
                }
            }
        }
    }
    let m = Master::started(&fmu, CoSimulation, &[(37, 0.1), (36, 0.1)]);
    m.well(m.set_real(36, 0.2));
    harmless(
        &m,
        "mu_s (static friction) = 0.1 is refused; allowed is a number from mu_k to 100",
        || m.step(0.0, 0.01),
    );
    m.well(m.set_real(37, 0.2));
    m.well(m.step(0.0, 0.01));
    // The controller has two tunable parameters, and inputs that belong together.
    let m = Master::ready(&Fmu::controller());
    for (vr, value) in [(10, -1.5), (5, 1e-4), (5, 2e-4), (10, -1.6)] {
        m.well(m.set_real(vr, value));
    }
    m.well(m.step(0.0, 1e-3));
}

#[test]
fn calls_in_any_order_are_answered_and_every_error_has_a_reason() {
    for fmu in [Fmu::plant(), Fmu::controller(), Fmu::tank()] {
        let mut fuzzer = Fuzzer::new(fmu);
        (0..400).for_each(|seed| fuzzer.sequence(seed));
        let [ok, _, _, error, ..] = fuzzer.statuses;
        let calls: u64 = fuzzer.statuses.iter().sum();
        let enough = ok > calls / 10 && error > calls / 10 && fuzzer.harmless > 100;
        assert!(enough, "{fuzzer:?}");
    }
}

#[test]
fn exactly_the_functions_of_the_standard_are_exported() {
    let mut expected = Functions::NAMES.to_vec();
    assert_eq!(expected.len(), 44, "as in FMI 2.0");
    expected.sort_unstable();
    for name in ["LoViNes", "PhaseLock", "Tank"] {
        let bytes = std::fs::read(Fmu::path(name)).unwrap();
        let library = object::File::parse(&*bytes).unwrap();
        let defined = library.dynamic_symbols().filter(|s| s.is_definition());
        let mut found: Vec<_> = defined.map(|s| s.name().unwrap().to_owned()).collect();
        found.sort();
        assert_eq!(found, expected, "{name}");
    }
}
