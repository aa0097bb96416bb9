//! What each shortcut saves, in instructions: the plant as it is, and the same work without the shortcut. And what each effect
//! of a real cavity costs, per impact of the default lock; and what an impact on a structure with several modes costs.
//!
//! ```text
//! cargo bench -p vines-benchmarks --bench savings
//! LOVINES_WITHOUT=hop cargo bench -p vines-benchmarks --bench savings -- scenes    what scenes cost without a mechanism of the fast path
//! cargo bench -p vines-benchmarks --bench savings -- structures    an impact on a structure of 1 to 8 modes
//! ```
//!
//! Every case is run under valgrind for two lengths; the difference tells what one unit of work costs, without the start of
//! the program. Instruction counts are the same in every run, however busy the machine is. validation/savings.csv and
//! validation/cavity_costs.csv keep the tables.

use core::f64::consts::TAU;
use std::env::{args, current_exe};
use std::error::Error;
use std::hint::black_box;
use std::process::Command;

use lovines::{Cavity, Drive, Excitation, Host, Parameters, Plant, Restitution, State, StructureState};
use vines_benchmarks::structures::{CANTILEVER, PLATE};

const OMEGA: f64 = 0.990_417;
const PERIOD: f64 = TAU / OMEGA;
/// A hundred steps a period, as a sampled controller takes them.
const STEP: f64 = PERIOD / 100.0;

/// The default rig, dimensionless, and what is done with it.
#[derive(Clone, Copy)]
struct Work {
    start: State,
    cavity: Cavity,
    /// The plain solver: certified search for every contact.
    plain: bool,
    amplitude: f64,
    step: f64,
    /// What each step adds to frequency, amplitude and length of a step.
    change: [f64; 3],
    /// What is read after each step.
    read: fn(&Plant),
}

/// Steps of a particle so slow that it meets no wall.
const QUIET: Work = Work {
    start: State { q1: 0.0, dq1: 0.0, q2: 0.0, dq2: 1e-6 },
    cavity: Cavity::IDEAL,
    plain: false,
    amplitude: 1e-3,
    step: STEP,
    change: [0.0; 3],
    read: nothing,
};
const SENSORS: Work = Work { read: sensors, ..QUIET };
const PLAIN: Work = Work { plain: true, ..QUIET };
const LONG: Work = Work { step: 100.0 * PERIOD, ..QUIET };

impl Work {
    fn changed(self, change: [f64; 3]) -> Self {
        Self { change, ..self }
    }

    fn run(&self, steps: u32) {
        let parameters = Parameters {
            cavity: self.cavity,
            ..Parameters::dimensionless(0.0084, 1.43, 0.65)
        };
        let mut plant = Plant::new(parameters, self.start).expect("a valid scene");
        plant.set_fast_path(!self.plain);
        for n in 0..steps {
            let [omega, amplitude, step] = self.change.map(|change| change * f64::from(n));
            let drive = Drive::harmonic(self.amplitude + amplitude, OMEGA + omega);
            plant.advance(black_box(drive), self.step + step).expect("a valid step");
            (self.read)(&plant);
        }
        black_box(plant.state());
    }
}

/// A start on the steady 1:1 motion.
const LOCK: State = State {
    q1: -0.438_371_55,
    dq1: 0.007_696_65,
    q2: -1.003_854_15,
    dq2: -0.878_123_25,
};

/// The steady 1:1 motion in a cavity: one step with this number of impacts.
fn locked_in(cavity: Cavity, impacts: u32) {
    let step = f64::from(impacts / 2) * PERIOD;
    Work { start: LOCK, cavity, amplitude: 0.0084 * 1.1, step, ..QUIET }.run(1);
}

/// Both walls with this law.
const fn walls(law: Restitution) -> [Option<Restitution>; 2] {
    [Some(law); 2]
}

/// Declares the effects: a name, what differs from an ideal cavity, and how much an impact may cost, as a multiple of the ideal lock.
macro_rules! effects {
    ($($name:literal: { $($effect:tt)* } $accepted:literal;)*) => {
        const EFFECTS: &[(&str, Cavity, f64)] = &[$(($name, Cavity { $($effect)* ..Cavity::IDEAL }, $accepted)),*];
    };
}

