//! The rows of `tests/reference/orbits.csv`: exact orbits, and the first-order theory beside them.
#![allow(dead_code, reason = "each test file uses its own part")]

use vines_model::Dimensionless;

const ORBITS: &str = include_str!("../../../../tests/reference/orbits.csv");

#[derive(Debug, Clone, Copy)]
pub struct Row {
    pub epsilon: f64,
    pub lambda: f64,
    pub r: f64,
    pub g: f64,
    pub sigma: f64,
    pub c: f64,
    pub b: f64,
    pub multipliers: [f64; 4],
    /// sigma, C and B.
    pub theory: [f64; 3],
}

impl Row {
    pub fn scene(&self) -> Dimensionless {
        Dimensionless::new(self.epsilon, self.lambda, self.r, self.g)
    }
}

pub fn rows() -> Vec<Row> {
    ORBITS.lines().skip(1).map(row).collect()
}

fn row(line: &str) -> Row {
    let cells: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap()).collect();
    let [epsilon, lambda, r, g, sigma, c, b, m1, m2, m3, m4, theory @ ..] = &cells[..] else {
        panic!("fourteen columns expected: {line}")
    };
    let [epsilon, lambda, r, g, sigma, c, b] = [epsilon, lambda, r, g, sigma, c, b].map(|one| *one);
    let (multipliers, theory) = ([*m1, *m2, *m3, *m4], theory.try_into().unwrap());
    Row { epsilon, lambda, r, g, sigma, c, b, multipliers, theory }
}
