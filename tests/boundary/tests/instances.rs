//! Many instances, changing threads, and FMU states.

use std::ptr::null_mut;
use std::thread;

use fmi2_boundary::{Fmu, Interface, Master};
use fmi2_component::Status;

fn lively(fmu: &Fmu) -> Master {
    let m = Master::new(fmu, Interface::CoSimulation);
    for (vr, value) in [(7, 1e-3), (8, 55.0), (12, 0.5)] {
        m.well(m.set_real(vr, value));
    }
    m.start();
    m
}

fn steps(m: &Master, from: u32, count: u32) {
    for n in from..from + count {
        m.well(m.step(f64::from(n) * 0.001, 0.001));
    }
}

#[test]
fn many_instances_do_not_know_of_each_other() {
    let fmu = Fmu::plant();
    let alone = lively(&fmu);
    steps(&alone, 0, 500);
    let all: Vec<_> = (0..300).map(|_| lively(&fmu)).collect();
    for n in 0..500 {
        for m in &all {
            steps(m, n, 1);
        }
    }
    let expected = alone.bytes();
    assert!(alone.real(19) > 0.0, "something has hit");
    assert!(all.iter().all(|m| m.bytes() == expected));
}

#[test]
fn an_instance_may_be_called_from_changing_threads() {
    let fmu = Fmu::plant();
    let expected = lively(&fmu);
    steps(&expected, 0, 400);
    let mut m = lively(&fmu);
    for n in 0..40 {
        m = thread::spawn(move || {
            steps(&m, 10 * n, 10);
            m
        })
        .join()
        .unwrap();
    }
    assert_eq!(m.bytes(), expected.bytes());
}

#[test]
fn instances_run_side_by_side_in_threads() {
    let fmu = Fmu::plant();
    let expected = lively(&fmu);
    steps(&expected, 0, 1000);
    let run = |_| {
        thread::spawn(move || {
            let m = lively(&fmu);
            steps(&m, 0, 1000);
            m.bytes()
        })
    };
    let threads: Vec<_> = (0..8).map(run).collect();
    for thread in threads {
        assert_eq!(thread.join().unwrap(), expected.bytes());
    }
}

#[test]
fn a_reset_instance_equals_a_fresh_one() {
    for fmu in [Fmu::plant(), Fmu::controller()] {
        let (used, fresh) = (Master::ready(&fmu), Master::new(&fmu, Interface::CoSimulation));
        steps(&used, 0, 100);
        // SAFETY: the instance is alive.
        used.well(unsafe { (used.f.fmi2Reset)(used.c) });
        assert_eq!(used.bytes(), fresh.bytes());
    }
}

#[test]
fn a_reset_instance_for_model_exchange_equals_a_fresh_one() {
    let new = || Master::new(&Fmu::plant(), Interface::ModelExchange);
    let (used, fresh) = (new(), new());
    used.well(used.set_real(12, 0.3));
    used.start();
    // SAFETY: the instance is alive; so below.
    unsafe {
        used.well((used.f.fmi2NewDiscreteStates)(used.c, &mut Default::default()));
        used.well((used.f.fmi2Reset)(used.c));
    }
    assert_eq!(used.bytes(), fresh.bytes());
}

#[test]
fn a_parameter_tuned_between_steps_holds_from_the_next_step_on() {
    let rig = |stiffness, restitution, state: [f64; 4]| {
        let m = Master::new(&Fmu::plant(), Interface::CoSimulation);
        for (vr, value) in [(1, stiffness), (5, restitution)] {
            m.well(m.set_real(vr, value));
        }
        for (vr, value) in (9..).zip(state) {
            m.well(m.set_real(vr, value));
        }
        m.start();
        m
    };
    let state = |m: &Master| [9, 10, 11, 12].map(|vr| m.real(vr));
    let tuned = rig(11_680.0, 0.65, [0.005, 0.1, 0.0, 0.3]);
    steps(&tuned, 0, 100);
    tuned.well(tuned.set_real(1, 9_000.0));
    tuned.well(tuned.set_real(5, 0.8));
    let fresh = rig(9_000.0, 0.8, state(&tuned));
    steps(&tuned, 100, 100);
    steps(&fresh, 0, 100);
    assert!(fresh.impacts() > 0);
    for (one, other) in state(&tuned).into_iter().zip(state(&fresh)) {
        assert!((one - other).abs() < 1e-12, "{one} is not {other}");
    }
}

#[test]
fn states_are_small() {
    for (fmu, most) in [(Fmu::plant(), 1200), (Fmu::controller(), 6000)] {
        let m = Master::ready(&fmu);
        let size = m.bytes().len();
        println!("{}: a state takes {size} bytes written out", fmu.name);
        assert!(size <= most, "{}: {size} bytes", fmu.name);
    }
}

#[test]
fn a_foreign_or_damaged_state_is_refused() {
    let plant = lively(&Fmu::plant());
    let own = plant.bytes();
    let exchange = Master::new(&Fmu::plant(), Interface::ModelExchange).bytes();
    let controller = Master::ready(&Fmu::controller()).bytes();
    let mut damaged = own.clone();
    damaged[100] ^= 1;
    let longer = [&own[..], &[0]].concat();
    for bytes in [
        exchange,
        controller,
        damaged,
        longer,
        own[..own.len() - 1].to_vec(),
        vec![],
    ] {
        let mut state = null_mut();
        let f = plant.f.fmi2DeSerializeFMUstate;
        // SAFETY: as many bytes as said.
        let status = unsafe { f(plant.c, bytes.as_ptr().cast(), bytes.len(), &mut state) };
        assert_eq!(status, Status::Error);
        assert!(state.is_null());
        assert!(plant.heard()[0].text.contains("serialised state") || bytes.is_empty());
    }
}
