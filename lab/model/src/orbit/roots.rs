//! Small root finders.

/// Roots of `a x^2 + b x + c`, without cancellation; each is a continuous function of the coefficients, also through
/// `a = 0`, where one of them becomes infinite.
pub(super) fn quadratic(a: f64, b: f64, c: f64) -> Option<[f64; 2]> {
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

/// The point where `f` changes sign in [a, b], to the last bit; `f` may be NaN nowhere in between.
pub(super) fn bisect(mut a: f64, mut b: f64, f: impl Fn(f64) -> bool) -> (f64, f64) {
    let at_a = f(a);
    loop {
        let middle = a + (b - a) / 2.0;
        if middle <= a.min(b) || middle >= a.max(b) {
            return (a, b);
        }
        if f(middle) == at_a {
            a = middle
        } else {
            b = middle
        }
    }
}

/// Where the minimum of `f` over [a, b] lies, by golden-section search.
pub(super) fn minimum(mut a: f64, mut b: f64, f: impl Fn(f64) -> f64) -> f64 {
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
mod tests {
    use super::*;

    #[test]
    fn a_small_root_beside_a_large_one_keeps_its_digits() {
        let [large, small] = quadratic(1e-12, 1.0, -1.0).unwrap();
        assert!((small - (1.0 - 1e-12)).abs() < 1e-15);
        assert!((large + 1e12).abs() < 2.0);
    }

    #[test]
    fn both_roots_are_continuous_where_the_linear_coefficient_changes_sign() {
        let above = quadratic(1.0, 1e-9, -1.0).unwrap();
        let below = quadratic(1.0, -1e-9, -1.0).unwrap();
        assert!((above[0] - below[0]).abs() < 1e-8 && (above[1] - below[1]).abs() < 1e-8);
    }

    #[test]
    fn bisection_ends_between_neighbouring_numbers() {
        let (a, b) = bisect(1.0, 2.0, |x| x * x > 2.0);
        assert!(a * a <= 2.0 && b * b > 2.0 && b - a < 3e-16);
    }

    #[test]
    fn the_minimum_of_a_parabola_is_found() {
        assert!((minimum(-1.0, 2.0, |x| (x - 0.3).powi(2)) - 0.3).abs() < 1e-7);
    }
}
