//! First-order theory: the backbones of several r, activation, and how it approaches the exact orbits.

use crate::orbit::convergence;
use crate::report::figures::{approach, backbones};
use crate::report::files::{ReportError, csv};
use crate::report::section::{Section, Subject};
use crate::report::table::Table;
use crate::scene::Dimensionless;
use crate::theory::{B_SYMMETRY_BREAKING, SlowFlow, resonant};

/// Halvings of epsilon in the convergence study.
const HALVINGS: u32 = 6;

pub(super) fn make(subject: &Subject, _: &(dyn Fn(f64) + Sync)) -> Result<Section, ReportError> {
    let mut section = Section::new("First-order theory and its accuracy");
    let p = subject.scene.dimensionless();
    let flow = SlowFlow::new(p.lambda, p.r);
    let stable = resonant(&p).into_iter().find(|one| one.stable());
    section.words(format!(
        "In the theory, the motions lie on the slow invariant manifold C² = R²B² + (1 − πB/2)², R = (1 − r)/(1 + r). Its fold is at \
         C = {:.4}, B = {:.4}. Two symmetric impacts per period are stable from there to B = {B_SYMMETRY_BREAKING:.4}, for every r. \
         docs/theory.md has the derivation and notes two misprints of the published study.",
        flow.manifold.c_min(),
        flow.manifold.b_min()
    ));
    describe_activation(&mut section, &p, stable.map_or(0.0, |one| one.sigma));
    if let Some(point) = &stable {
        section.figure(
            "approach",
            "The modulation off the manifold by the theory, one dot per impact. Driven at phase resonance, motions that start off the \
             manifold reach it within a few impacts and move along it to the locked point (square). Without drive, the motion moves \
             down to the fold and loses its synchrony there. It lies a little below the manifold, as the measured decay does: the \
             drift along the manifold is not infinitely slow compared with the approach to it.",
            approach::figure(&p, point).svg()?,
        );
    }
    section.figure(
        "backbones",
        "Backbones of first-order theory. Their shape does not depend on λ, but their stability does. The smaller the loss at the \
         impacts, the lower the amplitude at the fold.",
        backbones::figure(&p).svg()?,
    );
    match convergence(&p, HALVINGS) {
        Some(study) => {
            let [s, c, b] = study.slopes;
            section.finding = format!(
                "The difference between first-order theory and exact orbit shrinks as ε to the power {s:.2} in σ, {c:.2} in C and {b:.2} in B."
            );
            let rows = study
                .rows
                .iter()
                .map(|row| [row.epsilon, row.sigma, row.c, row.b].map(|one| format!("{one:.3e}")));
            section.table(
                "Theory minus exact orbit at phase resonance; λ, r and G as in the scene.",
                Table::new("ε | in σ | in C | in B").rows(rows),
            );
            section.words(section.finding.clone());
            section.attach("convergence.csv", csv(&[], &study.rows)?);
        }
        None => {
            section.found("Theory and exact orbits have no common stable phase-resonant motion here.");
        }
    }
    Ok(section)
}

fn describe_activation(section: &mut Section, scene: &Dimensionless, sigma: f64) {
    let activation = SlowFlow::new(scene.lambda, scene.r).activation(scene.epsilon, sigma);
    let stable = activation.stable.map_or("exists at no G".into(), |g| {
        format!("needs less, G = {g:.4}, but only a particle that is already moving reaches it")
    });
    section.words(format!(
        "How much base motion is needed? At σ = {sigma:.4}, the steady linear response reaches the wall at G = {:.4}. When the drive is \
         switched on at rest, the first beat is larger than that: impacts start at G = {:.4}, or at G = {:.4} with the phase of the base \
         that needs the least. A stable 1:1 motion {stable}.",
        activation.steady_linear, activation.from_rest, activation.from_rest_any_phase
    ));
}
