//! Summaries for a terminal.

use super::table::{Table, number};
use crate::comparison::{COMPARED_ABOVE, Comparison, TrackedComparison, TrackedPoint};
use crate::scene::{Definition, Dimensionless};

/// The numbers that a result belongs to, in one line.
#[must_use]
pub fn parameters(p: &Dimensionless) -> String {
    let definition = match p.definition == Definition::default() {
        true => String::new(),
        false => format!("; resonance: {}", p.definition.name()),
    };
    format!("{}, G = {:.4}{definition}", rig(p), p.g)
}

fn rig(p: &Dimensionless) -> String {
    let Dimensionless { epsilon, lambda, r, .. } = p;
    format!("epsilon = {epsilon:.6}, lambda = {lambda:.4}, r = {r}")
}

/// An identification: the locked point beside theory and exact orbit, then the decay.
#[must_use]
pub fn identification(found: &Comparison) -> String {
    let lock = &found.lock;
    let row = |name: &str, sigma: f64, c: f64, b: Option<f64>| {
        [name.to_string(), number(sigma), number(c), b.map_or("-".into(), number)]
    };
    let measured = row("measured at the lock", lock.sigma, lock.c, lock.b);
    let exact = found.exact.iter();
    let exact = exact.map(|one| row("exact orbit", one.sigma, one.c, Some(one.b)));
    let theory = found.theory.iter();
    let theory = theory.map(|one| row("theory, first order", one.sigma, one.c, Some(one.b)));
    let table = Table::new(["", "sigma", "C", "B"])
        .rows([measured])
        .rows(exact)
        .rows(theory);
    let alone = found.exact.is_none() && found.theory.is_none();
    let note = if alone {
        "  (theory and exact orbits are for phase resonance, -90 degrees; there is none to compare with)\n"
    } else {
        ""
    };
    format!(
        "{}, G = {:.4}\nLocked after {:.0} periods: {}, {}, phase error {:.1e} degrees\n\n{}{note}\n{}\n{}\n",
        rig(&found.parameters),
        lock.g,
        lock.periods_to_lock,
        lock.regime,
        lock.impacts(),
        lock.phase_error_deg,
        table.text(),
        decay(found),
        agreement(found)
    )
}

fn decay(found: &Comparison) -> String {
    let (Some(first), Some(last)) = (found.decay.first(), found.decay.last()) else {
        return "Free decay: no points".into();
    };
    let end = if found.lock.impacts_per_period.is_nan() {
        "where the backbone folds"
    } else {
        "where the impacts lose synchrony"
    };
    format!(
        "Free decay: {} points from C = {:.4} down to {:.4}, {end}",
        found.decay.len(),
        first.point.c,
        last.point.c
    )
}

fn agreement(found: &Comparison) -> String {
    match found.rms_sigma_error {
        Some(rms) => format!(
            "RMS of sigma against theory over C > {COMPARED_ABOVE}: {rms:.4} (theory is of first order in epsilon)"
        ),
        None => format!("No point of the decay lies above C = {COMPARED_ABOVE}"),
    }
}

/// The points of a tracked backbone, and what they cost.
#[must_use]
pub fn tracked(found: &TrackedComparison) -> String {
    let rows = found.points.iter().map(|TrackedPoint { point, exact }| {
        let regime = match point.regime_by_impacts {
            Some(by_impacts) => format!("{} / {by_impacts}", point.regime),
            None => point.regime.to_string(),
        };
        let settled = if point.settled { "" } else { "; not settled" };
        let mut cells = [point.c, point.sigma, point.g].map(number).to_vec();
        cells.extend([
            format!("{:.1}", point.periods),
            point.averaged.to_string(),
            exact.map_or("-".into(), |exact| format!("{:.1e}", exact.nearest)),
            regime + settled,
        ]);
        cells
    });
    let table = Table::new([
        "C",
        "sigma",
        "G",
        "periods",
        "averaged",
        "distance",
        "regime by response / by impacts",
    ])
    .rows(rows);
    let worst = found.worst().map_or(String::new(), |worst| {
        format!(
            "Largest distance from the exact backbone (largest of the differences in C, sigma and G): {worst:.1e}\n"
        )
    });
    format!(
        "{}\n\n{}\n{} points in {:.0} periods, {:.1} of which before the loop held the response: {:.1} periods per point\n{worst}",
        rig(&found.parameters),
        table.text(),
        found.points.len(),
        found.periods,
        found.periods_to_lock,
        found.periods_per_point()
    )
}
