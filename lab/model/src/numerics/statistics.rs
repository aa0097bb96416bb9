//! Statistics of samples.

/// Arithmetic mean; NaN for no values.
pub fn mean(values: impl IntoIterator<Item = f64>) -> f64 {
    let (mut sum, mut count) = (0.0, 0_usize);
    for value in values {
        sum += value;
        count += 1;
    }
    sum / count as f64
}

/// Mean of the squares; NaN for no values.
pub fn mean_square(values: impl IntoIterator<Item = f64>) -> f64 {
    mean(values.into_iter().map(|value| value * value))
}

/// Standard deviation of the values themselves (divided by n), not of a population they stand for; NaN for no values.
pub fn standard_deviation(values: &[f64]) -> f64 {
    let mean = mean(values.iter().copied());
    mean_square(values.iter().map(|value| value - mean)).sqrt()
}

/// Smallest and largest of `start` and the values.
pub fn range(start: (f64, f64), values: impl IntoIterator<Item = f64>) -> (f64, f64) {
    values
        .into_iter()
        .fold(start, |(low, high), value| (low.min(value), high.max(value)))
}

/// `count` values from `from` to `to` at equal distances, both ends included.
pub fn equally_spaced(from: f64, to: f64, count: usize) -> impl Iterator<Item = f64> + Clone {
    let steps = count.saturating_sub(1).max(1) as f64;
    (0..count).map(move |n| from + (to - from) * n as f64 / steps)
}

/// Standard deviation of the white noise on a smooth signal, from third differences; 0 for fewer than six values.
pub fn noise(values: &[f64]) -> f64 {
    let differences = values.windows(4).map(|v| v[3] - 3.0 * v[2] + 3.0 * v[1] - v[0]);
    if differences.len() < 3 {
        return 0.0;
    }
    // White noise of variance 1 gives them the variance 1 + 9 + 9 + 1.
    (mean_square(differences) / 20.0).sqrt()
}

/// Slope of the straight line that fits equally spaced values best, from a value to the next.
pub fn slope(values: &[f64]) -> f64 {
    let n = values.len() as f64;
    let middle = 0.5 * (n - 1.0);
    let mean = mean(values.iter().copied());
    let spread = n * (n * n - 1.0) / 12.0;
    let moment = |(i, value): (usize, &f64)| (i as f64 - middle) * (value - mean);
    values.iter().enumerate().map(moment).sum::<f64>() / spread
}

#[cfg(test)]
#[path = "../../tests/unit/statistics.rs"]
mod tests;
