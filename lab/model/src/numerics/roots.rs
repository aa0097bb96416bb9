//! Roots and minima of functions of one variable.

use std::convert::Infallible;

/// Roots of `a x^2 + b x + c`, without cancellation; each is a continuous function of the coefficients, also through
/// `a = 0`, where one of them becomes infinite.
pub fn quadratic(a: f64, b: f64, c: f64) -> Option<[f64; 2]> {
    let discriminant = b * b - 4.0 * a * c;
    if discriminant.is_nan() || discriminant < 0.0 {
        return None;
    }
    let root = discriminant.sqrt();
    if b >= 0.0 {
        let q = -(b + root) / 2.0;
        Some([q / a, c / q])
    } else {
        let q = (root - b) / 2.0;
        Some([c / q, q / a])
    }
}

/// Neighbouring doubles between `a` and `b` at which `f` differs; the first keeps the value that `f` has at `a`.
pub fn bisection(a: f64, b: f64, mut f: impl FnMut(f64) -> bool) -> (f64, f64) {
    let at_a = f(a);
    let Ok(ends) = try_bisection(a, b, 0.0, |x| Ok::<_, Infallible>(f(x) == at_a));
    ends
}

/// Ends of an interval, at most `width` wide or of neighbouring doubles, at which `like_a` changes; it is true at `a`.
pub fn try_bisection<E>(
    mut a: f64,
    mut b: f64,
    width: f64,
    mut like_a: impl FnMut(f64) -> Result<bool, E>,
) -> Result<(f64, f64), E> {
    while (b - a).abs() > width {
        let middle = a + (b - a) / 2.0;
        if middle <= a.min(b) || middle >= a.max(b) {
            break;
        }
        if like_a(middle)? {
            a = middle;
        } else {
            b = middle;
        }
    }
    Ok((a, b))
}

/// Minimum of `f` between `a` and `b` by golden-section search; `f` has one minimum there.
pub fn golden_section(mut a: f64, mut b: f64, f: impl Fn(f64) -> f64) -> f64 {
    let ratio = (5f64.sqrt() - 1.0) / 2.0;
    let (mut x, mut y) = (b - ratio * (b - a), a + ratio * (b - a));
    let (mut fx, mut fy) = (f(x), f(y));
    // 60 steps shrink the interval by 3e-13: beyond that a minimum is flat in doubles.
    for _ in 0..60 {
        if fx <= fy {
            (b, y, fy) = (y, x, fx);
            x = b - ratio * (b - a);
            fx = f(x);
        } else {
            (a, x, fx) = (x, y, fy);
            y = a + ratio * (b - a);
            fy = f(y);
        }
    }
    a + (b - a) / 2.0
}

#[cfg(test)]
#[path = "../../tests/unit/roots.rs"]
mod tests;
