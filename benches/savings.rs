//! What each skip saves, in instructions: the plant as it is, and the same work with the skip kept from happening. And what each effect
//! of a real cavity costs, per impact of the default lock.
//!
//! ```text
//! cargo bench --bench savings
//! ```
//!
//! Every case is run under valgrind for two lengths; the difference tells what one unit of work costs, without the start of
//! the program. Instruction counts are the same in every run, however busy the machine is. validation/savings.csv and
//! validation/cavity_costs.csv keep the tables.

use core::f64::consts::TAU;
use std::env::{args, current_exe};
use std::hint::black_box;
use std::process::{Command, ExitCode};

use lovines::{Cavity, Drive, Event, Parameters, Plant, Restitution, State};

const OMEGA: f64 = 0.990_417;
const PERIOD: f64 = TAU / OMEGA;
/// A hundred steps a period, as a sampled controller takes them.
const STEP: f64 = PERIOD / 100.0;

fn drive() -> Drive {
    Drive::harmonic(1e-3, OMEGA)
}

/// The plain solver: certified search for every contact.
fn plain(mut plant: Plant) -> Plant {
    plant.set_fast_path(false);
    plant
}

/// The default rig, dimensionless, with a particle so slow that it meets no wall.
fn quiet() -> Plant {
    let start = State { dq2: 1e-6, ..State::default() };
    Plant::new(Parameters::dimensionless(0.0084, 1.43, 0.65), start).expect("a scene")
}

/// The same rig in its steady 1:1 motion.
fn steady() -> Plant {
    steady_in(Cavity::IDEAL)
}

/// The same in another cavity.
fn steady_in(cavity: Cavity) -> Plant {
    let start = State {
        q1: -0.438_371_55,
        dq1: 0.007_696_65,
        q2: -1.003_854_15,
        dq2: -0.878_123_25,
    };
    let parameters = Parameters { cavity, ..Parameters::dimensionless(0.0084, 1.43, 0.65) };
    Plant::new(parameters, start).expect("a scene")
}

/// The lock in a cavity: one step with this number of impacts.
fn locked_in(cavity: Cavity, impacts: u32) {
    let duration = f64::from(impacts / 2) * PERIOD;
    steps(
        steady_in(cavity),
        1,
        |_| (Drive::harmonic(0.0084 * 1.1, OMEGA), duration),
        nothing,
    );
}

const fn walls(law: Restitution) -> Cavity {
    Cavity { restitution: [Some(law); 2], ..Cavity::IDEAL }
}

/// An effect, a cavity that has it, and how much an impact may cost, as a multiple of the ideal lock.
const EFFECTS: &[(&str, Cavity, f64)] = &[
    ("none", Cavity::IDEAL, 1.0),
    (
        "unequal gaps",
        Cavity { b_plus: Some(1.01), b_minus: Some(0.99), ..Cavity::IDEAL },
        1.2,
    ),
    ("tilt", Cavity { tilt: 3e-4, ..Cavity::IDEAL }, 1.2),
    ("friction", Cavity { kinetic_friction: 3e-4, ..Cavity::IDEAL }, 2.0),
    (
        "unequal walls",
        Cavity {
            restitution: [None, Some(Restitution::Constant(0.66))],
            ..Cavity::IDEAL
        },
        1.2,
    ),
    ("viscoelastic restitution", walls(Restitution::Viscoelastic(0.33)), 1.2),
    ("plastic restitution", walls(Restitution::Plastic(0.33)), 1.2),
    // No two flights are alike, so that none can be predicted from another: the cost is that of an irregular motion.
    (
        "scatter of the restitution, irregular flights",
        Cavity { scatter: 0.01, ..Cavity::IDEAL },
        2.2,
    ),
];

