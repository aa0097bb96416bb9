//! Outputs are looked up after a step, not worked out at every reading: what is read is right whatever came between.

use std::ptr::null_mut;

use fmi2_boundary::{Fmu, Interface, Master};

/// Value references.
const K: u32 = 1;
const R: u32 = 5;
const SIGNAL: u32 = 6;
const E: u32 = 7;
const OMEGA: u32 = 8;
const BASE: u32 = 16;
/// All real outputs.
const OUTPUTS: [u32; 13] = [9, 10, 11, 12, 13, 14, 15, 16, 17, 19, 20, 22, 23];

fn outputs(m: &Master) -> [u64; 13] {
    let mut values = [f64::NAN; 13];
    // SAFETY: the arrays are as long as they are said to be.
    m.well(unsafe { (m.f.fmi2GetReal)(m.c, OUTPUTS.as_ptr(), 13, values.as_mut_ptr()) });
    values.map(f64::to_bits)
}

/// Brings another instance into the same state; it has no output worked out then.
fn copy<'a>(m: &Master, other: &'a Master) -> &'a Master {
    let (bytes, mut state) = (m.bytes(), null_mut());
    // SAFETY: the bytes are as long as they are said to be.
    unsafe {
        let size = bytes.len();
        other.well((m.f.fmi2DeSerializeFMUstate)(
            other.c,
            bytes.as_ptr().cast(),
            size,
            &mut state,
        ));
        other.well((m.f.fmi2SetFMUstate)(other.c, state));
        other.well((m.f.fmi2FreeFMUstate)(other.c, &mut state));
    }
    other
}

#[test]
fn what_is_read_does_not_depend_on_what_was_read_before() {
    let fmu = Fmu::plant();
    let other = Master::new(&fmu, Interface::CoSimulation);
    let m = Master::new(&fmu, Interface::CoSimulation);
    m.well(m.set_real(12, 2.0));
    m.start();
    let step = 1e-3;
    for n in 0..500 {
        let time = f64::from(n) * step;
        assert_eq!(outputs(&m), outputs(copy(&m, &other)), "before step {n}");
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
        assert_eq!(outputs(&m), outputs(copy(&m, &other)), "inputs set before step {n}");
        m.well(m.step(time, step));
    }
    assert!(m.impacts() > 5);
}

#[test]
fn the_base_follows_its_inputs_at_once() {
    let m = Master::ready(&Fmu::plant());
    m.well(m.set_real(OMEGA, 54.9));
    m.well(m.set_real(E, 1e-4));
    m.well(m.step(0.0, 0.01));
    let oscillator = m.real(BASE);
    assert!(oscillator != 0.0);
    m.well(m.set_real(SIGNAL, 2e-3));
    assert_eq!(m.real(BASE), 2e-3 + oscillator);
    m.well(m.set_real(SIGNAL, 0.0));
    assert_eq!(m.real(BASE), oscillator);
    m.well(m.set_real(E, 0.0));
    assert_eq!(m.real(BASE), 0.0);
}

#[test]
fn an_input_set_to_what_it_is_changes_nothing() {
    let m = Master::ready(&Fmu::plant());
    m.well(m.set_real(OMEGA, 54.9));
    m.well(m.set_real(E, 1e-4));
    m.well(m.step(0.0, 0.01));
    let before = m.bytes();
    m.well(m.set_real(OMEGA, 54.9));
    m.well(m.set_real(E, 1e-4));
    assert_eq!(m.bytes(), before);
}
