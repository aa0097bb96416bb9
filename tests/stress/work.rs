//! Work per natural period at extreme values, and what a step costs in which nothing happens.

use crate::table::Table;
use lovines::{Drive, Outcome, Parameters, Plant, State};
use rayon::prelude::*;
use std::f64::consts::TAU;
use std::hint::black_box;
use std::time::{Duration, Instant};

/// Evaluations of the motion in a step.
fn evaluations(outcome: &Outcome) -> Option<u64> {
    Some(outcome.evaluations)
}

/// Evaluations that are accepted per impact, drive cycle or natural period, whichever are the most in a natural period.
const MOST_EVALUATIONS: f64 = 100.0;

const DAMPING_RATIOS: [f64; 15] = [
    0.0, 1e-12, 1e-6, 1e-3, 1e-2, 0.1, 0.5, 1.0, 2.0, 10.0, 1e2, 1e3, 1e4, 1e5, 1e6,
];
/// Amplitudes of the base, half-widths; frequencies, omega0.
const AMPLITUDES: [f64; 6] = [0.0, 1e-3, 0.1, 1.0, 30.0, 1e3];
const FREQUENCIES: [f64; 9] = [1e-3, 0.03, 0.3, 1.0, 1.7, 10.0, 30.0, 300.0, 1e3];
/// Steps that each drive is followed for; fewer once so many impacts or so much time have passed. A step is a natural period, or
/// [`CYCLES`] of the drive where those are shorter: the work is then scaled to a natural period.
const STEPS: u32 = 20;
const CYCLES: f64 = 10.0;
/// Where only time is measured, no more drives are begun after so much of it for one damping ratio.
const ENOUGH_TIME_PER_RATIO: Duration = Duration::from_secs(20);
const ENOUGH_IMPACTS: u64 = 100_000;
const ENOUGH_TIME: Duration = Duration::from_millis(200);

/// The hardest natural period of a drive.
#[derive(Clone, Copy, Debug, Default)]
struct Hardest {
    amplitude: f64,
    ratio: f64,
    impacts: f64,
    ns: f64,
    evaluations: Option<f64>,
    /// Time and evaluations per impact, drive cycle or natural period, whichever are the most in that period.
    ns_per_unit: f64,
    per_unit: Option<f64>,
}

impl Hardest {
    /// By evaluations where they are counted, else by time; one measure serves all drives.
    fn weight(&self) -> f64 {
        self.evaluations.unwrap_or(self.ns)
    }

    fn or(self, other: Self) -> Self {
        let mut more = if other.weight() > self.weight() { other } else { self };
        more.ns_per_unit = self.ns_per_unit.max(other.ns_per_unit);
        more.per_unit = match (self.per_unit, other.per_unit) {
            (Some(a), Some(b)) => Some(a.max(b)),
            (a, b) => a.or(b),
        };
        more
    }
}

fn rig(zeta: f64) -> Parameters {
    Parameters {
        damping: 2.0 * zeta,
        ..Parameters::dimensionless(0.0084, 1.0, 0.65)
    }
}

fn hardest(zeta: f64, amplitude: f64, ratio: f64) -> Hardest {
    let start = State { q1: 0.1, q2: -0.2, dq2: 0.9, ..State::default() };
    let mut plant = Plant::new(rig(zeta), start).expect("valid values");
    let drive = Drive::harmonic(amplitude, ratio);
    plant.begin(drive).expect("valid values");
    let mut worst = Hardest::default();
    let (began, mut impacts) = (Instant::now(), 0);
    let steps_per_period = (ratio / CYCLES).max(1.0);
    for _ in 0..STEPS {
        let before = Instant::now();
        let outcome = plant.advance(drive, TAU / steps_per_period).expect("valid values");
        black_box(plant.state());
        let ns = before.elapsed().as_nanos() as f64 * steps_per_period;
        let in_a_period = outcome.impacts as f64 * steps_per_period;
        let units = in_a_period.max(ratio).max(1.0);
        let counted = evaluations(&outcome).map(|n| n as f64 * steps_per_period);
        worst = worst.or(Hardest {
            amplitude,
            ratio,
            impacts: in_a_period,
            ns,
            ns_per_unit: ns / units,
            evaluations: counted,
            per_unit: counted.map(|n| n / units),
        });
        impacts += outcome.impacts;
        if impacts > ENOUGH_IMPACTS || began.elapsed() > ENOUGH_TIME {
            break;
        }
    }
    worst
}

/// The hardest natural period for each damping ratio, over all drives; some of them in the short form.
pub fn sweep(long: bool, table: &mut Table) {
    let every = if long { 1 } else { 4 };
    let mut rows = Vec::new();
    for zeta in DAMPING_RATIOS {
        let drives: Vec<(f64, f64)> = (AMPLITUDES.iter())
            .flat_map(|&amplitude| FREQUENCIES.map(|ratio| (amplitude, ratio)))
            .step_by(every)
            .collect();
        // Where only time is measured, the drives go one by one: others on the same cores would be in the figures.
        let one = |&(amplitude, ratio): &(f64, f64)| hardest(zeta, amplitude, ratio);
        let (worst, followed) = if evaluations(&Outcome::default()).is_some() {
            let worst = (drives.par_iter().map(one)).reduce(Hardest::default, Hardest::or);
            (worst, drives.len())
        } else {
            let began = Instant::now();
            let found: Vec<Hardest> = (drives.iter())
                .take_while(|_| began.elapsed() < ENOUGH_TIME_PER_RATIO)
                .map(one)
                .collect();
            let followed = found.len();
            let worst = found.into_iter().fold(Hardest::default(), Hardest::or);
            (worst, followed)
        };
        rows.push((zeta, drives.len(), followed, worst));
        table.progress(&format!("work at damping ratio {zeta}"));
    }
    let shown = |x: Option<f64>| x.map_or_else(|| "not counted".to_owned(), |x| format!("{x:.1}"));
    let lines: Vec<String> = (rows.iter())
        .map(|(zeta, drives, followed, w)| {
            let counted = w
                .evaluations
                .map_or_else(|| "not counted".to_owned(), |n| format!("{n:.0}"));
            format!(
                "| {zeta:e} | {followed} of {drives} | E = {:e} b, omega = {:e} omega0 | {:.0} | {:.1} | {:.0} | {counted} | {} |",
                w.amplitude,
                w.ratio,
                w.impacts,
                1e-3 * w.ns,
                w.ns_per_unit,
                shown(w.per_unit),
            )
        })
        .collect();
    table.second(
        "Work in a natural period, at most, over all drives of a damping ratio. Per unit: per impact, drive cycle or \
         natural period, whichever are the most.",
        "| damping ratio | drives | hardest drive | impacts | µs | ns per unit | evaluations | evaluations per unit |",
        &lines,
    );
    for (zeta, drives, _, worst) in rows {
        if let Some(per_unit) = worst.per_unit {
            table.row(
                &format!("damping ratio {zeta:e}: evaluations per impact, drive cycle or natural period"),
                &format!("{drives} drives"),
                per_unit,
                MOST_EVALUATIONS,
            );
        }
    }
}

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
