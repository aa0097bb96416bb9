//! Plants of structures against references of 45 digits, and against the plant of one oscillator.

mod reference;

use lovines::host::Equations;
use lovines::{Cavity, Drive, Excitation, Host, Mode, Parameters, Plant, State, Structure, StructureState};
use serde_json::Value;

use reference::{Reference, number, numbers, table};

impl Reference {
    fn plant(&self) -> (Plant<Structure>, Drive, Vec<Vec<f64>>) {
        let scene = &self.scene;
        let matrix = |name: &str| table(&scene[name]);
        let (mass, damping, stiffness) = (matrix("M"), matrix("C"), matrix("K"));
        let n = mass.len();
        let unit = |at: usize| -> Vec<f64> { (0..n).map(|i| f64::from(u8::from(i == at))).collect() };
        // A point is one degree of freedom, or a row over all.
        let row = |name: &str| match &scene[name] {
            Value::Array(_) => numbers(&scene[name]),
            at => unit(usize::try_from(at.as_u64().unwrap()).unwrap()),
        };
        let (excitation, drive, amplitude) = match scene.get("base") {
            Some(base) => (Excitation::Base, numbers(base), number(&scene["E"])),
            None => (Excitation::Force, row("drive"), number(&scene["F"])),
        };
        let equations = Equations::Matrices {
            mass,
            damping,
            stiffness,
            cavity: row("cavity"),
            drive,
            states: vec![],
        };
        let host = equations.host(excitation).unwrap();
        let parameters = Parameters {
            particle_mass: number(&scene["m"]),
            half_width: number(&scene["b"]),
            restitution: number(&scene["r"]),
            cavity: cavity_of(scene),
            ..Parameters::dimensionless(0.01, 1.0, 0.65)
        };
        let start = StructureState {
            displacements: numbers(&scene["q0"]),
            velocities: numbers(&scene["dq0"]),
            q2: number(&scene["q2"]),
            dq2: number(&scene["dq2"]),
        };
        let plant = Plant::with_host(host, parameters, &start).unwrap();
        (
            plant,
            Drive::harmonic(amplitude, number(&scene["omega"])),
            (0..n).map(unit).collect(),
        )
    }

    /// Errors of displacements and velocities after every row, relative to `b`, in steps of `1/parts` of the reference's; or, with `parts` of 0,
    /// in one step per row.
    fn errors(&self, parts: u32) -> Vec<f64> {
        let (mut plant, drive, units) = self.plant();
        let points: Vec<_> = units.iter().map(|unit| plant.host().row(unit).unwrap()).collect();
        let advance = |plant: &mut Plant<Structure>, length: f64| {
            plant.advance(drive, length).unwrap();
        };
        let error = |plant: &Plant<Structure>, row: &[f64]| {
            let got: Vec<_> = points.iter().map(|point| plant.point(point)).collect();
            let state = plant.state();
            let all = [0, 1].into_iter().flat_map(|k| got.iter().map(move |point| point[k]));
            let error = all
                .chain([state.q2, state.dq2])
                .zip(&row[1..])
                .map(|(got, expected)| (got - expected).abs());
            // Velocities in units of the first natural frequency.
            let unit = plant.host().sections()[0].oscillator.omega0;
            let displacements = points.len();
            let scale = |n: usize| match n {
                n if n < displacements || n == 2 * displacements => 1.0,
                _ => 1.0 / unit,
            };
            let error = error.enumerate().map(|(n, error)| error * scale(n));
            error.fold(0.0, f64::max) / plant.parameters().half_width
        };
        self.follow(parts, &mut plant, advance, error)
    }

    /// Change of the particle's displacement after every row per change of its velocity at the start.
    fn sensitivities(&self) -> Vec<f64> {
        const CHANGE: f64 = 1e-9;
        let run = |change: f64| -> Vec<f64> {
            let mut changed = Self {
                scene: self.scene.clone(),
                step: self.step,
                steps: Vec::new(),
                rows: Vec::new(),
            };
            changed.scene["dq2"] = Value::from(number(&self.scene["dq2"]) + change);
            let (mut plant, drive, _) = changed.plant();
            let mut after = || {
                plant.advance(drive, self.step).unwrap();
                plant.state().q2
            };
            self.rows.iter().map(|_| after()).collect()
        };
        run(0.0)
            .into_iter()
            .zip(run(CHANGE))
            .map(|(a, b)| (a - b).abs() / CHANGE)
            .collect()
    }
}

fn cavity_of(scene: &Value) -> Cavity {
    let value = |name: &str| scene.get(name).map_or(0.0, number);
    Cavity {
        kinetic_friction: value("mu_k"),
        static_friction: scene.get("mu_s").map(number),
        tilt: value("tilt"),
        ..Cavity::IDEAL
    }
}

