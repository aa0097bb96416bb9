//! Guards the plant's FMU for co-simulation: parameters that reach the plant, outputs, inputs with derivatives, instances side by side, FMU states,
//! resets; and plant and controller coupled in irregular steps.

use std::thread;

use fmi2_boundary::Interface::{CoSimulation, ModelExchange};
use fmi2_boundary::{Fmu, Master, call, fuzz, pair};
use fmi2_component::Status;
use lovines::{Cavity, Drive, Parameters, Plant, Restitution, State};

/// Value references: stiffness, restitution, e, E, omega, der(q2), base.
const K: u32 = 1;
const R: u32 = 5;
const SIGNAL: u32 = 6;
const E: u32 = 7;
const OMEGA: u32 = 8;
const DQ2: u32 = 12;
const BASE: u32 = 16;
/// q1, der(q1), q2, der(q2), as outputs and as parameters.
const STATES: [u32; 4] = [9, 10, 11, 12];
const START_PARAMETERS: [u32; 4] = [29, 30, 31, 32];

/// A real cavity: b_plus to mu_s and r_plus to r_scatter, then r_law and seed.
const CAVITY: [u32; 9] = [33, 34, 35, 36, 37, 39, 40, 41, 42];
const REALS: [f64; 9] = [0.0105, 0.0095, 0.05, 0.1, 0.15, 0.35, 0.3, 0.2, 0.02];
const INTEGERS: [(u32, i32); 2] = [(38, 1), (43, 11)];

/// A driven plant, whose particle hits the walls.
fn lively(fmu: &Fmu) -> Master {
    Master::started(fmu, CoSimulation, &[(E, 1e-3), (OMEGA, 55.0), (DQ2, 0.5)])
}

fn steps(m: &Master, from: u32, count: u32, step: f64) {
    for n in from..from + count {
        m.well(m.step(f64::from(n) * step, step));
    }
}

