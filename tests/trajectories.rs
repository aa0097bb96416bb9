//! Guards the plant's motion against trajectories in 40-digit arithmetic by independent programs (tests/reference): the ideal cavity, and the real
//! one with its limits and scatter.

use lovines::{Cavity, Drive, Event, Parameters, Plant, Restitution, State, Wall};
use std::collections::HashMap;

mod reference;
use reference::{number, numbers, table};

const FOLDER: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/reference");

/// A scene, and the rows of its reference: number of steps, q1, dq1, q2, dq2, wall, impacts; in the real cavity also sticks, energy lost to
/// friction, and time stuck.
struct Scene {
    parameters: Parameters,
    start: State,
    drive: Drive,
    step: f64,
    rows: Vec<Vec<f64>>,
}

/// A scene of tests/reference/trajectories, dimensionless, in the ideal cavity.
fn ideal(name: &str) -> Scene {
    let reference = reference::read(&format!("trajectories/{name}.json"));
    let [epsilon, lambda, r, g, omega, step] =
        ["eps", "lam", "r", "G", "Om", "step"].map(|key| number(&reference[key]));
    let start: [f64; 4] = numbers(&reference["x0"]).try_into().expect("a state");
    let rows = table(&reference["rows"]).into_iter().zip(1..);
    let rows = rows.map(|(row, n)| vec![f64::from(n), row[1], row[2], row[3], row[4], row[6], row[5]]);
    Scene {
        parameters: Parameters::dimensionless(epsilon, lambda, r),
        start: start.into(),
        drive: Drive::harmonic(epsilon * g, omega),
        step,
        rows: rows.collect(),
    }
}

/// The scenes of tests/reference/cavity.csv.
fn real() -> Vec<(String, Scene)> {
    let text = std::fs::read_to_string(format!("{FOLDER}/cavity.csv")).expect("reference data");
    let scenes = text.split("# scene = ").skip(1);
    scenes.map(real_scene).collect()
}

fn real_scene(text: &str) -> (String, Scene) {
    let (name, text) = text.split_once('\n').expect("a name");
    let (header, rows): (Vec<&str>, Vec<&str>) = text.lines().partition(|line| line.starts_with('#'));
    let given = header
        .iter()
        .map(|line| line[2..].split_once(" = ").expect("a key and a value"));
    let given: HashMap<&str, &str> = given.collect();
    let at = |key: &str| given[key].parse::<f64>().expect("a number");
    let law = |key: &str| match given["law"] {
        "constant" => Restitution::Constant(at(key)),
        "viscoelastic" => Restitution::Viscoelastic(at(key)),
        "plastic" => Restitution::Plastic(at(key)),
        other => panic!("{other}"),
    };
    let cavity = Cavity {
        b_plus: Some(at("b_plus")),
        b_minus: Some(at("b_minus")),
        tilt: at("theta"),
        kinetic_friction: at("mu_k"),
        static_friction: given.get("mu_s").map(|text| text.parse().expect("a number")),
        restitution: [Some(law("r_plus")), Some(law("r_minus"))],
        least_restitution: at("r_min"),
        scatter: at("scatter"),
        seed: given["seed"].parse().expect("a whole number"),
    };
    let parameters = Parameters {
        primary_mass: at("M"),
        stiffness: at("k"),
        damping: at("c"),
        particle_mass: at("m"),
        half_width: 0.5 * (at("b_plus") + at("b_minus")),
        restitution: 0.65,
        cavity,
    };
    let numbers = |line: &&str| line.split(',').map(|text| text.parse().expect("a number")).collect();
    let scene = Scene {
        parameters,
        start: State { q1: at("q1"), dq1: at("dq1"), q2: at("q2"), dq2: at("dq2") },
        drive: Drive::harmonic(at("E"), at("omega")),
        step: at("step"),
        rows: rows[1..].iter().map(numbers).collect(),
    };
    (name.into(), scene)
}

/// Largest error of any displacement (in half-widths) and velocity (in half-widths times the natural frequency) in any row.
fn worst_error(name: &str, scene: Scene) -> f64 {
    let Scene { parameters, start, drive, step, rows } = scene;
    let mut plant = Plant::new(parameters, start).expect("a valid scene");
    let (b, fast) = (parameters.half_width, parameters.natural_frequency());
    let (mut worst, mut done) = (0.0f64, 0);
    for row in &rows {
        while done < row[0] as u32 {
            plant.advance(drive, step).expect("a valid step");
            done += 1;
        }
        let State { q1, dq1, q2, dq2 } = plant.state();
        let errors = [q1 - row[1], (dq1 - row[2]) / fast, q2 - row[3], (dq2 - row[4]) / fast];
        worst = errors.iter().fold(worst, |worst, error| worst.max(error.abs() / b));
        let (totals, place) = (plant.totals(), format!("{name}, step {done}"));
        assert_eq!(plant.contact().map_or(0.0, Wall::sign), row[5], "{place}: contact");
        // Hops before the end of a chatter are not counted alike.
        if !name.starts_with("chatter") && name != "lower_wall" {
            assert_eq!(totals.impacts, row[6] as u64, "{place}: impacts");
        }
        if let [sticks, friction, stuck_time] = row[7..] {
            let energy = parameters.particle_mass * (b * fast) * (b * fast);
            assert_eq!(totals.sticks, sticks as u64, "{place}: sticks");
            assert!((totals.friction - friction).abs() < 1e-11 * energy, "{place}: friction");
            assert!(
                (totals.stuck_time - stuck_time).abs() * fast < 1e-8,
                "{place}: time stuck"
            );
        }
    }
    println!("{name}: worst error of any state in any row {worst:.2e}");
    worst
}

