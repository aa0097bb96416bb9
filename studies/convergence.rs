//! How does first-order theory approach the exact phase-resonant orbit of the default scene as epsilon shrinks, for each definition of
//! resonance?
//!
//! Theory minus exact orbit in sigma, C and B at epsilon and its halvings, with constant lambda, r and G. The exponents of epsilon are the
//! slopes of straight lines through the logarithms.
//!
//! Writes validation/convergence.csv.

mod common;

use common::*;
use vines_model::orbit::convergence;

/// Halvings of epsilon.
const HALVINGS: u32 = 7;

fn main() -> Result<(), Failure> {
    let scene = scene("", &[""; 0])?.dimensionless();
    let mut rows = Vec::new();
    for definition in Definition::all() {
        let name = definition.name();
        let study = convergence(&Dimensionless { definition, ..scene }, HALVINGS)
            .ok_or_else(|| format!("{name}: theory or exact orbit has no stable solution at some epsilon"))?;
        let [of_sigma, of_c, of_b] = study.slopes;
        rows.extend(study.rows.iter().map(|row| {
            let [sigma, c] = row.exact;
            format!(
                "{name},{:.3e},{sigma:.6},{c:.6},{:.3e},{:.3e},{:.3e},{of_sigma:.3},{of_c:.3},{of_b:.3}",
                row.epsilon, row.sigma, row.c, row.b
            )
        }));
    }
    let header = "resonance,epsilon,exact_sigma,exact_C,theory_less_exact_sigma,theory_less_exact_C,theory_less_exact_B,\
                  exponent_sigma,exponent_C,exponent_B";
    write("convergence", header, 2, &rows)
}
