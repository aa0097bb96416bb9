//! How does first-order theory approach the exact phase-resonant orbit of the default scene as epsilon shrinks, for each definition of
//! resonance?
//!
//! Theory minus exact orbit in sigma, C and B at epsilon and its halvings, with constant lambda, r and G. The exponents of epsilon are the
//! slopes of straight lines through the logarithms.
//!
//! Writes validation/convergence.csv.

mod common;

use common::*;
use vines_model::{numerics::slope, orbit::Orbit, theory::resonant};

/// Halvings of epsilon.
const HALVINGS: i32 = 7;

/// epsilon, sigma, C and B of the exact orbit, and theory less exact orbit in the same.
type Row = (f64, [f64; 3], [f64; 3]);

/// At the scene's epsilon and its halvings.
fn rows(scene: &Dimensionless) -> Option<Vec<Row>> {
    let row = |n: i32| {
        let scene = Dimensionless { epsilon: scene.epsilon / 2f64.powi(n), ..*scene };
        let theory = resonant(&scene).into_iter().find(|point| point.stable())?;
        let stable = phase_resonant(&scene).into_iter().filter(|orbit| orbit.stable);
        let distance = |orbit: &Orbit| (orbit.b - theory.b).abs();
        let exact = stable.min_by(|first, second| distance(first).total_cmp(&distance(second)))?;
        let [exact, theory] = [[exact.sigma, exact.c, exact.b], [theory.sigma, theory.c, theory.b]];
        Some((scene.epsilon, exact, [0, 1, 2].map(|i| theory[i] - exact[i])))
    };
    (0..=HALVINGS).map(row).collect()
}

fn main() -> Result<(), Failure> {
    let scene = scene("", &[""; 0])?.dimensionless();
    let mut lines = Vec::new();
    for definition in Definition::all() {
        let name = definition.name();
        let rows = rows(&Dimensionless { definition, ..scene })
            .ok_or_else(|| format!("{name}: theory or exact orbit has no stable solution at some epsilon"))?;
        // From row to row ln(epsilon) changes by -ln 2.
        let exponents = [0, 1, 2].map(|i| {
            let logs: Vec<f64> = rows.iter().map(|row| row.2[i].abs().ln()).collect();
            format!("{:.3}", -slope(&logs) / std::f64::consts::LN_2)
        });
        lines.extend(rows.iter().map(|(epsilon, [sigma, c, _], [of_sigma, of_c, of_b])| {
            format!(
                "{name},{epsilon:.3e},{sigma:.6},{c:.6},{of_sigma:.3e},{of_c:.3e},{of_b:.3e},{}",
                exponents.join(",")
            )
        }));
    }
    let header = "resonance,epsilon,exact_sigma,exact_C,theory_less_exact_sigma,theory_less_exact_C,theory_less_exact_B,\
                  exponent_sigma,exponent_C,exponent_B";
    write("convergence", header, 2, &lines)
}
