//! What the tests share: numbers from the environment, random numbers, and comparisons.
#![allow(dead_code, reason = "each test file uses its own part")]

use rand_chacha::{ChaCha8Rng, rand_core::Rng};

/// The number in the environment variable `name`.
pub fn setting(name: &str, default: u64) -> u64 {
    std::env::var(name).map_or(default, |text| {
        text.parse().unwrap_or_else(|_| panic!("{name}: a number"))
    })
}

/// A random number in a range.
pub fn within(random: &mut ChaCha8Rng, [low, high]: [f64; 2]) -> f64 {
    low + (high - low) * (random.next_u64() as f64 / u64::MAX as f64)
}

/// Requires that two numbers differ by at most `tolerance`, relative to a number above 1.
#[track_caller]
pub fn close(one: f64, other: f64, tolerance: f64) {
    let size = 1f64.max(one.abs());
    assert!((one - other).abs() <= tolerance * size, "{one} and {other}");
}
