//! Real roots of a polynomial: between two turning points there is at most one, so its derivative brackets them all.

use crate::numerics::bisection;

/// All real roots, ascending; coefficients by rising power. A double root counts once.
pub(super) fn real_roots(coefficients: &[f64]) -> Vec<f64> {
    let Some(degree) = coefficients.iter().rposition(|one| *one != 0.0) else {
        return Vec::new();
    };
    if degree == 0 {
        return Vec::new();
    }
    let coefficients = &coefficients[..=degree];
    let derivative: Vec<f64> = coefficients
        .iter()
        .enumerate()
        .skip(1)
        .map(|(power, one)| power as f64 * one)
        .collect();
    // Cauchy's bound: no root is larger.
    let leading = coefficients[degree].abs();
    let bound = 1.0 + coefficients.iter().fold(0f64, |most, one| most.max(one.abs())) / leading;

    let mut ends = vec![-bound];
    ends.extend(real_roots(&derivative));
    ends.push(bound);
    let mut roots: Vec<f64> = ends
        .windows(2)
        .filter_map(|pair| root_between(coefficients, pair[0], pair[1]))
        .collect();
    // A turning point that touches zero to within rounding.
    let touches = |x: &f64| {
        let size = coefficients
            .iter()
            .rev()
            .fold(0.0, |sum, one| sum * x.abs() + one.abs());
        value(coefficients, *x).abs() <= 8.0 * f64::EPSILON * size
    };
    roots.extend(ends[1..ends.len() - 1].iter().copied().filter(touches));
    roots.sort_by(f64::total_cmp);
    roots.dedup_by(|one, other| (*one - *other).abs() <= 1e-7 * (1.0 + other.abs()));
    roots
}

fn value(coefficients: &[f64], x: f64) -> f64 {
    coefficients.iter().rev().fold(0.0, |sum, one| sum * x + one)
}

/// The root between `a` and `b`, if the sign changes.
fn root_between(coefficients: &[f64], a: f64, b: f64) -> Option<f64> {
    let positive = |x| value(coefficients, x) > 0.0;
    (positive(a) != positive(b)).then(|| midpoint(bisection(a, b, positive)))
}

/// Rounds to one of two neighbouring doubles.
fn midpoint((a, b): (f64, f64)) -> f64 {
    a + (b - a) / 2.0
}

#[cfg(test)]
#[path = "../../tests/unit/polynomial.rs"]
mod tests;
