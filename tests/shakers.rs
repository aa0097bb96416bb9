//! Plants with an electrodynamic shaker against references of 40 digits.

mod reference;

use lovines::host::Equations;
use lovines::{
    Amplifier, Cavity, Drive, Excitation, Parameters, Plant, Row, Shaker, ShakerRows, Structure, StructureState,
};
use serde_json::Value;

use reference::{Reference, number, numbers, table};

fn pair(value: &Value) -> [f64; 2] {
    numbers(value).try_into().unwrap()
}

impl Reference {
    fn shaker(&self) -> Shaker {
        let given = &self.scene["shaker"];
        let value = |name: &str| number(&given[name]);
        Shaker {
            mass: value("mass"),
            suspension: pair(&given["suspension"]),
            stinger: pair(&given["stinger"]),
            end_mass: value("end_mass"),
            resistance: value("resistance"),
            inductance: value("inductance"),
            force_factor: value("force_factor"),
            amplifier: match given["amplifier"].as_str() {
                Some("current") => Amplifier::Current,
                _ => Amplifier::Voltage,
            },
            gain: value("gain"),
            cut_off: given.get("cut_off").map(number),
        }
    }

    /// The plant, the rows of all displacements of the reference, and what is measured of the shaker.
    fn plant(&self) -> (Plant<Structure>, Vec<Row>, ShakerRows) {
        let scene = &self.scene;
        let matrix = |name: &str| table(&scene[name]);
        let (damping, stiffness) = (matrix("C"), matrix("K"));
        let modes = damping.len();
        let unit = |n: usize, at: usize| -> Vec<f64> { (0..n).map(|i| f64::from(u8::from(i == at))).collect() };
        let equations = Equations::Matrices {
            mass: (0..modes).map(|i| unit(modes, i)).collect(),
            damping,
            stiffness,
            cavity: numbers(&scene["cavity"]),
            drive: numbers(&scene["drive"]),
            states: Vec::new(),
        };
        let by = match scene["base"].as_bool() {
            Some(true) => Excitation::Base,
            _ => Excitation::Force,
        };
        let shaker = self.shaker();
        let host = shaker.attach(&equations, by).unwrap().host(Excitation::Force).unwrap();
        let outputs = shaker.rows(&host, &equations, by).unwrap();
        let size = modes + usize::from(by == Excitation::Base);
        let mut rows: Vec<_> = (0..size).map(|n| host.row(&unit(size + 1, n)).unwrap()).collect();
        rows.push(outputs.armature.clone());
        let parameters = Parameters {
            particle_mass: number(&scene["m"]),
            half_width: number(&scene["b"]),
            restitution: number(&scene["r"]),
            cavity: Cavity { tilt: number(&scene["tilt"]), ..Cavity::IDEAL },
            ..Parameters::dimensionless(0.01, 1.0, 0.65)
        };
        let start = StructureState {
            q2: number(&scene["q2"]),
            dq2: number(&scene["dq2"]),
            ..StructureState::default()
        };
        (Plant::with_host(host, parameters, &start).unwrap(), rows, outputs)
    }

    /// Largest error of displacements, velocities over the first natural frequency of the structure, relative to `b`, and of the current, relative
    /// to its largest value, in one step per row, or in steps of `1/parts` of the reference's.
    fn error(&self, parts: u32) -> f64 {
        let (mut plant, rows, outputs) = self.plant();
        let drive = Drive::harmonic(number(&self.scene["E"]), number(&self.scene["omega"]));
        let limit = self.scene.get("limit").map_or(f64::INFINITY, number);
        let first = number(&self.scene["K"][0][0]).sqrt();
        let currents = self.rows.iter().map(|row| row[row.len() - 3].abs());
        let largest = currents.fold(0.0, f64::max);
        let advance = |plant: &mut Plant<Structure>, length: f64| {
            plant.advance_within(limit, drive, length).unwrap();
        };
        let error = |plant: &Plant<Structure>, expected: &[f64]| {
            let points: Vec<_> = rows.iter().map(|row| plant.point(row)).collect();
            let (n, state) = (points.len(), plant.state());
            let [.., current, _, _] = expected[..] else {
                unreachable!()
            };
            let mut errors: Vec<f64> = Vec::new();
            for (at, point) in points.iter().enumerate() {
                errors.push(point[0] - expected[1 + at]);
                errors.push((point[1] - expected[1 + n + at]) / first);
            }
            errors.push(state.q2 - expected[1 + 2 * n]);
            errors.push((state.dq2 - expected[2 + 2 * n]) / first);
            let got = plant.point(&outputs.current)[0] + outputs.current_per_command * plant.base_displacement();
            let mut of_current = (got - current).abs() / largest;
            let Shaker { amplifier, resistance, force_factor, .. } = self.shaker();
            if amplifier == Amplifier::Current {
                let voltage =
                    plant.point(&outputs.voltage)[0] + outputs.voltage_per_command * plant.base_displacement();
                let expected = resistance * current + force_factor * expected[2 * n];
                of_current = of_current.max((voltage - expected).abs() / (resistance * largest));
            }
            let error = errors.iter().fold(0f64, |worst, error| worst.max(error.abs()));
            of_current.max(error / plant.parameters().half_width)
        };
        let errors = self.follow(parts, &mut plant, advance, error);
        errors.into_iter().fold(0.0, f64::max)
    }
}

#[test]
fn plants_with_a_shaker_follow_references_of_40_digits() {
    for name in [
        "voltage",
        "inductance",
        "filtered",
        "current",
        "current-filtered",
        "clipped",
        "clipped-contact",
        "chatter",
        "table",
    ] {
        let reference = Reference::read("shakers.json", name);
        for parts in [0, 1, 10] {
            let error = reference.error(parts);
            println!("{name}, {parts} parts of a step: {error:.1e} b");
            assert!(error < 2e-12, "{name}, {parts}: {error:e}");
        }
    }
}