effects! {
    "none": {} 1.0;
    "unequal gaps": { b_plus: Some(1.01), b_minus: Some(0.99), } 1.2;
    "tilt": { tilt: 3e-4, } 1.2;
    "friction": { kinetic_friction: 3e-4, } 2.0;
    "unequal walls": { restitution: [None, Some(Restitution::Constant(0.66))], } 1.2;
    "viscoelastic restitution": { restitution: walls(Restitution::Viscoelastic(0.33)), } 1.2;
    "plastic restitution": { restitution: walls(Restitution::Plastic(0.33)), } 1.2;
    // No two flights are alike, so that none can be predicted from another, as in an irregular motion.
    "scatter of the restitution, irregular flights": { scatter: 0.01, } 2.2;
}

/// Steps of a particle on a wall that pushes all the time: stuck, or without loss in hops of 1/300 period.
fn pressed(hopping: bool, n: u32) {
    // Powers of two: the start is exactly at the wall.
    let half_width = 1024.0;
    let restitution = if hopping { 1.0 } else { 0.65 };
    let parameters = Parameters {
        half_width,
        ..Parameters::dimensionless(0.0084, 1.43, restitution)
    };
    let (acceleration, q1) = (-1.0 / 1024.0, 1.0 / 1024.0);
    let dq2 = if hopping {
        -0.5 * acceleration * PERIOD / 300.0
    } else {
        0.0
    };
    // Where the spring holds the mass at this acceleration.
    let start = State { q1, q2: q1 + half_width, dq2, ..State::default() };
    let mut plant = Plant::new(parameters, start).expect("a valid scene");
    let mut drive = Drive {
        signal: [0.0, 0.0, 0.5 * acceleration, 0.0],
        ..Drive::default()
    };
    for _ in 0..n {
        plant.advance(black_box(drive), STEP).expect("a valid step");
        // The same signal seen from now: one computed anew would jump by its rounding.
        drive = plant.base().drive;
    }
    assert_eq!(plant.contact().is_some(), !hopping);
    assert_eq!(plant.totals().impacts > 0, hopping);
}

/// The work, that number of steps of it.
type Run = fn(u32);

/// Declares the shortcuts: a name, the unit of work, the work with the shortcut, and without it.
macro_rules! shortcuts {
    ($($name:literal, $unit:expr, |$n:ident| $with:expr => $without:expr;)*) => {
        const ROWS: &[(&str, &str, Run, Run)] = &[$(($name, $unit, |$n| $with, |$n| $without)),*];
    };
}

const SHORT_STEP: &str = "step of 1/100 period";
const READ_STEP: &str = "step of 1/100 period, v and base read";
/// A unit of which few are enough.
const LONG_STEP: &str = "step of 100 periods";

shortcuts! {
    "walls out of reach: no root search", SHORT_STEP, |n| QUIET.run(n) => PLAIN.run(n);
    "the same", LONG_STEP, |n| LONG.run(n) => Work { plain: true, ..LONG }.run(n);
    "no excitation: no forced terms", "step of the plain solver",
        |n| Work { amplitude: 0.0, ..PLAIN }.run(n) => PLAIN.run(n);
    "the same, fast path", READ_STEP, |n| Work { amplitude: 0.0, ..SENSORS }.run(n) => SENSORS.run(n);
    "particle stuck: hops of 1/300 period not followed", SHORT_STEP, |n| pressed(false, n) => pressed(true, n);
    "drive unchanged: its coefficients reused", SHORT_STEP, |n| QUIET.run(n) => QUIET.changed([1e-9, 0.0, 0.0]).run(n);
    "the same, amplitude alone changed", SHORT_STEP, |n| QUIET.run(n) => QUIET.changed([0.0, 1e-9, 0.0]).run(n);
    "step length unchanged: its coefficients reused", READ_STEP,
        |n| SENSORS.run(n) => SENSORS.changed([0.0, 0.0, 1e-9]).run(n);
    "outputs when asked for: none", SHORT_STEP, |n| QUIET.run(n) => Work { read: all, ..QUIET }.run(n);
    "outputs when asked for: v and base", SHORT_STEP, |n| SENSORS.run(n) => Work { read: all, ..QUIET }.run(n);
}

/// Lock under a loop: 100 samples a period, each with a new amplitude and frequency.
fn controlled(n: u32) {
    let changes = [1e-9, 1e-9, 0.0];
    Work { start: LOCK, amplitude: 0.0084 * 1.1, ..SENSORS }
        .changed(changes)
        .run(n);
}

