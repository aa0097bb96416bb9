//! The short table of an identification.

use crate::comparison::{COMPARED_ABOVE, Comparison};

/// The result in a few lines: the locked point beside theory and exact orbit, then the decay.
#[must_use]
pub fn table(found: &Comparison) -> String {
    let (p, lock) = (&found.parameters, &found.lock);
    let mut lines = vec![
        format!(
            "epsilon = {:.6}, lambda = {:.4}, r = {}, G = {:.4}",
            p.epsilon, p.lambda, p.r, lock.g
        ),
        format!(
            "Locked after {:.0} periods: {}, {}, phase error {:.1e} degrees",
            lock.periods_to_lock,
            lock.regime,
            lock.impacts(),
            lock.phase_error_deg
        ),
        String::new(),
        format!("  {:<24}{:>12}{:>12}{:>12}", "", "sigma", "C", "B"),
    ];
    let mut row = |name: &str, sigma: f64, c: f64, b: Option<f64>| {
        let b = b.map_or("-".into(), |b| format!("{b:.6}"));
        lines.push(format!("  {name:<24}{sigma:>12.6}{c:>12.6}{b:>12}"));
    };
    row("measured at the lock", lock.sigma, lock.c, lock.b);
    if let Some(exact) = &found.exact {
        row("exact orbit", exact.sigma, exact.c, Some(exact.b));
    }
    if let Some(theory) = &found.theory {
        row(
            "theory, first order",
            theory.sigma,
            theory.c,
            Some(theory.b),
        );
    }
    if found.exact.is_none() && found.theory.is_none() {
        lines.push("  (neither theory nor exact orbit to compare with: they are for phase resonance, -90 degrees)".into());
    }
    lines.push(String::new());
    if let (Some(first), Some(last)) = (found.decay.first(), found.decay.last()) {
        lines.push(format!(
            "Free decay: {} points from C = {:.4} down to {:.4}, {}",
            found.decay.len(),
            first.point.c,
            last.point.c,
            if lock.impacts_per_period.is_nan() {
                "where the backbone folds"
            } else {
                "where the impacts lose synchrony"
            }
        ));
    }
    lines.push(match found.rms_sigma_error {
        Some(rms) => format!(
            "RMS of sigma against theory over C > {COMPARED_ABOVE}: {rms:.4} (theory is of first order in epsilon)"
        ),
        None => format!("No point of the decay lies above C = {COMPARED_ABOVE}"),
    });
    lines.join("\n") + "\n"
}
