//! The references of this folder, as JSON has them.
#![allow(dead_code)] // each test uses a part of it

use lovines::{Plant, Structure, Wall};
use serde_json::Value;

/// A number, or the decimal digits of one.
pub fn number(value: &Value) -> f64 {
    match value.as_str() {
        Some(digits) => digits.parse().expect("a number"),
        None => value.as_f64().expect("a number"),
    }
}

pub fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().expect("a list").iter().map(number).collect()
}

pub fn table(value: &Value) -> Vec<Vec<f64>> {
    value.as_array().expect("a list of lists").iter().map(numbers).collect()
}

/// The content of a file of this folder.
pub fn read(file: &str) -> Value {
    let path = format!("{}/tests/reference/{file}", env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(path).expect("reference data");
    serde_json::from_str(&text).expect("JSON")
}

/// A scene, and the instants at which its motion is known.
pub struct Reference {
    pub scene: Value,
    pub step: f64,
    /// Number of steps until each row.
    pub steps: Vec<f64>,
    /// t, the state as the file says, impacts so far, wall stuck to.
    pub rows: Vec<Vec<f64>>,
}

impl Reference {
    /// The scene of that name in a file of scenes.
    pub fn read(file: &str, name: &str) -> Self {
        let mut all = read(file);
        let found = &mut all[name];
        let rows = table(&found["rows"]);
        let every = || (1..=rows.len()).map(|n| n as f64).collect();
        Self {
            step: number(&found["step"]),
            steps: found.get("steps").map_or_else(every, numbers),
            scene: found["scene"].take(),
            rows,
        }
    }

    /// The error that `error` finds at every row, in steps of `1/parts` of the reference's, or, with `parts` of 0, in one step per row.
    /// Impacts and contact are the reference's; how many impacts a chatter has depends on where it is cut.
    pub fn follow(
        &self,
        parts: u32,
        plant: &mut Plant<Structure>,
        advance: impl Fn(&mut Plant<Structure>, f64),
        error: impl Fn(&Plant<Structure>, &[f64]) -> f64,
    ) -> Vec<f64> {
        let mut taken = 0.0;
        let mut after = |(until, row): (&f64, &Vec<f64>)| {
            let (count, length) = match parts {
                0 => (1, (until - taken) * self.step),
                _ => ((until - taken) as u32 * parts, self.step / f64::from(parts)),
            };
            taken = *until;
            for _ in 0..count {
                advance(plant, length);
            }
            let [.., impacts, wall] = row[..] else { unreachable!() };
            if self.scene.get("chatter").is_none() {
                assert_eq!(plant.totals().impacts, impacts as u64, "t = {}", row[0]);
            }
            assert_eq!(plant.contact().map_or(0.0, Wall::sign), wall, "t = {}", row[0]);
            error(plant, row)
        };
        self.steps.iter().zip(&self.rows).map(&mut after).collect()
    }
}