#[test]
fn the_parameters_of_a_real_cavity_and_a_drive_that_jumps_reach_the_plant_and_the_totals_come_back() {
    let m = Master::with(&Fmu::plant(), CoSimulation, &[(E, 0.0003), (OMEGA, 54.0), (DQ2, 0.0)]);
    m.well(m.set_reals(&CAVITY, &REALS));
    for (vr, value) in INTEGERS {
        m.well(m.set_integer(vr, value));
    }
    m.start();
    let [
        b_plus,
        b_minus,
        tilt,
        kinetic_friction,
        mu_s,
        k_plus,
        k_minus,
        least_restitution,
        scatter,
    ] = REALS;
    let cavity = Cavity {
        b_plus: Some(b_plus),
        b_minus: Some(b_minus),
        tilt,
        kinetic_friction,
        static_friction: Some(mu_s),
        restitution: [k_plus, k_minus].map(|k| Some(Restitution::Viscoelastic(k))),
        least_restitution,
        scatter,
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
    let mut plant = Plant::new(parameters, State::default()).expect("a valid scene");
    assert_eq!(m.reals(&CAVITY), REALS);
    for (vr, value) in INTEGERS {
        assert_eq!(m.integer(vr), value);
    }
    let step = 0.0025;
    for n in 0..1000 {
        let x = f64::from(n % 13) / 13.0;
        let (signal, amplitude, omega) = ([1e-5 * x, 1e-3 * (x - 0.5), 0.0, 0.0], 0.0003 + 1e-5 * x, 54.0 + x);
        let drive = Drive { signal, amplitude, omega };
        m.well(m.set_reals(&[SIGNAL, E, OMEGA], &[signal[0], amplitude, omega]));
        m.well(call!(m.fmi2SetRealInputDerivatives(&SIGNAL, 1, &1, &signal[1])));
        if n % 7 == 0 {
            // Forward with another step, and back.
            let before = m.bytes();
            m.well(m.step(f64::from(n) * step, 3.3 * step));
            m.well(m.restore(&before));
        }
        m.well(m.step(f64::from(n) * step, step));
        plant.advance(drive, step).expect("a valid step");
        assert_eq!(m.reals(&STATES), <[f64; 4]>::from(plant.state()), "step {n}");
    }
    let totals = plant.totals();
    assert!(totals.impacts > 10 && totals.sticks > 0 && totals.stuck_time > 0.0 && totals.friction > 0.0);
    assert_eq!([18, 44].map(|vr| m.integer(vr) as u64), [totals.impacts, totals.sticks]);
    assert_eq!(m.reals(&[45, 46]), [totals.stuck_time, totals.friction]);
}

#[test]
fn outputs_do_not_depend_on_what_was_read_before() {
    let all_reals = [9, 10, 11, 12, 13, 14, 15, 16, 17, 19, 20, 22, 23];
    let outputs = |m: &Master| m.reals(&all_reals).map(f64::to_bits);
    let fmu = Fmu::plant();
    let other = Master::new(&fmu, CoSimulation);
    let m = Master::started(&fmu, CoSimulation, &[(DQ2, 2.0)]);
    // The same state in an instance that has computed no output yet.
    let fresh = |m: &Master| {
        other.well(other.restore(&m.bytes()));
        outputs(&other)
    };
    for n in 0..500 {
        assert_eq!(outputs(&m), fresh(&m), "before step {n}");
        // Every combination of changes turns up.
        let change = |every: u32, vr: u32, value: f64| {
            if n % every == 0 {
                m.well(m.set_real(vr, value));
            }
        };
        change(2, OMEGA, 54.0 + f64::from(n % 5));
        change(3, E, 1e-4 * f64::from(n % 4));
        change(5, SIGNAL, 1e-5 * f64::from(n % 3));
        change(7, K, 11_680.0 + f64::from(n % 6));
        change(11, R, 0.65 + 0.01 * f64::from(n % 2));
        assert_eq!(outputs(&m), fresh(&m), "inputs set before step {n}");
        m.well(m.step(f64::from(n) * 1e-3, 1e-3));
    }
    assert!(m.impacts() > 5 && m.real(BASE) != 0.0);
    // An input set to its present value changes nothing.
    let before = m.bytes();
    m.well(m.set_reals(&[OMEGA, E], &m.reals(&[OMEGA, E])));
    assert_eq!(m.bytes(), before);
}

#[test]
fn instances_do_not_know_of_each_other_in_whatever_thread() {
    let fmu = Fmu::plant();
    let alone = lively(&fmu);
    steps(&alone, 0, 500, 1e-3);
    assert!(alone.real(19) > 0.0, "something has hit");
    // Each instance is made in one thread and goes on in another; many of them take turns in each.
    let begun = [(); 8].map(|()| {
        thread::spawn(move || {
            let all: Vec<_> = (0..40).map(|_| lively(&fmu)).collect();
            (0..250).for_each(|n| all.iter().for_each(|m| steps(m, n, 1, 1e-3)));
            all
        })
    });
    let ended = begun.map(|thread| {
        let all = thread.join().unwrap();
        thread::spawn(move || {
            (250..500).for_each(|n| all.iter().for_each(|m| steps(m, n, 1, 1e-3)));
            all.iter().map(Master::bytes).collect::<Vec<_>>()
        })
    });
    for thread in ended {
        assert!(thread.join().unwrap().iter().all(|bytes| *bytes == alone.bytes()));
    }
}

#[test]
fn a_reset_instance_equals_a_fresh_one_and_states_are_small() {
    for (fmu, interface, most) in [
        (Fmu::plant(), CoSimulation, 1200),
        (Fmu::plant(), ModelExchange, 1200),
        (Fmu::controller(), CoSimulation, 6000),
    ] {
        let [used, fresh] = [(); 2].map(|()| Master::new(&fmu, interface));
        used.start();
        match interface {
            CoSimulation => steps(&used, 0, 100, 1e-3),
            ModelExchange => used.well(call!(used.fmi2NewDiscreteStates(&mut Default::default()))),
        }
        assert!(used.bytes().len() <= most, "{}: {} bytes", fmu.name, used.bytes().len());
        used.well(call!(used.fmi2Reset()));
        assert_eq!(used.bytes(), fresh.bytes());
    }
}

#[test]
fn a_pair_in_other_instances_continues_from_the_states_with_the_same_bits() {
    let fmus = Fmu::pair(None);
    let [mut pair, mut twin] = [(); 2].map(|()| pair::Pair::new(&fmus));
    (0..2000).for_each(|_| assert!(pair.step(pair::SAMPLE_TIME) > 0.0));
    twin.take_over(&pair);
    for pair in [&mut pair, &mut twin] {
        for _ in 0..1500 {
            pair.step(pair::SAMPLE_TIME);
            pair.digest();
        }
    }
    assert!(pair.impacts() > 20 && pair.hash() == twin.hash());
}

#[test]
fn the_state_of_another_model_or_interface_is_refused() {
    let plant = lively(&Fmu::plant());
    let exchanged = Master::new(&Fmu::plant(), ModelExchange);
    for foreign in [exchanged, Master::ready(&Fmu::controller())] {
        plant.expect(plant.restore(&foreign.bytes()), Status::Error, &["serialised state"]);
    }
}

#[test]
fn a_start_parameter_and_its_output_are_one_value() {
    for interface in [CoSimulation, ModelExchange] {
        for (output, parameter) in STATES.into_iter().zip(START_PARAMETERS) {
            let m = Master::new(&Fmu::plant(), interface);
            m.enter_initialization();
            assert_eq!(m.real(output), m.real(parameter), "both start alike");
            for (set, value) in [(parameter, 1.25e-3), (output, -2.5e-3)] {
                m.well(m.set_real(set, value));
                assert_eq!(m.reals(&[output, parameter]), [value; 2]);
            }
            m.well(call!(m.fmi2ExitInitializationMode()));
            assert_eq!(m.set_real(parameter, 0.0), Status::Error, "it is fixed");
            assert_eq!(m.real(parameter), -2.5e-3);
        }
    }
}

/// Switches on the warnings.
fn listen(m: &Master) {
    m.well(call!(m.fmi2SetDebugLogging(1, 1, &c"logStatusWarning".as_ptr())));
}

/// The texts of the warnings since the last call.
fn warnings(m: &Master) -> Vec<String> {
    let warnings = m.heard().into_iter().filter(|line| line.status == Status::Warning);
    warnings.map(|line| line.text).collect()
}

#[test]
fn derivatives_of_held_inputs_have_no_effect_and_are_warned_of_once() {
    let fmu = Fmu::plant();
    let [held, given] = [(); 2].map(|()| Master::started(&fmu, CoSimulation, &[(E, 1e-4), (OMEGA, 55.0)]));
    listen(&given);
    for n in 0..20 {
        for vr in [E, OMEGA] {
            for order in 1..=3 {
                // Zero is the derivative of a held input.
                let value = if n < 3 { 0.0 } else { f64::from(n) };
                given.well(call!(given.fmi2SetRealInputDerivatives(&vr, 1, &order, &value)));
            }
        }
        for m in [&held, &given] {
            m.well(m.step(f64::from(n) * 1e-3, 1e-3));
        }
        assert_eq!(held.bytes(), given.bytes());
        if n < 3 {
            assert!(given.heard().is_empty());
        }
    }
    let warnings = warnings(&given);
    assert_eq!(warnings.len(), 2, "one for each of the two inputs: {warnings:?}");
    assert!(warnings[0].contains("held") && warnings[1].contains("omega"));
}

#[test]
fn a_step_longer_than_the_sample_time_is_warned_of_once() {
    let m = Master::started(&Fmu::controller(), CoSimulation, &[(0, 0.001)]);
    listen(&m);
    steps(&m, 0, 10, 0.001);
    (0..10).for_each(|n| m.well(m.step(0.01 + f64::from(n) * 0.0004, 0.0004)));
    assert!(warnings(&m).is_empty(), "every sample had its input");
    (0..5).for_each(|n| m.well(m.step(0.014 + f64::from(n) * 5.0, 5.0)));
    let warnings = warnings(&m);
    let [warning] = &warnings[..] else {
        panic!("one warning expected: {warnings:?}");
    };
    assert!(
        ["5 s", "sample_time = 0.001 s"]
            .iter()
            .all(|part| warning.contains(part))
    );
}

/// Where a channel is held between communication points, its samples are of irregular age: with steps of 0.99 sample times
/// the lock was off by 9e-3 in sigma, and with any of these steps but two it was not reported at all.
#[test]
fn irregular_steps_lock_where_regular_ones_do() {
    // The default scene has locked after 304 natural periods.
    let lock = |from: f64, to: f64, seed: u64| {
        let mut random = fuzz::Rng::with_seed(seed);
        let mut pair = pair::Pair::new(&Fmu::pair(None));
        let sigma = pair.run(400.0, || (from + (to - from) * random.f64()) * pair::SAMPLE_TIME);
        assert!(pair.is_locked(), "steps of {from} to {to} sample times, seed {seed}");
        sigma
    };
    let regular = lock(1.0, 1.0, 0);
    // Shortest and longest step, in sample times.
    for (from, to) in [(0.99, 0.99), (0.7, 0.7), (0.2, 1.0), (0.5, 1.5), (1.1, 1.1), (1.7, 1.7)] {
        for seed in 1..=2 {
            let off = (lock(from, to, seed) - regular).abs();
            assert!(off < 1e-4, "{from} to {to} samples, seed {seed}: off by {off:.1e}");
        }
    }
}
