//! The parameters of a real cavity: that they reach the plant, that a state can be saved, and the same in model exchange.

use fmi2_boundary::{Fmu, Interface, Master};
use fmi2_component::Status;
use lovines::{Cavity, Drive, Parameters, Plant, Restitution, State};

/// Value references of b_plus to mu_s, of r_plus to r_scatter, and values.
const REALS: [(u32, f64); 9] = [
    (33, 0.0105),
    (34, 0.0095),
    (35, 0.05),
    (36, 0.1),
    (37, 0.15),
    (39, 0.35),
    (40, 0.3),
    (41, 0.2),
    (42, 0.02),
];
/// r_law and seed.
const INTEGERS: [(u32, i32); 2] = [(38, 1), (43, 11)];
const STEP: f64 = 0.0025;

fn set_integer(m: &Master, vr: u32, value: i32) -> Status {
    // SAFETY: one reference, one value.
    unsafe { (m.f.fmi2SetInteger)(m.c, &vr, 1, &value) }
}

fn integer(m: &Master, vr: u32) -> i32 {
    let mut value = 0;
    // SAFETY: one reference, one place.
    m.well(unsafe { (m.f.fmi2GetInteger)(m.c, &vr, 1, &mut value) });
    value
}

fn real_cavity() -> Master {
    let m = Master::new(&Fmu::plant(), Interface::CoSimulation);
    for (vr, value) in REALS {
        m.well(m.set_real(vr, value));
    }
    for (vr, value) in INTEGERS {
        m.well(set_integer(&m, vr, value));
    }
    // E, omega, and a particle at rest.
    for (vr, value) in [(7, 0.0003), (8, 54.0), (12, 0.0)] {
        m.well(m.set_real(vr, value));
    }
    m.start();
    m
}

fn same_cavity() -> Plant {
    let cavity = Cavity {
        b_plus: Some(0.0105),
        b_minus: Some(0.0095),
        tilt: 0.05,
        kinetic_friction: 0.1,
        static_friction: Some(0.15),
        restitution: [0.35, 0.3].map(|k| Some(Restitution::Viscoelastic(k))),
        least_restitution: 0.2,
        scatter: 0.02,
        seed: 11,
    };
    let parameters = Parameters {
        primary_mass: 3.807,
        stiffness: 11680.0,
        damping: 2.53,
        particle_mass: 0.032,
        half_width: 0.01,
        restitution: 0.65,
        cavity,
    };
    Plant::new(parameters, State::default()).expect("a valid scene")
}

#[test]
fn the_parameters_reach_the_plant_and_the_totals_come_back() {
    let (m, mut plant) = (real_cavity(), same_cavity());
    for (vr, value) in REALS {
        assert_eq!(m.real(vr), value);
    }
    for (vr, value) in INTEGERS {
        assert_eq!(integer(&m, vr), value);
    }
    let drive = Drive::harmonic(0.0003, 54.0);
    for n in 0..1000 {
        m.well(m.step(f64::from(n) * STEP, STEP));
        plant.advance(drive, STEP).expect("a valid step");
        let State { q1, dq1, q2, dq2 } = plant.state();
        assert_eq!([9, 10, 11, 12].map(|vr| m.real(vr)), [q1, dq1, q2, dq2], "step {n}");
    }
    let totals = plant.totals();
    assert!(totals.impacts > 10 && totals.sticks > 0 && totals.stuck_time > 0.0 && totals.friction > 0.0);
    assert_eq!(
        [18, 44].map(|vr| integer(&m, vr) as u64),
        [totals.impacts, totals.sticks]
    );
    assert_eq!([45, 46].map(|vr| m.real(vr)), [totals.stuck_time, totals.friction]);
}

#[test]
fn output_derivatives_and_energy_know_friction_and_tilt() {
    let m = real_cavity();
    let h = 1e-7;
    for n in 0..400 {
        m.well(m.step(f64::from(n) * STEP, STEP));
    }
    let t = 400.0 * STEP;
    // q1, der(q1), q2, der(q2), energy, stuck_time, friction_loss.
    let variables = [9u32, 10, 11, 12, 22, 45, 46];
    let before = variables.map(|vr| m.real(vr));
    let slopes = variables.map(|vr| {
        let mut slope = 0.0;
        // SAFETY: one reference, one order, one place.
        m.well(unsafe { (m.f.fmi2GetRealOutputDerivatives)(m.c, &vr, 1, &1, &mut slope) });
        slope
    });
    let impacts = integer(&m, 18);
    m.well(m.step(t, h));
    assert_eq!(integer(&m, 18), impacts, "an impact in between would be a jump");
    for ((vr, before), slope) in variables.into_iter().zip(before).zip(slopes) {
        let difference = (m.real(vr) - before) / h;
        assert!(
            (difference - slope).abs() < 1e-4 * (1.0 + slope.abs()),
            "{vr}: {difference} {slope}"
        );
    }
}