/// So many steps of a plant under what `drive` tells for each, each followed by `read`.
fn steps(mut plant: Plant, n: u32, step: impl Fn(u32) -> (Drive, f64), read: impl Fn(&Plant)) {
    for k in 0..n {
        let (drive, duration) = step(k);
        plant.advance(black_box(drive), duration).unwrap();
        read(&plant);
    }
    black_box(plant.state());
}

fn nothing(_: &Plant) {}

/// Steps of a particle on a wall that pushes all the time: stuck, or without loss in hops of 1/300 period.
fn pressed(hopping: bool, n: u32, step: f64) {
    let half_width = 1e3;
    let parameters = Parameters {
        half_width,
        ..Parameters::dimensionless(0.0084, 1.43, if hopping { 1.0 } else { 0.65 })
    };
    let (acceleration, q1) = (-1e-3, 1e-3);
    let start = State {
        // Where the spring holds the mass at this acceleration.
        q1,
        q2: q1 + half_width,
        dq2: if hopping {
            -0.5 * acceleration * PERIOD / 300.0
        } else {
            0.0
        },
        ..State::default()
    };
    let mut plant = Plant::new(parameters, start).expect("a scene");
    for k in 0..n {
        let t = f64::from(k) * step;
        let signal = [0.5 * acceleration * t * t, acceleration * t, 0.5 * acceleration, 0.0];
        plant
            .advance(black_box(Drive { signal, ..Drive::default() }), step)
            .unwrap();
    }
    assert_eq!(plant.contact().is_some(), !hopping);
    assert_eq!(plant.totals().impacts > 0, hopping);
}

/// A run of so many units of work.
type Run = fn(u32);

/// A unit of which few are enough.
const LONG: &str = "step of 100 periods";

/// A skip, the unit of work, and that work with it and without it.
const ROWS: &[(&str, &str, Run, Run)] = &[
    (
        "walls out of reach: no root search",
        "step of 1/100 period",
        |n| steps(quiet(), n, |_| (drive(), STEP), nothing),
        |n| steps(plain(quiet()), n, |_| (drive(), STEP), nothing),
    ),
    (
        "the same",
        LONG,
        |n| steps(quiet(), n, |_| (drive(), 100.0 * PERIOD), nothing),
        |n| steps(plain(quiet()), n, |_| (drive(), 100.0 * PERIOD), nothing),
    ),
    (
        "no excitation: no forced terms",
        "step of the plain solver",
        |n| steps(plain(quiet()), n, |_| (Drive::harmonic(0.0, OMEGA), STEP), nothing),
        |n| steps(plain(quiet()), n, |_| (drive(), STEP), nothing),
    ),
    (
        "the same, fast path",
        "step of 1/100 period, v and base read",
        |n| steps(quiet(), n, |_| (Drive::harmonic(0.0, OMEGA), STEP), sensors),
        |n| steps(quiet(), n, |_| (drive(), STEP), sensors),
    ),
    (
        "particle stuck: hops of 1/300 period not followed",
        "step of 1/100 period",
        |n| pressed(false, n, STEP),
        |n| pressed(true, n, STEP),
    ),
    (
        "drive unchanged: its coefficients reused",
        "step of 1/100 period",
        |n| steps(quiet(), n, |_| (drive(), STEP), nothing),
        |n| {
            steps(
                quiet(),
                n,
                |k| (Drive::harmonic(1e-3, OMEGA + 1e-9 * f64::from(k)), STEP),
                nothing,
            )
        },
    ),
    (
        "the same, amplitude alone changed",
        "step of 1/100 period",
        |n| steps(quiet(), n, |_| (drive(), STEP), nothing),
        |n| {
            steps(
                quiet(),
                n,
                |k| (Drive::harmonic(1e-3 + 1e-9 * f64::from(k), OMEGA), STEP),
                nothing,
            )
        },
    ),
    (
        "step length unchanged: its coefficients reused",
        "step of 1/100 period, v and base read",
        |n| steps(quiet(), n, |_| (drive(), STEP), sensors),
        |n| steps(quiet(), n, |k| (drive(), STEP + 1e-9 * f64::from(k)), sensors),
    ),
    (
        "outputs when asked for: none",
        "step of 1/100 period",
        |n| steps(quiet(), n, |_| (drive(), STEP), nothing),
        |n| steps(quiet(), n, |_| (drive(), STEP), all),
    ),
    (
        "outputs when asked for: v and base",
        "step of 1/100 period",
        |n| steps(quiet(), n, |_| (drive(), STEP), sensors),
        |n| steps(quiet(), n, |_| (drive(), STEP), all),
    ),
    (
        "impact records when wanted",
        "impact",
        |n| locked_in(Cavity::IDEAL, n),
        |n| {
            let mut impacts: Vec<Event> = Vec::new();
            let duration = f64::from(n / 2) * PERIOD;
            steady()
                .advance_with(black_box(Drive::harmonic(0.0084 * 1.1, OMEGA)), duration, |event| {
                    impacts.push(event)
                })
                .unwrap();
            black_box(impacts);
        },
    ),
];

