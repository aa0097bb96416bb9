//! Numbers from the environment, and random ones.
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
