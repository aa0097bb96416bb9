//! First-order theory: the backbones of several r, activation, and how it approaches the exact orbits.

use super::{SectionError, Subject};
use crate::orbit::convergence;
use crate::report::figures::{approach, backbones};
use crate::report::files::csv;
use crate::report::section::Section;
use crate::report::table::Table;
use crate::theory::{B_SYMMETRY_BREAKING, SlowFlow};

/// Halvings of epsilon in the convergence study.
const HALVINGS: u32 = 6;

pub(super) fn make(subject: &Subject, _: &(dyn Fn(f64) + Sync)) -> Result<Section, SectionError> {
    let mut section = Section::new("Theory, and how far it is to be trusted");
    let p = subject.scene.dimensionless();
    let flow = SlowFlow::new(p.lambda, p.r);
    let stable = flow
        .phase_resonant(p.g)
        .into_iter()
        .find(|one| one.stable());
    section.words(format!(
        "The motions compared with lie on the slow invariant manifold C² = R²B² + (1 − πB/2)², R = (1 − r)/(1 + r). Its fold is at \
         C = {:.4}, B = {:.4}; two symmetric impacts per period are stable from there to B = {B_SYMMETRY_BREAKING:.4}, whatever r. \
         docs/theory.md derives all this, and notes two misprints of the published study.",
        flow.manifold.c_min(),
        flow.manifold.b_min()
    ));
    let sigma = stable.map_or(0.0, |one| one.sigma);
    let activation = flow.activation(sigma);
    let reached = activation
        .stable
        .map_or("there is none at any G".into(), |g| {
            format!("there is one from G = {g:.4} on")
        });
    section.words(format!(
        "How strong must the base move? At σ = {sigma:.4} impacts begin by themselves from G = {:.4} on, where the linear response \
         reaches the wall. A stable 1:1 motion needs less: {reached}, for a particle that is already moving.",
        activation.from_rest
    ));
    if let Some(point) = &stable {
        section.figure(
            "approach",
            "The modulation of theory off the manifold, one dot an impact. Driven at phase resonance, motions that start off the \
             manifold fall onto it within a few impacts and move along it to the locked point (square); without drive the motion moves \
             down to the fold, and loses its synchrony there. It runs a little below the manifold, as the measured decay does: its way \
             is not infinitely slow against the approach.",
            approach::figure(&p, point).svg()?,
        );
    }
    section.figure(
        "backbones",
        "Backbones of first-order theory. They do not depend on λ; which part of them is stable does. The less is lost at the \
         impacts, the deeper the fold.",
        backbones::figure(&p).svg()?,
    );
    match convergence(&p, HALVINGS) {
        Some(study) => {
            let [s, c, b] = study.slopes;
            section.finding = format!(
                "First-order theory approaches the exact orbit as ε to the power {s:.2} in σ, {c:.2} in C and {b:.2} in B."
            );
            let rows = study
                .rows
                .iter()
                .map(|row| [row.epsilon, row.sigma, row.c, row.b].map(|one| format!("{one:.3e}")));
            section.table(
                "Theory less exact orbit at phase resonance, with λ, r and G as they are.",
                Table::new(["ε", "in σ", "in C", "in B"]).rows(rows),
            );
            section.words(section.finding.clone());
            section.attach("convergence.csv", csv(&study.rows)?);
        }
        None => {
            section.found(
                "Theory and exact orbits have no stable phase-resonant motion in common here.",
            );
        }
    }
    Ok(section)
}