fn sensors(plant: &Plant) {
    black_box((plant.centre(), plant.base_displacement()));
}

fn all(plant: &Plant) {
    sensors(plant);
    black_box((plant.state(), plant.relative_displacement(), plant.relative_velocity()));
    black_box(plant.energy(plant.base_displacement()));
}

/// Instructions of a run of this program with these arguments, as valgrind counts them.
fn counted(arguments: &[&str], n: u32) -> Result<u64, String> {
    let output = Command::new("valgrind")
        .args(["--tool=cachegrind", "--cache-sim=no", "--cachegrind-out-file=/dev/null"])
        .arg(current_exe().map_err(|e| e.to_string())?)
        .args(arguments)
        .arg(n.to_string())
        .output()
        .map_err(|e| format!("valgrind: {e}; install it"))?;
    let text = String::from_utf8_lossy(&output.stderr);
    let count = text.lines().find_map(|line| line.split_once("refs:"));
    count
        .and_then(|(_, count)| count.trim().replace(',', "").parse().ok())
        .ok_or_else(|| format!("valgrind said no count of instructions but: {text}"))
}

/// Instructions per unit of work; `few` units are enough to leave the start behind.
fn per_unit(arguments: &[&str], few: u32) -> Result<f64, String> {
    let many = 6 * few;
    let difference = counted(arguments, many)? - counted(arguments, few)?;
    Ok(difference as f64 / f64::from(many - few))
}

fn table() -> Result<(), String> {
    println!("| shortcut | unit of work | instructions | without it | saved |\n|---|---|---|---|---|");
    for (row, (skip, unit, ..)) in ROWS.iter().enumerate() {
        let few = if *unit == LONG { 20 } else { 2000 };
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
            return Err(format!(
                "{effect}: {ratio:.3} ideal locks per impact; accepted are {accepted}"
            ));
        }
    }
    Ok(())
}

fn main() -> ExitCode {
    let arguments: Vec<String> = args().collect();
    if let [_, what, row, n] = &arguments[..]
        && let (Ok(row), Ok(n)) = (row.parse::<usize>(), n.parse())
    {
        match what.as_str() {
            "with" => (ROWS[row].2)(n),
            "without" => (ROWS[row].3)(n),
            _ => locked_in(EFFECTS[row].1, n),
        }
        return ExitCode::SUCCESS;
    }
    // `cargo test --benches` only wants to see each run once.
    if !arguments.iter().any(|argument| argument == "--bench") {
        for (_, _, with, without) in ROWS {
            with(100);
            without(100);
        }
        for (_, cavity, _) in EFFECTS {
            locked_in(*cavity, 100);
        }
        return ExitCode::SUCCESS;
    }
    match table() {
        Ok(()) => ExitCode::SUCCESS,
        Err(why) => {
            eprintln!("{why}");
            ExitCode::FAILURE
        }
    }
}