#[test]
fn a_lock_a_chatter_into_sticking_and_secular_growth_at_a_resonance_are_followed_to_1e_11() {
    for name in ["lock", "resonance", "chatter"] {
        assert!(worst_error(name, ideal(name)) < 1e-11, "{name}");
    }
}

#[test]
fn friction_tilt_unequal_gaps_and_every_law_of_restitution_are_followed_to_2e_12() {
    let scenes = real().into_iter();
    let worst: Vec<_> = scenes.map(|(name, scene)| (worst_error(&name, scene), name)).collect();
    assert_eq!(worst.len(), 13);
    assert!(worst.iter().all(|(error, _)| *error < 2e-12), "{worst:?}");
}

/// The default rig near its 1:1 motion, with a cavity.
fn lock(cavity: Cavity) -> (Plant, Drive) {
    let parameters = Parameters { cavity, ..Parameters::dimensionless(0.0084, 1.43, 0.65) };
    let start = State { q1: -0.4384, dq1: 0.0077, q2: -1.0039, dq2: -0.8781 };
    let plant = Plant::new(parameters, start).expect("a valid scene");
    (plant, Drive::harmonic(0.0084 * 1.1, 0.990_417))
}

/// The largest distance of the lock with a cavity from the ideal lock within 20 periods.
fn distance(cavity: Cavity) -> f64 {
    let ((mut ideal, drive), (mut real, _)) = (lock(Cavity::IDEAL), lock(cavity));
    let mut largest = 0.0f64;
    for _ in 0..1270 {
        ideal.advance(drive, 0.1).expect("a valid step");
        real.advance(drive, 0.1).expect("a valid step");
        let (a, b) = (ideal.state(), real.state());
        largest = largest.max((a.q1 - b.q1).abs()).max((a.q2 - b.q2).abs());
    }
    assert!(ideal.totals().impacts > 30);
    largest
}

#[test]
fn a_small_effect_changes_the_motion_in_proportion() {
    let effect = |size: f64| {
        [
            Cavity { kinetic_friction: size, ..Cavity::IDEAL },
            Cavity { tilt: size, ..Cavity::IDEAL },
            Cavity { b_plus: Some(1.0 + size), ..Cavity::IDEAL },
            Cavity {
                restitution: [Some(Restitution::Constant(0.65 + size)), None],
                ..Cavity::IDEAL
            },
            Cavity { scatter: size, ..Cavity::IDEAL },
        ]
    };
    for (small, smaller) in effect(1e-7).into_iter().zip(effect(1e-9)) {
        let ratio = distance(small) / distance(smaller);
        assert!((ratio - 100.0).abs() < 0.5, "{small:?}: {ratio}");
    }
    for nothing in effect(0.0) {
        assert_eq!(distance(nothing), 0.0, "{nothing:?}");
    }
    // The general path against the fast one.
    for least in effect(1e-300) {
        assert!(distance(least) < 1e-12, "{least:?}");
    }
}

#[test]
fn the_scatter_does_not_depend_on_the_steps_or_on_a_rollback() {
    let cavity = Cavity { scatter: 0.1, seed: 3, ..Cavity::IDEAL };
    let follow = |step: f64, n: u32, rollback: bool| {
        let (mut plant, drive) = lock(cavity);
        let mut velocities = Vec::new();
        for _ in 0..n {
            if rollback {
                let saved = plant.save();
                plant.advance(drive, 3.7 * step).expect("a valid step");
                plant.restore(&saved);
            }
            let on_event = |event| {
                if let Event::Impact { velocity, .. } = event {
                    velocities.push(velocity);
                }
            };
            plant.advance_with(drive, step, on_event).expect("a valid step");
        }
        velocities
    };
    let (long, short) = (follow(400.0, 1, false), follow(0.1, 4000, false));
    assert_eq!(short, follow(0.1, 4000, true));
    assert!(long.len() > 100 && long.len() == short.len());
    assert!(long.iter().zip(&short).all(|(a, b)| (a - b).abs() < 1e-11));
}
