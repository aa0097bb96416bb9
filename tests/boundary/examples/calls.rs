//! Makes one kind of call many times: `calls nothing|set|get|zero|sample COUNT`; prints the time of one.
//!
//! Under `valgrind --tool=callgrind` the difference between two counts tells the instructions of one call, on however busy a
//! machine.

use std::hint::black_box;
use std::time::Instant;

use fmi2_boundary::{Fmu, Master};

fn main() {
    let arguments: Vec<_> = std::env::args().skip(1).collect();
    let [what, count] = &arguments[..] else {
        eprintln!("usage: calls nothing|set|get|zero|sample COUNT");
        std::process::exit(2);
    };
    let count: u32 = count.parse().expect("COUNT is a whole number");
    let rig = Master::ready(&Fmu::plant());
    let (f, c) = (rig.f, rig.c);
    let step = 0.001;
    // omega and E; v, base, der(q2) and impact_time.
    let (inputs, drive) = ([8, 7], [54.9, 9.2e-5]);
    let (outputs, mut read) = ([13, 16, 12, 19], [0.0; 4]);
    let mut time = 0.0;
    // SAFETY: arrays are as long as they are said to be; so in each of these.
    let set = || unsafe { (f.fmi2SetReal)(c, inputs.as_ptr(), 2, black_box(&drive).as_ptr()) };
    let mut get = || unsafe { (f.fmi2GetReal)(c, outputs.as_ptr(), 4, black_box(&mut read).as_mut_ptr()) };
    let mut go = |step| {
        let status = unsafe { (f.fmi2DoStep)(c, time, step, 1) };
        time += step;
        status
    };
    let _ = (set(), go(step));
    let began = Instant::now();
    match what.as_str() {
        "nothing" => (0..count).for_each(|_| _ = black_box(unsafe { (f.fmi2GetVersion)() })),
        "set" => (0..count).for_each(|_| _ = set()),
        "get" => (0..count).for_each(|_| _ = get()),
        "zero" => (0..count).for_each(|_| _ = go(0.0)),
        _ => (0..count).for_each(|_| _ = (set(), go(step), get())),
    }
    let each = began.elapsed().as_secs_f64() * 1e9 / f64::from(count);
    println!("{what}: {each:.2} ns");
}