/// Steps from one sample of a clock to the next, which differ by their rounding.
fn clocked(n: u32) {
    let mut plant = Plant::new(Parameters::dimensionless(0.0084, 1.43, 0.65), QUIET.start).expect("a valid scene");
    let at = |n: u32| f64::from(n) * 0.063;
    for n in 0..n {
        let drive = black_box(Drive::harmonic(QUIET.amplitude, OMEGA));
        plant.advance(drive, at(n + 1) - at(n)).expect("a valid step");
        sensors(&plant);
    }
}

/// A chatter into rest on a wall that the spring presses towards the particle, again and again.
fn chatter(n: u32) {
    let start = State { q1: -0.5, dq1: 0.0, q2: -1.5, dq2: 0.004 };
    let mut plant = Plant::new(Parameters::dimensionless(0.0084, 1.43, 0.9), start).expect("a valid scene");
    for _ in 0..n {
        plant.set_state(start).expect("a valid state");
        plant.advance(black_box(Drive::held(0.0)), 0.3).expect("a valid step");
    }
    assert!(plant.contact().is_some() && plant.totals().impacts > 100 * u64::from(n));
}

/// Scenes that the mechanisms of the fast path (`src/fast/`) are for: name, unit of work, the work, that number of units of it.
const SCENES: &[(&str, &str, Run)] = &[
    ("short step", READ_STEP, |n| SENSORS.run(n)),
    ("clock", READ_STEP, clocked),
    ("loop", READ_STEP, controlled),
    ("lock", "impact", |n| locked_in(Cavity::IDEAL, n)),
    ("chatter", "chatter of 133 impacts", chatter),
    ("irregular flights", "impact", |n| {
        locked_in(Cavity { scatter: 0.01, ..Cavity::IDEAL }, n)
    }),
    ("friction", "impact", |n| {
        locked_in(Cavity { kinetic_friction: 3e-4, ..Cavity::IDEAL }, n)
    }),
];

fn nothing(_: &Plant) {}

fn sensors(plant: &Plant) {
    black_box((plant.centre(), plant.base_displacement()));
}

fn all(plant: &Plant) {
    sensors(plant);
    black_box((plant.state(), plant.relative_displacement(), plant.relative_velocity()));
    black_box(plant.energy(plant.base_displacement()));
}

/// The default rig with further modes, driven near its 1:1 motion for `periods`; 0 modes: the plain solver of one oscillator. Returns the number of
/// impacts.
fn structure(frequencies: &[f64], modes: usize, periods: u32) -> u64 {
    let parameters = Parameters::dimensionless(0.0084, 1.43, 0.65);
    let drive = Drive::harmonic(0.0084 * 1.1, OMEGA);
    let step = f64::from(periods) * PERIOD;
    if modes == 0 {
        // Not a call of its own: it would change how the compiler inlines the other cases. The steady motion has two impacts a period.
        Work {
            start: LOCK,
            plain: true,
            amplitude: drive.amplitude,
            step,
            ..QUIET
        }
        .run(1);
        return 2 * u64::from(periods);
    }
    let modes = vines_benchmarks::structures::modes(&frequencies[..modes]);
    let host = Host::from_modes(Excitation::Base, &modes).expect("a valid structure");
    let mut start = StructureState { q2: LOCK.q2, dq2: LOCK.dq2, ..StructureState::default() };
    start.displacements = (0..modes.len()).map(|n| if n == 0 { LOCK.q1 } else { 0.0 }).collect();
    start.velocities = (0..modes.len()).map(|n| if n == 0 { LOCK.dq1 } else { 0.0 }).collect();
    let mut plant = Plant::with_host(host, parameters, &start).expect("a valid scene");
    plant.advance(black_box(drive), step).expect("a valid step");
    plant.totals().impacts
}

/// What an impact on a structure costs, against the plain solver of one oscillator.
fn structures() -> Result<(), Box<dyn Error>> {
    println!(
        "| structure | modes | instructions per impact | plain solver of one oscillator | allowed |\n|---|---|---|---|---|"
    );
    let mut plain = None;
    for (kind, frequencies) in [("plate", PLATE), ("cantilever", CANTILEVER)] {
        for modes in [0, 1, 2, 3, 5, 8] {
            let (few, many) = (20, 120);
            let count = |periods| counted(&[kind, &modes.to_string()], periods);
            let impacts = structure(&frequencies, modes, many) - structure(&frequencies, modes, few);
            let cost = (count(many)? - count(few)?) as f64 / impacts as f64;
            let ratio = cost / *plain.get_or_insert(cost);
            println!(
                "| {kind} | {modes} | {cost:.0} | {ratio:.2} | {:.1} |",
                2.0 + 0.7 * modes as f64
            );
        }
    }
    Ok(())
}

