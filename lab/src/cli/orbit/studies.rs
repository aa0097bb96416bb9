//! `vines orbit --convergence` and `--definitions`: theory minus exact orbit as epsilon shrinks.

use vines::orbit::{Convergence, convergence};
use vines::report::{Table, number};
use vines::scene::{Definition, Dimensionless};

use super::shown;
use crate::cli::failure::Failure;

/// The convergence of the theory towards the exact orbits.
pub(super) fn converged(scene: &Dimensionless, json: bool) -> Result<String, Failure> {
    let study = convergence(scene, HALVINGS).ok_or_else(|| {
        Failure::run(format!(
            "theory or exact orbits have no stable phase-resonant solution at G = {:.4} (dimensionless)",
            scene.g
        ))
    })?;
    shown(scene, "Theory minus exact orbit", &study, json, || {
        let rows = study
            .rows
            .iter()
            .map(|row| [row.epsilon, row.sigma, row.c, row.b].map(|one| format!("{one:.3e}")));
        let [sigma, c, b] = study.slopes;
        let table = Table::new("epsilon | sigma | C | B").rows(rows);
        format!(
            "{}\nExponent of epsilon: sigma {sigma:.3}, C {c:.3}, B {b:.3}\n",
            table.text()
        )
    })
}

/// Halvings of epsilon in the convergence study.
const HALVINGS: u32 = 7;
/// One definition with its differences.
#[derive(serde::Serialize)]
struct Defined {
    definition: Definition,
    #[serde(flatten)]
    study: Convergence,
}

/// Theory minus exact orbit for all definitions.
pub(super) fn defined(scene: &Dimensionless, json: bool) -> Result<String, Failure> {
    let study = |definition| {
        let study = convergence(&Dimensionless { definition, ..*scene }, DEFINITION_HALVINGS)?;
        Some(Defined { definition, study })
    };
    let all: Vec<Defined> = Definition::all().into_iter().filter_map(study).collect();
    shown(
        scene,
        "Theory minus exact orbit, by definition of resonance",
        &all,
        json,
        || {
            let row = |one: &Defined| -> Vec<String> {
                let rows = &one.study.rows;
                let mut cells = vec![one.definition.name()];
                cells.extend(rows[0].exact.map(number));
                cells.extend(rows.iter().map(|row| format!("{:.2e}", row.sigma)));
                cells.push(format!("{:.2}", one.study.slopes[0]));
                cells.extend(rows.iter().map(|row| format!("{:.2e}", row.c)));
                cells.push(format!("{:.2}", one.study.slopes[1]));
                cells
            };
            let table = Table::new(
                "resonance | sigma | C | sigma: eps | eps/2 | eps/4 | eps/8 | eps/16 | exponent | C: eps | eps/2 | eps/4 | eps/8 | eps/16 | exponent",
            );
            let missing = Definition::all().len() - all.len();
            let note = match missing {
                0 => String::new(),
                _ => format!("\n{missing} definitions have no stable solution at every epsilon\n"),
            };
            format!(
                "sigma and C of the exact orbit, then theory minus exact\n{}{note}",
                table.rows(all.iter().map(row)).text()
            )
        },
    )
}

/// Halvings of epsilon for each definition.
const DEFINITION_HALVINGS: u32 = 4;
