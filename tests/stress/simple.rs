//! What a step costs in which the particle sticks or the rig is overdamped.

use crate::table::Table;
use crate::work::rig;
use lovines::{Drive, Plant, State};
use std::hint::black_box;
use std::time::Instant;

/// A rig whose particle sticks, or which is overdamped: what it is, its damping ratio, the particle's start, the step, and the drive of
/// the n-th step.
struct Simple {
    what: &'static str,
    zeta: f64,
    particle: Particle,
    step: f64,
    drive: fn(u32) -> Drive,
}

#[derive(Clone, Copy, PartialEq)]
enum Particle {
    /// On a wall that presses.
    Stuck,
    /// So slow that it meets nothing.
    Slow,
    /// Crossing its cavity; impacts are met now and then.
    Crossing,
}

/// The base pushes the wall against the particle for ever: its acceleration never changes sign in these steps.
fn pressing(_: u32) -> Drive {
    Drive { signal: [0.0, 0.0, 5.0, 0.0], ..Drive::default() }
}

fn pressing_anew(n: u32) -> Drive {
    Drive {
        signal: [0.0, 0.0, 5.0 + 1e-6 * f64::from(n % 7), 0.0],
        ..Drive::default()
    }
}

fn slow(_: u32) -> Drive {
    Drive::harmonic(1e-3, 0.3)
}

fn fast(_: u32) -> Drive {
    Drive::harmonic(0.5, 1.3)
}

fn fast_anew(n: u32) -> Drive {
    Drive::harmonic(0.5, 1.3 + 1e-6 * f64::from(n % 7))
}

fn slow_anew(n: u32) -> Drive {
    Drive::harmonic(1e-3, 0.3 + 1e-6 * f64::from(n % 7))
}

const fn simple(what: &'static str, zeta: f64, particle: Particle, step: f64, drive: fn(u32) -> Drive) -> Simple {
    Simple { what, zeta, particle, step, drive }
}

#[rustfmt::skip]
const SIMPLE: &[Simple] = &[
    simple("particle stuck, drive held", 0.1, Particle::Stuck, 0.01, pressing),
    simple("particle stuck, drive held", 0.1, Particle::Stuck, 1.0, pressing),
    simple("particle stuck, drive changes", 0.1, Particle::Stuck, 0.01, pressing_anew),
    simple("particle stuck, overdamped, drive held", 10.0, Particle::Stuck, 0.01, pressing),
    simple("particle stuck, overdamped, drive changes", 10.0, Particle::Stuck, 0.01, pressing_anew),
    simple("particle stuck, overdamped, drive held", 1e3, Particle::Stuck, 0.01, pressing),
    simple("particle stuck, overdamped, drive held", 1e5, Particle::Stuck, 0.01, pressing),
    simple("overdamped, no impacts, drive held", 10.0, Particle::Slow, 0.06, slow),
    simple("overdamped, no impacts, drive changes", 10.0, Particle::Slow, 0.06, slow_anew),
    simple("overdamped, no impacts, drive changes", 1e6, Particle::Slow, 0.06, slow_anew),
    simple("overdamped, impacts, drive held", 2.0, Particle::Crossing, 0.06, fast),
    simple("overdamped, impacts, drive held", 10.0, Particle::Crossing, 0.06, fast),
    simple("overdamped, impacts, drive changes", 10.0, Particle::Crossing, 0.06, fast_anew),
    simple("overdamped, impacts, drive held", 1e3, Particle::Crossing, 0.06, fast),
    simple("overdamped, impacts, drive held", 1e5, Particle::Crossing, 0.06, fast),
    simple("overdamped, impacts, drive changes", 1e5, Particle::Crossing, 0.06, fast_anew),
    simple("overdamped, impacts, drive held", 1e6, Particle::Crossing, 0.06, fast),
];
/// Steps of a run, and runs of which the quickest counts for each step.
const SIMPLE_STEPS: u32 = 100;
const SIMPLE_RUNS: usize = 9;

impl Simple {
    fn start(&self) -> Plant {
        let (q2, dq2) = match self.particle {
            Particle::Stuck => (-1.0, 0.0),
            Particle::Slow => (0.0, 1e-6),
            Particle::Crossing => (0.0, 0.9),
        };
        let start = State { q2, dq2, ..State::default() };
        let mut plant = Plant::new(rig(self.zeta), start).expect("valid values");
        plant.begin((self.drive)(0)).expect("valid values");
        // The first step decides about the contact.
        plant.advance((self.drive)(0), self.step).expect("valid values");
        plant
    }

    /// ns of each step, and whether the particle did what it was meant to do.
    fn run(&self) -> (Vec<f64>, bool) {
        let mut plant = self.start();
        let (mut met, mut ns) = (0, Vec::new());
        for n in 1..=SIMPLE_STEPS {
            let mut drive = (self.drive)(n);
            if drive.signal[2] != 0.0 {
                // The same signal seen from now, but for the change.
                drive.signal[..2].copy_from_slice(&plant.base().drive.signal[..2]);
            }
            let began = Instant::now();
            let outcome = plant.advance(drive, self.step).expect("valid values");
            black_box(plant.state());
            ns.push(began.elapsed().as_nanos() as f64);
            met += outcome.impacts + outcome.released;
        }
        let as_meant = match self.particle {
            Particle::Stuck => met == 0 && plant.contact().is_some(),
            Particle::Slow => met == 0,
            Particle::Crossing => met > 0,
        };
        (ns, as_meant)
    }
}

/// Cost of a step in which the particle sticks or the rig is overdamped.
pub fn steps(table: &mut Table) {
    let (mut lines, mut strange) = (Vec::new(), 0u32);
    for simple in SIMPLE {
        let mut least = vec![f64::INFINITY; SIMPLE_STEPS as usize];
        for _ in 0..SIMPLE_RUNS {
            let (ns, as_meant) = simple.run();
            strange += u32::from(!as_meant);
            for (least, ns) in least.iter_mut().zip(ns) {
                *least = least.min(ns);
            }
        }
        least.sort_by(f64::total_cmp);
        let median = least[least.len() / 2];
        let worst = least[least.len() - 1];
        lines.push(format!(
            "| {} | {:e} | {} | {median:.0} | {worst:.0} | 2000 |",
            simple.what, simple.zeta, simple.step
        ));
    }
    table.row(
        "particles that stick or cross where they are not meant to",
        &format!("{} cases of {SIMPLE_STEPS} steps", SIMPLE.len()),
        f64::from(strange),
        0.0,
    );
    table.second(
        "Cost of a step in which the particle sticks or the rig is overdamped. Each step is repeated 9 times, and the quickest counts; \
         the accepted cost is for an idle machine and not checked here.",
        "| what | damping ratio | step, 1/omega0 | median, ns | worst step, ns | accepted, ns |",
        &lines,
    );
}