/// Instructions of a run of this program with these arguments, as valgrind counts them.
fn counted(arguments: &[&str], n: u32) -> Result<u64, Box<dyn Error>> {
    let output = Command::new("valgrind")
        .args(["--tool=cachegrind", "--cache-sim=no", "--cachegrind-out-file=/dev/null"])
        .arg(current_exe()?)
        .args(arguments)
        .arg(n.to_string())
        .output()
        .map_err(|e| format!("valgrind: {e}; install it"))?;
    let text = String::from_utf8_lossy(&output.stderr);
    let count = text.lines().find_map(|line| line.split_once("refs:"));
    let count = count.and_then(|(_, count)| count.trim().replace(',', "").parse().ok());
    count.ok_or_else(|| format!("valgrind said no count of instructions but: {text}").into())
}

/// Instructions per unit of work; `few` units are enough to leave the start behind.
fn per_unit(arguments: &[&str], few: u32) -> Result<f64, Box<dyn Error>> {
    let many = 6 * few;
    let difference = counted(arguments, many)? - counted(arguments, few)?;
    Ok(difference as f64 / f64::from(many - few))
}

fn table() -> Result<(), Box<dyn Error>> {
    println!("| shortcut | unit of work | instructions | without it | saved |\n|---|---|---|---|---|");
    for (row, (skip, unit, ..)) in ROWS.iter().enumerate() {
        let few = if *unit == LONG_STEP { 20 } else { 2000 };
        let cost = |how| per_unit(&[how, &row.to_string()], few);
        let (with, without) = (cost("with")?, cost("without")?);
        let saved = 100.0 * (1.0 - with / without);
        println!("| {skip} | {unit} | {with:.0} | {without:.0} | {saved:.0} % |");
    }
    println!("\n| effect of the cavity | instructions per impact | ideal locks | accepted |\n|---|---|---|---|");
    let mut ideal = None;
    for (row, (effect, _, accepted)) in EFFECTS.iter().enumerate() {
        let cost = per_unit(&["effect", &row.to_string()], 4000)?;
        let ratio = cost / *ideal.get_or_insert(cost);
        println!("| {effect} | {cost:.0} | {ratio:.2} | {accepted:.1} |");
        if ratio > *accepted {
            return Err(format!("{effect}: {ratio:.3} ideal locks per impact; accepted are {accepted}").into());
        }
    }
    Ok(())
}

/// What the scenes of the fast path cost in this build.
fn scenes() -> Result<(), Box<dyn Error>> {
    println!(
        "| scene | unit of work | instructions without {:?} |\n|---|---|---|",
        option_env!("LOVINES_WITHOUT")
    );
    for (row, (scene, unit, _)) in SCENES.iter().enumerate() {
        let few = if *scene == "chatter" { 40 } else { 4000 };
        let cost = per_unit(&["scene", &row.to_string()], few)?;
        println!("| {scene} | {unit} | {cost:.0} |");
    }
    Ok(())
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = args().collect();
    if let [_, what, row, n] = &arguments[..]
        && let (Ok(row), Ok(n)) = (row.parse::<usize>(), n.parse())
    {
        match what.as_str() {
            "with" => (ROWS[row].2)(n),
            "without" => (ROWS[row].3)(n),
            "scene" => (SCENES[row].2)(n),
            "plate" => drop(black_box(structure(&PLATE, row, n))),
            "cantilever" => drop(black_box(structure(&CANTILEVER, row, n))),
            _ => locked_in(EFFECTS[row].1, n),
        }
        return Ok(());
    }
    // `cargo test --benches` only wants to see each run once.
    if !arguments.iter().any(|argument| argument == "--bench") {
        ROWS.iter()
            .for_each(|(_, _, with, without)| [with, without].into_iter().for_each(|run| run(100)));
        EFFECTS.iter().for_each(|(_, cavity, _)| locked_in(*cavity, 100));
        SCENES.iter().for_each(|(_, _, run)| run(100));
        return Ok(());
    }
    if arguments.iter().any(|argument| argument == "scenes") {
        return scenes();
    }
    if arguments.iter().any(|argument| argument == "structures") {
        return structures();
    }
    table()
}