#[test]
fn model_exchange_takes_the_parameters_and_slides_sticks_and_slips() {
    let m = Master::new(&Fmu::plant(), Interface::ModelExchange);
    for (vr, value) in REALS {
        m.well(m.set_real(vr, value));
    }
    for (vr, value) in INTEGERS {
        m.well(set_integer(&m, vr, value));
    }
    // A particle at rest, which friction holds.
    m.well(m.set_real(12, 0.0));
    m.start();
    let resolve = || {
        // SAFETY: one place; so below: arrays of five.
        m.well(unsafe { (m.f.fmi2NewDiscreteStates)(m.c, &mut Default::default()) });
    };
    let at = |t: f64| unsafe {
        m.well((m.f.fmi2EnterContinuousTimeMode)(m.c));
        m.well((m.f.fmi2SetTime)(m.c, t));
        m.well((m.f.fmi2EnterEventMode)(m.c));
    };
    resolve();
    assert_eq!(integer(&m, 44), 1);
    at(0.25);
    assert_eq!(m.real(45), 0.25, "time stuck");
    // A steeper slope lets it slip: der(w) < 0, because gravity pulls towards +q2.
    m.well(m.set_real(35, 0.3));
    resolve();
    // SAFETY: as above.
    let indicators = || unsafe {
        let mut z = [0.0; 5];
        m.well((m.f.fmi2GetEventIndicators)(m.c, z.as_mut_ptr(), 5));
        z
    };
    assert!(indicators()[4] < 1e-11 && indicators()[2..4] == [1.0; 2]);
    let pull = 9.80665 * (0.3f64.sin() - 0.1 * 0.3f64.cos());
    assert!((m.real(27) - pull).abs() < 1e-14, "der(u2)");
    let way = 1e-3;
    let mut x = [0.0, way, 0.0, 0.1, 0.0];
    unsafe {
        m.well((m.f.fmi2EnterContinuousTimeMode)(m.c));
        m.well((m.f.fmi2SetContinuousStates)(m.c, x.as_ptr(), 5));
    }
    let loss = 0.032 * 9.80665 * 0.1 * 0.3f64.cos() * way;
    assert!((m.real(46) / loss - 1.0).abs() < 1e-12, "energy lost to friction");
    // The particle has turned round: it sticks or slides the other way, at the next event.
    x[3] = -1e-6;
    unsafe { m.well((m.f.fmi2SetContinuousStates)(m.c, x.as_ptr(), 5)) };
    assert!(indicators()[4] < 0.0);
    unsafe { m.well((m.f.fmi2EnterEventMode)(m.c)) };
    resolve();
    assert!(indicators().iter().all(|&z| z > 0.0));
    assert_eq!((integer(&m, 44), m.real(15)), (1, 0.0), "it slides on from rest");
}

#[test]
fn a_law_that_does_not_exist_is_refused() {
    let m = Master::new(&Fmu::plant(), Interface::CoSimulation);
    for law in [-1, 3] {
        assert_eq!(set_integer(&m, 38, law), Status::Error);
    }
}

#[test]
fn partial_derivatives_by_tilt_and_friction_are_difference_quotients() {
    let m = real_cavity();
    for n in 0..400 {
        m.well(m.step(f64::from(n) * STEP, STEP));
    }
    // energy, der(u1), der(u2) by theta and mu_k.
    for known in [35u32, 36] {
        for unknown in [22u32, 25, 27] {
            let value = m.real(known);
            let at = |change: f64| {
                m.well(m.set_real(known, value + change));
                m.real(unknown)
            };
            let h = 1e-6;
            let quotient = (at(h) - at(-h)) / (2.0 * h);
            m.well(m.set_real(known, value));
            let mut slope = f64::NAN;
            // SAFETY: one element each.
            m.well(unsafe { (m.f.fmi2GetDirectionalDerivative)(m.c, &unknown, 1, &known, 1, &1.0, &mut slope) });
            assert!(
                (slope - quotient).abs() < 1e-7 * (1.0 + quotient.abs()),
                "{unknown} by {known}: {slope} {quotient}"
            );
        }
    }
}

#[test]
fn a_saved_state_goes_on_with_the_same_bits() {
    let (m, other) = (real_cavity(), real_cavity());
    for n in 0..600 {
        m.well(m.step(f64::from(n) * STEP, STEP));
        other.well(other.step(f64::from(n) * STEP, STEP));
        if n % 7 == 0 {
            // Forward with another step, and back.
            let mut state = std::ptr::null_mut();
            // SAFETY: the state is freed below, once.
            unsafe {
                other.well((other.f.fmi2GetFMUstate)(other.c, &mut state));
                other.well(other.step(f64::from(n + 1) * STEP, 3.3 * STEP));
                other.well((other.f.fmi2SetFMUstate)(other.c, state));
                other.well((other.f.fmi2FreeFMUstate)(other.c, &mut state));
            }
        }
        assert_eq!(
            m.reals(&[9, 10, 11, 12, 45, 46]),
            other.reals(&[9, 10, 11, 12, 45, 46]),
            "step {n}"
        );
    }
    assert_eq!(m.bytes(), other.bytes());
}