/// The references pass through transients that amplify a change of the start a million to ten thousand million times. No double precision
/// follows them further than its rounding error times that.
#[test]
fn chaotic_transients_of_structures_are_followed_as_far_as_double_precision_can() {
    for name in ["beam-force", "three-base"] {
        let reference = Reference::read("structures.json", name);
        let sensitivities = reference.sensitivities();
        for steps in [1, 10, 1000] {
            let (mut early, mut relative, mut amplified) = (0f64, 0f64, 1f64);
            for (error, sensitivity) in reference.errors(steps).into_iter().zip(&sensitivities) {
                amplified = amplified.max(*sensitivity);
                if amplified < 1e3 {
                    early = early.max(error);
                }
                if amplified < 1e8 {
                    relative = relative.max(error / amplified);
                }
            }
            println!(
                "{name}, {steps} steps per row: {early:.1e} b up to a sensitivity of 1e3, error per sensitivity {relative:.1e}"
            );
            assert!(
                early < 2e-12 && relative < 2e-14,
                "{name}, {steps}: {early:e} {relative:e}"
            );
        }
    }
}

/// Own references: persistent contact, chatter and friction with two modes on a base, and with three under a force whose damping is not
/// proportional.
#[test]
fn contact_chatter_and_friction_of_structures_follow_references_of_40_digits() {
    for name in [
        "contact",
        "contact-force",
        "chatter",
        "chatter-force",
        "friction",
        "stick-slip",
    ] {
        let reference = Reference::read("structures.json", name);
        for parts in [0, 1, 10] {
            let error = reference.errors(parts).into_iter().fold(0.0, f64::max);
            println!("{name}, {parts} parts of a step: {error:.1e} b");
            assert!(error < 2e-12, "{name}, {parts}: {error:e}");
        }
    }
}

#[test]
fn one_mode_is_the_plant_of_one_oscillator() {
    const CHANGE: f64 = 1e-11;
    let ideal = Parameters {
        half_width: 0.01,
        ..Parameters::dimensionless(0.0084, 1.43, 0.65)
    };
    let cavities = [
        Cavity::IDEAL,
        Cavity {
            kinetic_friction: 0.02,
            static_friction: Some(0.03),
            tilt: 0.003,
            b_minus: Some(0.008),
            ..Cavity::IDEAL
        },
        Cavity { tilt: 5e-5, ..Cavity::IDEAL },
    ];
    let mode = Mode {
        omega: 1.0,
        zeta: 0.5 * ideal.damping,
        cavity: 1.0,
        drive: 1.0,
    };
    for (cavity, restitution) in cavities.into_iter().flat_map(|cavity| [0.65, 0.2].map(|r| (cavity, r))) {
        let parameters = Parameters { cavity, restitution, ..ideal };
        let start = State { q1: 0.004, dq1: 0.001, q2: 0.0, dq2: -0.006 };
        let mut one = Plant::new(parameters, start).unwrap();
        let mut beside = Plant::new(parameters, State { dq2: start.dq2 + CHANGE, ..start }).unwrap();
        let host = Host::from_modes(Excitation::Base, &[mode]).unwrap();
        let of_mode = StructureState {
            displacements: vec![start.q1],
            velocities: vec![start.dq1],
            q2: start.q2,
            dq2: start.dq2,
        };
        let mut other = Plant::with_host(host, parameters, &of_mode).unwrap();
        let (mut worst, mut stuck, mut amplified) = (0f64, 0, 1f64);
        for n in 0..4000 {
            // A new drive at every sample, with jumps, as a controller makes them.
            let k = f64::from(n % 17);
            let signal = [1e-5 * k, 1e-6 * (k - 8.0), 0.0, 0.0];
            let drive = Drive {
                signal,
                ..Drive::harmonic(2e-4 * (1.0 + 0.05 * k), 0.9 + 0.01 * k)
            };
            let of_one = one.advance(drive, 0.063).unwrap();
            let of_other = other.advance(drive, 0.063).unwrap();
            beside.advance(drive, 0.063).unwrap();
            stuck += of_one.stuck;
            assert_eq!(
                (of_one.impacts, of_one.stuck),
                (of_other.impacts, of_other.stuck),
                "{cavity:?} {restitution}, {n}"
            );
            let distance = |a: State, b: State| {
                let both = [a.q1 - b.q1, a.q2 - b.q2, a.dq1 - b.dq1, a.dq2 - b.dq2];
                both.into_iter().map(f64::abs).fold(0.0, f64::max)
            };
            amplified = amplified.max(distance(one.state(), beside.state()) / CHANGE);
            worst = worst.max(distance(one.state(), other.state()) / amplified);
        }
        let worst = worst / ideal.half_width;
        println!(
            "{} impacts, {stuck} stuck: {worst:.1e} b per sensitivity, which is {amplified:.0}",
            one.totals().impacts
        );
        assert!(worst < 1e-13, "{cavity:?}, {restitution}: {worst:e}");
    }
}
